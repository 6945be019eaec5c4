"""Two flows integrated together in floats: that of H from a point of the constraints, and the nonholonomic one."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from inverse_service.errors import InputError
from inverse_service.expressions.derivative import Definitions, define_functions
from inverse_service.expressions.functions import FUNCTION
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    PI,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    add,
    number,
    substitute,
    walk,
)

STEPS, STEP = 100, 0.01
_STARTS = 12
_LARGE = 1e6
_FUNCTIONS: dict[str, Callable[[float], float]] = {
    **{name: getattr(math, name) for name in FUNCTION if hasattr(math, name)},
    "abs": abs,
    "sign": lambda u: float((u > 0) - (u < 0)),
    "Heaviside": lambda u: float(u > 0),
    "cot": lambda u: 1 / math.tan(u),
    "sec": lambda u: 1 / math.cos(u),
    "csc": lambda u: 1 / math.sin(u),
    "coth": lambda u: 1 / math.tanh(u),
    "sech": lambda u: 1 / math.cosh(u),
    "csch": lambda u: 1 / math.sinh(u),
}
State = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Flow:
    """x' = rates(x) for the variables in this order; no other names may occur in the rates."""

    variables: tuple[Expression, ...]
    rates: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """What was seen along both flows from one start, over `time` with Runge-Kutta steps of order 4.

    `difference` is the largest of |q_H - q| over all positions, `constraint` the largest of the
    constraints' images along the flow of H, `energy` the largest change of H.
    """

    time: float
    step: float
    parameters: Mapping[str, float]
    functions: Mapping[str, Expression]
    start: Mapping[str, float]
    difference: float
    constraint: float
    energy: float


def sample_functions(trees: Sequence[Expression], seed: int = 1) -> Definitions:
    """A polynomial for each arbitrary function that occurs, over symbols of its own."""
    source = random.Random(f"functions {seed}")
    found: dict[str, tuple[tuple[str, ...], Expression]] = {}
    for node in (node for tree in trees for node in walk(tree)):
        if isinstance(node, Arbitrary) and node.name not in found:
            arguments = tuple(f"argument_{k}" for k in range(len(node.arguments)))
            terms: list[Expression] = [number(Fraction(source.randrange(6, 14), 10))]
            for argument in map(Symbol, arguments):
                terms.append(Fraction(source.randrange(2, 9), 10) * argument)
                terms.append(Fraction(source.randrange(1, 5), 10) * argument**2)
            found[node.name] = (arguments, add(*terms))
    return found


def numerical(trees: Sequence[Expression], variables: Sequence[Expression]) -> Callable[[State], State]:
    """The trees as one function of the state; InputError for a name that is not among the variables."""
    places: dict[Expression, int] = {}
    steps: list[Callable[[list[float]], float]] = []
    for tree in trees:
        for node in reversed(list(walk(tree))):  # parts before what they are parts of
            if node not in places and node not in variables:
                steps.append(_step(node, places, variables))
                places[node] = len(variables) + len(steps) - 1
    wanted = [variables.index(tree) if tree in variables else places[tree] for tree in trees]

    def function(state: State) -> State:
        values = state.tolist()
        for step in steps:
            values.append(step(values))
        return np.array([values[place] for place in wanted])

    return function


def _step(
    node: Expression, places: Mapping[Expression, int], variables: Sequence[Expression]
) -> Callable[[list[float]], float]:
    """The value of a node from those before it."""

    def place(part: Expression) -> int:
        return variables.index(part) if part in variables else places[part]

    match node:
        case Number(value):
            constant = float(value)
            return lambda values: constant
        case Sum(terms):
            parts = [place(term) for term in terms]
            return lambda values: math.fsum(values[k] for k in parts)
        case Product(factors):
            parts = [place(factor) for factor in factors]
            return lambda values: math.prod(values[k] for k in parts)
        case Power(base, exponent):
            below, above = place(base), place(exponent)
            return lambda values: math.pow(values[below], values[above])
        case Apply(name, argument) if name in _FUNCTIONS:
            function, inner = _FUNCTIONS[name], place(argument)
            return lambda values: function(values[inner])
        case _ if node == PI:
            return lambda values: math.pi
    raise InputError(f"{to_text(node)} has no value in floats.")


def integrated(flow: Flow, start: State) -> list[State]:
    """The states at 0, h, 2h, … by Runge-Kutta steps of order 4; ArithmeticError where the flow leaves its domain."""
    slope = numerical(flow.rates, flow.variables)
    states = [start]
    for _ in range(STEPS):
        state = states[-1]
        first = slope(state)
        second = slope(state + STEP / 2 * first)
        third = slope(state + STEP / 2 * second)
        states.append(state + STEP / 6 * (first + 2 * second + 2 * third + slope(state + STEP * third)))
        if not (np.abs(states[-1]) < _LARGE).all():
            raise OverflowError("the motion leaves every bound")
    return states


def compare(
    nonholonomic: Flow,
    hamiltonian: Flow,
    momenta: Sequence[Expression],
    observed: Sequence[Expression],
    constants: Sequence[Symbol],
    seed: int = 1,
) -> Comparison | None:
    """Both flows from the same random point of the constraints; None where no start was found.

    `nonholonomic` is a flow of (q, u), `hamiltonian` one of (q, p) with the same q first; `momenta`
    are p over (q, u); `observed` are H and the constraints' images over (q, p).
    """
    trees = [*nonholonomic.rates, *hamiltonian.rates, *momenta, *observed]
    samples = sample_functions(trees, seed)
    source = random.Random(f"flow {seed}")
    for _ in range(_STARTS):
        values = {name: Fraction(source.randrange(50, 200), 100) for name in constants}
        table: dict[Expression, Expression] = {name: number(value) for name, value in values.items()}
        placed = [substitute(define_functions(tree, samples), table) for tree in trees]
        try:
            return _compared(nonholonomic, hamiltonian, placed, len(momenta), (values, samples), source)
        except (ArithmeticError, ValueError, RuntimeError, InputError):
            continue
    return None


def _compared(
    nonholonomic: Flow,
    hamiltonian: Flow,
    placed: Sequence[Expression],
    count: int,
    chosen: tuple[Mapping[Symbol, Fraction], Definitions],
    source: random.Random,
) -> Comparison:
    m, n = len(nonholonomic.rates), len(hamiltonian.rates)
    first = Flow(nonholonomic.variables, tuple(placed[:m]))
    second = Flow(hamiltonian.variables, tuple(placed[m : m + n]))
    start = np.array([source.randrange(20, 90) / 100 for _ in range(m)])
    lifted = numerical(placed[m + n : m + n + count], first.variables)(start)
    one = np.array(integrated(first, start))
    other = np.array(integrated(second, np.concatenate([start[: n // 2], lifted])))
    observe = numerical(placed[m + n + count :], second.variables)
    observed = np.array([observe(state) for state in other])
    if not np.isfinite(observed).all():
        raise OverflowError("what is observed has no finite value")
    return Comparison(
        time=STEPS * STEP,
        step=STEP,
        parameters={name.name: float(value) for name, value in chosen[0].items()},
        functions={name: body for name, (_, body) in chosen[1].items()},
        start={to_text(variable): float(value) for variable, value in zip(first.variables, start, strict=True)},
        difference=float(np.abs(one[:, : n // 2] - other[:, : n // 2]).max(initial=0.0)),
        constraint=float(np.abs(observed[:, 1:]).max(initial=0.0)),
        energy=float(np.abs(observed[:, 0] - observed[0, 0]).max()),
    )
