"""Trees as SymPy expressions, built node by node; no text is ever parsed by SymPy."""

from __future__ import annotations

from typing import Any

import sympy

from inverse_service.expressions.tree import (
    ELEMENTARY,
    PI,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
)

SympyExpression = Any  # SymPy has no types

_FUNCTIONS = {name: getattr(sympy, name) for name in (*ELEMENTARY, "Heaviside")}


def to_sympy(expression: Expression) -> SympyExpression:
    """The same formula; the velocity of x is the symbol named x'.

    ValueError for an acceleration, and for a derivative of an arbitrary function of anything but
    symbols (the documents of the contract have none).
    """
    match expression:
        case Number(value):
            return sympy.Rational(value.numerator, value.denominator)
        case Symbol(name):
            return sympy.pi if expression == PI else sympy.Symbol(name)
        case Velocity(coordinate):
            return velocity(coordinate)
        case Sum(terms):
            return sympy.Add(*map(to_sympy, terms))
        case Product(factors):
            return sympy.Mul(*map(to_sympy, factors))
        case Power(base, exponent):
            return to_sympy(base) ** to_sympy(exponent)
        case Apply(function, argument):
            return _FUNCTIONS[function](to_sympy(argument))
        case Arbitrary():
            return _arbitrary(expression)
    raise ValueError("an acceleration has no place in a right-hand side")


def velocity(coordinate: str) -> SympyExpression:
    """The symbol of a velocity."""
    return sympy.Symbol(coordinate + "'")


def _arbitrary(expression: Arbitrary) -> SympyExpression:
    arguments = [to_sympy(argument) for argument in expression.arguments]
    whole = sympy.Function(expression.name)(*arguments)
    for argument, order in zip(arguments, expression.orders, strict=True):
        if order and not argument.is_Symbol:
            raise ValueError(f"a derivative of {expression.name} at something that is not a symbol")
        whole = whole.diff(argument, order) if order else whole
    return whole
