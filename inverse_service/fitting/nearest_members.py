"""The members with a Lagrangian that are nearest to a fitted system, of each kind.

Two routes. Members with L = e^s (v G v/2 + A v - V) are found for any number of coefficients, if f
is linear in them (`multipliers`). For few coefficients the family is split into its leaves
(`solving.members`), which have all members, of any Lagrangian (`special_leaves`). Each nearest
point is then made exact (`exact_members`).

A kind contains others, so it is never farther than they are. Hence kinds, and the sets within one,
are compared by distance^2 / error^2 + 9 (m - degrees + rates), the degrees being the number of
equations, and the rates those of e^s: what has one equation less, or one rate more, has to be
nearer by more than three standard errors. Without errors, their size is estimated from the kind
that fits best for its degrees, and taken as 5 % at most.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Literal

import mpmath
import numpy as np

from inverse_service import deadline
from inverse_service.decision.solutions import SolveOptions
from inverse_service.fitting import exact_members, multipliers, special_leaves
from inverse_service.fitting.exact_members import Numbers
from inverse_service.fitting.fitted import FittedSystem, Floats, fraction_of, rational_matrix
from inverse_service.fitting.multipliers import Conditions, Kind, Optimum
from inverse_service.solving import leaves, members
from inverse_service.statements.stages import Progress, Stage

STARTS = 6
MOST_LETTERS = 6  # of a family that is split into leaves
SHARE_OF_LEAVES = 0.5
PENALTY = 9.0
USUAL_ERROR = 0.05  # of a coefficient, at most, where none is given
UNLIKELY = 0.0027  # a chi-square as large by chance: three standard errors
SAME = 1e-6
NEVER = 1e-300  # a chance below it is 0: results hold no smaller numbers


@dataclass(frozen=True, slots=True)
class Multiplier:
    """e^s G with s = g0 t + g q: G exact (n, n), and (g0, g_1, ..., g_n)."""

    matrix: tuple[Numbers, ...]
    rates: Numbers


@dataclass(frozen=True, slots=True)
class Member:
    """The nearest member of a kind that was found.

    `coefficients` are exact, at the `distance`; `point` is where the search ended, at the distance
    `least`. `degrees` is the number of independent equations that members of the kind satisfy;
    `equations` those that are linear, as rows (k, K) of K c + k = 0: for a kind with masses and
    rates those that hold for the masses and rates of this member. `is_projection`: no member of the
    kind is nearer than `least`. `second` is the distance at which the next best start ended;
    `attained` is False where members still nearer tend to a singular Lagrangian.
    """

    kind: str
    coefficients: Numbers
    distance: float
    point: Floats
    least: float
    degrees: int
    equations: tuple[Numbers, ...] = ()
    polynomials: tuple[special_leaves.Polynomial, ...] = ()
    is_projection: bool = False
    starts: int = 1
    second: float | None = None
    attained: bool = True
    multiplier: Multiplier | None = None
    timed: bool = False
    nice: Numbers | None = None


@dataclass(frozen=True, slots=True)
class Unreached:
    """A kind of which no member was found, or a set that is not decided, and why."""

    kind: str
    reason: str


@dataclass(frozen=True, slots=True)
class Nearest:
    """The members in their order, and what was not reached. `is_whole`: the leaves have all members
    of the family.
    """

    members: tuple[Member, ...]
    unreached: tuple[Unreached, ...]
    is_whole: bool


def nearest(
    fitted: FittedSystem,
    options: SolveOptions,
    end: float,
    nice: bool = False,
    progress: Progress = lambda _: None,
) -> Nearest:
    """The nearest members of each kind until the time `end`, those of `nice` fractions too."""
    found, missing, is_whole = list[Member](), list[Unreached](), False
    if fitted.columns is None:
        missing.append(Unreached("natural", "the equations are not linear in the coefficients"))
    else:
        progress(Stage("nearest", "kinds"))
        for one in of_kinds(fitted, options, end, nice):
            (found if isinstance(one, Member) else missing).append(one)  # type: ignore[arg-type]
    if len(fitted.letters) <= MOST_LETTERS:
        progress(Stage("nearest", "leaves"))
        until = deadline.now() + SHARE_OF_LEAVES * (end - deadline.now())
        for part in _of_leaves(fitted, options, until, nice):
            (found if isinstance(part, Member) else missing).append(part)  # type: ignore[arg-type]
        is_whole = not any(one.kind == "leaf" for one in missing)
    else:
        reason = f"leaves are computed for at most {MOST_LETTERS} coefficients"
        missing.append(Unreached("leaf", reason))
    return Nearest(by_distance(distinct(found, fitted), fitted), tuple(missing), is_whole)


def chance(distance: float, degrees: int) -> float:
    """How often a distance in errors is at least as large by chance: the chi-square distribution."""
    if degrees == 0:
        return 1.0
    half = mpmath.mpf(degrees) / 2
    found = float(mpmath.gammainc(half, mpmath.mpf(distance) ** 2 / 2, regularized=True))
    return found if found > NEVER else 0.0


def by_distance(found: Sequence[Member], fitted: FittedSystem) -> tuple[Member, ...]:
    """By distance, a wider kind only if it is nearer by more than errors explain."""
    error = 1.0
    if not fitted.metric.are_errors:
        rates = [one.distance / one.degrees**0.5 for one in found if one.degrees]
        error = max(min([*rates, USUAL_ERROR]), 1e-12)
    size = len(fitted.values)

    def score(one: Member) -> tuple[float, float]:
        rates = 0 if one.multiplier is None else sum(map(bool, one.multiplier.rates))
        free = PENALTY * (size - one.degrees)
        return ((one.distance / error) ** 2 + free + PENALTY * rates, one.distance)

    return tuple(sorted(found, key=score))


def distinct(found: Sequence[Member], fitted: FittedSystem) -> list[Member]:
    """Without those at a member that a smaller kind has, too."""
    kept = list[Member]()
    spread = fitted.metric.spread
    for one in sorted(found, key=lambda one: -one.degrees):
        near = [np.abs((one.point - other.point) / spread).max(initial=0.0) for other in kept]
        if min(near, default=1.0) > SAME * (1 + one.least):
            kept.append(one)
    return kept


# Kinds.


def of_kinds(
    fitted: FittedSystem, options: SolveOptions, end: float, nice: bool
) -> Iterator[Member | Unreached]:
    """The nearest member of each kind of `multipliers.KINDS`, or why there is none."""
    conditions = multipliers.fitted_conditions(fitted)
    for kind in multipliers.KINDS:
        if kind.timed and options.time_dependent is False:
            continue
        if kind.unit and conditions.size == 1:
            continue  # the scale of G does not matter
        if kind.unit or (conditions.size == 1 and not (kind.timed or kind.placed)):
            yield _on_unit(conditions, fitted, kind, nice)
            continue
        if deadline.now() > end:
            yield Unreached(kind.name, "the time was over")
            continue
        yield _searched(conditions, fitted, kind, options.seed, end, nice)


def _on_unit(
    conditions: Conditions, fitted: FittedSystem, kind: Kind, nice: bool
) -> Member | Unreached:
    """The exact projection on the members with G = 1 and s = 0."""
    n, size = conditions.size, len(fitted.values)
    matrix = tuple(tuple(Fraction(int(i == j)) for j in range(n)) for i in range(n))
    rates = (Fraction(0),) * (1 + n)
    rows = multipliers.linear_conditions(conditions, matrix, rates)
    projected = exact_members.projection(rows, fitted)
    if projected is None:
        return Unreached(kind.name, "no member has these terms")
    point = np.array(projected, dtype=float)
    least = fitted.distance(projected)
    short = _in_short_numbers(rows, fitted, least)
    assert short is not None, "the projection satisfies the conditions"
    degrees = size - len(short[2].free)
    return Member(
        kind.name,
        short[0],
        short[1],
        point,
        least,
        degrees,
        tuple(map(tuple, rows)),
        is_projection=True,
        multiplier=Multiplier(matrix, rates),
        nice=_nice(rows, fitted, least) if nice else None,
    )


def _in_short_numbers(
    rows: exact_members.Rows, fitted: FittedSystem, least: float
) -> tuple[Numbers, float, exact_members.LinearSet] | None:
    """A solution of K c + k = 0 as near as the nearest, in short decimals; None if there is none."""
    found = exact_members.solutions(rows, len(fitted.values), _order(fitted))
    if found is None:
        return None
    values = exact_members.weighted_point(found, fitted)
    spread = fitted.metric.spread[list(found.free)]
    close = exact_members.first_close(
        exact_members.roundings(values, spread),
        found.point,
        fitted,
        lambda d: exact_members.is_close(d, least, fitted),
    )
    return None if close is None else (*close, found)


def _order(fitted: FittedSystem) -> list[int]:
    """The coefficients, those that are known least first: these are determined by the others."""
    spread = fitted.metric.spread
    return sorted(range(len(spread)), key=lambda k: (-spread[k], -k))


def _nice(rows: exact_members.Rows, fitted: FittedSystem, least: float) -> Numbers | None:
    """A solution of K c + k = 0 in simple fractions, within the errors of the nearest."""
    found = exact_members.solutions(rows, len(fitted.values), _order(fitted))
    if found is None:
        return None
    values = exact_members.weighted_point(found, fitted)
    width = fitted.metric.spread[list(found.free)] * (2.0 if fitted.metric.are_errors else 1e-2)
    close = exact_members.first_close(
        exact_members.nice_fractions(values, width),
        found.point,
        fitted,
        lambda d: is_offered(d, least, len(found.free), fitted),
    )
    return None if close is None else close[0]


def is_offered(distance: float, least: float, free: int, fitted: FittedSystem) -> bool:
    """Whether fractions at this distance are offered: where the true member is expected.

    Its chi-square exceeds that of the nearest by about the number of free coefficients, here with
    two standard deviations; without errors, 2 % more are allowed.
    """
    if fitted.metric.are_errors:
        return distance**2 <= least**2 + free + 2.0 * float(np.sqrt(2.0 * free))
    return distance <= least + 0.02


def _searched(
    conditions: Conditions,
    fitted: FittedSystem,
    kind: Kind,
    seed: int,
    end: float,
    nice: bool,
) -> Member | Unreached:
    error = 1.0 if fitted.metric.are_errors else USUAL_ERROR
    found = list[tuple[float, Optimum, tuple[int, ...], int]]()
    starts = 0
    for pattern in multipliers.patterns(conditions, fitted):
        optima = multipliers.optima_of(conditions, fitted, kind, pattern, STARTS, seed, end)
        starts += optima[0].starts if optima else 0
        for one in optima:
            degrees = multipliers.degrees_of(conditions, fitted, kind, pattern, one)
            free = PENALTY * (len(fitted.values) - degrees)
            # Of members as good, those with fewer entries of G, which come later.
            score = (one.distance / error) ** 2 + free - 1e-6 * (len(found) + 1)
            found.append((score, one, pattern, degrees))
    if not found:
        return Unreached(kind.name, "no member with these terms was found")
    _, optimum, pattern, degrees = min(found, key=lambda one: one[0])
    exact = _exact(conditions, fitted, kind, pattern, optimum)
    if exact is None:
        return Unreached(
            kind.name,
            f"a member at the distance {optimum.distance:.4g} was not made exact: its conditions "
            "fix numbers that are not rational",
        )
    multiplier, rows, (coefficients, distance, _) = exact
    limit = optimum.distance * (1 + 1e-6) + 1e-9
    return Member(
        kind.name,
        coefficients,
        distance,
        optimum.coefficients,
        optimum.distance,
        degrees,
        tuple(map(tuple, rows)),
        starts=starts,
        second=min((one.distance for _, one, *_ in found if one.distance > limit), default=None),
        attained=optimum.attained,
        multiplier=multiplier,
        timed=bool(multiplier.rates[0]),
        nice=_nice_of(conditions, fitted, kind, pattern, optimum) if nice else None,
    )


def _thetas(
    conditions: Conditions,
    kind: Kind,
    pattern: Sequence[int],
    optimum: Optimum,
    written: Literal["digits", "fractions"],
) -> Iterator[Multiplier]:
    """Multipliers in ever more digits, or ever finer fractions, beside the optimum."""
    n = conditions.size
    pivot = max(
        (conditions.entries[k] for k in pattern),
        key=lambda entry: (abs(optimum.matrix[entry]) > 0.1 * np.abs(optimum.matrix).max(),
                           entry[0] == entry[1], -entry[0]),
    )  # fmt: skip
    whole = optimum.matrix / optimum.matrix[pivot]
    moving = [conditions.entries[k] for k in pattern if conditions.entries[k] != pivot]
    factors = [*([0] if kind.timed else []), *(range(1, 1 + n) if kind.placed else [])]
    values = [float(whole[entry]) for entry in moving]
    rates = [float(optimum.rates[k]) for k in factors]
    numbers = [*values, *rates]
    widths = [max(abs(value), 0.03) for value in values] + [max(abs(v), 0.03) for v in rates]
    tries = (
        exact_members.nice_fractions(numbers, [0.02] * len(numbers))
        if written == "fractions"
        else exact_members.roundings(numbers, widths)
    )
    for rounded in tries:
        table = {pivot: Fraction(1), **dict(zip(moving, rounded, strict=False))}
        matrix = tuple(
            tuple(table.get((min(i, j), max(i, j)), Fraction(0)) for j in range(n))
            for i in range(n)
        )
        found = [Fraction(0)] * (1 + n)
        for k, value in zip(factors, rounded[len(moving) :], strict=True):
            found[k] = value
        yield Multiplier(matrix, tuple(found))


def _exact(
    conditions: Conditions,
    fitted: FittedSystem,
    kind: Kind,
    pattern: Sequence[int],
    optimum: Optimum,
) -> tuple[Multiplier, exact_members.Rows, tuple[Numbers, float, exact_members.LinearSet]] | None:
    """The first multiplier in short numbers that has a member as near as the optimum."""
    for multiplier in _thetas(conditions, kind, pattern, optimum, "digits"):
        if not _is_regular(multiplier):
            continue
        rows = multipliers.linear_conditions(conditions, multiplier.matrix, multiplier.rates)
        found = exact_members.solutions(rows, len(fitted.values), _order(fitted))
        if found is None:
            continue
        z = exact_members.weighted_point(found, fitted)
        distance = fitted.distance(found.point([Fraction(float(value)) for value in z]))
        if not exact_members.is_close(distance, optimum.distance, fitted):
            continue
        short = _in_short_numbers(rows, fitted, optimum.distance)
        if short is not None:
            return multiplier, rows, short
    return None


def _nice_of(
    conditions: Conditions,
    fitted: FittedSystem,
    kind: Kind,
    pattern: Sequence[int],
    optimum: Optimum,
) -> Numbers | None:
    for multiplier in _thetas(conditions, kind, pattern, optimum, "fractions"):
        if not _is_regular(multiplier):
            continue
        rows = multipliers.linear_conditions(conditions, multiplier.matrix, multiplier.rates)
        found = _nice(rows, fitted, optimum.distance)
        if found is not None:
            return found
    return None


def _is_regular(multiplier: Multiplier) -> bool:
    return bool(rational_matrix(multiplier.matrix).det())


# Leaves.


def _of_leaves(
    fitted: FittedSystem, options: SolveOptions, end: float, nice: bool
) -> Iterator[Member | Unreached]:
    try:
        family = members.explore(fitted.system, fitted.letters, (), options, end)
    except leaves.NOT_COMPUTED as problem:
        yield Unreached("leaf", f"the family was not split: {problem}")
        return
    for one in family.open:
        yield Unreached("leaf", f"a set inside was not decided: {one.reason}")
    for found in family.leaves:
        if "variational" not in found.verdicts:
            continue
        offers = partial(_offers, fitted) if nice else None
        near = special_leaves.nearest_on(found, fitted, 2 * STARTS, options.seed, offers)
        shown = f"the leaf of {len(found.leaf.rules)} equations"
        if near is None:
            yield Unreached("leaf", f"{shown} was not reached")
            continue
        if near.exact is None:
            yield Unreached(
                "leaf",
                f"{shown} was reached at the distance {near.distance:.4g}, but its equations "
                "were not solved in rational numbers",
            )
            continue
        yield Member(
            "leaf",
            near.exact,
            fitted.distance(near.exact),
            near.coefficients,
            near.distance,
            len(near.equations),
            polynomials=near.equations,
            is_projection=near.is_linear,
            starts=near.starts,
            second=near.second,
            attained=near.attained,
            timed=found.verdict != "variational",
            nice=near.nice,
        )


def _offers(fitted: FittedSystem, distance: float, least: float, free: int) -> bool:
    return is_offered(distance, least, free, fitted)


def independent_rows(rows: Sequence[Numbers]) -> list[Numbers]:
    """A basis of the rows (k, K), in echelon form."""
    if not rows:
        return []
    width = len(rows[0])
    turned = rational_matrix([[*row[1:], row[0]] for row in rows])
    reduced, rank = turned.rref()
    table = [[fraction_of(reduced[i, j]) for j in range(width)] for i in range(rank)]
    return [(row[-1], *row[:-1]) for row in table]
