"""Functions of the velocities that ansätze are built from, in sets that grow."""

from __future__ import annotations

import itertools
from fractions import Fraction
from math import isqrt

from inverse_service.expressions.tree import (
    Apply,
    Expression,
    Number,
    Power,
    Sum,
    Velocity,
    is_exponential,
    number,
    square_root,
    walk,
)
from inverse_service.search.factors import HALF
from inverse_service.search.material import Material, distinct, moving_letters
from inverse_service.search.motion_terms import has_velocity
from inverse_service.search.terms import (
    EMPTY,
    Monomial,
    TooManyTerms,
    monomial,
    terms_of,
    times,
)

_FOUR = Fraction(4)
_POWERS = tuple(Fraction(e, 2) for e in (1, 3, 4, 5, 6, 8, -2, -4))
_CARRIED = tuple(Fraction(e, 2) for e in (0, 2, -2, 1, -1, 4, 3))
_ROOTS = tuple(Fraction(e, 2) for e in (1, -1, 2, -2, 3, -3, 4))


def with_roots(material: Material) -> list[Monomial]:
    """v_i v_j and v_i sqrt(p) for what holds velocities in f, as in the square F^2 of a Finsler function."""
    letters = [letter for letter in moving_letters(material) if isinstance(letter, Sum)]
    rooted = [times(monomial(v), frozenset([(p, HALF)])) for p in letters for v in material.motion.velocities]
    return [*quadratic(material), *rooted] if rooted else []


def ratios(material: Material) -> list[Monomial]:
    """v_i v_j and v_i v_j / v_k."""
    return distinct([*quadratic(material), *quotients(material, 2)])


def of_velocities(material: Material) -> list[Monomial]:
    """These, powers and logarithms of one velocity."""
    return distinct([*ratios(material), *(shape for v in material.motion.velocities for shape in single(v))])


def functions(material: Material) -> list[Monomial]:
    """These, and what f itself holds."""
    return distinct([*of_velocities(material), *of_letters(material)])


def as_in_force(material: Material) -> list[Monomial]:
    """Those of these that need no other roots and logarithms than f holds: f has values for them already."""
    items = {item for terms in material.motion.forces for key in terms for item in key}
    letters, rooted = {p for p, _ in items}, {p for p, e in items if e.denominator > 1}

    def is_held(letter: Expression, e: Fraction) -> bool:
        plain = not isinstance(letter, Apply) or is_exponential(letter) or letter in letters
        return plain and (e.denominator == 1 or letter in rooted)

    return [shape for shape in functions(material) if all(is_held(p, e) for p, e in shape)]


def products_and_roots(material: Material) -> list[Monomial]:
    """Products of up to four velocities, v_i log v_j, v_i v_j v_k / v_l^2 and its like, roots of velocities.

    For one coordinate `functions` has them all.
    """
    if material.motion.size == 1:
        return []
    higher = [*powers(material, 3), *(powers(material, 4) if material.motion.size < 4 else [])]
    crossed = [monomial(a, Apply("log", b)) for a, b in itertools.permutations(material.motion.velocities, 2)]
    double = [*quotients(material, 3), *(quotients(material, 4) if material.motion.size < 3 else [])]
    below = divisors(material)
    double += [frozenset([(v, _FOUR), (w, -_FOUR / 2)]) for v in material.motion.velocities for w in below if v != w]
    return distinct([*functions(material), *higher, *crossed, *double, *roots(material)])


def polynomials(material: Material) -> list[Monomial]:
    """Products of two, three and four velocities, of several coordinates."""
    if material.motion.size == 1:
        return []
    return [shape for degree in (2, 3, 4) for shape in powers(material, degree)]


def carried(material: Material) -> list[Monomial]:
    """v_i v_j w^e and functions of w, for the velocity w of a coordinate that f does not hold, roots in f first.

    The momentum of w is constant then, and w is a function of the others, which can enter L in any power.
    """
    motion, found = material.motion, list[Monomial]()
    held = {node for f in material.analysis.system.accelerations for node in walk(f)}
    cyclic = [v for q, v in zip(motion.coordinates, motion.velocities, strict=True) if q not in held]
    for w in sorted(cyclic, key=lambda w: (not _is_rooted(material, w), repr(w))):
        others = [v for v in motion.velocities if v != w]
        pairs = [monomial(*pair) for pair in itertools.combinations_with_replacement(others, 2)]
        found += [times(pair, monomial(w), e) for e in _CARRIED for pair in pairs]
        found += [*single(w), *(monomial(v, w) for v in others)]
    return list(dict.fromkeys(found)) if len(motion.velocities) > 1 else []


def _is_rooted(material: Material, w: Expression) -> bool:
    """Whether f holds a root of w."""
    nodes = (node for f in material.analysis.system.accelerations for node in walk(f))
    return any(
        isinstance(node, Power) and node.base == w and isinstance(node.exponent, Number) and node.exponent.value % 1
        for node in nodes
    )


def complex_logarithms(material: Material) -> list[Monomial]:
    """v_i v_j, and the parts of z' log z' for two velocities as one complex z': z'' = -(U_y + i U_x) z' has them."""
    found: list[Monomial] = []
    for v, w in itertools.combinations(material.motion.velocities, 2):
        modulus = Apply("log", v**2 + w**2)
        angle = Apply("atan", w / v)
        found += [monomial(letter, part) for letter in (v, w) for part in (modulus, angle)]
    return [*found, *quadratic(material)] if found else []


def quadratic(material: Material) -> list[Monomial]:
    """v_i v_j."""
    return powers(material, 2)


def powers(material: Material, degree: int) -> list[Monomial]:
    """Products of `degree` velocities."""
    velocities = material.motion.velocities
    return [monomial(*chosen) for chosen in itertools.combinations_with_replacement(velocities, degree)]


def quotients(material: Material, degree: int) -> list[Monomial]:
    """Products of `degree` velocities over w^(degree - 1) or w^(degree - 2), w another velocity or a sum of them in f.

    Where some velocities are constant along the motion, only these are divided by.
    """
    exponents = {degree - 1, degree - 2} - {0}
    return [
        times(product, monomial(w), -e)
        for product in powers(material, degree)
        for w in (*divisors(material), *material.linear_sums)
        if all(w != letter for letter, _ in product)
        for e in exponents
    ]


def divisors(material: Material) -> list[Expression]:
    """The velocities that are constant along the motion, else all."""
    motion = material.motion
    constant = [v for v, f in zip(motion.velocities, motion.forces, strict=True) if not f]
    return list(constant or motion.velocities)


def roots(material: Material) -> list[Monomial]:
    """w^(+-1/2) v_i v_j and v_i^a v_j^b with halves a + b = 1 or 2; w is constant along the motion."""
    motion = material.motion
    constant = [v for v, f in zip(motion.velocities, motion.forces, strict=True) if not f]
    found = [times(pair, frozenset([(w, e)])) for w in constant for e in (HALF, -HALF) for pair in quadratic(material)]
    for a, b in itertools.permutations(motion.velocities, 2):
        found += [frozenset([(a, HALF), (b, 3 * HALF)]), frozenset([(a, HALF), (b, HALF)])]
    return found


def single(velocity: Expression) -> list[Monomial]:
    """Powers, log v and v log v."""
    log = Apply("log", velocity)
    return [monomial(velocity, log), monomial(log), *(frozenset([(velocity, e)]) for e in _POWERS)]


def of_letters(material: Material) -> list[Monomial]:
    """Powers, logarithms and exponentials of what holds velocities in f, and those times a velocity."""
    shapes: list[Monomial] = exponentials(material)
    for letter in moving_letters(material):
        if isinstance(letter, Sum):
            # Its integer powers are sums of products that stand in the list themselves.
            shapes += [frozenset([(letter, e)]) for e in _ROOTS if e < 0 or e.denominator > 1]
            shapes += [monomial(Apply("log", letter)), *_arctangents(letter)]
        else:
            shapes += [frozenset([(letter, Fraction(e))]) for e in (1, -1, 2)]
    plain = [EMPTY, *(monomial(v) for v in material.motion.velocities)]
    return distinct([times(a, b) for a in shapes for b in plain])


def _arctangents(letter: Expression) -> list[Monomial]:
    """atan(c v) for a letter a v^2 + b with numbers a, b, c^2 = a/b."""
    match letter:
        case Sum((Number() as constant, square)) | Sum((square, Number() as constant)):
            terms = list(terms_of(square).items())
        case _:
            return []
    match [(list(key), value / constant.value) for key, value in terms]:
        case [([(Velocity() as v, power)], ratio)] if power == 2 and ratio > 0:
            return [monomial(Apply("atan", _root(ratio) * v))]
    return []


def _root(value: Fraction) -> Expression:
    """Its square root, a number where it is rational."""
    top, bottom = isqrt(value.numerator), isqrt(value.denominator)
    exact = top**2 == value.numerator and bottom**2 == value.denominator
    return number(Fraction(top, bottom)) if exact else square_root(number(value))


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
        part: Monomial = frozenset((p, e) for p, e in key if is_exponential(p) and has_velocity(p))
        if part:
            found[part] = None
            found[times(EMPTY, part, -1)] = None
            found.update(dict.fromkeys(frozenset([(p, Fraction(s))]) for p, _ in part for s in (1, -1, 2, -2)))
    return distinct(list(found))
