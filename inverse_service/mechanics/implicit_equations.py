"""Whole equations, linear in the accelerations, solved for them: M(t, q, q') q'' = -b(t, q, q').

The matrix is inverted exactly, block by block of its triangular form, over a ring of opaque atoms. Atoms may be related
(sin^2 + cos^2 = 1), so what the inverse is divided by is also confirmed not to vanish at random real points
(`sample_points`), to 50 digits; each factor of the determinant is among these divisors.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from mpmath import mp, mpf

from inverse_service import bounds, errors
from inverse_service.expressions import calculus, collecting, graphs, inequalities, tree as ex
from inverse_service.field import exact_field, matrices
from inverse_service.mechanics import euler_lagrange, writing

_POINTS = 3
_MOST_POINTS, _FEWER_POINTS = 20, 8
_MANY_NAMES = 100
_MOST_POSITIVE = 6
_SEED = 18_340_115
_WIDTHS = ("1", "1", "3", "0.4", "6", "0.1")

Point = dict[ex.Expression, Any]


@dataclass(frozen=True, slots=True)
class LinearEquation:
    """Coefficient of each coordinate's acceleration (missing: 0) and what is left; `pointer` is its place."""

    coefficients: Mapping[str, ex.Expression]
    rest: ex.Expression
    pointer: str = ""


def linear_equation(residual: ex.Expression, pointer: str = "") -> LinearEquation:
    """The parts of residual = 0; InputError where an acceleration enters otherwise than linearly."""
    parts = euler_lagrange.linear_parts(residual, ex.Acceleration)
    if not isinstance(parts, tuple):
        name = parts.coordinate
        detail = f"the acceleration {name}'' does not enter linearly: write the equation solved for {name}''."
        raise errors.InputError(detail, pointer)
    return LinearEquation({leaf.coordinate: slope for leaf, slope in parts[0].items()}, parts[1], pointer)


@dataclass(frozen=True, slots=True)
class Solved:
    """f with q'' = f, and what the equations are divided by for it that f does not show: M q'' = -b where det M != 0.

    x x'' = -x gives f = -1 and x, which is not 0 where the two say the same.
    """

    accelerations: tuple[ex.Expression, ...]
    nonzero: tuple[ex.Expression, ...] = ()


def solve_accelerations(equations: Sequence[LinearEquation], coordinates: Sequence[str]) -> tuple[ex.Expression, ...]:
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
    written = [tree for equation in equations for tree in (*equation.coefficients.values(), equation.rest)]
    found = tuple(writing.with_sums_as_in(solved[name], written) for name in coordinates)
    moving = {ex.TIME, *map(ex.Symbol, coordinates), *map(ex.Velocity, coordinates)}
    return Solved(found, unseen([one for one in divisors if not moving.isdisjoint(ex.walk(one))], found))


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
    for block in graphs.components({column: pattern[row_of[column]] for column in range(len(pattern))}):
        chosen = [row_of[column] for column in block]
        rests = [_with_known(equations[row], solved) for row in chosen]
        matrix = [[rows[row][column] for column in block] for row in chosen]
        inverse = matrices.inverse(matrix, ring.constant(1))
        if inverse is None:
            raise _singular([coordinates[column] for column in block])
        used = {index for row in (*inverse, *matrix) for entry in row for index, _ in entry.exponents}
        found = {index: exact_field.polynomial_tree(ring, ring.field.denominators[index]) for index in used}
        if vanishes(ex.multiply(*found.values())):
            raise _singular([coordinates[column] for column in block])
        divisors |= found
        for row, column in zip(inverse, block, strict=True):
            solved[coordinates[column]] = _solution(ring, row, rests, places)
    return solved, list(divisors.values())


def unseen(divisors: Sequence[ex.Expression], accelerations: Sequence[ex.Expression]) -> tuple[ex.Expression, ...]:
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
    return tuple(one for one in divisors if not inequalities.is_nonzero(one, seen))


def _row(
    ring: exact_field.ExactRing, equation: LinearEquation, coordinates: Sequence[str]
) -> list[exact_field.Quotient]:
    try:
        return [ring.value(equation.coefficients.get(name, ex.ZERO)) for name in coordinates]
    except ZeroDivisionError:
        raise errors.InputError("an equation divides by zero: remove the division.", equation.pointer) from None


def _matched(
    pattern: list[list[int]], equations: Sequence[LinearEquation], coordinates: Sequence[str]
) -> dict[int, int]:
    for columns, equation in zip(pattern, equations, strict=True):
        if not columns:
            raise errors.InputError(
                "this equation contains no acceleration, the matrix of the accelerations is singular, as is every "
                "Lagrangian that has it: write an equation of second order, or give a constraint as a nonholonomic "
                "system.",
                equation.pointer,
            )
    found = graphs.matching(pattern)
    lost = [name for column, name in enumerate(coordinates) if column not in found]
    if lost:
        raise _singular(lost)
    return found


def _with_known(equation: LinearEquation, solved: Mapping[str, ex.Expression]) -> ex.Expression:
    """The terms without unknown accelerations, after substituting the accelerations of earlier blocks."""
    known = [(solved[name], c) for name, c in equation.coefficients.items() if name in solved]
    return ex.add(equation.rest, *(_scaled(coefficient, acceleration) for acceleration, coefficient in known))


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
    """-Σ inverse_j rest_j: unchanged, or over one denominator where that is not much longer."""
    parts = [
        (-1 * exact_field.quotient_tree(ring, entry), rest)
        for entry, rest in zip(inverse_row, rests, strict=True)
        if not entry.is_zero
    ]
    plain = ex.add(*(_scaled(slope, rest) for slope, rest in parts))
    if len(parts) == 1 and isinstance(parts[0][0], ex.Number):
        return plain
    gathered = writing.numbers_outside(writing.one_square(_gathered(plain, places)))
    return gathered if 2 * ex.node_count(gathered) <= 3 * ex.node_count(plain) else plain


def _gathered(plain: ex.Expression, places: Mapping[ex.Expression, int]) -> ex.Expression:
    """The same over one denominator, in lowest terms; as it is where that would be too large."""
    ring = exact_field.opaque_ring([plain], exact_field.Budget(bounds.EXPANSION), places)
    try:
        return exact_field.quotient_tree(ring, ring.value(plain))
    except (exact_field.TooLarge, ZeroDivisionError):
        return plain


def _wrong_number(count: int, coordinates: Sequence[str]) -> errors.InputError:
    wanted = ", ".join(f"{name}''" for name in coordinates)
    equations, number_of = ("1 equation is" if count == 1 else f"{count} equations are"), len(coordinates)
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


def sample_points(
    trees: Sequence[ex.Expression], positive: Sequence[ex.Expression] = (), most: int = _MOST_POINTS
) -> list[Point]:
    """Up to 20 points (8 of many names) at which every tree is real, up to six of them with all names positive.

    All trees of `positive` are so at each of them. `most` is a lower limit on their number.

    Equal calls of an arbitrary function get the same value however their arguments are written.
    """
    leaves, calls = _leaves((*trees, *positive))
    source, boxes = random.Random(_SEED), _boxes(positive)
    most = most if len(leaves) <= _MANY_NAMES else min(most, _FEWER_POINTS)
    found: list[Point] = []
    in_all = 0
    with mp.workdps(bounds.DIGITS):
        least = mpf("0.05")
        for attempt in range(bounds.TRIES):
            width = mpf(_WIDTHS[attempt // 2 % len(_WIDTHS)])
            in_quadrant = attempt % 2 == 0
            if in_quadrant and in_all == _MOST_POSITIVE:
                continue
            point = {
                leaf: _draw_inside(source, *boxes[leaf], _draw(source, width, least, True))
                if leaf in boxes
                else _draw(source, width, least, in_quadrant)
                for leaf in leaves
            }
            point.update({call: point[canonical] for call, canonical in calls.items()})
            inside = all(is_positive(condition, point) for condition in positive)
            if inside and all(value(tree, point) is not None for tree in trees):
                found.append(point)
                in_all += in_quadrant
            if len(found) == most:
                break
    return found


def _leaves(trees: Sequence[ex.Expression]) -> tuple[list[ex.Expression], dict[ex.Arbitrary, ex.Expression]]:
    """What is drawn, and for every call of an arbitrary function its canonical form, which is drawn too."""
    nodes = dict.fromkeys(ex.distinct_nodes(trees))
    if any(isinstance(node, ex.Arbitrary) for node in nodes):  # calls that only collecting brings to light
        nodes |= dict.fromkeys(ex.distinct_nodes(map(collecting.collect, trees)))
    calls = {node: collecting.collect(node) for node in nodes if isinstance(node, ex.Arbitrary)}
    drawn = [node for node in nodes if isinstance(node, ex.Symbol | ex.Velocity) and node != ex.PI]
    return [*drawn, *dict.fromkeys(calls.values())], calls


def _draw(source: random.Random, width: calculus.Real, least: calculus.Real, positive: bool) -> calculus.Real:
    size = width * (mpf(source.randrange(1, 10**18)) / 10**18 + least)
    return size if positive or source.random() < 0.5 else -size


def _draw_inside(source: random.Random, low: Fraction | None, high: Fraction | None, size: Any) -> calculus.Real:
    """Between the two, or at a distance of this size from the only one."""
    if low is None or high is None:
        return _real(low) + size if low is not None else _real(high or Fraction(0)) - size
    return _real(low + (high - low) * Fraction(source.randrange(1, 10**18), 10**18))


def _real(value: Fraction) -> calculus.Real:
    return mpf(value.numerator) / value.denominator


def _boxes(positive: Sequence[ex.Expression]) -> dict[ex.Expression, tuple[Fraction | None, Fraction | None]]:
    """(a, b) of each name u of which u - a > 0 or b - u > 0 are among the conditions; None for what is not."""
    low: dict[ex.Expression, Fraction] = {}
    high: dict[ex.Expression, Fraction] = {}
    for condition in positive:
        slope, level = (condition, Fraction(0))
        match condition:
            case ex.Sum((part, ex.Number(c))):
                slope, level = part, c
        match slope:
            case ex.Symbol() | ex.Velocity() as leaf:
                low[leaf] = max(-level, low.get(leaf, -level))
            case ex.Product((ex.Number(k), ex.Symbol() | ex.Velocity() as leaf)) if k == -1:
                high[leaf] = min(level, high.get(leaf, level))
    leaves = dict.fromkeys([*low, *high])
    return {u: (low.get(u), high.get(u)) for u in leaves if u not in low or u not in high or low[u] < high[u]}


def value(tree: ex.Expression, point: Point) -> calculus.Real | None:
    """The value in the working precision, None where there is none; the point keeps it, with those of its parts."""
    try:
        return calculus.evaluate_once(tree, point)
    except calculus.NoRealValue:
        return None


def is_positive(condition: ex.Expression, point: Point) -> bool:
    number = value(condition, point)
    return number is not None and bool(number > 0)


def vanishes_at(tree: ex.Expression, points: Sequence[Point]) -> bool:
    """Whether the tree is 0 to 40 digits at every point at which it is real (one at least)."""
    with mp.workdps(bounds.DIGITS):
        values = [number for number in (value(tree, point) for point in points) if number is not None]
        return bool(values) and all(abs(number) <= mpf(10) ** -bounds.AGREEING for number in values)


def is_singular(matrix: Sequence[Sequence[ex.Expression]], points: Sequence[Point]) -> bool:
    """Whether the determinant vanishes at every point at which the entries are real (one at least)."""
    verdicts = []
    with mp.workdps(bounds.DIGITS):
        for point in points:
            rows = [[value(entry, point) for entry in row] for row in matrix]
            if all(entry is not None for row in rows for entry in row):
                verdicts.append(_vanishes(rows))
            if verdicts and not verdicts[-1]:
                return False
    return bool(verdicts)


def _vanishes(rows: list[list[calculus.Real]]) -> bool:
    """|det| against the product of the lengths of the rows (Hadamard)."""
    bound = mp.fprod(mp.norm(row) for row in rows)
    return bool(bound == 0 or abs(mp.det(mp.matrix(rows))) <= mpf(10) ** -bounds.AGREEING * bound)


def vanishes(tree: ex.Expression) -> bool:
    """True where the tree is 0 at several random points, relative to the size of its terms.

    InputError where it is 0 at all points found, and these are fewer.
    """
    points = sample_points([tree], most=_POINTS)
    with mp.workdps(bounds.DIGITS):
        vanished = all(is_small(tree, point) for point in points)
    if vanished and len(points) < _POINTS:
        raise errors.InputError(
            "no point was found at which the coefficients of the accelerations are real: check roots and logarithms.",
            "/equations",
        )
    return vanished


def is_small(tree: ex.Expression, table: Mapping[ex.Expression, calculus.Real]) -> bool:
    """Whether a factor is 0 to the working precision; a sum is measured against the sizes of its terms."""
    match tree:
        case ex.Power(base, _):
            return is_small(base, table)
        case ex.Product(factors):
            return any(is_small(factor, table) for factor in factors)
        case ex.Sum(terms):
            known = dict(table)
            values = [calculus.evaluate_once(term, known) for term in terms]
        case _:
            values = [calculus.evaluate(tree, table)]
    size = mp.fsum(map(abs, values)) if len(values) > 1 else 1
    return bool(abs(mp.fsum(values)) <= mpf(10) ** (10 - bounds.DIGITS) * size)
