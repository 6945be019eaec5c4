"""The Lagrangians that the search returns: members of a space that are regular, definite if possible, simple.

If the simplest regular sums are indefinite, weights for which a sum of several has a positive definite Hessian are
computed at one real point, then made few and short. Further Lagrangians are shown if they have an advantage.
"""

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import mpmath
import numpy as np
from flint import nmod_mat
from numpy.typing import NDArray

from inverse_service import bounds, deadline
from inverse_service.decision import certify, deciding, solutions
from inverse_service.expressions import printing, tree as ex
from inverse_service.field import exact_field, matrices, modular, real_branch
from inverse_service.mechanics import euler_lagrange, writing
from inverse_service.search import ansatz, terms as tm
from inverse_service.search.ansatz import SamplePoints

Residues = NDArray[np.object_]
Matrix = NDArray[np.float64]
# The smallest eigenvalue that counts as positive.
_POSITIVE = 1e-3
_DENOMINATORS = (1, 2, 3, 4, 6, 12)
_LONGEST_CHECK = 60.0  # seconds per described Lagrangian
# Two Hessians are compared at a point and where its coordinates and velocities are larger by this factor.
_TINY, _STEP = mpmath.mpf(10) ** -20, mpmath.mpf(129) / 128


@dataclass(frozen=True, slots=True)
class Found:
    """Regular Lagrangians of one family, simplest first; `parts` are the Lagrangians whose sum is the first one."""

    lagrangians: tuple[ex.Expression, ...]
    family: str
    parts: tuple[ex.Expression, ...]


@dataclass(frozen=True, slots=True)
class SearchOutcome:
    """The Lagrangians found, and each family tried with its number of candidates."""

    found: Found | None
    tried: tuple[tuple[str, int], ...]


def hessians(space: ansatz.LagrangianSpace, points: SamplePoints, first: int = 0) -> tuple[int, list[Residues]]:
    """(prime, d2L/dv dv of each combination at one of the points), skipping the `first` points."""
    every = dict.fromkeys(key for c in space.combinations for key in c)
    candidates = [key for key in every if not tm.is_linear(key)]
    letters = ansatz.letters_of(candidates)
    table = ansatz.table_at(points, letters, first + 1, first=first)
    inverse, n = pow(1 << 64, -1, table.prime), table.derivatives.size
    values = ansatz.hessians_of(table, letters, candidates)[0][0].astype(object) * inverse % table.prime
    single = dict(zip(candidates, values, strict=True))
    zero = np.zeros((n, n), object)

    def combined(combination: ansatz.Combination) -> Residues:
        weighted = (
            modular.number_value(a, table.prime) * single[key] for key, a in combination.items() if key in single
        )
        return sum(weighted, start=zero) % table.prime

    return table.prime, list(map(combined, space.combinations))


def _regular_sets(
    space: ansatz.LagrangianSpace, order: Sequence[int], forms: Sequence[Residues], prime: int, seed: int
) -> list[tuple[int, ...]]:
    """Sets of indices, simplest first, of combinations whose generic sum is regular; `order` sorts the combinations."""
    squares_first = sorted(order, key=lambda k: not _is_diagonal(forms[k]))
    generator = random.Random(seed)
    weights = {k: generator.randrange(1, prime) for k in order}

    def is_regular(chosen: Sequence[int]) -> bool:
        total = sum((weights[k] * forms[k] for k in chosen), start=0 * forms[0]) % prime
        return bool(nmod_mat(total.tolist(), prime).rank() == len(total))

    found: list[tuple[int, ...]] = [(k,) for k in order if is_regular([k])]
    for sequence in (squares_first, order):
        chosen = list(sequence) if is_regular(sequence) else []
        for k in reversed(chosen.copy()):  # try to omit the last ones first
            rest = [j for j in chosen if j != k]
            chosen = rest if is_regular(rest) else chosen
        found += [tuple(chosen)] if chosen else []
    return sorted(dict.fromkeys(found), key=lambda ks: sum(complexity(space.combinations[k])[0] for k in ks))


def _is_diagonal(matrix: Residues) -> bool:
    return not (matrix - np.diag(np.diagonal(matrix))).any()


def complexity(combination: ansatz.Combination) -> tuple[Fraction | int, int]:
    """The total weight of its terms, and their number."""
    return sum((tm.rank(key)[0] + 1 for key in combination), Fraction(0)), len(combination)


def reduced(total: ansatz.Combination, gauge: Sequence[ansatz.Combination]) -> ansatz.Combination:
    """The combination minus gauge elements, subtracted while that makes it simpler."""
    improved = True
    while improved:
        improved = False
        for element in gauge:
            for key, a in element.items():
                if key in total:
                    shorter = tm.add_terms(total, element, -total[key] / a)
                    if shorter and complexity(shorter) < complexity(total):
                        total, improved = shorter, True
    return total


def scaled(combination: ansatz.Combination, sign: int = 0) -> ansatz.Combination:
    """The multiple in which the simplest term not linear in the velocities has the coefficient 1/2 if quadratic, else
    1.

    A positive `sign` means a positive factor.
    """
    moving = [key for key in combination if not tm.is_linear(key)] or list(combination)
    leading = min(moving, key=tm.rank)
    target = Fraction(1, 2) if any(e == 2 and tm.has_velocity(letter) for letter, e in leading) else Fraction(1)
    factor = target / (abs(combination[leading]) if sign > 0 else combination[leading])
    return {key: a * factor for key, a in combination.items()}


def definite_weights(hessians: Sequence[Matrix]) -> list[list[Fraction]]:
    """Weights w with sum w_k H_k positive definite: one choice far from all singular sums, one with as few as possible.

    H_k are symmetric of shape (n, n), finite and not zero; at most `bounds.COLUMNS` of them.
    """
    near = matrices.definite_weights(hessians) if 0 < len(hessians) <= bounds.COLUMNS else None
    if near is None:
        return []
    found = [_short(near, hessians), _short(_few(near, hessians), hessians)]
    return [one for k, one in enumerate(found) if one is not None and one not in found[:k]]


def _is_definite(matrix: Matrix) -> bool:
    """Whether the matrix is clearly positive definite in units in which all squares have the coefficient 1."""
    sizes = np.sqrt(np.abs(np.diagonal(matrix)))
    return bool(sizes.all() and np.linalg.eigvalsh(matrix / np.outer(sizes, sizes))[0] > _POSITIVE)


def _few(weights: list[float], hessians: Sequence[Matrix]) -> list[float]:
    """The weights with unnecessary ones set to 0, the smallest first."""
    kept = list(weights)
    for k in sorted(range(len(kept)), key=lambda k: abs(weights[k])):
        without = [0.0 if j == k else w for j, w in enumerate(kept)]
        if _is_definite(np.tensordot(without, hessians, 1)):
            kept = without
    return kept


def _short(weights: Sequence[float], hessians: Sequence[Matrix]) -> list[Fraction] | None:
    """The weights rounded to multiples of 1/d for the least possible d; equal weights stay equal."""
    largest = max(map(abs, weights))
    for d in _DENOMINATORS:
        rounded = [Fraction(round(w / largest * d), d) for w in weights]
        if _is_definite(np.tensordot([float(w) for w in rounded], hessians, 1)):
            return rounded
    return None


@dataclass(frozen=True, slots=True)
class Member:
    """A Lagrangian, the combinations whose sum it is, and whether its Hessian is positive at the real point."""

    terms: ansatz.Combination
    parts: tuple[ansatz.Combination, ...]
    definite: bool


def best_members(
    space: ansatz.LagrangianSpace, seed: int, completed: Callable[[ansatz.Combination], ansatz.Combination] = dict
) -> list[Member]:
    """The simplest regular members that can be `completed` by potentials: definite ones first, then short ones."""
    if not space.combinations:
        return []
    prime, forms = hessians(space, space.sampler.points(seed))
    # The others are total derivatives, or vanish by relations among generators.
    moving = [k for k, form in enumerate(forms) if form.any()]
    gauge = [c for c, form in zip(space.combinations, forms, strict=True) if not form.any()]
    order = sorted(moving, key=lambda k: complexity(space.combinations[k]))
    sets = _regular_sets(space, order, forms, prime, seed)[: bounds.FEW]
    found = [_sum_of(space, gauge, chosen) for chosen in sets]
    if sets and not any(member.definite for member in found):
        found += _definite_sums(space, gauge, [space.combinations[k] for k in order[: bounds.COLUMNS]])
    found = [replace(member, terms=whole) for member in found if (whole := completed(member.terms))]
    parameters = frozenset(ex.Symbol(name) for name in space.sampler.analysis.system.parameters)
    table = space.sampler.real_point
    plain = [_divided(member, parameters, table) for member in found] if table and parameters else found
    return sorted(plain, key=lambda member: _order(member, parameters))


def _order(member: Member, parameters: frozenset[ex.Symbol]) -> tuple[bool, Fraction, tuple[Fraction | int, int]]:
    weights = (sum((abs(e) + (e < 0) for _, e in part), Fraction(0)) for part in _constants(member.terms, parameters))
    return not member.definite, sum(weights, Fraction(0)), complexity(member.terms)


def _divided(member: Member, parameters: frozenset[ex.Symbol], table: real_branch.RealTable) -> Member:
    """The member divided by the parameters of one of its kinetic terms, if that leaves fewer parameters there.

    A constant times a multiplier is a multiplier; the sign keeps the Hessian positive at the real point.
    """
    found = [member]
    for part in dict.fromkeys(_constants(member.terms, parameters)):
        if part:
            sign = -1 if real_branch.real_sign(tm.monomial_tree(part), table) < 0 else 1
            terms = {tm.times(key, part, -1): sign * value for key, value in member.terms.items()}
            found.append(replace(member, terms=terms))
    return min(found, key=lambda one: _order(one, parameters))


def _constants(terms: ansatz.Combination, parameters: frozenset[ex.Symbol]) -> list[tm.Monomial]:
    """The generators of each kinetic term that contain only parameters."""
    kinetic = [key for key in terms if not tm.is_linear(key)]
    return [frozenset(item for item in key if tm.is_constant(item[0], parameters)) for key in kinetic]


def _sum_of(space: ansatz.LagrangianSpace, gauge: Sequence[ansatz.Combination], chosen: Sequence[int]) -> Member:
    """The sum of the chosen combinations, each with the sign that makes its Hessian positive.

    If that sum is singular, the parts get different weights.
    """
    names, table = space.sampler.analysis.system.coordinates, space.sampler.real_point

    def inertia(combination: ansatz.Combination) -> tuple[int, int] | None:
        return euler_lagrange.inertia(euler_lagrange.hessian_at(tm.tree_of(combination), names, table))

    parts = [scaled(reduced(space.combinations[k], gauge)) for k in chosen]
    signs = [-1 if found is not None and found[1] > found[0] else 1 for found in (inertia(p) for p in parts)]
    total, found = ansatz.Combination(), None
    for spread in range(3):
        weights = (sign * (1 + spread * k) for k, sign in enumerate(signs))
        total = reduced(tm.weighted_sum(zip(parts, weights, strict=True)), gauge)
        found = inertia(total)
        if found is None or sum(found) == len(names):
            break
    given = tuple(space.combinations[k] for k in chosen)
    return Member(total, given, found is not None and found[0] == len(names))


def _definite_sums(
    space: ansatz.LagrangianSpace, gauge: Sequence[ansatz.Combination], simplest: Sequence[ansatz.Combination]
) -> list[Member]:
    """Sums of the simplest combinations with a positive definite Hessian at the real point."""
    if not all(map(_is_quadratic, space.combinations)):
        return []  # a Hessian that contains velocities is definite at some places only
    with_hessian = [(c, matrix) for c in simplest if (matrix := _real_hessian(space, c)) is not None]
    found = []
    for weights in definite_weights([matrix for _, matrix in with_hessian]):
        used = [(weight, c) for weight, (c, _) in zip(weights, with_hessian, strict=True) if weight]
        total = tm.weighted_sum((c, weight) for weight, c in used)
        found.append(Member(scaled(reduced(total, gauge), sign=1), tuple(c for _, c in used), definite=True))
    return found


def _is_quadratic(combination: ansatz.Combination) -> bool:
    """Whether its terms are v_i v_j, v_i or 1 times functions of position."""
    moving = [[(letter, e) for letter, e in key if tm.has_velocity(letter)] for key in combination]
    plain = all(isinstance(letter, ex.Velocity) for part in moving for letter, _ in part)
    return plain and all(
        sum(e for _, e in part) in (0, 1, 2) and min((e for _, e in part), default=1) > 0 for part in moving
    )


def _real_hessian(space: ansatz.LagrangianSpace, combination: ansatz.Combination) -> Matrix | None:
    """d2L/dv dv at the real point; None if it vanishes or has no value."""
    deadline.check()
    names = space.sampler.analysis.system.coordinates
    form = euler_lagrange.hessian_at(tm.tree_of(combination), names, space.sampler.real_point)
    matrix = np.array([] if form is None else form.tolist(), float)
    return matrix if matrix.any() and np.isfinite(matrix).all() else None


def describe(analysis: deciding.Analysis, lagrangian: ex.Expression, family: str) -> solutions.Lagrangian:
    """Describe L: g = d2L/dv dv, the functions that must not vanish, and those that are positive on its domain."""
    names = analysis.system.coordinates
    rates = euler_lagrange.hessian(lagrangian, names)
    short = {entry: _compact(analysis, entry) for row in rates for entry in row}
    multiplier = tuple(tuple(short[entry] for entry in row) for row in rates)
    where = certify.where_proved(analysis, lagrangian, min(deadline.left(deadline.end(), 1.0), _LONGEST_CHECK))
    return solutions.Lagrangian(lagrangian, multiplier, where.nonzero, family, where.positive)


def _compact(analysis: deciding.Analysis, entry: ex.Expression) -> ex.Expression:
    """The entry as a sum of products or, if that is shorter, as one quotient; parameters are printed first."""
    held, count = set(ex.walk(entry)), 1 + 2 * len(analysis.system.coordinates)
    moving = [variable for variable in deciding.variables_of(analysis.system)[:count] if variable in held]
    return writing.shorten(tm.collected(entry), exact_field.Budget.short(), moving)


def is_multiple(
    first: ex.Expression, second: ex.Expression, names: Sequence[str], table: real_branch.RealTable | None
) -> bool:
    """Whether the Hessians are constant multiples of each other at the real point and at a point near it."""
    if table is None:
        return first == second
    moving = {*map(ex.Symbol, names), *map(ex.Velocity, names)}
    with mpmath.workdps(30):
        beside = {leaf: value * _STEP if leaf in moving else value for leaf, value in table.items()}
        forms = [[euler_lagrange.hessian_at(tree, names, at) for tree in (first, second)] for at in (table, beside)]
        if any(form is None for pair in forms for form in pair):
            return False
        pairs = [entries for pair in forms for entries in zip(*pair, strict=True)]
        a, b = max(pairs, key=lambda pair: abs(pair[0]))
        return all(abs(x * b - y * a) < _TINY * (1 + abs(a * b)) for x, y in pairs)


def why_shown(
    shown: ex.Expression, other: ex.Expression, names: Sequence[str], table: real_branch.RealTable | None
) -> str:
    """The advantage of another Lagrangian over the shown one; "" if it has none."""
    if len(printing.to_text(other)) < len(printing.to_text(shown)):
        return "shorter"
    if is_definite(other, names, table) and not is_definite(shown, names, table):
        return "positive definite"
    return "of another kind" if _kind(other, names) < _kind(shown, names) else ""


def is_definite(lagrangian: ex.Expression, names: Sequence[str], table: real_branch.RealTable | None) -> bool:
    """Whether the Hessian is positive definite at the real point."""
    return euler_lagrange.inertia(euler_lagrange.hessian_at(lagrangian, names, table)) == (len(names), 0)


def _kind(lagrangian: ex.Expression, names: Sequence[str]) -> tuple[int, bool]:
    """Its `reading_class`, and whether its degree in the velocities exceeds 2."""
    moving = {*map(ex.Velocity, names)}
    is_higher = any(
        node in moving for row in euler_lagrange.hessian(lagrangian, names) for entry in row for node in ex.walk(entry)
    )
    return ex.reading_class(lagrangian, ex.TIME), is_higher
