"""A question about a system: about which equations it is, and which Lagrangians count."""

from dataclasses import dataclass, replace
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


_OF_MOTIONS = frozenset((About.OWN, About.FIRST, About.SECOND, About.THIRD, About.REDUCED))
WITH_FRICTION = "rayleigh"  # the kind of L whose equations have more than the derivatives of L


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

    def includes(self, other: "Question") -> bool:
        """Whether each Lagrangian that answers the other question answers this one, too.

        Then a yes to the other one is a yes, and a no to this one is a no to the other. An L(q, q')
        is an L(t, q, q'), and one of a kind is one of any kind but with friction. A Lagrangian of
        an associated system has the motion; so has, with half the squares of the constraints, one
        of the reduced equations.
        """
        return (
            (self.about is other.about or (self.about is About.ANY and other.about in _OF_MOTIONS))
            and (self.timed or not other.timed)
            and (self.kind == other.kind or (not self.kind and other.kind != WITH_FRICTION))
            and (self.clock, self.case) == (other.clock, other.case)
        )

    @property
    def form(self) -> str:
        """The variables of L, as people read them: L(q, q') or L(t, q, q')."""
        return "L(t, q, q')" if self.timed else "L(q, q')"

    @property
    def certified(self) -> str:
        """The word for the variables of L in certificates and families: autonomous or
        time_dependent.
        """
        return "time_dependent" if self.timed else "autonomous"

    def widened(self, depends_on_time: bool) -> "Question":
        """This question about equations that contain t if `depends_on_time`: L may then do so,
        too.
        """
        return replace(self, timed=self.timed or depends_on_time)

    @property
    def is_about_others(self) -> bool:
        """Whether it is about other equations than the given ones, or about some of their
        Lagrangians only.
        """
        return self.about is About.REDUCED or bool(self.clock or self.kind or self.case)


PLAIN, TIMED = Question(), Question(timed=True)


def narrowest(depends_on_time: bool) -> Question:
    """The question about L(q, q'), or that about L(t, q, q') if the equations, or L, contain t."""
    return PLAIN.widened(depends_on_time)


def asked(time_dependent: bool | None, depends_on_time: bool) -> tuple[Question, ...]:
    """The questions about equations: both for `time_dependent` None; that on L(t, q, q') alone if
    they contain t.
    """
    if depends_on_time or time_dependent:
        return (TIMED,)
    return (PLAIN,) if time_dependent is False else (PLAIN, TIMED)
