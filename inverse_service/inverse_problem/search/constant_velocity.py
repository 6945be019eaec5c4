"""Systems w'' = 0, x'' = w' A(w) x' with A = W'(w) A_0, A_0 constant, or blocks of this kind.

    L = w'^2/2 + x'^T S(W(w)) x'/(2 w'),    dS/dW = -S A_0,    S A_0 symmetric
so S = e^(WT) S(0) with T(S) = -S A_0 on the symmetric S for which S A_0 is symmetric; any A_0 has a
regular one among them (Frobenius). The closed form of e^(WT) is that of linear systems, W for t.
Groups with an abelian ideal of codimension 1 are of this kind with W = w.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.exact_ring import quotient_tree
from inverse_service.algebra.rational_functions import Budget, TooLarge
from inverse_service.algebra.real_point import RealTable
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.tree import (
    HALF,
    ONE,
    TIME,
    ZERO,
    Expression,
    Symbol,
    Velocity,
    add,
    divide,
    multiply,
    number,
    power,
    substitute,
)
from inverse_service.inverse_problem.search.carried_velocities import Block, carried
from inverse_service.inverse_problem.search.deadline import end
from inverse_service.inverse_problem.search.linear_systems import matrices as matrices
from inverse_service.inverse_problem.search.linear_systems.choice import choose
from inverse_service.inverse_problem.search.linear_systems.matrices import Matrix
from inverse_service.inverse_problem.search.linear_systems.modes import Branch, Multipliers, all_branches, asymmetry
from inverse_service.inverse_problem.search.linear_systems.reading import EIGENVALUE, LinearSystem
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.terms import tree_of

_TERMS, _WORK = 3_000, 400_000


def applies(material: Material) -> bool:
    """Whether f has this form with A constant."""
    parts = carried(material.motion)
    return parts is not None and all(block.rate == Symbol(parts.carrier.coordinate) for block in parts.blocks)


def applies_with_functions(material: Material) -> bool:
    """Whether f has this form with some A that is not constant and couples velocities; other families have the rest."""
    parts = carried(material.motion)
    return parts is not None and not applies(material) and any(len(block.velocities) > 1 for block in parts.blocks)


def propose(material: Material, seed: int) -> Sequence[Expression]:
    """Regular Lagrangians, those with a definite S first; none where the exponents are no square roots."""
    parts, table = carried(material.motion), material.analysis.real_point
    if parts is None or table is None:
        return ()
    try:
        chosen = [_choices(block, parts.carrier, table) for block in parts.blocks]
    except (TooLarge, ZeroDivisionError, KeyError):
        return ()
    if not all(chosen):
        return ()
    kinetic = multiply(HALF, power(parts.carrier, 2))
    sums = [[options[min(k, len(options) - 1)] for options in chosen] for k in range(max(map(len, chosen)))]
    return tuple(dict.fromkeys(add(kinetic, *terms) for terms in sums))


def _choices(block: Block, carrier: Velocity, table: RealTable) -> list[Expression]:
    """x'^T S x'/(2 w') for one block."""
    space = _multipliers(_linear_system(block))
    found = choose(space.system, all_branches(space, table), table)
    return [_kinetic(space.system, block, carrier, choice.branch) for choice in found]


def _linear_system(block: Block) -> LinearSystem:
    """q'' = A_0 q' in W instead of t."""
    trees = [[tree_of(entry) for entry in row] for row in block.matrix]
    budget = Budget(_TERMS, end(), _WORK)
    ring = exact_ring([tree for row in trees for tree in row], (), 0, budget, further=(EIGENVALUE,))
    damping = tuple(tuple(ring.value(tree).scaled(-1) for tree in row) for row in trees)
    none = matrices.plus(damping, damping, -1)
    return LinearSystem(ring, damping, ((ONE, none),), (ZERO,) * len(damping))


def _multipliers(system: LinearSystem) -> Multipliers:
    """The symmetric S with S A symmetric, and T(S) = -S A on them."""
    n, owner = system.size, system.ring.field
    basis, free = matrices.kernel(list(asymmetry(system.damping)), n * (n + 1) // 2, owner)
    images = [matrices.entries(matrices.product(matrices.symmetric(one, n), system.damping)) for one in basis]
    columns = [tuple(image[k] for k in free) for image in images]
    return Multipliers(system, tuple(basis), matrices.transpose(tuple(columns)) if columns else ())


def _kinetic(system: LinearSystem, block: Block, carrier: Velocity, branch: Branch) -> Expression:
    return add(*(
        multiply(collect(substitute(phi, {TIME: block.rate})), term)
        for phi, matrix in branch.parts
        for term in _quadratic_form(system, matrix, block, carrier)
    ))  # fmt: skip


def _quadratic_form(system: LinearSystem, matrix: Matrix, block: Block, carrier: Velocity) -> Iterator[Expression]:
    """The terms of x'^T G x'/(2 w')."""
    for i, j in matrices.places(system.size):
        if not matrix[i][j].is_zero:
            weight = multiply(number(Fraction(1, 1 + (i == j))), quotient_tree(system.ring, matrix[i][j]))
            yield divide(multiply(weight, block.velocities[i], block.velocities[j]), carrier)
