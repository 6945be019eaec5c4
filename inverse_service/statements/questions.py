"""A question about a system: about which equations it is, and which Lagrangians count."""

from dataclasses import dataclass
from enum import StrEnum


class About(StrEnum):
    """The equations that a question is about.

    `MAIN`: those of the document. Of a motion on constraints: `ANY` associated system, one with
    multiples of the constraints of one's `OWN`, the `FIRST`, `SECOND` or `THIRD` associated system,
    the `REDUCED` equations of the free coordinates.
    """

    MAIN = "main"
    ANY = "any"
    OWN = "own"
    FIRST = "first"
    SECOND = "second"
    THIRD = "third"
    REDUCED = "reduced"


@dataclass(frozen=True, slots=True)
class Question:
    """Is there a regular Lagrangian L(q, q'), or L(t, q, q') if `timed`, of these equations?

    `clock`: N as text, for the equations with the time tau, dtau = N dt. `kind`: of which kind L
    has to be (natural, riemannian, finsler, positive_definite, rayleigh, invariant). `case`:
    equations between parameters, or what a function is, with which the equations are asked about.
    """

    about: About = About.MAIN
    timed: bool = False
    clock: str = ""
    kind: str = ""
    case: tuple[str, ...] = ()

    @property
    def is_about_others(self) -> bool:
        """Whether it is about other equations than the given ones, or about some of their
        Lagrangians only.
        """
        return self.about is About.REDUCED or bool(self.clock or self.kind or self.case)
