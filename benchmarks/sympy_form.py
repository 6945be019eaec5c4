"""Convert trees to SymPy expressions in which velocities are separate symbols."""

from __future__ import annotations

from typing import Any

import sympy

from inverse_service.expressions.tree import Expression
from inverse_service.sympy import from_sympy
from inverse_service.sympy.from_sympy import Table

SympyExpression = Any  # SymPy has no types


class _Names(Table):
    """Map every name, also that of a velocity, to a symbol."""

    def velocity(self, name: str) -> SympyExpression:
        return velocity(name)


_NAMES = _Names(sympy.Symbol("t"))


def to_sympy(expression: Expression) -> SympyExpression:
    """The same formula; the velocity of x is the symbol named x'. Raises KeyError for an
    acceleration.
    """
    return from_sympy.to_sympy(expression, _NAMES.leaf)


def velocity(coordinate: str) -> SympyExpression:
    """The symbol of a velocity."""
    return sympy.Symbol(coordinate + "'")
