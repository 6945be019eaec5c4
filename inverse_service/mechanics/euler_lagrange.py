"""Momenta, velocity Hessian and Euler-Lagrange residual of a Lagrangian L(t, q, v).

Derivatives are collected (like terms added, exact) but not simplified. The advice {method, order,
alpha, reason} on the integrator that L asks for is seen from the formula alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple, TypeVar

import mpmath

from inverse_service.expressions import calculus, collecting, printing, tree as ex

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
                held = [node for node in ex.distinct_nodes((part,)) if isinstance(node, Leaf)]
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
    if any(ex.holds(one, ex.TIME) for one in constraints):
        why = f"but the energy may drift, since a constraint contains t{_EXACT}"
    if any(collecting.collect(one + ex.substitute(one, turned)) != ex.ZERO for one in constraints):
        why = (
            "but the energy is not constant, because constraints with velocity-free terms do work."
        )
    if ex.holds(lagrangian, ex.TIME):
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
