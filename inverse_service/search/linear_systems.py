"""Linear systems q'' + C q' + K(t) q = b(t) with constant C: multipliers that depend on t alone.

With N = C/2 and Phi = 2 K - C^2/2 such a multiplier satisfies
    g' = T(g) = g N + (g N)^T,        g Phi symmetric,
hence g [N, Phi], g [N, [N, Phi]], … symmetric. The symmetric matrices with all these properties are
the greatest T-invariant space V on which g Phi is symmetric, and g(t) = e^(tT) g(0) with g(0) in V
(Sarlet, Engels and Bahar 1982). The rates of e^(tT) are means of two eigenvalues of C: a single
rate a, or a pair a +- sqrt(d):
    g(t) = e^(at) sum_k t^k (T - a)^k g(0)/k!,                                    (T - a)^m g(0) =
    0, g(t) = e^(at) (cosh(sqrt(d) t) + sinh(sqrt(d) t)/sqrt(d) (T - a)) g(0),       ((T - a)^2 - d)
    g(0) = 0.
The equations times g are self-adjoint. V is computed exactly over the field of the parameters.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement, count
from math import factorial, isqrt
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from inverse_service import bounds
from inverse_service.expressions import calculus, polynomials, terms as tm, tree as ex
from inverse_service.field import exact_field, matrices, real_branch
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search import ansatz, antiderivatives, material as mt, row_factors
from inverse_service.search.antiderivatives import Integrator

# An eigenvalue below this fraction of the largest counts as zero.
_TINY = 1e-9
# The variable of characteristic polynomials, a name that no formula can contain.
_EIGENVALUE = ex.Symbol("an eigenvalue")
# Arrays of quotients; numpy applies the arithmetic of the objects.
Array = NDArray[Any]
Rate = tuple[ex.Expression, ex.Expression]


def is_linear(material: mt.Material) -> bool:
    """Whether f is linear in q and v, with constant coefficients of v."""
    moving: set[ex.Expression] = {*material.motion.coordinates, *material.motion.velocities}
    for key in (key for terms in material.motion.forces for key in terms):
        held = [item for item in key if ex.holds(item[0], *moving)]
        damps = any(isinstance(letter, ex.Velocity) for letter, _ in held)
        if held and (len(held) > 1 or held[0][0] not in moving or held[0][1] != 1):
            return False
        if damps and tm.depends_on([key], ex.TIME):
            return False
    return True


def propose(material: mt.Material, seed: int) -> Iterator[ex.Expression]:
    """Regular Lagrangians with such multipliers, definite and short ones first; L(q, q') if g' =
    0.
    """
    system, table = material.analysis.system, material.analysis.real_point
    if table is None:
        return
    lines = row_factors.lines_of(system, row_factors.solved_lines(system))
    (one, _), (stiffness, _), (damping, _) = lines.conditions()
    rates = list(_rates(damping)) if material.motion.question.timed else [(ex.ZERO, ex.ZERO)]
    parts = [tree for rate in rates for tree in rate]
    ring, values = row_factors.tables_in_ring(lines, [one, stiffness, damping], parts)
    arrays = [np.array(v) for v in values]
    multipliers = [one for rate in rates for one in _multipliers(material, ring, arrays, rate)]
    for g in _regular_sums(ring, multipliers, table):
        tree = row_factors.lagrangian_of_lines(lines.sums(g), Integrator(system, table))
        if tree is not None:
            yield tree


def _rates(damping: row_factors.Table) -> Iterator[Rate]:
    """(a, d) with constants a and d, where a +- sqrt(d) are means of two eigenvalues of C."""
    eigenvalues = eigenvalues_of([[tm.tree_of(entry) for entry in row] for row in damping])
    found = dict[Rate, None]()
    for (a, d), (b, e) in combinations_with_replacement(eigenvalues, 2):
        mean = tm.collected((a + b) / 2)
        if (a, d) == (b, e):
            found |= {(mean, ex.ZERO): None, (mean, d): None}
        elif ex.ZERO in (d, e):
            found[mean, tm.collected((d + e) / 4)] = None
    yield from found


def eigenvalues_of(trees: Sequence[Sequence[ex.Expression]]) -> list[Rate]:
    """(a, 0) for each factor x - a of det(trees - x), and (a, d) for each pair a +- sqrt(d)."""
    constants = [entry for row in trees for entry in row]
    ring = exact_field.exact_ring(
        constants, (), 0, exact_field.Budget.long(), further=(_EIGENVALUE,)
    )
    x, one = ring.atoms[_EIGENVALUE], ring.constant(1)
    matrix = [
        [ring.value(c) - (x if i == j else one - one) for j, c in enumerate(row)]
        for i, row in enumerate(trees)
    ]
    (place,) = (k for k, degree in enumerate(x.numerator.degrees()) if degree)
    eigenvalues = list[Rate]()
    for factor, _ in polynomials.factor_polynomial(matrices.determinant(matrix, one).numerator)[1]:
        parts = exact_field.coefficients_of(factor, [place])
        quotients = (ring.field.quotient(parts.get((k,), factor * 0), ()) for k in range(3))
        c, b, a = (exact_field.quotient_tree(ring, part) for part in quotients)
        if max(parts) == (1,):
            eigenvalues.append((-c / b, ex.ZERO))
        elif max(parts) == (2,):
            eigenvalues.append((-b / (2 * a), tm.collected(b**2 / (4 * a**2) - c / a)))
    return eigenvalues


def characteristic_of(system: SecondOrderSystem, letter: ex.Symbol) -> ex.Expression | None:
    """det(letter - C) of q'' = C q' with constant C, if it has no multiple roots, and an
    irreducible factor of degree above 2; None for other systems.
    """
    velocities = [ex.Velocity(name) for name in system.coordinates]
    still = dict.fromkeys(velocities, ex.ZERO)
    trees = [[calculus.differentiate(f, v) for v in velocities] for f in system.accelerations]
    constants = [entry for row in trees for entry in row]
    if any(ex.substitute(f, still) != ex.ZERO for f in system.accelerations) or any(
        ex.has(entry, ex.Velocity) or ex.holds(entry, ex.TIME, *map(ex.Symbol, system.coordinates))
        for entry in constants
    ):
        return None
    ring = exact_field.exact_ring(constants, (), 0, exact_field.Budget.long(), further=(letter,))
    x, one = ring.atoms[letter], ring.constant(1)
    matrix = [
        [(x if i == j else one - one) - ring.value(c) for j, c in enumerate(row)]
        for i, row in enumerate(trees)
    ]
    whole = matrices.determinant(matrix, one)
    (place,) = (k for k, degree in enumerate(x.numerator.degrees()) if degree)
    _, factors = polynomials.factor_polynomial(whole.numerator)
    degrees = [factor.degrees()[place] for factor, _ in factors]
    multiple = any(
        count > 1 and degree for (_, count), degree in zip(factors, degrees, strict=True)
    )
    return None if multiple or max(degrees) < 3 else exact_field.quotient_tree(ring, whole)


@dataclass(frozen=True, slots=True)
class Multiplier:
    """g(t) = sum of phi(t) G over the pairs (phi, G); `row` contains the entries of g(0) and of
    g(0) K.
    """

    parts: tuple[tuple[ex.Expression, Array], ...]
    row: tuple[exact_field.Quotient, ...]

    @property
    def size(self) -> int:
        """The number of terms in all entries."""
        return row_factors.term_count(self.row) + sum(
            row_factors.term_count(g.flat) for _, g in self.parts[1:]
        )


def _multipliers(
    material: mt.Material, ring: exact_field.ExactRing, tables: Sequence[Array], rate: Rate
) -> Iterator[Multiplier]:
    """The multipliers of one rate, for g(0) with many zeros in g(0) or in g(0) K; `tables` are 1,
    K, and C.
    """
    one, stiffness, damping = tables
    a, d = map(ring.value, rate)
    n, connection = len(one), _scaled(damping, Fraction(1, 2))
    tensor = stiffness + stiffness - _scaled(damping @ damping, Fraction(1, 2))
    conditions, basis, before = [(one, 1)], list[list[exact_field.Quotient]](), n * n + 1
    while before > len(basis):
        before = len(basis) or n * n + 1
        conditions.append((tensor, 1))
        basis = row_factors.constant_sums(ring, conditions).basis
        tensor = connection @ tensor - tensor @ connection
        if not basis:
            return

    def moved(g: Array) -> Array:
        """(T - a) g."""
        product: Array = g @ connection
        whole: Array = product + product.T - g * a
        return whole

    space = images = [np.array(vector).reshape(n, n) for vector in basis]
    for _ in space[: len(space) if material.motion.question.timed else 1] if d.is_zero else ():
        images = [moved(g) for g in images]
    images = images if d.is_zero else [moved(moved(g)) - g * d for g in images]
    weights = matrices.null_vectors(ring, [list(g.flat) for g in images])
    starts = [
        sum((g * w for g, w in zip(space, vector, strict=True)), start=one * ring.constant(0))
        for vector in weights
    ]
    rows = [[*g.flat, *(g @ stiffness).flat] for g in starts]
    last = sorted(range(n * n), key=lambda k: k % (n + 1) == 0)  # the entries on the diagonal
    orders = [last[::-1], last, [n * n + k for k in last]]
    for row in [row for order in orders for row in matrices.reduced_rows(rows, order).rows]:
        inverse = exact_field.common_factor([c for c in row[: n * n] if not c.is_zero]).inverse()
        primitive = tuple(entry * inverse for entry in row)
        g, parts = np.array(primitive[: n * n]).reshape(n, n), list[tuple[ex.Expression, Array]]()
        for phi in _functions_of_time(*rate, material.analysis.real_point or {}):
            if all(entry.is_zero for entry in g.flat):
                break
            parts.append((phi, g))
            g = moved(g)
        yield Multiplier(tuple(parts), primitive)


def _functions_of_time(
    a: ex.Expression, d: ex.Expression, table: real_branch.RealTable
) -> Iterator[ex.Expression]:
    """e^(at) t^k/k! or, for the pair of rates, e^(at) cosh(sqrt(d) t) and e^(at) sinh(sqrt(d)
    t)/sqrt(d).
    """
    growth = ex.Apply("exp", a * ex.TIME)
    if d == ex.ZERO:
        yield from (Fraction(1, factorial(k)) * ex.TIME**k * growth for k in count())
    rises = real_branch.real_sign(d, table) > 0
    root = antiderivatives.extracted_root(d if rises else ex.negated(d))
    yield growth * ex.Apply("cosh" if rises else "cos", root * ex.TIME)
    yield growth * ex.Apply("sinh" if rises else "sin", root * ex.TIME) / root


def _scaled(array: Array, factor: Fraction) -> Array:
    return np.array([entry.scaled(factor) for entry in array.flat], object).reshape(array.shape)


def _regular_sums(
    ring: exact_field.ExactRing, multipliers: Sequence[Multiplier], table: real_branch.RealTable
) -> list[list[tm.Terms]]:
    """Regular g, tested at t = 0 and real parameter values: definite ones first, then those with
    few terms.
    """
    size = isqrt(len(multipliers[0].row) // 2) if multipliers else 0
    known = {one.row: one for one in multipliers}
    ordered = sorted(known.values(), key=lambda one: (not _is_diagonal(one), one.size))
    starts = [_numeric(ring, one.parts[0][1], table) for one in ordered]
    alone = [[Fraction(int(j == k)) for j in range(k + 1)] for k in range(len(ordered))]
    first = [[Fraction(1)] * k for k in range(2, len(ordered) + 1)]
    few = [_without_idle(ordered, starts, one) for one in first[-1:]]
    found = list[tuple[tuple[bool, bool, int], list[tm.Terms]]]()
    for weights in [*ansatz.short_definite_weights(starts[: bounds.COLUMNS]), *alone, *first, *few]:
        used = [(w, k) for k, w in enumerate(weights) if w]
        values = _eigenvalues(starts, weights)
        if _is_regular(values):
            parts = [(phi, g, w) for w, k in used for phi, g in ordered[k].parts]
            total = [tm.Terms() for _ in range(size * size)]
            for phi, g, w in parts:
                for place, entry in enumerate(g.flat):
                    tree = phi * exact_field.quotient_tree(ring, entry)
                    total[place] = tm.add_terms(
                        total[place], tm.terms_of(tree), w if values[-1] > 0 else -w
                    )
            changes = any(len(ordered[k].parts) > 1 for _, k in used)  # its sign may, too
            mixed = not all(_is_diagonal(ordered[k]) for _, k in used)
            rank = (
                changes or bool(values[0] < 0 < values[-1]),
                mixed,
                sum(ordered[k].size for _, k in used),
            )
            found.append((rank, total))
    return [g for _, g in sorted(found, key=lambda one: one[0])]


def _without_idle(
    multipliers: Sequence[Multiplier],
    starts: Sequence[NDArray[np.float64]],
    weights: Sequence[Fraction],
) -> list[Fraction]:
    """The weights without those that the sum does not need to be regular, the longest first."""
    kept = list(weights)
    for place in sorted(range(len(kept)), key=lambda k: -multipliers[k].size):
        less = [Fraction(0) if k == place else w for k, w in enumerate(kept)]
        if any(less) and _is_regular(_eigenvalues(starts, less)):
            kept = less
    return kept


def _eigenvalues(
    starts: Sequence[NDArray[np.float64]], weights: Sequence[Fraction]
) -> NDArray[np.float64]:
    used = [float(w) * starts[k] for k, w in enumerate(weights) if w]
    return np.asarray(np.linalg.eigvalsh(sum(used[1:], used[0])))


def _is_regular(values: NDArray[np.float64]) -> bool:
    return bool(min(abs(values)) > _TINY * max(abs(values)))


def _is_diagonal(multiplier: Multiplier) -> bool:
    return all(entry.is_zero for (i, j), entry in np.ndenumerate(multiplier.parts[0][1]) if i != j)


def _numeric(
    ring: exact_field.ExactRing, matrix: Array, table: real_branch.RealTable
) -> NDArray[np.float64]:
    trees = (exact_field.quotient_tree(ring, entry) for entry in matrix.flat)
    with mpmath.workdps(bounds.DIGITS):
        return np.array([float(calculus.evaluate(tree, table)) for tree in trees]).reshape(
            matrix.shape
        )
