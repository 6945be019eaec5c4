"""Irreducible factors of characteristic polynomials over the field of the parameters."""

from __future__ import annotations

from flint import fmpq, fmpq_mpoly

from inverse_service.algebra.exact_ring import ExactRing, sum_of
from inverse_service.algebra.rational_functions import Quotient
from inverse_service.inverse_problem.search.linear_systems.matrices import Matrix, characteristic_polynomial
from inverse_service.inverse_problem.search.linear_systems.reading import EIGENVALUE

# Symbolic characteristic polynomials of greater matrices take too long.
_LARGEST_SYMBOLIC = 12


def factors_of(ring: ExactRing, matrix: Matrix) -> list[tuple[list[Quotient], int]]:
    """(coefficients, the constant one first, and multiplicity) of the factors of det(x - matrix) by degree.

    Empty for large matrices with parameters.
    """
    symbolic = any(entry.constant_value is None for row in matrix for entry in row)
    if symbolic and len(matrix) > _LARGEST_SYMBOLIC:
        return []
    variable = ring.atoms[EIGENVALUE]
    terms = [c * variable**k for k, c in enumerate(characteristic_polynomial(matrix)) if not c.is_zero]
    _, factors = sum_of(ring.constant(0), terms).numerator.factor()
    found = [(_by_power(factor, variable), int(multiplicity)) for factor, multiplicity in factors]
    return sorted((item for item in found if len(item[0]) > 1), key=lambda item: len(item[0]))


def _by_power(polynomial: fmpq_mpoly, variable: Quotient) -> list[Quotient]:
    """The coefficients of a polynomial in the eigenvalue."""
    owner = variable.field
    place = next(k for k, degree in enumerate(variable.numerator.degrees()) if degree)
    tables: list[dict[tuple[int, ...], fmpq]] = [{} for _ in range(int(polynomial.degrees()[place]) + 1)]
    for exponents, coefficient in polynomial.terms():
        rest = tuple(0 if k == place else int(e) for k, e in enumerate(exponents))
        tables[int(exponents[place])][rest] = coefficient
    return [owner.quotient(owner.reduce(owner.context.from_dict(table)), ()) for table in tables]
