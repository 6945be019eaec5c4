"""Free Lagrangians of the class for its second and third associated systems (without a force), with H.

    L = I_1 r1'^2/2 + sum over the places F of I_i w_i^2/2 + w^T S w/(2 r1')       w = (r2', s_1', ...)
    H = (p_r1 + p^T S^-1 p/2)^2/(2 I_1) + sum over F of p_i^2/(2 I_i)

second   S = diag(1/u_i), F empty (L1 of Proposition 1), or F = {r2} where N is constant (L2)
third    S and F of `rotation`
On the constraints S u is constant on the places coupled, so that their image is linear in the momenta.
They are proposals: nothing is claimed of them until the checker has confirmed them.
Source: Propositions 1 and 2 of the paper named in `paper_class`; `rotation` for the third.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from inverse_service.expressions.tree import HALF, ZERO, Expression, Velocity, add, number
from inverse_service.field.exact_field import TooLarge
from inverse_service.mechanics.euler_lagrange import momenta
from inverse_service.mechanics.legendre.transform import LegendreTransform, momentum_symbols
from inverse_service.mechanics.nonholonomic.paper_class import PaperClass, rotation
from inverse_service.mechanics.writing import tidied

Matrix = Sequence[Sequence[Expression]]


@dataclass(frozen=True, slots=True)
class PaperLagrangian:
    """A proposal: its Lagrangian, its Legendre transform, and the image of the constraints in phase space.

    `label` names it for people. `images` is empty where u is constant and nothing is coupled.
    """

    label: str
    lagrangian: Expression
    transform: LegendreTransform
    images: tuple[Expression, ...]


def propose_lagrangians(member: PaperClass, kind: str) -> tuple[PaperLagrangian, ...]:
    """The proposals for one kind of associated system; none for the first, and none where there is a force.

    None either where they would be too large or the time of the member's ring is over: nobody need propose.
    """
    if member.has_force or kind not in ("second", "third"):
        return ()
    try:
        return _of_second(member) if kind == "second" else (_of_third(member),)
    except (TooLarge, ZeroDivisionError):
        return ()


def _of_second(member: PaperClass) -> tuple[PaperLagrangian, ...]:
    directions = member.directions
    if any(entry.is_zero for entry in directions):
        return ()
    trees = [member.geometry.tree(entry) for entry in directions]
    size = len(trees)
    density = member.density
    form: list[list[Expression]] = [[ZERO] * size for _ in range(size)]
    inverse: list[list[Expression]] = [[ZERO] * size for _ in range(size)]
    for place, tree in enumerate(trees):
        sign = number(1 if place == 0 else -1)
        form[place][place] = tidied(sign / (density * tree))
        inverse[place][place] = tidied(sign * density * tree)
    everything = tuple(range(size))
    first = _proposal(member, "first Lagrangian of Proposition 1", form, inverse, everything)
    if not member.density_is_constant:
        return (first,)
    return first, _proposal(member, "second Lagrangian of Proposition 1", form, inverse, everything[1:])


def _of_third(member: PaperClass) -> PaperLagrangian:
    turned = rotation(member)
    return _proposal(member, "Lagrangian of the rotation", turned.form, turned.inverse, turned.turning)


def _proposal(member: PaperClass, label: str, form: Matrix, inverse: Matrix, coupled: Sequence[int]) -> PaperLagrangian:
    names = member.geometry.system.coordinates
    moving = [Velocity(names[place]) for place in member.moving]
    masses = [member.geometry.tree(mass) for mass in member.masses]
    free = [place for place in range(len(moving)) if place not in coupled]
    rate = Velocity(names[member.r1])
    kinetic = [HALF * member.geometry.tree(member.mass_of_r1) * rate**2]
    kinetic += [HALF * masses[place] * moving[place] ** 2 for place in free]
    terms = [tidied(term / rate) for term in _quadratic(form, moving, coupled)]
    lagrangian = add(*kinetic, *terms)
    transform = _transform(member, lagrangian, inverse, coupled)
    return PaperLagrangian(label, lagrangian, transform, _images(member, form, coupled, transform))


def _quadratic(matrix: Matrix, vector: Sequence[Expression], places: Sequence[int]) -> list[Expression]:
    """The terms of x^T M x / 2 over some places."""
    terms = []
    for position, i in enumerate(places):
        terms.append(HALF * matrix[i][i] * vector[i] ** 2)
        terms += [matrix[i][j] * vector[i] * vector[j] for j in places[position + 1 :]]
    return [term for term in terms if term != ZERO]


def _transform(
    member: PaperClass, lagrangian: Expression, inverse: Matrix, coupled: Sequence[int]
) -> LegendreTransform:
    """H and v(q, p) written down; r1' = (p_r1 + p^T S^-1 p/2)/I_1, w = r1' S^-1 p, w_i = p_i/I_i on F."""
    names = member.geometry.system.coordinates
    symbols, note = momentum_symbols(lagrangian, names)
    p = [symbols[place] for place in member.moving]
    mass = member.geometry.tree(member.mass_of_r1)
    masses = [member.geometry.tree(each) for each in member.masses]
    inner = add(symbols[member.r1], *(tidied(term) for term in _quadratic(inverse, p, coupled)))
    rate = inner / mass
    velocities: dict[int, Expression] = {member.r1: rate}
    energies = [HALF * inner**2 / mass]
    for i, place in enumerate(member.moving):
        if i in coupled:
            turned = add(*(tidied(inverse[i][j] * p[j]) for j in coupled if inverse[i][j] != ZERO))
            velocities[place] = turned * rate
        else:
            velocities[place] = p[i] / masses[i]
            energies.append(HALF * p[i] ** 2 / masses[i])
    found = tuple(velocities[place] for place in range(len(names)))
    functions = tuple(tidied(momentum) for momentum in momenta(lagrangian, names))
    return LegendreTransform(lagrangian, symbols, add(*energies), functions, found, False, note, found)


def _images(
    member: PaperClass, form: Matrix, coupled: Sequence[int], transform: LegendreTransform
) -> tuple[Expression, ...]:
    """The constraints in phase space: p_w is parallel to S u on the coupled places, p_i = I_i u_i c on the free ones.

    With e the first coupled place: p_i - (Su)_i/(Su)_e p_e, and I_1 p_i - I_i u_i/(Su)_e (p_r1 + ...) p_e.
    """
    p = [transform.symbols[place] for place in member.moving]
    if not coupled:
        return ()
    assert transform.velocities is not None
    directions = [member.geometry.tree(entry) for entry in member.directions]
    constants = [_row(form, directions, coupled, i) if i in coupled else ZERO for i in range(len(p))]
    first = coupled[0]
    ratios = [tidied(constants[i] / constants[first]) for i in coupled[1:]]
    found = [p[i] - ratio * p[first] for i, ratio in zip(coupled[1:], ratios, strict=True)]
    rate = transform.velocities[member.r1]
    for i in range(len(p)):
        if i not in coupled:
            factor = tidied(member.geometry.tree(member.masses[i]) * directions[i] / constants[first])
            found.append(p[i] - factor * p[first] * rate)
    return tuple(found)


def _row(matrix: Matrix, vector: Sequence[Expression], places: Sequence[int], row: int) -> Expression:
    return add(*(matrix[row][j] * vector[j] for j in places if matrix[row][j] != ZERO))
