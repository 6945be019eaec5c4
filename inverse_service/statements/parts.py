"""The parts of a result that are finished one after the other, under the names that people see."""

from enum import StrEnum


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


def existence(timed: bool) -> Part:
    """The verdict on L(t, q, q') if `timed`, else on L(q, q')."""
    return Part.EXISTENCE_WITH_TIME if timed else Part.EXISTENCE


def lagrangian(timed: bool) -> Part:
    """L of the question for L(t, q, q') if `timed`, else of that for L(q, q')."""
    return Part.LAGRANGIAN_WITH_TIME if timed else Part.LAGRANGIAN


# The parts of which one is still sought where a Lagrangian may yet be found.
OF_LAGRANGIANS = frozenset(
    (
        Part.EXISTENCE,
        Part.EXISTENCE_WITH_TIME,
        Part.LAGRANGIAN,
        Part.LAGRANGIAN_WITH_TIME,
    )
)
