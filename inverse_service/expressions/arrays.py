"""Evaluate trees in floating point, at one point or at many at once: a name is a number or an array
of numbers.
"""

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from mpmath import fp
from numpy.typing import NDArray

from inverse_service import errors
from inverse_service.expressions import functions, tree as ex

Array = NDArray[np.float64]


class NoValue(errors.InputError):
    """A formula contains a name without a value."""

    code = "no-value"


def array_value(expression: ex.Expression, table: Mapping[ex.Expression, Any]) -> Array:
    """The formula at every row of the table, as (m,); nan or infinite where it has no real value.

    Raises NoValue for a name or an arbitrary function that the table does not hold.
    """
    return array_values([expression], table)[0]


def array_values(
    expressions: Sequence[ex.Expression], table: Mapping[ex.Expression, Any]
) -> list[Array]:
    """The values of several formulas; common subexpressions are computed once."""
    sizes = [np.shape(value) for value in table.values() if np.ndim(value)]
    known = dict(table)
    with np.errstate(all="ignore"):
        found = [np.asarray(_value(one, known), dtype=float) for one in expressions]
    return [np.broadcast_to(one, sizes[0] if sizes else (1,)) for one in found]


def special_values(function: str, *arguments: Any) -> Array:
    """A special function of (its order and) its argument in double precision, by mpmath; nan where
    it has no real value.
    """
    operation = getattr(fp, functions.FUNCTION[function].mpmath or function)

    def value(*inner: float) -> float:
        try:
            found = operation(*inner)
        except (ValueError, ZeroDivisionError, OverflowError):
            return math.nan
        return math.nan if isinstance(found, complex) else float(found)

    return np.asarray(np.vectorize(value, otypes=[float])(*arguments))


def _value(expression: ex.Expression, known: dict[ex.Expression, Any]) -> Any:
    if expression in known:
        return known[expression]
    found: Any
    match expression:
        case ex.Number(value):
            found = float(value)
        case ex.Sum(terms):
            found = sum(_value(term, known) for term in terms)
        case ex.Product(factors):
            found = math.prod(_value(factor, known) for factor in factors)
        case ex.Power(base, ex.Number(value)) if value.denominator == 1 and abs(value) <= 8:
            found = np.asarray(_value(base, known), dtype=float) ** abs(int(value))
            found = found if value >= 0 else 1 / found
        case ex.Power(base, ex.Number(value)) if abs(value) == Fraction(1, 2):
            found = np.sqrt(_value(base, known))
            found = found if value > 0 else 1 / found
        case ex.Power(base, exponent):
            found = np.power(np.asarray(_value(base, known), dtype=float), _value(exponent, known))
        case ex.Apply(function) if function in functions.SPECIAL:
            inner = functions.arguments_of(expression)[::-1]  # the order first
            found = special_values(function, *(_value(part, known) for part in inner))
        case ex.Apply(function, argument):
            below, inner = functions.RECIPROCALS.get(function), _value(argument, known)
            found = (
                np.heaviside(inner, np.nan)
                if function == functions.STEP
                else getattr(np, below or function)(inner)
            )
            found = 1 / found if below else found
        case _ if expression == ex.PI:
            found = np.pi
        case _:
            raise NoValue(
                f"a formula has no value here: {getattr(expression, 'name', 'a name')} is not given."
            )
    known[expression] = found
    return found
