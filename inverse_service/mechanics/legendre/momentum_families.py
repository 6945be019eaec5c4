"""The families of Lagrangians whose momentum map is inverted in closed form, cheapest first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice, product

from inverse_service import bounds
from inverse_service.deadline import now
from inverse_service.expressions import collecting
from inverse_service.expressions import tree as ex
from inverse_service.mechanics.legendre import blocks, quadratic


@dataclass(frozen=True, slots=True)
class Reach:
    """How deep blocks may be split into smaller problems, and until when (`now`)."""

    depth: int = 4
    deadline: float = float("inf")

    @property
    def exhausted(self) -> bool:
        return self.depth <= 0 or now() > self.deadline


def block_branches(block: blocks.Block, reach: Reach) -> Iterator[blocks.Branch]:
    """Candidates for one block without linear terms; none of them is checked here."""
    yield from quadratic.quadratic_branches(block)
    if quadratic.form_matrix(collecting.expand(block.function), block.names) is not None:
        return
    # Most Lagrangians are quadratic: what solves the others is loaded for them.
    from inverse_service.mechanics.legendre.homogeneous import homogeneous_branches
    from inverse_service.mechanics.legendre.linear import linear_branches, routh_branches
    from inverse_service.mechanics.legendre.radial import radial_branches, ratio_branches
    from inverse_service.mechanics.legendre.scalar import elimination_branches, scalar_branches

    inner = partial(solve, reach=Reach(reach.depth - 1, reach.deadline))
    for family in (
        radial_branches,
        ratio_branches,
        homogeneous_branches,
        routh_branches,
        linear_branches,
        scalar_branches,
    ):
        if reach.exhausted:
            return
        yield from family(block, inner)
    if not reach.exhausted:
        yield from elimination_branches(block)


def solve(
    function: ex.Expression, names: Sequence[str], momenta: Mapping[str, ex.Symbol], reach: Reach
) -> Iterator[blocks.Branch]:
    """Candidates for any function of the velocities: products of those of its blocks."""
    parts = blocks.split(function, names, momenta)
    found = [_up_to_certain(block, reach) for block in parts.blocks]
    table = momentum_shifts(parts.linear, momenta)
    for choice in islice(product(*found), bounds.CANDIDATES):
        rates = {
            name: ex.substitute(tree, table)
            for block, branch in zip(parts.blocks, choice, strict=True)
            for name, tree in zip(block.names, blocks.resolved(branch.velocities, block.names), strict=True)
        }
        energies = [ex.substitute(branch.hamiltonian, table) for branch in choice]
        conditions = tuple(ex.substitute(condition, table) for branch in choice for condition in branch.conditions)
        velocities = tuple(rates[name] for name in names)
        yield blocks.Branch(velocities, ex.add(*energies, -parts.free), conditions)


def _up_to_certain(block: blocks.Block, reach: Reach) -> list[blocks.Branch]:
    """The candidates up to the first that claims to hold everywhere."""
    found = []
    for branch in islice(block_branches(block, reach), bounds.CANDIDATES):
        found.append(branch)
        if not branch.conditions:
            break
    return found


def momentum_shifts(
    linear: Mapping[str, ex.Expression], momenta: Mapping[str, ex.Symbol]
) -> dict[ex.Expression, ex.Expression]:
    """p -> p - A for the terms A v of a Lagrangian."""
    return {momenta[name]: momenta[name] - a for name, a in linear.items()}
