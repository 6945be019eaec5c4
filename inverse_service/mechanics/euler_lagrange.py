"""Momenta, velocity Hessian and Euler-Lagrange residual of a Lagrangian L(t, q, v); equations
solved for accelerations.

Derivatives are collected (like terms added, exact) but not simplified. The advice {method, order,
alpha, reason} on the integrator that L asks for is seen from the formula alone.

Whole equations linear in the accelerations, M(t, q, q') q'' = -b(t, q, q'), are solved with the
exact inverse of M, block by block of its triangular form, over a ring of opaque atoms. Atoms may be
related (sin^2 + cos^2 = 1), so what the inverse is divided by is also confirmed not to vanish at
random real points, to 50 digits; each factor of the determinant is among these divisors.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple, TypeVar

import mpmath

from inverse_service import bounds, errors
from inverse_service.expressions import calculus, collecting, graphs, printing, tree as ex
from inverse_service.field import exact_field, matrices, real_branch
from inverse_service.mechanics import writing

Matrix = tuple[tuple[ex.Expression, ...], ...]
Leaf = ex.Symbol | ex.Velocity | ex.Acceleration
L = TypeVar("L", ex.Velocity, ex.Acceleration)
# Eigenvalues below this part of the largest are zero.
_TINY = mpmath.mpf(10) ** -20
_EXACT = "; where a single trajectory is to be exact, adaptive costs less."
_ENERGY = f"and the energy does not drift{_EXACT}"
NOTHING_KEPT = "nothing is known to be conserved that a geometric method would keep."
_ENDS = " It ends where {} changes its sign: a motion that passes there needs adaptive."


def gradient(tree: ex.Expression, leaves: Iterable[Leaf]) -> dict[Leaf, ex.Expression]:
    """The derivatives by the leaves that occur; of a long sum each term is looked at once."""
    wanted, parts = set(leaves), dict[Leaf, list[ex.Expression]]()
    left: list[tuple[ex.Expression, ex.Expression]] = [(ex.ONE, tree)]
    for factor, part in left:
        match part:
            case ex.Sum(terms):
                left += [(factor, term) for term in terms]
            case ex.Product((*constants, ex.Sum(terms))) if wanted.isdisjoint(
                node for c in constants for node in ex.walk(c)
            ):
                left += [(ex.multiply(factor, *constants), term) for term in terms]
            case _:
                held = dict.fromkeys(node for node in ex.walk(part) if isinstance(node, Leaf))
                for leaf in (node for node in held if node in wanted):
                    parts.setdefault(leaf, []).append(factor * calculus.differentiate(part, leaf))
    return {leaf: ex.add(*terms) for leaf, terms in parts.items()}


def linear_parts(
    tree: ex.Expression, leaves: type[L]
) -> tuple[dict[L, ex.Expression], ex.Expression] | L:
    """(a, b) of sum a_i u_i + b, u_i the leaves of this type; one of them where it occurs
    otherwise.
    """
    nodes = list(ex.distinct_nodes((tree,)))
    found = dict.fromkeys(node for node in nodes if isinstance(node, leaves))
    slopes: dict[Leaf, ex.Expression] = gradient(tree, found)
    # sign(u) has the slope 0.
    inner: list[ex.Expression] = [
        node for node in nodes if isinstance(node, ex.Apply | ex.Arbitrary)
    ]
    for part in ex.distinct_nodes([*slopes.values(), *inner]):
        if isinstance(part, leaves):
            return part
    still = dict(dict.fromkeys(found, ex.ZERO))
    terms = (
        ex.substitute(term, still) if ex.holds(term, *found) else term for term in ex.summands(tree)
    )
    rest = ex.add(*terms)
    return {leaf: slopes.get(leaf, ex.ZERO) for leaf in found}, rest


def momenta(lagrangian: ex.Expression, coordinates: Sequence[str]) -> tuple[ex.Expression, ...]:
    """p_i = dL/dv_i, one for each coordinate."""
    slopes = gradient(lagrangian, map(ex.Velocity, coordinates))
    return tuple(collecting.collect(slopes.get(ex.Velocity(name), ex.ZERO)) for name in coordinates)


def hessian(lagrangian: ex.Expression, coordinates: Sequence[str]) -> Matrix:
    """g_ij = d2L/dv_i dv_j, (n, n), symmetric: each entry pair is the same tree."""
    rates = [ex.Velocity(name) for name in coordinates]
    rows = [
        gradient(momentum, rates[: i + 1])
        for i, momentum in enumerate(momenta(lagrangian, coordinates))
    ]
    table = [
        [collecting.collect(row.get(rate, ex.ZERO)) for rate in rates[: i + 1]]
        for i, row in enumerate(rows)
    ]
    return tuple(
        tuple(table[max(i, j)][min(i, j)] for j in range(len(rates))) for i in range(len(rates))
    )


def hessian_at(
    lagrangian: ex.Expression,
    coordinates: Sequence[str],
    point: Mapping[ex.Expression, mpmath.mpf] | None,
) -> mpmath.matrix | None:
    """g at a real point to 30 digits, (n, n); None where it has no value there."""
    if point is None:
        return None
    with mpmath.workdps(30), suppress(calculus.NoRealValue, ArithmeticError):
        rows = hessian(lagrangian, coordinates)
        return mpmath.matrix([[calculus.evaluate(entry, point) for entry in row] for row in rows])
    return None


class Inertia(NamedTuple):
    """The numbers of positive and of negative eigenvalues."""

    positive: int
    negative: int


def inertia(form: mpmath.matrix | None) -> Inertia | None:
    """(positive, negative) eigenvalues of a symmetric matrix; None without one."""
    if form is None:
        return None
    with mpmath.workdps(30):
        values = mpmath.eigsy(form, eigvals_only=True)
        least = max(map(abs, values)) * _TINY
        return Inertia(
            sum(value > least for value in values), sum(value < -least for value in values)
        )


def euler_lagrange_residual(
    lagrangian: ex.Expression, coordinates: Sequence[str], accelerations: Sequence[ex.Expression]
) -> tuple[ex.Expression, ...]:
    """sum_j L_(v_i v_j) f^j + sum_j L_(v_i q_j) v^j + L_(v_i t) - L_(q_i), one for each coordinate.

    Zero along q'' = f exactly when its solutions are extremals. ValueError where the numbers of
    coordinates and accelerations differ.
    """
    return tuple(
        map(collecting.collect, euler_lagrange_sums(lagrangian, coordinates, accelerations))
    )


def euler_lagrange_sums(
    lagrangian: ex.Expression, coordinates: Sequence[str], accelerations: Sequence[ex.Expression]
) -> tuple[ex.Expression, ...]:
    """The residual as it comes, nothing collected: to be evaluated, not to be read."""
    pairs = zip(coordinates, accelerations, strict=True)
    rates: list[tuple[ex.Symbol | ex.Velocity, ex.Expression]] = [
        (ex.Velocity(name), f) for name, f in pairs
    ]
    rates += [(ex.Symbol(name), ex.Velocity(name)) for name in coordinates]
    sums, forces = [], gradient(lagrangian, map(ex.Symbol, coordinates))
    for name, momentum in zip(coordinates, momenta(lagrangian, coordinates), strict=True):
        slopes = gradient(momentum, [ex.TIME, *(leaf for leaf, _ in rates)])
        terms = [slopes[leaf] * rate for leaf, rate in rates if leaf in slopes and rate != ex.ZERO]
        sums.append(
            ex.add(*terms, slopes.get(ex.TIME, ex.ZERO), -forces.get(ex.Symbol(name), ex.ZERO))
        )
    return tuple(sums)


def advice_for_lagrangian(
    lagrangian: ex.Expression, coordinates: Sequence[str], walls: Iterable[ex.Expression] = ()
) -> dict[str, Any]:
    """The advice for a regular L without constraints and forces; `walls` are formulas at whose
    zeros L ends.
    """
    moving = {*map(ex.Symbol, coordinates), *map(ex.Velocity, coordinates), ex.TIME}
    reached = dict.fromkeys(printing.to_text(wall) for wall in walls if moving & set(ex.walk(wall)))
    ends = _ENDS.format(" or ".join(reached)) if reached else ""
    timed = ex.holds(lagrangian, ex.TIME)
    why = "; L contains t, so the energy is not constant." if timed else f", {_ENERGY}"
    separable, masses = is_separable(lagrangian, coordinates), set[ex.Expression]()
    if separable:
        rates = [ex.Velocity(name) for name in coordinates]
        slopes = (
            slope for p in momenta(lagrangian, coordinates) for slope in gradient(p, rates).values()
        )
        masses = {node for slope in slopes for node in ex.walk(collecting.collect(slope))}
    if separable and not moving & masses:
        return advice(
            "stormer-verlet",
            8,
            f"L is separable, so its steps are explicit and symplectic{why}{ends}",
        )
    but = (
        "its masses depend on the time"
        if moving & masses == {ex.TIME}
        else "not quadratic in the velocities"
    )
    form = f"separable, but {but}" if separable else "not separable"
    return advice(
        "variational", 8, f"L is {form}; the steps are implicit and symplectic{why}{ends}", "1/2"
    )


def advice_for_constraints(
    lagrangian: ex.Expression, constraints: Sequence[ex.Expression], coordinates: Sequence[str]
) -> dict[str, Any]:
    """The advice for a Lagrangian with nonholonomic constraints.

    The method keeps the energy of regular motions for long, and nearly that of others, where the
    motion is reversible: L is even in the velocities and the constraints are odd.
    """
    turned = {ex.Velocity(name): -ex.Velocity(name) for name in coordinates}
    why = f"and the energy drifts little, because the motion is reversible{_EXACT}"
    if collecting.collect(lagrangian - ex.substitute(lagrangian, turned)) != ex.ZERO:
        why = f"but the energy may drift, since L has terms of odd degree in the velocities{_EXACT}"
    if any(collecting.collect(one + ex.substitute(one, turned)) != ex.ZERO for one in constraints):
        why = (
            "but the energy is not constant, because constraints with velocity-free terms do work."
        )
    if any(ex.holds(tree, ex.TIME) for tree in (lagrangian, *constraints)):
        why = "but L contains t, so the energy is not constant."
    return advice(
        "nonholonomic", 8, f"it keeps the discrete constraints to round-off, {why}", "1/2"
    )


def advice(method: str, order: int | None, reason: str, alpha: str | None = None) -> dict[str, Any]:
    """The parts by name."""
    return {"method": method, "order": order, "alpha": alpha, "reason": reason}


def is_separable(lagrangian: ex.Expression, coordinates: Sequence[str]) -> bool:
    """L = T(t, v) - V(t, q)."""
    rates, places = [*map(ex.Velocity, coordinates)], [*map(ex.Symbol, coordinates)]
    mixed = [
        term
        for term in ex.summands(lagrangian)
        if ex.holds(term, *rates) and ex.holds(term, *places)
    ]
    slopes = gradient(ex.add(*mixed), rates).values()
    rest = (part for slope in slopes for part in gradient(slope, places).values())
    return all(collecting.collect(part) == ex.ZERO for part in rest)


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
