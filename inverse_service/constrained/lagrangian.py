"""A Lagrangian whose flow on the constraints is a nonholonomic motion: its 1-jet there, its own equations, H."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations, count, islice

from inverse_service import bounds
from inverse_service.constrained.hamiltonisation.reduced import reduced_system
from inverse_service.deadline import OutOfTime, check, left, now, until
from inverse_service.decision.solutions import Lagrangian, SolveOptions
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    TIME,
    ZERO,
    Arbitrary,
    Expression,
    Number,
    Sum,
    Symbol,
    Velocity,
    add,
    substitute,
    walk,
)
from inverse_service.field.exact_atoms import exact_ring
from inverse_service.field.exact_ring import factor_trees, quotient_tree
from inverse_service.field.rational_functions import Budget, TooLarge
from inverse_service.mechanics.euler_lagrange import euler_lagrange_sums, hessian
from inverse_service.mechanics.nonholonomic.motion import ConstrainedMotion
from inverse_service.mechanics.quotient_matrices import solve_square
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search.terms import TooManyTerms, terms_of, tree_of
from inverse_service.solving.solving import solve


@dataclass(frozen=True, slots=True)
class JetOnConstraints:
    """L = l + lambda_a (s^a' - w^a) + …: l and the lambda_a along the constraints."""

    on_constraints: Expression
    transverse_momenta: tuple[Expression, ...]


def jet_of(lagrangian: Expression, motion: ConstrainedMotion) -> JetOnConstraints:
    """Of any L on the tangent bundle."""
    rates = motion.on_constraints
    momenta = [differentiate(lagrangian, Velocity(name)) for name in motion.dependent]
    on, *transverse = (_short(substitute(tree, rates)) for tree in (lagrangian, *momenta))
    return JetOnConstraints(on, tuple(transverse))


def _short(tree: Expression) -> Expression:
    try:
        return tree_of(terms_of(tree))
    except TooManyTerms:
        return collect(tree)


def own_system(lagrangian: Expression, motion: ConstrainedMotion, deadline: float) -> SecondOrderSystem | None:
    """The Euler-Lagrange equations of a regular L, solved for the accelerations; None where that is too large."""
    names = motion.coordinates
    matrix = hessian(lagrangian, names)
    right = [-tree for tree in euler_lagrange_sums(lagrangian, names, [ZERO] * len(names))]
    trees = [*right, *(entry for row in matrix for entry in row)]
    variables: list[Symbol | Velocity] = [TIME, *map(Symbol, names), *map(Velocity, names)]
    try:
        ring = exact_ring(trees, variables, 0, Budget(bounds.TERMS, deadline), slopes=False)
        values = [[ring.value(entry) for entry in row] for row in matrix]
        solved = solve_square(values, [ring.value(tree) for tree in right])
        if solved is None:
            return None
        found = tuple(quotient_tree(ring, entry) for entry in solved)
    except (TooLarge, ZeroDivisionError):
        return None
    return SecondOrderSystem(names, found, motion.parameters, motion.functions)


@dataclass(frozen=True, slots=True)
class ClosedFunctions:
    """As many functions R(q) as velocities are free, with R'' = G(R, R') along the motion: this system, and each R."""

    system: SecondOrderSystem
    functions: Mapping[str, Expression]


def closed_coordinates(motion: ConstrainedMotion) -> Iterator[ClosedFunctions]:
    """The free coordinates, if their equations contain no others."""
    system = reduced_system(motion)
    if system is not None:
        yield ClosedFunctions(system, {name: Symbol(name) for name in motion.free})


def closed_functions(motion: ConstrainedMotion, deadline: float) -> Iterator[ClosedFunctions]:
    """Other coordinates of which that holds, or factors of the forces such as x cos(phi) + y sin(phi)."""
    found = dict[str, Expression]({name: Symbol(name) for name in motion.coordinates})
    taken = {*motion.coordinates, *motion.parameters, *dict(motion.functions)}
    with suppress(TooLarge, ZeroDivisionError, OutOfTime), until(deadline):
        for tree in _position_factors(motion, Budget(bounds.TERMS, deadline))[: bounds.FEW]:
            name = next(name for k in count(1) if (name := f"R_{k}") not in taken)
            taken.add(name)
            found[name] = tree
    for chosen in combinations(found, len(motion.free)):
        functions, system = {name: found[name] for name in chosen}, None
        with suppress(TooLarge, ZeroDivisionError, OutOfTime), until(deadline):
            check()
            system = _system_of(motion, functions, Budget(bounds.TERMS, deadline))
        if system is not None and chosen != motion.free:
            yield ClosedFunctions(system, functions)


def _position_factors(motion: ConstrainedMotion, budget: Budget) -> list[Expression]:
    """What the parts of the forces of each degree in the velocities are products of, if it is a sum."""
    velocities = [Velocity(name) for name in motion.free]
    still: dict[Expression, Expression] = dict.fromkeys(velocities, ZERO)
    slopes = [differentiate(f, v) for f in motion.free_accelerations for v in velocities]
    trees = [substitute(f, still) for f in (*motion.free_accelerations, *slopes)]
    ring = exact_ring(trees, [Symbol(name) for name in motion.coordinates], 0, budget, slopes=False)
    values = [value for tree in trees if not (value := ring.value(tree)).is_zero]
    factors = dict.fromkeys(part for value in values for part in factor_trees(ring, value))
    return [part for part in factors if isinstance(part, Sum) and _solved_for(part, motion.coordinates)]


def _solved_for(tree: Expression, names: Sequence[str]) -> str | None:
    """A coordinate in which the tree is linear."""
    for name in names:
        slope = differentiate(tree, Symbol(name))
        if slope != ZERO and Symbol(name) not in walk(slope):
            return name
    return None


def _system_of(
    motion: ConstrainedMotion, functions: Mapping[str, Expression], budget: Budget
) -> SecondOrderSystem | None:
    """R'' = G(R, R') for R at the place of coordinates; None where G contains others."""
    table: dict[Expression, Expression] = {}
    others = [name for name in motion.coordinates if name not in functions]
    for name, tree in functions.items():
        if name not in motion.coordinates:
            solved = _solved_for(tree, others)
            if solved is None:
                return None
            others.remove(solved)
            rest = substitute(tree, {Symbol(solved): ZERO})
            table[Symbol(solved)] = (Symbol(name) - rest) / differentiate(tree, Symbol(solved))
    rates = [motion.rate(tree) for tree in functions.values()]
    speeds = _free_velocities(motion, rates, list(functions), budget)
    if speeds is None:
        return None
    forces = [substitute(substitute(motion.rate(rate), speeds), table) for rate in rates]
    return _without(motion, others, list(functions), forces, budget)


def _free_velocities(
    motion: ConstrainedMotion, rates: Sequence[Expression], names: Sequence[str], budget: Budget
) -> dict[Expression, Expression] | None:
    """The free velocities by those of the functions; None where these do not fix them."""
    free: list[Symbol | Velocity] = [Velocity(name) for name in motion.free]
    matrix = [[differentiate(rate, u) for u in free] for rate in rates]
    still: dict[Expression, Expression] = dict.fromkeys(free, ZERO)
    right = [Velocity(name) - substitute(rate, still) for name, rate in zip(names, rates, strict=True)]
    trees = [*right, *(entry for row in matrix for entry in row)]
    ring = exact_ring(trees, [Symbol(name) for name in motion.coordinates], 0, budget, slopes=False)
    solved = solve_square([[ring.value(e) for e in row] for row in matrix], [ring.value(tree) for tree in right])
    return None if solved is None else {u: quotient_tree(ring, e) for u, e in zip(free, solved, strict=True)}


def _without(
    motion: ConstrainedMotion, others: Sequence[str], names: Sequence[str], forces: Sequence[Expression], budget: Budget
) -> SecondOrderSystem | None:
    """The system, if its forces depend on no other coordinate."""
    ring = exact_ring(forces, [Symbol(name) for name in others], 1, budget)
    values = [ring.value(force) for force in forces]
    if not all(ring.partial(place)(value).is_zero for place in range(len(others)) for value in values):
        return None
    nowhere: dict[Expression, Expression] = {Symbol(name): ZERO for name in others}
    plain = tuple(substitute(quotient_tree(ring, value), nowhere) for value in values)
    held = {node.name for tree in plain for node in walk(tree) if isinstance(node, Arbitrary)}
    kept = tuple(function for function in motion.functions if function[0] in held)
    return SecondOrderSystem(tuple(names), plain, motion.parameters, kept)


def lagrangian_of_closed(
    motion: ConstrainedMotion, closed: Iterable[ClosedFunctions], with_time: bool, seed: int, time_limit: float
) -> Lagrangian | None:
    """That of R'' = G(R, R'), with half the squares of the constraints: its equations hold wherever R follows its own.

    l(R, R') with lambda = 0 solves the equations along the constraints where R are coordinates that are free. None
    where none of the first few has one in closed form.
    """
    end = now() + time_limit
    for one in islice(closed, bounds.FEW):
        solution = solve(one.system, SolveOptions(with_time, seed, max(left(end), 0.1), conditions=False))
        answer = solution.with_time if with_time else solution.autonomous
        if answer is not None and answer.lagrangian is not None:
            return on_whole_motion(motion, one, answer.lagrangian)
    return None


def on_whole_motion(motion: ConstrainedMotion, closed: ClosedFunctions, lagrangian: Lagrangian) -> Lagrangian:
    """L(R, R') with half the squares of the constraints: regular, and its flow keeps the constraints."""
    table: dict[Expression, Expression] = {}
    for name, tree in closed.functions.items():
        slopes = [differentiate(tree, Symbol(q)) * Velocity(q) for q in motion.coordinates]
        table |= {Symbol(name): tree, Velocity(name): add(*slopes)}
    pairs = zip(motion.dependent, motion.dependent_velocities, strict=True)
    squares = [(Velocity(name) - w) ** Fraction(2) for name, w in pairs]
    half = Number(Fraction(1, 2))
    whole = add(substitute(lagrangian.expression, table), *(half * square for square in squares))
    return replace(
        lagrangian,
        expression=whole,
        multiplier=hessian(whole, motion.coordinates),
        nonzero=tuple(substitute(tree, table) for tree in lagrangian.nonzero),
        positive=tuple(substitute(tree, table) for tree in lagrangian.positive),
    )
