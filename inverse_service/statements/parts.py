"""The parts of a result that are finished one after the other, under the names that people see."""

from enum import StrEnum

from inverse_service.statements.questions import Question


class Part(StrEnum):
    """A part of a result; the first verdict and L have names without the time, the others with
    it.
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
