"""Second-order systems that hold a nonholonomic motion: the motion is theirs on the constraints.

first    the accelerations as they come, all velocities written by the free ones
second   in s'', where s' = c(q) u_j with one free velocity u_j, each term with u_j has s'/c in its place
third    (r2', s')' = r1' M(r1) (r2', s') with M a rotation, in the class of `paper_class` (see `rotation`)
A velocity-free force stays what it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from inverse_service.expressions.tree import Expression, Number
from inverse_service.field.exact_field import Quotient, sum_of
from inverse_service.mechanics.nonholonomic.motion import EliminatedMotion
from inverse_service.mechanics.nonholonomic.paper_class import PaperClass, rotation
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.mechanics.writing import velocity_parts

Kind = Literal["first", "second", "third"]
KINDS: tuple[Kind, ...] = ("first", "second", "third")


@dataclass(frozen=True, slots=True)
class AssociatedSystem:
    """`system` is None where `explanation` says why this kind is not defined."""

    kind: str
    system: SecondOrderSystem | None
    explanation: str


def associated(motion: EliminatedMotion, member: PaperClass | None, reason: str, kind: Kind) -> AssociatedSystem:
    """One associated system of the motion; `reason` says why the system is outside the class, if it is."""
    if kind == "first":
        return _named(motion, kind, motion.accelerations, _FIRST)
    if kind == "second":
        return _second(motion, member)
    if member is None:
        return AssociatedSystem(kind, None, f"The third system is defined in the paper's class only: {reason}.")
    return _third(motion, member)


def with_multiples(base: AssociatedSystem, multiples: Sequence[Expression], name: str) -> AssociatedSystem:
    """f plus what a user adds to each acceleration; that it vanishes on the constraints is not tested here."""
    if base.system is None:
        return base
    system = base.system
    summed = tuple(f + extra for f, extra in zip(system.accelerations, multiples, strict=True))
    title = f"{system.name}, with multiples of the constraints"
    changed = SecondOrderSystem(system.coordinates, summed, system.parameters, system.functions, title)
    return AssociatedSystem(name, changed, f"{base.explanation} The given multiples of the constraints are added.")


_FIRST = (
    "The accelerations as d'Alembert's principle gives them, with the dependent velocities written by the free ones."
)


def _named(
    motion: EliminatedMotion, kind: str, accelerations: Sequence[Quotient], explanation: str
) -> AssociatedSystem:
    parts = motion.geometry
    trees = tuple(parts.tree(element) for element in accelerations)
    return AssociatedSystem(kind, _system(motion, kind, trees), explanation)


def _system(motion: EliminatedMotion, kind: str, accelerations: tuple[Expression, ...]) -> SecondOrderSystem:
    given = motion.geometry.system
    title = f"{given.name}, {kind} associated system" if given.name else f"{kind} associated system"
    return SecondOrderSystem(given.coordinates, accelerations, given.parameters, given.functions, title)


def _second(motion: EliminatedMotion, member: PaperClass | None) -> AssociatedSystem:
    parts, choice = motion.geometry, motion.frame
    names = parts.system.coordinates
    accelerations = list(motion.accelerations)
    for place in choice.dependent:
        row = choice.basis[place]
        columns = [j for j, entry in enumerate(row) if not entry.is_zero]
        if len(columns) > 1 or not choice.drift[place].is_zero:
            what = "several free velocities" if len(columns) > 1 else "a velocity-free term too"
            reason = f"the velocity of {names[place]} depends on {what}, so that no product is replaced in one way"
            return AssociatedSystem("second", None, f"The second system is not defined: {reason}.")
        if columns:
            free = choice.free[columns[0]]
            accelerations[place] = _replaced(motion, accelerations[place], free, place, row[columns[0]])
    plain = "In s'' = ... each term with the free velocity that s' is a multiple of has s' in its place"
    if member is None:
        return _named(motion, "second", accelerations, f"{plain} (the paper's rule, used outside its class).")
    return _named(motion, "second", accelerations, f"{plain}: r1' r2' = -r1' s'/A.")


def _replaced(motion: EliminatedMotion, element: Quotient, free: int, place: int, ratio: Quotient) -> Quotient:
    """One factor u_free of each term becomes s'/ratio."""
    parts = motion.geometry
    speed = parts.velocity(free)
    other = parts.velocity(place) / ratio
    terms = []
    for part in velocity_parts(parts.ring, element):
        holds = not parts.by_velocity(free, part).is_zero
        terms.append(part / speed * other if holds else part)
    return sum_of(parts.zero, terms)


def _third(motion: EliminatedMotion, member: PaperClass) -> AssociatedSystem:
    parts = motion.geometry
    trees = [parts.tree(element) for element in motion.accelerations]
    forces = [parts.tree(_velocity_free(motion, element)) for element in motion.accelerations]
    turned = rotation(member)
    if len(turned.turning) > 2 and any(_is_negative(parts.tree(mass)) for mass in member.masses):
        text = "The third system is not defined: with three and more turning velocities all masses have to be positive."
        return AssociatedSystem("third", None, text)
    for place, row in zip(member.moving, turned.terms(), strict=True):
        trees[place] = row + forces[place]
    return AssociatedSystem("third", _system(motion, "third", tuple(trees)), turned.explanation)


def _is_negative(mass: Expression) -> bool:
    return isinstance(mass, Number) and mass.value < 0


def _velocity_free(motion: EliminatedMotion, element: Quotient) -> Quotient:
    parts = motion.geometry
    held = [
        part
        for part in velocity_parts(parts.ring, element)
        if all(parts.by_velocity(k, part).is_zero for k in motion.frame.free)
    ]
    return sum_of(parts.zero, held)
