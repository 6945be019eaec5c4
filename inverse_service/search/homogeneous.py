"""Lagrangians of systems whose equations have one factor in common, q'' = P(q, q') q': their paths
are straight lines.

They are sought among the products of P, its roots, velocities and generators of position, one
degree at a time in the scalings of f: P^2 for Funk's metric, P^4/R^2 with the root R in P for
Berwald's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import combinations_with_replacement

from inverse_service import bounds
from inverse_service.expressions import calculus, terms as tm, tree as ex
from inverse_service.field import exact_field, matrices
from inverse_service.mechanics import grading
from inverse_service.search import ansatz, families, material as mt

# All products together, and those of one degree.
_MOST_PRODUCTS = 20_000
_LIMITS = {"velocity": 2, "root": 1}
# The highest degree in the coordinates, and the largest number, of the terms of a sum F.
_HIGHEST, _MOST_TERMS = 3, 80


def common_factor(material: mt.Material) -> tm.Monomial | None:
    """P with f_i = P v_i for each i, up to a number; None without one, or if no function of
    velocities occurs.
    """
    pairs = zip(material.motion.forces, material.motion.velocities, strict=True)
    quotients = [tm.multiply_by(f, tm.monomial(v), -1) for f, v in pairs]
    first = quotients[0]
    if not first or any(other != first for other in quotients[1:]) or not material.velocity_letters:
        return None
    _, common, primitive = tm.split_content(first)
    return tm.times(common, tm.monomial(mt.positive_form(primitive, material.analysis.real_point)))


def has_common_factor(material: mt.Material) -> bool:
    return common_factor(material) is not None


def propose(material: mt.Material, seed: int) -> Iterator[ex.Expression]:
    """Lagrangians of the simplest degrees that contain regular ones."""
    factor, motion = common_factor(material), material.motion
    if factor is None:
        return
    items = (item for f in motion.forces for key in f for item in key)
    roots = dict.fromkeys(p for p, e in items if e.denominator > 1 and tm.has_velocity(p))
    blocks = [
        grading.Block(tm.monomial(v), range(3), "velocity", moves=True) for v in motion.velocities
    ]
    blocks.append(grading.Block(factor, range(-2, 5), bends=True))
    blocks += [
        grading.Block(tm.monomial(p), [Fraction(k, 2) for k in range(-4, 2)], "root", bends=True)
        for p in roots
    ]
    sums = [p for p in material.position_letters if isinstance(p, ex.Sum)]
    blocks += [grading.Block(tm.monomial(p), range(-2, 1)) for p in sums]
    yield from lagrangians_of_products(material, seed, blocks, _LIMITS, _MOST_PRODUCTS)


def lagrangians_of_products(
    material: mt.Material,
    seed: int,
    blocks: Sequence[grading.Block],
    limits: Mapping[str, int],
    most: int,
) -> Iterator[ex.Expression]:
    """Those of the simplest degrees that contain regular ones, among at most so many products of
    powers of the blocks.
    """
    pairs = zip(material.analysis.system.coordinates, material.motion.forces, strict=True)
    gradings = grading.gradings_of(grading.second_order(*pair) for pair in pairs)
    sampler = ansatz.sampler_of(
        material.analysis,
        [tm.times(tm.EMPTY, b.product, e) for b in blocks for e in b.exponents if e],
    )
    known = list[ansatz.Combination]()
    for terms in grading.products_by_degree(blocks, gradings, limits, most, bounds.SMALL):
        space = ansatz.solve_multiplier(
            sampler, [key for key in terms if not tm.is_affine(key)], seed
        )
        known += space.combinations
        if space.combinations:
            found = replace(space, combinations=tuple(known))
            members = ansatz.best_members(found, seed, partial(families.with_potential, material))
            yield from (tm.tree_of(member.terms) for member in members)


def propose_sums(material: mt.Material, seed: int) -> Iterator[ex.Expression]:
    """F^2/2 for the sums F of velocities and roots over the denominators of P."""
    if common_factor(material) is None:
        return
    with suppress(exact_field.TooLarge, ZeroDivisionError, tm.TooManyTerms):
        terms, divisor = _terms_of_sums(material)
        if len(terms) > _MOST_TERMS:
            return
        table = [_hamel(material, term / divisor) for term in terms]
        q, v = material.motion.coordinates, material.motion.velocities
        trees = [entry for column in table for entry in column]
        ring = exact_field.exact_ring(trees, [*q, *v], None, exact_field.Budget.long())
        columns = [[ring.value(entry) for entry in column] for column in table]
        for vector in matrices.null_vectors(ring, columns):
            weights = [exact_field.quotient_tree(ring, c) for c in vector]
            yield ex.dot(weights, terms) ** 2 / (2 * divisor**2)


def _terms_of_sums(material: mt.Material) -> tuple[list[ex.Expression], ex.Expression]:
    """Terms for the sums F, and the product of the denominators of f that hold only coordinates.

    The terms are products of a velocity or a root in f and a monomial in the coordinates, and those
    of denominators that hold velocities: as P = -v_k (dF/dq_k)/F, what F has in no common factor
    with the numerator is there, with roots of any degree.
    """
    motion = material.motion
    items = [item for f in motion.forces for key in f for item in key]
    below = dict.fromkeys(p for p, e in items if e < 0 and ex.holds(p, *motion.coordinates))
    roots = dict.fromkeys(p for p, e in items if e.denominator == 2 and tm.has_velocity(p))
    divisor = ex.multiply(*(p for p in below if not tm.has_velocity(p)))
    degree = min(_HIGHEST, max(_degree(divisor, motion.coordinates) - 1, 0))
    powers = [
        ex.multiply(*chosen)
        for k in range(degree + 1)
        for chosen in combinations_with_replacement(motion.coordinates, k)
    ]
    letters = [*motion.velocities, *(p ** Fraction(1, 2) for p in roots)]
    terms = [letter * power for letter in letters for power in powers]
    written = [tm.monomial_tree(key) for p in below if tm.has_velocity(p) for key in tm.terms_of(p)]
    every = list(dict.fromkeys([*terms, *written]))
    return (every if len(every) <= _MOST_TERMS else terms), divisor


def _degree(tree: ex.Expression, coordinates: Sequence[ex.Symbol]) -> int:
    """The degree of a polynomial in the coordinates; other generators count as constants."""
    keys = tm.terms_of(tree)
    return max(int(sum(tm.exponent_of(key, q) for q in coordinates)) for key in keys)


def _hamel(material: mt.Material, term: ex.Expression) -> list[ex.Expression]:
    """Gamma(F) and Hamel's expressions of one term F."""
    q, v = material.motion.coordinates, material.motion.velocities
    slopes = [calculus.differentiate(term, each) for each in v]
    ends = [calculus.differentiate(term, each) for each in q]
    rate = ex.dot(v, ends) + ex.dot(material.analysis.system.accelerations, slopes)
    return [
        rate,
        *(
            ex.dot(v, [calculus.differentiate(slope, each) for each in q]) - end
            for slope, end in zip(slopes, ends, strict=True)
        ),
    ]
