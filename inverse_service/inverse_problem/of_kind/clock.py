"""A system with another clock: dtau = N(q) dt, q' = dq/dtau (Chaplygin 1911)."""

from __future__ import annotations

from dataclasses import replace

from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import Expression, Symbol, Velocity, add, divide, multiply, power, substitute
from inverse_service.expressions.tree import subtract as less
from inverse_service.inverse_problem.of_kind.rayleigh import collected
from inverse_service.mechanics.second_order_system import SecondOrderSystem


def with_clock(system: SecondOrderSystem, factor: Expression) -> SecondOrderSystem:
    """q'' = f(q, N q')/N^2 - (q'^k dN/dq^k / N) q', for f without t."""
    names = system.coordinates
    faster: dict[Expression, Expression] = {Velocity(name): multiply(factor, Velocity(name)) for name in names}
    rate = divide(add(*(multiply(Velocity(name), differentiate(factor, Symbol(name))) for name in names)), factor)
    forces = (divide(substitute(f, faster), power(factor, 2)) for f in system.given)
    pairs = zip(forces, names, strict=True)
    found = tuple(collected(less(force, multiply(rate, Velocity(name)))) for force, name in pairs)
    return replace(system, accelerations=found, branch=None, name="")
