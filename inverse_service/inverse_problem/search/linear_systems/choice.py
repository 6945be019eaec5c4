"""The simplest regular multipliers among combinations of branches, judged at a real point."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mpmath

from inverse_service.algebra.exact_ring import quotient_tree
from inverse_service.algebra.real_point import RealTable
from inverse_service.expressions.evaluation import evaluate
from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.search.linear_systems import matrices as matrices
from inverse_service.inverse_problem.search.linear_systems.matrices import Matrix
from inverse_service.inverse_problem.search.linear_systems.modes import Branch
from inverse_service.inverse_problem.search.linear_systems.reading import LinearSystem

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
    """None for a singular sum; a negative definite one is turned round."""
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
