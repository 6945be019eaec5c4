"""Blocks L = g(v_k) + v_k phi(w / v_k), w the other velocities (the rational family of the paper).

With u = w/v_k: p_w = phi'(u) and p_k = g'(v_k) + phi - u phi'(u). If phi* and g* are the Legendre
transforms, then u = phi*'(p_w), v_k = g*'(p_k + phi*(p_w)) and H = g*(p_k + phi*(p_w)).
For g = a v_k^2/2 and phi = u^T S u/2: H = (p_k + p_w^T S^-1 p_w/2)^2 / (2 a).
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from inverse_service.expressions.collecting import Expansion, expand, to_tree
from inverse_service.expressions.collecting_trees import Monomial, monomial_tree
from inverse_service.expressions.tree import (
    Expression,
    Velocity,
    add,
    divide,
    multiply,
    substitute,
)
from inverse_service.mechanics.legendre.blocks import Block, without
from inverse_service.mechanics.legendre.branch import Branch, Solver
from inverse_service.mechanics.legendre.forms import velocities_in


def ratio_branches(block: Block, solve: Solver) -> Iterator[Branch]:
    """The branches for each velocity that can play the part of v_k."""
    for pivot in block.names if len(block.names) > 1 else ():
        parts = _parts(block, pivot)
        if parts is None:
            continue
        alone, homogeneous = parts
        others = [name for name in block.names if name != pivot]
        for inner in solve(homogeneous, others, block.momenta):
            for outer in solve(alone, [pivot], block.momenta):
                yield _joined(block, pivot, inner, outer)


def _parts(block: Block, pivot: str) -> tuple[Expression, Expression] | None:
    """(g, phi(u)), u_j being written as the velocity of w_j; None where the block is not of the form."""
    rate = Velocity(pivot)
    others = [name for name in block.names if name != pivot]
    table: dict[Expression, Expression] = {Velocity(name): multiply(rate, Velocity(name)) for name in others}
    alone: list[tuple[Monomial, Fraction]] = []
    homogeneous: list[tuple[Monomial, Fraction]] = []
    for monomial, value in expand(substitute(block.function, table)).terms:
        rest = without(monomial, [pivot])
        if not velocities_in(monomial_tree(monomial), others):
            alone.append((monomial, value))
        elif (rate, Fraction(1)) in monomial and not velocities_in(monomial_tree(rest), [pivot]):
            homogeneous.append((rest, value))
        else:
            return None
    if not alone or not homogeneous:
        return None
    return to_tree(Expansion(tuple(alone))), to_tree(Expansion(tuple(homogeneous)))


def _joined(block: Block, pivot: str, inner: Branch, outer: Branch) -> Branch:
    others = [name for name in block.names if name != pivot]
    momentum = block.momenta[pivot]
    shifted: dict[Expression, Expression] = {momentum: add(momentum, inner.hamiltonian)}
    velocities = {name: multiply(rate, Velocity(pivot)) for name, rate in zip(others, inner.velocities, strict=True)}
    velocities[pivot] = substitute(outer.velocities[0], shifted)
    ratios: dict[Expression, Expression] = {Velocity(n): divide(Velocity(n), Velocity(pivot)) for n in others}
    conditions = [substitute(condition, ratios) for condition in inner.conditions]
    conditions += [substitute(condition, shifted) for condition in outer.conditions]
    rates = tuple(velocities[name] for name in block.names)
    return Branch(rates, substitute(outer.hamiltonian, shifted), tuple(conditions))
