"""The values of formulas along a trajectory: one numpy operation for each node of the tree.

Below, bounds of formulas on straight ways: interval arithmetic, and straight lines with a bound of the rest.

R. E. Moore, R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis, SIAM 2009.

A bound holds for every point of the box, so that nothing in it is missed, however narrow. Roundings are not directed:
bounds are good to a few units of round-off, far below what they are compared with.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from inverse_service.errors import InputError
from inverse_service.expressions.functions import RECIPROCALS
from inverse_service.expressions.tree import (
    PI,
    TIME,
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
)
from inverse_service.integrators.trajectory import Array

# NumPy's names, where they are not ours.
_NUMPY = {name: f"arc{name[1:]}" for name in ("asin", "acos", "atan", "asinh", "acosh", "atanh")}


def array_function(name: str, values: Any) -> Any:
    below = RECIPROCALS.get(name)
    return 1 / array_function(below, values) if below else getattr(np, _NUMPY.get(name, name))(values)


class NoValue(InputError):
    """A formula holds a name that was given no value."""

    code = "no-value"


def table_of(
    coordinates: tuple[str, ...],
    positions: Array,
    velocities: Array | None,
    values: Mapping[str, float | Array],
    times: Array | None = None,
) -> dict[Expression, Any]:
    """Names to arrays: `positions` and `velocities` are (m, n), each column a coordinate; parameters numbers or (m,).

    `times` (m,) are values of t; left out, t is 0, as at the start.
    """
    table: dict[Expression, Any] = {TIME: 0.0 if times is None else times}
    table |= {Symbol(name): value for name, value in values.items()}
    table |= {Symbol(name): positions[:, k] for k, name in enumerate(coordinates)}
    if velocities is not None:
        table |= {Velocity(name): velocities[:, k] for k, name in enumerate(coordinates)}
    return table


def array_value(expression: Expression, table: Mapping[Expression, Any]) -> Array:
    """The formula at every row of the table, as (m,); nan or infinite where it has no real value.

    Raises NoValue for a name or an arbitrary function that the table does not hold.
    """
    sizes = [np.shape(value) for value in table.values() if np.ndim(value)]
    with np.errstate(all="ignore"):
        value = _value(expression, dict(table))
    return np.broadcast_to(np.asarray(value, dtype=float), sizes[0] if sizes else (1,))


def _value(expression: Expression, known: dict[Expression, Any]) -> Any:
    if expression not in known:
        known[expression] = _computed(expression, known)
    return known[expression]


def _computed(expression: Expression, known: dict[Expression, Any]) -> Any:
    match expression:
        case Number(value):
            return float(value)
        case Sum(terms):
            return sum(_value(term, known) for term in terms)
        case Product(factors):
            product: Any = 1.0
            for factor in factors:
                product = product * _value(factor, known)
            return product
        case Power(base, exponent):
            return _power(_value(base, known), exponent, known)
        case Apply(function, argument):
            return array_function(function, _value(argument, known))
        case _ if expression == PI:
            return np.pi
        case _:
            raise NoValue(f"a formula has no value here: {getattr(expression, 'name', 'a name')} is not given.")


def _power(base: Any, exponent: Expression, known: dict[Expression, Any]) -> Any:
    if isinstance(exponent, Number) and exponent.value.denominator == 1 and abs(exponent.value) <= 8:
        whole = int(exponent.value)
        product = np.asarray(base, dtype=float) ** abs(whole)
        return product if whole >= 0 else 1 / product
    if isinstance(exponent, Number) and exponent.value.denominator == 2 and abs(exponent.value.numerator) == 1:
        root = np.sqrt(base)
        return root if exponent.value > 0 else 1 / root
    return np.power(np.asarray(base, dtype=float), _value(exponent, known))


Box = tuple[Array, Array]  # least and greatest values, (m,)
_FALLING = ("acos",)
_DOMAINS = {"log": (0.0, np.inf), "acosh": (1.0, np.inf)} | dict.fromkeys(("asin", "acos", "atanh"), (-1.0, 1.0))
_MOST_FACTORS = 8


class Line(NamedTuple):
    """A straight line through each box, middle + slope s for s in [-1, 1], and bounds of the rest: with them the square
    of x - c is as narrow multiplied out as it is written."""

    middle: Array
    slope: Array
    rest: Box


Known = dict[Expression, tuple[Box, Line]]


def bounds(expression: Expression, ends: Mapping[Expression, Box]) -> Box:
    """The least and the greatest value on the straight way from one end to the other, of all names together, (m,);
    infinite where none is known, as at a pole."""
    with np.errstate(all="ignore"):
        lines = {name: ((a + b) / 2, (b - a) / 2) for name, (a, b) in ends.items()}
        zero = np.zeros(1)
        known = {name: (_range(Line(*line, (zero, zero))), Line(*line, (zero, zero))) for name, line in lines.items()}
        low, high = _bounds(expression, known)[0]
    return np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)


def _range(line: Line) -> Box:
    size = np.abs(line.slope)
    return line.middle - size + line.rest[0], line.middle + size + line.rest[1]


def _bounds(expression: Expression, known: Known) -> tuple[Box, Line]:
    if expression not in known:
        known[expression] = _bounded(expression, known)
    return known[expression]


def _bounded(expression: Expression, known: Known) -> tuple[Box, Line]:
    match expression:
        case Sum(terms):
            parts = [_bounds(term, known) for term in terms]
            box = _sum([part[0] for part in parts])
            lines = [part[1] for part in parts]
            middle, slope = (np.asarray(sum(column)) for column in list(zip(*lines, strict=True))[:2])
            return _both(box, Line(middle, slope, _sum([line.rest for line in lines])))
        case Product(factors):
            return _multiplied([_bounds(factor, known) for factor in factors])
        case Power(base, exponent):
            inside = _bounds(base, known)
            box = _raised(inside[0], exponent, known)
            if isinstance(exponent, Number) and exponent.value in range(2, _MOST_FACTORS + 1):
                return _both(box, _multiplied([inside] * int(exponent.value))[1])
            return _flat(box)
        case Apply(function, argument):
            return _flat(_function(function, _bounds(argument, known)[0]))
        case _:
            value = array_value(expression, {})  # numbers; a name that is not given is refused there
            return _flat((value, value))


def _flat(box: Box) -> tuple[Box, Line]:
    middle = np.where(np.isfinite(box[0]) & np.isfinite(box[1]), (box[0] + box[1]) / 2, 0.0)
    return box, Line(middle, np.zeros(1), (box[0] - middle, box[1] - middle))


def _both(box: Box, line: Line) -> tuple[Box, Line]:
    """What both bounds leave; nan stands for none."""
    low, high = _range(line)
    return (np.fmax(box[0], low), np.fmin(box[1], high)), line


def _sum(boxes: Sequence[Box]) -> Box:
    return np.asarray(sum(low for low, _ in boxes)), np.asarray(sum(high for _, high in boxes))


def _multiplied(factors: Sequence[tuple[Box, Line]]) -> tuple[Box, Line]:
    box, line = factors[0]
    for other, second in factors[1:]:
        box = _product(box, other)
        squares = line.slope * second.slope
        zero = np.zeros(1)
        straight = _range(Line(line.middle, line.slope, (zero, zero)))
        rest = _sum([(np.minimum(squares, 0.0), np.maximum(squares, 0.0)), _product(line.rest, _range(second)),
                     _product(second.rest, straight)])  # fmt: skip
        slope = line.middle * second.slope + line.slope * second.middle
        box, line = _both(box, Line(line.middle * second.middle, slope, rest))
    return box, line


def _product(a: Box, b: Box) -> Box:
    corners = np.broadcast_arrays(*(np.nan_to_num(x * y, nan=0.0, posinf=np.inf, neginf=-np.inf) for x in a for y in b))
    return np.minimum.reduce(corners), np.maximum.reduce(corners)


def _reciprocal(box: Box) -> Box:
    low, high = box
    through = (low <= 0) & (high >= 0)
    return np.where(through, -np.inf, 1 / high), np.where(through, np.inf, 1 / low)


def _raised(box: Box, exponent: Expression, known: Known) -> Box:
    if isinstance(exponent, Number) and exponent.value < 0:
        return _reciprocal(_raised(box, Number(-exponent.value), known))
    low, high = box
    if isinstance(exponent, Number) and exponent.value.denominator == 1:
        count = int(exponent.value)
        return _even(box, lambda x: x**count) if count % 2 == 0 else (low**count, high**count)
    low = np.maximum(low, 0.0)  # a root is real from there on
    if isinstance(exponent, Number):
        return low ** float(exponent.value), high ** float(exponent.value)
    return _function("exp", _product(_bounds(exponent, known)[0], (np.log(low), np.log(high))))


def _even(box: Box, value: object) -> Box:
    """An even function that grows with |x|."""
    assert callable(value)
    low, high = box
    near = np.where((low <= 0) & (high >= 0), 0.0, np.minimum(np.abs(low), np.abs(high)))
    return value(near), value(np.maximum(np.abs(low), np.abs(high)))


def _function(name: str, box: Box) -> Box:
    below = RECIPROCALS.get(name)
    if below:
        return _reciprocal(_function(below, box))
    low, high = box
    if name == "cosh":
        return _even(box, np.cosh)
    if name in ("sin", "cos"):
        return _wave(low, high, array_function(name, low), array_function(name, high), 0.25 * (name == "sin"))
    if name == "tan":
        pole = np.floor(low / np.pi + 0.5) != np.floor(high / np.pi + 0.5)
        return np.where(pole, -np.inf, np.tan(low)), np.where(pole, np.inf, np.tan(high))
    least, greatest = _DOMAINS.get(name, (-np.inf, np.inf))
    ends = array_function(name, np.clip(low, least, greatest)), array_function(name, np.clip(high, least, greatest))
    return (ends[1], ends[0]) if name in _FALLING else ends


def _wave(low: Array, high: Array, first: Array, last: Array, shift: float) -> Box:
    """A cosine later by `shift` of its period, from its values at the ends: those of a small angle keep its digits."""
    a, b = low / (2 * np.pi) - shift, high / (2 * np.pi) - shift
    top, bottom = np.ceil(a) <= np.floor(b), np.ceil(a - 0.5) <= np.floor(b - 0.5)
    return np.where(bottom, -1.0, np.minimum(first, last)), np.where(top, 1.0, np.maximum(first, last))
