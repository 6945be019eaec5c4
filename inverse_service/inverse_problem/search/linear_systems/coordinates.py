"""Coordinates u = w.q in which a linear system falls apart into u'' = -c u' - k u + b.

The rows w are the left eigenvectors of a combination A = C + m K that has all its eigenvalues in the
field of the parameters; each has to be an eigenvector of C and of K.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from inverse_service.algebra.exact_trees import quotient_tree
from inverse_service.algebra.rational_functions import Quotient
from inverse_service.expressions.tree import TIME, Expression, add, multiply, walk
from inverse_service.inverse_problem.search.linear_systems import matrices as matrices
from inverse_service.inverse_problem.search.linear_systems.factors import factors_of
from inverse_service.inverse_problem.search.linear_systems.matrices import Matrix, Vector
from inverse_service.inverse_problem.search.linear_systems.reading import LinearSystem

_COMBINATIONS = (1, 2, 3)


@dataclass(frozen=True, slots=True)
class Separate:
    """u = weights.q with u'' = -damping u' - stiffness u + force."""

    weights: tuple[Expression, ...]
    damping: Quotient
    stiffness: Quotient
    force: Expression


def separate_coordinates(system: LinearSystem) -> list[Separate] | None:
    """n such coordinates, or None where there are none over the field of the parameters."""
    stiffness = system.stiffness[0][1]
    if len(system.stiffness) > 1 or any(node == TIME for b in system.forcing for node in walk(b)):
        return None
    for multiple in _COMBINATIONS:
        rows = _eigenvectors(system, matrices.plus(system.damping, stiffness, multiple))
        found = [_separate(system, row) for row in rows]
        if len(rows) == system.size and all(found):
            return [one for one in found if one is not None]
    return None


def _eigenvectors(system: LinearSystem, matrix: Matrix) -> list[Vector]:
    """The left eigenvectors whose eigenvalues are in the field."""
    owner = system.ring.field
    transposed = matrices.transpose(matrix)
    one = matrices.identity(owner, system.size)
    found: list[Vector] = []
    for coefficients, _ in factors_of(system.ring, transposed):
        if len(coefficients) == 2:
            rate = -(coefficients[0] / coefficients[1])
            shifted = matrices.plus(transposed, matrices.times(one, rate), -1)
            found += matrices.kernel(shifted, system.size, owner)[0]
    return found


def _separate(system: LinearSystem, row: Vector) -> Separate | None:
    """The coordinate of a row that is an eigenvector of C and of K."""
    damping, stiffness = (_eigenvalue(row, m) for m in (system.damping, system.stiffness[0][1]))
    if damping is None or stiffness is None:
        return None
    weights = tuple(quotient_tree(system.ring, w) for w in row)
    return Separate(weights, damping, stiffness, linear_form(weights, system.forcing))


def _eigenvalue(row: Vector, matrix: Matrix) -> Quotient | None:
    """r with row matrix = r row."""
    image = matrices.apply(matrices.transpose(matrix), row)
    place = next(k for k, entry in enumerate(row) if not entry.is_zero)
    ratio = image[place] / row[place]
    return ratio if all((b - ratio * a).is_zero for a, b in zip(row, image, strict=True)) else None


def linear_form(weights: Sequence[Expression], letters: Sequence[Expression]) -> Expression:
    """weights.letters."""
    return add(*(multiply(weight, letter) for weight, letter in zip(weights, letters, strict=True)))
