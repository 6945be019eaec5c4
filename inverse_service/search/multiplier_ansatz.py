"""Which combinations of terms have a multiplier as Hessian: the ansatz without its potentials.

The Hessian g of a combination has to fulfil (H2) Gamma(g) = g N + (g N)^T and (H3) g Phi symmetric;
(H1) holds. Terms linear in the velocities do not enter, so this small problem tells whether a family
holds a regular Lagrangian before its potentials are searched for.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from inverse_service.deadline import STEP, check
from inverse_service.decision.kinds.helmholtz import tensors, written
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import Expression, Symbol, Velocity, node_count
from inverse_service.field import modular
from inverse_service.field.echelon_kernels import Words
from inverse_service.field.modular import Field, compiled, minus, multiply, plus
from inverse_service.field.point import Point, evaluate
from inverse_service.field.sample_points import Integers, Matrix, SamplePoints
from inverse_service.field.series_program import SeriesProgram, TooLarge, constants_at, run
from inverse_service.search.linear_ansatz import (
    Exponents,
    LagrangianSpace,
    exponents_of,
    letters_of,
    to_montgomery,
)
from inverse_service.search.null_vectors import (
    SPARE,
    SampledRows,
    pivots,
    rational_vectors,
    settled_kernel,
)
from inverse_service.search.sampling import (
    Derivatives,
    LetterTable,
    Sampler,
    letter_table,
    monomial_values,
    products_of_values,
    table_at,
    values_at,
)
from inverse_service.search.terms import Monomial


def solve_multiplier(sampler: Sampler, terms: Sequence[Monomial], seed: int) -> LagrangianSpace:
    """Combinations of the terms, each of which is a Lagrangian up to a potential and linear terms."""
    letters, n = letters_of(terms), len(sampler.analysis.accelerations)

    def equations(begin: int, end: int) -> Words:
        table = letter_table(sampler, letters, end, seed, with_third=True, first=begin)
        return helmholtz_matrix(sampler, table, letters, terms)[0]

    # Many of the n^2 conditions can be trivial, so the first samples need not suffice.
    vectors = rational_vectors(len(terms), SampledRows(equations, n * n), sampler.prime(seed), SPARE)
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
        return (unknowns + SPARE) // n**2 + 1

    found = settled_kernel(equations, points.prime, samples(len(terms)), samples)
    used = {k for row in found.basis.tolist() for k, x in enumerate(row) if int(x)}
    return [terms[k] for k in sorted(used)]


def _independent(points: SamplePoints, terms: Sequence[Monomial]) -> list[Monomial]:
    """The terms without those that are combinations of earlier ones at these points."""
    letters = letters_of(terms)
    rows = values_at(points, letters, len(terms) + SPARE)
    return [terms[k] for k in pivots(products_of_values(rows, letters, terms, points.prime), points.prime)]


def helmholtz_matrix(
    sampler: Sampler, table: LetterTable, letters: Sequence[Expression], terms: Sequence[Monomial]
) -> tuple[Words, Words]:
    """The n^2 conditions H2 (i <= j) and H3 (i < j) of each term at each sample, and its Hessian; Montgomery form.

    Shapes (samples n^2, terms) and (samples, terms, n, n).
    """
    prime, n = table.prime, table.derivatives.size
    values = monomial_values(table, letters, terms)
    tensors = tensors_of(sampler, table)
    geometry = Geometry(*(to_montgomery(np.array([pair[k] for pair in tensors], np.uint64), prime) for k in (0, 1)))
    derivatives = Derivatives(*(to_montgomery(array, prime) for array in table.derivatives))
    result = np.zeros((len(values) * n * n, len(terms)), np.uint64)
    hessians, rates = (np.zeros((len(values), len(terms), n, n), np.uint64) for _ in range(2))
    field = modular.field_of(prime)
    _differentiate(values, exponents_of(letters, terms, prime), derivatives, field, hessians, rates)
    _write_conditions(hessians, rates, geometry, field, result)
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
    check(STEP + sum(map(node_count, sampler.analysis.accelerations)))
    if len(sampler.analysis.accelerations) == 1:  # Phi is in no condition
        f, known = sampler.analysis.accelerations[0], dict[Expression, int]()
        evaluate(f, point, known)  # SingularPoint where it has no value
        slope = evaluate(differentiate(f, sampler.variables[2]), point, known)
        return [[-slope * pow(2, -1, point.prime) % point.prime]], [[0]]
    series, instructions = _written(tuple(sampler.variables), tuple(sampler.analysis.accelerations))
    registers = run(series, instructions, constants_at(series, point), point.prime, order=2)
    return tensors(len(sampler.analysis.accelerations), len(sampler.variables), registers)


@lru_cache(maxsize=32)
def _written(
    variables: tuple[Symbol | Velocity, ...], forces: tuple[Expression, ...]
) -> tuple[SeriesProgram, Integers]:
    try:
        return written(variables, variables[1 + len(forces) :], forces, order=2)
    except TooLarge as problem:
        raise IrreducibleAtoms("the forces are too long for their series") from problem


class Geometry(NamedTuple):
    """The connection N and the Jacobi endomorphism Phi at each sample, (samples, n, n)."""

    connection: Words
    endomorphism: Words


@compiled
def _differentiate(
    values: Words, terms: Exponents, d: Derivatives, field: Field, hessians: Words, rates: Words
) -> None:
    """g_ij = m (V_i V_j + W_ij) and Gamma(g_ij) = m (G (V_i V_j + W_ij) + H_i V_j + V_i H_j + Gamma W_ij).

    V, W, G, H are sums over the letters of m; all in Montgomery form, the results (samples, terms, n, n) zero before.
    """
    n = d.by_velocity.shape[2]
    for s in range(values.shape[0]):
        for c in range(values.shape[1]):
            first, last = terms.starts[c], terms.starts[c + 1]
            along = _sum_of(terms, d.along, s, first, last, field)
            for i in range(n):
                for j in range(i, n):
                    v = h = w = x = part = rate = np.uint64(0)
                    for k in range(first, last):
                        e, p = terms.exponents[k], terms.letters[k]
                        v = plus(v, multiply(e, d.by_velocity[s, p, i], field), field)
                        h = plus(h, multiply(e, d.mixed[s, p, i], field), field)
                        w = plus(w, multiply(e, d.by_velocity[s, p, j], field), field)
                        x = plus(x, multiply(e, d.mixed[s, p, j], field), field)
                        part = plus(part, multiply(e, d.hessian[s, p, i, j], field), field)
                        rate = plus(rate, multiply(e, d.third[s, p, i, j], field), field)
                    part = plus(part, multiply(v, w, field), field)
                    rate = plus(rate, multiply(along, part, field), field)
                    rate = plus(rate, plus(multiply(h, w, field), multiply(v, x, field), field), field)
                    hessians[s, c, i, j] = hessians[s, c, j, i] = multiply(values[s, c], part, field)
                    rates[s, c, i, j] = rates[s, c, j, i] = multiply(values[s, c], rate, field)


@compiled
def _sum_of(terms: Exponents, numbers: Words, s: int, first: int, last: int, field: Field) -> np.uint64:
    """The sum of a quantity over the letters of a term, each times its exponent."""
    total = np.uint64(0)
    for k in range(first, last):
        total = plus(total, multiply(terms.exponents[k], numbers[s, terms.letters[k]], field), field)
    return total


@compiled
def _write_conditions(hessians: Words, rates: Words, geometry: Geometry, field: Field, result: Words) -> None:
    """Gamma(g_ij) - g_ik N_kj - g_jk N_ki for i <= j, then g_ik Phi_kj - g_jk Phi_ki for i < j, for each sample."""
    samples, count, n, _ = hessians.shape
    for s in range(samples):
        for c in range(count):
            row = s * n * n
            for i in range(n):
                for j in range(i, n):
                    rate = rates[s, c, i, j]
                    for k in range(n):
                        rate = minus(rate, multiply(hessians[s, c, i, k], geometry.connection[s, k, j], field), field)
                        rate = minus(rate, multiply(hessians[s, c, j, k], geometry.connection[s, k, i], field), field)
                    result[row, c] = rate
                    row += 1
            for i in range(n):
                for j in range(i + 1, n):
                    skew = np.uint64(0)
                    for k in range(n):
                        skew = plus(skew, multiply(hessians[s, c, i, k], geometry.endomorphism[s, k, j], field), field)
                        skew = minus(skew, multiply(hessians[s, c, j, k], geometry.endomorphism[s, k, i], field), field)
                    result[row, c] = skew
                    row += 1
