"""A Lagrangian whose flow on the constraints is a nonholonomic motion: its 1-jet there, its own equations, H."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.exact_ring import quotient_tree
from inverse_service.algebra.rational_functions import Budget, TooLarge
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    TIME,
    ZERO,
    Expression,
    Number,
    Symbol,
    Velocity,
    add,
    multiply,
    negate,
    power,
    substitute,
    subtract,
)
from inverse_service.inverse_problem.hamiltonisation.reduced import reduced_system
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.inverse_problem.outcome import Lagrangian
from inverse_service.inverse_problem.search.terms import TooManyTerms, terms_of, tree_of
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.euler_lagrange import euler_lagrange_sums, hessian
from inverse_service.mechanics.nonholonomic.motion import ConstrainedMotion
from inverse_service.mechanics.quotient_matrices import solve_square
from inverse_service.mechanics.second_order_system import SecondOrderSystem

_TERMS = 4_000


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
    right = [negate(tree) for tree in euler_lagrange_sums(lagrangian, names, [ZERO] * len(names))]
    trees = [*right, *(entry for row in matrix for entry in row)]
    variables: list[Symbol | Velocity] = [TIME, *map(Symbol, names), *map(Velocity, names)]
    try:
        ring = exact_ring(trees, variables, 0, Budget(_TERMS, deadline), slopes=False)
        values = [[ring.value(entry) for entry in row] for row in matrix]
        solved = solve_square(values, [ring.value(tree) for tree in right])
        if solved is None:
            return None
        found = tuple(quotient_tree(ring, entry) for entry in solved)
    except (TooLarge, ZeroDivisionError):
        return None
    return SecondOrderSystem(names, found, motion.parameters, motion.functions)


def lagrangian_of_reduced(
    motion: ConstrainedMotion, with_time: bool, seed: int, time_limit: float
) -> Lagrangian | None:
    """That of r'' = F(r, r'), if these are equations of their own, with half the squares of the constraints.

    l(r, r') with lambda = 0 solves the equations along the constraints; None where there is none in closed form.
    """
    system = reduced_system(motion)
    if system is None:
        return None
    solution = solve(system, SolveOptions(with_time, seed, time_limit, conditions=False))
    answer = solution.with_time if with_time else solution.autonomous
    if answer is None or answer.lagrangian is None:
        return None
    pairs = zip(motion.dependent, motion.dependent_velocities, strict=True)
    squares = [power(subtract(Velocity(name), w), Fraction(2)) for name, w in pairs]
    whole = add(answer.lagrangian.expression, *(multiply(Number(Fraction(1, 2)), square) for square in squares))
    return replace(answer.lagrangian, expression=whole, multiplier=hessian(whole, motion.coordinates))
