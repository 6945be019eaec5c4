"""Systems w'' = 0, x'' = w' A x' with a constant matrix A, such as groups with an abelian ideal of codimension 1.

    L = w'^2/2 + x'^T S(w) x'/(2 w'),    S' = -S A,    S A symmetric
so S(w) = e^(wT) S(0) with T(S) = -S A on the symmetric S for which S A is symmetric; any A has a
regular one among them (Frobenius). The closed form of e^(wT) is that of linear systems, w for t.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.exact_trees import quotient_tree
from inverse_service.algebra.rational_functions import Budget, TooLarge
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
    walk,
)
from inverse_service.inverse_problem.search.deadline import end
from inverse_service.inverse_problem.search.linear_systems import matrices as matrices
from inverse_service.inverse_problem.search.linear_systems.choice import choose
from inverse_service.inverse_problem.search.linear_systems.matrices import Matrix
from inverse_service.inverse_problem.search.linear_systems.modes import Branch, Multipliers, all_branches, asymmetry
from inverse_service.inverse_problem.search.linear_systems.reading import EIGENVALUE, LinearSystem
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.motion import MotionTerms
from inverse_service.inverse_problem.search.terms import Terms, monomial, tree_of

_TERMS, _WORK = 3_000, 400_000


@dataclass(frozen=True, slots=True)
class Carried:
    """w', the velocities x', and A as terms."""

    carrier: Velocity
    velocities: tuple[Velocity, ...]
    matrix: tuple[tuple[Terms, ...], ...]


def carried(motion: MotionTerms) -> Carried | None:
    """The parts of f where some A is not zero, or None where f is of another kind."""
    for carrier, f in zip(motion.velocities, motion.forces, strict=True):
        if not f:
            found = _carried_by(carrier, motion)
            if found is not None and any(entry for row in found.matrix for entry in row):
                return found
    return None


def _carried_by(carrier: Velocity, motion: MotionTerms) -> Carried | None:
    moving = {*motion.coordinates, *motion.velocities, TIME}
    others = [v for v in motion.velocities if v != carrier]
    rows = []
    for v, f in zip(motion.velocities, motion.forces, strict=True):
        row: dict[Velocity, Terms] = {other: {} for other in others}
        for key, value in f.items():
            letters = dict(key)
            own = [other for other in others if letters.get(other) == 1]
            rest = key - monomial(carrier, *own)
            if letters.get(carrier) != 1 or len(own) != 1 or any(node in moving for p, _ in rest for node in walk(p)):
                return None
            row[own[0]][rest] = value
        if v != carrier:
            rows.append(tuple(row.values()))
    return Carried(carrier, tuple(others), tuple(rows))


def applies(material: Material) -> bool:
    """Whether f has this form."""
    return carried(material.motion) is not None


def propose(material: Material, seed: int) -> Sequence[Expression]:
    """Regular Lagrangians, those with a definite S first; none where the exponents are no square roots."""
    parts, table = carried(material.motion), material.analysis.real_point
    if parts is None or table is None:
        return ()
    try:
        space = _multipliers(_linear_system(parts))
        chosen = choose(space.system, all_branches(space, table), table)
        return tuple(dict.fromkeys(_lagrangian(space.system, parts, choice.branch) for choice in chosen))
    except (TooLarge, ZeroDivisionError, KeyError):
        return ()


def _linear_system(parts: Carried) -> LinearSystem:
    """q'' = A q' in w instead of t."""
    trees = [[tree_of(entry) for entry in row] for row in parts.matrix]
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


def _lagrangian(system: LinearSystem, parts: Carried, branch: Branch) -> Expression:
    w = Symbol(parts.carrier.coordinate)
    forms = (
        multiply(substitute(phi, {TIME: w}), term)
        for phi, matrix in branch.parts
        for term in _quadratic_form(system, matrix, parts)
    )
    return add(multiply(HALF, power(parts.carrier, 2)), *forms)


def _quadratic_form(system: LinearSystem, matrix: Matrix, parts: Carried) -> Iterator[Expression]:
    """The terms of x'^T G x'/(2 w')."""
    for i, j in matrices.places(system.size):
        if not matrix[i][j].is_zero:
            weight = multiply(number(Fraction(1, 1 + (i == j))), quotient_tree(system.ring, matrix[i][j]))
            yield divide(multiply(weight, parts.velocities[i], parts.velocities[j]), parts.carrier)
