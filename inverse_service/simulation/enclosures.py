"""Bounds of a formula along a motion, by interval arithmetic, and what they show between points of
a run.

Between two points the motion is the cubic of Hermite through them; its values, its velocity and its
acceleration lie between their coefficients of Bernstein. A formula f whose bounds exclude 0 has no
zero there; one whose bounds of df/dt exclude 0 has at most one. All other intervals are halved.

Source: R. E. Moore, R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis, 2009.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from inverse_service.expressions import arrays, calculus, functions, tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.simulation import numeric_formulas as nf

Bounds = tuple[Array, Array]  # the least and the greatest value, (m,) each
Table = Mapping[ex.Expression, Bounds]
HALVINGS = 30  # of the distance of two points
MOST_INTERVALS = 2**14  # that are halved at once
NOISE = 1e-12  # of a coordinate
NEXT_TO_ZERO = 1e-6  # of the greatest value of a formula at the points
RISING = ("exp", "log", "sinh", "tanh", "asin", "atan", "asinh", "acosh", "atanh")
LEAST = {"log": 0.0, "asin": -1.0, "acos": -1.0, "acosh": 1.0, "atanh": -1.0}  # where it begins
MOST = {"asin": 1.0, "acos": 1.0, "atanh": 1.0}  # and where it ends


def bounds_of(tree: ex.Expression, table: Table) -> Bounds:
    """Bounds of a formula whose names have these bounds; infinite ones next to a pole, nan where it
    has no value.
    """
    known = dict(table)
    with np.errstate(all="ignore"):
        return _bounds(tree, known)


def _bounds(tree: ex.Expression, known: dict[ex.Expression, Bounds]) -> Bounds:
    if tree in known:
        return known[tree]
    match tree:
        case ex.Number(value):
            found = (np.array(float(value)),) * 2
        case ex.Sum(terms):
            parts = [_bounds(term, known) for term in terms]
            found = sum(low for low, _ in parts), sum(high for _, high in parts)  # type: ignore[assignment]
        case ex.Product(factors):
            found = _bounds(factors[0], known)
            for factor in factors[1:]:
                found = _product(found, _bounds(factor, known))
        case ex.Power(base, ex.Number(value)) if value.denominator == 1:
            found = _whole_power(_bounds(base, known), int(value))
        case ex.Power(base, ex.Number(value)):
            low, high = (
                np.power(np.maximum(end, 0.0), float(abs(value))) for end in _bounds(base, known)
            )
            found = (low, high) if value > 0 else (1 / high, 1 / low)
        case ex.Power(base, exponent):
            found = _bounds(ex.Apply("exp", exponent * ex.Apply("log", base)), known)
        case ex.Apply(function, argument):
            found = _of_function(function, argument, known)
        case _ if tree == ex.PI:
            found = (np.array(np.pi),) * 2
        case _:
            raise arrays.NoValue("A formula has no value here: a name is not given.")
    known[tree] = found
    return found


def _product(left: Bounds, right: Bounds) -> Bounds:
    every = np.stack(np.broadcast_arrays(*(np.nan_to_num(a * b, nan=0.0, posinf=np.inf, neginf=-np.inf)
                                           for a in left for b in right)))  # fmt: skip
    return every.min(axis=0), every.max(axis=0)


def _whole_power(base: Bounds, exponent: int) -> Bounds:
    low, high = base
    size = abs(exponent)
    first, last = low**size, high**size
    if size % 2 == 0:
        first, last = np.minimum(first, last), np.maximum(first, last)
        first = np.where((low < 0) & (high > 0), 0.0, first)
    if exponent > 0:
        return first, last
    through = (first <= 0) & (last >= 0)
    is_even = size % 2 == 0
    inner = np.where(through & (not is_even), -np.inf, 1 / last)
    return inner, np.where(through, np.inf, 1 / first)


def _of_function(
    function: str, argument: ex.Expression, known: dict[ex.Expression, Bounds]
) -> Bounds:
    low, high = _bounds(argument, known)
    if function in LEAST:
        low, high = (np.clip(end, LEAST[function], MOST.get(function)) for end in (low, high))
    if function in RISING:
        return getattr(np, function)(low), getattr(np, function)(high)
    match function:
        case "acos":
            return np.acos(high), np.acos(low)
        case functions.STEP:
            return np.heaviside(low, 0.0), np.heaviside(high, 1.0)
        case "cosh":
            nearest = np.where((low < 0) & (high > 0), 0.0, np.minimum(np.abs(low), np.abs(high)))
            return np.cosh(nearest), np.cosh(np.maximum(np.abs(low), np.abs(high)))
        case "sin":
            return _sine(low, high)
        case "cos":
            return _sine(low + np.pi / 2, high + np.pi / 2)
    if function in functions.SPECIAL:  # nothing is known of its values
        return np.full_like(low, -np.inf), np.full_like(high, np.inf)
    kernel = functions.FUNCTION[function].kernel
    assert kernel is not None
    return _bounds(kernel(argument), known)


def _sine(low: Array, high: Array) -> Bounds:
    """Of sin: 1 and -1 where a top or a bottom lies between."""

    def holds(place: float) -> NDArray[np.bool_]:
        """Whether place + 2 k pi is between, for an integer k."""
        found: NDArray[np.bool_] = np.ceil((low - place) / (2 * np.pi)) <= np.floor(
            (high - place) / (2 * np.pi)
        )
        return found

    first, last = np.sin(low), np.sin(high)
    least, most = np.minimum(first, last), np.maximum(first, last)
    return np.where(holds(-np.pi / 2), -1.0, least), np.where(holds(np.pi / 2), 1.0, most)


def is_plain(formula: ex.Expression, coordinates: Sequence[str]) -> bool:
    """Whether it is linear in the state and in t, so that it changes no faster than the motion
    does.
    """
    moving = {ex.TIME, *nf.state_names(coordinates)}

    def degree(tree: ex.Expression) -> int:
        match tree:
            case ex.Sum(terms):
                return max(map(degree, terms))
            case ex.Product(factors):
                return sum(map(degree, factors))
            case _ if tree in moving:
                return 1
        return 2 if ex.holds(tree, *moving) else 0

    return degree(formula) <= 1


@lru_cache(maxsize=64)
def _rate(formula: ex.Expression, coordinates: tuple[str, ...]) -> ex.Expression:
    """df/dt with Acceleration(x) for x''."""
    names = [(ex.Symbol(x), ex.Velocity(x), ex.Acceleration(x)) for x in coordinates]
    slopes = [calculus.differentiate(formula, q) * v for q, v, _ in names]
    slopes += [calculus.differentiate(formula, v) * a for _, v, a in names]
    return ex.add(calculus.differentiate(formula, ex.TIME), *slopes)


NOT_SHOWN, OFTEN = 0.05, 0.01  # of the way in an interval, and of the intervals that are looked at
LOOKED_AT, SHARES = (
    512,
    (0.1, 0.23, 0.382),
)  # intervals, and the shares at which the motion is compared


@dataclass(frozen=True, slots=True)
class Curve:
    """The cubics between m + 1 points: times (m + 1,), positions and velocities (m + 1, n)."""

    coordinates: tuple[str, ...]
    times: Array
    positions: Array
    velocities: Array
    values: Mapping[str, float]

    def hull(self, places: NDArray[np.int64], begin: Array, end: Array) -> Table:
        """Bounds of t and of the state between two shares of these intervals."""
        length = np.diff(self.times)[places][:, None]
        first, last = self.positions[places], self.positions[places + 1]
        v, w = self.velocities[places] * length, self.velocities[places + 1] * length
        bend, curve = (
            v + w - 2 * (last - first),
            3 * (last - first) - 2 * v - w,
        )  # q = first + v s + curve s^2 + bend s^3
        s, d = begin[:, None], (end - begin)[:, None]
        place = first + s * (v + s * (curve + s * bend))
        speed, push = (
            v + s * (2 * curve + 3 * s * bend),
            2 * curve + 6 * s * bend,
        )  # at s, by the share
        q = _hull(place, place + d * speed / 3, place + d * (2 * speed + d * push / 2) / 3,
                  place + d * (speed + d * (push / 2 + d * bend)))  # fmt: skip
        velocity = _hull(speed, speed + d * push / 2, speed + d * (push + 3 * d * bend))
        acceleration = _hull(push, push + 6 * d * bend)
        table: dict[ex.Expression, Bounds] = {
            ex.Symbol(name): (np.array(value), np.array(value))
            for name, value in self.values.items()
        }
        length = length[:, 0]
        table[ex.TIME] = self.times[places] + begin * length, self.times[places] + end * length
        for k, x in enumerate(self.coordinates):
            table[ex.Symbol(x)] = q[0][:, k], q[1][:, k]
            table[ex.Velocity(x)] = velocity[0][:, k] / length, velocity[1][:, k] / length
            table[ex.Acceleration(x)] = (
                acceleration[0][:, k] / length**2,
                acceleration[1][:, k] / length**2,
            )
        return table


def is_rough(
    curve: Curve, states: Callable[[NDArray[np.int64], Array], tuple[Array, Array]]
) -> bool:
    """Whether the motion, positions and velocities (k, n) at shares of intervals, is elsewhere than
    on the cubics.
    """
    places = np.unique(np.linspace(0, len(curve.times) - 2, LOOKED_AT).astype(np.int64))
    shares = np.resize(SHARES, len(places))
    table, far = curve.hull(places, shares, shares), np.zeros(len(places), dtype=bool)
    length = np.diff(curve.times)[places]
    for k, (x, q) in enumerate(zip(curve.coordinates, states(places, shares)[0].T, strict=True)):
        ends = curve.positions[places, k], curve.positions[places + 1, k]
        way = np.abs(ends[1] - ends[0]) + length * np.abs(curve.velocities[places, k])
        noise = NOISE * np.abs(curve.positions[:, k]).max()
        far |= np.abs(q - table[ex.Symbol(x)][0]) > NOT_SHOWN * way + noise
    return bool(far.mean() > OFTEN)


def _hull(*points: Array) -> Bounds:
    return np.minimum.reduce(points), np.maximum.reduce(points)


def hidden(formula: ex.Expression, curve: Curve, known: Array) -> tuple[Array, bool]:
    """Places, in intervals from the first point, between which the formula changes its sign and
    which its values at the points, `known` (m + 1,), do not show; and whether there may be others
    that were not found.
    """
    rate, size = (
        _rate(formula, curve.coordinates),
        np.abs(known).max(initial=0.0, where=np.isfinite(known)),
    )
    places = np.flatnonzero(np.isfinite(known[:-1]) & np.isfinite(known[1:]))
    begin, end = np.zeros(len(places)), np.ones(len(places))
    looked, signs, lost = [np.arange(len(known)) + 0.0], [np.sign(known)], False
    for halving in range(HALVINGS + 1):
        table = curve.hull(places, begin, end)
        low, high = (np.broadcast_to(one, len(places)) for one in bounds_of(formula, table))
        is_open = ~((low > 0) | (high < 0))
        slowest, fastest = bounds_of(rate, table)
        is_open &= ~((slowest > 0) | (fastest < 0))
        places, begin, end = places[is_open], begin[is_open], end[is_open]
        low, high = low[is_open], high[is_open]
        if not len(places):
            break
        if halving == HALVINGS or len(places) > MOST_INTERVALS:
            # Where it touches zero, its bounds are next to it; next to a pole they are infinite.
            far = np.maximum(np.abs(low), np.abs(high)) > NEXT_TO_ZERO * size
            lost = halving < HALVINGS or bool((far & np.isfinite(low) & np.isfinite(high)).any())
            break
        middle = (begin + end) / 2
        at, _ = bounds_of(formula, curve.hull(places, middle, middle))
        looked.append(places + middle)
        signs.append(np.broadcast_to(np.sign(at), len(places)))
        places, begin, end = (
            np.tile(places, 2),
            np.concatenate([begin, middle]),
            np.concatenate([middle, end]),
        )
    where, sign = np.concatenate(looked), np.concatenate(signs)
    order = np.argsort(where, kind="stable")
    changes = np.diff(sign[order]) != 0
    about = np.concatenate([[False], changes]) | np.concatenate([changes, [False]])
    kept = order[about & (order >= len(known))]
    return where[kept], lost
