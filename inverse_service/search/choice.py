"""From a space of Lagrangians to the simplest regular one."""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction

import mpmath
from flint import nmod_mat

from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.tree import Expression
from inverse_service.field.point import number_value
from inverse_service.field.real_point import RealTable
from inverse_service.search.linear_ansatz import Combination, LagrangianSpace, letters_of
from inverse_service.search.motion_terms import has_velocity
from inverse_service.search.sampling import LetterTable, letter_table, monomial_values
from inverse_service.search.terms import Monomial, add_terms, rank

Matrix = list[list[int]]
# Eigenvalues below this part of the largest are zero.
_TINY = mpmath.mpf(10) ** -20


def hessians(space: LagrangianSpace, seed: int) -> tuple[int, list[Matrix]]:
    """(prime, d2L/dv dv of each combination at one random point)."""
    candidates = list(dict.fromkeys(key for c in space.combinations for key in c))
    letters = letters_of(candidates)
    table = letter_table(space.sampler, letters, 1, seed)
    index = {letter: k for k, letter in enumerate(letters)}
    inverse = pow(1 << 64, -1, table.prime)
    values = [int(x) * inverse % table.prime for x in monomial_values(table, letters, candidates)[0]]
    single = {
        key: _hessian(table, [(index[p], e) for p, e in key], value)
        for key, value in zip(candidates, values, strict=True)
    }
    return table.prime, [_combined(single, c, table.prime) for c in space.combinations]


def _hessian(table: LetterTable, letters: Sequence[tuple[int, Fraction]], value: int) -> Matrix:
    """m (V_i V_j + sum e d2 log p)."""
    prime, n = table.prime, table.derivatives.size
    weights = [(k, number_value(e, prime)) for k, e in letters]
    slope = [sum(w * int(table.derivatives.by_velocity[0, k, i]) for k, w in weights) % prime for i in range(n)]
    return [
        [value * (slope[i] * slope[j] + sum(w * int(table.derivatives.hessian[0, k, i, j]) for k, w in weights)) % prime
         for j in range(n)]
        for i in range(n)
    ]  # fmt: skip


def _combined(single: dict[Monomial, Matrix], combination: Combination, prime: int) -> Matrix:
    n = len(next(iter(single.values())))
    total = [[0] * n for _ in range(n)]
    for key, a in combination.items():
        weight = number_value(a, prime)
        for i in range(n):
            for j in range(n):
                total[i][j] = (total[i][j] + weight * single[key][i][j]) % prime
    return total


def regular_members(space: LagrangianSpace, seed: int, most: int = 4) -> list[tuple[int, ...]]:
    """Index sets of combinations whose generic sum is regular, simplest first.

    Combinations without a Hessian (total derivatives, relations among letters) are left aside.
    """
    if not space.combinations:
        return []
    prime, matrices = hessians(space, seed)
    useful = [k for k, matrix in enumerate(matrices) if any(map(any, matrix))]
    order = sorted(useful, key=lambda k: complexity(space.combinations[k]))
    squares_first = sorted(order, key=lambda k: not _is_diagonal(matrices[k]))
    generator = random.Random(seed)
    weights = {k: generator.randrange(1, prime) for k in order}
    found: list[tuple[int, ...]] = [(k,) for k in order if _rank([matrices[k]], [1], prime) == len(matrices[k])]
    for sequence in (squares_first, order):
        together = _pruned(sequence, matrices, weights, prime)
        if together is not None:
            found.append(together)
    found = list(dict.fromkeys(found))
    found.sort(key=lambda ks: sum(complexity(space.combinations[k])[0] for k in ks))
    return found[:most]


def _is_diagonal(matrix: Matrix) -> bool:
    return not any(x for i, row in enumerate(matrix) for j, x in enumerate(row) if i != j)


def _pruned(
    order: Sequence[int], matrices: Sequence[Matrix], weights: dict[int, int], prime: int
) -> tuple[int, ...] | None:
    """The combinations without which the generic sum is singular, the last in order left out first."""
    chosen = list(order)
    if not chosen or not _is_regular(chosen, matrices, weights, prime):
        return None
    for k in reversed(order):
        rest = [j for j in chosen if j != k]
        if rest and _is_regular(rest, matrices, weights, prime):
            chosen = rest
    return tuple(chosen)


def _is_regular(chosen: Sequence[int], matrices: Sequence[Matrix], weights: dict[int, int], prime: int) -> bool:
    found = _rank([matrices[k] for k in chosen], [weights[k] for k in chosen], prime)
    return found == len(matrices[chosen[0]])


def _rank(matrices: Sequence[Matrix], weights: Sequence[int], prime: int) -> int:
    n = len(matrices[0])
    total = [
        sum(w * m[i][j] for m, w in zip(matrices, weights, strict=True)) % prime for i in range(n) for j in range(n)
    ]
    return int(nmod_mat(n, n, total, prime).rank())


def complexity(combination: Combination) -> tuple[Fraction | int, int]:
    """Total weight of its terms, and their number."""
    return sum((rank(key)[0] + 1 for key in combination), Fraction(0)), len(combination)


def gauge_of(space: LagrangianSpace, seed: int) -> list[Combination]:
    """The combinations without Hessian."""
    _, matrices = hessians(space, seed)
    return [c for c, m in zip(space.combinations, matrices, strict=True) if not any(map(any, m))]


def reduced(total: Combination, gauge: Sequence[Combination]) -> Combination:
    """Gauge elements subtracted as long as the rest gets simpler."""
    improved = True
    while improved:
        improved = False
        for element in gauge:
            for key, a in element.items():
                if key in total:
                    shorter = add_terms(total, element, -total[key] / a)
                    if shorter and complexity(shorter) < complexity(total):
                        total, improved = shorter, True
    return total


def scaled(combination: Combination) -> Combination:
    """The simplest term that is not linear in the velocities gets coefficient 1/2 if quadratic, else 1."""
    moving = [key for key in combination if velocity_degree(key) not in (0, 1)] or list(combination)
    leading = min(moving, key=rank)
    target = Fraction(1, 2) if any(e == 2 and has_velocity(letter) for letter, e in leading) else Fraction(1)
    factor = target / combination[leading]
    return {key: a * factor for key, a in combination.items()}


def velocity_degree(key: Monomial) -> Fraction:
    """0 without velocities, 1 for a single velocity, else a number above 1."""
    return sum((1 + abs(e - 1) for letter, e in key if has_velocity(letter)), Fraction(0))


def signature(space: LagrangianSpace, hessian: Sequence[Sequence[Expression]]) -> tuple[int, int] | None:
    """`inertia` at the real point of the space."""
    return inertia(space.sampler.real_point, hessian)


def inertia(table: RealTable | None, hessian: Sequence[Sequence[Expression]]) -> tuple[int, int] | None:
    """(positive, negative) eigenvalues of a Hessian at a real point; None where it has no value there."""
    if table is None:
        return None
    with mpmath.workdps(30):
        try:
            matrix = mpmath.matrix([[evaluate(entry, table) for entry in row] for row in hessian])
            values = mpmath.eigsy(matrix, eigvals_only=True)
        except (NoRealValue, ArithmeticError):
            return None
        size = max(abs(value) for value in values)
        return sum(1 for x in values if x > size * _TINY), sum(1 for x in values if x < -size * _TINY)
