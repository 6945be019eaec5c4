"""The ladder of ansätze: families of candidate terms, cheapest first."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.expressions.tree import Apply, Expression, Number, Sum, Symbol, Velocity
from inverse_service.inverse_problem.search.integrating import integrating_factor
from inverse_service.inverse_problem.search.material import (
    Material,
    antiderivatives,
    distinct,
    integrating_candidates,
)
from inverse_service.inverse_problem.search.motion import euler_lagrange, split_velocities
from inverse_service.inverse_problem.search.terms import EMPTY, Monomial, TooManyTerms, monomial, rank, times

MOST_CANDIDATES = 1_500
_MOST_FACTORS = 24
HALF = Fraction(1, 2)


@dataclass(frozen=True, slots=True)
class Family:
    """A named ansatz: the terms holding velocities that it tries; potentials are added to all."""

    name: str
    cost: int
    terms: Callable[[Material, "Factors"], list[Monomial]]


@dataclass(frozen=True, slots=True)
class Factors:
    """Functions of position (and time) that may multiply a term: 1, and integrating factors."""

    integrating: tuple[Monomial, ...]


def find_factors(material: Material, seed: int) -> Factors:
    """1 and the integrating factors of the coefficients of f, with their inverses."""
    found: dict[Monomial, None] = {EMPTY: None}
    for c, variable in integrating_candidates(material)[:_MOST_FACTORS]:
        factor = integrating_factor(material, c, variable, seed)
        if factor:
            found[factor] = None
            found[times(EMPTY, factor, -1)] = None
    return Factors(tuple(sorted(found, key=rank)[:_MOST_FACTORS]))


def products(left: Iterable[Monomial], right: Sequence[Monomial]) -> list[Monomial]:
    return [times(a, b) for a in left for b in right]


def pairs(material: Material) -> list[Monomial]:
    """v_i v_j."""
    return [monomial(a, b) for a, b in itertools.combinations_with_replacement(material.motion.velocities, 2)]


def _constant(material: Material, factors: Factors) -> list[Monomial]:
    return products(material.parameter_monomials[:12], pairs(material))


def _integrating(material: Material, factors: Factors) -> list[Monomial]:
    return products(factors.integrating, products(material.parameter_monomials[:4], pairs(material)))


def position_monomials(material: Material, degree: int) -> list[Monomial]:
    """Products of at most `degree` of the letters that depend on position; sums also inverted and rooted."""
    units: list[Monomial] = []
    for letter in material.position_letters:
        exponents = [1, -1, HALF, -HALF] if isinstance(letter, Sum) else [1]
        units += [frozenset([(letter, Fraction(e))]) for e in exponents]
    found = [EMPTY]
    for count in range(1, degree + 1):
        for chosen in itertools.combinations_with_replacement(units, count):
            product = EMPTY
            for unit in chosen:
                product = times(product, unit)
            found.append(product)
    return distinct(found)


def _metric(material: Material, factors: Factors) -> list[Monomial]:
    shapes = products(position_monomials(material, 2), products(material.parameter_monomials[:3], pairs(material)))
    return distinct(shapes)


def _laurent(material: Material, factors: Factors) -> list[Monomial]:
    """phi v_i v_j / v_k with k different from i and j, and phi v_i v_j."""
    velocities = material.motion.velocities
    shapes = [
        times(monomial(a, b), monomial(c), -1)
        for a, b in itertools.combinations_with_replacement(velocities, 2)
        for c in velocities
        if c not in (a, b)
    ]
    roots = [m for m in position_monomials(material, 1) if m]
    shapes_of_factors = distinct([*factors.integrating, *products(roots, factors.integrating), *roots])
    return pairs(material) + products([EMPTY, *shapes_of_factors][:_MOST_FACTORS], shapes)


def _velocity_letters(material: Material, factors: Factors) -> list[Monomial]:
    """Powers and logarithms of the letters of f that hold velocities, alone and times a velocity."""
    shapes = []
    for letter in material.velocity_letters:
        if isinstance(letter, Apply) and letter.function == "exp":
            shapes += [frozenset([(letter, Fraction(e))]) for e in (1, -1)]
            continue
        shapes += [frozenset([(letter, Fraction(e) * HALF)]) for e in (1, -1, 2, -2, 3, -3, 4)]
        shapes.append(monomial(Apply("log", letter)))
    plain = [EMPTY, *(monomial(v) for v in material.motion.velocities)]
    return pairs(material) + products(factors.integrating[:6], products(plain, shapes))


def _separate(material: Material, factors: Factors) -> list[Monomial]:
    """phi times v log v, log v, exp(+-v), v^3, v^4, 1/v, sqrt(v), and quartic products."""
    velocities = material.motion.velocities
    shapes: list[Monomial] = pairs(material)
    for v in velocities:
        log, exp = Apply("log", v), Apply("exp", v)
        shapes += [monomial(v, log), monomial(log), monomial(exp), frozenset([(exp, Fraction(-1))])]
        shapes += [frozenset([(v, Fraction(e))]) for e in (3, 4, -1, -2, HALF, Fraction(3, 2))]
    shapes += [monomial(a, Apply("log", b)) for a, b in itertools.permutations(velocities, 2)]
    shapes += [
        monomial(*chosen)
        for degree in (3, 4)
        for chosen in itertools.combinations_with_replacement(velocities, degree)
        if len(velocities) <= 3
    ]
    return products(factors.integrating[:8], shapes)


FAMILIES = (
    Family("constant multiplier", 1, _constant),
    Family("quadratic with integrating factors", 2, _integrating),
    Family("quadratic in the velocities", 3, _metric),
    Family("Laurent monomials v_i v_j / v_k", 4, _laurent),
    Family("functions of the velocities in f", 5, _velocity_letters),
    Family("separate functions of the velocities", 6, _separate),
)


def with_potentials(material: Material, moving: Sequence[Monomial]) -> list[Monomial]:
    """The terms and what can cancel the velocity-free and linear parts of their Euler-Lagrange expressions."""
    motion = material.motion
    found: dict[Monomial, None] = dict.fromkeys(moving)
    for key in moving:
        try:
            residuals = euler_lagrange(motion, key)
        except TooManyTerms:
            continue
        for i, residual in enumerate(residuals):
            for term in residual:
                for extra in _cancelling(material, term, i):
                    found[extra] = None
        if len(found) > MOST_CANDIDATES:
            break
    ordered = sorted(found, key=rank)
    return [key for key in ordered if _is_admissible(material, key)][:MOST_CANDIDATES]


def _cancelling(material: Material, term: Monomial, i: int) -> list[Monomial]:
    motion = material.motion
    position, moving = split_velocities(term)
    if not moving:
        return antiderivatives(position, motion.coordinates[i])
    if len(moving) == 1:
        ((letter, exponent),) = moving
        if isinstance(letter, Velocity) and exponent == 1:
            j = motion.velocities.index(letter)
            return [
                times(m, monomial(motion.velocities[k]))
                for k, q in ((i, motion.coordinates[j]), (j, motion.coordinates[i]))
                for m in antiderivatives(position, q)
            ]
    return []


def _is_admissible(material: Material, key: Monomial) -> bool:
    """L may contain t only where asked for, and a pure constant is no term."""
    if not key or all(isinstance(letter, Number) for letter, _ in key):
        return False
    return material.motion.with_time or not any(_has_time(letter) for letter, _ in key)


def _has_time(letter: Expression) -> bool:
    from inverse_service.expressions.tree import TIME, walk

    return any(node == TIME for node in walk(letter))


