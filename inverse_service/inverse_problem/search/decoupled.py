"""Systems that fall apart: a Lagrangian for each block of equations that share coordinates, added up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from inverse_service.expressions.tree import Expression, Symbol, Velocity, add, walk
from inverse_service.inverse_problem.decision.analysis import analyse
from inverse_service.inverse_problem.search.found import Ladder
from inverse_service.inverse_problem.search.material import Material
from inverse_service.mechanics.second_order_system import SecondOrderSystem

_WORK_FOR_A_BLOCK = 700_000


def decoupled_blocks(system: SecondOrderSystem) -> list[SecondOrderSystem]:
    """The system as blocks: within one, coordinates occur in each other's equations, directly or by others."""
    groups: list[set[str]] = [{name} for name in system.coordinates]
    for name, f in zip(system.coordinates, system.accelerations, strict=True):
        used = {name} | _coordinates_in(f, system.coordinates)
        joined = [group for group in groups if group & used]
        groups = [group for group in groups if not group & used] + [set().union(*joined)]
    return [_block(system, group) for group in groups]


def _coordinates_in(tree: Expression, names: Sequence[str]) -> set[str]:
    found = set()
    for node in walk(tree):
        if isinstance(node, Velocity):
            found.add(node.coordinate)
        elif isinstance(node, Symbol) and node.name in names:
            found.add(node.name)
    return found


def _block(system: SecondOrderSystem, group: set[str]) -> SecondOrderSystem:
    kept = [k for k, name in enumerate(system.coordinates) if name in group]
    coordinates = tuple(system.coordinates[k] for k in kept)
    return replace(system, coordinates=coordinates, accelerations=tuple(system.accelerations[k] for k in kept))


def applies(material: Material) -> bool:
    return len(decoupled_blocks(material.analysis.system)) > 1


def propose(material: Material, seed: int, ladder: Ladder) -> list[Expression]:
    """The sum of the Lagrangians that `ladder` finds for the blocks; nothing where one has none."""
    parts = []
    for block in decoupled_blocks(material.analysis.system):
        found = ladder(analyse(block), material.motion.with_time, seed, _WORK_FOR_A_BLOCK)
        if found is None:
            return []
        parts.append(found.lagrangians[0])
    return [add(*parts)]
