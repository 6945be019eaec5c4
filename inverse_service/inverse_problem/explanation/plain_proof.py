"""The proof that needs no theory: L put into the Euler-Lagrange equations gives the equations of motion."""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate, differentiate_in_time
from inverse_service.expressions.notation import Formula, partial_derivative, row, theory
from inverse_service.expressions.tree import (
    ONE,
    Acceleration,
    Expression,
    Symbol,
    Velocity,
    subtract,
    walk,
)
from inverse_service.inverse_problem.explanation.steps import Piece, said, separated
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
        return (said("Put into `d/dt(dL/dq') - dL/dq = 0`, `L` gives equations that `f` satisfies identically."),)
    sentences = [_sentence(name, *line) for name, line in zip(system.coordinates, lines, strict=True)]
    concluded = [*sentences[-1], " ", *_conclusion(system, [line[3] for line in lines])]
    return tuple(said(*pieces) for pieces in (*sentences[:-1], concluded))


def _line(lagrangian: Expression, name: str, names: Sequence[str]) -> tuple[Expression, ...]:
    """(dL/dv, its derivative along the motion, dL/dq, the difference of these)."""
    momentum = collect(differentiate(lagrangian, Velocity(name)))
    rate = collect(differentiate_in_time(momentum, names))
    force = collect(differentiate(lagrangian, Symbol(name)))
    return momentum, rate, force, collect(subtract(rate, force))


def _sentence(
    name: str, momentum: Expression, rate: Expression, force: Expression, equation: Expression
) -> list[Piece]:
    lagrangian = theory("L")
    slope, pull = (partial_derivative(lagrangian, by) for by in (Velocity(name), Symbol(name)))
    rated = row("d/dt ", slope)
    return [
        row(slope, " = ", momentum), ", ", row(rated, " = ", rate), " and ", row(pull, " = ", force),
        ", so the Euler-Lagrange equation ", row(rated, " - ", pull, " = 0"), " reads ", row(equation, " = 0"), ".",
    ]  # fmt: skip


def _conclusion(system: SecondOrderSystem, equations: Sequence[Expression]) -> list[Piece]:
    pairs = list(zip(system.coordinates, system.accelerations, strict=True))
    motion: list[Formula] = [row(Acceleration(name), " = ", f) for name, f in pairs]
    if len(pairs) > 1:
        return ["Solved for the accelerations, these equations are ", *separated(motion), "."]
    factor = differentiate(equations[0], Acceleration(system.coordinates[0]))
    what: list[Piece] = ["That is "] if factor == ONE else ["Divided by ", factor, ", that is "]
    return [*what, motion[0], "."]
