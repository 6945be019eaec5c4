"""Which algebraic conditions on the multiplier suffice for a negative verdict.

The hierarchy, each tensor T of type (1, 1) giving "g T is symmetric" and each curvature the cyclic
condition g_ij R^j_kl + g_lj R^j_ik + g_kj R^j_li = 0:

    Phi, nabla Phi, nabla^2 Phi, …;   R, nabla R, …;   R[nabla Phi], R[nabla^2 Phi], …

with the tensors of `mechanics.conditions`. At a point each is a linear condition on the n(n+1)/2
entries of g. A set suffices when every symmetric g that satisfies it at a generic point is singular.
Values are taken at random points modulo a prime, from Taylor series of f.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from flint import nmod_mat

from inverse_service import bounds
from inverse_service.decision.local_system import LocalScalar, motion_of_series
from inverse_service.errors import IrreducibleAtoms
from inverse_service.field.tower import draw_point
from inverse_service.field.truncated_series import SingularPoint
from inverse_service.mechanics.conditions import (
    Motion,
    S,
    Tensor11,
    Tensor12,
    connection,
    curvature,
    jacobi_endomorphism,
    nabla,
    nabla_of_curvature,
)

if TYPE_CHECKING:
    from inverse_service.decision.analysis import Analysis


def local_motion(analysis: Analysis, seed: int, order: int) -> Motion[LocalScalar]:
    """The motion about the random point of this seed, f known to `order`.

    A point where a denominator vanishes is passed over for the next one. Raises IrreducibleAtoms
    where no point was found.
    """
    for attempt in range(bounds.ATTEMPTS):
        point = draw_point(analysis.tower, seed * bounds.ATTEMPTS + attempt)
        with suppress(SingularPoint):
            return motion_of_series(*analysis.series(point, analysis.system.depends_on_time, order))
    raise IrreducibleAtoms("the formulas vanish or have no value at every random point tried")


# Larger sets than this are not searched for the smallest; all conditions of the depth are named.
LARGEST_SET = 4
DEEPEST = 3
_TRIALS = 3

Row = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class ConditionName:
    """A tensor of the hierarchy; `order` counts the derivatives of f that it needs."""

    name: str
    order: int
    cyclic: bool


@dataclass(frozen=True, slots=True)
class EquationName:
    """One linear equation: (T)_ik for "g T symmetric" (i < k), (R)_ikl for the cyclic one (i < k < l)."""

    condition: ConditionName
    indices: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class SufficientSet:
    """Conditions that leave only singular g, the equations among them needed, and what is left.

    `dimension` is that of the space of symmetric g that satisfy the equations at a generic point.
    """

    conditions: tuple[ConditionName, ...]
    equations: tuple[EquationName, ...]
    rank: int
    dimension: int


def unknowns(n: int) -> list[tuple[int, int]]:
    """Index pairs of the entries g_ij, i <= j, in the order of the columns."""
    return [(i, j) for i in range(n) for j in range(i, n)]


def _power_name(operator: str, exponent: int, operand: str) -> str:
    """ "Phi", "nabla Phi", "nabla^2 Phi"."""
    if exponent == 0:
        return operand
    return f"{operator} {operand}" if exponent == 1 else f"{operator}^{exponent} {operand}"


def hierarchy(motion: Motion[S], depth: int) -> dict[ConditionName, Tensor11[S] | Tensor12[S]]:
    """The tensors that need at most depth + 2 derivatives of f; curvatures only for n >= 3."""
    n = connection(motion)
    endomorphisms = [jacobi_endomorphism(motion)]
    for _ in range(depth):
        endomorphisms.append(nabla(motion, n, endomorphisms[-1]))
    table: dict[ConditionName, Tensor11[S] | Tensor12[S]] = {}
    for k, tensor in enumerate(endomorphisms):
        table[ConditionName(_power_name("nabla", k, "Phi"), k + 2, False)] = tensor
    if motion.size < 3:
        return table
    bend: Tensor12[S] | None = None
    for k in range(depth):
        bend = curvature(motion, endomorphisms[0]) if bend is None else nabla_of_curvature(motion, n, bend)
        table[ConditionName(_power_name("nabla", k, "R"), k + 3, True)] = bend
        if k:
            name = f"R[{_power_name('nabla', k, 'Phi')}]"
            table[ConditionName(name, k + 3, True)] = curvature(motion, endomorphisms[k])
    return table


def equation_terms(
    condition: ConditionName, tensor: Tensor11[S] | Tensor12[S], n: int
) -> dict[EquationName, list[tuple[tuple[int, int], int, S]]]:
    """Each equation as terms (unknown, sign, coefficient), the unknown given with i <= j."""
    found: dict[EquationName, list[tuple[tuple[int, int], int, S]]] = {}
    if condition.cyclic:
        bend = cast("Tensor12[S]", tensor)
        for i, k, m in itertools.combinations(range(n), 3):
            cycle = [(i, k, m), (m, i, k), (k, m, i)]
            terms = [(_pair(a, j), 1, bend[j][b][c]) for a, b, c in cycle for j in range(n)]
            found[EquationName(condition, (i, k, m))] = terms
        return found
    plain = cast("Tensor11[S]", tensor)
    for i, k in itertools.combinations(range(n), 2):
        left = [(_pair(i, j), 1, plain[j][k]) for j in range(n)]
        right = [(_pair(k, j), -1, plain[j][i]) for j in range(n)]
        found[EquationName(condition, (i, k))] = left + right
    return found


def _pair(i: int, j: int) -> tuple[int, int]:
    return (i, j) if i <= j else (j, i)


@dataclass(frozen=True, slots=True)
class PointwiseConditions:
    """The equations of the hierarchy at one point, each a row over the `unknowns`, modulo `prime`."""

    size: int
    prime: int
    rows: Mapping[EquationName, Row]

    def kernel(self, names: Sequence[EquationName]) -> list[Row]:
        """A basis of the g that satisfy the named equations."""
        return kernel([self.rows[name] for name in names], len(unknowns(self.size)), self.prime)


def tensors_at(motion: Motion[LocalScalar], depth: int) -> PointwiseConditions:
    """The equations of the hierarchy to `depth` at the point of the series."""
    n, prime = motion.size, motion.zero.ring.prime
    position = {pair: column for column, pair in enumerate(unknowns(n))}
    rows: dict[EquationName, Row] = {}
    for condition, tensor in hierarchy(motion, depth).items():
        for name, terms in equation_terms(condition, tensor, n).items():
            row = [0] * len(position)
            for pair, sign, coefficient in terms:
                row[position[pair]] += sign * coefficient.value
            rows[name] = tuple(entry % prime for entry in row)
    return PointwiseConditions(n, prime, rows)


def kernel(rows: Sequence[Row], columns: int, prime: int) -> list[Row]:
    """A basis of the vectors orthogonal to the rows modulo the prime."""
    if not rows:
        return [tuple(int(i == j) for j in range(columns)) for i in range(columns)]
    basis, nullity = nmod_mat(len(rows), columns, [entry for row in rows for entry in row], prime).nullspace()
    return [tuple(int(basis[i, k]) for i in range(columns)) for k in range(nullity)]


def all_singular(basis: Sequence[Row], n: int, prime: int) -> bool:
    """Whether det vanishes identically on the span (tested at random combinations)."""
    source = random.Random(f"determinant {prime}")
    pairs = unknowns(n)
    for _ in range(_TRIALS if basis else 0):
        weights = [source.randrange(1, prime) for _ in basis]
        entry = {
            pair: sum(w * vector[column] for w, vector in zip(weights, basis, strict=True)) % prime
            for column, pair in enumerate(pairs)
        }
        matrix = nmod_mat(n, n, [entry[_pair(i, j)] for i in range(n) for j in range(n)], prime)
        if int(matrix.det()):
            return False
    return True


def smallest_sufficient_set(analysis: Analysis, seed: int = 1, depth: int = DEEPEST) -> SufficientSet | None:
    """The cheapest conditions that leave only singular g, confirmed at a second point.

    The least depth that suffices is taken, there the fewest tensors, among these the lowest orders.
    None where the hierarchy to `depth` does not suffice: then differential consequences decide.
    Raises IrreducibleAtoms where no generic point is found.
    """
    for level in range(depth + 1):
        first = tensors_at(local_motion(analysis, seed, level + 2), level)
        chosen = _sufficient(first)
        if chosen is None:
            continue
        second = tensors_at(local_motion(analysis, seed + 1, level + 2), level)
        if all_singular(second.kernel(chosen.equations), second.size, second.prime):
            return chosen
    return None


def unique_direction(analysis: Analysis, seed: int) -> SufficientSet | None:
    """Conditions, cheap ones first, that fix g at a generic point up to one factor; None where there are none."""
    for level in range(DEEPEST + 1):
        table = tensors_at(local_motion(analysis, seed, level + 2), level)
        kept: list[EquationName] = []
        for name in sorted(table.rows, key=lambda item: item.condition.order):
            if len(table.kernel([*kept, name])) < len(table.kernel(kept)):
                kept.append(name)
        if len(table.kernel(kept)) == 1:
            conditions = tuple(dict.fromkeys(name.condition for name in kept))
            return SufficientSet(conditions, tuple(kept), len(kept), 1)
    return None


def _sufficient(table: PointwiseConditions) -> SufficientSet | None:
    by_condition: dict[ConditionName, list[EquationName]] = {}
    for name, row in table.rows.items():
        if any(row):
            by_condition.setdefault(name.condition, []).append(name)
    everything = [name for names in by_condition.values() for name in names]
    if not _suffices(table, everything):
        return None
    for group in _groups(list(by_condition)):
        names = [name for condition in group for name in by_condition[condition]]
        if _suffices(table, names):
            return _pruned(table, names)
    return _pruned(table, everything)


def _groups(conditions: Sequence[ConditionName]) -> list[tuple[ConditionName, ...]]:
    """Sets of conditions, small ones first, then those of low order."""
    sizes = range(1, min(LARGEST_SET, len(conditions)) + 1)
    found = [group for size in sizes for group in itertools.combinations(conditions, size)]
    return sorted(found, key=lambda group: (len(group), sum(c.order for c in group)))


def _suffices(table: PointwiseConditions, names: Sequence[EquationName]) -> bool:
    return all_singular(table.kernel(names), table.size, table.prime)


def _pruned(table: PointwiseConditions, names: Sequence[EquationName]) -> SufficientSet:
    """Leave out every equation that is not needed, those of high order first."""
    kept = list(names)
    for name in sorted(names, key=lambda item: -item.condition.order):
        without = [other for other in kept if other != name]
        if _suffices(table, without):
            kept = without
    dimension = len(table.kernel(kept))
    conditions = tuple(dict.fromkeys(name.condition for name in kept))
    return SufficientSet(conditions, tuple(kept), len(unknowns(table.size)) - dimension, dimension)
