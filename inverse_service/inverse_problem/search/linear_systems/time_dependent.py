"""Lagrangians of linear systems q'' = -C q' - K q + b(t), quadratic with coefficients that may depend on t.

For a multiplier g(t), the simplest regular one among combinations of branches, judged at a real point,
    L = 1/2 v.g v + 1/4 v.(g C - C^T g) q - 1/2 q.S q + q.g b,    S the symmetric part of g K:
with W = (g C - C^T g)/4 antisymmetric its equations are g v' + (g' + 2W) v + (W' + S) q - g b = 0, and
(H2) says g' + 2W = g C, the antisymmetric part of g K being W' by (H3).
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import mpmath

from inverse_service.algebra.exact_ring import quotient_tree
from inverse_service.algebra.rational_functions import Quotient, TooLarge
from inverse_service.algebra.real_point import RealTable
from inverse_service.expressions.evaluation import evaluate
from inverse_service.expressions.tree import ZERO, Expression, add, multiply, power
from inverse_service.inverse_problem.explanation.elimination import common_factor
from inverse_service.inverse_problem.search.linear_systems import matrices as matrices
from inverse_service.inverse_problem.search.linear_systems.matrices import Matrix
from inverse_service.inverse_problem.search.linear_systems.modes import (
    Branch,
    Multipliers,
    all_branches,
    constant_branches,
    invariant_multipliers,
    uniform_branches,
)
from inverse_service.inverse_problem.search.linear_systems.reading import LinearSystem, linear_system, linear_terms
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.motion import MotionTerms
from inverse_service.inverse_problem.search.terms import TooManyTerms, terms_of, tree_of

_MOST_FOUND = 3
_RANDOM_TRIES = 60
_ALL_SIGNS_UP_TO = 4
_DIGITS = 30
_TINY = mpmath.mpf(10) ** -20


@dataclass(frozen=True, slots=True)
class _Rated:
    """Integer weights of the branches, and how simple the multiplier is (smaller is better)."""

    weights: tuple[int, ...]
    rank: tuple[bool, int, int, int]


@dataclass(frozen=True, slots=True)
class Choice:
    """A regular g(t); whether it is positive definite at t = 0 and the real values of the parameters."""

    branch: Branch
    definite: bool


def choose(system: LinearSystem, branches: Sequence[Branch], table: RealTable) -> list[Choice]:
    """Regular combinations with small integers, definite and sparse ones first."""
    if not branches:
        return []
    branches = sorted(branches, key=lambda branch: (not _is_diagonal(branch.start), _size(branch)))
    with mpmath.workdps(_DIGITS):
        starts = [_numeric(system, branch.start, table) for branch in branches]
        sizes = [_size(branch) for branch in branches]
        tried = dict.fromkeys(_weights(len(branches)))
        rated = [_rate(weights, starts, sizes) for weights in tried]
    found = sorted((one for one in rated if one is not None), key=lambda one: one.rank)
    return [Choice(_combined(one.weights, branches), not one.rank[0]) for one in found[:_MOST_FOUND]]


def _numeric(system: LinearSystem, matrix: Matrix, table: RealTable) -> mpmath.matrix:
    return mpmath.matrix([[evaluate(quotient_tree(system.ring, entry), table) for entry in row] for row in matrix])


def _size(branch: Branch) -> int:
    """Terms in all entries."""
    return sum(len(entry.numerator) + len(entry.exponents) for _, g in branch.parts for row in g for entry in row)


def _is_diagonal(g: Matrix) -> bool:
    return all(entry.is_zero for i, row in enumerate(g) for j, entry in enumerate(row) if i != j)


def _weights(count: int) -> Iterator[tuple[int, ...]]:
    """Single branches, sums of the first ones, all signs of few, then random small integers."""
    for k in range(count):
        yield tuple(int(j == k) for j in range(count))
    for k in range(2, count + 1):
        yield tuple(int(j < k) for j in range(count))
    if count <= _ALL_SIGNS_UP_TO:
        yield from (w for w in itertools.product((1, 0, -1, 2), repeat=count) if any(w))
    generator = random.Random(count)
    for _ in range(_RANDOM_TRIES):
        yield tuple(generator.choice((1, 1, -1, 2, 3)) for _ in range(count))


def _rate(weights: Sequence[int], starts: Sequence[mpmath.matrix], sizes: Sequence[int]) -> _Rated | None:
    """None for a singular sum; a negative definite one changes its sign."""
    total = mpmath.zeros(starts[0].rows)
    for weight, start in zip(weights, starts, strict=True):
        total += weight * start
    values = list(mpmath.eigsy(total, eigvals_only=True))
    if min(map(abs, values)) <= _TINY * max(map(abs, values)):
        return None
    positive = sum(1 for value in values if value > 0)
    turned = tuple(-w for w in weights) if 2 * positive < len(values) else tuple(weights)
    size = sum(size for weight, size in zip(weights, sizes, strict=True) if weight)
    rank = (positive not in (0, len(values)), size, sum(map(abs, weights)), sum(1 for w in turned if w < 0))
    return _Rated(turned, rank)


def _combined(weights: Sequence[int], branches: Sequence[Branch]) -> Branch:
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
    return add(*(multiply(phi, add(*_terms(system, motion, g))) for phi, g in scaled))


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
            yield multiply(phi, term)
    for i, j in itertools.product(range(system.size), repeat=2):
        yield _expanded(multiply(_term(system, g[i][j], motion.coordinates[i]), system.forcing[j]))


def _expanded(tree: Expression) -> Expression:
    """With common factors of coefficient and force cancelled."""
    try:
        return tree_of(terms_of(tree))
    except TooManyTerms:
        return tree


def _quadratic_form(
    system: LinearSystem, form: Matrix, letters: Sequence[Expression], factor: Fraction
) -> Iterator[Expression]:
    """factor * letters.form letters for a symmetric form."""
    for i, letter in enumerate(letters):
        yield _term(system, form[i][i].scaled(factor), power(letter, 2))
    for i, j in itertools.combinations(range(len(letters)), 2):
        yield _term(system, form[i][j].scaled(2 * factor), letters[i], letters[j])


def _term(system: LinearSystem, coefficient: Quotient, *letters: Expression) -> Expression:
    return ZERO if coefficient.is_zero else multiply(quotient_tree(system.ring, coefficient), *letters)


_MOST = 3
_MOST_TO_BE_DEFINITE = 3


def is_linear(material: Material) -> bool:
    """Whether f is linear in q and v, with constant coefficients of v."""
    return linear_terms(material.motion) is not None


def linear_lagrangians(material: Material, seed: int) -> Sequence[Expression]:
    """Regular Lagrangians whose multiplier depends on t at most, the simplest first.

    One function of time suffices where there is a regular multiplier e^(ct) G; else sums of branches
    of e^(tT) are taken; none where V holds no regular matrix or the exponents are no square roots.
    """
    table = material.analysis.real_point
    try:
        system = linear_system(material) if table is not None else None
        if system is None or table is None:
            return ()
        found = _choices(system, material.motion.with_time, table)
        trees = dict.fromkeys(lagrangian(system, material.motion, choice.branch) for choice in found)
        return tuple(trees)
    except (TooLarge, ZeroDivisionError, KeyError):
        return ()


def _choices(system: LinearSystem, with_time: bool, table: RealTable) -> list[Choice]:
    """Of the first stage with a definite multiplier; else of the first with a regular one.

    For many coordinates one function of time is preferred to a definite sum over several.
    """
    space = invariant_multipliers(system)
    regular: list[Choice] = []
    for branches in _stages(space, with_time, table) if space.basis else ():
        found = choose(system, branches, table)
        if any(choice.definite for choice in found):
            return [*(choice for choice in found if choice.definite), *regular][:_MOST]
        regular = regular or found
        if regular and system.size > _MOST_TO_BE_DEFINITE:
            break
    return regular


def _stages(space: Multipliers, with_time: bool, table: RealTable) -> Iterator[list[Branch]]:
    """Sets of branches to combine, the simplest first."""
    yield constant_branches(space)
    if with_time:
        yield uniform_branches(space)
        yield all_branches(space, table)
