"""Bounds of formulas on straight ways: interval arithmetic, and straight lines with a bound of the rest.

R. E. Moore, R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis, SIAM 2009.

A bound holds for every point of the box, so that nothing in it is missed, however narrow. Roundings are not directed:
bounds are good to a few units of round-off, far below what they are compared with.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from inverse_service.expressions.functions import RECIPROCALS
from inverse_service.expressions.tree import Apply, Expression, Number, Power, Product, Sum
from inverse_service.integrators.trajectory import Array
from inverse_service.simulation.array_values import array_function, array_value

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
        known[expression] = _computed(expression, known)
    return known[expression]


def _computed(expression: Expression, known: Known) -> tuple[Box, Line]:
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
            box = _power(inside[0], exponent, known)
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


def _power(box: Box, exponent: Expression, known: Known) -> Box:
    if isinstance(exponent, Number) and exponent.value < 0:
        return _reciprocal(_power(box, Number(-exponent.value), known))
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
