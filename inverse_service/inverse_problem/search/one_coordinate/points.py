"""Values at random points of a prime field of what a multiplier is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from flint import nmod_mat

from inverse_service.algebra.primes import reconstruct
from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.search.linear_ansatz import letters_of
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.multiplier_ansatz import tensors_of
from inverse_service.inverse_problem.search.sampling import (
    LetterTable,
    letter_table,
    make_sampler,
    monomial_values,
)
from inverse_service.inverse_problem.search.terms import Monomial

_BOUND = 1_000


@dataclass(frozen=True, slots=True)
class Samples:
    """Letters, their values and logarithmic derivatives along the motion, and df/dv, at points of one prime."""

    places: dict[Expression, int]
    table: LetterTable
    slopes: tuple[int, ...]

    @property
    def prime(self) -> int:
        return self.table.prime

    def along(self, sample: int, key: Monomial) -> int:
        """Gamma(log key)."""
        rates = self.table.along[sample]
        return sum(int(rates[self.places[p]]) * residue(e, self.prime) for p, e in key) % self.prime


def residue(value: Fraction, prime: int) -> int:
    return value.numerator * pow(value.denominator, -1, prime) % prime


def sampled(material: Material, terms: Sequence[Monomial], count: int, seed: int) -> Samples:
    """`count` points for the letters of the terms; IrreducibleAtoms, SingularPoint or ValueError if there are none."""
    letters = letters_of(terms)
    sampler = make_sampler(material.analysis, dict.fromkeys(item for term in terms for item in term))
    table = letter_table(sampler, letters, count, seed)
    slopes = tuple(-2 * connection[0][0] % table.prime for connection, _ in tensors_of(sampler, table))
    return Samples({p: k for k, p in enumerate(letters)}, table, slopes)


def independent(samples: Samples, terms: Sequence[Monomial]) -> list[Monomial]:
    """The terms without those that are combinations of earlier ones as functions (1 = sin^2 + cos^2)."""
    rows = montgomery_values(samples, terms)
    reduced, order = nmod_mat(len(rows), len(terms), [a for row in rows for a in row], samples.prime).rref()
    return [terms[next(k for k in range(len(terms)) if int(reduced[i, k]))] for i in range(order)]


def montgomery_values(samples: Samples, terms: Sequence[Monomial]) -> list[list[int]]:
    """The value of each term at each sample in Montgomery form (times 2^64)."""
    return [[int(a) for a in row] for row in monomial_values(samples.table, list(samples.places), terms)]


def solved(rows: Sequence[Sequence[int]], prime: int) -> list[Fraction] | None:
    """Small rationals e with row[:-1] . e = row[-1], columns that depend on earlier ones left out."""
    width = len(rows[0]) - 1
    reduced, order = nmod_mat(len(rows), width + 1, [a for row in rows for a in row], prime).rref()
    solution = [Fraction(0)] * width
    for i in range(order):
        pivot = next(k for k in range(width + 1) if int(reduced[i, k]))
        value = reconstruct(int(reduced[i, width]), prime, _BOUND)
        if pivot == width or value is None:
            return None
        solution[pivot] = value
    return solution
