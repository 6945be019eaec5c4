"""The requests to the solver, and its results: trees and integers, not text documents."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from inverse_service.expressions import tree as ex

if TYPE_CHECKING:
    from inverse_service.decision.cells import Left
    from inverse_service.mechanics.first_integrals import FirstIntegral
    from inverse_service.mechanics.legendre import LegendreTransform
    from inverse_service.mechanics.second_order_system import SecondOrderSystem

Verdict = Literal["variational", "not_variational", "undetermined"]
Matrix = tuple[tuple[ex.Expression, ...], ...]
# Solutions on the cells that are answered, and the other cells.
SoFar: TypeAlias = "tuple[tuple[Solution, ...], tuple[Left, ...]]"


@dataclass(frozen=True, slots=True)
class SolveOptions:
    """Which question, which random numbers, how long, and the caller's own ideas.

    `time_dependent`: False asks for L(q, q'), True for L(t, q, q'), None for both. `seed` fixes the random points and
    primes, so that a run can be repeated. `time_limit` is in seconds; the solver looks at it between its stages and
    ends as undetermined. `ansatz`: terms that a Lagrangian is first looked for in. `given`: the equations as they were
    written, one tree for each that vanishes along the motion, accelerations unsolved: their own multiplier is tried
    first. `series_order`: up to which order the multiplier is expanded where no closed form is found; None leaves the
    choice to the solver. `conditions`: whether Phi, nabla Phi and R are written out. `first_integrals`: whether they
    are looked for. `reasons`: whether it is said why there is no Lagrangian, which `solving.with_reasons` does later.
    `hand_over`: called with the names of the parts that are finished and checked, with what makes the
    solutions so far, while there is more to find.
    """

    time_dependent: bool | None = None
    seed: int = 1
    time_limit: float = 60.0
    ansatz: tuple[ex.Expression, ...] = ()
    given: tuple[ex.Expression, ...] = ()
    series_order: int | None = None
    conditions: bool = True
    first_integrals: bool = False
    reasons: bool = True
    hand_over: Callable[[Sequence[str], Callable[[], SoFar]], None] | None = None


def questions(time_dependent: bool | None, system: SecondOrderSystem) -> tuple[bool, bool]:
    """Whether L(q, q') is asked for, and whether L(t, q, q') is, the only question where f contains t."""
    depends = system.depends_on_time
    return not depends and time_dependent is not True, depends or time_dependent is not False


@dataclass(frozen=True, slots=True)
class SolutionSpace:
    """Size of the space of multipliers: D_0, D_1, … at `order`, Cartan characters, a sentence."""

    order: int
    dimensions: tuple[int, ...]
    characters: tuple[int, ...]
    involutive: bool
    statement: str


@dataclass(frozen=True, slots=True)
class Lagrangian:
    """A regular Lagrangian, its Hessian g, the functions that must not vanish, and its family.

    Where all trees of `positive` are > 0 it is a Lagrangian of the system. `reason`: why it is shown with another.
    """

    expression: ex.Expression
    multiplier: Matrix
    nonzero: tuple[ex.Expression, ...]
    family: str
    positive: tuple[ex.Expression, ...] = ()
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Hamiltonian:
    """H over (q, p), p of coordinate x being Symbol("p_x"); over (q, v) where `implicit`.

    `symbols[i]` names the momentum of coordinate i, `momenta[i]` is p_i(t, q, v); `note` says on
    which branch the transform was inverted, or why it was not; there every tree of `positive`, over
    (t, q, v, p), is > 0.
    """

    expression: ex.Expression
    momenta: tuple[ex.Expression, ...]
    implicit: bool
    constraints: tuple[ex.Expression, ...]
    symbols: tuple[ex.Symbol, ...]
    note: str
    positive: tuple[ex.Expression, ...]

    @classmethod
    def of(cls, found: LegendreTransform, constraints: Iterable[ex.Expression] = ()) -> Hamiltonian:
        """That of a Legendre transform, with the constraints in phase space."""
        rest = found.symbols, found.note, found.positive
        return cls(found.hamiltonian, found.momenta, found.implicit, tuple(constraints), *rest)


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a step: "text", a "formula" in the sentence, or one on "display" below it.

    `letters` are the names of the theory in a formula, with their lower indices; R without them too.
    """

    kind: str
    text: str
    letters: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Step:
    """One step of an explanation: its sentence, and this in parts, what is shown below it at the end."""

    text: str
    parts: tuple[Part, ...] = ()


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to one question: is there L(q, q'), or is there L(t, q, q')?

    `explanation` proves it, `details` say how it was found and what else proves it.

    It holds, at generic points, where all trees of `positive` are > 0 and none of `nonzero` is 0; if `one_side`, on the
    part of that set that is connected with the point of the certificate. Its proof rests on the signs of `sides`, and
    is one for general parameters: `exceptions` are equations between them where it is none.
    """

    verdict: Verdict
    reason: str = ""
    lagrangian: Lagrangian | None = None
    other_lagrangians: tuple[Lagrangian, ...] = ()
    hamiltonian: Hamiltonian | None = None
    space: SolutionSpace | None = None
    certificate: Mapping[str, Any] | None = None
    checked: Literal["valid", "incomplete", "invalid"] | None = None
    explanation: tuple[Step, ...] = ()
    details: tuple[Step, ...] = ()
    positive: tuple[ex.Expression, ...] = ()
    nonzero: tuple[ex.Expression, ...] = ()
    sides: tuple[ex.Expression, ...] = ()
    one_side: bool = False
    exceptions: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class Conditions:
    """Phi and nabla_Phi as n x n trees, R as n x n x n trees (R[j][k][l] = R^j_kl)."""

    Phi: Matrix
    nabla_Phi: Matrix
    R: tuple[Matrix, ...]


@dataclass(frozen=True, slots=True)
class Solution:
    """Everything found out about one system; `autonomous` is None where f contains t.

    `cut` names the parts for which the time was over, each with a sentence.
    """

    system: SecondOrderSystem
    autonomous: Answer | None
    with_time: Answer | None
    conditions: Conditions | None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    cut: Mapping[str, str] = field(default_factory=dict)
    first_integrals: tuple[FirstIntegral, ...] = ()

    @property
    def main(self) -> Answer | None:
        """Of L(q, q'), of L(t, q, q') where f contains t."""
        return self.with_time if self.system.depends_on_time else self.autonomous
