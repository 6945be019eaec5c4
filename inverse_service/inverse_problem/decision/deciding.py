"""The decision: prolong, project, test, order by order, at one random point, then at a second.

Not variational: every g(p) that the order-r system leaves is singular. Variational: for some
degree d >= 1 the projection has stopped falling, D_d(r - 1) = D_d(r), its symbol is involutive, and
a regular g(p) is left; the projected system is then formally integrable and, f being analytic,
solutions exist through every g(p) left (Cartan, Kuranishi, Goldschmidt).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from inverse_service.algebra.echelon import Flags
from inverse_service.algebra.point import Expansion, Variable
from inverse_service.algebra.series import SingularPoint
from inverse_service.algebra.series_program import TooLarge, constants_at
from inverse_service.algebra.tower import draw_point
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import TIME, Symbol, Velocity
from inverse_service.inverse_problem.decision import involution
from inverse_service.inverse_problem.decision.analysis import Analysis, analyse
from inverse_service.inverse_problem.decision.local_program import CompiledSystem, LocalProgram, local_program
from inverse_service.inverse_problem.decision.prolongation import (
    LocalSystem,
    Prolongation,
    RowName,
    advance,
    equations,
    local_system,
    start,
    unknown_block,
)
from inverse_service.inverse_problem.outcome import SolutionSpace, Verdict
from inverse_service.mechanics.second_order_system import SecondOrderSystem

# Most negative verdicts fall at order 1, most positive ones at order 3: f is expanded for these first.
_FIRST_ORDER, _SECOND_ORDER = 1, 3
_POINTS = 4
_MOST_UNKNOWNS = 60_000


@dataclass(frozen=True, slots=True)
class Limits:
    """How far to prolong: the highest order, and a wall-clock deadline (time.monotonic)."""

    order: int = 7
    deadline: float = float("inf")


@dataclass(frozen=True, slots=True)
class Decision:
    """The verdict on one question with what proves it.

    `rows` name the prolonged equations used for a negative verdict; `space` and `symbol` (at
    `degree`) the involution data of a positive one; `points` the primes and seeds used.
    """

    verdict: Verdict
    with_time: bool
    order: int
    reason: str = ""
    rows: tuple[RowName, ...] = ()
    space: SolutionSpace | None = None
    symbol: involution.Symbol | None = None
    degree: int = 0
    history: tuple[tuple[int, ...], ...] = ()
    points: tuple[Mapping[str, int], ...] = ()
    seconds: float = 0.0


Progress = Callable[[str], None]
# X, N, Phi for (with_time, seed, order): another way to expand f than from its tree.
Expander = Callable[[bool, int, int], LocalSystem]


@dataclass(slots=True)
class _Kept:
    """What both runs share: the program for prolongation up to `order`, and (prime, constants) for each seed."""

    program: LocalProgram | None = None
    order: int = 0
    constants: dict[int, tuple[int, npt.NDArray[np.uint64]]] = field(default_factory=dict)


@dataclass(slots=True)
class _Run:
    """One run at one point."""

    analysis: Analysis
    with_time: bool
    seed: int
    limits: Limits
    progress: Progress
    expected: int = _FIRST_ORDER
    expander: Expander | None = None
    history: list[tuple[int, ...]] = field(default_factory=list)
    # Rows that depend on others: where another run found them, and where this one did.
    expected_rows: Mapping[tuple[str, int], Flags] = field(default_factory=dict)
    dependent_rows: Mapping[tuple[str, int], Flags] = field(default_factory=dict)
    kept: _Kept = field(default_factory=_Kept)


def decide(
    system: SecondOrderSystem,
    time_dependent: bool,
    seed: int = 1,
    limits: Limits | None = None,
    progress: Progress | None = None,
    analysis: Analysis | None = None,
    expander: Expander | None = None,
) -> Decision:
    """Is there a regular L(q, v), or with `time_dependent` a regular L(t, q, v)?

    Two points over two primes must agree; `undetermined` with the reason otherwise, and where the
    atoms of f cannot be reduced or a limit is reached. f that contains t asks for L(t, q, v).
    `expander` takes the place of the expansion of the trees of f, for systems that share work.
    """
    began = time.monotonic()
    with_time = time_dependent or system.depends_on_time
    limits, report = limits or Limits(), progress or (lambda _: None)
    try:
        analysis = analysis or analyse(system)
        run = _Run(analysis, with_time, 2 * seed, limits, report, expander=expander)
        first = _decide_once(run)
        if first.verdict == "undetermined":
            return _timed(first, began)
        # The second run will go as far as the first: it expands f once, to that order, and tests at once
        # that the rows without use there are without use here.
        again = _Run(analysis, with_time, 2 * seed + 1, limits, report, first.order, expander)
        again.expected_rows, again.kept = run.dependent_rows, run.kept
        second = _decide_once(again)
    except IrreducibleAtoms as problem:
        return _timed(Decision("undetermined", with_time, 0, reason=problem.detail), began)
    return _timed(_agreement(first, second), began)


def _timed(decision: Decision, began: float) -> Decision:
    return replace(decision, seconds=time.monotonic() - began)


def _agreement(first: Decision, second: Decision) -> Decision:
    same = (first.verdict, first.order, first.history) == (second.verdict, second.order, second.history)
    if second.verdict == "undetermined" or not same:
        return Decision(
            "undetermined", first.with_time, first.order, reason=second.reason or "two random points gave two answers"
        )
    return replace(first, points=(*first.points, *second.points))


def _decide_once(run: _Run) -> Decision:
    """One run; a point where a denominator vanishes is replaced."""
    for attempt in range(_POINTS):
        try:
            return _prolong(run, run.seed + 100_003 * attempt)
        except SingularPoint:
            run.history.clear()
    raise IrreducibleAtoms("a denominator vanishes at every point tried: is it identically zero?")


def _expand(run: _Run, seed: int, order: int) -> LocalSystem | CompiledSystem:
    """X, N, Phi at the point of this seed, enough for prolongation order `order`."""
    if run.expander is not None:
        return run.expander(run.with_time, seed, order)
    system = run.analysis.system
    velocities = [Velocity(name) for name in system.coordinates]
    variables: list[Variable] = [*[TIME] * run.with_time, *(Symbol(name) for name in system.coordinates), *velocities]
    try:
        return _expanded_by_program(run, variables, velocities, seed, order)
    except TooLarge:
        expansion = Expansion(draw_point(run.analysis.tower, seed), variables, order + 2)
    speeds = [expansion.expand(v) for v in velocities]
    forces = [expansion.expand(f) for f in run.analysis.accelerations]
    return local_system(expansion.ring, speeds, forces, run.with_time)


def _expanded_by_program(
    run: _Run, variables: Sequence[Variable], velocities: Sequence[Velocity], seed: int, order: int
) -> CompiledSystem:
    """By compiled series; the program and the constants at a point are made once, for the usual order at least."""
    kept = run.kept
    if kept.program is None or order > kept.order:
        kept.order, kept.constants = max(order, _SECOND_ORDER), {}
        kept.program = local_program(variables, velocities, run.analysis.accelerations, kept.order + 2)
    if seed not in kept.constants:
        point = draw_point(run.analysis.tower, seed)
        kept.constants[seed] = (point.prime, constants_at(kept.program.series, point))
    return kept.program.at(*kept.constants[seed], order + 2)


def _prolong(run: _Run, seed: int) -> Decision:
    known = run.expected
    prolongation = start(_expand(run, seed, known), run.expected_rows)
    run.dependent_rows = prolongation.dependent
    prime = prolongation.local.ring.prime
    points = ({"prime": prime, "seed": seed},)
    while True:
        order = prolongation.order + 1
        stop = _limit_reached(run, prolongation, order)
        if stop:
            return Decision("undetermined", run.with_time, prolongation.order, stop, history=tuple(run.history))
        if order > known:
            known = max(order, _SECOND_ORDER)
            prolongation.local = _expand(run, seed, known)
            prolongation.equations = equations(prolongation.local)
        run.progress(f"prolongation to order {order}")
        advance(prolongation)
        run.history.append(tuple(prolongation.dimension(d) for d in range(order + 1)))
        found = _negative(run, prolongation, seed) or _positive(run, prolongation, seed)
        if found:
            return replace(found, points=points)


def _limit_reached(run: _Run, prolongation: Prolongation, order: int) -> str:
    """The sentence that names the limit in the way of this order, or nothing."""
    if order > run.limits.order:
        return f"not settled by order {run.limits.order} of prolongation"
    if time.monotonic() > run.limits.deadline:
        return f"the time limit came before order {order} of prolongation"
    bits = 63 // prolongation.size
    unknowns = prolongation.width(order - 1)
    if order + 2 >= 1 << bits or unknowns + len(unknown_block(prolongation, order)) > _MOST_UNKNOWNS:
        return f"order {order} of prolongation would need more than {_MOST_UNKNOWNS} unknowns"
    return ""


def _negative(run: _Run, prolongation: Prolongation, seed: int) -> Decision | None:
    if len(run.history) > 1 and run.history[-1][0] == run.history[-2][0]:
        return None  # the same values g(p) as the order before left, and there a regular one was among them
    rows = involution.value_rows(prolongation)
    if not involution.is_singular_everywhere(prolongation, list(rows.values()), seed):
        return None
    kept = dict(rows)
    for number in sorted(rows, reverse=True):
        rest = [row for k, row in kept.items() if k != number]
        if involution.is_singular_everywhere(prolongation, rest, seed):
            del kept[number]
    used = sorted({original for number in kept for original in prolongation.echelon.trace({number: 1})})
    names = tuple(prolongation.row_name(number) for number in used)
    return Decision("not_variational", run.with_time, prolongation.order, rows=names, history=tuple(run.history))


def _positive(run: _Run, prolongation: Prolongation, seed: int) -> Decision | None:
    order, history = prolongation.order, run.history
    for degree in range(1, order):
        if history[order][degree] != history[order - 1][degree]:
            continue
        symbol = involution.symbol(prolongation, degree, seed)
        if symbol.involutive:
            dimensions = history[order][: degree + 1]
            space = SolutionSpace(
                order, history[order], symbol.characters, True, statement(dimensions[-1], symbol.characters)
            )
            return Decision(
                "variational", run.with_time, order, space=space, symbol=symbol, degree=degree, history=tuple(history)
            )
    return None


def statement(dimension: int, characters: tuple[int, ...]) -> str:
    """On how many constants, or functions of how many variables, the multiplier depends."""
    highest = max((k for k, a in enumerate(characters, start=1) if a), default=0)
    if highest == 0:
        return f"the multiplier depends on {_count(dimension, 'constant')}"
    functions = _count(characters[highest - 1], "function")
    return f"the multiplier depends on {functions} of {_count(highest, 'variable')}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
