"""The nearest members on the leaves of a family that is split exactly (`solving.members`).

On a leaf with equations h(c) = 0 the nearest point is found by Newton's method on the conditions of
the least distance, c <- c0 + C J^T (J C J^T)^+ (J (c - c0) - h), from the fitted system and from
points around it; if the equations are linear the first step is the projection and exact.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from graphlib import CycleError, TopologicalSorter

import numpy as np
from flint import Ordering, fmpq, fmpq_mpoly, fmpq_mpoly_ctx, fmpq_poly

from inverse_service.expressions.polynomials import as_fraction
from inverse_service.fitting import exact_members
from inverse_service.fitting.exact_members import Numbers
from inverse_service.fitting.fitted import FittedSystem, Floats
from inverse_service.solving.members import Found

STEPS = 80
TINY = 1e-10
# The first numbers of points of a curve of degree 2, the simplest first, and how many points are
# tried on each axis.
SIMPLE = tuple(
    sorted(
        {sign * Fraction(p, q) for q in (1, 2, 3, 4, 5, 6, 8, 10) for p in range(31) for sign in (1, -1)},
        key=lambda one: (one.denominator + abs(one.numerator), one < 0),
    )
)  # fmt: skip
MOST_POINTS = 6
Point = tuple[Fraction, Fraction]
Curve = dict[tuple[int, ...], Fraction]  # the numbers before x^p y^q


@dataclass(frozen=True, slots=True)
class Polynomial:
    """sum_a factors[a] prod_k c_k^exponents[a, k], over the coefficients of a fitted system."""

    exponents: tuple[tuple[int, ...], ...]
    factors: Numbers

    def value(self, c: Floats) -> float:
        powers = np.prod(np.power(c, np.array(self.exponents)), axis=1)
        return float(powers @ np.array(self.factors, dtype=float))

    def slopes(self, c: Floats) -> Floats:
        found = np.zeros(len(c))
        exponents = np.array(self.exponents)
        factors = np.array(self.factors, dtype=float)
        for k in range(len(c)):
            lowered = exponents.copy()
            lowered[:, k] = np.maximum(lowered[:, k] - 1, 0)
            found[k] = (factors * exponents[:, k]) @ np.prod(np.power(c, lowered), axis=1)
        return found

    def exact(self, c: Sequence[Fraction]) -> Fraction:
        total = Fraction(0)
        for exponents, factor in zip(self.exponents, self.factors, strict=True):
            term = factor
            for value, exponent in zip(c, exponents, strict=True):
                if exponent:
                    term *= value**exponent
            total += term
        return total

    @property
    def degree(self) -> int:
        return max(map(sum, self.exponents), default=0)

    def degree_in(self, *places: int) -> int:
        return max((sum(one[k] for k in places) for one in self.exponents), default=0)

    def held(self) -> set[int]:
        return {k for exponents in self.exponents for k, e in enumerate(exponents) if e}


def polynomial_of(found: Found, fitted: FittedSystem, equation: fmpq_mpoly) -> Polynomial | None:
    """The equation as a polynomial in the coefficients; None if it holds anything else."""
    unknowns = found.leaf.unknowns
    place = {index: fitted.letters.index(name) for index, name in unknowns.letters.items()}
    exponents, factors = list[tuple[int, ...]](), list[Fraction]()
    for powers, factor in equation.terms():
        own = [0] * len(fitted.letters)
        for index, power in enumerate(powers):
            if power and index not in place:
                return None
            if power:
                own[place[index]] = int(power)
        exponents.append(tuple(own))
        factors.append(as_fraction(factor))
    return Polynomial(tuple(exponents), tuple(factors))


@dataclass(frozen=True, slots=True)
class OnLeaf:
    """The nearest point of a leaf that was found: floating point, and exact where its equations can
    be solved in rational numbers.

    `is_linear`: it is the projection, and no point of the leaf is nearer.
    """

    equations: tuple[Polynomial, ...]
    coefficients: Floats
    distance: float
    exact: Numbers | None
    is_linear: bool
    starts: int
    second: float | None
    attained: bool
    nice: Numbers | None = None


def nearest_on(
    found: Found,
    fitted: FittedSystem,
    starts: int,
    seed: int,
    offers: Callable[[float, float, int], bool] | None = None,
) -> OnLeaf | None:
    """The nearest member on a leaf; None if its equations hold more than coefficients or no start
    reached it. With `offers` (distance, that of the nearest, number of free coefficients) also one
    in simple fractions that it accepts.
    """
    equations = [polynomial_of(found, fitted, rule.equation) for rule in found.leaf.rules]
    nonzero = [polynomial_of(found, fitted, one) for one in found.leaf.nonzero]
    whole = [one for one in equations if one is not None]
    if len(whole) < len(equations):
        return None
    is_linear = all(one.degree <= 1 for one in whole)
    root = fitted.metric.root
    random = np.random.default_rng(seed)
    points = list[tuple[float, Floats]]()
    for attempt in range(1 if is_linear else starts):
        shift = random.normal(size=len(root)) * (0 if not attempt else 3.0 * 2 ** (attempt % 4))
        point = _projected(whole, fitted, fitted.fitted + root @ shift)
        if point is not None:
            points.append(
                (float(np.linalg.norm(np.linalg.solve(root, point - fitted.fitted))), point)
            )
    if not points:
        return None
    points.sort(key=lambda one: one[0])
    distance, point = points[0]
    if is_linear and (projected := exact_members.projection(_rows(whole), fitted)) is not None:
        point = np.array(projected, dtype=float)
        distance = fitted.distance(projected)
    others = [one for one, _ in points if one > distance * (1 + 1e-6) + 1e-9]
    attained = all(one is None or _is_away(one, point, fitted) for one in nonzero)
    exact = _exact(whole, point, distance, fitted) if whole else fitted.values
    on_it = [one for one in nonzero if one is not None]
    nice = None if offers is None else _nice(whole, on_it, point, distance, fitted, offers)
    return OnLeaf(
        tuple(whole),
        point,
        distance,
        exact,
        is_linear,
        1 if is_linear else starts,
        others[0] if others else None,
        attained,
        nice,
    )


def _rows(equations: Sequence[Polynomial]) -> exact_members.Rows:
    """(k, K) of linear equations."""
    size = len(equations[0].exponents[0]) if equations else 0
    found = list[list[Fraction]]()
    for one in equations:
        row = [Fraction(0)] * (1 + size)
        for exponents, factor in zip(one.exponents, one.factors, strict=True):
            row[1 + exponents.index(1) if any(exponents) else 0] += factor
        found.append(row)
    return found


def _is_away(polynomial: Polynomial, point: Floats, fitted: FittedSystem) -> bool:
    """Whether it does not vanish at the point, to a thousandth of the errors."""
    slope = float(np.linalg.norm(fitted.metric.root.T @ polynomial.slopes(point)))
    return abs(polynomial.value(point)) > 1e-3 * slope or not slope


def _projected(
    equations: Sequence[Polynomial], fitted: FittedSystem, start: Floats
) -> Floats | None:
    c, root = start, fitted.metric.root
    if not equations:
        return fitted.fitted
    for _ in range(STEPS):
        slopes = np.array([one.slopes(c) for one in equations]) @ root
        h = np.array([one.value(c) for one in equations])
        sizes = np.linalg.norm(slopes, axis=1)
        if not np.all(sizes > 0):
            return None
        slopes, h = slopes / sizes[:, None], h / sizes
        y = np.linalg.solve(root, c - fitted.fitted)
        new = np.linalg.lstsq(slopes, slopes @ y - h, rcond=1e-12)[0]
        step = new - y
        limit = 3.0 + float(np.linalg.norm(y))
        length = float(np.linalg.norm(step))
        if length > limit:
            step *= limit / length
        c = c + root @ step
        if length < 1e-13 * (1 + float(np.linalg.norm(y))):
            break
    slopes = np.array([one.slopes(c) for one in equations]) @ root
    h = np.array([one.value(c) for one in equations])
    good = np.all(np.abs(h) <= TINY * np.maximum(np.linalg.norm(slopes, axis=1), 1e-300))
    return c if good and np.all(np.isfinite(c)) else None


def _exact(
    equations: Sequence[Polynomial], point: Floats, distance: float, fitted: FittedSystem
) -> Numbers | None:
    """A member of short rational numbers beside the point."""
    chart = _chart(equations, point)
    if chart is None:
        return None
    free, member = chart
    tries = exact_members.roundings(point[free], fitted.metric.spread[free])
    found = exact_members.first_close(
        tries, member, fitted, lambda d: exact_members.is_close(d, distance, fitted)
    )
    return None if found is None else found[0]


def _nice(
    equations: Sequence[Polynomial],
    nonzero: Sequence[Polynomial],
    point: Floats,
    distance: float,
    fitted: FittedSystem,
    offers: Callable[[float, float, int], bool],
) -> Numbers | None:
    """A member whose free coefficients are simple fractions, near the point, on the leaf itself."""
    chart = _chart(equations, point)
    if chart is None:
        return None
    free, whole = chart

    def member(values: Numbers) -> Numbers | None:
        c = whole(values)
        return None if c is None or not all(one.exact(c) for one in nonzero) else c

    width = fitted.metric.spread[free] * (2.0 if fitted.metric.are_errors else 1e-2)
    tries = exact_members.nice_fractions(point[free], width)
    found = exact_members.first_close(
        tries, member, fitted, lambda d: offers(d, distance, len(point) - len(equations))
    )
    return None if found is None else found[0]


@dataclass(frozen=True, slots=True)
class Solved:
    """An equation, and the coefficients that it determines: one in which it is linear, or two,
    between which it is a curve.
    """

    equation: Polynomial
    places: tuple[int, ...]


def _chart(
    equations: Sequence[Polynomial], point: Floats
) -> tuple[list[int], Callable[[Numbers], Numbers | None]] | None:
    """The places of the coefficients that are chosen, and the member for given numbers there; None
    where the equations are not solved for the others in rational numbers.

    Both coefficients of a curve are among those that are chosen: the member is near their numbers.
    """
    solved = _solvable(equations, point)
    if solved is None:
        return None
    bound = [one.places[0] for one in solved if len(one.places) == 1]
    free = [k for k in range(len(point)) if k not in bound]

    def member(values: Numbers) -> Numbers | None:
        c = [Fraction(0)] * len(point)
        for k, value in zip(free, values, strict=True):
            c[k] = value
        for one in solved:
            found = _on_line(one, c) if len(one.places) == 1 else _on_curve(one, c)
            if found is None:
                return None
            for k, value in zip(one.places, found, strict=True):
                c[k] = value
        return tuple(c)

    return free, member


def _on_line(one: Solved, c: Sequence[Fraction]) -> Numbers | None:
    """The coefficient in which an equation is linear."""
    (k,) = one.places
    at = list(c)
    at[k] = Fraction(0)
    rest = one.equation.exact(at)
    at[k] = Fraction(1)
    slope = one.equation.exact(at) - rest
    return (-rest / slope,) if slope else None


def _on_curve(one: Solved, c: Sequence[Fraction]) -> Numbers | None:
    """The point of h(x, y) = 0, of degree d, where a line beside (x, y) meets it last: rational,
    and near (x, y) if that is near the curve.

    It is a line through (x, y) in a direction in which h has degree 1, or through a rational point
    of multiplicity d - 1, and so meets the curve in one more point (Walker, Algebraic curves, 1950,
    III.7).
    """
    i, j = one.places
    curve = _curve_of(one, c)
    at = (c[i], c[j])
    if not _along(curve, at, (Fraction(0), Fraction(0))):
        return at
    degree = max(map(sum, curve))
    lines = [(at, direction) for direction in _directions(curve, degree)]
    points = _simple_points(curve) if degree == 2 else _singular_points(curve, degree)
    lines += [((x, y), (at[0] - x, at[1] - y)) for x, y in points]
    best: Numbers | None = None
    far = Fraction(0)
    for (x, y), (u, v) in lines:
        values = _along(curve, (x, y), (u, v)).coeffs()
        held = [k for k, value in enumerate(values) if value]
        if len(held) != 2 or held[1] != held[0] + 1:
            continue
        s = -as_fraction(values[held[0]] / values[held[1]])
        found = (x + s * u, y + s * v)
        away = abs(found[0] - at[0]) + abs(found[1] - at[1])
        if best is None or away < far:
            best, far = found, away
    return best


def _curve_of(one: Solved, c: Sequence[Fraction]) -> Curve:
    """The equation in the two coefficients that it determines, with numbers for the others."""
    i, j = one.places
    found: Curve = {}
    for exponents, factor in zip(one.equation.exponents, one.equation.factors, strict=True):
        value = factor
        for k, exponent in enumerate(exponents):
            if exponent and k not in one.places:
                value *= c[k] ** exponent
        key = (exponents[i], exponents[j])
        found[key] = found.get(key, Fraction(0)) + value
    return {key: value for key, value in found.items() if value}


def _along(curve: Curve, point: Point, direction: Point) -> fmpq_poly:
    """h(point + s direction), a polynomial in s."""
    first, second = (
        fmpq_poly([_rational(start), _rational(step)])
        for start, step in zip(point, direction, strict=True)
    )
    found = fmpq_poly()
    for (p, q), value in curve.items():
        found += first**p * second**q * _rational(value)
    return found


def _rational(value: Fraction) -> fmpq:
    return fmpq(value.numerator, value.denominator)


def _roots(polynomial: fmpq_poly) -> list[Fraction]:
    """The rational ones."""
    return [as_fraction(root) for root, _ in polynomial.roots()] if polynomial else []


def _directions(curve: Curve, degree: int) -> list[Point]:
    """The rational points at infinity: h has a smaller degree along them."""
    top = {key: value for key, value in curve.items() if sum(key) == degree}
    found = [
        (Fraction(1), slope)
        for slope in _roots(_along(top, (Fraction(1), Fraction(0)), (Fraction(0), Fraction(1))))
    ]
    return found if (0, degree) in top else [*found, (Fraction(0), Fraction(1))]


def _simple_points(curve: Curve) -> Iterator[Point]:
    """Rational points with a simple x or y, a few of each."""
    none, one = Fraction(0), Fraction(1)
    for is_turned in (False, True):
        count = 0
        for x in SIMPLE:
            line = ((none, x), (one, none)) if is_turned else ((x, none), (none, one))
            for y in _roots(_along(curve, *line)):
                yield (y, x) if is_turned else (x, y)
                count += 1
            if count > MOST_POINTS:
                break


def _singular_points(curve: Curve, degree: int) -> Iterator[Point]:
    """The rational points of multiplicity degree - 1: there all derivatives of the order degree - 2
    vanish.
    """
    context = fmpq_mpoly_ctx.get(["x", "y"], Ordering.lex)
    whole = context.from_dict({key: _rational(value) for key, value in curve.items()})
    slopes = [whole]
    for _ in range(degree - 2):
        slopes = [slopes[0].derivative(0), *(one.derivative(1) for one in slopes)]
    slopes = [one for one in slopes if not one.is_zero()]
    if len(slopes) < 2:
        return
    none, unit = Fraction(0), Fraction(1)
    tables = [{key: as_fraction(value) for key, value in one.terms()} for one in slopes]
    eliminant = slopes[0].resultant(slopes[1], "y").terms()
    found = {key: as_fraction(value) for key, value in eliminant}
    for x in _roots(_along(found, (none, none), (unit, none))):
        ends = [_along(table, (x, none), (none, unit)) for table in tables]
        yield from ((x, y) for y in _roots(next(filter(None, ends), fmpq_poly())))


def _solvable(equations: Sequence[Polynomial], point: Floats) -> list[Solved] | None:
    """An order in which each equation is linear in a coefficient, or a curve of two that has
    rational points, and that no earlier one needs.
    """
    choices = list[list[tuple[int, ...]]]()
    beside = [Fraction(value).limit_denominator(1000) for value in point.tolist()]
    for one in equations:
        slopes = one.slopes(point)
        held = [k for k in sorted(one.held()) if abs(slopes[k]) > 1e-9]
        single = [(k,) for k in held if one.degree_in(k) == 1]
        pairs = [pair for pair in itertools.combinations(held, 2) if one.degree_in(*pair) > 1]
        reached = [pair for pair in pairs if not single and _on_curve(Solved(one, pair), beside)]
        choices.append([*single, *reached])
    for chosen in itertools.islice(itertools.product(*choices), 2000):
        taken = [k for places in chosen for k in places]
        if len(set(taken)) < len(taken):
            continue
        needs = {
            place: {
                other
                for other, places in enumerate(chosen)
                if other != place and equations[place].held().intersection(places)
            }
            for place in range(len(equations))
        }
        try:
            order = [*TopologicalSorter(needs).static_order()]
        except CycleError:
            continue
        return [Solved(equations[place], chosen[place]) for place in order]
    return None
