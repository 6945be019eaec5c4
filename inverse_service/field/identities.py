"""Test at random points modulo primes whether formulas vanish identically, and compute generic ranks of matrices."""

from collections.abc import Sequence

from flint import nmod_mat

from inverse_service import bounds, errors
from inverse_service.expressions import tree as ex
from inverse_service.field import real_point, reduction
from inverse_service.field.point import Point, SingularPoint, Variable, evaluate
from inverse_service.field.tower import draw_point, to_kernels


def values_modulo_primes(
    expressions: Sequence[ex.Expression], variables: Sequence[Variable], points: int = 2, seed: int = 1
) -> list[tuple[Point, list[int]]] | None:
    """The residues of all expressions at `points` random points, each over a separate prime.

    None if the relations among their functions cannot be determined or no point is found.
    """
    kernels = [to_kernels(expression) for expression in expressions]
    try:
        table = real_point.find_real_point(kernels, variables, seed)
        tower = reduction.reduce_atoms(kernels, variables, table)
        found = []
        for attempt in range(bounds.ATTEMPTS):
            point = draw_point(tower, seed * bounds.ATTEMPTS + attempt)
            known: dict[ex.Expression, int] = {}
            try:
                found.append((point, [evaluate(kernel, point, known) for kernel in kernels]))
            except (SingularPoint, ValueError, ZeroDivisionError, KeyError):
                continue
            if len(found) == points:
                return found
    except (errors.IrreducibleAtoms, KeyError):
        return None
    return None


def vanish(expressions: Sequence[ex.Expression], variables: Sequence[Variable], seed: int = 1) -> bool | None:
    """True if all vanish at two points, False if one does not, None if that cannot be decided.

    A nonzero rational function of degree d vanishes at a random point with probability about d/2^61.
    """
    if not expressions:
        return True
    found = values_modulo_primes(expressions, variables, 2, seed)
    return None if found is None else all(not any(values) for _, values in found)


def rank_at_point(
    matrix: Sequence[Sequence[ex.Expression]], variables: Sequence[Variable], seed: int = 1
) -> int | None:
    """The rank of a matrix of expressions at a random point, which is its generic rank (almost surely)."""
    flat = [entry for row in matrix for entry in row]
    if not flat:
        return 0
    found = values_modulo_primes(flat, variables, 1, seed)
    if found is None:
        return None
    ((point, values),) = found
    return int(nmod_mat(len(matrix), len(matrix[0]), values, point.prime).rank())
