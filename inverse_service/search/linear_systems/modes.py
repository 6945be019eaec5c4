"""All multipliers g(t) of a linear system with constant damping, in closed form.

For q'' = -C q' - K q, N = C/2 and Phi = 2K - C^2/2. A multiplier that depends on t alone fulfils
    g' = T(g) = g N + (g N)^T,        g Phi symmetric,
hence g [N, Phi], g [N, [N, Phi]], … symmetric. The symmetric matrices with all these properties are
the greatest T-invariant space V on which g Phi is symmetric, and g(t) = e^(tT) g(0) with g(0) in V.
The closed form of e^(tT) comes from the factors of degree 1 and 2 of the characteristic polynomial of
T on V over the field of the parameters (Jordan form; Sarlet, Engels and Bahar 1982 for the conditions).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import factorial

from flint import fmpq_mpoly

from inverse_service import bounds
from inverse_service.expressions.tree import (
    ONE,
    TIME,
    Apply,
    Expression,
    number,
    square_root,
)
from inverse_service.field.exact_ring import ExactRing, quotient_tree, sum_of
from inverse_service.field.rational_functions import Quotient, coefficients_of, factored
from inverse_service.field.real_point import RealTable, real_sign
from inverse_service.search.linear_systems import linear_terms as matrices
from inverse_service.search.linear_systems.linear_terms import (
    EIGENVALUE,
    LinearSystem,
    Matrix,
    Vector,
    characteristic_polynomial,
)
from inverse_service.search.one_coordinate.algebra import even_root


def factors_of(ring: ExactRing, matrix: Matrix) -> list[tuple[list[Quotient], int]]:
    """(coefficients, the constant one first, and multiplicity) of the factors of det(x - matrix) by degree.

    Empty for large matrices with parameters.
    """
    symbolic = any(entry.constant_value is None for row in matrix for entry in row)
    if symbolic and len(matrix) > bounds.COORDINATES:
        return []
    variable = ring.atoms[EIGENVALUE]
    terms = [c * variable**k for k, c in enumerate(characteristic_polynomial(matrix)) if not c.is_zero]
    _, factors = factored(sum_of(ring.constant(0), terms).numerator)
    found = [(_by_power(factor, variable), multiplicity) for factor, multiplicity in factors]
    return sorted((item for item in found if len(item[0]) > 1), key=lambda item: len(item[0]))


def _by_power(polynomial: fmpq_mpoly, variable: Quotient) -> list[Quotient]:
    """The coefficients of a polynomial in the eigenvalue."""
    owner = variable.field
    place = next(k for k, degree in enumerate(variable.numerator.degrees()) if degree)
    found, degree = coefficients_of(polynomial, [place]), int(polynomial.degrees()[place])
    return [owner.quotient(owner.reduce(found.get((k,), polynomial * 0)), ()) for k in range(degree + 1)]


@dataclass(frozen=True, slots=True)
class Branch:
    """g(t) = sum of phi(t) G over the pairs (phi, G); `start` is g(0)."""

    parts: tuple[tuple[Expression, Matrix], ...]

    start: Matrix


@dataclass(frozen=True, slots=True)
class Multipliers:
    """The space V: a basis of vectors, and the matrix of T in it."""

    system: LinearSystem
    basis: tuple[Vector, ...]
    operator: Matrix

    def matrix(self, coordinates: Vector) -> Matrix:
        """The element of V with these coordinates, as a symmetric matrix."""
        return matrices.symmetric(matrices.combination(coordinates, self.basis), self.system.size)


def invariant_multipliers(system: LinearSystem) -> Multipliers:
    """V and T on it; an empty basis where there is no multiplier at all."""
    owner, n = system.ring.field, system.size
    width = n * (n + 1) // 2
    half = Fraction(1, 2)
    connection = matrices.plus(system.damping, system.damping, -half)
    tensors = [matrices.plus(k, k) for _, k in system.stiffness]
    tensors[0] = matrices.plus(tensors[0], matrices.product(system.damping, system.damping), -half)
    rows: list[Vector] = []
    basis, free = matrices.kernel(rows, width, owner)
    while basis:
        rows = matrices.echelon([*rows, *(row for tensor in tensors for row in asymmetry(tensor))])[0]
        smaller, free = matrices.kernel(rows, width, owner)
        if len(smaller) == len(basis):
            break
        basis = smaller
        tensors = [_commutator(connection, tensor) for tensor in tensors]
        tensors = [tensor for tensor in tensors if not matrices.is_zero(tensor)]
    images = [matrices.entries(_moved(matrices.symmetric(vector, n), connection)) for vector in basis]
    columns = [tuple(image[k] for k in free) for image in images]
    return Multipliers(system, tuple(basis), matrices.transpose(tuple(columns)) if columns else ())


def _moved(g: Matrix, connection: Matrix) -> Matrix:
    """T(g)."""
    product = matrices.product(g, connection)
    return matrices.plus(product, matrices.transpose(product))


def _commutator(left: Matrix, right: Matrix) -> Matrix:
    return matrices.plus(matrices.product(left, right), matrices.product(right, left), -1)


def asymmetry(tensor: Matrix) -> Iterator[Vector]:
    """The rows of (g A)_ij - (g A)_ji in the entries of g, i < j."""
    n = len(tensor)
    zero = tensor[0][0].field.constant(0)
    places = matrices.places(n)
    for i, j in places[: n * (n - 1) // 2]:
        row = dict.fromkeys(places, zero)
        for k in range(n):
            row[min(i, k), max(i, k)] += tensor[k][j]
            row[min(j, k), max(j, k)] -= tensor[k][i]
        yield tuple(row.values())


def constant_branches(space: Multipliers) -> list[Branch]:
    """g' = 0."""
    return _pure(space, space.system.ring.constant(0)) if space.basis else []


def _pure(space: Multipliers, rate: Quotient) -> list[Branch]:
    """The eigenvectors of T for one eigenvalue."""
    basis = matrices.kernel(_shifted(space, rate), len(space.basis), space.system.ring.field)[0]
    factor = _exponential(quotient_tree(space.system.ring, rate))
    return [Branch(((factor, start),), start) for start in _sparse(space, basis)]


def _sparse(space: Multipliers, coordinates: Sequence[Vector]) -> list[Matrix]:
    """Spanning matrices: two reduced bases, entries on the diagonal eliminated last and first, simple ones first."""
    n = space.system.size
    vectors = [matrices.combination(vector, space.basis) for vector in coordinates]
    turned = [vector[::-1] for vector in matrices.echelon([vector[::-1] for vector in vectors])[0]]
    found = [matrices.symmetric(vector, n) for vector in (*turned, *matrices.echelon(vectors)[0])]
    return [g for k, g in enumerate(found) if not any(_equal(g, other) for other in found[:k])]


def _equal(left: Matrix, right: Matrix) -> bool:
    return matrices.is_zero(matrices.plus(left, right, -1))


def _shifted(space: Multipliers, rate: Quotient) -> Matrix:
    """T - rate."""
    one = matrices.identity(space.system.ring.field, len(space.basis))
    return matrices.plus(space.operator, matrices.times(one, rate), -1)


def all_branches(space: Multipliers, table: RealTable) -> list[Branch]:
    """e^(tT) on the parts of V that belong to factors of degree 1 and 2, simple ones first."""
    simple: list[Branch] = []
    nested: list[Branch] = []
    for coefficients, multiplicity in factors_of(space.system.ring, space.operator) if space.basis else ():
        if len(coefficients) == 2:
            rate = -(coefficients[0] / coefficients[1])
            simple += _pure(space, rate)
            nested += _chains(space, rate, multiplicity) if multiplicity > 1 else []
        elif len(coefficients) == 3:
            simple += _pairs(space, coefficients, table)
    return simple + nested


def _chains(space: Multipliers, rate: Quotient, multiplicity: int) -> list[Branch]:
    """e^(rt) sum_k t^k (T - r)^k / k! g(0) on the kernel of (T - r)^m."""
    ring = space.system.ring
    shifted = _shifted(space, rate)
    whole = shifted
    for _ in range(multiplicity - 1):
        whole = matrices.product(whole, shifted)
    factor = _exponential(quotient_tree(ring, rate))
    return [
        _chain(space, shifted, factor, vector) for vector in matrices.kernel(whole, len(space.basis), ring.field)[0]
    ]


def _chain(space: Multipliers, shifted: Matrix, factor: Expression, vector: Vector) -> Branch:
    parts, current, k = [], vector, 0
    while any(not entry.is_zero for entry in current):
        monomial = Fraction(1, factorial(k)) * TIME**k * factor
        parts.append((monomial, space.matrix(current)))
        current, k = matrices.apply(shifted, current), k + 1
    return Branch(tuple(parts), parts[0][1])


def _pairs(space: Multipliers, coefficients: Sequence[Quotient], table: RealTable) -> list[Branch]:
    """T = a + X with X^2 = d: e^(at) (C(t) + S(t) X), C = cosh, S = sinh(rt)/r for d = r^2; cos, sin for d < 0."""
    ring = space.system.ring
    lowest, middle, leading = coefficients
    center = (middle / leading).scaled(Fraction(-1, 2))
    discriminant = center * center - lowest / leading
    shifted = _shifted(space, center)
    one = matrices.identity(ring.field, len(space.basis))
    square = matrices.plus(matrices.product(shifted, shifted), matrices.times(one, discriminant), -1)
    even, odd, outside = _even_and_odd(quotient_tree(ring, discriminant), table)
    factor, inverse = _exponential(quotient_tree(ring, center)), ring.value(outside).inverse()
    found = []
    for vector in matrices.kernel(square, len(space.basis), ring.field)[0]:
        start, slope = space.matrix(vector), space.matrix(matrices.apply(shifted, vector))
        parts = (factor * even, start), (factor * odd, matrices.times(slope, inverse))
        found.append(Branch(parts, start))
    return found


def _even_and_odd(discriminant: Expression, table: RealTable) -> tuple[Expression, Expression, Expression]:
    """(C, r S, r) with C'' = d C, C(0) = 1, S = C'/d, and r the part of sqrt|d| that needs no root."""
    positive = real_sign(discriminant, table) > 0
    outside, inside = even_root(discriminant if positive else -discriminant)
    root = square_root(inside)
    names = ("cosh", "sinh") if positive else ("cos", "sin")
    even, odd = (Apply(name, outside * root * TIME) for name in names)
    return even, odd / root, outside


def _exponential(rate: Expression) -> Expression:
    """e^(rate t)."""
    argument = rate * TIME
    return ONE if argument == number(0) else Apply("exp", argument)
