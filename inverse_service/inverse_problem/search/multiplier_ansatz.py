"""Which combinations of terms have a multiplier as Hessian: the ansatz without its potentials.

The Hessian g of a combination has to fulfil (H2) Gamma(g) = g N + (g N)^T and (H3) g Phi symmetric;
(H1) holds. Terms linear in the velocities do not enter, so this small problem tells whether a family
holds a regular Lagrangian before its potentials are searched for.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from inverse_service.algebra import modular
from inverse_service.algebra import series as ps
from inverse_service.algebra.echelon_kernels import Words
from inverse_service.algebra.modular import compiled, multiply
from inverse_service.algebra.point import Expansion, Point, evaluate
from inverse_service.deadline import check
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import Expression, walk
from inverse_service.inverse_problem.decision.local_system import local_system
from inverse_service.inverse_problem.search.gradings import graded
from inverse_service.inverse_problem.search.linear_ansatz import (
    LagrangianSpace,
    exponent_lists,
    letters_of,
    to_montgomery,
)
from inverse_service.inverse_problem.search.null_vectors import SampledRows, pivots, settled_kernel, vectors_of_groups
from inverse_service.inverse_problem.search.sample_points import Matrix, SamplePoints
from inverse_service.inverse_problem.search.sampling import (
    LetterTable,
    Sampler,
    letter_table,
    monomial_values,
    products_of_values,
    table_at,
    values_at,
)
from inverse_service.inverse_problem.search.terms import Monomial

_SPARE_EQUATIONS = 10
# In units of the search (see `deadline`).
_WORK_OF_TENSORS = 100


def solve_multiplier(sampler: Sampler, terms: Sequence[Monomial], seed: int) -> LagrangianSpace:
    """Combinations of the terms, each of which is a Lagrangian up to a potential and linear terms."""
    letters, n = letters_of(terms), len(sampler.analysis.accelerations)

    def equations(begin: int, end: int) -> Words:
        table = letter_table(sampler, letters, end, seed, with_third=True, first=begin)
        return helmholtz_matrix(sampler, table, letters, terms)[0]

    # Many of the n^2 conditions can be trivial, so the first samples need not suffice.
    groups = graded(sampler.analysis.system, terms)
    vectors = vectors_of_groups(groups, SampledRows(equations, n * n), sampler.prime(seed), _SPARE_EQUATIONS)
    return LagrangianSpace(sampler, tuple({terms[k]: a for k, a in vector.items()} for vector in vectors))


def occurring_terms(sampler: Sampler, terms: Sequence[Monomial], seed: int) -> list[Monomial]:
    """The terms that a multiplier is made of at one value of the parameters, its coefficients being any numbers.

    Terms that are combinations of simpler ones there, as k - r is of 1 and r, are left out.
    """
    points = sampler.with_fixed_parameters(seed)
    terms = _independent(points, terms)
    letters, n = letters_of(terms), len(sampler.analysis.accelerations)

    def equations(begin: int, end: int) -> Words:
        table = table_at(points, letters, end, with_third=True, first=begin)
        return helmholtz_matrix(sampler, table, letters, terms)[0]

    def samples(unknowns: int) -> int:
        return (unknowns + _SPARE_EQUATIONS) // n**2 + 1

    found = settled_kernel(equations, points.prime, samples(len(terms)), samples)
    used = {k for row in found.basis.tolist() for k, x in enumerate(row) if int(x)}
    return [terms[k] for k in sorted(used)]


def _independent(points: SamplePoints, terms: Sequence[Monomial]) -> list[Monomial]:
    """The terms without those that are combinations of earlier ones at these points."""
    letters = letters_of(terms)
    rows = values_at(points, letters, len(terms) + _SPARE_EQUATIONS)
    return [terms[k] for k in pivots(products_of_values(rows, letters, terms, points.prime), points.prime)]


def helmholtz_matrix(
    sampler: Sampler, table: LetterTable, letters: Sequence[Expression], terms: Sequence[Monomial]
) -> tuple[Words, Words]:
    """The n^2 conditions H2 (i <= j) and H3 (i < j) of each term at each sample, and its Hessian; Montgomery form.

    Shapes (samples n^2, terms) and (samples, terms, n, n).
    """
    prime = table.prime
    starts, places, exponents = exponent_lists(letters, terms, prime)
    values = monomial_values(table, letters, terms)
    n = table.by_velocity.shape[2]
    pairs = tensors_of(sampler, table)
    modulus, negative_inverse, _, _ = modular.constants(prime)
    result = np.zeros((len(values) * n * n, len(terms)), np.uint64)
    hessians = np.zeros((len(values), len(terms), n, n), np.uint64)
    arrays = (table.along, table.by_velocity, table.mixed, table.hessian, table.third)
    along, by_velocity, mixed, hessian, third = (to_montgomery(array, prime) for array in arrays)
    connection, endomorphism = (to_montgomery(np.array([pair[k] for pair in pairs], np.uint64), prime) for k in (0, 1))
    work = (np.empty(n, np.uint64), np.empty(n, np.uint64), np.empty((n, n), np.uint64), np.empty((n, n), np.uint64))
    _fill(
        values, starts, places, exponents, along, by_velocity, mixed, hessian, third, connection, endomorphism,
        result, hessians, *work, modulus, negative_inverse,
    )  # fmt: skip
    return result, hessians


def tensors_of(sampler: Sampler, table: LetterTable) -> list[tuple[Matrix, Matrix]]:
    """(N, Phi) at each sample of a table; what is known of a point is kept."""
    places = [table.known.place(k) for k in table.numbers]
    for place in places:
        if place.tensors is None:
            place.tensors = connection_and_endomorphism(sampler, place.point)
    return [place.tensors for place in places if place.tensors is not None]


def connection_and_endomorphism(sampler: Sampler, point: Point) -> tuple[Matrix, Matrix]:
    """(N, Phi) at a point, each (n, n)."""
    check(_WORK_OF_TENSORS + sum(1 for f in sampler.analysis.accelerations for _ in walk(f)))
    if len(sampler.analysis.accelerations) == 1:  # Phi is in no condition
        f, known = sampler.analysis.accelerations[0], dict[Expression, int]()
        evaluate(f, point, known)  # SingularPoint where it has no value
        slope = evaluate(differentiate(f, sampler.variables[2]), point, known)
        return [[-slope * pow(2, -1, point.prime) % point.prime]], [[0]]
    expansion = Expansion(point, sampler.variables, 2)
    velocities = [expansion.expand(v) for v in sampler.variables[1 + len(sampler.analysis.accelerations) :]]
    forces = [expansion.expand(f) for f in sampler.analysis.accelerations]
    local = local_system(expansion.ring, velocities, forces)
    return (
        [[ps.value_at_point(entry) for entry in row] for row in local.connection],
        [[ps.value_at_point(entry) for entry in row] for row in local.endomorphism],
    )


@compiled
def _fill(
    values: Any, starts: Any, places: Any, exponents: Any, along: Any, by_velocity: Any, mixed: Any, hessian: Any,
    third: Any, connection: Any, endomorphism: Any, result: Any, hessians: Any, v: Any, h: Any, g: Any, dg: Any,
    prime: Any, inverse: Any,
) -> None:  # fmt: skip
    samples, count = values.shape
    n = by_velocity.shape[2]
    zero = np.uint64(0)
    for s in range(samples):
        for c in range(count):
            total = zero
            for i in range(n):
                v[i] = h[i] = zero
                for j in range(n):
                    g[i, j] = dg[i, j] = zero
            for k in range(starts[c], starts[c + 1]):
                e, p = exponents[k], places[k]
                total = (total + multiply(e, along[s, p], prime, inverse)) % prime
                for i in range(n):
                    v[i] = (v[i] + multiply(e, by_velocity[s, p, i], prime, inverse)) % prime
                    h[i] = (h[i] + multiply(e, mixed[s, p, i], prime, inverse)) % prime
                    for j in range(n):
                        g[i, j] = (g[i, j] + multiply(e, hessian[s, p, i, j], prime, inverse)) % prime
                        dg[i, j] = (dg[i, j] + multiply(e, third[s, p, i, j], prime, inverse)) % prime
            # g_ij = m (V_i V_j + W_ij), Gamma(g_ij) = m (G (V_i V_j + W_ij) + H_i V_j + V_i H_j + Gamma W_ij)
            for i in range(n):
                for j in range(n):
                    part = (g[i, j] + multiply(v[i], v[j], prime, inverse)) % prime
                    rate = (dg[i, j] + multiply(total, part, prime, inverse)) % prime
                    rate = (rate + multiply(h[i], v[j], prime, inverse)) % prime
                    rate = (rate + multiply(v[i], h[j], prime, inverse)) % prime
                    g[i, j] = hessians[s, c, i, j] = multiply(values[s, c], part, prime, inverse)
                    dg[i, j] = multiply(values[s, c], rate, prime, inverse)
            row = s * n * n
            for i in range(n):
                for j in range(i, n):
                    rate = dg[i, j]
                    for k in range(n):
                        rate = (rate + prime - multiply(g[i, k], connection[s, k, j], prime, inverse)) % prime
                        rate = (rate + prime - multiply(g[j, k], connection[s, k, i], prime, inverse)) % prime
                    result[row, c] = rate
                    row += 1
            for i in range(n):
                for j in range(i + 1, n):
                    skew = zero
                    for k in range(n):
                        skew = (skew + multiply(g[i, k], endomorphism[s, k, j], prime, inverse)) % prime
                        skew = (skew + prime - multiply(g[j, k], endomorphism[s, k, i], prime, inverse)) % prime
                    result[row, c] = skew
                    row += 1
