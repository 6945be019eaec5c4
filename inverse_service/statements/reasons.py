"""Why a verdict, or a set of points, is open: a reason as a value, with its sentence.

Programs compare the `Reason`; people read the words. The words of all reasons of the solver are in
this file.
"""

from dataclasses import dataclass
from enum import StrEnum


class Reason(StrEnum):
    """What kept a question open.

    `TIME`: the time limit. `SIZE`: something is larger than is tried. `IRREDUCIBLE`: it is not
    known which relations hold among the functions in f. `CHECK`: the checker, or a second point,
    did not confirm what was found. `SEARCH`: it is possible, and was not found. `NOT_ASKED`,
    `NOT_YET`: nothing was tried, or nothing is known so far. `NO_POINT`: no real point is known at
    which to ask. `MANY_CELLS`: more open sets than are answered. `UNCONNECTED`: another connected
    part of an answered set; `BEYOND`: a set beyond the answered ones; `OUTSIDE_DOMAIN`: a set that
    the domain of an answer alone leaves out. `UNSOLVED`: no accelerations in solved form. `FAULT`:
    an error in the program; `STOPPED`: the run was ended before.
    """

    TIME = "time"
    SIZE = "size"
    IRREDUCIBLE = "irreducible"
    CHECK = "check"
    SEARCH = "search"
    NOT_ASKED = "not_asked"
    NOT_YET = "not_yet"
    NO_POINT = "no_point"
    MANY_CELLS = "many_cells"
    UNCONNECTED = "unconnected"
    BEYOND = "beyond"
    OUTSIDE_DOMAIN = "outside_domain"
    UNSOLVED = "unsolved"
    FAULT = "fault"
    STOPPED = "stopped"


@dataclass(frozen=True, slots=True)
class Open:
    """Why something is open, as a value and in words."""

    reason: Reason
    words: str


# Of a question.
NOT_YET = Open(Reason.NOT_YET, "This is not decided yet.")
TO_COME = Open(Reason.NOT_YET, "The computation is in progress.")
ONLY_THE_MOTION = Open(Reason.NOT_ASKED, "Only the motion was requested: see any_associated.")
TIME_WAS_OVER = Open(Reason.TIME, "The time limit for this question was reached.")
NO_TIME_TO_BEGIN = Open(Reason.TIME, "the time limit was reached before this question")
SEARCH_EXPIRED = Open(Reason.TIME, "The time limit for the search was reached.")
TWO_ANSWERS = Open(Reason.CHECK, "computations at two random points gave different answers")
SERIES_TOO_LARGE = Open(Reason.SIZE, "its series are too large")
UNSOLVED = Open(
    Reason.UNSOLVED,
    "the accelerations in solved form are too long to decide about, and no Lagrangian of the equations as "
    "given answers this",
)
TOO_LARGE_NUMBER = Open(
    Reason.SIZE,
    "A number in the computation, usually an exponent, exceeds 64 bits, so no verdict was reached.",
)
REFUSED = Open(
    Reason.FAULT,
    "The independent checker refused the certificate of this answer, so there is none; this is an error in "
    "the program.",
)
# Of a kind of Lagrangian.
KIND_NOT_FOUND = Open(
    Reason.SEARCH,
    "the conditions on the multiplier leave such a Lagrangian possible, but none was found",
)
NOT_HOMOGENEOUS = Open(Reason.SEARCH, "f contains t: no homogeneous Lagrangian is looked for")
NOT_RATIONAL = Open(
    Reason.SEARCH,
    "f is not rational, and none of the Lagrangians found has a definite Hessian at this point",
)
NO_RATIONAL_MATRIX = Open(
    Reason.SEARCH,
    "no matrix of rational numbers was found that decides this; matrices of algebraic numbers may, but are not tried",
)
POINT_OUTSIDE = Open(
    Reason.NO_POINT,
    "f has no value at this point, or the point belongs to another branch of signs",
)
POINT_IS_SPECIAL = Open(
    Reason.CHECK,
    "the check could not confirm that g takes the same values at this point as at a generic one",
)
# Of a set of points.
NO_TIME = Open(Reason.TIME, "the time was over")
NO_POINT = Open(Reason.NO_POINT, "no real point was found in this set")
UNCONNECTED = Open(Reason.UNCONNECTED, "this part is not connected with the one answered")
IN_NO_CELL = Open(Reason.BEYOND, "no solved cell contains the point")
OUTSIDE_DOMAIN = Open(Reason.OUTSIDE_DOMAIN, "the same equations hold there")
OUTSIDE_ODD_ROOTS = Open(
    Reason.OUTSIDE_DOMAIN,
    "with real odd roots of negative values the same equations hold there",
)


def irreducible(detail: str) -> Open:
    """Relations among functions, or a denominator, cannot be decided."""
    return Open(Reason.IRREDUCIBLE, detail)


def time_before_order(order: int) -> Open:
    return Open(Reason.TIME, f"the time limit came before order {order} of prolongation")


def not_by_order(order: int) -> Open:
    return Open(Reason.SIZE, f"not decided by order {order} of prolongation")


def too_many_unknowns(order: int, most: int) -> Open:
    return Open(Reason.SIZE, f"order {order} of prolongation would need more than {most} unknowns")


def too_large_series(order: int) -> Open:
    return Open(Reason.SIZE, f"order {order} of prolongation would need too large series")


def too_long(most: int) -> Open:
    """An acceleration has more than so many characters."""
    return Open(
        Reason.SIZE,
        f"an acceleration in solved form has more than {most:,} characters, too many for a certificate",
    )


def many_cells(number: str, most: int) -> Open:
    """So many combinations of signs, at most so many of which are solved."""
    return Open(
        Reason.MANY_CELLS,
        f"roots of squares and similar terms lead to {number} combinations of signs, each with a separate answer; "
        f"at most {most} are solved: write the formulas of one",
    )


def more_cells(most: int) -> Open:
    return Open(Reason.MANY_CELLS, f"more than {most} cells")


def unconfirmed(verdict: str, reasons: str) -> Open:
    """The checker did not confirm a verdict, for its reasons."""
    return Open(Reason.CHECK, f"found {verdict}, but the checker could not confirm it: {reasons}")


def unconfirmed_kind(verdict: str) -> Open:
    return Open(
        Reason.CHECK, f"found {verdict.replace('_', ' ')}, but the check could not confirm it"
    )


def many_coordinates(most: int) -> Open:
    return Open(Reason.SIZE, f"this is decided for at most {most} coordinates")


def no_clock(tried: str) -> Open:
    return Open(
        Reason.SEARCH,
        f"No Lagrangian was found with dtau = N dt for N = {tried}; others were not tried.",
    )


def other_system(what: str, problem: str) -> Open:
    """The system of an answer, or its motion, could not be compared with the document."""
    return Open(
        Reason.CHECK,
        f"An answer was found, but its {what} could not be compared with the document: {problem}",
    )


def unconfirmed_motion(verdict: str, order: int) -> Open:
    return Open(
        Reason.CHECK,
        f"the solver found {verdict.replace('_', ' ')} at order {order}, but the independent check could not "
        "confirm it",
    )
