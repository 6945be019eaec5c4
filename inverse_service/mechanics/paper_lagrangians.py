"""The Lagrangians of the class for its second and third associated systems (without a potential).

second   L1 = I_1 r1'^2/2 + (r2'^2/r1' + sum s_a'^2/(A_a r1'))/(2 N)
         L2 = I_1 r1'^2/2 + I_2 r2'^2/2 + sum s_a'^2/(2 N A_a r1')     where N is constant
third    L  = I_1 r1'^2/2 + sum over constant entries I_i w_i^2/2 + w^T S w/(2 r1')
They are proposals: nothing is claimed of them until the checker has confirmed them.
Source: Proposition 1 of the paper named in `paper_class`; `rotation` for the third.
"""

from __future__ import annotations

from inverse_service.expressions.tree import (
    HALF,
    Expression,
    Velocity,
    add,
    divide,
    multiply,
    power,
)
from inverse_service.mechanics.nonholonomic_writing import tidied
from inverse_service.mechanics.paper_class import PaperClass
from inverse_service.mechanics.rotation import rotation


def class_lagrangians(member: PaperClass, kind: str) -> tuple[Expression, ...]:
    """The proposals for one kind of associated system; none for the first, and none where there is a force."""
    if member.has_force:
        return ()
    if kind == "second":
        first = _of_second(member)
        return (first, _with_free_r2(member)) if member.density_is_constant else (first,)
    return (_of_third(member),) if kind == "third" else ()


def _square(name: str) -> Expression:
    return power(Velocity(name), 2)


def _kinetic(member: PaperClass) -> Expression:
    """I_1 r1'^2/2."""
    name = member.geometry.system.coordinates[member.r1]
    return multiply(HALF, member.geometry.tree(member.mass_of_r1), _square(name))


def _ratios(member: PaperClass, first: int) -> list[Expression]:
    """(1/2N) w_i^2/(u_i r1') up to signs, from place `first` on; w_i^2/2 where A_i is zero."""
    names = member.geometry.system.coordinates
    rate = Velocity(names[member.r1])
    factors = (member.geometry.ring.constant(1), *member.slopes)
    density, terms = member.density, []
    for place, factor in list(zip(member.moving, factors, strict=True))[first:]:
        if factor.is_zero:
            terms.append(multiply(HALF, _square(names[place])))
        else:
            below = multiply(member.geometry.tree(factor), rate)
            terms.append(tidied(divide(multiply(HALF, _square(names[place])), multiply(density, below))))
    return terms


def _of_second(member: PaperClass) -> Expression:
    return add(_kinetic(member), *_ratios(member, 0))


def _with_free_r2(member: PaperClass) -> Expression:
    parts = member.geometry
    mass = parts.tree(member.masses[0])
    free = multiply(HALF, mass, _square(parts.system.coordinates[member.r2]))
    return add(_kinetic(member), free, *_ratios(member, 1))


def _of_third(member: PaperClass) -> Expression:
    turned = rotation(member)
    rate = Velocity(turned.driver)
    terms = []
    for i, left in enumerate(turned.names):
        for j, right in enumerate(turned.names[: i + 1]):
            weight = HALF if i == j else divide(HALF, HALF)
            term = multiply(weight, turned.form[i][j], Velocity(left), Velocity(right))
            terms.append(tidied(divide(term, rate) if i in turned.turning else term))
    return add(_kinetic(member), *terms)
