"""Whether a multiplier g(t, q) without velocities is possible, seen at one place.

At fixed (t, q) the entries of g and of its derivatives d_t g, d_k g are numbers, and for every v
    (H3) g Phi = (g Phi)^T,    (H2) d_t g + v^k d_k g = g N + (g N)^T
are linear in them. Where no solution for several v has a regular g, or where f is not quadratic in v,
no Lagrangian is quadratic in the velocities, and ansätze of that kind are not tried.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations_with_replacement

from flint import nmod_mat

from inverse_service.algebra.point import Expansion, Point, Variable
from inverse_service.algebra.series import SingularPoint, terms
from inverse_service.algebra.tower import atoms_in_order, draw_point
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import Velocity
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.motion import has_velocity
from inverse_service.inverse_problem.search.multiplier_ansatz import connection_and_endomorphism
from inverse_service.inverse_problem.search.sampling import Sampler

_SPARE_VELOCITIES = 2
Matrix = list[list[int]]


def may_be_velocity_free(material: Material, seed: int) -> bool:
    """False only where a generic place excludes a regular g(t, q); True where the test cannot be made."""
    sampler = Sampler(material.analysis, material.analysis.tower, material.analysis.real_point)
    try:
        place = draw_point(sampler.tower, seed)
        if not _is_quadratic(sampler, place):
            return False
        if any(has_velocity(atom) for atom in atoms_in_order(material.analysis.accelerations)):
            return True
        # Each velocity gives n^2 equations for the (n + 2) n (n + 1)/2 unknowns.
        count = material.motion.size + 2 + _SPARE_VELOCITIES
        with_time = material.motion.with_time
        rows = [row for k in range(count) for row in _rows(sampler, _moved(sampler, place, k), with_time)]
    except (IrreducibleAtoms, SingularPoint, ValueError):
        return True
    return _has_regular(rows, material.motion.size, place.prime, seed)


def _velocities(sampler: Sampler) -> list[Velocity]:
    return [v for v in sampler.variables if isinstance(v, Velocity)]


def _is_quadratic(sampler: Sampler, place: Point) -> bool:
    """Whether all third derivatives of f by the velocities vanish at a point."""
    expansion = Expansion(place, _velocities(sampler), 3)
    series = [expansion.expand(f) for f in sampler.analysis.accelerations]
    return not any(sum(exponents) == 3 for f in series for exponents in terms(f))


def _moved(sampler: Sampler, place: Point, k: int) -> Point:
    """The same place with other velocities; no atom of f depends on them."""
    values: dict[Variable, int] = {v: place.draw(("velocity", k, v.coordinate)) for v in _velocities(sampler)}
    return replace(place, variables={**place.variables, **values})


def _rows(sampler: Sampler, point: Point, with_time: bool) -> Matrix:
    """H3 for i < j and H2 for i <= j; columns are the entries of g, then d_t g and each d_k g."""
    n, prime = len(sampler.analysis.accelerations), point.prime
    connection, endomorphism = connection_and_endomorphism(sampler, point)
    pairs = list(combinations_with_replacement(range(n), 2))
    column = {pair: k for k, pair in enumerate(pairs)} | {(j, i): k for k, (i, j) in enumerate(pairs)}
    field = [int(with_time), *(point.variable(v) for v in _velocities(sampler))]
    rows = []
    for i, j in pairs:
        symmetric, rate = [0] * len(pairs), [0] * (len(pairs) * (2 + n))
        for k in range(n):
            symmetric[column[i, k]] += endomorphism[k][j]
            symmetric[column[j, k]] -= endomorphism[k][i]
            rate[column[i, k]] -= connection[k][j]
            rate[column[j, k]] -= connection[k][i]
        for k, x in enumerate(field):
            rate[(1 + k) * len(pairs) + column[i, j]] = x
        rows.append([x % prime for x in rate])
        if i < j:
            rows.append([x % prime for x in symmetric] + [0] * (len(rate) - len(pairs)))
    return rows


def _has_regular(rows: Sequence[Sequence[int]], n: int, prime: int, seed: int) -> bool:
    """Whether a random solution has a regular g: then nearly all have."""
    width = len(rows[0])
    basis, nullity = nmod_mat(len(rows), width, [x for row in rows for x in row], prime).nullspace()
    generator = random.Random(f"velocity-free {seed}")
    weights = [generator.randrange(prime) for _ in range(nullity)]
    columns = basis.tolist()
    g = [[0] * n for _ in range(n)]
    for k, (i, j) in enumerate(combinations_with_replacement(range(n), 2)):
        g[i][j] = g[j][i] = sum(w * int(x) for w, x in zip(weights, columns[k], strict=False)) % prime
    return int(nmod_mat(n, n, [x for row in g for x in row], prime).rank()) == n
