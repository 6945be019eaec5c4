"""Texts of results as SymPy expressions, read by our own grammar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import sympy

from inverse_service.expressions.reader import read_formula
from inverse_service.sympy.names import Table
from inverse_service.sympy.trees import to_sympy

_RELATIONS = ((" >= ", sympy.Ge), (" <= ", sympy.Le), (" != ", sympy.Ne), (" > ", sympy.Gt), (" < ", sympy.Lt))


def expression(text: str, table: Table) -> Any:
    """A formula of a result."""
    return to_sympy(read_formula(text, table.of_formulas()), table)


def with_integrals(table: Table, integrals: Mapping[str, Any]) -> Table:
    """The table with a function F(x) for each integral of an answer; SymPy differentiates it to what is known."""
    arguments = {name: tuple(part["arguments"]) for name, part in integrals.items()}
    functions = {name: _integral(name, part, arguments[name], table) for name, part in integrals.items()}
    return replace(table, functions={**table.functions, **functions}, arguments={**table.arguments, **arguments})


def _integral(name: str, part: Mapping[str, Any], arguments: tuple[str, ...], table: Table) -> Any:
    """The class of a function that is known by its derivatives."""

    def fdiff(self: Any, argindex: int = 1) -> Any:
        slope = part["derivatives"].get(arguments[argindex - 1])
        if slope is None:
            return sympy.Function.fdiff(self, argindex)
        formal = [table.symbol(argument) for argument in arguments]
        return expression(slope, table).subs(dict(zip(formal, self.args, strict=True)), simultaneous=True)

    return type(name, (sympy.Function,), {"fdiff": fdiff, "nargs": len(arguments)})


def relation(text: str, table: Table) -> Any:
    """A condition such as x' != 0; the whole text as a symbol where it is a sentence."""
    for sign, kind in _RELATIONS:
        left, found, right = text.partition(sign)
        if found:
            return kind(expression(left, table), expression(right, table))
    return sympy.Symbol(text)
