"""The requests to the solver and its results, as trees and integers rather than text documents."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from inverse_service.expressions import tree as ex

if TYPE_CHECKING:
    from inverse_service.field.real_branch import RealTable
    from inverse_service.mechanics.first_integrals import FirstIntegral
    from inverse_service.mechanics.legendre import LegendreTransform
    from inverse_service.mechanics.second_order_system import SecondOrderSystem
    from inverse_service.statements.parts import Part as ResultPart
    from inverse_service.statements.reasons import Open

Verdict = Literal["variational", "not_variational", "undetermined"]
Matrix = tuple[tuple[ex.Expression, ...], ...]
# The solutions on the answered cells, and the remaining cells.
SoFar: TypeAlias = "tuple[tuple[Solution, ...], tuple[Left, ...]]"


@dataclass(frozen=True, slots=True)
class SolveOptions:
    """The question, the random numbers, the time limit, and the caller's suggestions.

    `time_dependent`: False asks for L(q, q'), True for L(t, q, q'), None for both. `seed` fixes the
    random points and primes, so that a run can be repeated. `time_limit` is in seconds; the solver
    checks it between its stages and returns undetermined when it expires. `ansatz`: terms among
    which the search first looks for a Lagrangian. `given`: the equations as written, each a tree
    that vanishes along the motion, with unsolved accelerations; their own multiplier is tried
    first. `series_order`: the order to which the multiplier is expanded if no closed form is found;
    None lets the solver choose. `conditions`: whether to write out Phi, nabla Phi, and R.
    `first_integrals`: whether to search for them. `reasons`: whether to explain why there is no
    Lagrangian, which `solving.with_reasons` can do later. `hand_over`: called while work continues,
    with the names of the finished and checked parts and a function that returns the solutions so
    far.
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
    hand_over: Callable[[Sequence[ResultPart], Callable[[], SoFar]], None] | None = None


@dataclass(frozen=True, slots=True)
class SolutionSpace:
    """The size of the space of multipliers: D_0, D_1, … at `order`, Cartan characters, and a
    sentence.
    """

    order: int
    dimensions: tuple[int, ...]
    characters: tuple[int, ...]
    involutive: bool
    statement: str


@dataclass(frozen=True, slots=True)
class Lagrangian:
    """A regular Lagrangian, its Hessian g, the functions that must not vanish, and its family.

    It is a Lagrangian of the system where all trees of `positive` are > 0. `reason`: why it is
    shown with another one.
    """

    expression: ex.Expression
    multiplier: Matrix
    nonzero: tuple[ex.Expression, ...]
    family: str
    positive: tuple[ex.Expression, ...] = ()
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Hamiltonian:
    """H by the Legendre transform of L, with the constraints of a nonholonomic motion in phase
    space, if any.
    """

    transform: LegendreTransform
    constraints: tuple[ex.Expression, ...] = ()


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a step: "text", a "formula" in the sentence, or a "display" formula below it.

    `letters` are the names of the theory in a formula, with their lower indices; R also without
    indices.
    """

    kind: str
    text: str
    letters: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Step:
    """One step of an explanation: its sentence, and the sentence in parts, with displayed formulas
    at the end.
    """

    text: str
    parts: tuple[Part, ...] = ()


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to one question: is there L(q, q'), or is there L(t, q, q')? `open` says why it
    is undetermined.

    `explanation` proves it; `details` say how it was found and which other proofs exist.

    It is valid at generic points where all trees of `positive` are > 0 and none of `nonzero` is 0;
    if `one_side`, only on the connected component of the certificate's point. Its proof depends on
    the signs of `sides` and is valid for general parameters: `exceptions` are equations between
    parameters for which it fails.
    """

    verdict: Verdict
    open: Open | None = None
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
class Left:
    """A set without an answer: the region where the trees are positive, with a point of it if one
    is known.
    """

    positive: tuple[ex.Expression, ...]
    near: RealTable | None
    open: Open


@dataclass(frozen=True, slots=True)
class AllIntegrals:
    """A proof that first integrals polynomial in the velocities up to a degree are combinations of
    `number` products.

    The products of those found and of `others`, 1 among them; with any coefficients that are
    analytic in q, and in t if `timed`. Those found determine the `others`, but not as polynomials.
    """

    degree: int
    number: int
    timed: bool
    certificate: Mapping[str, Any]
    others: tuple[FirstIntegral, ...] = ()


@dataclass(frozen=True, slots=True)
class Solution:
    """All results about one system; `autonomous` is None if f contains t.

    `cut` maps each part for which the time limit expired to why it is open.
    """

    system: SecondOrderSystem
    autonomous: Answer | None
    with_time: Answer | None
    conditions: Conditions | None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    cut: Mapping[ResultPart, Open] = field(default_factory=dict)
    first_integrals: tuple[FirstIntegral, ...] = ()
    all_integrals: AllIntegrals | None = None

    @property
    def main(self) -> Answer | None:
        """The answer for L(q, q'), or for L(t, q, q') if f contains t."""
        return self.with_time if self.system.depends_on_time else self.autonomous

    def answers_time(self, time_dependent: bool | None) -> bool:
        """Whether L(t, q, q') is answered first: asked for, or the only question where f contains
        t.
        """
        wants_time = time_dependent is True or self.system.depends_on_time
        return self.autonomous is None or (wants_time and self.with_time is not None)

    def first(self, time_dependent: bool | None) -> Answer | None:
        """The answer that is shown first."""
        return self.with_time if self.answers_time(time_dependent) else self.autonomous
