"""The proof that needs no theory: L put into the Euler-Lagrange equations gives the equations of motion."""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate, differentiate_in_time
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.printing_latex import to_latex
from inverse_service.expressions.tree import (
    ONE,
    Acceleration,
    Expression,
    Symbol,
    Velocity,
    subtract,
    walk,
)
from inverse_service.inverse_problem.outcome import Step
from inverse_service.mechanics.second_order_system import SecondOrderSystem

# Nodes of one equation beyond which nobody follows it line by line.
_LONGEST = 400


def euler_lagrange_steps(system: SecondOrderSystem, lagrangian: Expression) -> tuple[Step, ...]:
    """One step for each coordinate: dL/dv, its derivative along the motion, dL/dq, and the equation that they make.

    A single sentence where these formulas are long.
    """
    lines = [_line(lagrangian, name, system.coordinates) for name in system.coordinates]
    if any(sum(1 for tree in line for _ in walk(tree)) > _LONGEST for line in lines):
        return (Step("Put into d/dt(dL/dq') - dL/dq = 0, L gives equations that f satisfies identically.", _GENERAL),)
    steps = [_step(name, *line) for name, line in zip(system.coordinates, lines, strict=True)]
    return (*steps[:-1], _concluded(steps[-1], system, [line[3] for line in lines]))


_GENERAL = r"\frac{d}{dt}\frac{\partial L}{\partial \dot q} - \frac{\partial L}{\partial q} = 0"


def _line(lagrangian: Expression, name: str, names: Sequence[str]) -> tuple[Expression, ...]:
    """(dL/dv, its derivative along the motion, dL/dq, the difference of these)."""
    momentum = collect(differentiate(lagrangian, Velocity(name)))
    rate = collect(differentiate_in_time(momentum, names))
    force = collect(differentiate(lagrangian, Symbol(name)))
    return momentum, rate, force, collect(subtract(rate, force))


def _step(name: str, momentum: Expression, rate: Expression, force: Expression, equation: Expression) -> Step:
    p, q, v = f"dL/d{name}'", to_latex(Symbol(name)), to_latex(Velocity(name))
    text = (
        f"{p} = {to_text(momentum)}, d/dt {p} = {to_text(rate)} and dL/d{name} = {to_text(force)}, "
        f"so the Euler-Lagrange equation d/dt {p} - dL/d{name} = 0 reads {to_text(equation)} = 0"
    )
    slope = rf"\frac{{\partial L}}{{\partial {v}}}"
    latex = rf"\frac{{d}}{{dt}}{slope} - \frac{{\partial L}}{{\partial {q}}} = {to_latex(equation)} = 0"
    return Step(text + ".", latex)


def _concluded(last: Step, system: SecondOrderSystem, equations: Sequence[Expression]) -> Step:
    pairs = list(zip(system.coordinates, system.accelerations, strict=True))
    motion = ", ".join(f"{name}'' = {to_text(f)}" for name, f in pairs)
    factors = [
        differentiate(equation, Acceleration(name))
        for name, equation in zip(system.coordinates, equations, strict=True)
    ]
    what = "Solved for the accelerations, these equations are"
    if len(pairs) == 1:
        (factor,) = factors
        what = "That is" if factor == ONE else f"Divided by {to_text(factor)}, that is"
    return Step(f"{last.text} {what} {motion}.", last.latex)
