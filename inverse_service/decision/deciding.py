"""The decision on a system of second order: the card of Helmholtz settled, the answer in the words of mechanics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import cast

from inverse_service.deadline import now
from inverse_service.decision.analysis import Analysis, analyze
from inverse_service.decision.kinds import helmholtz
from inverse_service.decision.kinds.restricted import ANY_FRICTION, Among, added_equations
from inverse_service.decision.local_system import LocalSystem, RowName, equations, local_system
from inverse_service.decision.solutions import SolutionSpace, Verdict
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import TIME, Symbol, Velocity
from inverse_service.field.point import Expansion, Variable, evaluate
from inverse_service.field.series_program import TooLarge
from inverse_service.field.tower import draw_point
from inverse_service.field.truncated_series import SingularPoint
from inverse_service.linear_pde.emission import LocalEquations
from inverse_service.linear_pde.involution import Matrix
from inverse_service.linear_pde.involution import Symbol as SymbolOfSystem
from inverse_service.linear_pde.involutive_form import Coefficients, Finding, Limits, settle
from inverse_service.linear_pde.unknowns import Unknowns
from inverse_service.mechanics.second_order_system import SecondOrderSystem

_VERDICTS: Mapping[bool | None, Verdict] = {True: "variational", False: "not_variational", None: "undetermined"}


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
    symbol: SymbolOfSystem | None = None
    degree: int = 0
    history: tuple[tuple[int, ...], ...] = ()
    points: tuple[Mapping[str, int], ...] = ()
    seconds: float = 0.0


Progress = Callable[[str], None]


class HelmholtzAt:
    """The card of Helmholtz for one system, at random points."""

    others: tuple[Matrix, ...] = ()

    __slots__ = ("_among", "_analysis", "_series", "_variables", "_velocities", "_with_time", "matrix", "unknowns")

    def __init__(self, analysis: Analysis, with_time: bool, among: Among = ()) -> None:
        names, self._among = analysis.system.coordinates, among
        self._analysis, self._with_time = analysis, with_time
        self._velocities = [Velocity(name) for name in names]
        self._variables: list[Variable] = [*[TIME] * with_time, *map(Symbol, names), *self._velocities]
        n, size = len(names), len(self._variables)
        self.unknowns: Unknowns = helmholtz.unknowns_of(n, size)
        self.matrix: Matrix = helmholtz.matrix_of(n, size)
        forces = analysis.accelerations
        self._series = Coefficients(
            lambda order: helmholtz.written(self._variables, self._velocities, forces, order),
            lambda seed: draw_point(analysis.tower, seed),
        )

    def at(self, seed: int, order: int) -> LocalEquations:
        """With the equations of the kind of L that is asked for."""
        found = self._of_all(seed, order)
        if not self._among:
            return found
        expansion = Expansion(draw_point(self._analysis.tower, seed), self._variables, order + 2)
        more = added_equations(self._among, expansion, self._analysis.accelerations, self.unknowns)
        own = () if ANY_FRICTION in self._among else found.equations
        return replace(found, equations=(*own, *more))

    def _of_all(self, seed: int, order: int) -> LocalEquations:
        """By compiled series; by sparse ones where those would be too large."""
        try:
            prime, registers = self._series.at(seed, order)
        except TooLarge:
            return equations(self.expanded(seed, order))
        size = len(self._variables)
        return helmholtz.compiled_equations(len(self._velocities), size, prime, order, registers)

    def expanded(self, seed: int, order: int) -> LocalSystem:
        """X, N, Phi by sparse series at the point of this seed, for prolongation to this order."""
        point = draw_point(self._analysis.tower, seed)
        return local_system(*self._analysis.series(point, self._with_time, order + 2))


def decide(
    system: SecondOrderSystem,
    time_dependent: bool,
    seed: int = 1,
    limits: Limits | None = None,
    progress: Progress | None = None,
    analysis: Analysis | None = None,
    among: Among = (),
) -> Decision:
    """Is there a regular L(q, v), or with `time_dependent` a regular L(t, q, v)?

    Two points over two primes must agree; `undetermined` with the reason otherwise, and where the
    atoms of f cannot be reduced or a limit is reached. f that contains t asks for L(t, q, v).
    `among`: only Lagrangians of a kind are asked about.
    """
    began = now()
    with_time = time_dependent or system.depends_on_time
    try:
        analysis = analysis or analyze(system)
        found = None if among else _of_one_coordinate(analysis, with_time, seed)
        if found is None:
            card = HelmholtzAt(analysis, with_time, among)
            found = settle(card, seed, limits or Limits(), progress or (lambda _: None))
    except IrreducibleAtoms as problem:
        return Decision("undetermined", with_time, 0, reason=problem.detail)
    return replace(_decision(found, with_time), seconds=now() - began)


def _of_one_coordinate(analysis: Analysis, with_time: bool, seed: int) -> Finding | None:
    """Always yes where f has values: g has to solve Gamma(g) + g df/dv = 0 alone (Darboux 1894, no. 604).

    No displacement is characteristic, so g on t = 0, or on q = 0, is arbitrary. None for more coordinates.
    """
    if len(analysis.system.coordinates) > 1:
        return None
    point = draw_point(analysis.tower, seed)
    try:
        evaluate(analysis.accelerations[0], point, {})
    except SingularPoint:
        return None
    symbol = SymbolOfSystem(2, 3, (1, 1, 0)) if with_time else SymbolOfSystem(1, 1, (1, 0))
    history = ((1,), (1, 3), (1, 3, 6)) if with_time else ((1,), (1, 2), (1, 2, 3))
    points = ({"prime": point.prime, "seed": seed},)
    return Finding(True, 2, symbol=symbol, degree=1, history=history, points=points)


def _decision(found: Finding, with_time: bool) -> Decision:
    space, symbol = None, found.symbol
    if symbol is not None:
        dimensions = found.history[found.order]
        words = statement(dimensions[found.degree], symbol.characters)
        space = SolutionSpace(found.order, dimensions, symbol.characters, True, words)
    rows = cast(tuple[RowName, ...], found.rows)
    return Decision(
        _VERDICTS[found.exists], with_time, found.order, found.reason, rows, space, symbol, found.degree,
        found.history, found.points,
    )  # fmt: skip


def statement(dimension: int, characters: tuple[int, ...]) -> str:
    """On how many constants, or functions of how many variables, the multiplier depends."""
    highest = max((k for k, a in enumerate(characters, start=1) if a), default=0)
    if highest == 0:
        return f"the multiplier depends on {_count(dimension, 'constant')}"
    functions = _count(characters[highest - 1], "function")
    return f"the multiplier depends on {functions} of {_count(highest, 'variable')}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
