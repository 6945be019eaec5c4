"""Texts of results as SymPy expressions, read by our own grammar."""

from __future__ import annotations

from typing import Any

import sympy

from inverse_service.expressions.reader import read_formula
from inverse_service.sympy.names import Table
from inverse_service.sympy.trees import to_sympy

_RELATIONS = ((" >= ", sympy.Ge), (" <= ", sympy.Le), (" != ", sympy.Ne), (" > ", sympy.Gt), (" < ", sympy.Lt))


def expression(text: str, table: Table) -> Any:
    """A formula of a result."""
    return to_sympy(read_formula(text, table.of_formulas()), table)


def relation(text: str, table: Table) -> Any:
    """A condition such as x' != 0; the whole text as a symbol where it is a sentence."""
    for sign, kind in _RELATIONS:
        left, found, right = text.partition(sign)
        if found:
            return kind(expression(left, table), expression(right, table))
    return sympy.Symbol(text)
