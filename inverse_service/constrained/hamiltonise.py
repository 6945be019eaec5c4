"""From a free Lagrangian of an associated system to its Hamiltonian, with a proof that its flow
contains the motion.

The claim: the flow of H~, restricted to the image of the constraints under p = dL~/dv, is the
nonholonomic motion. It consists of identities, each tested at random points modulo primes.
`compare` integrates both flows in floating point as an illustration.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from inverse_service import errors
from inverse_service.expressions import arrays, calculus, printing, tree as ex
from inverse_service.field import real_branch
from inverse_service.mechanics import constrained_motion, second_order_system, writing
from inverse_service.mechanics.euler_lagrange import euler_lagrange_sums
from inverse_service.mechanics.legendre import LegendreTransform, constraint_images, legendre

Verdict = Literal["holds", "fails", "not settled"]

STEPS, STEP = 100, 0.01
_STARTS = 12
_LARGE = 1e6
State = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Identity:
    """One part of the claim, with formulas of the theory between grave accents, and the test
    result.
    """

    text: str
    verdict: Verdict


@dataclass(frozen=True, slots=True)
class Hamiltonisation:
    """H~ and the images of the constraints, the parts of the claim, and a comparison of both flows.

    `transform` is None if L~ is degenerate; `comparison` is None if H~ has no closed form, t
    occurs, or no start was found.
    """

    lagrangian: ex.Expression
    transform: LegendreTransform | None
    images: tuple[ex.Expression, ...]
    statements: tuple[Identity, ...]
    comparison: Comparison | None

    @property
    def holds(self) -> bool:
        """Whether every statement was confirmed."""
        return bool(self.statements) and all(
            statement.verdict == "holds" for statement in self.statements
        )


def hamiltonise(
    motion: constrained_motion.EquationsOfMotion,
    associated: second_order_system.SecondOrderSystem,
    lagrangian: ex.Expression,
    seed: int = 1,
    known: LegendreTransform | None = None,
    known_images: Sequence[ex.Expression] = (),
) -> Hamiltonisation:
    """The report for one Lagrangian of one associated system.

    `known` is its Legendre transform if available, `known_images` are the constraints in phase
    space; both are tested like everything else.
    """
    names = associated.coordinates
    try:
        transform = known or legendre(lagrangian, names)
    except errors.InputError:
        return Hamiltonisation(lagrangian, None, (), (), None)
    images = tuple(known_images) or tuple(
        without_constants(writing.as_one_quotient(image))
        for image in constraint_images(motion.system.constraints, transform, names)
    )
    work = _Work(motion, associated, lagrangian, transform, images, seed)
    statements = [work.restriction(), work.euler_lagrange()]
    if transform.implicit or transform.velocities is None:
        return Hamiltonisation(lagrangian, transform, images, tuple(statements), None)
    statements += [work.canonical(), work.image(), work.invariance()]
    return Hamiltonisation(lagrangian, transform, images, tuple(statements), work.comparison())


def without_constants(tree: ex.Expression) -> ex.Expression:
    """The tree without number factors."""
    if not isinstance(tree, ex.Product):
        return tree
    return ex.multiply(*(factor for factor in tree.factors if not isinstance(factor, ex.Number)))


@dataclass(frozen=True, slots=True)
class _Work:
    motion: constrained_motion.EquationsOfMotion
    associated: second_order_system.SecondOrderSystem
    lagrangian: ex.Expression
    transform: LegendreTransform
    images: tuple[ex.Expression, ...]
    seed: int

    @property
    def names(self) -> tuple[str, ...]:
        return self.associated.coordinates

    @property
    def variables(self) -> list[ex.Symbol | ex.Velocity]:
        """t, q, v, and the parameters."""
        return [*self.associated.variables, *map(ex.Symbol, self.associated.parameters)]

    @property
    def lifted(self) -> dict[ex.Expression, ex.Expression]:
        """Each momentum as a function of (q, v)."""
        return dict(zip(self.transform.symbols, self.transform.momenta, strict=True))

    def _tested(self, text: str, trees: Sequence[ex.Expression]) -> Identity:
        found = real_branch.vanish(trees, self.variables, self.seed)
        return Identity(text, "not settled" if found is None else "holds" if found else "fails")

    def restriction(self) -> Identity:
        """f on the constraints is the nonholonomic acceleration."""
        pairs = zip(self.associated.accelerations, self.motion.accelerations, strict=True)
        trees = [ex.substitute(f, self.motion.on_constraints) - a for f, a in pairs]
        return self._tested(
            "On the constraints the associated system has the accelerations of the motion.", trees
        )

    def euler_lagrange(self) -> Identity:
        trees = euler_lagrange_sums(self.lagrangian, self.names, self.associated.accelerations)
        return self._tested(
            "The Euler-Lagrange equations of L hold along the associated system.", trees
        )

    def canonical(self) -> Identity:
        """dH/dp = v and dH/dq = -dL/dq at p = dL/dv."""
        h = self.transform.hamiltonian
        trees = []
        for name, symbol in zip(self.names, self.transform.symbols, strict=True):
            trees.append(
                ex.substitute(calculus.differentiate(h, symbol), self.lifted) - ex.Velocity(name)
            )
            slope = calculus.differentiate(self.lagrangian, ex.Symbol(name))
            trees.append(
                ex.substitute(calculus.differentiate(h, ex.Symbol(name)), self.lifted) + slope
            )
        return self._tested(
            "With `p = dL/dv` the canonical equations of H are the Euler-Lagrange equations of L.",
            trees,
        )

    def image(self) -> Identity:
        """The images vanish on the image of the constraints and are independent there."""
        text = "The constraints in phase space are the image of the constraints, and independent."
        trees = [self._restricted(tree) for tree in self.images]
        tested = self._tested(text, trees)
        if tested.verdict != "holds":
            return tested
        slopes = [
            [self._restricted(calculus.differentiate(tree, p)) for p in self.transform.symbols]
            for tree in self.images
        ]
        rank = real_branch.rank_at_point(slopes, self.variables, self.seed)
        if rank is None:
            return Identity(text, "not settled")
        return Identity(text, "holds" if rank == len(self.images) else "fails")

    def _restricted(self, tree: ex.Expression) -> ex.Expression:
        """A function of (q, p) at p = dL/dv on the constraints, over (q, u)."""
        return ex.substitute(ex.substitute(tree, self.lifted), self.motion.on_constraints)

    def invariance(self) -> Identity:
        """{P, H} = 0 on the submanifold."""
        trees = [
            self._restricted(calculus.time_derivative(image, self._canonical_rates()))
            for image in self.images
        ]
        return self._tested("The flow of H keeps the constraints in phase space.", trees)

    def _canonical_rates(self) -> list[tuple[ex.Expression, ex.Expression]]:
        """q' = dH/dp, p' = -dH/dq."""
        h, pairs = (
            self.transform.hamiltonian,
            list(zip(map(ex.Symbol, self.names), self.transform.symbols, strict=True)),
        )
        forward = [(q, calculus.differentiate(h, p)) for q, p in pairs]
        return [*forward, *((p, -calculus.differentiate(h, q)) for q, p in pairs)]

    def comparison(self) -> Comparison | None:
        """Both flows in floating point from one start."""
        if any(
            node == ex.TIME
            for f in (*self.motion.accelerations, self.lagrangian)
            for node in ex.walk(f)
        ):
            return None
        positions = tuple(map(ex.Symbol, self.names))
        rates = [
            self.motion.on_constraints.get(ex.Velocity(name), ex.Velocity(name))
            for name in self.names
        ]
        speeds = tuple(map(ex.Velocity, self.motion.free))
        first = Flow((*positions, *speeds), (*rates, *self.motion.free_accelerations))
        second = Flow(*zip(*self._canonical_rates(), strict=True))
        momenta = [ex.substitute(p, self.motion.on_constraints) for p in self.transform.momenta]
        constants = [ex.Symbol(name) for name in self.associated.parameters]
        return compare(
            first, second, momenta, [self.transform.hamiltonian, *self.images], constants, self.seed
        )


@dataclass(frozen=True, slots=True)
class Flow:
    """x' = rates(x) for the variables in this order; no other names may occur in the rates."""

    variables: tuple[ex.Expression, ...]
    rates: tuple[ex.Expression, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """The differences along both flows from one start, over `time`, with Runge-Kutta steps of order
    4.

    `difference` is the largest of |q_H - q| over all positions, `constraint` the largest of the
    constraints' images along the flow of H, `energy` the largest change of H.
    """

    time: float
    step: float
    parameters: Mapping[str, float]
    functions: Mapping[str, ex.Expression]
    start: Mapping[str, float]
    difference: float
    constraint: float
    energy: float


def sample_functions(trees: Sequence[ex.Expression], seed: int = 1) -> calculus.Definitions:
    """A polynomial, over separate symbols, for each arbitrary function that occurs."""
    source = random.Random(f"functions {seed}")
    found: dict[str, tuple[tuple[str, ...], ex.Expression]] = {}
    for node in (node for tree in trees for node in ex.walk(tree)):
        if isinstance(node, ex.Arbitrary) and node.name not in found:
            arguments = tuple(f"argument_{k}" for k in range(len(node.arguments)))
            terms: list[ex.Expression] = [ex.number(Fraction(source.randrange(6, 14), 10))]
            for argument in map(ex.Symbol, arguments):
                terms.append(Fraction(source.randrange(2, 9), 10) * argument)
                terms.append(Fraction(source.randrange(1, 5), 10) * argument**2)
            found[node.name] = (arguments, ex.add(*terms))
    return found


def integrated(flow: Flow, start: State) -> list[State]:
    """The states at 0, h, 2h, … by Runge-Kutta steps of order 4; ArithmeticError if the flow leaves
    its domain.
    """
    rates = arrays.function_of(flow.rates, flow.variables)

    def slope(state: State) -> State:
        return np.array(rates(state.tolist()))

    states = [start]
    for _ in range(STEPS):
        state = states[-1]
        first = slope(state)
        second = slope(state + STEP / 2 * first)
        third = slope(state + STEP / 2 * second)
        states.append(
            state + STEP / 6 * (first + 2 * second + 2 * third + slope(state + STEP * third))
        )
        if not (np.abs(states[-1]) < _LARGE).all():
            raise OverflowError("the motion leaves every bound")
    return states


def compare(
    nonholonomic: Flow,
    hamiltonian: Flow,
    momenta: Sequence[ex.Expression],
    observed: Sequence[ex.Expression],
    constants: Sequence[ex.Symbol],
    seed: int = 1,
) -> Comparison | None:
    """Compare both flows from the same random point of the constraints; None if no start was found.

    `nonholonomic` is a flow of (q, u), `hamiltonian` a flow of (q, p) with the same q first;
    `momenta` are p as functions of (q, u); `observed` are H and the constraints' images as
    functions of (q, p).
    """
    trees = [*nonholonomic.rates, *hamiltonian.rates, *momenta, *observed]
    samples, source = sample_functions(trees, seed), random.Random(f"flow {seed}")
    m, n, count = len(nonholonomic.rates), len(hamiltonian.rates), len(momenta)
    for _ in range(_STARTS):
        values = {name: Fraction(source.randrange(50, 200), 100) for name in constants}
        table = {name: ex.number(value) for name, value in values.items()}
        placed = [ex.substitute(calculus.define_functions(tree, samples), table) for tree in trees]
        first = Flow(nonholonomic.variables, tuple(placed[:m]))
        second = Flow(hamiltonian.variables, tuple(placed[m : m + n]))
        start = np.array([source.randrange(20, 90) / 100 for _ in range(m)])
        try:
            lifted = arrays.function_of(placed[m + n : m + n + count], first.variables)(
                start.tolist()
            )
            one = np.array(integrated(first, start))
            other = np.array(integrated(second, np.concatenate([start[: n // 2], lifted])))
            watched = arrays.function_of(placed[m + n + count :], second.variables)
            seen = np.array([watched(state) for state in other.tolist()])
        except (ArithmeticError, ValueError, RuntimeError, errors.InputError):
            continue
        if np.isfinite(seen).all():
            return Comparison(
                time=STEPS * STEP,
                step=STEP,
                parameters={name.name: float(value) for name, value in values.items()},
                functions={name: body for name, (_, body) in samples.items()},
                start={
                    printing.to_text(x): float(value)
                    for x, value in zip(first.variables, start, strict=True)
                },
                difference=float(np.abs(one[:, : n // 2] - other[:, : n // 2]).max(initial=0.0)),
                constraint=float(np.abs(seen[:, 1:]).max(initial=0.0)),
                energy=float(np.abs(seen[:, 0] - seen[0, 0]).max()),
            )
    return None
