"""Two flows integrated side by side in floats: that of H from a point of the constraints, and the nonholonomic one."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from inverse_service.expressions.derivative import differentiate
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
    Velocity,
    add,
    multiply,
    number,
    power,
    rebuild,
    substitute,
    walk,
)

STEPS, STEP = 100, 0.01
_STARTS = 12
_LARGE = 1e6
State = list[float]
_FUNCTIONS: dict[str, Callable[[float], float]] = {
    name: getattr(math, name)
    for name in ("exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "asinh", "acosh")
} | {
    "atanh": math.atanh,
    "cot": lambda u: 1 / math.tan(u),
    "sec": lambda u: 1 / math.cos(u),
    "csc": lambda u: 1 / math.sin(u),
    "coth": lambda u: 1 / math.tanh(u),
    "sech": lambda u: 1 / math.cosh(u),
    "csch": lambda u: 1 / math.sinh(u),
}


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


def sample_functions(trees: Sequence[Expression], seed: int = 1) -> dict[str, tuple[tuple[Symbol, ...], Expression]]:
    """A polynomial for each arbitrary function that occurs, over symbols of its own."""
    source = random.Random(f"functions {seed}")
    found: dict[str, tuple[tuple[Symbol, ...], Expression]] = {}
    for tree in trees:
        for node in _arbitrary(tree):
            if node.name not in found:
                arguments = tuple(Symbol(f"argument_{k}") for k in range(len(node.arguments)))
                terms: list[Expression] = [number(Fraction(source.randrange(6, 14), 10))]
                for argument in arguments:
                    terms.append(multiply(number(Fraction(source.randrange(2, 9), 10)), argument))
                    terms.append(multiply(number(Fraction(source.randrange(1, 5), 10)), power(argument, 2)))
                found[node.name] = (arguments, add(*terms))
    return found


def _arbitrary(tree: Expression) -> list[Arbitrary]:
    return [node for node in walk(tree) if isinstance(node, Arbitrary)]


def with_functions(tree: Expression, table: Mapping[str, tuple[tuple[Symbol, ...], Expression]]) -> Expression:
    """Each arbitrary function replaced by its sample, derivatives by derivatives of the sample."""
    known: dict[Expression, Expression] = {}

    def sampled(part: Expression) -> Expression:
        if part not in known:
            known[part] = _sampled(rebuild(part, sampled), table)
        return known[part]

    return sampled(tree)


def _sampled(node: Expression, table: Mapping[str, tuple[tuple[Symbol, ...], Expression]]) -> Expression:
    if not isinstance(node, Arbitrary) or node.name not in table:
        return node
    arguments, body = table[node.name]
    for argument, order in zip(arguments, node.orders, strict=True):
        for _ in range(order):
            body = differentiate(body, argument)
    return substitute(body, dict(zip(arguments, node.arguments, strict=True)))


@dataclass(slots=True)
class _Tape:
    """Operations in an order in which each finds its operands; equal subtrees stand on it once."""

    places: Mapping[Expression, int]
    known: dict[Expression, int] = field(default_factory=dict)
    operations: list[Callable[[State], float]] = field(default_factory=list)

    def place(self, tree: Expression) -> int:
        """Where the value of the tree is found; KeyError for a name that has no place."""
        if tree in self.places:
            return self.places[tree]
        if tree not in self.known:
            operation = self._operation(tree)
            self.known[tree] = len(self.places) + len(self.operations)
            self.operations.append(operation)
        return self.known[tree]

    def _operation(self, tree: Expression) -> Callable[[State], float]:
        match tree:
            case Number(value):
                constant = float(value)
                return lambda values: constant
            case Sum(terms):
                parts = [self.place(term) for term in terms]
                return lambda values: sum([values[k] for k in parts])
            case Product(factors):
                parts = [self.place(factor) for factor in factors]
                return lambda values: math.prod([values[k] for k in parts])
            case Power(base, Number(value)) if value.denominator == 1:
                inner, whole = self.place(base), int(value)
                return lambda values: values[inner] ** whole
            case Power(base, exponent):
                inner, upper = self.place(base), self.place(exponent)
                return lambda values: math.pow(values[inner], values[upper])
            case Apply(function, argument):
                inner, operation = self.place(argument), _FUNCTIONS[function]
                return lambda values: operation(values[inner])
        if tree == PI:
            return lambda values: math.pi
        raise KeyError(tree)


def compiled(trees: Sequence[Expression], places: Mapping[Expression, int]) -> Callable[[State], State]:
    """The trees as one function of the state; KeyError for a name that is not in `places`."""
    tape = _Tape(places)
    wanted = [tape.place(tree) for tree in trees]

    def values_at(state: State) -> State:
        values = list(state)
        for operation in tape.operations:
            values.append(operation(values))
        return [values[k] for k in wanted]

    return values_at


def integrated(flow: Flow, start: State, steps: int = STEPS, step: float = STEP) -> list[State]:
    """The states at 0, h, 2h, …; ArithmeticError or ValueError where the flow leaves its domain."""
    places = {variable: place for place, variable in enumerate(flow.variables)}
    slope = compiled(flow.rates, places)
    states = [start]
    for _ in range(steps):
        states.append(_runge_kutta(slope, states[-1], step))
        if not all(abs(value) < _LARGE for value in states[-1]):
            raise OverflowError("the motion leaves every bound")
    return states


def _runge_kutta(slope: Callable[[State], State], state: State, step: float) -> State:
    first = slope(state)
    second = slope([x + step / 2 * k for x, k in zip(state, first, strict=True)])
    third = slope([x + step / 2 * k for x, k in zip(state, second, strict=True)])
    fourth = slope([x + step * k for x, k in zip(state, third, strict=True)])
    rows = zip(state, first, second, third, fourth, strict=True)
    return [x + step / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in rows]


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
        placed = [substitute(with_functions(tree, samples), table) for tree in trees]
        try:
            return _compared(nonholonomic, hamiltonian, placed, len(momenta), (values, samples), source)
        except (ArithmeticError, ValueError, TypeError):
            continue
        except KeyError:  # a function that floats do not know
            return None
    return None


def _compared(
    nonholonomic: Flow,
    hamiltonian: Flow,
    placed: Sequence[Expression],
    count: int,
    chosen: tuple[Mapping[Symbol, Fraction], Mapping[str, tuple[tuple[Symbol, ...], Expression]]],
    source: random.Random,
) -> Comparison:
    m, n = len(nonholonomic.rates), len(hamiltonian.rates)
    first = Flow(nonholonomic.variables, tuple(placed[:m]))
    second = Flow(hamiltonian.variables, tuple(placed[m : m + n]))
    start = [source.randrange(20, 90) / 100 for _ in range(m)]
    places = {variable: place for place, variable in enumerate(first.variables)}
    lifted = compiled(placed[m + n : m + n + count], places)(start)
    one = integrated(first, start)
    other = integrated(second, [*start[: n // 2], *lifted])
    spots = {variable: place for place, variable in enumerate(second.variables)}
    observe = compiled(placed[m + n + count :], spots)
    observed = [observe(state) for state in other]
    return Comparison(
        time=STEPS * STEP,
        step=STEP,
        parameters={name.name: float(value) for name, value in chosen[0].items()},
        functions={name: body for name, (_, body) in chosen[1].items()},
        start={_name(variable): value for variable, value in zip(first.variables, start, strict=True)},
        difference=max(abs(a - b) for x, y in zip(one, other, strict=True) for a, b in _positions(x, y, n // 2)),
        constraint=max((abs(image) for _, *images in observed for image in images), default=0.0),
        energy=max(abs(energy - observed[0][0]) for energy, *_ in observed),
    )


def _positions(left: State, right: State, count: int) -> list[tuple[float, float]]:
    return list(zip(left[:count], right[:count], strict=True))


def _name(variable: Expression) -> str:
    return f"{variable.coordinate}'" if isinstance(variable, Velocity) else getattr(variable, "name", "")
