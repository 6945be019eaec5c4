"""One candidate for the inverse of a momentum map, before it is checked."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from inverse_service.expressions.tree import Expression, Symbol, Velocity, substitute
from inverse_service.mechanics.legendre.blocks import Block


@dataclass(frozen=True, slots=True)
class Branch:
    """v(t, q, p) and H(t, q, p) of a block, where every tree of `conditions` (in t, q, v, p) is positive.

    A velocity may contain the Velocity of another name of the block whose own formula contains none;
    `resolved` puts that formula in.
    """

    velocities: tuple[Expression, ...]
    hamiltonian: Expression
    conditions: tuple[Expression, ...] = ()


Family = Callable[[Block], Iterator[Branch]]
Solver = Callable[[Expression, Sequence[str], Mapping[str, Symbol]], Iterator[Branch]]


def resolved(velocities: Sequence[Expression], names: Sequence[str]) -> tuple[Expression, ...]:
    """The velocities of a branch over (t, q, p) alone: no Velocity of `names` is left."""
    table: dict[Expression, Expression] = {Velocity(name): tree for name, tree in zip(names, velocities, strict=True)}
    return tuple(substitute(tree, table) for tree in velocities)
