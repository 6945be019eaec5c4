"""Whole equations, linear in the accelerations, solved for them: M(t, q, q') q'' = -b(t, q, q').

The matrix is inverted exactly, block by block of its triangular form, by fraction-free elimination
(Bareiss 1968) over polynomials in opaque atoms. Atoms may be related (sin^2 + cos^2 = 1), so a
determinant that is not the zero polynomial is also confirmed not to vanish at random points, to
50 digits.

Whether a tree is the zero function, by its values at random points to 50 digits.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mpmath import mp, mpf

from inverse_service import bounds
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.evaluation import NoRealValue, Real, evaluate
from inverse_service.expressions.graphs import components, matching
from inverse_service.expressions.tree import (
    ONE,
    PI,
    ZERO,
    Acceleration,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    multiply,
    node_count,
    walk,
)
from inverse_service.mechanics.opaque_fractions import (
    OpaqueFraction,
    OpaqueRing,
    atoms_of,
    cleared,
    common_denominator,
    expanded_terms,
    solved_rows,
)


@dataclass(frozen=True, slots=True)
class LinearEquation:
    """Coefficient of each coordinate's acceleration (missing: 0) and what is left; `pointer` is its place."""

    coefficients: Mapping[str, Expression]
    rest: Expression
    pointer: str = ""


def linear_equation(residual: Expression, pointer: str = "") -> LinearEquation:
    """The parts of residual = 0; InputError where an acceleration enters otherwise than linearly."""
    coefficients, rest = _parts(residual, pointer)
    return LinearEquation(coefficients, rest, pointer)


def has_acceleration(expression: Expression) -> bool:
    return any(isinstance(node, Acceleration) for node in walk(expression))


def _parts(expression: Expression, pointer: str) -> tuple[dict[str, Expression], Expression]:
    if not has_acceleration(expression):
        return {}, expression
    match expression:
        case Acceleration(coordinate):
            return {coordinate: ONE}, ZERO
        case Sum(terms):
            return _parts_of_sum(terms, pointer)
        case Product(factors):
            return _parts_of_product(factors, pointer)
        case _:
            raise _nonlinear(expression, pointer)


def _parts_of_sum(terms: tuple[Expression, ...], pointer: str) -> tuple[dict[str, Expression], Expression]:
    collected: dict[str, list[Expression]] = {}
    rests = []
    for term in terms:
        coefficients, rest = _parts(term, pointer)
        rests.append(rest)
        for coordinate, coefficient in coefficients.items():
            collected.setdefault(coordinate, []).append(coefficient)
    return {coordinate: add(*found) for coordinate, found in collected.items()}, add(*rests)


def _parts_of_product(factors: tuple[Expression, ...], pointer: str) -> tuple[dict[str, Expression], Expression]:
    holders = [factor for factor in factors if has_acceleration(factor)]
    if len(holders) != 1:
        raise _nonlinear(Product(factors), pointer)
    others = [factor for factor in factors if factor is not holders[0]]
    coefficients, rest = _parts(holders[0], pointer)
    scaled = {coordinate: multiply(*others, found) for coordinate, found in coefficients.items()}
    return scaled, multiply(*others, rest)


def _nonlinear(expression: Expression, pointer: str) -> InputError:
    name = next(node.coordinate for node in walk(expression) if isinstance(node, Acceleration))
    return InputError(
        f"the acceleration {name}'' does not enter linearly: write the equation solved for {name}''.",
        pointer,
    )


_POINTS = 3
_ATTEMPTS = 60
_SEED = 20_040_229


def vanishes(tree: Expression) -> bool:
    """True where the tree is 0 at several random points, relative to the size of its terms.

    InputError where no point is found at which it has a real value.
    """
    source = random.Random(_SEED)
    values = []
    with mp.workdps(bounds.DIGITS):
        for attempt in range(_ATTEMPTS):
            try:
                values.append(_is_small(tree, _point(tree, source, 1 + attempt % 5)))
            except NoRealValue:
                continue
            if not values[-1] or len(values) == _POINTS:
                return values[-1]
    raise InputError(
        "no point was found at which the coefficients of the accelerations are real: check roots and logarithms.",
        "/equations",
    )


def _point(tree: Expression, source: random.Random, width: int) -> dict[Expression, Real]:
    """Random values of all leaves; the first attempts are positive, later ones of both signs."""
    table: dict[Expression, Real] = {}
    for node in walk(tree):
        if isinstance(node, Symbol | Velocity | Acceleration | Arbitrary) and node not in table and node != PI:
            value = mpf(source.randrange(1, 10**18)) / 10**18
            low = 0 if width <= 2 else -width
            table[node] = low + (width - low) * value
    return table


def _is_small(tree: Expression, table: Mapping[Expression, Real]) -> bool:
    """Whether a factor is 0 to the working precision; a sum is measured against the sizes of its terms."""
    match tree:
        case Power(base, _):
            return _is_small(base, table)
        case Product(factors):
            return any(_is_small(factor, table) for factor in factors)
        case Sum(terms):
            values = [evaluate(term, table) for term in terms]
        case _:
            values = [evaluate(tree, table)]
    size = mp.fsum(map(abs, values)) if len(values) > 1 else 1
    return bool(abs(mp.fsum(values)) <= mpf(10) ** (10 - bounds.DIGITS) * size)


def solve_accelerations(equations: Sequence[LinearEquation], coordinates: Sequence[str]) -> tuple[Expression, ...]:
    """f with q'' = f, in the order of `coordinates`.

    InputError where the numbers differ or the matrix of the accelerations is singular; LimitError
    where its inverse would be too large to write down.
    """
    if len(equations) != len(coordinates):
        raise _wrong_number(len(equations), coordinates)
    ring = OpaqueRing([c for equation in equations for c in equation.coefficients.values()])
    atoms = (atom for equation in equations for atom in atoms_of(equation.rest))
    places = {atom: place for place, atom in enumerate(atoms)}
    rows = [_row(ring, equation, coordinates) for equation in equations]
    pattern = [[k for k, entry in enumerate(row) if not entry.numerator.is_zero()] for row in rows]
    row_of = _matched(pattern, equations, coordinates)
    solved: dict[str, Expression] = {}
    for block in components({column: pattern[row_of[column]] for column in range(len(pattern))}):
        chosen = [row_of[column] for column in block]
        rests = [_with_known(equations[row], solved) for row in chosen]
        inverse = _inverse(ring, [[rows[row][column] for column in block] for row in chosen])
        if inverse is None:
            raise _singular([coordinates[column] for column in block])
        for place, column in enumerate(block):
            solved[coordinates[column]] = _solution(ring, inverse[place], rests, places)
    return tuple(solved[name] for name in coordinates)


def _row(ring: OpaqueRing, equation: LinearEquation, coordinates: Sequence[str]) -> list[OpaqueFraction]:
    zero = ring.fraction(ZERO)
    try:
        found = {name: ring.fraction(tree) for name, tree in equation.coefficients.items()}
        return [found.get(name, zero) for name in coordinates]
    except ZeroDivisionError:
        raise InputError("an equation divides by zero: write it without that.", equation.pointer) from None


def _matched(
    pattern: list[list[int]], equations: Sequence[LinearEquation], coordinates: Sequence[str]
) -> dict[int, int]:
    for columns, equation in zip(pattern, equations, strict=True):
        if not columns:
            raise InputError(
                "this equation contains no acceleration, the matrix of the accelerations is singular, as is every "
                "Lagrangian that has it: write an equation of second order, or give a constraint as a nonholonomic "
                "system.",
                equation.pointer,
            )
    found = matching(pattern)
    lost = [name for column, name in enumerate(coordinates) if column not in found]
    if lost:
        raise _singular(lost)
    return found


def _with_known(equation: LinearEquation, solved: Mapping[str, Expression]) -> Expression:
    """The rest of the equation with the accelerations of earlier blocks put in."""
    known = [(solved[name], c) for name, c in equation.coefficients.items() if name in solved]
    return add(equation.rest, *(_scaled(coefficient, acceleration) for acceleration, coefficient in known))


def _scaled(coefficient: Expression, expression: Expression) -> Expression:
    """The product; a number is multiplied into the terms of a sum."""
    if isinstance(coefficient, Number) and isinstance(expression, Sum):
        return add(*(coefficient * term for term in expression.terms))
    return coefficient * expression


def _inverse(ring: OpaqueRing, matrix: list[list[OpaqueFraction]]) -> list[list[OpaqueFraction]] | None:
    """The inverse of a block, None where its determinant is the zero function."""
    scales = [common_denominator(ring, row) for row in matrix]
    found = solved_rows(ring, [cleared(row, scale) for row, scale in zip(matrix, scales, strict=True)], scales)
    if found is None or vanishes(ring.tree(OpaqueFraction(found[1], ring.constant(1)))):
        return None
    return [[ring.reduced(entry, found[1]) for entry in row] for row in found[0]]


def _solution(
    ring: OpaqueRing,
    inverse_row: Sequence[OpaqueFraction],
    rests: Sequence[Expression],
    places: Mapping[Expression, int],
) -> Expression:
    """-Σ inverse_j rest_j: as it stands, or put over one denominator where that is not much longer."""
    parts = [(entry, rest) for entry, rest in zip(inverse_row, rests, strict=True) if not entry.numerator.is_zero()]
    plain = add(*(_scaled(-1 * ring.tree(entry), rest) for entry, rest in parts))
    if all(isinstance(ring.tree(entry), Number) and len(parts) == 1 for entry, _ in parts):
        return plain
    gathered = _gathered(plain, places)
    return gathered if 2 * node_count(gathered) <= 3 * node_count(plain) else plain


def _gathered(plain: Expression, places: Mapping[Expression, int]) -> Expression:
    """The same over one denominator, in lowest terms; as it is where that would be too large."""
    if max(expanded_terms(plain)) > bounds.TERMS:
        return plain
    ring = OpaqueRing([plain], places)
    try:
        return ring.tree(ring.fraction(plain))
    except (LimitError, ZeroDivisionError):
        return plain


def _wrong_number(count: int, coordinates: Sequence[str]) -> InputError:
    wanted = ", ".join(f"{name}''" for name in coordinates)
    equations, number_of = ("1 equation is" if count == 1 else f"{count} equations are"), len(coordinates)
    return InputError(
        f"{equations} given for {number_of} acceleration{'s' * (number_of != 1)} ({wanted}): "
        "write one equation for each coordinate.",
        "/equations",
    )


def _singular(names: Sequence[str]) -> InputError:
    unknowns = ", ".join(f"{name}''" for name in names)
    return InputError(
        f"the matrix of the accelerations is singular, the equations do not determine {unknowns}: "
        "write equations that are independent in the accelerations.",
        "/equations",
    )
