"""Momenta, velocity Hessian and Euler-Lagrange residual of a Lagrangian L(t, q, v).

Derivatives are collected (like terms added, exact), not simplified further.
"""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    TIME,
    ZERO,
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    negate,
)

Matrix = tuple[tuple[Expression, ...], ...]


def momenta(lagrangian: Expression, coordinates: Sequence[str]) -> tuple[Expression, ...]:
    """p_i = dL/dv_i, one for each coordinate."""
    return tuple(collect(differentiate(lagrangian, Velocity(name))) for name in coordinates)


def hessian(lagrangian: Expression, coordinates: Sequence[str]) -> Matrix:
    """g_ij = d2L/dv_i dv_j, (n, n), symmetric: each entry pair is the same tree."""
    first = momenta(lagrangian, coordinates)
    table = {
        (i, j): collect(differentiate(first[i], Velocity(coordinates[j])))
        for i in range(len(coordinates))
        for j in range(i + 1)
    }
    return tuple(tuple(table[max(i, j), min(i, j)] for j in range(len(coordinates))) for i in range(len(coordinates)))


def euler_lagrange_residual(
    lagrangian: Expression, coordinates: Sequence[str], accelerations: Sequence[Expression]
) -> tuple[Expression, ...]:
    """sum_j L_(v_i v_j) f^j + sum_j L_(v_i q_j) v^j + L_(v_i t) - L_(q_i), one for each coordinate.

    Zero along q'' = f exactly when its solutions are extremals. ValueError where the numbers of
    coordinates and accelerations differ.
    """
    return tuple(map(collect, euler_lagrange_sums(lagrangian, coordinates, accelerations)))


def euler_lagrange_sums(
    lagrangian: Expression, coordinates: Sequence[str], accelerations: Sequence[Expression]
) -> tuple[Expression, ...]:
    """The residual as it comes, nothing collected: to be evaluated, not to be read."""
    pairs = zip(coordinates, accelerations, strict=True)
    rates: list[tuple[Symbol | Velocity, Expression]] = [(Velocity(name), f) for name, f in pairs]
    rates += [(Symbol(name), Velocity(name)) for name in coordinates]
    sums = []
    for name, momentum in zip(coordinates, momenta(lagrangian, coordinates), strict=True):
        terms = [multiply(differentiate(momentum, leaf), rate) for leaf, rate in rates if rate != ZERO]
        force = negate(differentiate(lagrangian, Symbol(name)))
        sums.append(add(*terms, differentiate(momentum, TIME), force))
    return tuple(sums)
