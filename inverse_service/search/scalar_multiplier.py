"""Multipliers phi(t, q) G with one function phi and a constant symmetric matrix G, found exactly.

(H2) gives Gamma(log det g) = -div_v f, so n d(log phi) = -div_v f has to be alpha_0 + alpha_i v_i with alpha
closed, the integral being n log phi. Then G solves linear equations whose coefficients hold parameters and any
numbers. f is quadratic in v, and phi G_ij (q''_j - f_j) are the Euler-Lagrange expressions of
phi G_ij v_i v_j / 2 + A_i v_i - V.

For n = 1, y'' = a + b y' + c y'^2, this is phi = exp(-int b dt - 2 int c dy), where b_y = 2 c_t; with alpha_0(t) alone
it is uniform damping (Bateman 1931); with alpha = 0 a constant multiplier.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import mpmath
import numpy as np

from inverse_service import bounds
from inverse_service.decision.deciding import Analysis
from inverse_service.expressions import evaluation
from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field
from inverse_service.field.matrices import null_vectors, numerators, reduced_rows
from inverse_service.field.real_point import RealTable
from inverse_service.mechanics import conditions
from inverse_service.mechanics.potential import potential
from inverse_service.search import members, quadratures, terms
from inverse_service.search.material import Material

Matrix = list[list[exact_field.Quotient]]


@dataclass(frozen=True, slots=True)
class _Setting:
    """f over its ring, df/dv, Gamma(log phi), its part alpha_0 without velocities, and phi."""

    exact: conditions.MotionInRing
    slopes: conditions.Tensor11[exact_field.Quotient]
    rate: exact_field.Quotient
    drag: exact_field.Quotient
    phi: ex.Expression

    @property
    def ring(self) -> exact_field.ExactRing:
        return self.exact.ring

    @property
    def places(self) -> range:
        return range(self.exact.motion.size)

    def at_rest(self, element: exact_field.Quotient) -> exact_field.Quotient:
        """The element at v = 0."""
        moving = [index for index, tree in self.ring.trees.items() if isinstance(tree, ex.Velocity)]
        return exact_field.Quotient(
            self.ring.field, element.numerator.subs(dict.fromkeys(moving, 0)), element.exponents
        )


@dataclass(frozen=True, slots=True)
class _Prepared:
    """The multiplier up to its constant matrix, and regular choices of that."""

    setting: _Setting
    matrices: list[Matrix]


def propose(material: Material, seed: int) -> list[ex.Expression]:
    """Lagrangians with such a multiplier, the simplest first; none where f has none."""
    known = _prepared(material)
    if known is None:
        return []
    try:
        found = [_lagrangian(material, known.setting, matrix) for matrix in known.matrices]
    except (exact_field.TooLarge, terms.TooManyTerms, ZeroDivisionError):
        return []
    return [tree for tree in found if tree is not None]


def kinetic_terms(material: Material) -> list[terms.Monomial]:
    """The terms of phi G_ij v_i v_j for all of these multipliers: where they are found, A and V may take an ansatz."""
    known = _prepared(material)
    if known is None or function_of_position(material) is None:
        return []
    velocities = material.motion.velocities
    try:
        kinetic = [_kinetic(known.setting, velocities, matrix) for matrix in known.matrices]
        return list(dict.fromkeys(key for tree in kinetic for key in terms.terms_of(tree)))
    except terms.TooManyTerms:
        return []


def function_of_position(material: Material) -> ex.Expression | None:
    """phi where f has such a multiplier without integral signs in it."""
    known = _prepared(material)
    return (
        known.setting.phi if known and not any(isinstance(n, ex.Integral) for n in ex.walk(known.setting.phi)) else None
    )


def is_of_one_coordinate(material: Material) -> bool:
    return material.motion.size == 1


def _prepared(material: Material) -> _Prepared | None:
    """None where f has no such multiplier; computed once for all rungs that ask."""
    if "scalar multiplier" not in material.shared:
        material.shared["scalar multiplier"] = _multipliers(material)
    found: _Prepared | None = material.shared["scalar multiplier"]
    return found


def _multipliers(material: Material) -> _Prepared | None:
    try:
        exact = conditions.motion_in_ring(material.analysis.system, 2, exact_field.Budget.long())
        setting = _setting(exact, material.analysis)
        if setting is None or (ex.TIME in ex.walk(setting.phi) and not material.motion.with_time):
            return None
        chosen = _regular(setting, material.analysis.real_point)
    except (exact_field.TooLarge, terms.TooManyTerms, ZeroDivisionError):
        return None
    return _Prepared(setting, chosen) if chosen else None


def _setting(exact: conditions.MotionInRing, analysis: Analysis) -> _Setting | None:
    """None where f is not quadratic in v, or -div_v f/n not Gamma of a function of t and q that is found."""
    motion, ring = exact.motion, exact.ring
    slopes = conditions.velocity_slopes(motion)
    share = exact_field.sum_of(motion.zero, [slopes[i][i] for i in range(motion.size)]).scaled(
        Fraction(-1, motion.size)
    )
    alpha = [by(share) for by in motion.by_velocity]
    second = [by(entry) for row in slopes for entry in row for by in motion.by_velocity]
    if any(not by(entry).is_zero for entry in (*alpha, *second) for by in motion.by_velocity):
        return None
    velocities = [ring.atoms[v] for v in ring.variables if isinstance(v, ex.Velocity)]
    drag = exact_field.sum_of(motion.zero, [share, *(-(slope * v) for slope, v in zip(alpha, velocities, strict=True))])
    found = potential(ring, range(1 + motion.size), [drag, *alpha])
    if found is None:
        return None
    return _Setting(exact, slopes, share, drag, quadratures.exponential(ring, found, analysis.real_point))


def _regular(setting: _Setting, table: RealTable | None) -> list[Matrix]:
    """Regular constant matrices G: those that are positive definite at the real point first, then few entries."""
    basis = [_oriented(setting, _matrix(setting, vector), table) for vector in _constant_vectors(setting)]
    if not basis:
        return []
    real = [_real(setting, matrix, table) for matrix in basis]
    known = [matrix for matrix in real if matrix is not None]
    weights = members.definite_weights(known) if len(known) == len(basis) <= bounds.COLUMNS else []
    plain = [Fraction(int(_is_diagonal(matrix))) for matrix in basis]
    alone = [[Fraction(int(j == k)) for j in range(len(basis))] for k in range(len(basis))]
    choices = [plain, *weights, [Fraction(1)] * len(basis), *alone]
    sums = [_combined(setting, basis, choice) for k, choice in enumerate(choices) if choice not in choices[:k]]
    found = [matrix for matrix in sums if len(reduced_rows(matrix, range(len(matrix))).pivots) == len(matrix)]
    return sorted(found, key=lambda one: (not _is_definite(_real(setting, one, table)), _entries(one)))[: bounds.FEW]


def _constant_vectors(setting: _Setting) -> list[list[exact_field.Quotient]]:
    """The entries G_ab, a <= b, that (H2) and (H3) allow: a basis over the constants, each without denominators."""
    phi, zero = conditions.jacobi_endomorphism(setting.exact.motion), setting.ring.constant(0)
    columns = [_conditions(setting, phi, a, b, zero) for a, b in _pairs(setting)]
    return [_without_denominators(setting, vector) for vector in null_vectors(setting.ring, columns)]


def _pairs(setting: _Setting) -> list[tuple[int, int]]:
    return list(itertools.combinations_with_replacement(setting.places, 2))


def _conditions(
    setting: _Setting, phi: conditions.Tensor11[exact_field.Quotient], a: int, b: int, zero: exact_field.Quotient
) -> list[exact_field.Quotient]:
    """(H2) and (H3) for the matrix with ones at (a, b) and (b, a): rate G + (G f_v + (G f_v)^T)/2, and G Phi skewed."""

    def lowered(tensor: conditions.Tensor11[exact_field.Quotient], i: int, j: int) -> exact_field.Quotient:
        """(G T)_ij."""
        return tensor[b][j] if i == a else tensor[a][j] if i == b else zero

    rates = []
    for i, j in _pairs(setting):
        half = (lowered(setting.slopes, i, j) + lowered(setting.slopes, j, i)).scaled(Fraction(1, 2))
        rates.append(half + setting.rate if (i, j) == (a, b) else half)
    skew = [lowered(phi, i, j) - lowered(phi, j, i) for i, j in itertools.combinations(setting.places, 2)]
    return [*rates, *skew]


def _without_denominators(setting: _Setting, vector: Sequence[exact_field.Quotient]) -> list[exact_field.Quotient]:
    return [exact_field.Quotient(setting.ring.field, numerator, ()) for numerator in numerators(setting.ring, vector)]


def _matrix(setting: _Setting, vector: Sequence[exact_field.Quotient]) -> Matrix:
    table = dict(zip(_pairs(setting), vector, strict=True))
    return [[table[min(i, j), max(i, j)] for j in setting.places] for i in setting.places]


def _combined(setting: _Setting, basis: Sequence[Matrix], weights: Sequence[Fraction]) -> Matrix:
    zero = setting.ring.constant(0)
    pairs = [(matrix, w) for matrix, w in zip(basis, weights, strict=True) if w]
    return [
        [exact_field.sum_of(zero, [m[i][j].scaled(w) for m, w in pairs]) for j in setting.places]
        for i in setting.places
    ]


def _entries(matrix: Matrix) -> int:
    return sum(not entry.is_zero for row in matrix for entry in row)


def _is_diagonal(matrix: Matrix) -> bool:
    return all(entry.is_zero for i, row in enumerate(matrix) for j, entry in enumerate(row) if i != j)


def _oriented(setting: _Setting, matrix: Matrix, table: RealTable | None) -> Matrix:
    """The matrix or its opposite, with a positive trace at the real point, or if that is 0 a positive first entry."""
    values = _real(setting, matrix, table)
    positive = values is None or (values.trace() or values[0, 0]) >= 0
    return matrix if positive else [[-entry for entry in row] for row in matrix]


def _real(setting: _Setting, matrix: Matrix, table: RealTable | None) -> members.Matrix | None:
    """The entries at the real point; None where there is none."""
    if table is None:
        return None
    try:
        with mpmath.workdps(20):
            return np.array(
                [
                    [float(evaluation.evaluate(exact_field.quotient_tree(setting.ring, e), table)) for e in row]
                    for row in matrix
                ]
            )
    except (evaluation.NoRealValue, ArithmeticError, TypeError):
        return None


def _is_definite(matrix: members.Matrix | None) -> bool:
    return matrix is not None and bool(np.linalg.eigvalsh(matrix)[0] > 0)


def _lagrangian(material: Material, setting: _Setting, matrix: Matrix) -> ex.Expression | None:
    """phi G_ij v_i v_j / 2 + A_i v_i - V; None where the last terms have no closed form that is found."""
    velocities = material.motion.velocities
    wanted = [_wanted(setting, velocities, row) for row in matrix]
    rest = quadratures.completed(material.analysis.system.coordinates, wanted)
    return None if rest is None else _kinetic(setting, velocities, matrix) + rest


def _kinetic(setting: _Setting, velocities: Sequence[ex.Velocity], matrix: Matrix) -> ex.Expression:
    """phi G_ij v_i v_j / 2."""
    squares = [
        (ex.HALF if i == j else ex.ONE)
        * exact_field.quotient_tree(setting.ring, matrix[i][j])
        * (velocities[i] ** 2 if i == j else velocities[i] * velocities[j])
        for i, j in _pairs(setting)
    ]
    return setting.phi * ex.add(*squares)


def _wanted(setting: _Setting, velocities: Sequence[ex.Velocity], row: Sequence[exact_field.Quotient]) -> terms.Terms:
    """-phi ((G f)_i + ((G f_v)_ij + alpha_0 G_ij) v_j) at v = 0: what A_i v_i - V has to give."""
    ring, zero, motion = setting.ring, setting.ring.constant(0), setting.exact.motion
    force = exact_field.sum_of(
        zero, [-(g * setting.at_rest(f)) for g, f in zip(row, motion.accelerations, strict=True)]
    )
    total = terms.terms_of(setting.phi * exact_field.quotient_tree(ring, force))
    for j, v in enumerate(velocities):
        slopes = [-(g * setting.at_rest(setting.slopes[k][j])) for k, g in enumerate(row)]
        tree = exact_field.quotient_tree(ring, exact_field.sum_of(zero, [*slopes, -(row[j] * setting.drag)]))
        total = terms.add_terms(
            total, terms.multiply_terms(terms.terms_of(setting.phi * tree), {terms.monomial(v): Fraction(1)})
        )
    return total
