"""The ladder of ansätze: families of candidate terms, cheapest first."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.expressions.tree import TIME, Symbol, Velocity
from inverse_service.inverse_problem.search import shapes
from inverse_service.inverse_problem.search.closure import closed, is_admissible, potentials
from inverse_service.inverse_problem.search.darboux.terms import of_darboux_polynomials
from inverse_service.inverse_problem.search.factors import Factors, position_monomials, products
from inverse_service.inverse_problem.search.material import Material, distinct
from inverse_service.inverse_problem.search.motion import has_velocity
from inverse_service.inverse_problem.search.terms import Monomial, monomial, times

_MOST_SEEDS = 900
_MOST_PRODUCTS = 360
# Short functions of position: so many terms, but not fewer functions than that.
_MOST_SHORT, _FEW_FUNCTIONS = 240, 20
# What can cancel the residuals of v_i v_j, whose coefficients need not be products of few letters.
_MOST_ANSWERS = 200
# Plain functions of position that are offered as potentials beside what the residuals ask for.
_MOST_FUNCTIONS = 60


@dataclass(frozen=True, slots=True)
class Family:
    """A named ansatz: the terms it starts from, and how they are completed.

    With depth > 0 the seeds are closed that often under what cancels their residuals, up to `bound`
    terms; with depth 0 potentials and linear terms are read off f, at most `bound` of each.
    `companions` are terms without a Hessian that go with every choice of the others. `quadratic` says
    that no multiplier of the family depends on the velocities, `by_residuals` that potentials are read
    off the exact residuals of what has a multiplier.
    """

    name: str
    cost: float
    seeds: Callable[[Material, Factors], list[Monomial]]
    depth: int = 1
    bound: int = 400
    companions: tuple[Monomial, ...] = ()
    quadratic: bool = False
    by_residuals: bool = False


def _constant(material: Material, factors: Factors) -> list[Monomial]:
    return products(material.parameter_monomials[:12], shapes.pairs(material))


def _constant_in_time(material: Material, factors: Factors) -> list[Monomial]:
    return products(factors.in_time, _constant(material, factors))


def _integrating(material: Material, factors: Factors) -> list[Monomial]:
    pairs = shapes.pairs(material)
    every = products(material.parameter_monomials[:4], products(factors.in_time, factors.plain))
    return products(every[: max(4, _MOST_PRODUCTS // len(pairs))], pairs)


def _metric(material: Material, factors: Factors) -> list[Monomial]:
    quadratic = products(material.parameter_monomials[:3], shapes.pairs(material))
    room = _MOST_SEEDS // (len(quadratic) * len(factors.in_time))
    degree = next((d for d in (4, 3) if len(position_monomials(material, d)) <= room), 2)
    functions = distinct([*position_monomials(material, degree), *factors.plain])
    answers = closed(material, shapes.pairs(material), 2, _MOST_ANSWERS)
    return products(factors.in_time, [*products(functions, quadratic), *answers])


def _short_metric(material: Material, factors: Factors) -> list[Monomial]:
    """phi v_i v_j with phi a product of at most two letters as f holds them, or an integrating factor."""
    shapes_of_v = shapes.pairs(material)
    products_of_two = [key for key in position_monomials(material, 2) if all(e.denominator == 1 for _, e in key)]
    functions = distinct([*products_of_two, *factors.plain[:4]])
    room = max(_FEW_FUNCTIONS, _MOST_SHORT // len(shapes_of_v))
    return products(factors.in_time, products(functions[:room], shapes_of_v))


def _fitting(material: Material, room: int) -> list[Monomial]:
    """Products of up to three letters where there is room for all of them, else of two."""
    units = len(position_monomials(material, 1)) - 1
    return position_monomials(material, 3 if math.comb(units + 3, 3) <= room else 2)


def _laurent_plain(material: Material, factors: Factors) -> list[Monomial]:
    """phi_i v_i^2 / v_k with phi_i from the coefficients of f_i, v_i v_j / v_k, and v_i v_j."""
    fitted = [
        times(factor, shape)
        for shape in shapes.quotients(material)
        for i, v in enumerate(material.motion.velocities)
        if (v, Fraction(2)) in shape and i in factors.across
        for factor in (factors.across[i],)
    ]
    seeds = shapes.pairs(material) + products(factors.plain[:3], shapes.quotients(material)) + fitted
    return products(factors.in_time, seeds)


def _laurent(material: Material, factors: Factors) -> list[Monomial]:
    """phi v_i v_j / v_k with phi an integrating factor, a product of letters, or both; and v_i v_j."""
    quotients = shapes.quotients(material)
    simple = position_monomials(material, 1)
    room = max(4, _MOST_SEEDS // max(1, len(quotients)))
    every = distinct([*products(simple, factors.plain), *_fitting(material, room)])
    chosen = list(dict.fromkeys([*simple[: room // 3], *factors.plain[: room // 3], *every]))[:room]
    return products(factors.in_time[:2], shapes.pairs(material) + products(chosen, quotients))


def _laurent_double(material: Material, factors: Factors) -> list[Monomial]:
    every = [*shapes.quotients(material), *shapes.double_quotients(material)]
    return shapes.pairs(material) + products(factors.plain[:3], every)


def _velocity_functions(material: Material, factors: Factors) -> list[Monomial]:
    """Functions of the velocities with constant coefficients: polynomials, logarithms, letters of f."""
    polynomial = [m for degree in (2, 3, 4) for m in shapes.powers(material, degree)]
    alone = [m for v in material.motion.velocities for _, m in shapes.single(v)]
    every = [*polynomial, *alone, *shapes.of_letters(material)]
    # Where f holds no position, first integrals can be linear in t: x'' = x'^2 keeps 1/x' + t.
    linear = material.motion.with_time and not material.position_letters
    times_t = products([monomial(TIME)], shapes.of_letters(material)) if linear else []
    return [*products(factors.in_time, every[:_MOST_SEEDS]), *times_t[:_MOST_SEEDS]]


def _times_roots(material: Material, factors: Factors) -> list[Monomial]:
    """phi v_i v_j and phi v_i sqrt(p) with p quadratic in the velocities and phi a function of position."""
    rooted = shapes.velocities_times_roots(material)
    if not rooted:
        return []
    every = [*shapes.pairs(material), *rooted]
    room = _MOST_SEEDS // len(every)
    degree = next((d for d in (4, 3) if len(position_monomials(material, d)) <= room), 2)
    return products(position_monomials(material, degree)[:room], every)


def _roots_of_constants(material: Material, factors: Factors) -> list[Monomial]:
    roots = shapes.roots_of_constants(material)
    return shapes.pairs(material) + roots if roots else []


def _separate(material: Material, factors: Factors) -> list[Monomial]:
    """phi_i(q) psi(v_i) with phi_i fitted to psi, and letters of f with integrating factors."""
    fitted = [
        m
        for i, v in enumerate(material.motion.velocities)
        for k, shape in shapes.single(v)
        for m in products(factors.of_degree(i, k), [shape])
    ]
    letters = products(factors.plain[:6], shapes.of_letters(material)[: _MOST_SEEDS // 6])
    return products(factors.in_time, distinct([*fitted, *shapes.pairs(material), *letters]))


def _logarithms(material: Material, factors: Factors) -> list[Monomial]:
    """phi v_i log v_j, roots of velocities, and the separate functions with all integrating factors."""
    alone = [m for v in material.motion.velocities for _, m in shapes.single(v)]
    roots = [m for v in material.motion.velocities for m in shapes.roots_of_velocity(v)]
    return products(factors.plain[:6], [*alone, *roots, *shapes.crossed_logarithms(material)])


FAMILIES = (
    Family("constant multiplier", 1, _constant, quadratic=True),
    Family("quadratic, polynomial in the coordinates", 2, _constant_in_time, depth=3, bound=250, quadratic=True),
    Family("quadratic with integrating factors", 3, _integrating, quadratic=True),
    Family("quadratic with short functions of position", 3.4, _short_metric, bound=150, quadratic=True),
    Family("Laurent monomials v_i v_j / v_k, polynomial in the coordinates", 4, _laurent_plain, depth=3, bound=600),
    Family("functions of the velocities, constant coefficients", 5, _velocity_functions, depth=0, bound=200),
    Family("roots of velocities that are constant", 5.5, _roots_of_constants, depth=2, bound=250),
    Family("functions of one velocity with fitted factors", 6, _separate, depth=0, bound=200),
    Family("quadratic in the velocities", 7, _metric, bound=500, quadratic=True),
    Family("Laurent monomials v_i v_j / v_k", 8, _laurent, bound=400),
    Family("velocities times a root of f, with functions of position", 8.2, _times_roots, bound=400),
    Family("Darboux polynomials and first integrals", 8.5, of_darboux_polynomials, by_residuals=True),
    Family("logarithms and roots of velocities", 9, _logarithms),
    Family("Laurent monomials v_i v_j v_k / v_l^2", 9.5, _laurent_double, depth=2, bound=500),
)


def kinetic_terms(material: Material, family: Family, factors: Factors) -> list[Monomial]:
    """The terms of an ansatz that have a Hessian, simple ones first."""
    seeds = [key for key in distinct(family.seeds(material, factors)) if is_admissible(material, key)]
    if family.depth > 1 and is_polynomial(material):
        seeds = closed(material, seeds, family.depth, family.bound)
    return [key for key in distinct(seeds) if is_admissible(material, key) and not is_linear(key)]


def all_terms(material: Material, family: Family, chosen: Sequence[Monomial]) -> list[Monomial]:
    """Chosen kinetic terms with the potentials and linear terms that can go with them."""
    depth = max(1, family.depth) if is_polynomial(material) else 1
    every = [*closed(material, chosen, depth, family.bound), *family.companions]
    every += _fitting(material, _MOST_FUNCTIONS)[1:_MOST_FUNCTIONS]
    if not family.depth:
        every += potentials(material, chosen, family.bound)
    return [key for key in distinct(every) if is_admissible(material, key)]


def is_polynomial(material: Material) -> bool:
    """Whether f is a polynomial in positions, velocities and parameters: only then are deep closures finite."""
    return all(
        isinstance(letter, Symbol | Velocity) and e > 0
        for terms in material.motion.forces
        for key in terms
        for letter, e in key
    )


def is_linear(key: Monomial) -> bool:
    """Whether a term is a function of position times at most one velocity."""
    moving = [(letter, e) for letter, e in key if has_velocity(letter)]
    return not moving or (len(moving) == 1 and isinstance(moving[0][0], Velocity) and moving[0][1] == 1)
