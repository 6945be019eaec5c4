"""Lagrangians whose motion on the constraints is the given one, in closed form, by linear algebra.

The Euler-Lagrange expressions of a term at a point of D, with the accelerations of the motion, are linear in its
coefficient. The terms are T and T s', with T a Laurent monomial in the free velocities times a product of functions of
position: l less lambda_a w^a, and lambda_a. Products of two constraints may be added at will: they change the
associated system, not the motion.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import reduce

from inverse_service import bounds
from inverse_service.deadline import OutOfTime, check, until
from inverse_service.decision.analysis import Analysis, analyze
from inverse_service.decision.solutions import Lagrangian
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.tree import (
    TIME,
    ZERO,
    Apply,
    Expression,
    Number,
    Sum,
    Symbol,
    Velocity,
    holds,
    substitute,
)
from inverse_service.field.elementary import to_kernels
from inverse_service.field.exact_atoms import exact_ring
from inverse_service.field.exact_ring import quotient_tree
from inverse_service.field.rational_functions import Budget, TooLarge
from inverse_service.mechanics.nonholonomic.motion import ConstrainedMotion
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search.factors import position_monomials, products
from inverse_service.search.linear_ansatz import solve_ansatz
from inverse_service.search.material import Material, distinct, gather
from inverse_service.search.members import best_members
from inverse_service.search.protocol import describe
from inverse_service.search.sampling import make_sampler
from inverse_service.search.terms import (
    EMPTY,
    Monomial,
    TooManyTerms,
    monomial,
    terms_of,
    times,
    tree_of,
)

# With 4,000 terms the inclined knife edge, which needs v^-3, has none.
_MOST_TERMS, _MOST_PRODUCTS = 6_000, 30_000
# The widest ansatz last: degree in the free velocities that change, lowest and highest power of those that do not,
# letters of position in a product, degree in the coordinates.
_WIDTHS = ((2, -1, 2, 2, 0), (2, -1, 2, 2, 1), (2, -2, 2, 2, 1), (2, -3, 2, 3, 1), (2, -3, 2, 2, 2), (2, -3, 3, 4, 2))


def first_system(motion: ConstrainedMotion) -> SecondOrderSystem:
    """The accelerations of all coordinates, by the free velocities."""
    table = dict(zip(motion.free, motion.free_accelerations, strict=True))
    table |= {name: motion.rate(w) for name, w in zip(motion.dependent, motion.dependent_velocities, strict=True)}
    accelerations = tuple(table[name] for name in motion.coordinates)
    return SecondOrderSystem(motion.coordinates, accelerations, motion.parameters, motion.functions)


def find_lagrangians(motion: ConstrainedMotion, with_time: bool, seed: int, deadline: float) -> list[Lagrangian]:
    """Lagrangians on the whole tangent bundle, simplest first, of the first ansatz that has any within the time."""
    try:
        with until(deadline):
            constrained = {v: to_kernels(w) for v, w in motion.on_constraints.items() if isinstance(v, Velocity)}
            analysis = replace(analyze(_plain(first_system(motion), deadline)), constrained=constrained)
            return _first_found(motion, gather(analysis, with_time), analysis, seed)
    except (IrreducibleAtoms, TooManyTerms, OutOfTime):
        return []


def _plain(system: SecondOrderSystem, deadline: float) -> SecondOrderSystem:
    """The same accelerations over sines and cosines, all relations used: 1/(1 + tan(x)^2) as cos(x)^2."""
    trees = [to_kernels(f) for f in system.accelerations]
    variables: list[Symbol | Velocity] = [TIME, *map(Symbol, system.coordinates), *map(Velocity, system.coordinates)]
    try:
        ring = exact_ring(trees, variables, 0, Budget(bounds.TERMS, deadline), slopes=False)
        return replace(system, accelerations=tuple(quotient_tree(ring, ring.value(tree)) for tree in trees))
    except (TooLarge, ZeroDivisionError):
        return system


def _first_found(motion: ConstrainedMotion, material: Material, analysis: Analysis, seed: int) -> list[Lagrangian]:
    squares = _squares(motion)
    for candidates in _families(motion, material):
        sampler = make_sampler(analysis, [item for key in candidates for item in key])
        space = solve_ansatz(sampler, candidates, seed)
        members = best_members(replace(space, combinations=(*space.combinations, *squares)), seed)
        if members:
            return [describe(analysis, tree_of(member.terms), "along the constraints") for member in members]
    return []


def _squares(motion: ConstrainedMotion) -> list[dict[Monomial, Fraction]]:
    """Half the square of each constraint: a Lagrangian of nothing on the constraints."""
    found = []
    for v, w in motion.on_constraints.items():
        constraint = v - w
        try:
            found.append({key: value / 2 for key, value in terms_of(constraint * constraint).items()})
        except TooManyTerms:
            continue
    return found


def _families(motion: ConstrainedMotion, material: Material) -> Iterator[list[Monomial]]:
    transverse = [EMPTY, *(monomial(Velocity(name)) for name in motion.dependent)]
    before = 0
    for (degree, low, high, letters, coordinates), inverted in itertools.product(_WIDTHS, _inverted(motion)):
        shapes = _shapes(motion, inverted, degree, low, high)
        parts = _functions(motion, material, letters, coordinates)
        check(len(shapes) * len(transverse) + sum(map(len, parts)))
        if len(transverse) * len(shapes) * math.prod(map(len, parts)) > _MOST_PRODUCTS:
            continue
        constants, *others = parts
        reduced = [key for key in distinct(reduce(products, others)) if _is_reduced(key)]
        factors = distinct(products(constants, reduced))
        candidates = distinct(products(transverse, products(shapes, factors)))
        if before <= len(candidates) <= _MOST_TERMS:
            before = len(candidates)
            yield candidates


def _is_reduced(key: Monomial) -> bool:
    """Whether neither sin^2 + cos^2 = 1 nor (u^a)^(1/a) = u makes it a sum of others that are there too."""
    return not any(
        (isinstance(letter, Sum) and e >= 1) or (isinstance(letter, Apply) and letter.function == "sin" and e > 1)
        for letter, e in key
    )


def _shapes(
    motion: ConstrainedMotion, inverted: Sequence[Velocity], degree: int, low: int, high: int
) -> list[Monomial]:
    """Powers low … high of the inverted free velocities, products of the others to a degree."""
    moving = [Velocity(name) for name in motion.free if Velocity(name) not in inverted]
    found = [EMPTY]
    for v in inverted:
        found = [times(key, monomial(v), e) for key in found for e in range(low, high + 1)]
    upper = [
        monomial(*chosen)
        for count in range(degree + 1)
        for chosen in itertools.combinations_with_replacement(moving, count)
    ]
    return products(found, upper)


def _inverted(motion: ConstrainedMotion) -> list[tuple[Velocity, ...]]:
    """Which free velocities may stand in denominators: those that move by themselves, or those that keep their sign."""
    pairs = [(Velocity(name), name, f) for name, f in zip(motion.free, motion.free_accelerations, strict=True)]
    alone = tuple(v for v, name, f in pairs if _is_alone(motion, name, f))
    kept = tuple(v for v, _, f in pairs if collect(substitute(f, {v: ZERO})) == ZERO)
    return list(dict.fromkeys(chosen if len(chosen) < len(pairs) else () for chosen in (alone, kept)))


def _is_alone(motion: ConstrainedMotion, name: str, f: Expression) -> bool:
    """Whether the motion of a coordinate depends on no other."""
    every: list[Expression] = [*map(Symbol, motion.coordinates), *map(Velocity, motion.free)]
    return not holds(f, *(leaf for leaf in every if leaf not in (Symbol(name), Velocity(name))))


def _functions(
    motion: ConstrainedMotion, material: Material, letters: int, coordinates: int
) -> tuple[list[Monomial], list[Monomial], list[Monomial]]:
    """Parameters as f holds them, products of letters of the motion, and of coordinates: to be multiplied."""
    names = [monomial(Symbol(name)) for name in motion.coordinates]
    powers: list[Monomial] = [EMPTY]
    for count in range(1, coordinates + 1):
        for chosen in itertools.combinations_with_replacement(names, count):
            powers.append(reduce(times, chosen))
    constants = [EMPTY, *_constants(motion, material)][:3]
    squares = [times(a, b) for a, b in itertools.combinations_with_replacement(constants, 2)]
    return distinct(squares), position_monomials(material, letters), powers


def _constants(motion: ConstrainedMotion, material: Material) -> list[Monomial]:
    """What each term of f holds of parameters, such as g*sin(alpha)."""
    moving: list[Expression] = [TIME, *map(Symbol, motion.coordinates), *map(Velocity, motion.coordinates)]
    found: list[Monomial] = []
    for terms in material.motion.forces:
        for key in terms:
            part = frozenset(
                (letter, e) for letter, e in key if not isinstance(letter, Number) and not holds(letter, *moving)
            )
            found += [part] if part else []
    return distinct(found)
