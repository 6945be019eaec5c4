"""The angles in which a system is short: a - b for a where functions of a - b occur.

A polynomial in the sines and cosines of angles u is a sum of waves exp(i (w, u)), w integers. In
another basis of the angles a wave with the coordinates w takes prod_k (|w_k| + 1) monomials. A
wheel at the angle b behind a wheel at the angle a brings sin(a) cos(b) - cos(a) sin(b): one
monomial in a - b, and its powers many in a and b.
"""

import math
import random
from collections.abc import Container, Iterable, Sequence
from itertools import combinations
from operator import add, sub

from inverse_service.expressions import collecting, functions, printing, tree as ex
from inverse_service.field import exact_field

Wave = tuple[int, ...]
# Coefficients of waves are found modulo a prime, in which the imaginary unit is a residue; a wave
# that is lost to chance makes formulas longer at most.
_PRIME = 1_000_000_009
_IMAGINARY = pow(13, (_PRIME - 1) // 4, _PRIME)
_HALF = pow(2, -1, _PRIME)


def by_short_angles(
    trees: Sequence[ex.Expression],
    ring: exact_field.ExactRing,
    elements: Iterable[exact_field.Quotient],
) -> list[ex.Expression] | None:
    """The trees in the angles that make the elements short; None where the angles of the ring do.

    `ring` holds the trees.
    """
    found = (_angle_of(tree, ("cos",)) for tree in ring.trees.values())
    angles = [angle for angle in found if angle is not None]
    units = [tuple(int(k == j) for j in range(len(angles))) for k in range(len(angles))]
    sums = [tuple(map(of, *pair)) for pair in combinations(units, 2) for of in (add, sub)]
    basis, old, waves = list(angles), units, list(_waves_of(ring, angles, elements))
    while (best := _shorter(waves, waves) or _shorter(waves, sums)) is not None:
        place, wave = best
        turned = [(one, _sum(one, basis)) for one in (wave, _opposite(wave))]
        wave, basis[place] = min(turned, key=lambda one: printing.to_text(one[1]).count("-"))
        waves, old = _exchanged(waves, place, wave), _exchanged(old, place, wave)
    if basis == angles:
        return None
    table = {
        ex.Apply(name, angle): value
        for angle, turns in zip(angles, old, strict=True)
        for name, value in zip(("sin", "cos"), _sine_and_cosine(turns, basis), strict=True)
    }
    held = {
        node: ex.substitute(exact_field.quotient_tree(ring, value), table)
        for node, value in ring.atoms.items()
        if _angle_of(node, functions.CIRCULAR) is not None
    }
    return [ex.substitute(tree, held) for tree in trees]


def _angle_of(tree: ex.Expression, functions: Container[str]) -> ex.Expression | None:
    """The argument of one of the functions, if it is an angle without functions."""
    match tree:
        case ex.Apply(name, angle) if name in functions and not ex.has(
            angle, ex.Apply | ex.Arbitrary | ex.Power
        ):
            return angle
    return None


def _size(waves: Iterable[Wave]) -> tuple[int, int]:
    """How many monomials the waves take, and how many the product of each with itself."""
    sizes = [math.prod(abs(turns) + 1 for turns in wave) for wave in waves]
    return sum(sizes), sum(size**2 for size in sizes)


def _shorter(waves: Sequence[Wave], choices: Iterable[Wave]) -> tuple[int, Wave] | None:
    """The best of the choices in the place of a vector of the basis; None where no exchange makes
    the waves shorter.
    """
    sizes = {
        (place, wave): _size(_exchanged(waves, place, wave))
        for wave in choices
        for place, turns in enumerate(wave)
        if abs(turns) == 1
    }
    best = min(sizes, key=lambda one: sizes[one], default=None)
    return best if best is not None and sizes[best] < _size(waves) else None


def _sum(wave: Wave, angles: Sequence[ex.Expression]) -> ex.Expression:
    return collecting.collect(
        ex.add(*(turns * angle for turns, angle in zip(wave, angles, strict=True)))
    )


def _opposite(wave: Wave) -> Wave:
    return tuple(-turns for turns in wave)


def _exchanged(waves: Sequence[Wave], place: int, new: Wave) -> list[Wave]:
    """The waves with `new`, which has +-1 there, in the place of a vector of the basis."""
    found = []
    for wave in waves:
        of_new = wave[place] * new[place]
        rest = [turns - of_new * other for turns, other in zip(wave, new, strict=True)]
        found.append((*rest[:place], of_new, *rest[place + 1 :]))
    return found


def _waves_of(
    ring: exact_field.ExactRing,
    angles: Sequence[ex.Expression],
    elements: Iterable[exact_field.Quotient],
) -> set[Wave]:
    """The waves of the numerators, each of a pair of opposite ones, at random values of all other
    generators.
    """
    places = {tree: index for index, tree in ring.trees.items()}
    pairs = [(places[ex.Apply("sin", angle)], places[ex.Apply("cos", angle)]) for angle in angles]
    circular, drawn = {index for pair in pairs for index in pair}, random.Random(1)
    values = {index: drawn.randrange(1, _PRIME) for index in ring.trees if index not in circular}
    found = set[Wave]()
    for element in elements:
        total = dict[Wave, int]()
        for exponents, coefficient in element.numerator.terms():
            value = int(coefficient.p) * pow(int(coefficient.q), -1, _PRIME)
            for index, drawn_value in values.items():
                value = value * pow(drawn_value, int(exponents[index]), _PRIME) % _PRIME
            waves: dict[Wave, int] = {(): value}
            for sine, cosine in pairs:
                waves = {
                    (*wave, turns): a * b % _PRIME
                    for wave, a in waves.items()
                    for turns, b in _powers(int(exponents[sine]), int(exponents[cosine])).items()
                }
            for wave, a in waves.items():
                total[wave] = (total.get(wave, 0) + a) % _PRIME
        found |= {max(wave, _opposite(wave)) for wave, a in total.items() if a and any(wave)}
    return found


def _powers(sine: int, cosine: int) -> dict[int, int]:
    """The waves of sin^sine cos^cosine of one angle."""
    found = {0: 1}
    for sign, scale in [(-1, _HALF * -_IMAGINARY)] * sine + [(1, _HALF)] * cosine:
        more = dict[int, int]()
        for turns, a in found.items():
            more[turns + 1] = (more.get(turns + 1, 0) + a * scale) % _PRIME
            more[turns - 1] = (more.get(turns - 1, 0) + sign * a * scale) % _PRIME
        found = more
    return found


def _sine_and_cosine(
    turns: Wave, angles: Sequence[ex.Expression]
) -> tuple[ex.Expression, ex.Expression]:
    """Of a sum of angles, by the addition theorems."""
    sine: ex.Expression = ex.ZERO
    cosine: ex.Expression = ex.ONE
    for count, angle in zip(turns, angles, strict=True):
        s, c = ex.Apply("sin", angle), ex.Apply("cos", angle)
        for _ in range(abs(count)):
            step = s if count > 0 else ex.negated(s)
            sine, cosine = sine * c + cosine * step, cosine * c - sine * step
    return sine, cosine
