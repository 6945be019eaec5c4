"""One step of a method as a program: what the kernel writer turns into a compiled loop.

A kernel keeps its numbers in one array of doubles, handed in and out, so that a run can continue in
pieces; when it stops, it leaves a code in its status.

`plan` goes from equations F(u) = 0 to statements: eliminate, split into blocks, solve the blocks.
Unknowns whose equation has a constant pivot are eliminated symbolically; the remaining ones are put
into block triangular form (matching, then strongly connected components, Tarjan 1972), so that only
what is truly coupled is iterated. A matching assigns each unknown its own equation; the blocks are
the strongly connected components of "the equation of u contains v" (R. Tarjan, SIAM J. Comput. 1
(1972) 146), each after all that it depends on.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import symengine

from inverse_service.errors import InputError
from inverse_service.expressions.graphs import components, matching
from inverse_service.kernels.codegen.symengine_trees import (
    STEP,
    ZERO,
    Formula,
    contains,
    free_names,
    slope,
    symbol,
)

NOT_FINITE = 1
NO_CONVERGENCE, SINGULAR, GUARDED, WATCHED = 100, 200, 300, 400
CONTRACTION = 50  # of the blocks that have no determinant
TOO_SHORT, NO_START, TOO_MANY = 2, 4, 6
UNOBSERVABLE = 1000
STATUS, CLOCK, STOPPED_AT, STOPPED_VALUE = "status", "clock", "stopped_at", "stopped_value"
NOT_STARTED = {STATUS: float(NO_START), STOPPED_AT: 0.0, STOPPED_VALUE: math.nan}
# Of t or a place: its round-off. Of a place: what a motion passes in a step of the grid. Of a
# velocity: what the force of a pole gives it in a step that is refused. Of that: how well it is
# known there.
INSTANT, CREEPING, FELT, UNKNOWN = 2.3e-16, 1e-3, 1e-6, 1e-4
TRIAL = "trial"  # the length of the next step where a kernel chooses it
_LARGEST_GUARDED = 4
# Of the numbers by which rows of linear equations are divided: a smaller one would cost digits.
_SMALLEST_PIVOT = 0.01
_NO_VALUE = ("zoo", "nan", "oo")
_PARAMETER = re.compile(r"h|c\d+")


@dataclass(frozen=True, slots=True)
class Layout:
    """Places of the changing numbers (`persistent`) and, after them, of the arguments."""

    persistent: tuple[str, ...]
    arguments: tuple[str, ...]
    columns: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """All of them, in their order."""
        return (*self.persistent, *self.arguments)


def changing(program: Program) -> tuple[str, ...]:
    """State variables that a step changes."""
    return tuple(
        name
        for name, update in zip(program.state, program.updates, strict=True)
        if update is not None
    )


def layout_of(program: Program) -> Layout:
    """Status first; then state, compensations, rates of unknowns, determinants, signs, greatest
    values.
    """
    persistent = [
        *(STATUS, CLOCK, STOPPED_AT, STOPPED_VALUE),
        *((TRIAL,) if program.error is not None else ()),
        *program.state,
        *(f"{name}_low" for name in changing(program)),
        *(f"{name}_rate" for name in program.unknowns),
        *(f"{name}_trend" for name in program.guessed),
        *program.sizes,
        *(f"{which}_{k}" for k in range(len(program.solves)) for which in ("first", "last")),
        *(
            f"watch_{k}"
            for k, watch in enumerate(program.watches)
            if watch.kind in ("sign", "rank")
        ),
        *(f"maximum_{k}" for k in range(len(program.observed))),
    ]
    columns = (*changing(program), *(f"observed_{k}" for k in range(len(program.observed))))
    return Layout(tuple(persistent), program.arguments, columns)


Matrix = tuple[tuple[Formula, ...], ...]


@dataclass(frozen=True, slots=True)
class Assign:
    """name := formula."""

    name: str
    formula: Formula


@dataclass(frozen=True, slots=True)
class Solve:
    """residuals(unknowns) = 0 by Newton with the given Jacobian; one linear solve where `affine`.
    Without a Jacobian unknowns less residuals are a contraction, which is iterated until changes
    are within round-off.

    `scales` names the state variable of which each unknown is the increment ("" where there is
    none): convergence is judged against its round-off. `limit` is the Jacobian as h -> 0: where the
    actual determinant differs from that of the limit by its own size, there may be other solutions,
    and the run stops.
    `guesses` are the first ones, over the values of the step before under the same names.
    Where `tested` is False the determinant may be anything: an estimate of the error judges the
    step.
    """

    unknowns: tuple[str, ...]
    residuals: tuple[Formula, ...]
    jacobian: tuple[tuple[Formula, ...], ...]
    affine: bool
    scales: tuple[str, ...]
    limit: Matrix = ()
    tested: bool = True
    inner: tuple[Solve, ...] = ()
    guesses: tuple[Formula, ...] = ()

    @property
    def entries(self) -> list[Formula]:
        """Those of the Jacobian, row by row."""
        return [entry for row in self.jacobian for entry in row]


@dataclass(frozen=True, slots=True)
class Watch:
    """A quantity tested after each step.

    "sign" must keep its sign, "rank" also the share `limit` of its first size, "positive" and
    "domain" must be above 0, "bound" must stay below `limit` and have a value, "map" must stay
    below it where it has one. `begin` is the same quantity over the state, whose sign at the start
    is the first. A quantity is a formula, or the determinant of a matrix.
    """

    kind: str
    formula: Formula | Matrix
    quantity: str
    remedy: str
    limit: float = 1.0
    begin: Formula | None = None

    @property
    def rows(self) -> Matrix:
        """Those of the matrix, or the formula as one of its own."""
        return self.formula if isinstance(self.formula, tuple) else ((self.formula,),)

    @property
    def entries(self) -> list[Formula]:
        """Row by row."""
        return [entry for row in self.rows for entry in row]


Statement = Assign | Solve


def size_name(block: int, unknown: str) -> str:
    """Where the greatest size of the unknowns with this letter is kept; `block` counts those that
    are iterated.
    """
    return f"size_{block}_{unknown[0]}"


@dataclass(frozen=True, slots=True)
class Program:
    """`statements` compute the increments, `updates[k]` is the increment of `state[k]` (None: it
    never changes).

    `arguments` are read-only and given at run time; "h" is the (sub)step. `observed` are formulas
    of old state and increments. `error` is the squared norm of the error of a step that chooses its
    own length, which falls with its power `order`; where a step is refused, the next one must be
    longer than the root of `instant`.
    """

    state: tuple[str, ...]
    arguments: tuple[str, ...]
    statements: tuple[Statement, ...]
    updates: tuple[Formula | None, ...]
    watches: tuple[Watch, ...] = ()
    observed: tuple[tuple[str, Formula], ...] = ()
    forces: int = 0
    error: Formula | None = None
    order: int = 0
    instant: Formula | None = None

    @property
    def blocks(self) -> tuple[Solve, ...]:
        return tuple(
            statement for statement in self.statements if not isinstance(statement, Assign)
        )

    @property
    def solves(self) -> tuple[Solve, ...]:
        """Those with a determinant that is watched."""
        return tuple(block for block in self.blocks if block.jacobian and block.tested)

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Those of implicit blocks whose rates (unknown / h) are kept as the next guess."""
        return tuple(name for block in self.blocks if block.tested for name in block.unknowns)

    @property
    def guessed(self) -> tuple[str, ...]:
        """Those of the unknowns for which the change of the rate is kept, too."""
        blocks = (block for block in self.blocks if not block.affine and not block.guesses)
        return tuple(name for block in blocks for name in block.unknowns)

    @property
    def sizes(self) -> tuple[str, ...]:
        """Names of the greatest increments so far: one for each letter in each block that is
        iterated.
        """
        blocks = (block for block in self.blocks if not block.affine)
        return tuple(
            dict.fromkeys(
                size_name(k, name) for k, block in enumerate(blocks) for name in block.unknowns
            )
        )


def plan(
    equations: Sequence[Formula], unknowns: Sequence[str], scales: Mapping[str, str], guarded: bool = False,
    poles: bool = False,
) -> tuple[Statement, ...]:  # fmt: skip
    """Statements that compute the unknowns; `scales` names the state variable of which each is the
    increment.

    `guarded` blocks are compared with their determinant at h -> 0. With `poles` an unknown whose
    factor is a reciprocal, as in u/cos(q) = p, is eliminated too: u = p cos(q) is smooth where the
    equation has a pole.
    """
    left, rest, assigned = _eliminate(list(equations), list(unknowns), poles)
    statements: list[Statement] = []
    for rows, names in _blocks(left, rest):
        statements.append(_block([left[row] for row in rows], names, scales, guarded))
    return (*statements, *reversed(assigned))


class Eliminated(NamedTuple):
    """What is left of equations, and the unknowns that were solved for."""

    equations: list[Formula]
    unknowns: list[str]
    assigned: list[Assign]


def _eliminate(equations: list[Formula], unknowns: list[str], poles: bool) -> Eliminated:
    """Solve equations with a pivot that never vanishes, and substitute the solutions into the
    others.
    """
    assigned: list[Assign] = []
    while (pivot := _best_pivot(equations, unknowns, poles)) is not None:
        row, name = pivot
        variable = symbol(name)
        equation = equations.pop(row)
        factor = equation.diff(variable)
        value = -equation.subs({variable: ZERO}) / factor
        if not _is_number(factor):
            value = value.expand()
        equations[:] = [
            e.subs({variable: value}) if contains(e, variable) else e for e in equations
        ]
        unknowns.remove(name)
        assigned.append(Assign(name, value))
    return Eliminated(equations, unknowns, assigned)


def _best_pivot(
    equations: Sequence[Formula], unknowns: Sequence[str], poles: bool
) -> tuple[int, str] | None:
    """The pivot whose elimination spreads least: (equations touched, other unknowns brought in)."""
    present = [free_names(equation).intersection(unknowns) for equation in equations]

    def is_pivot(row: int, name: str) -> bool:
        factor = equations[row].diff(symbol(name))
        return _is_number(factor) or (poles and _is_reciprocal(factor, name))

    def spread(pivot: tuple[int, str]) -> tuple[int, int, int]:
        row, name = pivot
        others = len(present[row]) - 1
        return (sum(name in one for one in present) - 1) * others, others, unknowns.index(name)

    pivots = (
        (row, name)
        for row, names in enumerate(present)
        for name in unknowns
        if name in names and is_pivot(row, name)
    )
    return min(pivots, key=spread, default=None)


def _is_number(factor: Formula) -> bool:
    """A number other than zero: it vanishes nowhere, and no power of h makes a difference of
    increments large.
    """
    return factor != ZERO and not factor.free_symbols


def _is_reciprocal(whole: Formula, name: str) -> bool:
    """A number over powers of something without the unknown: it has poles but no zeros. Parameters
    may stand above.
    """
    if contains(whole, symbol(name)) or not whole.free_symbols:
        return False
    factors = whole.args if isinstance(whole, symengine.Mul) else (whole,)
    return all(
        not (names := free_names(factor))
        or all(_PARAMETER.fullmatch(one) for one in names)
        or (isinstance(factor, symengine.Pow) and factor.args[1].is_Number and factor.args[1] < 0)
        for factor in factors
    )


def _blocks(
    equations: Sequence[Formula], unknowns: Sequence[str]
) -> list[tuple[list[int], list[str]]]:
    """Rows and unknowns of the diagonal blocks, in the order in which they can be solved."""
    if not unknowns:
        return []
    present = [free_names(equation) for equation in equations]
    owners = matching(
        [[row for row, names in enumerate(present) if name in names] for name in unknowns]
    )
    row_of = {unknowns[place]: row for row, place in owners.items()}
    if len(row_of) < len(unknowns):
        raise InputError(
            "The equations of a step do not determine it: the Lagrangian is degenerate."
        )
    graph = {
        name: [other for other in unknowns if other != name and other in present[row_of[name]]]
        for name in unknowns
    }
    return [([row_of[name] for name in names], names) for names in components(graph)]


def linear_blocks(
    matrix: Sequence[Sequence[Formula]],
    right: Sequence[Formula],
    names: Sequence[str],
    tested: bool,
) -> Iterator[Statement]:
    """matrix x = right for the unknowns of these names: rows with a number among their entries are
    solved for its unknown, then one diagonal block after the other.

    A disk of five coordinates with two constraints has a block of 3 in the place of 7, which takes
    a tenth of the time. What nothing drives is 0, unless a determinant is `tested`, and is left out
    of what follows: a disk that rolls upright keeps the rate at which it turns.
    """
    table = {
        i: {j: entry for j, entry in enumerate(row) if entry != ZERO}
        for i, row in enumerate(matrix)
    }
    sides, assigned = dict(enumerate(right)), list[Assign]()
    while (pivot := _number_in(table)) is not None:
        i, j = pivot
        own, side = table.pop(i), sides.pop(i)
        factor = own.pop(j)
        rest = sum((entry * symbol(names[k]) for k, entry in own.items()), ZERO)
        assigned.append(Assign(names[j], (side - rest) / factor))
        for r, row in table.items():
            if (part := row.pop(j, None)) is None:
                continue
            share = part / factor
            sides[r] = sides[r] - share * side
            for k, entry in own.items():
                row[k] = row.get(k, ZERO) - share * entry
                if row[k] == ZERO:
                    del row[k]
    owners = matching([[i for i, row in table.items() if j in row] for j in range(len(names))])
    found = [*_solves(table, sides, names, {j: i for i, j in owners.items()}, tested)]
    yield from found
    still = {symbol(zero.name): ZERO for zero in found if isinstance(zero, Assign)}
    for one in reversed(assigned):
        formula = one.formula.subs(still)
        if formula == ZERO:
            still[symbol(one.name)] = ZERO
        yield Assign(one.name, formula)


def _number_in(table: Mapping[int, Mapping[int, Formula]]) -> tuple[int, int] | None:
    """The place of a number, not small, whose elimination fills in least."""
    columns: dict[int, int] = {}
    for row in table.values():
        for j in row:
            columns[j] = columns.get(j, 0) + 1
    found = (
        (i, j)
        for i, row in table.items()
        for j, entry in row.items()
        if _is_number(entry) and abs(float(entry)) >= _SMALLEST_PIVOT
    )
    return min(found, key=lambda at: (len(table[at[0]]) - 1) * (columns[at[1]] - 1), default=None)


def _solves(
    table: Mapping[int, Mapping[int, Formula]],
    sides: Mapping[int, Formula],
    names: Sequence[str],
    row_of: Mapping[int, int],
    tested: bool,
) -> Iterator[Statement]:
    """The diagonal blocks of the rows that are left; those of a degenerate matrix are one block. 0
    for the unknowns of one whose right-hand sides are 0, where none is `tested`.
    """
    places = sorted({j for row in table.values() for j in row} | {*row_of})
    if len(row_of) < len(table):
        raise InputError("The linear equations for the accelerations do not determine them.")
    coupled: dict[int, set[int]] = {j: set() for j in places}
    for j in places:
        for k in table[row_of[j]]:
            if k != j:
                coupled[j].add(k)
                coupled[k].add(j)
    for block in map(sorted, components({j: sorted(coupled[j]) for j in places})):
        unknowns = [names[k] for k in block]
        if not tested and all(sides[row_of[i]] == ZERO for i in block):
            yield from (Assign(name, ZERO) for name in unknowns)
            continue
        entries = tuple(tuple(table[row_of[i]].get(j, ZERO) for j in block) for i in block)
        sums = (
            sum((a * symbol(x) for a, x in zip(row, unknowns, strict=True)), ZERO)
            for row in entries
        )
        residuals = tuple(total - sides[row_of[i]] for total, i in zip(sums, block, strict=True))
        yield Solve(tuple(unknowns), residuals, entries, True, ("",) * len(block), tested=tested)


def _block(
    equations: Sequence[Formula], names: Sequence[str], scales: Mapping[str, str], guarded: bool
) -> Solve:
    variables = [symbol(name) for name in names]
    jacobian = tuple(
        tuple(slope(equation, variable) for variable in variables) for equation in equations
    )
    compared = guarded and len(names) <= _LARGEST_GUARDED
    affine = not any(
        contains(entry, variable) for row in jacobian for entry in row for variable in variables
    )
    limit = limit_at_zero_step(jacobian, variables) if compared and not affine else ()
    kept = tuple(scales.get(name, "") for name in names)
    return Solve(tuple(names), tuple(equations), jacobian, affine, kept, limit)


def limit_at_zero_step(
    jacobian: Sequence[Sequence[Formula]], variables: Sequence[Formula]
) -> Matrix:
    """The Jacobian for h -> 0 at fixed rates u/h; empty where the form does not show it."""
    rates = {variable: STEP * symbol(f"{variable}_w") for variable in variables}
    back = {symbol(f"{variable}_w"): variable / STEP for variable in variables}
    found = []
    try:
        for row in jacobian:
            moved = [entry.subs(rates) for entry in row]
            # Expanded only where it is divided by h: a power of a sum has thousands of terms.
            plain = [entry.expand() if _is_divided_by_step(entry) else entry for entry in moved]
            found.append(tuple(entry.subs({STEP: ZERO}).subs(back) for entry in plain))
    except (RuntimeError, ZeroDivisionError):
        return ()
    known = all(word not in str(entry) for row in found for entry in row for word in _NO_VALUE)
    return tuple(found) if known else ()


def _is_divided_by_step(formula: Formula) -> bool:
    """Whether h stands below in it, so that a limit needs what cancels: (d/h)^2 h."""
    if not contains(formula, STEP):
        return False
    if isinstance(formula, symengine.Pow) and formula.args[0] == STEP:
        return not (formula.args[1].is_Number and formula.args[1] > 0)
    return any(map(_is_divided_by_step, formula.args))


def used_only(
    statements: Sequence[Statement], formulas: Sequence[Formula]
) -> tuple[Statement, ...]:
    """The statements without assignments that nothing after them needs."""
    needed = {name for formula in formulas for name in free_names(formula)}
    kept: list[Statement] = []
    for statement in reversed(statements):
        if isinstance(statement, Assign):
            if statement.name not in needed:
                continue
            needed |= free_names(statement.formula)
        else:
            parts = (
                *statement.residuals,
                *statement.entries,
                *(entry for row in statement.limit for entry in row),
            )
            for one in statement.inner:
                parts = (*parts, *one.residuals, *one.entries)
            needed |= {name for part in parts for name in free_names(part)}
        kept.append(statement)
    return tuple(reversed(kept))
