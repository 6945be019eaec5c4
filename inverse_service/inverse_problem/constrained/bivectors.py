"""The algebraic test on the constraints: 2-forms that annihilate the Lie derivatives of vertical bivectors.

A Lagrangian gives on D (t a parameter) a closed invariant 2-form that vanishes on pairs of vertical vectors and has
none in its kernel. So it annihilates all (L_Gamma)^j (d/du^alpha ^ d/du^beta), j = 0, 1, 2, … Where every 2-form that
does has a vertical vector in its kernel there is no Lagrangian: what Phi, nabla Phi, … are for the inverse problem.
"""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import dataclass

from flint import nmod_mat

from inverse_service.algebra import series as ps
from inverse_service.algebra.point import Expansion, Variable
from inverse_service.algebra.series import Series
from inverse_service.algebra.tower import draw_point
from inverse_service.expressions.tree import TIME, Symbol, Velocity
from inverse_service.inverse_problem.constrained.deciding import AnalysedMotion

_HIGHEST = 6
# Derivatives of series to these orders are short work.
_MOST_COEFFICIENTS = 20_000


@dataclass(frozen=True, slots=True)
class Obstruction:
    """The bivectors of j = 0 … `last` span `rank` of `size` dimensions and leave only degenerate 2-forms."""

    last: int
    rank: int
    size: int


def obstruction(analysed: AnalysedMotion, seed: int) -> Obstruction | None:
    """The first j at which the test fails, at a random point; SingularPoint where it has no series."""
    names, k = analysed.names, len(analysed.motion.free)
    variables: list[Variable] = [*map(Symbol, names), *map(Velocity, analysed.motion.free)]
    size, order = len(variables), _HIGHEST + 1
    while math.comb(size + 1 + order, order) > _MOST_COEFFICIENTS:
        order -= 1
    expansion = Expansion(draw_point(analysed.tower, seed), [*variables, TIME], order)
    speeds = [expansion.expand(Velocity(name)) for name in analysed.motion.free]
    field = [*speeds, *map(expansion.expand, (*analysed.velocities, *analysed.forces))]
    columns = list(itertools.combinations(range(size), 2))
    brackets = [[_unit(expansion, size, size - k + alpha)] for alpha in range(k)]
    rows: list[list[int]] = []
    for last in range(order):
        for alpha, beta in itertools.combinations(range(k), 2):
            rows.append(_bivector(brackets[alpha], brackets[beta], last, columns, expansion.ring.prime))
        matrix = nmod_mat(max(len(rows), 1), len(columns), [x for row in rows for x in row], expansion.ring.prime)
        if not _leaves_a_regular_form(matrix, columns, size, k, seed):
            return Obstruction(last, matrix.rank(), len(columns))
        brackets = [[*found, _bracket(field, found[-1], size)] for found in brackets]
    return None


def _unit(expansion: Expansion, size: int, place: int) -> list[Series]:
    return [expansion.ring.constant(int(x == place)) for x in range(size)]


def _bracket(field: list[Series], vector: list[Series], size: int) -> list[Series]:
    """[Gamma, V], one order less; the last variable is t, whose rate is 1."""
    order = len(vector[0]) - 1
    found = []
    for y in range(size):
        total = ps.derivative(vector[y], size)
        for x in range(size):
            total = ps.add(total, ps.multiply(field[x][:order], ps.derivative(vector[y], x)))
            total = ps.subtract(total, ps.multiply(vector[x][:order], ps.derivative(field[y][: order + 1], x)))
        found.append(total)
    return found


def _bivector(
    left: list[list[Series]], right: list[list[Series]], j: int, columns: list[tuple[int, int]], prime: int
) -> list[int]:
    """(L_Gamma)^j (left_0 ^ right_0) at the point: sum of C(j, i) left_i ^ right_(j - i)."""
    values = [[[ps.value_at_point(part) for part in vector] for vector in side] for side in (left, right)]
    total = [0] * len(columns)
    for i in range(j + 1):
        a, b, factor = values[0][i], values[1][j - i], math.comb(j, i)
        for place, (x, y) in enumerate(columns):
            total[place] = (total[place] + factor * (a[x] * b[y] - a[y] * b[x])) % prime
    return total


def _leaves_a_regular_form(matrix: nmod_mat, columns: list[tuple[int, int]], size: int, k: int, seed: int) -> bool:
    """Whether the generic 2-form that annihilates the rows has no vertical vector in its kernel."""
    prime = int(matrix.modulus())
    basis, nullity = matrix.nullspace()
    generator = random.Random(f"forms {seed}")
    weights = [generator.randrange(1, prime) for _ in range(nullity)]
    form = nmod_mat(k, size, prime)
    for place, (x, y) in enumerate(columns):
        value = sum(w * int(basis[place, column]) for column, w in enumerate(weights)) % prime
        for a, b, sign in ((x, y, 1), (y, x, -1)):
            if a >= size - k:
                form[a - size + k, b] = sign * value
    return bool(form.rank() == k)
