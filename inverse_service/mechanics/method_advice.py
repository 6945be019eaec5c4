"""Which integrator a Lagrangian asks for, seen from its formula alone: {method, order, alpha, reason}."""

from collections.abc import Iterable, Sequence
from typing import Any

from inverse_service.expressions import collecting, derivative, printing, tree as ex
from inverse_service.mechanics import euler_lagrange

EXACT = "; where a single trajectory is to be exact, adaptive costs less."
ENERGY = f"and the energy does not drift{EXACT}"
NOTHING_KEPT = "nothing is known to be conserved that a geometric method would keep."
LEAVES = " It ends where {} changes its sign: a motion that passes there needs adaptive."


def for_lagrangian(
    lagrangian: ex.Expression, coordinates: Sequence[str], walls: Iterable[ex.Expression] = ()
) -> dict[str, Any]:
    """The advice for a regular L without constraints and forces; `walls` are formulas at whose zeros L ends."""
    moving = {*map(ex.Symbol, coordinates), *map(ex.Velocity, coordinates), ex.TIME}
    reached = dict.fromkeys(printing.to_text(wall) for wall in walls if moving & set(ex.walk(wall)))
    ends = LEAVES.format(" or ".join(reached)) if reached else ""
    with_time = ex.holds(lagrangian, ex.TIME)
    why = "; L contains t, so the energy is not constant." if with_time else f", {ENERGY}"
    masses = {
        node for row in euler_lagrange.hessian(lagrangian, coordinates) for entry in row for node in ex.walk(entry)
    }
    separable = is_separable(lagrangian, coordinates)
    if separable and not moving & masses:
        return advice("stormer-verlet", 8, f"L is separable, so its steps are explicit and symplectic{why}{ends}")
    but = "its masses depend on the time" if moving & masses == {ex.TIME} else "not quadratic in the velocities"
    form = f"separable, but {but}" if separable else "not separable"
    return advice("variational", 8, f"L is {form}; the steps are implicit and symplectic{why}{ends}", "1/2")


def for_constraints(
    lagrangian: ex.Expression, constraints: Sequence[ex.Expression], coordinates: Sequence[str]
) -> dict[str, Any]:
    """The advice for a Lagrangian with nonholonomic constraints.

    The method keeps the energy of regular motions for long, and nearly that of others, where the motion is
    reversible: L is even in the velocities and the constraints are odd.
    """
    turned = {ex.Velocity(name): -ex.Velocity(name) for name in coordinates}
    why = f"and the energy drifts little, because the motion is reversible{EXACT}"
    if collecting.collect(lagrangian - ex.substitute(lagrangian, turned)) != ex.ZERO:
        why = f"but the energy may drift, since L has terms of odd degree in the velocities{EXACT}"
    if any(collecting.collect(one + ex.substitute(one, turned)) != ex.ZERO for one in constraints):
        why = "but the energy is not constant, because constraints with velocity-free terms do work."
    if any(ex.holds(tree, ex.TIME) for tree in (lagrangian, *constraints)):
        why = "but L contains t, so the energy is not constant."
    return advice("nonholonomic", 8, f"it keeps the discrete constraints to round-off, {why}", "1/2")


def advice(method: str, order: int | None, reason: str, alpha: str | None = None) -> dict[str, Any]:
    """The parts by name."""
    return {"method": method, "order": order, "alpha": alpha, "reason": reason}


def is_separable(lagrangian: ex.Expression, coordinates: Sequence[str]) -> bool:
    """L = T(t, v) - V(t, q)."""
    rest = [
        derivative.differentiate(derivative.differentiate(lagrangian, ex.Velocity(v)), ex.Symbol(q))
        for v in coordinates
        for q in coordinates
    ]
    return all(collecting.collect(slope) == ex.ZERO for slope in rest)
