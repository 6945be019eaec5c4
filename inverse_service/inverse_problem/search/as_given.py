"""The Lagrangian of equations that are Euler-Lagrange equations as they are written.

Where E_i(t, q, q', q'') = M_ij q''_j + b_i is self-adjoint, its own multiplier M is the velocity Hessian of L
(Helmholtz 1887), and L follows by quadrature: a part of M that is homogeneous of degree d in the velocities belongs to
M_ij v_i v_j / ((d + 1)(d + 2)), and what is left of E_i is that of some A_i(t, q) v_i - V(t, q). Masses stay as
written.

A Lagrangian is given up to a constant factor. Where the Hessian of a quadratic one that was found otherwise is h M, the
constants that h has as a factor are divided out: e^(ct/m) (m x'^2 - k x^2)/2 for m x'' + c x' + k x = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service import bounds
from inverse_service.errors import InputError
from inverse_service.expressions.tree import ONE, Acceleration, Expression, Symbol, Velocity
from inverse_service.inverse_problem.search.completion import completed, expressions_without_acceleration
from inverse_service.inverse_problem.search.motion_terms import split_velocities
from inverse_service.inverse_problem.search.terms import (
    EMPTY,
    Monomial,
    Terms,
    TooManyTerms,
    add_terms,
    derivative_of_terms,
    monomial,
    multiply_terms,
    split_content,
    terms_of,
    times,
    tree_of,
)
from inverse_service.mechanics.implicit_equations import linear_equation
from inverse_service.mechanics.second_order_system import SecondOrderSystem


@dataclass(frozen=True, slots=True)
class _Equations:
    """E_i = sum_j matrix[i][j] q''_j + rest[i]."""

    velocities: tuple[Velocity, ...]
    matrix: list[list[Terms]]
    rest: list[Terms]


def lagrangian_as_given(system: SecondOrderSystem, given: Sequence[Expression] = ()) -> Expression | None:
    """L with dE_i/dq''_j as its Hessian for E = 0 as given, E = q'' - f where nothing is given.

    None where E is not of that kind. That L is a Lagrangian of the system is for the caller to check.
    """
    try:
        equations = _in_order(_equations(system, given or _solved(system)))
        kinetic = _kinetic(equations) if equations is not None else None
        if equations is None or kinetic is None:
            return None
        rest = completed(system.coordinates, _left_over(system.coordinates, equations, kinetic))
    except (TooManyTerms, InputError):
        return None
    if rest is None:
        return None
    sign = -1 if all(value < 0 for value in kinetic.values()) else 1
    whole = tree_of(kinetic) + rest
    return whole if sign > 0 else tree_of({key: -value for key, value in terms_of(whole).items()})


def written_masses(system: SecondOrderSystem, given: Sequence[Expression]) -> list[list[Terms]] | None:
    """dE_i/dq''_j of the equations in an order in which it is symmetric; None where there is none.

    InputError where an acceleration does not enter linearly, TooManyTerms where a sum is long.
    """
    equations = _in_order(_equations(system, given))
    return None if equations is None else equations.matrix


def _solved(system: SecondOrderSystem) -> list[Expression]:
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    return [Acceleration(name) - f for name, f in pairs]


def _equations(system: SecondOrderSystem, given: Sequence[Expression]) -> _Equations:
    """InputError where an acceleration does not enter linearly, TooManyTerms where a sum is long."""
    names = system.coordinates
    parts = [linear_equation(equation) for equation in given]
    matrix = [
        [terms_of(part.coefficients[name]) if name in part.coefficients else {} for name in names] for part in parts
    ]
    rest = [terms_of(part.rest) for part in parts]
    return _Equations(tuple(map(Velocity, names)), matrix, rest)


def _in_order(equations: _Equations) -> _Equations | None:
    """The equations in an order in which the matrix is symmetric: as they stand, or each by its only acceleration."""
    if _is_symmetric(equations.matrix):
        return equations
    own = [[k for k, entry in enumerate(row) if entry] for row in equations.matrix]
    if sorted(own) != [[k] for k in range(len(own))]:
        return None
    order = sorted(range(len(own)), key=lambda row: own[row])
    matrix, rest = [equations.matrix[row] for row in order], [equations.rest[row] for row in order]
    return _Equations(equations.velocities, matrix, rest)


def _is_symmetric(matrix: list[list[Terms]]) -> bool:
    size = len(matrix)
    return all(len(row) == size for row in matrix) and all(
        matrix[i][j] == matrix[j][i] for i in range(size) for j in range(i)
    )


def _kinetic(equations: _Equations) -> Terms | None:
    """sum M_ij v_i v_j / ((d + 1)(d + 2)); None where a part of M is of degree -1 or -2, or not a polynomial in v."""
    total: Terms = {}
    for row, v in zip(equations.matrix, equations.velocities, strict=True):
        for entry, w in zip(row, equations.velocities, strict=True):
            for key, value in entry.items():
                _, moving = split_velocities(key)
                degree = sum((e for _, e in moving), Fraction(0))
                if not all(isinstance(letter, Velocity) for letter, _ in moving) or degree in (-1, -2):
                    return None
                term = {times(key, monomial(v, w)): value / ((degree + 1) * (degree + 2))}
                total = add_terms(total, term)
    return total


def _left_over(names: Sequence[str], equations: _Equations, kinetic: Terms) -> list[Terms]:
    """E_i without accelerations, less that of the kinetic part."""
    own = expressions_without_acceleration(names, kinetic)
    return [add_terms(rest, expression, -1) for rest, expression in zip(equations.rest, own, strict=True)]


def masses(system: SecondOrderSystem) -> list[Terms]:
    """Products w_i of constants, without denominators, with w_i df_i/dq_j = w_j df_j/dq_i; 1 where there are none."""
    forces = [terms_of(f) for f in system.accelerations]
    slopes = [[derivative_of_terms(f, Symbol(q)) for q in system.coordinates] for f in forces]
    constants, found = {*map(Symbol, system.parameters)}, dict[int, tuple[Monomial, Fraction]]()
    for start in range(len(slopes)):
        block = [] if start in found else [start]
        found.setdefault(start, (EMPTY, Fraction(1)))
        for i in block:
            for j, slope in enumerate(slopes[i]):
                ratio = _ratio(slope, slopes[j][i], constants)
                if ratio is None:
                    return [{EMPTY: Fraction(1)}] * len(slopes)
                if slope and j not in found:
                    found[j] = times(found[i][0], ratio[0]), found[i][1] * ratio[1]
                    block.append(j)
        tables = [dict(found[i][0]) for i in block]
        least = {
            letter: min(table.get(letter, Fraction(0)) for table in tables) for table in tables for letter in table
        }
        common = frozenset((letter, e) for letter, e in least.items() if e)
        found |= {i: (times(found[i][0], common, -1), found[i][1]) for i in block}
    return [{key: value} for key, value in (found[i] for i in range(len(slopes)))]


def _ratio(left: Terms, right: Terms, constants: set[Symbol]) -> tuple[Monomial, Fraction] | None:
    """(m, c) with left = c m right, m a product of constants; None where there is none."""
    if not left and not right:
        return EMPTY, Fraction(1)
    for key, value in right.items() if left else ():
        first = next(iter(left))
        m, c = times(first, key, -1), left[first] / value
        if {letter for letter, _ in m} <= constants and left == {times(k, m): c * a for k, a in right.items()}:
            return m, c
    return None


def with_written_masses(
    lagrangian: Expression, system: SecondOrderSystem, given: Sequence[Expression]
) -> Expression | None:
    """A constant multiple of L whose Hessian has the constants of the equations as written.

    None where L is not quadratic in the velocities, its Hessian no multiple of dE_i/dq''_j, or nothing changes.
    """
    try:
        written = written_masses(system, given) if 0 < len(given) <= bounds.COORDINATES else None
        hessian = _hessian(terms_of(lagrangian), system.coordinates)
    except (TooManyTerms, InputError):
        return None
    if written is None or hessian is None or not _is_multiple(hessian, written):
        return None
    parameters: set[Expression] = {Symbol(name) for name in system.parameters}
    (number, wanted), (value, known) = _constant(written[0][0], parameters), _constant(hessian[0][0], parameters)
    factor, ratio = times(wanted, known, -1), abs(number / value)
    # The factor stays in one piece, so that it cancels: (m + M)/(m + M).
    return tree_of({times(key, factor): ratio * c for key, c in terms_of(lagrangian).items()}) if factor else None


def _hessian(terms: Terms, names: Sequence[str]) -> list[list[Terms]] | None:
    """d^2 L/dv_i dv_j; None where L is not of degree 2 in the velocities."""
    places = {Velocity(name): k for k, name in enumerate(names)}
    found: list[list[Terms]] = [[{} for _ in names] for _ in names]
    for key, value in terms.items():
        rest, moving = split_velocities(key)
        if any(v not in places or e not in (1, 2) for v, e in moving) or sum(e for _, e in moving) > 2:
            return None
        rates = [places[v] for v, e in moving if isinstance(v, Velocity) for _ in range(int(e))]
        if len(rates) == 2:
            i, j = rates
            found[i][j][rest] = found[j][i][rest] = value * (2 if i == j else 1)
    return found


def _is_multiple(left: Sequence[Sequence[Terms]], right: Sequence[Sequence[Terms]]) -> bool:
    """Whether left = h right with any function h."""
    first, other = left[0][0], right[0][0]
    pairs = [pair for rows in zip(left, right, strict=True) for pair in zip(*rows, strict=True)]
    return bool(first and other) and all(multiply_terms(a, other) == multiply_terms(first, b) for a, b in pairs)


def _constant(terms: Terms, parameters: set[Expression]) -> tuple[Fraction, Monomial]:
    """The factor of a sum that is made of numbers and parameters alone, a sum of parameters as one letter."""
    content, common, rest = split_content(terms)
    outside: Monomial = frozenset(item for item in common if item[0] in parameters)
    whole = rest != ONE and {letter for key in terms_of(rest) for letter, _ in key} <= parameters
    return content, times(outside, monomial(rest)) if whole else outside
