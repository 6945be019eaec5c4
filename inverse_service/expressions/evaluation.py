"""Evaluate trees at a point in real arithmetic of any precision."""

from collections.abc import Callable, Mapping
from functools import reduce
from operator import mul
from typing import Any

from mpmath import mp, mpf

from inverse_service import errors
from inverse_service.expressions import pieces, tree as ex

Real = Any  # mpmath has no types
_NAMES = {"log": "ln"}


class NoRealValue(errors.InverseServiceError):
    """The tree has no finite real value at the point; it may have one at another point."""

    code = "no-real-value"


def evaluate(expression: ex.Expression, table: Mapping[ex.Expression, Real]) -> Real:
    """The value in mpmath's working precision.

    `table` maps Symbol, Velocity, Acceleration, and complete Arbitrary nodes (with arguments and orders) to values.
    NoRealValue if a node is missing or has no finite real value.
    """
    return evaluate_once(expression, dict(table))


def evaluate_once(expression: ex.Expression, table: dict[ex.Expression, Real]) -> Real:
    """Like `evaluate`, but store every value in the table, so that trees with common parts share work."""
    known = table.get(expression)
    if known is not None:
        return known
    try:
        value = _value(expression, table)
    except (ZeroDivisionError, ValueError, OverflowError) as error:
        raise NoRealValue(f"a formula has no real value at a point: {error}") from error
    if not isinstance(value, mpf) or not mp.isfinite(value):
        raise NoRealValue("a formula has no finite real value at a point")
    table[expression] = value
    return value


def _value(expression: ex.Expression, table: dict[ex.Expression, Real]) -> Real:
    match expression:
        case ex.Number(value):
            return mpf(value.numerator) if value.denominator == 1 else mpf(value.numerator) / value.denominator
        case ex.Sum(terms):
            values = [evaluate_once(term, table) for term in terms]
            return values[0] + values[1] if len(values) == 2 else mp.fsum(values)  # twice as fast as fsum
        case ex.Product(factors):
            return reduce(mul, [evaluate_once(factor, table) for factor in factors])
        case ex.Power(base, ex.Number(value)) if value.denominator == 1:
            return evaluate_once(base, table) ** value.numerator
        case ex.Power(base, exponent):
            return mp.power(evaluate_once(base, table), evaluate_once(exponent, table))
        case ex.Apply(function, argument) if function == pieces.STEP:
            value = evaluate_once(argument, table)
            if value == 0:
                raise NoRealValue("a step has no value on its boundary")
            return mpf(value > 0)
        case ex.Apply(function, argument):
            operation: Callable[[Real], Real] = getattr(mp, _NAMES.get(function, function))
            return operation(evaluate_once(argument, table))
        case ex.Arbitrary(name, _, _):
            raise NoRealValue(f"no value is given for the function {name}")
        case _ if expression == ex.PI:
            return +mp.pi
        case _:
            raise NoRealValue(f"no value is given for {expression}")
