"""Linear systems q'' = -C q' - (K_0 + sum_j phi_j(t) K_j) q + b(t), read off the terms of f."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from flint import fmpq, fmpq_mat

from inverse_service.expressions.tree import ONE, TIME, ZERO, Expression, Symbol, holds
from inverse_service.field.exact_atoms import exact_ring
from inverse_service.field.exact_ring import ExactRing, sum_of
from inverse_service.field.rational_functions import Budget, Quotient, QuotientField, as_fraction
from inverse_service.mechanics.quotient_matrices import dot, null_space, reduced_rows
from inverse_service.search.material import Material
from inverse_service.search.motion_terms import MotionTerms
from inverse_service.search.terms import Monomial, Terms, monomial_tree, tree_of

Vector = tuple[Quotient, ...]
Matrix = tuple[Vector, ...]


def product(left: Matrix, right: Matrix) -> Matrix:
    """left right."""
    columns = transpose(right)
    return tuple(tuple(_dot(row, column) for column in columns) for row in left)


def apply(matrix: Matrix, vector: Vector) -> Vector:
    """matrix vector."""
    return tuple(_dot(row, vector) for row in matrix)


def _dot(left: Vector, right: Vector) -> Quotient:
    return dot(left[0].field.constant(0), left, right)


def transpose(matrix: Matrix) -> Matrix:
    return tuple(zip(*matrix, strict=True))


def plus(left: Matrix, right: Matrix, factor: Fraction | int = 1) -> Matrix:
    """left + factor right, factor a rational number."""
    rows = zip(left, right, strict=True)
    return tuple(tuple(a + b.scaled(factor) for a, b in zip(*pair, strict=True)) for pair in rows)


def times(matrix: Matrix, factor: Quotient) -> Matrix:
    return tuple(tuple(entry * factor for entry in row) for row in matrix)


def trace(matrix: Matrix) -> Quotient:
    return sum_of(matrix[0][0].field.constant(0), [matrix[i][i] for i in range(len(matrix))])


def identity(owner: QuotientField, size: int) -> Matrix:
    return tuple(tuple(owner.constant(int(i == j)) for j in range(size)) for i in range(size))


def is_zero(matrix: Matrix) -> bool:
    return all(entry.is_zero for row in matrix for entry in row)


def places(size: int) -> list[tuple[int, int]]:
    """The entries i <= j of a symmetric matrix in the order of its vector."""
    return [*itertools.combinations(range(size), 2), *((i, i) for i in range(size))]


def symmetric(vector: Vector, size: int) -> Matrix:
    """The symmetric matrix with these entries."""
    table = dict(zip(places(size), vector, strict=True))
    return tuple(tuple(table[min(i, j), max(i, j)] for j in range(size)) for i in range(size))


def entries(matrix: Matrix) -> Vector:
    """The entries of a symmetric matrix."""
    return tuple(matrix[i][j] for i, j in places(len(matrix)))


def echelon(rows: Sequence[Vector]) -> tuple[list[Vector], list[int]]:
    """(nonzero rows of the reduced echelon form, their pivots)."""
    found = reduced_rows(rows, range(len(rows[0]) if rows else 0))
    return list(found.rows), list(found.pivots)


def kernel(rows: Sequence[Vector], width: int, owner: QuotientField) -> tuple[list[Vector], list[int]]:
    """(basis of the vectors that every row annihilates, the unknown that each has to itself)."""
    found = null_space(rows, width, owner.constant(1))
    return [tuple(vector) for vector in found.values()], list(found)


def combination(weights: Sequence[Quotient], vectors: Sequence[Vector]) -> Vector:
    """sum_k weights_k vectors_k."""
    return tuple(_dot(tuple(weights), column) for column in zip(*vectors, strict=True))


def characteristic_polynomial(matrix: Matrix) -> list[Quotient]:
    """The coefficients of det(x - matrix), the constant one first (Faddeev and LeVerrier)."""
    owner, size = matrix[0][0].field, len(matrix)
    numbers = [entry.constant_value for row in matrix for entry in row]
    if all(value is not None for value in numbers):
        rational = fmpq_mat(size, size, [fmpq(x.numerator, x.denominator) for x in numbers if x is not None])
        return [owner.constant(as_fraction(c)) for c in rational.charpoly().coeffs()]
    found = [owner.constant(1)]
    auxiliary = identity(owner, size)
    for k in range(1, size + 1):
        moved = product(matrix, auxiliary)
        coefficient = trace(moved).scaled(Fraction(-1, k))
        found.append(coefficient)
        auxiliary = plus(moved, times(identity(owner, size), coefficient))
    return found[::-1]


# A name that no formula can hold: the variable of characteristic polynomials.
EIGENVALUE = Symbol("an eigenvalue")


@dataclass(frozen=True, slots=True)
class LinearTerms:
    """C and K_j as terms, and b: `damping[i][j]`, `stiffness[phi][i][j]`, phi = {} for K_0."""

    damping: tuple[tuple[Terms, ...], ...]
    stiffness: dict[Monomial, tuple[tuple[Terms, ...], ...]]
    forcing: tuple[Terms, ...]


@dataclass(frozen=True, slots=True)
class LinearSystem:
    """C, the pairs (phi_j(t), K_j) with phi_0 = 1 first, and b(t); entries exact in the parameters."""

    ring: ExactRing
    damping: Matrix
    stiffness: tuple[tuple[Expression, Matrix], ...]
    forcing: tuple[Expression, ...]

    @property
    def size(self) -> int:
        return len(self.damping)


def linear_terms(motion: MotionTerms) -> LinearTerms | None:
    """The parts of f, or None where f is not linear or C depends on time."""
    n = motion.size
    damping = _empty(n)
    stiffness: dict[Monomial, list[list[Terms]]] = {frozenset(): _empty(n)}
    forcing: list[Terms] = [{} for _ in range(n)]
    places: dict[Expression, tuple[int, int]] = {q: (k, 0) for k, q in enumerate(motion.coordinates)}
    places |= {v: (k, 1) for k, v in enumerate(motion.velocities)}
    for i, terms in enumerate(motion.forces):
        for key, value in terms.items():
            moving = [(letter, e) for letter, e in key if holds(letter, *places)]
            if not moving:
                forcing[i][key] = value
                continue
            if len(moving) > 1 or moving[0][1] != 1 or moving[0][0] not in places:
                return None
            column, kind = places[moving[0][0]]
            in_time: Monomial = frozenset(item for item in key if holds(item[0], TIME))
            if kind and in_time:
                return None
            target = damping if kind else stiffness.setdefault(in_time, _empty(n))
            target[i][column][key - frozenset(moving) - in_time] = -value
    return LinearTerms(_frozen(damping), {phi: _frozen(k) for phi, k in stiffness.items()}, tuple(forcing))


def _empty(n: int) -> list[list[Terms]]:
    return [[{} for _ in range(n)] for _ in range(n)]


def _frozen(rows: list[list[Terms]]) -> tuple[tuple[Terms, ...], ...]:
    return tuple(map(tuple, rows))


def linear_system(material: Material) -> LinearSystem | None:
    """C, K and b with exact entries; None where f is not linear. TooLarge where a budget ends."""
    terms = linear_terms(material.motion)
    if terms is None:
        return None
    parts = [terms.damping, *terms.stiffness.values()]
    trees = [tree_of(entry) for rows in parts for row in rows for entry in row]
    budget = Budget.long()
    ring = exact_ring(trees, (), 0, budget, further=(EIGENVALUE,))
    factors = [monomial_tree(phi) if phi else ONE for phi in terms.stiffness]
    exact = [_exact(ring, rows) for rows in parts]
    forcing = tuple(tree_of(entry) if entry else ZERO for entry in terms.forcing)
    return LinearSystem(ring, exact[0], tuple(zip(factors, exact[1:], strict=True)), forcing)


def _exact(ring: ExactRing, rows: tuple[tuple[Terms, ...], ...]) -> Matrix:
    return tuple(tuple(ring.value(tree_of(entry)) for entry in row) for row in rows)
