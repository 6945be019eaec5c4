"""Whether expressions vanish identically: their values at random points modulo primes, all relations kept.

From a free Lagrangian of an associated system to its Hamiltonian, with proof that it holds the motion.

The claim: the flow of H~, restricted to the image of the constraints under p = dL~/dv, is the
nonholonomic motion. It is taken apart into identities; each is tested at random points modulo primes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from flint import nmod_mat

from inverse_service import bounds
from inverse_service.constrained.hamiltonisation.restricted_flow import Comparison, Flow, compare
from inverse_service.errors import InputError, IrreducibleAtoms
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    TIME,
    Expression,
    Number,
    Product,
    Symbol,
    Velocity,
    add,
    multiply,
    substitute,
    walk,
)
from inverse_service.field.elementary import to_kernels
from inverse_service.field.point import Point, Variable, evaluate
from inverse_service.field.real_point import find_real_point
from inverse_service.field.reduction import reduce_atoms
from inverse_service.field.tower import draw_point
from inverse_service.field.truncated_series import SingularPoint
from inverse_service.mechanics.euler_lagrange import euler_lagrange_sums
from inverse_service.mechanics.legendre.on_constraints import constraint_images
from inverse_service.mechanics.legendre.transform import LegendreTransform, legendre
from inverse_service.mechanics.nonholonomic.motion import EquationsOfMotion
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.mechanics.writing import tidied


def values_modulo_primes(
    expressions: Sequence[Expression], variables: Sequence[Variable], points: int = 2, seed: int = 1
) -> list[tuple[Point, list[int]]] | None:
    """The residues of all expressions at `points` random points, each over a prime of its own.

    None where the relations among their functions cannot be settled or no point is found.
    """
    kernels = [to_kernels(expression) for expression in expressions]
    try:
        table = find_real_point(kernels, variables, seed)
        tower = reduce_atoms(kernels, variables, table)
        found = []
        for attempt in range(bounds.ATTEMPTS):
            point = draw_point(tower, seed * bounds.ATTEMPTS + attempt)
            known: dict[Expression, int] = {}
            try:
                found.append((point, [evaluate(kernel, point, known) for kernel in kernels]))
            except (SingularPoint, ValueError, ZeroDivisionError, KeyError):
                continue
            if len(found) == points:
                return found
    except (IrreducibleAtoms, KeyError):
        return None
    return None


def vanish(expressions: Sequence[Expression], variables: Sequence[Variable], seed: int = 1) -> bool | None:
    """True where all vanish at two points, False where one does not, None where it was not settled.

    A nonzero rational function of degree d vanishes at a random point with probability about d/2^61.
    """
    if not expressions:
        return True
    found = values_modulo_primes(expressions, variables, 2, seed)
    return None if found is None else all(not any(values) for _, values in found)


def rank_at_point(matrix: Sequence[Sequence[Expression]], variables: Sequence[Variable], seed: int = 1) -> int | None:
    """The rank of a matrix of expressions at a random point, which is its generic rank (almost surely)."""
    flat = [entry for row in matrix for entry in row]
    if not flat:
        return 0
    found = values_modulo_primes(flat, variables, 1, seed)
    if found is None:
        return None
    ((point, values),) = found
    return int(nmod_mat(len(matrix), len(matrix[0]), values, point.prime).rank())


Verdict = Literal["holds", "fails", "not settled"]


@dataclass(frozen=True, slots=True)
class Statement:
    """One part of the claim, formulas of the theory between grave accents, and what the test said."""

    text: str
    verdict: Verdict


@dataclass(frozen=True, slots=True)
class Hamiltonisation:
    """H~ and the images of the constraints, the parts of the claim, and both flows side by side.

    `transform` is None where L~ is degenerate; `comparison` is None where H~ has no closed form, t
    occurs, or no start was found.
    """

    lagrangian: Expression
    transform: LegendreTransform | None
    images: tuple[Expression, ...]
    statements: tuple[Statement, ...]
    comparison: Comparison | None

    @property
    def holds(self) -> bool:
        """Whether every statement was confirmed."""
        return bool(self.statements) and all(statement.verdict == "holds" for statement in self.statements)


def hamiltonise(
    motion: EquationsOfMotion,
    associated: SecondOrderSystem,
    lagrangian: Expression,
    seed: int = 1,
    known: LegendreTransform | None = None,
    known_images: Sequence[Expression] = (),
) -> Hamiltonisation:
    """The report for one Lagrangian of one associated system.

    `known` is its Legendre transform where that is known, `known_images` are the constraints in phase
    space; both are tested like everything else.
    """
    names = associated.coordinates
    try:
        transform = known or legendre(lagrangian, names)
    except InputError:
        return Hamiltonisation(lagrangian, None, (), (), None)
    images = tuple(known_images) or tuple(
        without_constants(tidied(image)) for image in constraint_images(motion.system.constraints, transform, names)
    )
    work = _Work(motion, associated, lagrangian, transform, images, seed)
    statements = [work.restriction(), work.euler_lagrange()]
    if transform.implicit or transform.velocities is None:
        return Hamiltonisation(lagrangian, transform, images, tuple(statements), None)
    statements += [work.canonical(), work.image(), work.invariance()]
    return Hamiltonisation(lagrangian, transform, images, tuple(statements), work.comparison())


def without_constants(tree: Expression) -> Expression:
    """The tree without number factors."""
    if not isinstance(tree, Product):
        return tree
    return multiply(*(factor for factor in tree.factors if not isinstance(factor, Number)))


@dataclass(frozen=True, slots=True)
class _Work:
    motion: EquationsOfMotion
    associated: SecondOrderSystem
    lagrangian: Expression
    transform: LegendreTransform
    images: tuple[Expression, ...]
    seed: int

    @property
    def names(self) -> tuple[str, ...]:
        return self.associated.coordinates

    @property
    def variables(self) -> list[Symbol | Velocity]:
        """t, q, v and the parameters."""
        found: list[Symbol | Velocity] = [TIME, *map(Symbol, self.names), *map(Velocity, self.names)]
        return [*found, *map(Symbol, self.associated.parameters)]

    @property
    def lifted(self) -> dict[Expression, Expression]:
        """Each momentum as a function of (q, v)."""
        return dict(zip(self.transform.symbols, self.transform.momenta, strict=True))

    def _tested(self, text: str, trees: Sequence[Expression]) -> Statement:
        found = vanish(trees, self.variables, self.seed)
        return Statement(text, "not settled" if found is None else "holds" if found else "fails")

    def restriction(self) -> Statement:
        """f on the constraints is the nonholonomic acceleration."""
        pairs = zip(self.associated.accelerations, self.motion.accelerations, strict=True)
        trees = [substitute(f, self.motion.on_constraints) - a for f, a in pairs]
        return self._tested("On the constraints the associated system has the accelerations of the motion.", trees)

    def euler_lagrange(self) -> Statement:
        trees = euler_lagrange_sums(self.lagrangian, self.names, self.associated.accelerations)
        return self._tested("The Euler-Lagrange equations of L hold along the associated system.", trees)

    def canonical(self) -> Statement:
        """dH/dp = v and dH/dq = -dL/dq at p = dL/dv."""
        h = self.transform.hamiltonian
        trees = []
        for name, symbol in zip(self.names, self.transform.symbols, strict=True):
            trees.append(substitute(differentiate(h, symbol), self.lifted) - Velocity(name))
            slope = differentiate(self.lagrangian, Symbol(name))
            trees.append(substitute(differentiate(h, Symbol(name)), self.lifted) + slope)
        return self._tested(
            "With `p = dL/dv` the canonical equations of H are the Euler-Lagrange equations of L.", trees
        )

    def image(self) -> Statement:
        """The images vanish on the image of the constraints and are independent there."""
        text = "The constraints in phase space are the image of the constraints, and independent."
        trees = [self._restricted(tree) for tree in self.images]
        tested = self._tested(text, trees)
        if tested.verdict != "holds":
            return tested
        slopes = [[self._restricted(differentiate(tree, p)) for p in self.transform.symbols] for tree in self.images]
        rank = rank_at_point(slopes, self.variables, self.seed)
        if rank is None:
            return Statement(text, "not settled")
        return Statement(text, "holds" if rank == len(self.images) else "fails")

    def _restricted(self, tree: Expression) -> Expression:
        """A function of (q, p) at p = dL/dv on the constraints, over (q, u)."""
        return substitute(substitute(tree, self.lifted), self.motion.on_constraints)

    def invariance(self) -> Statement:
        """{P, H} = 0 on the submanifold."""
        h = self.transform.hamiltonian
        trees = []
        for image in self.images:
            terms = [differentiate(image, TIME)]
            for name, p in zip(self.names, self.transform.symbols, strict=True):
                q = Symbol(name)
                terms.append(differentiate(image, q) * differentiate(h, p))
                terms.append(-(differentiate(image, p) * differentiate(h, q)))
            trees.append(self._restricted(add(*terms)))
        return self._tested("The flow of H keeps the constraints in phase space.", trees)

    def comparison(self) -> Comparison | None:
        """Both flows in floats from one start."""
        if any(node == TIME for f in (*self.motion.accelerations, self.lagrangian) for node in walk(f)):
            return None
        positions = tuple(map(Symbol, self.names))
        rates = [self.motion.on_constraints.get(Velocity(name), Velocity(name)) for name in self.names]
        speeds = tuple(map(Velocity, self.motion.free))
        first = Flow((*positions, *speeds), (*rates, *self.motion.free_accelerations))
        h, symbols = self.transform.hamiltonian, self.transform.symbols
        forward = [differentiate(h, p) for p in symbols]
        backward = [-differentiate(h, q) for q in positions]
        second = Flow((*positions, *symbols), (*forward, *backward))
        momenta = [substitute(p, self.motion.on_constraints) for p in self.transform.momenta]
        constants = [Symbol(name) for name in self.associated.parameters]
        return compare(first, second, momenta, [h, *self.images], constants, self.seed)
