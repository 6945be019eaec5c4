"""Accelerations of a constrained motion in a form that is regular wherever the constraints are independent.

With g = L_vv, F = L_q - L_vq v - L_vt + Q and constraints w v = 0:

    a = g^-1 (F + w^T lambda),   lambda = -(w g^-1 w^T)^-1 (w' v + w g^-1 F)

Unlike the equations in independent velocities they have no singular points such as cos(phi) = 0.
Source: A. M. Bloch, Nonholonomic Mechanics and Control, 2003, chapter 5; adjugates by Laplace expansion.
"""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.codegen.triangular_form import components
from inverse_service.errors import InputError
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import ONE, TIME, ZERO, Expression, Symbol, Velocity, add, dot
from inverse_service.mechanics.euler_lagrange import euler_lagrange_sums, hessian

Matrix = tuple[tuple[Expression, ...], ...]
# Beyond this size the expansion of a full determinant would fill pages.
MOST_FULL_ROWS = 5
DEGENERATE = (
    "the matrix of the velocities is singular (d2L/dv_i dv_j, or constraints that depend on one another), so no "
    "accelerations follow: give every coordinate its kinetic energy, with other parameters or effects of the scene."
)


def regular_accelerations(
    coordinates: Sequence[str],
    lagrangian: Expression,
    constraints: Sequence[Expression],
    forces: Sequence[Expression] = (),
) -> tuple[Expression, ...] | None:
    """All n accelerations over (q, v), with further forces Q; None where the matrices are too large to be inverted."""
    found = accelerations_and_multipliers(coordinates, lagrangian, constraints, forces)
    return None if found is None else found[0]


def accelerations_and_multipliers(
    coordinates: Sequence[str],
    lagrangian: Expression,
    constraints: Sequence[Expression],
    forces: Sequence[Expression] = (),
) -> tuple[tuple[Expression, ...], tuple[Expression, ...]] | None:
    """a and lambda; the constraints exert the forces w^T lambda."""
    names = tuple(coordinates)
    inertia = inverse(hessian(lagrangian, names))
    if inertia is None:
        return None
    own = tuple(-e for e in euler_lagrange_sums(lagrangian, names, [ZERO] * len(names)))
    free = _applied(inertia, tuple(map(add, own, forces)) if forces else own)
    if not constraints:
        return free, ()
    rows = tuple(tuple(collect(differentiate(w, Velocity(name))) for name in names) for w in constraints)
    lifted = tuple(_applied(inertia, row) for row in rows)
    gram = inverse(tuple(tuple(dot(row, lift) for lift in lifted) for row in rows))
    if gram is None:
        return None
    defects = [_rate(w, names) + dot(row, free) for w, row in zip(constraints, rows, strict=True)]
    multipliers = tuple(-dot(line, defects) for line in gram)
    moved = (free[i] + dot([lift[i] for lift in lifted], multipliers) for i in range(len(names)))
    return tuple(moved), multipliers


def inverse(matrix: Matrix) -> Matrix | None:
    """The inverse of a symmetric matrix, block by block; None where a block is larger than MOST_FULL_ROWS.

    InputError where it is singular everywhere.
    """
    span = range(len(matrix))
    found: list[list[Expression]] = [[ZERO for _ in span] for _ in span]
    for block in components({i: [j for j in span if matrix[i][j] != ZERO] for i in span}):
        if len(block) > MOST_FULL_ROWS:
            return None
        inner = tuple(tuple(matrix[i][j] for j in block) for i in block)
        whole = determinant(inner)
        if whole == ZERO:
            raise InputError(DEGENERATE)
        for a, i in enumerate(block):
            for b, j in enumerate(block):
                found[i][j] = _cofactor(inner, b, a) / whole
    return tuple(map(tuple, found))


def determinant(matrix: Matrix) -> Expression:
    """The determinant by expansion along the first row; 1 for a matrix without rows."""
    if not matrix:
        return ONE
    terms = [entry * _cofactor(matrix, 0, j) for j, entry in enumerate(matrix[0]) if entry != ZERO]
    return collect(add(*terms))


def _cofactor(matrix: Matrix, row: int, column: int) -> Expression:
    minor = tuple(
        tuple(entry for j, entry in enumerate(line) if j != column) for i, line in enumerate(matrix) if i != row
    )
    value = determinant(minor)
    return -value if (row + column) % 2 else value


def _rate(expression: Expression, names: tuple[str, ...]) -> Expression:
    """The part of the derivative in time that holds no acceleration."""
    along = (differentiate(expression, Symbol(name)) * Velocity(name) for name in names)
    return collect(add(*along, differentiate(expression, TIME)))


def _applied(matrix: Matrix, vector: Sequence[Expression]) -> tuple[Expression, ...]:
    return tuple(dot(row, vector) for row in matrix)
