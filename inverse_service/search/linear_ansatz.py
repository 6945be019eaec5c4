"""All rational combinations of candidate terms that are Lagrangians, by linear algebra modulo a prime."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from inverse_service import bounds
from inverse_service.expressions.tree import Expression
from inverse_service.field import modular
from inverse_service.field.echelon_kernels import Words
from inverse_service.field.modular import Field, compiled, minus, multiply, plus
from inverse_service.field.point import number_value
from inverse_service.search.null_vectors import SPARE, SampledRows, kernel, rational_vectors
from inverse_service.search.sampling import (
    Derivatives,
    Integers,
    LetterTable,
    Sampler,
    letter_table,
    monomial_values,
)
from inverse_service.search.terms import Monomial

Combination = dict[Monomial, Fraction]


@dataclass(frozen=True, slots=True)
class LagrangianSpace:
    """Independent combinations with vanishing Euler-Lagrange expressions along f."""

    sampler: Sampler
    combinations: tuple[Combination, ...]


class Exponents(NamedTuple):
    """The letters of candidate c are letters[starts[c]] … letters[starts[c + 1] - 1], with exponents as residues."""

    starts: Integers
    letters: Integers
    exponents: Words


@compiled
def _fill(values: Words, candidates: Exponents, d: Derivatives, field: Field, result: Words) -> None:
    """result[s n + i, c] = m_c (V_i G + H_i - Q_i) at sample s, from and to Montgomery form."""
    n = d.by_velocity.shape[2]
    for s in range(values.shape[0]):
        for c in range(values.shape[1]):
            first, last = candidates.starts[c], candidates.starts[c + 1]
            along = np.uint64(0)
            for k in range(first, last):
                along = plus(along, multiply(candidates.exponents[k], d.along[s, candidates.letters[k]], field), field)
            for i in range(n):
                velocity = rest = np.uint64(0)
                for k in range(first, last):
                    e, p = candidates.exponents[k], candidates.letters[k]
                    velocity = plus(velocity, multiply(e, d.by_velocity[s, p, i], field), field)
                    other = minus(d.mixed[s, p, i], d.by_position[s, p, i], field)
                    rest = plus(rest, multiply(e, other, field), field)
                total = plus(multiply(velocity, along, field), rest, field)
                result[s * n + i, c] = multiply(values[s, c], total, field)


def to_montgomery(array: Words, prime: int) -> Words:
    """x R modulo the prime for each residue x."""
    result = np.ascontiguousarray(array).copy()
    _scale(result.reshape(-1), modular.field_of(prime))
    return result


@compiled
def _scale(numbers: Words, field: Field) -> None:
    """Each number times R."""
    for k in range(numbers.shape[0]):
        numbers[k] = multiply(numbers[k], field.square, field)


def euler_lagrange_matrix(table: LetterTable, letters: Sequence[Expression], candidates: Sequence[Monomial]) -> Words:
    """EL_i of each candidate at each sample, (samples * n, candidates)."""
    prime = table.prime
    values = monomial_values(table, letters, candidates)
    result = np.zeros((len(values) * table.derivatives.size, len(candidates)), np.uint64)
    derivatives = Derivatives(*(to_montgomery(array, prime) for array in table.derivatives))
    _fill(values, exponents_of(letters, candidates, prime), derivatives, modular.field_of(prime), result)
    return result


def exponents_of(letters: Sequence[Expression], candidates: Sequence[Monomial], prime: int) -> Exponents:
    """The letters of each candidate in a row, their exponents in Montgomery form."""
    index = {letter: k for k, letter in enumerate(letters)}
    starts, places, exponents = [0], [], []
    for candidate in candidates:
        for letter, e in candidate:
            places.append(index[letter])
            exponents.append(number_value(e, prime))
        starts.append(len(places))
    numbers = to_montgomery(np.array(exponents, np.uint64), prime)
    return Exponents(np.array(starts, np.int64), np.array(places, np.int64), numbers)


def letters_of(candidates: Sequence[Monomial]) -> list[Expression]:
    return list(dict.fromkeys(letter for candidate in candidates for letter, _ in candidate))


def solve_ansatz(sampler: Sampler, candidates: Sequence[Monomial], seed: int) -> LagrangianSpace:
    """The space of Lagrangians in the span of the candidates (simple ones first).

    Each basis element has its most complicated candidate to itself. Combinations whose coefficients
    are no small rationals, or that fail at control points over another prime, are left out.
    """
    letters, n = letters_of(candidates), len(sampler.analysis.accelerations)

    def equations(begin: int, end: int) -> Words:
        table = letter_table(sampler, letters, end, seed, first=begin)
        return euler_lagrange_matrix(table, letters, candidates)

    # Equations of cyclic coordinates can be trivial, so the first samples need not suffice.
    found = rational_vectors(len(candidates), SampledRows(equations, n), sampler.prime(seed), SPARE)
    kept = _that_hold(sampler, candidates, found, seed + 77_777)
    return LagrangianSpace(sampler, tuple({candidates[k]: a for k, a in vector.items()} for vector in kept))


def null_combinations(matrix: Words, candidates: Sequence[Monomial], prime: int) -> list[Combination]:
    """The rational part of the kernel of a matrix, (equations, candidates)."""
    vectors = kernel(matrix, prime).rational_vectors()
    return [{candidates[k]: a for k, a in vector.items()} for vector in vectors]


def _that_hold(
    sampler: Sampler, candidates: Sequence[Monomial], vectors: list[dict[int, Fraction]], seed: int
) -> list[dict[int, Fraction]]:
    """Those whose Euler-Lagrange expressions vanish at fresh points over another prime."""
    used = sorted({k for vector in vectors for k in vector})
    if not used:
        return []
    chosen = [candidates[k] for k in used]
    letters = letters_of(chosen)
    table = letter_table(sampler, letters, bounds.FEW, seed)
    prime = table.prime
    rows = euler_lagrange_matrix(table, letters, chosen).tolist()
    place = {k: position for position, k in enumerate(used)}

    def holds(vector: dict[int, Fraction]) -> bool:
        weights = [(place[k], number_value(a, prime)) for k, a in vector.items()]
        return all(sum(row[k] * w for k, w in weights) % prime == 0 for row in rows)

    return [vector for vector in vectors if holds(vector)]
