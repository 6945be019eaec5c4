"""What the work is at, and what of a result is finished: stages and parts as values, which are put
into words only where a person reads them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeAlias

from inverse_service.statements.questions import Question


@dataclass(frozen=True, slots=True)
class Stage:
    """A stage that begins: its `step`, and of which of several things it is one.

    `name` is that of a method or of an ansatz, or says how far it is; `order` is that of a
    prolongation; `timed` says that the decision is about L(t, q, q'). `about` is the associated
    system of a motion on constraints, or "any".
    """

    step: str
    name: str = ""
    order: int | None = None
    timed: bool = False
    about: str = ""

    @property
    def kind(self) -> str:
        """The step of the question that it belongs to."""
        return f"{self.step} with time" if self.timed else self.step

    @property
    def text(self) -> str:
        """As people read it."""
        order = f" to order {self.order}" if self.order is not None else ""
        return "".join(
            (
                f"{self.about}: " * bool(self.about),
                self.kind,
                order,
                f": {self.name}" * bool(self.name),
            )
        )

    def of(self, about: str) -> "Stage":
        """The same stage of the question about an associated system."""
        return replace(self, about=about)


Progress: TypeAlias = Callable[[Stage], None]
DECISION, METHOD, ANSATZ, PROLONGATION = "decision", "method", "ansatz", "prolongation"


class Part(StrEnum):
    """A part of a result, under the name that people see: the first verdict and L have names
    without the time, the others with it.
    """

    MOTION = "motion"
    CONDITIONS = "conditions"
    EXISTENCE = "existence"
    EXISTENCE_WITH_TIME = "existence_with_time"
    CERTIFICATE = "certificate"
    LAGRANGIAN = "lagrangian"
    LAGRANGIAN_WITH_TIME = "lagrangian_with_time"
    HAMILTONIAN = "hamiltonian"
    FIRST_INTEGRALS = "first_integrals"
    ANY_ASSOCIATED = "any_associated"
    REDUCED = "reduced"
    CLOCK = "clock"
    KINDS = "kinds"
    FAMILY = "family"
    EXPLANATION = "explanation"


def existence(question: Question) -> Part:
    """The verdict on L(q, q') or L(t, q, q')."""
    return Part.EXISTENCE_WITH_TIME if question.timed else Part.EXISTENCE


def lagrangian(question: Question) -> Part:
    """L of the question for L(q, q') or L(t, q, q')."""
    return Part.LAGRANGIAN_WITH_TIME if question.timed else Part.LAGRANGIAN


# The parts of which one is still sought where a Lagrangian may yet be found.
OF_LAGRANGIANS = frozenset(
    (
        Part.EXISTENCE,
        Part.EXISTENCE_WITH_TIME,
        Part.LAGRANGIAN,
        Part.LAGRANGIAN_WITH_TIME,
    )
)
