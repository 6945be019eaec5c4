"""Where a Lagrangian with letters for the parameters stays a regular Lagrangian.

The Euler-Lagrange equations of L along f are identities in the parameters, so they hold wherever L is
defined. What is left is det of the Hessian: it vanishes identically for the values of the parameters
at which all its coefficients do.
"""

from __future__ import annotations

from dataclasses import dataclass

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.rational_functions import Budget, Quotient
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity
from inverse_service.inverse_problem.special_cases.side_conditions import Ideal, Reader
from inverse_service.inverse_problem.special_cases.strata import ParameterSpace
from inverse_service.mechanics.euler_lagrange import hessian
from inverse_service.mechanics.quotient_matrices import determinant
from inverse_service.mechanics.second_order_system import SecondOrderSystem


@dataclass(frozen=True)
class Regularity:
    """L is a regular Lagrangian off the zeros of the ideals; `proved` is False where more may be special."""

    ideals: tuple[Ideal, ...]
    proved: bool


def regularity(system: SecondOrderSystem, lagrangian: Expression, space: ParameterSpace, budget: Budget) -> Regularity:
    """For a Lagrangian of the system; raises TooLarge or ZeroDivisionError."""
    entries = hessian(lagrangian, system.coordinates)
    names = system.coordinates
    variables: list[Symbol | Velocity] = [TIME, *map(Symbol, names), *map(Velocity, names)]
    ring = exact_ring([*(entry for row in entries for entry in row), lagrangian], variables, 0, budget)
    matrix = [[ring.value(entry) for entry in row] for row in entries]
    # The value of L itself lists its denominators.
    ring.value(lagrangian)
    reader = Reader.of(ring, space)
    whole = determinant(matrix, ring.constant(1))
    ideals = [*reader.ideals(whole), *_denominators(reader), *reader.inside_functions()]
    return Regularity(tuple(ideals), not reader.is_doubtful(whole))


def _denominators(reader: Reader) -> list[Ideal]:
    """Where a denominator of L vanishes identically."""
    found = [Quotient(reader.ring.field, denominator, ()) for denominator in reader.ring.field.denominators]
    return [ideal for quotient in found for ideal in reader.ideals(quotient)]
