"""Which functions of the velocities a multiplier can be made of, seen at one place.

For g = sum_k c_k(t, q) Hessian(s_k) the coefficients and their derivatives are numbers at one place (t, q), and (H2),
(H3) are linear in them for every v there. What has to vanish in all solutions is left out of the ansatz before its
coefficients are guessed; where no solution is regular, no ansatz in these shapes holds a Lagrangian.
"""

from __future__ import annotations

import random
from collections.abc import Sequence

import numpy as np
from flint import nmod_mat

from inverse_service.algebra.series import SingularPoint
from inverse_service.errors import IrreducibleAtoms
from inverse_service.inverse_problem.search.deadline import check
from inverse_service.inverse_problem.search.linear_ansatz import letters_of
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.multiplier_ansatz import helmholtz_matrix
from inverse_service.inverse_problem.search.sampling import LetterTable, make_sampler, monomial_values, table_at
from inverse_service.inverse_problem.search.terms import Monomial

_SPARE = 6
# Shapes are left out until there are so few: the elimination is cubic in them.
_MOST = 120
Grid = list[list[int]]


def possible_shapes(material: Material, shapes: Sequence[Monomial], seed: int) -> list[Monomial]:
    """Those that can occur in a regular multiplier; all of them where the test cannot be made."""
    chosen = list(shapes)[:_MOST]
    if not chosen:
        return []
    try:
        sampler = make_sampler(material.analysis, dict.fromkeys(item for shape in chosen for item in shape))
        points, letters = sampler.at_one_place(seed), letters_of(chosen)
        n, columns = material.motion.size, len(chosen) * (material.motion.size + 1 + material.motion.with_time)
        table = table_at(points, letters, (columns + _SPARE) // n**2 + 2, with_third=True)
        prime = table.prime
        forms = _hessians(table, chosen)
        inverse = pow(1 << 64, -1, prime)
        plain = np.array(helmholtz_matrix(sampler, table, letters, chosen), dtype=object) * inverse % prime
    except (IrreducibleAtoms, SingularPoint, ValueError):
        return chosen
    rows = [[*map(int, row), *_of_derivatives(material, table, forms, k)] for k, row in enumerate(plain.tolist())]
    check(1 + len(rows) * columns * min(len(rows), columns) // 10_000)
    basis, nullity = nmod_mat(len(rows), len(rows[0]), [x for row in rows for x in row], prime).nullspace()
    return _used(chosen, basis, nullity, forms, prime, seed)


def _hessians(table: LetterTable, shapes: Sequence[Monomial]) -> list[list[Grid]]:
    """d2s/dv dv of each shape at each sample."""
    prime, letters = table.prime, letters_of(shapes)
    index = {letter: k for k, letter in enumerate(letters)}
    inverse = pow(1 << 64, -1, prime)
    values = [[int(x) * inverse % prime for x in row] for row in monomial_values(table, letters, shapes)]
    weights = [[(index[p], e.numerator * pow(e.denominator, -1, prime)) for p, e in shape] for shape in shapes]
    slopes, seconds = table.by_velocity.tolist(), table.hessian.tolist()
    span = range(table.by_velocity.shape[2])
    found = []
    for s, row in enumerate(values):
        forms = []
        for value, weight in zip(row, weights, strict=True):
            slope = [sum(w * slopes[s][p][i] for p, w in weight) for i in span]
            forms.append([
                [value * (slope[i] * slope[j] + sum(w * seconds[s][p][i][j] for p, w in weight)) % prime for j in span]
                for i in span
            ])  # fmt: skip
        found.append(forms)
    return found


def _of_derivatives(material: Material, table: LetterTable, forms: Sequence[Sequence[Grid]], row: int) -> list[int]:
    """The entries of one row for d_t c (where L may hold t) and each d_k c: s_ij times 1 and v^k in (H2), 0 in (H3)."""
    n, shapes = material.motion.size, len(forms[0])
    sample, place = divmod(row, n * n)
    pairs = [(i, j) for i in range(n) for j in range(i, n)]
    point = table.points[sample]
    rates = [1] * material.motion.with_time + [point.variable(v) for v in material.motion.velocities]
    if place >= len(pairs):
        return [0] * (len(rates) * shapes)
    i, j = pairs[place]
    return [rate * form[i][j] % table.prime for rate in rates for form in forms[sample]]


def _used(
    shapes: Sequence[Monomial], basis: nmod_mat, nullity: int, forms: Sequence[Sequence[Grid]], prime: int, seed: int
) -> list[Monomial]:
    """The shapes with a coefficient in some solution; none where a random solution has a singular g, as then all do."""
    generator = random.Random(f"velocity shapes {seed}")
    weights = [generator.randrange(prime) for _ in range(nullity)]
    table = basis.tolist()
    mixed = [sum(w * int(x) for w, x in zip(weights, row, strict=False)) % prime for row in table[: len(shapes)]]
    n = len(forms[0][0])
    g = [
        sum(c * form[i][j] for c, form in zip(mixed, forms[0], strict=True)) % prime for i in range(n) for j in range(n)
    ]
    if nmod_mat(n, n, g, prime).rank() < n:
        return []
    return [shape for shape, c in zip(shapes, mixed, strict=True) if c]
