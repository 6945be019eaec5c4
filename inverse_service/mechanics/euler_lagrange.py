"""Momenta, velocity Hessian and Euler-Lagrange residual of a Lagrangian L(t, q, v).

Derivatives are collected (like terms added, exact), not simplified further.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    ONE,
    TIME,
    ZERO,
    Expression,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    multiply,
    walk,
)

Matrix = tuple[tuple[Expression, ...], ...]


def gradient(tree: Expression, leaves: Iterable[Symbol | Velocity]) -> dict[Symbol | Velocity, Expression]:
    """The derivatives by the leaves that occur; of a long sum each term is looked at once."""
    wanted, parts = set(leaves), dict[Symbol | Velocity, list[Expression]]()
    left: list[tuple[Expression, Expression]] = [(ONE, tree)]
    for factor, part in left:
        match part:
            case Sum(terms):
                left += [(factor, term) for term in terms]
            case Product((*constants, Sum(terms))) if wanted.isdisjoint(node for c in constants for node in walk(c)):
                left += [(multiply(factor, *constants), term) for term in terms]
            case _:
                held = dict.fromkeys(node for node in walk(part) if isinstance(node, Symbol | Velocity))
                for leaf in (node for node in held if node in wanted):
                    parts.setdefault(leaf, []).append(factor * differentiate(part, leaf))
    return {leaf: add(*terms) for leaf, terms in parts.items()}


def momenta(lagrangian: Expression, coordinates: Sequence[str]) -> tuple[Expression, ...]:
    """p_i = dL/dv_i, one for each coordinate."""
    slopes = gradient(lagrangian, map(Velocity, coordinates))
    return tuple(collect(slopes.get(Velocity(name), ZERO)) for name in coordinates)


def hessian(lagrangian: Expression, coordinates: Sequence[str]) -> Matrix:
    """g_ij = d2L/dv_i dv_j, (n, n), symmetric: each entry pair is the same tree."""
    rates = [Velocity(name) for name in coordinates]
    rows = [gradient(momentum, rates[: i + 1]) for i, momentum in enumerate(momenta(lagrangian, coordinates))]
    table = [[collect(row.get(rate, ZERO)) for rate in rates[: i + 1]] for i, row in enumerate(rows)]
    return tuple(tuple(table[max(i, j)][min(i, j)] for j in range(len(rates))) for i in range(len(rates)))


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
    sums, forces = [], gradient(lagrangian, map(Symbol, coordinates))
    for name, momentum in zip(coordinates, momenta(lagrangian, coordinates), strict=True):
        slopes = gradient(momentum, [TIME, *(leaf for leaf, _ in rates)])
        terms = [slopes[leaf] * rate for leaf, rate in rates if leaf in slopes and rate != ZERO]
        sums.append(add(*terms, slopes.get(TIME, ZERO), -forces.get(Symbol(name), ZERO)))
    return tuple(sums)
