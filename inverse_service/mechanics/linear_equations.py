"""Equations linear in the accelerations, solved for them.

Whole equations linear in the accelerations, M(t, q, q') q'' = -b(t, q, q'), are solved with the
exact inverse of M, block by block of its triangular form, over a ring of opaque atoms. Atoms may be
related (sin^2 + cos^2 = 1), so what the inverse is divided by is also confirmed not to vanish at
random real points, to 50 digits; each factor of the determinant is among these divisors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction

from inverse_service import bounds, errors
from inverse_service.expressions import graphs, tree as ex
from inverse_service.field import exact_field, matrices, real_branch
from inverse_service.mechanics import writing
from inverse_service.mechanics.euler_lagrange import linear_parts

# Functions that are defined everywhere, or just where their expansions are.
_SMOOTH = frozenset(("sin", "cos", "tan", "exp", "sinh", "cosh", "tanh"))


@dataclass(frozen=True, slots=True)
class LinearEquation:
    """Coefficient of each coordinate's acceleration (missing: 0) and what is left; `pointer` is its
    place.
    """

    coefficients: Mapping[str, ex.Expression]
    rest: ex.Expression
    pointer: str = ""


def linear_equation(residual: ex.Expression, pointer: str = "") -> LinearEquation:
    """The parts of residual = 0; InputError where an acceleration enters otherwise than
    linearly.
    """
    parts = linear_parts(residual, ex.Acceleration)
    if not isinstance(parts, tuple):
        name = parts.coordinate
        detail = f"the acceleration {name}'' does not enter linearly: write the equation solved for {name}''."
        raise errors.InputError(detail, pointer)
    return LinearEquation(
        {leaf.coordinate: slope for leaf, slope in parts[0].items()}, parts[1], pointer
    )


@dataclass(frozen=True, slots=True)
class Solved:
    """f with q'' = f, and what the equations are divided by for it that f does not show: M q'' = -b
    where det M != 0.

    x x'' = -x gives f = -1 and x, which is not 0 where the two say the same.
    """

    accelerations: tuple[ex.Expression, ...]
    nonzero: tuple[ex.Expression, ...] = ()


def solve_accelerations(
    equations: Sequence[LinearEquation], coordinates: Sequence[str]
) -> tuple[ex.Expression, ...]:
    """f with q'' = f, in the order of `coordinates`; errors as of `solve_lines`."""
    return solve_lines(equations, coordinates).accelerations


def solve_lines(equations: Sequence[LinearEquation], coordinates: Sequence[str]) -> Solved:
    """f with q'' = f, in the order of `coordinates`, and where.

    InputError where the numbers differ or the matrix of the accelerations is singular; LimitError
    where its inverse would be too large to write down.
    """
    if len(equations) != len(coordinates):
        raise _wrong_number(len(equations), coordinates)
    try:
        solved, divisors = _solve_blocks(equations, coordinates)
    except exact_field.TooLarge as error:
        detail = f"the accelerations cannot be solved for, {error}: write the equations solved, or with fewer symbols."
        raise errors.LimitError(detail, "/equations") from None
    written = [
        tree for equation in equations for tree in (*equation.coefficients.values(), equation.rest)
    ]
    found = tuple(writing.with_sums_as_in(solved[name], written) for name in coordinates)
    moving = {ex.TIME, *map(ex.Symbol, coordinates), *map(ex.Velocity, coordinates)}
    return Solved(
        found, unseen([one for one in divisors if not moving.isdisjoint(ex.walk(one))], found)
    )


def _solve_blocks(
    equations: Sequence[LinearEquation], coordinates: Sequence[str]
) -> tuple[dict[str, ex.Expression], list[ex.Expression]]:
    """The acceleration of each coordinate, and what the matrix and its inverse are divided by."""
    slopes = [c for equation in equations for c in equation.coefficients.values()]
    ring = exact_field.opaque_ring(slopes)
    rows = [_row(ring, equation, coordinates) for equation in equations]
    pattern = [[k for k, entry in enumerate(row) if not entry.is_zero] for row in rows]
    row_of = _matched(pattern, equations, coordinates)
    atoms = (atom for equation in equations for atom in exact_field.opaque_atoms(equation.rest))
    solved, places = dict[str, ex.Expression](), {atom: place for place, atom in enumerate(atoms)}
    divisors = dict[int, ex.Expression]()
    for block in graphs.components(
        {column: pattern[row_of[column]] for column in range(len(pattern))}
    ):
        chosen = [row_of[column] for column in block]
        rests = [_with_known(equations[row], solved) for row in chosen]
        matrix = [[rows[row][column] for column in block] for row in chosen]
        inverse = matrices.inverse(matrix, ring.constant(1))
        if inverse is None:
            raise _singular([coordinates[column] for column in block])
        used = {
            index for row in (*inverse, *matrix) for entry in row for index, _ in entry.exponents
        }
        found = {
            index: exact_field.polynomial_tree(ring, ring.field.denominators[index])
            for index in used
        }
        if real_branch.vanishes(ex.multiply(*found.values())):
            raise _singular([coordinates[column] for column in block])
        divisors |= found
        for row, column in zip(inverse, block, strict=True):
            solved[coordinates[column]] = _solution(ring, row, rests, places)
    return solved, list(divisors.values())


def unseen(
    divisors: Sequence[ex.Expression], accelerations: Sequence[ex.Expression]
) -> tuple[ex.Expression, ...]:
    """Those that may be 0, by which no acceleration is divided, and of which none has a root."""
    if not divisors:
        return ()
    seen = list[ex.Expression]()
    for node in ex.distinct_nodes(accelerations):
        if not (isinstance(node, ex.Power) and isinstance(node.exponent, ex.Number)):
            continue
        if node.exponent.value.denominator > 1:
            seen.append(node.base ** Fraction(1, node.exponent.value.denominator))
        if node.exponent.value < 0 or node.exponent.value.denominator > 1:
            with suppress(exact_field.TooLarge, ZeroDivisionError):
                ring = exact_field.opaque_ring([node.base])
                seen += exact_field.factor_trees(ring, ring.value(node.base))
    return tuple(one for one in divisors if not real_branch.is_nonzero(one, seen))


def _row(
    ring: exact_field.ExactRing, equation: LinearEquation, coordinates: Sequence[str]
) -> list[exact_field.Quotient]:
    try:
        return [ring.value(equation.coefficients.get(name, ex.ZERO)) for name in coordinates]
    except ZeroDivisionError:
        raise errors.InputError(
            "an equation divides by zero: remove the division.", equation.pointer
        ) from None


def _matched(
    pattern: list[list[int]], equations: Sequence[LinearEquation], coordinates: Sequence[str]
) -> dict[int, int]:
    for columns, equation in zip(pattern, equations, strict=True):
        if not columns:
            raise errors.InputError(
                "this equation contains no acceleration, so the equations do not determine all accelerations: write "
                "an equation of second order, or give a constraint together with a Lagrangian.",
                equation.pointer,
            )
    found = graphs.matching(pattern)
    lost = [name for column, name in enumerate(coordinates) if column not in found]
    if lost:
        raise _singular(lost)
    return found


def _with_known(equation: LinearEquation, solved: Mapping[str, ex.Expression]) -> ex.Expression:
    """The terms without unknown accelerations, after substituting the accelerations of earlier
    blocks.
    """
    known = [(solved[name], c) for name, c in equation.coefficients.items() if name in solved]
    return ex.add(
        equation.rest, *(_scaled(coefficient, acceleration) for acceleration, coefficient in known)
    )


def _scaled(coefficient: ex.Expression, expression: ex.Expression) -> ex.Expression:
    """The product; a number is multiplied into the terms of a sum."""
    if isinstance(coefficient, ex.Number) and isinstance(expression, ex.Sum):
        return ex.add(*(coefficient * term for term in expression.terms))
    return coefficient * expression


def _solution(
    ring: exact_field.ExactRing,
    inverse_row: Sequence[exact_field.Quotient],
    rests: Sequence[ex.Expression],
    places: Mapping[ex.Expression, int],
) -> ex.Expression:
    """-Σ inverse_j rest_j: unchanged, or over one denominator where that is shorter, or not much
    longer before its sums are shortened (sin^2 + cos^2 is 1).
    """
    parts = [
        (-1 * exact_field.quotient_tree(ring, entry), rest)
        for entry, rest in zip(inverse_row, rests, strict=True)
        if not entry.is_zero
    ]
    plain = ex.add(*(_scaled(slope, rest) for slope, rest in parts))
    if len(parts) == 1 and isinstance(parts[0][0], ex.Number):
        return plain
    gathered = _gathered(plain, places)
    short = writing.with_shortest_sums(gathered) if _is_smooth(gathered) else gathered
    short = writing.numbers_outside(writing.one_square(short))
    if 2 * ex.node_count(gathered) <= 3 * ex.node_count(plain):
        return short
    return writing.shortest([plain, short])


def _is_smooth(tree: ex.Expression) -> bool:
    """Whether it has no roots, whose signs an expansion loses: (v^2)^(1/2) is |v|, not v."""
    return all(
        node.function in _SMOOTH
        if isinstance(node, ex.Apply)
        else isinstance(node.exponent, ex.Number) and node.exponent.value.denominator == 1
        for node in ex.distinct_nodes((tree,))
        if isinstance(node, ex.Apply | ex.Power)
    )


def _gathered(plain: ex.Expression, places: Mapping[ex.Expression, int]) -> ex.Expression:
    """The same over one denominator, in lowest terms; as it is where that would be too large."""
    ring = exact_field.opaque_ring([plain], exact_field.Budget(bounds.EXPANSION), places)
    try:
        return exact_field.quotient_tree(ring, ring.value(plain))
    except (exact_field.TooLarge, ZeroDivisionError):
        return plain


def _wrong_number(count: int, coordinates: Sequence[str]) -> errors.InputError:
    wanted = ", ".join(f"{name}''" for name in coordinates)
    equations, number_of = (
        ("1 equation is" if count == 1 else f"{count} equations are"),
        len(coordinates),
    )
    return errors.InputError(
        f"{equations} given for {number_of} acceleration{'s' * (number_of != 1)} ({wanted}): "
        "write one equation for each coordinate."
        + " Constraints and their multipliers go with a Lagrangian: L = …, x' = …."
        * (count > number_of),
        "/equations",
    )


def _singular(names: Sequence[str]) -> errors.InputError:
    unknowns = ", ".join(f"{name}''" for name in names)
    return errors.InputError(
        f"the matrix of the accelerations is singular, the equations do not determine {unknowns}: "
        "write equations that are independent in the accelerations.",
        "/equations",
    )
