"""Reductions: a system as blocks that share no coordinates, and with a coordinate as time."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from inverse_service.decision import certify
from inverse_service.expressions import collecting, tree as ex
from inverse_service.field import exact_field
from inverse_service.mechanics import writing
from inverse_service.mechanics.second_order_system import SecondOrderSystem, connected
from inverse_service.search import quadratures
from inverse_service.search.material import Material
from inverse_service.search.protocol import Smaller
from inverse_service.search.terms import collected, tree_of


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


def is_decoupled(material: Material) -> bool:
    return len(decoupled_blocks(_cancelled(material))) > 1


def into_blocks(material: Material, seed: int) -> Iterator[Smaller]:
    """The blocks; the sum of their Lagrangians is one of the whole system."""
    blocks = tuple(decoupled_blocks(_cancelled(material)))
    system = material.analysis.system
    timed = (material.motion.with_time,) * len(blocks)
    yield Smaller(blocks, timed, lambda found: [_sum_of(system, [trees[0] for trees in found])])


def _sum_of(system: SecondOrderSystem, trees: Sequence[ex.Expression]) -> ex.Expression:
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


def has_own_time(material: Material) -> bool:
    """Whether the paths of the motion are solutions of a system with one of the coordinates as time."""
    return any(True for _ in _along(material))


def along_a_coordinate(material: Material, seed: int) -> Iterator[Smaller]:
    """With u as time, x'' = F(u, x, dx/du): L = u' M(u, x, x'/u') + S(u, u').

    M, homogeneous of degree 1, has the equations of the paths alone (Noether's second theorem: that of u follows from
    those of x), and S is a Lagrangian of u, whose equation no other coordinate enters. L is regular if M and S are.
    """
    for u, paths, own in sorted(_along(material), key=lambda found: size(found[1].accelerations)):
        yield Smaller((paths, own), (True, material.motion.with_time), partial(_homogeneous, u))


def _along(material: Material) -> Iterator[tuple[str, SecondOrderSystem, SecondOrderSystem]]:
    """(u, the system of dx/du, that of u) for each coordinate u with u'' = f_u(u, u') such that paths have no u'."""
    system = material.analysis.system
    names = system.coordinates
    if len(names) == 1 or system.depends_on_time or is_decoupled(material):
        return
    for u, f in zip(names, system.accelerations, strict=True):
        rate, others = ex.Velocity(u), tuple(name for name in names if name != u)
        if not _coordinates_in(f, names) <= {u}:
            continue
        table: dict[ex.Expression, ex.Expression] = {ex.Velocity(x): ex.Velocity(x) * rate for x in others}
        forces = []
        for x, force in zip(names, system.accelerations, strict=True):
            if x != u:
                along = collecting.collect((ex.substitute(force, table) - ex.Velocity(x) * f) / rate**2)
                is_free = not ex.holds(along, rate)
                forces.append(along if is_free else writing.quotient(along, exact_field.Budget.short()))
        if not any(ex.holds(force, rate) for force in forces):
            timed = tuple(ex.substitute(force, {ex.Symbol(u): ex.TIME}) for force in forces)
            functions = tuple((name, tuple("t" if x == u else x for x in held)) for name, held in system.functions)
            plain = replace(system, branch=None, nonzero=(), functions=functions)
            paths = replace(plain, coordinates=others, accelerations=timed)
            yield u, paths, replace(plain, coordinates=(u,), accelerations=(f,))


def _homogeneous(u: str, found: Sequence[Sequence[ex.Expression]]) -> list[ex.Expression]:
    """u' M(u, x, x'/u') + S for each M."""
    rate, lagrangians = ex.Velocity(u), []
    for tree in found[0]:
        velocities = [node for node in ex.walk(tree) if isinstance(node, ex.Velocity)]
        table: dict[ex.Expression, ex.Expression] = {v: v / rate for v in velocities}
        lagrangians.append(collected(rate * ex.substitute(tree, {**table, ex.TIME: ex.Symbol(u)})))
    return [one + found[1][0] for one in lagrangians]


def size(trees: Sequence[ex.Expression]) -> int:
    return sum(map(ex.node_count, trees))
