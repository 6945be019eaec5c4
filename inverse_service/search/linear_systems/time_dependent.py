"""Lagrangians of linear systems q'' = -C q' - K q + b(t), quadratic with coefficients that may depend on t.

For a multiplier g(t), the simplest regular one among combinations of branches, judged at a real point,
    L = 1/2 v.g v + 1/4 v.(g C - C^T g) q - 1/2 q.S q + q.g b,    S the symmetric part of g K:
with W = (g C - C^T g)/4 antisymmetric its equations are g v' + (g' + 2W) v + (W' + S) q - g b = 0, and
(H2) says g' + 2W = g C, the antisymmetric part of g K being W' by (H3).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from fractions import Fraction

import mpmath
import numpy as np
from numpy.typing import NDArray

from inverse_service import bounds
from inverse_service.expressions.evaluation import evaluate
from inverse_service.expressions.tree import ZERO, Expression, add, multiply
from inverse_service.field.exact_ring import quotient_tree
from inverse_service.field.rational_functions import Quotient, TooLarge, common_factor
from inverse_service.field.real_point import RealTable
from inverse_service.search.linear_systems import linear_terms as matrices
from inverse_service.search.linear_systems.linear_terms import (
    LinearSystem,
    Matrix,
    linear_system,
    linear_terms,
)
from inverse_service.search.linear_systems.modes import (
    Branch,
    all_branches,
    constant_branches,
    invariant_multipliers,
)
from inverse_service.search.material import Material
from inverse_service.search.members import definite_weights
from inverse_service.search.motion_terms import MotionTerms
from inverse_service.search.terms import collected

# Of the largest eigenvalue, the least that counts as one.
_TINY = 1e-9


def choose(system: LinearSystem, branches: Sequence[Branch], table: RealTable) -> list[Branch]:
    """Regular sums of branches, at t = 0 and the real values of the parameters: definite and short ones first."""
    branches = sorted(branches, key=lambda branch: (not _is_diagonal(branch.start), _size(branch)))
    starts = [_numeric(system, branch.start, table) for branch in branches]
    count, found = len(branches), dict[tuple[Fraction, ...], tuple[bool, int]]()
    alone = [[Fraction(int(j == k)) for j in range(count)] for k in range(count)]
    first = [[Fraction(int(j < k)) for j in range(count)] for k in range(2, count + 1)]
    for weights in [*definite_weights(starts[: bounds.COLUMNS]), *alone, *first]:
        padded = [*weights, *[Fraction(0)] * (count - len(weights))]
        values = np.linalg.eigvalsh(sum(float(w) * start for w, start in zip(padded, starts, strict=True)))
        sign = -1 if values[-1] <= 0 else 1
        if min(abs(values)) > _TINY * max(abs(values)):
            size = sum(_size(branch) for w, branch in zip(padded, branches, strict=True) if w)
            found[tuple(sign * w for w in padded)] = (values[0] < 0 < values[-1], size)
    return [_combined(weights, branches) for weights in sorted(found, key=lambda one: found[one])[: bounds.FEW]]


def _numeric(system: LinearSystem, matrix: Matrix, table: RealTable) -> NDArray[np.float64]:
    with mpmath.workdps(bounds.DIGITS):
        rows = [[float(evaluate(quotient_tree(system.ring, entry), table)) for entry in row] for row in matrix]
    return np.array(rows)


def _size(branch: Branch) -> int:
    """Terms in all entries."""
    return sum(len(entry.numerator) + len(entry.exponents) for _, g in branch.parts for row in g for entry in row)


def _is_diagonal(g: Matrix) -> bool:
    return all(entry.is_zero for i, row in enumerate(g) for j, entry in enumerate(row) if i != j)


def _combined(weights: Sequence[Fraction], branches: Sequence[Branch]) -> Branch:
    """sum of weight * branch, parts with the same function of time put together."""
    chosen = [(weight, branch) for weight, branch in zip(weights, branches, strict=True) if weight]
    zero = matrices.plus(branches[0].start, branches[0].start, -1)
    start, table = zero, dict[Expression, Matrix]()
    for weight, branch in chosen:
        start = matrices.plus(start, branch.start, weight)
        for phi, g in branch.parts:
            table[phi] = matrices.plus(table.get(phi, zero), g, weight)
    return Branch(tuple((phi, g) for phi, g in table.items() if not matrices.is_zero(g)), start)


def lagrangian(system: LinearSystem, motion: MotionTerms, branch: Branch) -> Expression:
    """L as a sum over the functions of time in g."""
    scaled = _primitive(branch)
    return add(*(phi * add(*_terms(system, motion, g)) for phi, g in scaled))


def _primitive(branch: Branch) -> list[tuple[Expression, Matrix]]:
    """g over the common factor of its entries; a numerical factor keeps its sign."""
    factor = common_factor([entry for _, g in branch.parts for row in g for entry in row if not entry.is_zero])
    number = factor.constant_value
    inverse = (factor.scaled(-1) if number is not None and number < 0 else factor).inverse()
    return [(phi, matrices.times(g, inverse)) for phi, g in branch.parts]


def _terms(system: LinearSystem, motion: MotionTerms, g: Matrix) -> Iterator[Expression]:
    """The terms of L that are linear in g, without its function of time."""
    yield from _quadratic_form(system, g, motion.velocities, Fraction(1, 2))
    damped = matrices.product(g, system.damping)
    skew = matrices.plus(damped, matrices.transpose(damped), -1)
    for i, j in itertools.product(range(system.size), repeat=2):
        yield _term(system, skew[i][j].scaled(Fraction(1, 4)), motion.velocities[i], motion.coordinates[j])
    for phi, stiffness in system.stiffness:
        lowered = matrices.product(g, stiffness)
        form = matrices.plus(lowered, matrices.transpose(lowered))
        for term in _quadratic_form(system, form, motion.coordinates, Fraction(-1, 4)):
            yield phi * term
    for i, j in itertools.product(range(system.size), repeat=2):
        yield collected(_term(system, g[i][j], motion.coordinates[i]) * system.forcing[j])


def _quadratic_form(
    system: LinearSystem, form: Matrix, letters: Sequence[Expression], factor: Fraction
) -> Iterator[Expression]:
    """factor * letters.form letters for a symmetric form."""
    for i, letter in enumerate(letters):
        yield _term(system, form[i][i].scaled(factor), letter**2)
    for i, j in itertools.combinations(range(len(letters)), 2):
        yield _term(system, form[i][j].scaled(2 * factor), letters[i], letters[j])


def _term(system: LinearSystem, coefficient: Quotient, *letters: Expression) -> Expression:
    return ZERO if coefficient.is_zero else multiply(quotient_tree(system.ring, coefficient), *letters)


def is_linear(material: Material) -> bool:
    """Whether f is linear in q and v, with constant coefficients of v."""
    return linear_terms(material.motion) is not None


def linear_lagrangians(material: Material, seed: int) -> Sequence[Expression]:
    """Regular Lagrangians whose multiplier depends on t at most, the simplest first.

    None where V holds no regular matrix or the exponents are no square roots.
    """
    table = material.analysis.real_point
    try:
        system = linear_system(material) if table is not None else None
        if system is None or table is None:
            return ()
        space = invariant_multipliers(system)
        branches = all_branches(space, table) if material.motion.with_time else constant_branches(space)
        chosen = choose(system, branches, table)
        return tuple(dict.fromkeys(lagrangian(system, material.motion, branch) for branch in chosen))
    except (TooLarge, ZeroDivisionError, KeyError):
        return ()
