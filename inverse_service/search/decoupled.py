"""A system as blocks that share no coordinates, and the sum of their Lagrangians."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from inverse_service.decision import certify
from inverse_service.expressions import tree as ex
from inverse_service.mechanics.second_order_system import SecondOrderSystem, connected
from inverse_service.search import quadratures
from inverse_service.search.material import Material
from inverse_service.search.terms import tree_of


def decoupled_blocks(system: SecondOrderSystem) -> list[SecondOrderSystem]:
    """The system as blocks: within one, coordinates occur in each other's equations, directly or by others."""
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    links = ({name} | _coordinates_in(f, system.coordinates) for name, f in pairs)
    return [_block(system, group) for group in connected(system.coordinates, links)]


def _coordinates_in(tree: ex.Expression, names: Sequence[str]) -> set[str]:
    found = set()
    for node in ex.walk(tree):
        if isinstance(node, ex.Velocity):
            found.add(node.coordinate)
        elif isinstance(node, ex.Symbol) and node.name in names:
            found.add(node.name)
    return found


def _block(system: SecondOrderSystem, group: Collection[str]) -> SecondOrderSystem:
    kept = [k for k, name in enumerate(system.coordinates) if name in group]
    coordinates = tuple(system.coordinates[k] for k in kept)
    return replace(system, coordinates=coordinates, accelerations=tuple(system.accelerations[k] for k in kept))


def _cancelled(material: Material) -> SecondOrderSystem:
    """The system, with f_i as it was factored where fewer coordinates occur in it: (u x - v x)/(u - v) is x."""
    system = material.analysis.system
    pairs = zip(system.accelerations, map(tree_of, material.motion.forces), strict=True)
    forces = tuple(min(pair, key=lambda tree: len(_coordinates_in(tree, system.coordinates))) for pair in pairs)
    return replace(system, accelerations=forces)


def blocks_of(material: Material) -> list[SecondOrderSystem]:
    """The blocks of f with its common factors cancelled."""
    return decoupled_blocks(_cancelled(material))


def sum_of(system: SecondOrderSystem, trees: Sequence[ex.Expression]) -> ex.Expression:
    """The sum of Lagrangians of blocks, each of which may have named its own integral F."""
    fresh, used, found = quadratures.fresh_names(system, *trees), set[str](), []
    for tree in trees:
        own = {node.name for node in certify.walk_integrals(tree)}
        names = {name: next(fresh) for name in sorted(own & used)}
        used |= own
        found.append(_renamed(tree, names) if names else tree)
    return ex.add(*found)


def _renamed(tree: ex.Expression, names: Mapping[str, str]) -> ex.Expression:
    named = replace(tree, name=names.get(tree.name, tree.name)) if isinstance(tree, ex.Integral) else tree
    return ex.rebuild(named, lambda part: _renamed(part, names))
