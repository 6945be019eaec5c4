"""Decide by prolongation, projection, and tests, order by order, at one random point and then at a
second.

No: in every solution of the order-r system, a matrix of derivatives has less than the required
rank. Yes: for some degree d >= 1, not below that of the matrix, the projection has stopped falling,
D_d(r - 1) = D_d(r), its symbol is involutive, and the rank is reached; the projected system is then
formally integrable and, the coefficients being analytic, solutions exist through every element left
(Cartan, Kuranishi, Goldschmidt).
"""

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Protocol

import numpy as np
import numpy.typing as npt
from flint import nmod_mat

from inverse_service.deadline import now
from inverse_service.errors import IrreducibleAtoms
from inverse_service.field import matrices, modular
from inverse_service.field.dense_series import Registers, SeriesProgram, constants_at, run
from inverse_service.field.echelon import Echelon, Flags, Indices, SparseRows, Words
from inverse_service.field.exact_field import TooLarge
from inverse_service.field.modular import (
    GOLDEN,
    Field,
    Point,
    SingularPoint,
    compiled,
    mixed,
    multiply,
)
from inverse_service.linear_pde import equations as pde
from inverse_service.statements import reasons
from inverse_service.statements.stages import PROLONGATION, Progress, Stage

Rows = list[dict[int, int]]

# Most negative verdicts occur at order 1 and most positive ones at order 3, so series are first
# made for these.
_FIRST_ORDER, SECOND_ORDER = 1, 3
_POINTS = 4
MOST_UNKNOWNS = 60_000
# The growth of the time from one order to the next; an order that would exceed the deadline is not
# begun.
_GROWTH = 3
Integers = npt.NDArray[np.int64]
# A Taylor coefficient (function, monomial), and the choice of a free coefficient's value modulo a
# prime.
Unknown = tuple[int, tuple[int, ...]]
Choice = Callable[[Unknown, int], int]


@dataclass(frozen=True, slots=True, eq=False)
class Matrix:
    """A matrix of derivatives of the unknowns at the point that must have a given rank."""

    entries: tuple[tuple[pde.Derivative, ...], ...]
    rank: int


@lru_cache(maxsize=64)
def degree_of(unknowns: pde.Unknowns, matrix: Matrix) -> int:
    """The degree of the unknowns in the matrix."""
    return max(
        len(by) - unknowns.functions[number].order for row in matrix.entries for number, by in row
    )


@lru_cache(maxsize=64)
def _places(unknowns: pde.Unknowns, matrix: Matrix) -> tuple[tuple[int, int, int, int], ...]:
    """Row, column, unknown, and factor of each entry."""
    return tuple(
        (i, j, *pde.column_of(unknowns, derivative))
        for i, row in enumerate(matrix.entries)
        for j, derivative in enumerate(row)
    )


def matrix_at(
    unknowns: pde.Unknowns, matrix: Matrix, values: Mapping[int, int] | Sequence[int], prime: int
) -> nmod_mat:
    """The matrix of a solution, from the values of the unknowns by their columns."""
    found = nmod_mat(len(matrix.entries), len(matrix.entries[0]), prime)
    for i, j, column, factor in _places(unknowns, matrix):
        found[i, j] = values[column] * factor
    return found


def consequences(prolongation: pde.Prolongation, degree: int) -> dict[int, dict[int, int]]:
    """All consequences on the unknowns up to this degree: {number of basis row: {column:
    value}}.
    """
    return prolongation.echelon.rows_within(0, prolongation.width(degree))


def generic_rank(prolongation: pde.Prolongation, matrix: Matrix) -> int:
    """The rank of the matrix at the generic solution of all rows: the larger of two random ones."""
    width = prolongation.width(degree_of(prolongation.unknowns, matrix))
    return _larger_rank(
        prolongation, matrix, lambda k: prolongation.echelon.random_solution(k, width)
    )


def rank_of_rows(prolongation: pde.Prolongation, matrix: Matrix, rows: Rows, seed: int) -> int:
    """The rank at the generic solution of some consequences on the unknowns in the matrix."""
    prime, width = (
        prolongation.local.prime,
        prolongation.width(degree_of(prolongation.unknowns, matrix)),
    )
    basis = matrices.kernel_of(matrices.matrix_of_rows(rows, width, prime))
    if basis.nrows() == 0:
        return 0
    generator = random.Random(f"regular {seed}")

    def element(_: int) -> list[int]:
        weights = nmod_mat(
            1, basis.nrows(), [generator.randrange(prime) for _ in range(basis.nrows())], prime
        )
        return list(map(int, (weights * basis).entries()))

    return _larger_rank(prolongation, matrix, element)


def _larger_rank(
    prolongation: pde.Prolongation, matrix: Matrix, element: Callable[[int], Sequence[int]]
) -> int:
    rank = 0
    for k in range(2):
        if rank < matrix.rank:
            found = matrix_at(prolongation.unknowns, matrix, element(k), prolongation.local.prime)
            rank = max(rank, found.rank())
    return rank


@dataclass(frozen=True, slots=True)
class Symbol:
    """dim M_d, dim of its prolongation, Cartan characters; involutive by Cartan's equality."""

    dimension: int
    prolonged: int
    characters: tuple[int, ...]

    @property
    def involutive(self) -> bool:
        return self.prolonged == sum(k * a for k, a in enumerate(self.characters, start=1))


def symbol_of(prolongation: pde.Prolongation, degree: int, seed: int) -> Symbol:
    """M_d of the projected system at degree d = `degree` >= 1, tested in random directions.

    M_d^(k) are the elements annihilated by k random constant derivatives; alpha_k = dim M^(k-1) -
    dim M^(k); involutive iff dim M_(d+1) = sum k alpha_k (Cartan; Bryant et al., Exterior
    Differential Systems, chapter VIII).
    """
    low, high = prolongation.width(degree - 1), prolongation.width(degree)
    rows = prolongation.echelon.cut_rows(low, high)
    dimension = high - low - (len(rows.starts) - 1)
    if dimension == 0:
        return Symbol(0, 0, (0,) * prolongation.size)
    characters = _characters(prolongation, degree, rows, seed)
    return Symbol(dimension, _prolonged(prolongation, degree, rows), characters)


@compiled
def _raise(
    rows: SparseRows, step: pde.Raised, small: Words, field: Field, raised: Indices, scaled: Words
) -> None:
    """Each entry, for the coefficient of m in d_a y, as one for that of x_a m in y: all entries for
    each a.
    """
    entries = len(rows.columns)
    for a in range(step.places.shape[1]):
        for k in range(entries):
            column = rows.columns[k]
            raised[a * entries + k] = step.places[column, a]
            scaled[a * entries + k] = multiply(
                rows.values[k], small[step.factors[column, a]], field
            )


def _prolonged(prolongation: pde.Prolongation, degree: int, rows: SparseRows) -> int:
    """dim {y of degree d + 1 : all partial derivatives lie in M_d}."""
    size, prime = prolongation.size, prolongation.local.prime
    step = pde.raised_unknowns(prolongation.unknowns, degree)
    entries = len(rows.columns)
    columns, values = np.empty(size * entries, np.int64), np.empty(size * entries, np.uint64)
    small = modular.small_numbers(prime, degree + prolongation.unknowns.most + 2)
    _raise(rows, step, small, modular.field_of(prime), columns, values)
    starts = rows.starts[None, :-1] + entries * np.arange(size)[:, None]
    echelon = Echelon(prime)
    echelon.widen(pde.count_of_degree(prolongation.unknowns, degree + 1))
    echelon.insert(SparseRows(np.append(starts.ravel(), size * entries), columns, values))
    return echelon.width - echelon.count


@compiled
def _derive(
    state: np.uint64, factors: Indices, small: Words, directions: Words, values: Words, field: Field
) -> None:
    """values[k, m, a] = directions[k, a] * (the exponent of x_a in x_a m), the directions
    random.
    """
    for k in range(directions.shape[0]):
        for a in range(directions.shape[1]):
            state += GOLDEN
            directions[k, a] = mixed(state) % field.prime
    for k in range(values.shape[0]):
        for m in range(values.shape[1]):
            for a in range(values.shape[2]):
                values[k, m, a] = multiply(directions[k, a], small[factors[m, a]], field)


def _characters(
    prolongation: pde.Prolongation, degree: int, rows: SparseRows, seed: int
) -> tuple[int, ...]:
    """alpha_1, …, alpha_m: the number of new equations among D_k y = 0, with D_k the k-th random
    derivative.

    The equations for the coefficient of a monomial m in D y, m of one degree less.
    """
    prime, size = prolongation.local.prime, prolongation.size
    step = pde.raised_unknowns(prolongation.unknowns, degree - 1)
    values, directions = (
        np.empty((size, *step.places.shape), np.uint64),
        np.empty((size, size), np.uint64),
    )
    small = modular.small_numbers(prime, degree + prolongation.unknowns.most + 1)
    _derive(np.uint64(seed), step.factors, small, directions, values, modular.field_of(prime))
    echelon = Echelon(prime)
    echelon.widen(pde.count_of_degree(prolongation.unknowns, degree))
    echelon.insert(rows)
    columns = np.tile(step.places.ravel(), size)
    dependent = echelon.insert(
        SparseRows(np.arange(0, len(columns) + 1, size), columns, values.ravel())
    )
    return tuple(int(k) for k in np.count_nonzero(~dependent.reshape(size, -1), axis=1))


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of prolongation: the highest order, a deadline (`now`), and the largest number of
    unknowns.
    """

    order: int = 7
    deadline: float = float("inf")
    unknowns: int = MOST_UNKNOWNS


class Card(Protocol):
    """A question: unknown functions, a matrix of their derivatives with a required rank, and the
    equations.
    """

    @property
    def unknowns(self) -> pde.Unknowns: ...

    @property
    def matrix(self) -> Matrix: ...

    @property
    def others(self) -> tuple[Matrix, ...]:
        """Other matrices whose ranks are reported."""

    def at(self, seed: int, order: int) -> pde.LocalEquations:
        """The equations at the random point of this seed, to this order; raises SingularPoint or
        TooLarge.
        """


@dataclass(frozen=True, slots=True)
class Finding:
    """Whether there is a solution of the required rank, or None with the reason, and the proof.

    `rows` name the prolonged equations used for a no; `symbol` at `degree`, and `history`, D_0,
    D_1, … at each order, are the involution data of a yes; `ranks` those of the matrix and of the
    others at the generic solution; `points` the primes and seeds used. For a no by series along one
    solution, `along` is the last coefficient used, and there is no order.
    """

    exists: bool | None
    order: int
    open: reasons.Open | None = None
    rows: tuple[pde.RowName, ...] = ()
    symbol: Symbol | None = None
    degree: int = 0
    history: tuple[tuple[int, ...], ...] = ()
    points: tuple[Mapping[str, int], ...] = ()
    ranks: tuple[int, ...] = ()
    along: int | None = None


@dataclass(slots=True)
class Run:
    """One run at one point."""

    card: Card
    seed: int
    limits: Limits
    progress: Progress
    expected: int = _FIRST_ORDER
    lasted: float = 0.0  # seconds of the last order
    history: list[tuple[int, ...]] = field(default_factory=list)
    # Dependent rows: as found by another run, and as found by this one.
    expected_rows: Mapping[tuple[str, int], Flags] = field(default_factory=dict)
    dependent_rows: Mapping[tuple[str, int], Flags] = field(default_factory=dict)


def settle(card: Card, seed: int, limits: Limits, progress: Progress) -> Finding:
    """Decide if two points over two primes agree and no limit is reached; otherwise stay
    undetermined.
    """
    try:
        run = Run(card, 2 * seed, limits, progress)
        first = settle_once(run)
        if first.exists is None:
            return first
        # The second run reaches the order of the first: it makes its series once, to that order,
        # and immediately tests that the rows that were redundant there are redundant here.
        again = Run(card, 2 * seed + 1, limits, progress, first.order)
        again.expected_rows = run.dependent_rows
        return _agreement(first, settle_once(again))
    except IrreducibleAtoms as problem:
        return Finding(None, 0, reasons.irreducible(problem.detail))
    except TooLarge:
        return Finding(None, 0, reasons.SERIES_TOO_LARGE)


def _agreement(first: Finding, second: Finding) -> Finding:
    same = (first.exists, first.order, first.history) == (
        second.exists,
        second.order,
        second.history,
    )
    if second.exists is None or not same:
        return Finding(None, first.order, second.open or reasons.TWO_ANSWERS)
    return replace(first, points=(*first.points, *second.points))


def settle_once(run: Run) -> Finding:
    """One run; a point where a denominator vanishes is replaced."""
    for attempt in range(_POINTS):
        try:
            return prolong(run, run.seed + 100_003 * attempt)
        except SingularPoint:
            run.history.clear()
    raise IrreducibleAtoms(
        "a denominator vanishes at every point that was tried, so it may be zero everywhere"
    )


def prolong(run: Run, seed: int) -> Finding:
    known = run.expected
    prolongation = pde.start(run.card.at(seed, known), run.expected_rows)
    run.dependent_rows = prolongation.dependent
    points = ({"prime": prolongation.local.prime, "seed": seed},)
    while True:
        order = prolongation.order + 1
        stop = limit_reached(run, prolongation, order)
        if stop:
            return _stopped(run, prolongation, stop)
        if order > known:
            known = max(order, SECOND_ORDER)
            try:
                prolongation.local = run.card.at(seed, known)
            except TooLarge:
                return _stopped(run, prolongation, reasons.too_large_series(order))
        run.progress(Stage(PROLONGATION, order=order))
        began = now()
        pde.advance(prolongation)
        run.lasted = now() - began
        run.history.append(prolongation.dimensions)
        found = _negative(run, prolongation, seed) or _positive(run, prolongation, seed)
        if found:
            return replace(
                found, history=tuple(run.history), points=points, ranks=_ranks(run, prolongation)
            )


def _stopped(run: Run, prolongation: pde.Prolongation, reason: reasons.Open) -> Finding:
    """An undetermined finding, with the progress so far."""
    return Finding(
        None,
        prolongation.order,
        reason,
        history=tuple(run.history),
        ranks=_ranks(run, prolongation),
    )


def _ranks(run: Run, prolongation: pde.Prolongation) -> tuple[int, ...]:
    """The ranks of the matrix and of the others, if there are others."""
    matrices = (run.card.matrix, *run.card.others) if run.card.others else ()
    found = []
    for matrix in matrices:
        degree = degree_of(prolongation.unknowns, matrix)
        if prolongation.order < degree:
            return ()
        found.append(generic_rank(prolongation, matrix))
    return tuple(found)


def limit_reached(run: Run, prolongation: pde.Prolongation, order: int) -> reasons.Open | None:
    """The limit in the way of this order, if there is one."""
    if order > run.limits.order:
        return reasons.not_by_order(run.limits.order)
    if now() + _GROWTH * run.lasted > run.limits.deadline:
        return reasons.time_before_order(order)
    unknowns, bits = prolongation.unknowns, 63 // prolongation.size
    total = prolongation.width(order - 1) + pde.count_of_degree(unknowns, order)
    if order + unknowns.most >= 1 << bits or total > run.limits.unknowns:
        return reasons.too_many_unknowns(order, run.limits.unknowns)
    return None


def _negative(run: Run, prolongation: pde.Prolongation, seed: int) -> Finding | None:
    matrix = run.card.matrix
    degree = degree_of(prolongation.unknowns, matrix)
    if prolongation.order < degree or _as_before(run, degree):
        return None
    if generic_rank(prolongation, matrix) == matrix.rank:
        return None
    kept = consequences(prolongation, degree)
    for number in sorted(kept, reverse=True):
        others = [row for k, row in kept.items() if k != number]
        if rank_of_rows(prolongation, matrix, others, seed) < matrix.rank:
            del kept[number]
    used = sorted(
        {original for number in kept for original in prolongation.echelon.trace({number: 1})}
    )
    return Finding(
        False, prolongation.order, rows=tuple(prolongation.row_name(number) for number in used)
    )


def _as_before(run: Run, degree: int) -> bool:
    """Whether the order before left the same values of the matrix, one of the full rank among
    them.
    """
    return len(run.history) > degree + 1 and run.history[-1][degree] == run.history[-2][degree]


def _positive(run: Run, prolongation: pde.Prolongation, seed: int) -> Finding | None:
    order, history = prolongation.order, run.history
    for degree in range(max(1, degree_of(prolongation.unknowns, run.card.matrix)), order):
        if history[order][degree] != history[order - 1][degree]:
            continue
        symbol = symbol_of(prolongation, degree, seed)
        if symbol.involutive:
            return Finding(True, order, symbol=symbol, degree=degree)
    return None


@dataclass(slots=True)
class Coefficients:
    """Series at random points; `write(order)` makes the program and its instructions for series to
    that order.

    To prolong to an order takes series to `degree` of it. `written` is the order of prolongation
    that the program serves, `constants` holds (prime, constants) for each seed.
    """

    write: Callable[[int], tuple[SeriesProgram, Integers]]
    draw: Callable[[int], Point]
    degree: Callable[[int], int] = lambda order: order + 2
    program: tuple[SeriesProgram, Integers] | None = None
    written: int = 0
    constants: dict[int, tuple[int, npt.NDArray[np.uint64]]] = field(default_factory=dict)

    def at(self, seed: int, order: int) -> tuple[int, Registers]:
        """The prime and all registers; SingularPoint where a denominator vanishes, TooLarge for too
        many words.
        """
        if self.program is None or order > self.written:
            self.written, self.constants = max(order, SECOND_ORDER), {}
            self.program = self.write(self.degree(self.written))
        series, instructions = self.program
        if seed not in self.constants:
            point = self.draw(seed)
            self.constants[seed] = (point.prime, constants_at(series, point))
        prime, constants = self.constants[seed]
        return prime, run(series, instructions, constants, prime, self.degree(order))


def prolonged(card: Card, seed: int, order: int) -> pde.Prolongation:
    """All rows up to the order at the point of this seed; SingularPoint where the coefficients have
    no value there.
    """
    prolongation = pde.start(card.at(seed, order))
    for _ in range(order + 1):
        pde.advance(prolongation)
    return prolongation


def solution_of(
    card: Card, prolongation: pde.Prolongation, degree: int, choose: Choice
) -> dict[Unknown, int] | None:
    """A solution of all rows, in the unknowns up to this degree; None where its matrix is below the
    rank asked for.

    An unknown that is the pivot of a row follows from those before it, the others are chosen.
    """
    names = [
        name for d in range(degree + 1) for name in pde.unknown_names(prolongation.unknowns, d)
    ]
    prime, values = prolongation.local.prime, dict[int, int]()
    rows = {max(row): row for row in prolongation.echelon.rows_within(0, len(names)).values()}
    for column, name in enumerate(names):
        if column in rows:  # the entry of the pivot is 1
            values[column] = (
                -sum(x * values[k] for k, x in rows[column].items() if k != column) % prime
            )
        else:
            values[column] = choose(name, prime) % prime
    if matrix_at(card.unknowns, card.matrix, values, prime).rank() < card.matrix.rank:
        return None
    return {name: values[column] for column, name in enumerate(names)}


def halved_squares(unknown: Unknown, prime: int) -> int:
    """1/2 for the square of a displacement, 0 for all else: a choice."""
    return pow(2, -1, prime) if sum(unknown[1]) == 2 and 2 in unknown[1] else 0
