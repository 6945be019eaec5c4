"""Small blocks solved equation by equation: one velocity is isolated in one momentum and put into the others.

For L = Re(z log z) with z = x' + i y': p_y = -atan(y'/x') gives y', and then p_x = log|z| + 1 gives x'.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    Expression,
    Sum,
    Symbol,
    Velocity,
    add,
    multiply,
    rebuild,
    substitute,
    subtract,
)
from inverse_service.mechanics.legendre.blocks import Block
from inverse_service.mechanics.legendre.branch import Branch
from inverse_service.mechanics.legendre.forms import quotient, simplified, velocities_in
from inverse_service.mechanics.legendre.isolation import isolate
from inverse_service.mechanics.legendre.scalar import roots_for

_LARGEST_BLOCK = 3
Equation = tuple[Symbol, Expression]
Solved = tuple[dict[str, Expression], tuple[Expression, ...]]


def elimination_branches(block: Block) -> Iterator[Branch]:
    """The branches of a block of two or three velocities; H is the energy p v - L at v(p)."""
    if not 1 < len(block.names) <= _LARGEST_BLOCK:
        return
    functions = [simplified(differentiate(block.function, Velocity(name))) for name in block.names]
    works = [multiply(Velocity(name), p) for name, p in zip(block.names, functions, strict=True)]
    energy = simplified(subtract(add(*works), block.function))
    equations = [(block.momenta[name], p) for name, p in zip(block.names, functions, strict=True)]
    for rates, conditions in _solutions(equations, block.names):
        table: dict[Expression, Expression] = {Velocity(name): tree for name, tree in rates.items()}
        velocities = tuple(simplified(rates[name]) for name in block.names)
        yield Branch(velocities, simplified(substitute(energy, table)), conditions)


def _solutions(equations: Sequence[Equation], names: Sequence[str]) -> Iterator[Solved]:
    """Every way to solve the equations one after the other, each by one of the unknowns."""
    if len(names) == 1:
        momentum, function = equations[0]
        for root in roots_for(factored_inside(function), Velocity(names[0]), momentum):
            yield {names[0]: root.value}, root.conditions
        return
    for momentum, function in equations:
        others = [equation for equation in equations if equation[0] != momentum]
        for name in names:
            for root in isolate(function, Velocity(name), momentum):
                table: dict[Expression, Expression] = {Velocity(name): root.value}
                left = [other for other in names if other != name]
                reduced = [(p, simplified(substitute(f, table))) for p, f in others]
                if all(velocities_in(f, left) for _, f in reduced):
                    yield from _completed(name, root.value, root.conditions, _solutions(reduced, left))


def _completed(
    name: str, value: Expression, conditions: tuple[Expression, ...], rest: Iterator[Solved]
) -> Iterator[Solved]:
    for rates, others in rest:
        table: dict[Expression, Expression] = {Velocity(other): tree for other, tree in rates.items()}
        yield {**rates, name: substitute(value, table)}, conditions + others


def factored_inside(tree: Expression) -> Expression:
    """The tree with every sum in it as one factored quotient, the outer ones first."""
    outer = quotient(tree) if isinstance(tree, Sum) else tree
    return rebuild(outer, factored_inside)
