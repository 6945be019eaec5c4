"""The reduction of a system to blocks that share no coordinates."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from inverse_service.decision import certify
from inverse_service.expressions import tree as ex
from inverse_service.mechanics import second_order_system
from inverse_service.search import quadratures, terms
from inverse_service.search.material import Material
from inverse_service.search.protocol import Smaller


def decoupled_blocks(system: second_order_system.SecondOrderSystem) -> list[second_order_system.SecondOrderSystem]:
    """The system as blocks: within one, coordinates occur in each other's equations, directly or by others."""
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    links = ({name} | _coordinates_in(f, system.coordinates) for name, f in pairs)
    return [_block(system, group) for group in second_order_system.connected(system.coordinates, links)]


def _coordinates_in(tree: ex.Expression, names: Sequence[str]) -> set[str]:
    found = set()
    for node in ex.walk(tree):
        if isinstance(node, ex.Velocity):
            found.add(node.coordinate)
        elif isinstance(node, ex.Symbol) and node.name in names:
            found.add(node.name)
    return found


def _block(
    system: second_order_system.SecondOrderSystem, group: Collection[str]
) -> second_order_system.SecondOrderSystem:
    kept = [k for k, name in enumerate(system.coordinates) if name in group]
    coordinates = tuple(system.coordinates[k] for k in kept)
    return replace(system, coordinates=coordinates, accelerations=tuple(system.accelerations[k] for k in kept))


def _cancelled(material: Material) -> second_order_system.SecondOrderSystem:
    """The system, with f_i as it was factored where fewer coordinates occur in it: (u x - v x)/(u - v) is x."""
    system = material.analysis.system
    pairs = zip(system.accelerations, map(terms.tree_of, material.motion.forces), strict=True)
    forces = tuple(min(pair, key=lambda tree: len(_coordinates_in(tree, system.coordinates))) for pair in pairs)
    return replace(system, accelerations=forces)


def is_decoupled(material: Material) -> bool:
    return len(decoupled_blocks(_cancelled(material))) > 1


def into_blocks(material: Material, seed: int) -> Iterator[Smaller]:
    """The blocks; the sum of their Lagrangians is one of the whole system."""
    blocks = tuple(decoupled_blocks(_cancelled(material)))
    system = material.analysis.system
    yield Smaller(blocks, material.motion.with_time, lambda found: [_sum_of(system, [trees[0] for trees in found])])


def _sum_of(system: second_order_system.SecondOrderSystem, trees: Sequence[ex.Expression]) -> ex.Expression:
    """The sum of Lagrangians of blocks, each of which may have called an integral of its own F."""
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
