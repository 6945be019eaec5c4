"""Whether expressions vanish identically: their values at random points modulo primes, all relations kept."""

from __future__ import annotations

from collections.abc import Sequence

from flint import nmod_mat

from inverse_service.algebra.kernels import to_kernels
from inverse_service.algebra.point import Point, Variable, evaluate
from inverse_service.algebra.real_point import find_real_point
from inverse_service.algebra.reduction import reduce_atoms
from inverse_service.algebra.series import SingularPoint
from inverse_service.algebra.tower import draw_point
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import Expression

_ATTEMPTS = 6


def values_modulo_primes(
    expressions: Sequence[Expression], variables: Sequence[Variable], points: int = 2, seed: int = 1
) -> list[tuple[Point, list[int]]] | None:
    """The residues of all expressions at `points` random points, each over a prime of its own.

    None where the relations among their functions cannot be settled or no point is found.
    """
    kernels = [to_kernels(expression) for expression in expressions]
    try:
        table = find_real_point(kernels, variables, seed)
        tower = reduce_atoms(kernels, variables, table)
        found = []
        for attempt in range(_ATTEMPTS):
            point = draw_point(tower, seed * _ATTEMPTS + attempt)
            known: dict[Expression, int] = {}
            try:
                found.append((point, [evaluate(kernel, point, known) for kernel in kernels]))
            except (SingularPoint, ValueError, ZeroDivisionError, KeyError):
                continue
            if len(found) == points:
                return found
    except (IrreducibleAtoms, KeyError):
        return None
    return None


def vanish(expressions: Sequence[Expression], variables: Sequence[Variable], seed: int = 1) -> bool | None:
    """True where all vanish at two points, False where one does not, None where it was not settled.

    A nonzero rational function of degree d vanishes at a random point with probability about d/2^61.
    """
    if not expressions:
        return True
    found = values_modulo_primes(expressions, variables, 2, seed)
    return None if found is None else all(not any(values) for _, values in found)


def rank_at_point(matrix: Sequence[Sequence[Expression]], variables: Sequence[Variable], seed: int = 1) -> int | None:
    """The rank of a matrix of expressions at a random point, which is its generic rank (almost surely)."""
    flat = [entry for row in matrix for entry in row]
    if not flat:
        return 0
    found = values_modulo_primes(flat, variables, 1, seed)
    if found is None:
        return None
    ((point, values),) = found
    return int(nmod_mat(len(matrix), len(matrix[0]), values, point.prime).rank())
