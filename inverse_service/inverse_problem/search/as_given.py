"""The Lagrangian of equations that are Euler-Lagrange equations as they are written.

Where E_i(t, q, q', q'') = M_ij q''_j + b_i is self-adjoint, its own multiplier M is the velocity Hessian of L
(Helmholtz 1887), and L follows by quadrature: a part of M that is homogeneous of degree d in the velocities belongs to
M_ij v_i v_j / ((d + 1)(d + 2)), and what is left of E_i is that of some A_i(t, q) v_i - V(t, q). Masses stay as
written.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.errors import InputError
from inverse_service.expressions.tree import TIME, Acceleration, Expression, Symbol, Velocity, subtract
from inverse_service.inverse_problem.search.deadline import check
from inverse_service.inverse_problem.search.exact_solution import solution
from inverse_service.inverse_problem.search.material import antiderivatives
from inverse_service.inverse_problem.search.motion import split_velocities
from inverse_service.inverse_problem.search.terms import (
    Monomial,
    Terms,
    TooManyTerms,
    add_terms,
    derivative_of_terms,
    monomial,
    multiply_terms,
    rank,
    terms_of,
    times,
    tree_of,
)
from inverse_service.mechanics.linear_parts import linear_equation
from inverse_service.mechanics.second_order_system import SecondOrderSystem

# Terms that are tried for A_i v_i - V beside four for each term wanted, and how often what is left over is answered.
_MOST_TERMS, _DEPTH = 60, 3


@dataclass(frozen=True, slots=True)
class _Equations:
    """E_i = sum_j matrix[i][j] q''_j + rest[i]."""

    coordinates: tuple[Symbol, ...]
    velocities: tuple[Velocity, ...]
    matrix: list[list[Terms]]
    rest: list[Terms]

    @property
    def places(self) -> range:
        return range(len(self.coordinates))


def lagrangian_as_given(system: SecondOrderSystem, given: Sequence[Expression] = ()) -> Expression | None:
    """L with dE_i/dq''_j as its Hessian for E = 0 as given, E = q'' - f where nothing is given.

    None where E is not of that kind. That L is a Lagrangian of the system is for the caller to check.
    """
    try:
        equations = _in_order(_equations(system, given or _solved(system)))
        kinetic = _kinetic(equations) if equations is not None else None
        rest = _completed(equations, _left_over(equations, kinetic)) if equations is not None and kinetic else None
    except (TooManyTerms, InputError):
        return None
    if kinetic is None or rest is None:
        return None
    sign = -1 if all(value < 0 for value in kinetic.values()) else 1
    return tree_of({key: sign * value for key, value in add_terms(kinetic, rest).items()})


def _solved(system: SecondOrderSystem) -> list[Expression]:
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    return [subtract(Acceleration(name), f) for name, f in pairs]


def _equations(system: SecondOrderSystem, given: Sequence[Expression]) -> _Equations:
    """InputError where an acceleration does not enter linearly, TooManyTerms where a sum is long."""
    names = system.coordinates
    parts = [linear_equation(equation) for equation in given]
    matrix = [
        [terms_of(part.coefficients[name]) if name in part.coefficients else {} for name in names] for part in parts
    ]
    rest = [terms_of(part.rest) for part in parts]
    return _Equations(tuple(map(Symbol, names)), tuple(map(Velocity, names)), matrix, rest)


def _in_order(equations: _Equations) -> _Equations | None:
    """The equations in an order in which the matrix is symmetric: as they stand, or each by its only acceleration."""
    if _is_symmetric(equations.matrix):
        return equations
    own = [[k for k, entry in enumerate(row) if entry] for row in equations.matrix]
    if sorted(own) != [[k] for k in equations.places]:
        return None
    order = sorted(equations.places, key=lambda row: own[row])
    matrix, rest = [equations.matrix[row] for row in order], [equations.rest[row] for row in order]
    return _Equations(equations.coordinates, equations.velocities, matrix, rest)


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


def _left_over(equations: _Equations, kinetic: Terms) -> list[Terms]:
    """E_i without accelerations, less that of the kinetic part."""
    return [
        add_terms(rest, expression, -1)
        for rest, expression in zip(equations.rest, _expressions(equations, kinetic), strict=True)
    ]


def _expressions(equations: _Equations, terms: Terms) -> list[Terms]:
    """v_j L_(v_i q_j) + L_(v_i t) - L_(q_i) for each i."""
    found = []
    for q, v in zip(equations.coordinates, equations.velocities, strict=True):
        check()
        momentum = derivative_of_terms(terms, v)
        total = add_terms(derivative_of_terms(momentum, TIME), derivative_of_terms(terms, q), -1)
        for other, rate in zip(equations.coordinates, equations.velocities, strict=True):
            slope = derivative_of_terms(momentum, other)
            total = add_terms(total, multiply_terms(slope, {monomial(rate): Fraction(1)}))
        found.append(total)
    return found


def _completed(equations: _Equations, wanted: list[Terms]) -> Terms | None:
    """A_i v_i - V with these Euler-Lagrange expressions, by linear equations for the coefficients of its terms."""
    columns: dict[Monomial, list[Terms]] = {}
    fresh = [(i, key) for i in equations.places for key in wanted[i]]
    if any(not _is_affine(key) for _, key in fresh):
        return None
    right, most = _numbered(wanted), _MOST_TERMS + 4 * len(fresh)
    for _ in range(_DEPTH):
        raised = dict.fromkeys(m for i, key in fresh for m in _answers(equations, i, key) if m not in columns)
        fresh = []
        for m in sorted(raised, key=rank)[: most - len(columns)]:
            columns[m] = _expressions(equations, {m: Fraction(1)})
            fresh += [(i, key) for i, terms in enumerate(columns[m]) for key in terms if _is_affine(key)]
        found = solution([_numbered(expressions) for expressions in columns.values()], right)
        if found is not None:
            return {m: a for m, a in zip(columns, found, strict=True) if a}
    return None


def _numbered(expressions: Iterable[Terms]) -> dict[Hashable, Fraction]:
    return {(i, key): value for i, terms in enumerate(expressions) for key, value in terms.items()}


def _is_affine(key: Monomial) -> bool:
    moving = list(split_velocities(key)[1])
    return len(moving) <= 1 and all(isinstance(letter, Velocity) and e == 1 for letter, e in moving)


def _answers(equations: _Equations, i: int, key: Monomial) -> list[Monomial]:
    """B with dB/dq_i = T for a term T of E_i; B v_i with dB/dq_j = T and B v_j with dB/dq_i = T for a term T v_j."""
    position, moving = split_velocities(key)
    q, v = equations.coordinates[i], equations.velocities[i]
    if not moving:
        return list(antiderivatives(position, q))
    ((rate, _),) = moving
    other = next(p for p, w in zip(equations.coordinates, equations.velocities, strict=True) if w == rate)
    pairs: list[tuple[Monomial, Expression]] = [(m, v) for m in antiderivatives(position, other)]
    pairs += [(m, rate) for m in antiderivatives(position, q)]
    return [times(m, monomial(w)) for m, w in pairs]
