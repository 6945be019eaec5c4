"""Lagrangians of systems that are quadratic in the velocities, with a quadratic integral in
denominators.

The geodesics of a group that acts on a plane are an example: on the group there is an invariant
form D, and the velocities in the plane have quadratic terms over D. Such terms are sought among the
products of velocities, coordinates and powers of D, one degree at a time in the scalings of f.
"""

from __future__ import annotations

from collections.abc import Iterator

from inverse_service import bounds
from inverse_service.expressions import terms as tm, tree as ex
from inverse_service.mechanics import first_integrals, grading
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search import homogeneous, material as mt, reductions

_MOST_PRODUCTS = 40_000
_LIMITS = {"velocity": 3, "coordinate": 3}
_SECONDS = 1.0  # for integrals of a part of the system


def closed_parts(system: SecondOrderSystem) -> list[SecondOrderSystem]:
    """The systems of the coordinates that one coordinate needs, without the whole system, the
    largest first.
    """
    found = dict.fromkeys(reductions.closures(system).values())
    parts = [group for group in found if 1 < len(group) < len(system.coordinates)]
    return [
        reductions.block_of(system, group)
        for group in sorted(parts, key=lambda group: (-len(group), sorted(group)))
    ]


def applies(material: mt.Material) -> bool:
    """Whether f is a polynomial of degree 2 in the velocities and coordinates alone, and a part of
    the system is closed.
    """
    system = material.analysis.system
    plain = {*map(ex.Symbol, system.coordinates), *map(ex.Velocity, system.coordinates)}
    return (
        not system.parameters
        and not system.functions
        and all(
            p in plain and e in (1, 2) for f in material.motion.forces for key in f for p, e in key
        )
        and all(_degree(key) == 2 for f in material.motion.forces for key in f)
        and bool(closed_parts(system))
    )


def _degree(key: tm.Monomial) -> int:
    return sum(int(e) for p, e in key if isinstance(p, ex.Velocity))


def propose(material: mt.Material, seed: int) -> Iterator[ex.Expression]:
    """Lagrangians of the simplest degrees that contain regular ones, for each quadratic integral of
    a closed part.
    """
    system = material.analysis.system
    for part in closed_parts(system)[: bounds.FEW]:
        for one in first_integrals.first_integrals(
            first_integrals.unconstrained_motion(part), None, seed, _SECONDS
        ):
            terms = tm.terms_of(one.expression)
            if all(_degree(key) == 2 for key in terms) and not ex.holds(one.expression, ex.TIME):
                yield from _with(material, seed, tm.monomial(tm.tree_of(terms)))


def _with(material: mt.Material, seed: int, form: tm.Monomial) -> Iterator[ex.Expression]:
    names = material.analysis.system.coordinates
    blocks = [
        grading.Block(tm.monomial(v), range(3), "velocity", moves=True)
        for v in material.motion.velocities
    ]
    blocks.append(grading.Block(form, range(-1, 2), bends=True))
    blocks += [grading.Block(tm.monomial(ex.Symbol(q)), range(3), "coordinate") for q in names]
    yield from homogeneous.lagrangians_of_products(material, seed, blocks, _LIMITS, _MOST_PRODUCTS)
