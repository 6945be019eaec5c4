"""The decision: prolong, project, test, order by order, at one random point, then at a second.

No: in every solution of the order-r system a matrix of derivatives stays below the rank asked for. Yes: for
some degree d >= 1, not below that of the matrix, the projection has stopped falling, D_d(r - 1) = D_d(r), its symbol
is involutive, and the rank is reached; the projected system is then formally integrable and, the
coefficients being analytic, solutions exist through every element left (Cartan, Kuranishi, Goldschmidt).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from inverse_service.deadline import now
from inverse_service.errors import IrreducibleAtoms
from inverse_service.field.echelon import Flags
from inverse_service.field.point import Point
from inverse_service.field.series_program import Registers, SeriesProgram, TooLarge, constants_at, run
from inverse_service.field.truncated_series import SingularPoint
from inverse_service.linear_pde import involution
from inverse_service.linear_pde.emission import LocalEquations, Prolongation, RowName, advance, start
from inverse_service.linear_pde.involution import Matrix
from inverse_service.linear_pde.unknowns import Unknowns, count_of_degree

# Most negative verdicts fall at order 1, most positive ones at order 3: series are made for these first.
_FIRST_ORDER, SECOND_ORDER = 1, 3
_POINTS = 4
MOST_UNKNOWNS = 60_000
# An order takes so many times as long as the one before: none is begun that would pass the deadline.
_GROWTH = 3


@dataclass(frozen=True, slots=True)
class Limits:
    """How far to prolong: the highest order, a deadline (`now`), the most unknowns."""

    order: int = 7
    deadline: float = float("inf")
    unknowns: int = MOST_UNKNOWNS


class Card(Protocol):
    """A question: unknown functions, a matrix of their derivatives that has to reach a rank, and the equations."""

    @property
    def unknowns(self) -> Unknowns: ...

    @property
    def matrix(self) -> Matrix: ...

    @property
    def others(self) -> tuple[Matrix, ...]:
        """Matrices whose ranks are of interest too."""

    def at(self, seed: int, order: int) -> LocalEquations:
        """The equations at the random point of this seed, to this order; raises SingularPoint or TooLarge."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Whether there is a solution of the rank, or None with the reason, and what proves it.

    `rows` name the prolonged equations used for a no; `symbol` at `degree`, and `history`, D_0, D_1, … at each
    order, are the involution data of a yes; `ranks` those of the matrix and of the others at the generic
    solution; `points` the primes and seeds used. A no by series along one solution has in `along` the last coefficient
    that it takes, and no order.
    """

    exists: bool | None
    order: int
    reason: str = ""
    rows: tuple[RowName, ...] = ()
    symbol: involution.Symbol | None = None
    degree: int = 0
    history: tuple[tuple[int, ...], ...] = ()
    points: tuple[Mapping[str, int], ...] = ()
    ranks: tuple[int, ...] = ()
    along: int | None = None


@dataclass(slots=True)
class _Run:
    """One run at one point."""

    card: Card
    seed: int
    limits: Limits
    progress: Callable[[str], None]
    expected: int = _FIRST_ORDER
    lasted: float = 0.0  # seconds of the last order
    history: list[tuple[int, ...]] = field(default_factory=list)
    # Rows that depend on others: where another run found them, and where this one did.
    expected_rows: Mapping[tuple[str, int], Flags] = field(default_factory=dict)
    dependent_rows: Mapping[tuple[str, int], Flags] = field(default_factory=dict)


def settle(card: Card, seed: int, limits: Limits, progress: Callable[[str], None]) -> Finding:
    """Two points over two primes must agree; else nothing is settled, nor where a limit is reached."""
    try:
        run = _Run(card, 2 * seed, limits, progress)
        first = _settle_once(run)
        if first.exists is None:
            return first
        # The second run will go as far as the first: it makes its series once, to that order, and tests at once
        # that the rows without use there are without use here.
        again = _Run(card, 2 * seed + 1, limits, progress, first.order)
        again.expected_rows = run.dependent_rows
        return _agreement(first, _settle_once(again))
    except IrreducibleAtoms as problem:
        return Finding(None, 0, problem.detail)


def _agreement(first: Finding, second: Finding) -> Finding:
    same = (first.exists, first.order, first.history) == (second.exists, second.order, second.history)
    if second.exists is None or not same:
        return Finding(None, first.order, second.reason or "two random points gave two answers")
    return replace(first, points=(*first.points, *second.points))


def _settle_once(run: _Run) -> Finding:
    """One run; a point where a denominator vanishes is replaced."""
    for attempt in range(_POINTS):
        try:
            return _prolong(run, run.seed + 100_003 * attempt)
        except SingularPoint:
            run.history.clear()
    raise IrreducibleAtoms("a denominator vanishes at every point tried: is it identically zero?")


def _prolong(run: _Run, seed: int) -> Finding:
    known = run.expected
    prolongation = start(run.card.at(seed, known), run.expected_rows)
    run.dependent_rows = prolongation.dependent
    points = ({"prime": prolongation.local.prime, "seed": seed},)
    while True:
        order = prolongation.order + 1
        stop = _limit_reached(run, prolongation, order)
        if stop:
            return _stopped(run, prolongation, stop)
        if order > known:
            known = max(order, SECOND_ORDER)
            try:
                prolongation.local = run.card.at(seed, known)
            except TooLarge:
                stop = f"order {order} of prolongation would need too large series"
                return _stopped(run, prolongation, stop)
        run.progress(f"prolongation to order {order}")
        began = now()
        advance(prolongation)
        run.lasted = now() - began
        run.history.append(prolongation.dimensions)
        found = _negative(run, prolongation, seed) or _positive(run, prolongation, seed)
        if found:
            return replace(found, history=tuple(run.history), points=points, ranks=_ranks(run, prolongation))


def _stopped(run: _Run, prolongation: Prolongation, reason: str) -> Finding:
    """Nothing is settled; how far it came."""
    return Finding(None, prolongation.order, reason, history=tuple(run.history), ranks=_ranks(run, prolongation))


def _ranks(run: _Run, prolongation: Prolongation) -> tuple[int, ...]:
    """Of the matrix and the others, where there are others."""
    matrices = (run.card.matrix, *run.card.others) if run.card.others else ()
    found = []
    for matrix in matrices:
        degree = involution.degree_of(prolongation.unknowns, matrix)
        if prolongation.order < degree:
            return ()
        found.append(involution.generic_rank(prolongation, matrix))
    return tuple(found)


# How the reason of a finding begins that a deadline left open.
OUT_OF_TIME = "the time limit came before order"


def _limit_reached(run: _Run, prolongation: Prolongation, order: int) -> str:
    """The sentence that names the limit in the way of this order, or nothing."""
    if order > run.limits.order:
        return f"not settled by order {run.limits.order} of prolongation"
    if now() + _GROWTH * run.lasted > run.limits.deadline:
        return f"{OUT_OF_TIME} {order} of prolongation"
    unknowns, bits = prolongation.unknowns, 63 // prolongation.size
    total = prolongation.width(order - 1) + count_of_degree(unknowns, order)
    if order + unknowns.most >= 1 << bits or total > run.limits.unknowns:
        return f"order {order} of prolongation would need more than {run.limits.unknowns} unknowns"
    return ""


def _negative(run: _Run, prolongation: Prolongation, seed: int) -> Finding | None:
    matrix = run.card.matrix
    degree = involution.degree_of(prolongation.unknowns, matrix)
    if prolongation.order < degree or _as_before(run, degree):
        return None
    if involution.generic_rank(prolongation, matrix) == matrix.rank:
        return None
    kept = involution.consequences(prolongation, degree)
    for number in sorted(kept, reverse=True):
        others = [row for k, row in kept.items() if k != number]
        if involution.rank_of_rows(prolongation, matrix, others, seed) < matrix.rank:
            del kept[number]
    used = sorted({original for number in kept for original in prolongation.echelon.trace({number: 1})})
    return Finding(False, prolongation.order, rows=tuple(prolongation.row_name(number) for number in used))


def _as_before(run: _Run, degree: int) -> bool:
    """Whether the order before left the same values of the matrix, one of the full rank among them."""
    return len(run.history) > degree + 1 and run.history[-1][degree] == run.history[-2][degree]


def _positive(run: _Run, prolongation: Prolongation, seed: int) -> Finding | None:
    order, history = prolongation.order, run.history
    for degree in range(max(1, involution.degree_of(prolongation.unknowns, run.card.matrix)), order):
        if history[order][degree] != history[order - 1][degree]:
            continue
        symbol = involution.symbol(prolongation, degree, seed)
        if symbol.involutive:
            return Finding(True, order, symbol=symbol, degree=degree)
    return None


Integers = npt.NDArray[np.int64]


@dataclass(slots=True)
class Coefficients:
    """Series at random points; `write(order)` makes the program and its instructions for series to that order.

    To prolong to an order takes series to `degree` of it. `written` is the order of prolongation that the
    program serves, `constants` holds (prime, constants) for each seed.
    """

    write: Callable[[int], tuple[SeriesProgram, Integers]]
    draw: Callable[[int], Point]
    degree: Callable[[int], int] = lambda order: order + 2
    program: tuple[SeriesProgram, Integers] | None = None
    written: int = 0
    constants: dict[int, tuple[int, npt.NDArray[np.uint64]]] = field(default_factory=dict)

    def at(self, seed: int, order: int) -> tuple[int, Registers]:
        """The prime and all registers; SingularPoint where a denominator vanishes, TooLarge for too many words."""
        if self.program is None or order > self.written:
            self.written, self.constants = max(order, SECOND_ORDER), {}
            self.program = self.write(self.degree(self.written))
        series, instructions = self.program
        if seed not in self.constants:
            point = self.draw(seed)
            self.constants[seed] = (point.prime, constants_at(series, point))
        prime, constants = self.constants[seed]
        return prime, run(series, instructions, constants, prime, self.degree(order))
