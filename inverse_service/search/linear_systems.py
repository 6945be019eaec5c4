"""Linear systems: their terms, all multipliers that depend on t alone, and the Lagrangians.

Linear systems q'' = -C q' - (K_0 + sum_j phi_j(t) K_j) q + b(t), read off the terms of f.

All multipliers g(t) of a linear system with constant damping, in closed form.

For q'' = -C q' - K q, N = C/2 and Phi = 2K - C^2/2. A multiplier that depends on t alone fulfils
    g' = T(g) = g N + (g N)^T,        g Phi symmetric,
hence g [N, Phi], g [N, [N, Phi]], … symmetric. The symmetric matrices with all these properties are
the greatest T-invariant space V on which g Phi is symmetric, and g(t) = e^(tT) g(0) with g(0) in V.
The closed form of e^(tT) comes from the factors of degree 1 and 2 of the characteristic polynomial of
T on V over the field of the parameters (Jordan form; Sarlet, Engels and Bahar 1982 for the conditions).

Lagrangians of linear systems q'' = -C q' - K q + b(t), quadratic with coefficients that may depend on t.

For a multiplier g(t), the simplest regular one among combinations of branches, judged at a real point,
    L = 1/2 v.g v + 1/4 v.(g C - C^T g) q - 1/2 q.S q + q.g b,    S the symmetric part of g K:
with W = (g C - C^T g)/4 antisymmetric its equations are g v' + (g' + 2W) v + (W' + S) q - g b = 0, and
(H2) says g' + 2W = g C, the antisymmetric part of g K being W' by (H3).
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import factorial
from typing import Any

import mpmath
import numpy as np
from flint import fmpq, fmpq_mat, fmpq_mpoly
from numpy.typing import NDArray

from inverse_service import bounds
from inverse_service.expressions import evaluation, tree as ex
from inverse_service.field import exact_field, matrices, real_point
from inverse_service.search import members, quadratures
from inverse_service.search.material import Material
from inverse_service.search.terms import Monomial, MotionTerms, Terms, collected, monomial_tree, tree_of

# Of quotients: numpy's arithmetic of objects is theirs.
Array = NDArray[Any]


def _scaled(array: Array, factor: Fraction) -> Array:
    """factor times the array, factor a rational number."""
    return _array([entry.scaled(factor) for entry in array.flat], *array.shape)


def _array(values: Sequence[object], *shape: int) -> Array:
    return np.array(values, object).reshape(shape)


def identity(owner: exact_field.QuotientField, size: int) -> Array:
    return _array([owner.constant(int(i == j)) for i in range(size) for j in range(size)], size, size)


def is_zero(matrix: Array) -> bool:
    return all(entry.is_zero for entry in matrix.flat)


def places(size: int) -> list[tuple[int, int]]:
    """The entries i <= j of a symmetric matrix in the order of its vector."""
    return [*itertools.combinations(range(size), 2), *((i, i) for i in range(size))]


def symmetric(vector: Array, size: int) -> Array:
    """The symmetric matrix with these entries."""
    rows, columns = zip(*places(size), strict=True)
    found = np.empty((size, size), object)
    found[rows, columns] = found[columns, rows] = vector
    return found


def entries(matrix: Array) -> Array:
    """The entries of a symmetric matrix."""
    return _array([matrix[place] for place in places(len(matrix))], -1)


def kernel(rows: Iterable[Array], width: int, owner: exact_field.QuotientField) -> tuple[Array, list[int]]:
    """(basis of the vectors that every row annihilates, the unknown that each has to itself)."""
    found = matrices.null_space([list(row) for row in rows], width, owner.constant(1))
    return _array(list(found.values()), len(found), width), list(found)


def characteristic_polynomial(matrix: Array) -> list[exact_field.Quotient]:
    """The coefficients of det(x - matrix), the constant one first (Faddeev and LeVerrier)."""
    owner, size = matrix[0, 0].field, len(matrix)
    numbers = [entry.constant_value for entry in matrix.flat]
    if all(value is not None for value in numbers):
        rational = fmpq_mat(size, size, [fmpq(x.numerator, x.denominator) for x in numbers if x is not None])
        return [owner.constant(exact_field.as_fraction(c)) for c in rational.charpoly().coeffs()]
    found = [owner.constant(1)]
    auxiliary = identity(owner, size)
    for k in range(1, size + 1):
        moved = matrix @ auxiliary
        coefficient = exact_field.sum_of(owner.constant(0), moved.diagonal()).scaled(Fraction(-1, k))
        found.append(coefficient)
        auxiliary = moved + identity(owner, size) * coefficient
    return found[::-1]


# A name that no formula can hold: the variable of characteristic polynomials.
EIGENVALUE = ex.Symbol("an eigenvalue")


@dataclass(frozen=True, slots=True)
class LinearTerms:
    """C and K_j as terms, and b: `damping[i][j]`, `stiffness[phi][i][j]`, phi = {} for K_0."""

    damping: tuple[tuple[Terms, ...], ...]
    stiffness: dict[Monomial, tuple[tuple[Terms, ...], ...]]
    forcing: tuple[Terms, ...]


@dataclass(frozen=True, slots=True)
class LinearSystem:
    """C, the pairs (phi_j(t), K_j) with phi_0 = 1 first, and b(t); entries exact in the parameters."""

    ring: exact_field.ExactRing
    damping: Array
    stiffness: tuple[tuple[ex.Expression, Array], ...]
    forcing: tuple[ex.Expression, ...]

    @property
    def size(self) -> int:
        return len(self.damping)


def linear_terms(motion: MotionTerms) -> LinearTerms | None:
    """The parts of f, or None where f is not linear or C depends on time."""
    n = motion.size
    damping = _empty(n)
    stiffness: dict[Monomial, list[list[Terms]]] = {frozenset(): _empty(n)}
    forcing: list[Terms] = [{} for _ in range(n)]
    places: dict[ex.Expression, tuple[int, int]] = {q: (k, 0) for k, q in enumerate(motion.coordinates)}
    places |= {v: (k, 1) for k, v in enumerate(motion.velocities)}
    for i, terms in enumerate(motion.forces):
        for key, value in terms.items():
            moving = [(letter, e) for letter, e in key if ex.holds(letter, *places)]
            if not moving:
                forcing[i][key] = value
                continue
            if len(moving) > 1 or moving[0][1] != 1 or moving[0][0] not in places:
                return None
            column, kind = places[moving[0][0]]
            in_time: Monomial = frozenset(item for item in key if ex.holds(item[0], ex.TIME))
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
    budget = exact_field.Budget.long()
    ring = exact_field.exact_ring(trees, (), 0, budget, further=(EIGENVALUE,))
    factors = [monomial_tree(phi) if phi else ex.ONE for phi in terms.stiffness]
    exact = [_exact(ring, rows) for rows in parts]
    forcing = tuple(tree_of(entry) if entry else ex.ZERO for entry in terms.forcing)
    return LinearSystem(ring, exact[0], tuple(zip(factors, exact[1:], strict=True)), forcing)


def _exact(ring: exact_field.ExactRing, rows: tuple[tuple[Terms, ...], ...]) -> Array:
    return _array([ring.value(tree_of(entry)) for row in rows for entry in row], len(rows), len(rows))


def factors_of(ring: exact_field.ExactRing, matrix: Array) -> list[tuple[list[exact_field.Quotient], int]]:
    """(coefficients, the constant one first, and multiplicity) of the factors of det(x - matrix) by degree.

    Empty for large matrices with parameters.
    """
    symbolic = any(entry.constant_value is None for entry in matrix.flat)
    if symbolic and len(matrix) > bounds.COORDINATES:
        return []
    variable = ring.atoms[EIGENVALUE]
    terms = [c * variable**k for k, c in enumerate(characteristic_polynomial(matrix)) if not c.is_zero]
    _, factors = exact_field.factor_polynomial(exact_field.sum_of(ring.constant(0), terms).numerator)
    found = [(_by_power(factor, variable), multiplicity) for factor, multiplicity in factors]
    return sorted((item for item in found if len(item[0]) > 1), key=lambda item: len(item[0]))


def _by_power(polynomial: fmpq_mpoly, variable: exact_field.Quotient) -> list[exact_field.Quotient]:
    """The coefficients of a polynomial in the eigenvalue."""
    owner = variable.field
    place = next(k for k, degree in enumerate(variable.numerator.degrees()) if degree)
    found, degree = exact_field.coefficients_of(polynomial, [place]), int(polynomial.degrees()[place])
    return [owner.quotient(owner.reduce(found.get((k,), polynomial * 0)), ()) for k in range(degree + 1)]


@dataclass(frozen=True, slots=True)
class Branch:
    """g(t) = sum of phi(t) G over the pairs (phi, G); `start` is g(0)."""

    parts: tuple[tuple[ex.Expression, Array], ...]
    start: Array


@dataclass(frozen=True, slots=True)
class Multipliers:
    """The space V: a basis of vectors, and the matrix of T in it."""

    system: LinearSystem
    basis: Array
    operator: Array

    def matrix(self, coordinates: Array) -> Array:
        """The element of V with these coordinates, as a symmetric matrix."""
        return symmetric(coordinates @ self.basis, self.system.size)


def invariant_multipliers(system: LinearSystem) -> Multipliers:
    """V and T on it; an empty basis where there is no multiplier at all."""
    owner, n = system.ring.field, system.size
    connection = _scaled(system.damping, Fraction(1, 2))
    tensors = [k + k for _, k in system.stiffness]
    tensors[0] = tensors[0] - _scaled(system.damping @ system.damping, Fraction(1, 2))
    rows: list[Array] = []
    basis, free = kernel(rows, n * (n + 1) // 2, owner)
    while len(basis):
        rows += [row for tensor in tensors for row in asymmetry(tensor)]
        smaller, free = kernel(rows, n * (n + 1) // 2, owner)
        if len(smaller) == len(basis):
            break
        basis = smaller
        tensors = [connection @ tensor - tensor @ connection for tensor in tensors]
        tensors = [tensor for tensor in tensors if not is_zero(tensor)]
    moved = [symmetric(vector, n) @ connection for vector in basis]
    images = [entries(one + one.T)[free] for one in moved]
    return Multipliers(system, basis, _array(images, len(basis), len(basis)).T)


def asymmetry(tensor: Array) -> Iterator[Array]:
    """The rows of (g A)_ij - (g A)_ji in the entries of g, i < j."""
    n = len(tensor)
    zero = tensor[0, 0] - tensor[0, 0]
    pairs = places(n)
    for i, j in pairs[: n * (n - 1) // 2]:
        row = dict.fromkeys(pairs, zero)
        for k in range(n):
            row[min(i, k), max(i, k)] += tensor[k, j]
            row[min(j, k), max(j, k)] -= tensor[k, i]
        yield _array(list(row.values()), -1)


def constant_branches(space: Multipliers) -> list[Branch]:
    """g' = 0."""
    return _pure(space, space.system.ring.constant(0)) if len(space.basis) else []


def _pure(space: Multipliers, rate: exact_field.Quotient) -> list[Branch]:
    """The eigenvectors of T for one eigenvalue."""
    basis = kernel(_shifted(space, rate), len(space.basis), space.system.ring.field)[0]
    factor = _exponential(exact_field.quotient_tree(space.system.ring, rate))
    return [Branch(((factor, start),), start) for start in _sparse(space, basis)]


def _sparse(space: Multipliers, coordinates: Array) -> list[Array]:
    """Spanning matrices: two reduced bases, entries on the diagonal eliminated last and first, simple ones first."""
    vectors = coordinates @ space.basis
    turned = _echelon(vectors[:, ::-1])[:, ::-1] if len(vectors) else vectors
    found = [symmetric(vector, space.system.size) for vector in (*turned, *_echelon(vectors))]
    return [g for k, g in enumerate(found) if not any(is_zero(g - other) for other in found[:k])]


def _echelon(rows: Array) -> Array:
    """The nonzero rows of the reduced echelon form."""
    return _array(matrices.reduced_rows([list(row) for row in rows], range(rows.shape[1])).rows, -1, rows.shape[1])


def _shifted(space: Multipliers, rate: exact_field.Quotient) -> Array:
    """T - rate."""
    shifted: Array = space.operator - identity(space.system.ring.field, len(space.basis)) * rate
    return shifted


def all_branches(space: Multipliers, table: real_point.RealTable) -> list[Branch]:
    """e^(tT) on the parts of V that belong to factors of degree 1 and 2, simple ones first."""
    simple: list[Branch] = []
    nested: list[Branch] = []
    for coefficients, multiplicity in factors_of(space.system.ring, space.operator) if len(space.basis) else ():
        if len(coefficients) == 2:
            rate = -(coefficients[0] / coefficients[1])
            simple += _pure(space, rate)
            nested += _chains(space, rate, multiplicity) if multiplicity > 1 else []
        elif len(coefficients) == 3:
            simple += _pairs(space, coefficients, table)
    return simple + nested


def _chains(space: Multipliers, rate: exact_field.Quotient, multiplicity: int) -> list[Branch]:
    """e^(rt) sum_k t^k (T - r)^k / k! g(0) on the kernel of (T - r)^m."""
    ring = space.system.ring
    shifted = _shifted(space, rate)
    whole = shifted
    for _ in range(multiplicity - 1):
        whole = whole @ shifted
    factor = _exponential(exact_field.quotient_tree(ring, rate))
    return [_chain(space, shifted, factor, vector) for vector in kernel(whole, len(space.basis), ring.field)[0]]


def _chain(space: Multipliers, shifted: Array, factor: ex.Expression, vector: Array) -> Branch:
    parts, current, k = [], vector, 0
    while not is_zero(current):
        monomial = Fraction(1, factorial(k)) * ex.TIME**k * factor
        parts.append((monomial, space.matrix(current)))
        current, k = shifted @ current, k + 1
    return Branch(tuple(parts), parts[0][1])


def _pairs(
    space: Multipliers, coefficients: Sequence[exact_field.Quotient], table: real_point.RealTable
) -> list[Branch]:
    """T = a + X with X^2 = d: e^(at) (C(t) + S(t) X), C = cosh, S = sinh(rt)/r for d = r^2; cos, sin for d < 0."""
    ring = space.system.ring
    lowest, middle, leading = coefficients
    center = (middle / leading).scaled(Fraction(-1, 2))
    discriminant = center * center - lowest / leading
    shifted = _shifted(space, center)
    square = shifted @ shifted - identity(ring.field, len(space.basis)) * discriminant
    even, odd, outside = _even_and_odd(exact_field.quotient_tree(ring, discriminant), table)
    factor, inverse = _exponential(exact_field.quotient_tree(ring, center)), ring.value(outside).inverse()
    found = []
    for vector in kernel(square, len(space.basis), ring.field)[0]:
        start, slope = space.matrix(vector), space.matrix(shifted @ vector)
        parts = (factor * even, start), (factor * odd, slope * inverse)
        found.append(Branch(parts, start))
    return found


def _even_and_odd(
    discriminant: ex.Expression, table: real_point.RealTable
) -> tuple[ex.Expression, ex.Expression, ex.Expression]:
    """(C, r S, r) with C'' = d C, C(0) = 1, S = C'/d, and r the part of sqrt|d| that needs no root."""
    positive = real_point.real_sign(discriminant, table) > 0
    outside, inside = quadratures.even_root(discriminant if positive else -discriminant)
    root = ex.square_root(inside)
    names = ("cosh", "sinh") if positive else ("cos", "sin")
    even, odd = (ex.Apply(name, outside * root * ex.TIME) for name in names)
    return even, odd / root, outside


def _exponential(rate: ex.Expression) -> ex.Expression:
    """e^(rate t)."""
    argument = rate * ex.TIME
    return ex.ONE if argument == ex.number(0) else ex.Apply("exp", argument)


# Of the largest eigenvalue, the least that counts as one.
_TINY = 1e-9


def choose(system: LinearSystem, branches: Sequence[Branch], table: real_point.RealTable) -> list[Branch]:
    """Regular sums of branches, at t = 0 and the real values of the parameters: definite and short ones first."""
    branches = sorted(branches, key=lambda branch: (not _is_diagonal(branch.start), _size(branch)))
    starts = [_numeric(system, branch.start, table) for branch in branches]
    count, found = len(branches), dict[tuple[Fraction, ...], tuple[bool, int]]()
    alone = [[Fraction(int(j == k)) for j in range(count)] for k in range(count)]
    first = [[Fraction(int(j < k)) for j in range(count)] for k in range(2, count + 1)]
    for weights in [*members.definite_weights(starts[: bounds.COLUMNS]), *alone, *first]:
        padded = [*weights, *[Fraction(0)] * (count - len(weights))]
        values = np.linalg.eigvalsh(sum(float(w) * start for w, start in zip(padded, starts, strict=True)))
        sign = -1 if values[-1] <= 0 else 1
        if min(abs(values)) > _TINY * max(abs(values)):
            size = sum(_size(branch) for w, branch in zip(padded, branches, strict=True) if w)
            found[tuple(sign * w for w in padded)] = (values[0] < 0 < values[-1], size)
    return [_combined(weights, branches) for weights in sorted(found, key=lambda one: found[one])[: bounds.FEW]]


def _numeric(system: LinearSystem, matrix: Array, table: real_point.RealTable) -> NDArray[np.float64]:
    trees = (exact_field.quotient_tree(system.ring, entry) for entry in matrix.flat)
    with mpmath.workdps(bounds.DIGITS):
        return np.array([float(evaluation.evaluate(tree, table)) for tree in trees]).reshape(matrix.shape)


def _size(branch: Branch) -> int:
    """Terms in all entries."""
    return sum(len(entry.numerator) + len(entry.exponents) for _, g in branch.parts for entry in g.flat)


def _is_diagonal(g: Array) -> bool:
    return all(entry.is_zero for (i, j), entry in np.ndenumerate(g) if i != j)


def _combined(weights: Sequence[Fraction], branches: Sequence[Branch]) -> Branch:
    """sum of weight * branch, parts with the same function of time put together."""
    start = zero = branches[0].start - branches[0].start
    table = dict[ex.Expression, Array]()
    for weight, branch in zip(weights, branches, strict=True):
        start = start + _scaled(branch.start, weight)
        for phi, g in branch.parts if weight else ():
            table[phi] = table.get(phi, zero) + _scaled(g, weight)
    return Branch(tuple((phi, g) for phi, g in table.items() if not is_zero(g)), start)


def lagrangian(system: LinearSystem, motion: MotionTerms, branch: Branch) -> ex.Expression:
    """L as a sum over the functions of time in g."""
    scaled = _primitive(branch)
    return ex.add(*(phi * ex.add(*_terms(system, motion, g)) for phi, g in scaled))


def _primitive(branch: Branch) -> list[tuple[ex.Expression, Array]]:
    """g over the common factor of its entries; a numerical factor keeps its sign."""
    factor = exact_field.common_factor([entry for _, g in branch.parts for entry in g.flat if not entry.is_zero])
    number = factor.constant_value
    inverse = (factor.scaled(-1) if number is not None and number < 0 else factor).inverse()
    return [(phi, g * inverse) for phi, g in branch.parts]


def _terms(system: LinearSystem, motion: MotionTerms, g: Array) -> Iterator[ex.Expression]:
    """The terms of L that are linear in g, without its function of time."""
    yield from _quadratic_form(system, _scaled(g, Fraction(1, 2)), motion.velocities)
    damped = g @ system.damping
    skew = _scaled(damped - damped.T, Fraction(1, 4))
    for (i, j), entry in np.ndenumerate(skew):
        yield _term(system, entry, motion.velocities[i], motion.coordinates[j])
    for phi, stiffness in system.stiffness:
        lowered = g @ stiffness
        form = _scaled(lowered + lowered.T, Fraction(-1, 4))
        yield from (phi * term for term in _quadratic_form(system, form, motion.coordinates))
    for (i, j), entry in np.ndenumerate(g):
        yield collected(_term(system, entry, motion.coordinates[i]) * system.forcing[j])


def _quadratic_form(system: LinearSystem, form: Array, letters: Sequence[ex.Expression]) -> Iterator[ex.Expression]:
    """letters.form letters for a symmetric form."""
    for i, letter in enumerate(letters):
        yield _term(system, form[i, i], letter**2)
    for i, j in itertools.combinations(range(len(letters)), 2):
        yield _term(system, form[i, j].scaled(2), letters[i], letters[j])


def _term(system: LinearSystem, coefficient: exact_field.Quotient, *letters: ex.Expression) -> ex.Expression:
    return (
        ex.ZERO if coefficient.is_zero else ex.multiply(exact_field.quotient_tree(system.ring, coefficient), *letters)
    )


def is_linear(material: Material) -> bool:
    """Whether f is linear in q and v, with constant coefficients of v."""
    return linear_terms(material.motion) is not None


def linear_lagrangians(material: Material, seed: int) -> Sequence[ex.Expression]:
    """Regular Lagrangians whose multiplier depends on t at most, the simplest first.

    None where V holds no regular matrix or the exponents are not square roots.
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
    except (exact_field.TooLarge, ZeroDivisionError, KeyError):
        return ()
