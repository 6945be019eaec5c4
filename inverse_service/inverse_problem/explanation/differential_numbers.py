"""Differentiated Helmholtz equations in numbers at one point, with sums in which all derivatives of g cancel.

The rows are chosen at a random point, modulo a prime. At the point with small rational values the
coefficients of the derivatives have to have the same rank: then the sums go on to exist near the point (the
kernel of a matrix of constant rank depends analytically on the point), and what they exclude there is
excluded at every generic point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial

from inverse_service import bounds
from inverse_service.algebra.point import Point, Variable
from inverse_service.algebra.semidefinite import kernel as rational_kernel
from inverse_service.algebra.tower import draw_point
from inverse_service.algebra.truncated_series import SingularPoint
from inverse_service.deadline import now
from inverse_service.expressions.tree import Expression, Symbol, Velocity
from inverse_service.inverse_problem.decision.analysis import Analysis
from inverse_service.inverse_problem.decision.local_system import RowName
from inverse_service.inverse_problem.explanation.differentiated_equations import (
    DerivativeOfEntry,
    Row,
    cancelling,
    consequence,
    rank_of_derivatives,
    row_names,
    rows_at,
    variables_of_question,
)
from inverse_service.inverse_problem.explanation.hierarchy import all_singular, kernel, unknowns
from inverse_service.inverse_problem.explanation.numbers_at_a_point import (
    PlainPoint,
    are_confirmed,
    atoms_and_jets,
    bare_variables,
    fractions_of_one_prime,
    has_points,
    is_real,
    leave_singular_only,
    matrices_left,
    residues_at,
    whole_multiple,
)

# The sums are searched for among the equations of the lowest order that suffices, if they are not more than this.
MOST_ROWS, HIGHEST_ORDER = 500, 3
# So many equations are gone through for those that can be left out.
PRUNED = 60
_ENOUGH = 40

FractionRow = Mapping[DerivativeOfEntry, Fraction]
_Key = Expression | tuple[RowName, DerivativeOfEntry]


@dataclass(frozen=True, slots=True)
class Sum:
    """Factors of equations that add up to an equation over `unknowns`, all derivatives of g cancelled."""

    factors: Mapping[RowName, Fraction]
    result: tuple[Fraction, ...]


@dataclass(frozen=True, slots=True)
class DifferentialNumbers:
    """Values at the point, the equations used, the sums; `rank` is that of the derivatives' coefficients.

    `real` says whether a real point has these values; else they only respect the algebraic relations.
    """

    with_time: bool
    real: bool
    variables: Mapping[Variable, Fraction]
    atoms: Mapping[Expression, Fraction]
    rows: Mapping[RowName, FractionRow]
    sums: tuple[Sum, ...]
    considered: int
    rank: int

    @property
    def size(self) -> int:
        """How much there is to read."""
        numbers = [value for row in self.rows.values() for value in row.values()]
        numbers += [value for each in self.sums for value in each.factors.values()]
        return sum(len(str(number)) for number in numbers)


def differential_numbers(
    analysis: Analysis, with_time: bool, seed: int = 1, deadline: float = float("inf")
) -> DifferentialNumbers | None:
    """The shortest of the first arguments found; None where none was met before the deadline (`now`)."""
    if not has_points(analysis):
        return None
    for order in range(1, HIGHEST_ORDER + 1):
        chosen = sufficient_rows(analysis, with_time, order, seed, deadline)
        shortest = None if chosen is None else _shortest(analysis, chosen, deadline)
        if shortest is not None:
            return shortest
    return None


def _shortest(analysis: Analysis, chosen: SufficientRows, deadline: float) -> DifferentialNumbers | None:
    """The shortest argument at the points gone through that a second prime confirms."""
    best: DifferentialNumbers | None = None
    met = 0
    for attempt in range(bounds.TRIES):
        if now() > deadline or met == chosen.points_wanted:
            break
        residues = partial(_residues, analysis, chosen, attempt)
        values = fractions_of_one_prime(analysis, residues)
        numbers = None if values is None else _at_point(analysis, chosen, values)
        if values is None or numbers is None:
            continue
        if best is not None and numbers.size >= best.size:
            met += 1
        elif are_confirmed(analysis, residues, values):
            best, met = numbers, met + 1
    return best


@dataclass(frozen=True, slots=True)
class SufficientRows:
    """Rows that leave only singular g at a generic point; `rank` is that of the coefficients of derivatives there."""

    with_time: bool
    order: int
    names: tuple[RowName, ...]
    rank: int

    @property
    def points_wanted(self) -> int:
        """Among how many points the shortest argument is chosen: where each takes long, few."""
        return _ENOUGH if len(self.names) <= PRUNED else 3


def sufficient_rows(
    analysis: Analysis, with_time: bool, order: int, seed: int, deadline: float = float("inf")
) -> SufficientRows | None:
    """Those of the order, without those not needed; None where they leave a regular g."""
    n, size = len(analysis.system.coordinates), len(variables_of_question(analysis, with_time))
    if sum(1 for _ in row_names(n, size, order)) > MOST_ROWS:
        return None
    point = draw_point(analysis.tower, seed)
    try:
        rows = {name: row for name, row in rows_at(analysis, with_time, order, point).items() if row}
    except SingularPoint:
        return None
    kept = _needed(rows, n, point.prime)
    if kept is None:
        return None
    for name in reversed(list(kept)) if len(kept) <= PRUNED else ():
        rest = {other: row for other, row in kept.items() if other != name}
        if now() < deadline and _needed(rest, n, point.prime) is not None:
            kept = rest
    return SufficientRows(with_time, order, tuple(kept), rank_of_derivatives(kept, point.prime))


def _needed(rows: Mapping[RowName, Row], n: int, prime: int) -> dict[RowName, Row] | None:
    """The rows in sums without derivatives that leave only singular g; None where all of them leave a regular one."""
    used: dict[RowName, Row] = {}
    results: list[tuple[int, ...]] = []
    left = kernel(results, len(unknowns(n)), prime)
    for factors in cancelling(rows, prime):
        narrowed = kernel([*results, result := consequence(rows, factors, n, prime)], len(unknowns(n)), prime)
        if len(narrowed) == len(left):
            continue
        results, left = [*results, result], narrowed
        used |= {name: rows[name] for name in factors}
        if all_singular(left, n, prime):
            return {name: row for name, row in rows.items() if name in used}
    return None


def _at_point(
    analysis: Analysis, chosen: SufficientRows, values: Mapping[_Key, Fraction]
) -> DifferentialNumbers | None:
    """The argument at a point with these values; None where it does not close there."""
    entries: dict[RowName, dict[DerivativeOfEntry, Fraction]] = {name: {} for name in chosen.names}
    for key, value in values.items():
        if isinstance(key, tuple):
            entries[key[0]][key[1]] = value
    rows = {name: whole_multiple(row) for name, row in entries.items() if row}
    n = len(analysis.system.coordinates)
    sums, rank = _sums(rows, n)
    if rank != chosen.rank or not _excludes(sums, n):
        return None
    used = {name for each in sums for name in each.factors}
    bare = bare_variables(analysis.accelerations)
    named = {key: value for key, value in values.items() if not isinstance(key, tuple)}
    velocities = {Velocity(name) for name in analysis.system.coordinates}
    shown = {key: named[key] for key in named if isinstance(key, Symbol | Velocity) and key in bare | velocities}
    return DifferentialNumbers(
        chosen.with_time,
        is_real(analysis),
        shown,
        {atom: named[atom] for atom in atoms_and_jets(analysis, chosen.order + 1)},
        {name: row for name, row in rows.items() if name in used},
        sums,
        len(chosen.names),
        rank,
    )


def _residues(analysis: Analysis, chosen: SufficientRows, attempt: int, prime: int) -> dict[_Key, int] | None:
    """Values of variables, atoms and coefficients; None where the point is singular."""

    def coefficients(point: Point) -> dict[_Key, int]:
        rows = rows_at(analysis, chosen.with_time, chosen.order, point, chosen.names)
        return {(name, unknown): value for name in chosen.names for unknown, value in rows[name].items()}

    point = PlainPoint(prime, attempt, dict(analysis.tower.real_signs))
    return residues_at(analysis, point, atoms_and_jets(analysis, chosen.order + 1), coefficients)


def _sums(rows: Mapping[RowName, FractionRow], n: int) -> tuple[tuple[Sum, ...], int]:
    """Sums in which the derivatives cancel, as many as are needed, and the rank of the derivatives' coefficients."""
    columns = sorted({unknown for row in rows.values() for unknown in row if unknown.degree})
    basis = rational_kernel([[row.get(c, Fraction(0)) for row in rows.values()] for c in columns], len(rows))
    sums: list[Sum] = []
    for vector in basis:
        factors = {name: factor for name, factor in zip(rows, vector, strict=True) if factor}
        more = [*sums, _whole(rows, factors, n)]
        if not _excludes(sums, n) and len(_left(more, n)) < len(_left(sums, n)):
            sums = more
    return tuple(sums), len(rows) - len(basis)


def _whole(rows: Mapping[RowName, FractionRow], factors: Mapping[RowName, Fraction], n: int) -> Sum:
    """The sum with whole factors without a common divisor, and what it says of g."""
    whole = whole_multiple(factors)
    total: dict[DerivativeOfEntry, Fraction] = {}
    for name, factor in whole.items():
        for unknown, value in rows[name].items():
            total[unknown] = total.get(unknown, Fraction(0)) + factor * value
    values = {(unknown.i, unknown.j): value for unknown, value in total.items() if not unknown.degree}
    return Sum(whole, tuple(values.get(pair, Fraction(0)) for pair in unknowns(n)))


def _excludes(sums: Sequence[Sum], n: int) -> bool:
    """Whether every symmetric matrix that satisfies the sums is singular."""
    return leave_singular_only([each.result for each in sums], n)


def _left(sums: Sequence[Sum], n: int) -> list[tuple[int, ...]]:
    return matrices_left([each.result for each in sums], n)
