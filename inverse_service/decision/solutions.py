"""The requests to the solver and its results, as trees and integers rather than text documents."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from inverse_service.expressions import tree as ex
from inverse_service.statements.domains import EVERYWHERE, Domain

if TYPE_CHECKING:
    from inverse_service.field.real_branch import RealTable
    from inverse_service.mechanics.first_integrals import FirstIntegral
    from inverse_service.mechanics.legendre import LegendreTransform
    from inverse_service.mechanics.second_order_system import SecondOrderSystem
    from inverse_service.statements.questions import Question
    from inverse_service.statements.reasons import Open
    from inverse_service.statements.stages import Part as ResultPart

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
    """A regular Lagrangian, its Hessian g, its family, and the set on which it is one.

    `reason`: why it is shown with another one.
    """

    expression: ex.Expression
    multiplier: Matrix
    family: str
    domain: Domain = EVERYWHERE
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
class Statement:
    """What was found for a question: whether there is a Lagrangian; `open` says why this is
    undetermined.

    `explanation` proves it, or `why` does in words; `details` say how it was found and which other
    proofs exist. `construction` says what would give an L that has no formula. `freedom` says on
    how many functions L depends; `dissipation` is D of a natural L with friction.

    It is valid at generic points of `domain` and for general parameters: `exceptions` are equations
    between parameters for which its proof fails.
    """

    question: Question
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
    construction: Step | None = None
    domain: Domain = EVERYWHERE
    exceptions: Sequence[str] = ()
    freedom: str = ""
    dissipation: ex.Expression | None = None
    why: str = ""

    @property
    def formula(self) -> ex.Expression | None:
        """L, if one is known."""
        return None if self.lagrangian is None else self.lagrangian.expression

    def answers(self, question: Question) -> bool:
        """Whether it is about this question, or its proof is one of the answer to it."""
        if question == self.question:
            return True
        if self.verdict == "not_variational":
            return self.question.includes(question)
        return self.verdict == "variational" and question.includes(self.question)

    def place_for(self, question: Question) -> tuple[bool, bool, bool]:
        """The place among the statements that answer a question: known before open, with L before
        without, its own before what implies it.
        """
        without = self.verdict == "variational" and self.lagrangian is None
        return self.verdict == "undetermined", without, self.question != question


def implied(question: Question, found: Iterable[Statement]) -> Statement | None:
    """The best of the statements that answer a question; None if none does."""
    fitting = (one for one in found if one.answers(question))
    return min(fitting, key=lambda one: one.place_for(question), default=None)


@dataclass(frozen=True, slots=True)
class Conditions:
    """Phi and nabla_Phi as n x n trees, R as n x n x n trees (R[j][k][l] = R^j_kl)."""

    Phi: Matrix
    nabla_Phi: Matrix
    R: tuple[Matrix, ...]


@dataclass(frozen=True, slots=True)
class Left:
    """A set without an answer, with a point of it if one is known."""

    domain: Domain
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
    """All results about one system: what was `asked`, and the statements, each proved once.

    `cut` maps each part for which the time limit expired to why it is open.
    """

    system: SecondOrderSystem
    asked: tuple[Question, ...]
    statements: tuple[Statement, ...]
    conditions: Conditions | None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    cut: Mapping[ResultPart, Open] = field(default_factory=dict)
    first_integrals: tuple[FirstIntegral, ...] = ()
    all_integrals: AllIntegrals | None = None

    def answer_to(self, question: Question) -> Statement | None:
        """The statement that answers a question; None if it was not asked."""
        return implied(question, self.statements) if question in self.asked else None

    @property
    def main(self) -> Statement:
        """The answer to the first question: for L(q, q'), or for L(t, q, q') if that is the only
        one.
        """
        found = self.answer_to(self.asked[0])
        assert found is not None
        return found

    @property
    def other(self) -> Statement | None:
        """The answer to the last question, where its proof is another one and it says more."""
        found = self.answer_to(self.asked[-1])
        if found is None or found is self.main:
            return None
        says_more = found.verdict != self.main.verdict or found.formula != self.main.formula
        return found if says_more else None

    def changed(self, change: Callable[[Statement], Statement]) -> Solution:
        """The solution with each statement changed."""
        return replace(self, statements=tuple(map(change, self.statements)))
