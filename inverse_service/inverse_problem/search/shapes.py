"""Functions of the velocities that ansätze are built from."""

from __future__ import annotations

import itertools
from fractions import Fraction

from inverse_service.expressions.tree import Apply, Expression, Sum, Velocity
from inverse_service.inverse_problem.search.factors import HALF
from inverse_service.inverse_problem.search.material import Material, distinct
from inverse_service.inverse_problem.search.motion import has_velocity
from inverse_service.inverse_problem.search.terms import EMPTY, Monomial, TooManyTerms, monomial, terms_of, times


def pairs(material: Material) -> list[Monomial]:
    """v_i v_j."""
    return powers(material, 2)


def powers(material: Material, degree: int) -> list[Monomial]:
    """Products of `degree` velocities."""
    velocities = material.motion.velocities
    return [monomial(*chosen) for chosen in itertools.combinations_with_replacement(velocities, degree)]


def quotients(material: Material) -> list[Monomial]:
    """v_i v_j / w with w another velocity, or a sum of velocities that is a factor of f.

    Where some velocities are constant along the motion, only these are divided by.
    """
    return [
        times(pair, monomial(w), -1)
        for pair in pairs(material)
        for w in (*divisors(material), *material.linear_sums)
        if all(w != letter for letter, _ in pair)
    ]


def divisors(material: Material) -> list[Expression]:
    motion = material.motion
    constant = [v for v, f in zip(motion.velocities, motion.forces, strict=True) if not f]
    return list(constant or motion.velocities)


def roots_of_constants(material: Material) -> list[Monomial]:
    """w^(+-1/2) and v_i v_j w^(+-1/2) for velocities w that are constant along the motion."""
    motion = material.motion
    constant = [v for v, f in zip(motion.velocities, motion.forces, strict=True) if not f]
    roots: list[Monomial] = [frozenset([(w, e)]) for w in constant for e in (HALF, -HALF)]
    return [*roots, *(times(pair, root) for root in roots for pair in pairs(material))]


def double_quotients(material: Material) -> list[Monomial]:
    """v_i v_j v_k / w^2."""
    return [
        times(triple, monomial(w), -2)
        for triple in powers(material, 3)
        for w in divisors(material)
        if all(w != letter for letter, _ in triple)
    ]


def single(velocity: Expression) -> list[tuple[int, Monomial]]:
    """(k, shape) with second derivative proportional to v^k."""
    log = Apply("log", velocity)
    found: list[tuple[int, Monomial]] = [(-1, monomial(velocity, log)), (-2, monomial(log))]
    found += [(e - 2, frozenset([(velocity, Fraction(e))])) for e in (2, 3, 4, -1, -2)]
    return found


def roots_of_velocity(velocity: Expression) -> list[Monomial]:
    return [frozenset([(velocity, e)]) for e in (HALF, 3 * HALF)]


def crossed_logarithms(material: Material) -> list[Monomial]:
    """v_i log v_j."""
    return [monomial(a, Apply("log", b)) for a, b in itertools.permutations(material.motion.velocities, 2)]


def of_letters(material: Material) -> list[Monomial]:
    """Powers and logarithms of the letters of f that hold velocities, and those times a velocity.

    Exponentials are taken as they occur together in f, in numerators and inside sums.
    """
    shapes: list[Monomial] = exponentials(material)
    for letter in material.velocity_letters:
        if not (isinstance(letter, Apply) and letter.function == "exp"):
            shapes += [frozenset([(letter, Fraction(e) * HALF)]) for e in (1, -1, 2, -2, 3, -3, 4)]
            shapes.append(monomial(Apply("log", letter)))
    plain = [EMPTY, *(monomial(v) for v in material.motion.velocities)]
    return distinct([times(a, b) for a in shapes for b in plain])


def velocities_times_roots(material: Material) -> list[Monomial]:
    """v_i sqrt(p) for the letters p of degree 2 in the velocities whose roots stand in f, as in F^2 of a spray."""
    rooted = {letter for terms in material.motion.forces for key in terms for letter, e in key if e.denominator == 2}
    rooted |= {
        letter
        for outer in material.velocity_letters
        for key in (terms_of(outer) if isinstance(outer, Sum) else ())
        for letter, e in key
        if e.denominator == 2
    }
    letters = [p for p in material.velocity_letters if p in rooted and velocity_degrees(p) == {2}]
    return [times(monomial(v), frozenset([(p, HALF)])) for p in letters for v in material.motion.velocities]


def velocity_degrees(letter: Expression) -> set[Fraction]:
    """The degrees in the velocities of the terms of a sum; none where something else holds velocities."""
    try:
        keys = [[(p, e) for p, e in key if has_velocity(p)] for key in terms_of(letter)]
    except TooManyTerms:
        return set()
    if not all(isinstance(p, Velocity) for key in keys for p, _ in key):
        return set()
    return {sum((e for _, e in key), Fraction(0)) for key in keys}


def exponentials(material: Material) -> list[Monomial]:
    """The products of exponentials of velocities in f, and their inverses."""
    found: dict[Monomial, None] = {}
    keys = [key for terms in material.motion.forces for key in terms]
    for letter in material.velocity_letters:
        if isinstance(letter, Sum):
            try:
                keys += list(terms_of(letter))
            except TooManyTerms:
                continue
    for key in keys:
        part: Monomial = frozenset((p, e) for p, e in key if _is_moving_exponential(p))
        if part:
            found[part] = None
            found[times(EMPTY, part, -1)] = None
            found.update(dict.fromkeys(frozenset([(p, Fraction(s))]) for p, _ in part for s in (1, -1, 2, -2)))
    return distinct(list(found))


def _is_moving_exponential(letter: Expression) -> bool:
    return isinstance(letter, Apply) and letter.function == "exp" and has_velocity(letter)
