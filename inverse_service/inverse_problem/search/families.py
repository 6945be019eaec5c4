"""The ladder of ansätze: families of candidate terms, cheapest first."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.expressions.tree import TIME, Apply, Number, Sum, walk
from inverse_service.inverse_problem.search.integrating import integrating_factor
from inverse_service.inverse_problem.search.material import (
    Material,
    antiderivatives,
    distinct,
    integrating_candidates,
)
from inverse_service.inverse_problem.search.motion import euler_lagrange, split_velocities
from inverse_service.inverse_problem.search.terms import EMPTY, Monomial, TooManyTerms, monomial, rank, times

_MOST_SEEDS = 700
_MOST_FACTORS = 24
HALF = Fraction(1, 2)


@dataclass(frozen=True, slots=True)
class Family:
    """A named ansatz: the terms it starts from, and how often what cancels their residuals is added.

    `position_only` adds functions of position of degree <= 2 and nothing that follows from residuals
    but potentials.
    """

    name: str
    cost: int
    seeds: Callable[[Material, Factors], list[Monomial]]
    depth: int = 1
    bound: int = 400


@dataclass(frozen=True, slots=True)
class Factors:
    """Functions of position (and time) that may multiply a term: 1, and integrating factors."""

    integrating: tuple[Monomial, ...]


def find_factors(material: Material, seed: int) -> Factors:
    """1, the integrating factors of the coefficients of f and of each equation together, and inverses."""
    found: dict[Monomial, None] = {EMPTY: None}
    by_equation: dict[int, Monomial] = {}
    for i, c, variable in integrating_candidates(material)[:_MOST_FACTORS]:
        factor = integrating_factor(material, c, variable, seed)
        if factor:
            found[factor] = None
            by_equation[i] = times(by_equation.get(i, EMPTY), factor)
    found.update(dict.fromkeys(by_equation.values()))
    found.update(dict.fromkeys([times(EMPTY, factor, -1) for factor in found]))
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
    """phi v_i v_j / v_k with k different from i and j, and v_i v_j."""
    return pairs(material) + products(_multipliers(material, factors), _quotients(material))


def _quotients(material: Material) -> list[Monomial]:
    """v_i v_j / w with w a velocity or a sum of velocities that is a factor of f."""
    velocities = material.motion.velocities
    return [
        times(monomial(a, b), monomial(c), -1)
        for a, b in itertools.combinations_with_replacement(velocities, 2)
        for c in (*velocities, *material.linear_sums)
        if c not in (a, b)
    ]


def _multipliers(material: Material, factors: Factors) -> list[Monomial]:
    """1, integrating factors, products of letters, as many as leave the ansatz small."""
    roots = position_monomials(material, 2)
    every = distinct([*factors.integrating, *products(position_monomials(material, 1), factors.integrating), *roots])
    room = max(4, _MOST_SEEDS // max(1, len(_quotients(material))))
    chosen = dict.fromkeys([*factors.integrating[: room // 2], *every])
    return list(chosen)[:room]


def _laurent_plain(material: Material, factors: Factors) -> list[Monomial]:
    return pairs(material) + products(factors.integrating[:3], _quotients(material))


def _laurent_double(material: Material, factors: Factors) -> list[Monomial]:
    """phi v_i v_j / v_k and phi v_i v_j v_k / v_l^2."""
    velocities = material.motion.velocities
    shapes = [
        times(monomial(*chosen), monomial(c), -2)
        for chosen in itertools.combinations_with_replacement(velocities, 3)
        for c in velocities
        if c not in chosen
    ]
    return pairs(material) + products(factors.integrating[:3], [*_quotients(material), *shapes])


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
    Family("quadratic, polynomial in the coordinates", 2, _constant, depth=3),
    Family("quadratic with integrating factors", 3, _integrating),
    Family("quadratic in the velocities", 4, _metric, bound=700),
    Family("Laurent monomials v_i v_j / v_k, polynomial in the coordinates", 5, _laurent_plain, depth=3, bound=800),
    Family("Laurent monomials v_i v_j / v_k", 6, _laurent, bound=1_000),
    Family("functions of the velocities in f", 7, _velocity_letters),
    Family("Laurent monomials v_i v_j v_k / v_l^2", 8, _laurent_double, depth=2, bound=800),
    Family("separate functions of the velocities", 9, _separate, bound=600),
)


def candidates(material: Material, family: Family, factors: Factors) -> list[Monomial]:
    """The seeds, and terms whose Euler-Lagrange expressions can cancel those of the terms before.

    A residual T(q) w(v) in equation i is cancelled by B(q) w v_i / v_j with dB/dq_j = T; only the
    velocity shapes of the seeds, 1 and v_k are admitted.
    """
    seeds = [key for key in distinct(family.seeds(material, factors)) if _is_admissible(material, key)]
    if not seeds:
        return []
    shapes = {split_velocities(key)[1] for key in seeds} | {EMPTY}
    shapes |= {monomial(v) for v in material.motion.velocities}
    found = dict.fromkeys(seeds)
    bound = max(family.bound, 2 * len(seeds))
    fresh = seeds
    for _ in range(family.depth):
        added: dict[Monomial, None] = {}
        for key in fresh:
            added.update(dict.fromkeys(extra for extra in _cancelling(material, key, shapes) if extra not in found))
            if len(added) + len(found) > 2 * bound:
                break
        fresh = sorted(added, key=rank)[: max(0, bound - len(found))]
        found.update(dict.fromkeys(fresh))
    return sorted(found, key=rank)


def _cancelling(material: Material, key: Monomial, shapes: set[Monomial]) -> list[Monomial]:
    """Admissible terms that answer the residuals of one candidate."""
    try:
        residuals = euler_lagrange(material.motion, key)
    except TooManyTerms:
        return []
    found: dict[Monomial, None] = {}
    motion = material.motion
    for v, residual in zip(motion.velocities, residuals, strict=True):
        for term in residual:
            position, moving = split_velocities(term)
            for q, w in zip(motion.coordinates, motion.velocities, strict=True):
                shape = times(times(moving, monomial(v)), monomial(w), -1)
                if shape in shapes:
                    found.update(dict.fromkeys(times(m, shape) for m in antiderivatives(position, q)))
    found.update(dict.fromkeys(m for extra in list(found) for m in _without_squares(extra)))
    return [extra for extra in found if _is_admissible(material, extra)]


def _without_squares(key: Monomial) -> list[Monomial]:
    """With sin^2 u or cos^2 u also the monomial without it: 1 = sin^2 u + cos^2 u."""
    return [
        times(key, frozenset([(letter, Fraction(2))]), -1)
        for letter, e in key
        if isinstance(letter, Apply) and letter.function in ("sin", "cos") and e >= 2
    ]


def _is_admissible(material: Material, key: Monomial) -> bool:
    """L may contain t only where asked for, and a pure constant is no term."""
    if all(isinstance(letter, Number) for letter, _ in key):
        return False
    return material.motion.with_time or not any(node == TIME for letter, _ in key for node in walk(letter))
