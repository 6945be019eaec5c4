"""Random Lagrangians of less usual shapes: Finsler, logarithms, arctangents, products and powers of
velocities.

Each is regular at a generic point; coefficients are short functions of position.
"""

from __future__ import annotations

import random

import sympy

from tests.generator.ingredients import Space, coefficient, function_of, monomial, positive

HALVES = tuple(sympy.Rational(k, 2) for k in (1, 3, 5)) + tuple(map(sympy.Integer, (-1, 3, 4)))


def _factor(rng: random.Random, s: Space) -> sympy.Expr:
    """1 or a function of one coordinate."""
    return sympy.Integer(1) if rng.random() < 0.35 else function_of(rng, rng.choice(s.coordinates))


def _position(rng: random.Random, s: Space) -> sympy.Expr:
    return sum((monomial(rng, s.coordinates) for _ in range(rng.randint(0, 2))), sympy.Integer(0))


def _each(rng: random.Random, s: Space, shapes: list[sympy.Expr]) -> sympy.Expr:
    return sum(
        (coefficient(rng) * _factor(rng, s) * shape for shape in shapes), sympy.Integer(0)
    ) + _position(rng, s)


def powers(rng: random.Random, s: Space) -> sympy.Expr:
    """phi_i(q) v_i^k + U(q), half-integral k included."""
    return _each(rng, s, [v ** rng.choice(HALVES) for v in s.velocities])


def logarithms(rng: random.Random, s: Space) -> sympy.Expr:
    """phi v_i log v_i, log v_i, and v_i log v_j for the next velocity."""
    n, v = s.n, s.velocities
    if n == 1 or rng.random() < 0.5:
        return _each(rng, s, [rng.choice((w * sympy.log(w), sympy.log(w))) for w in v])
    crossed = [v[k] * sympy.log(v[(k + 1) % n]) for k in range(n if n > 2 else 1)]
    if rng.random() < 0.5:
        return _each(rng, s, crossed)
    return _each(rng, s, [*crossed, rng.choice(v) ** 2])


def products(rng: random.Random, s: Space) -> sympy.Expr:
    """Products of velocities of degree 3 and 4, with squares."""
    v = s.velocities
    shapes = [w**2 for w in v[1:]] if rng.random() < 0.6 else []
    if s.n == 1:
        return _each(rng, s, [v[0] ** rng.choice((3, 4))])
    one, other = rng.sample(v, 2)
    shapes.append(rng.choice((one**2 * other**2, one**2 * other, one * other**3, one**3 * other)))
    missing = [w for w in v if not any(w in shape.free_symbols for shape in shapes)]
    return _each(rng, s, [*shapes, *(w**2 for w in missing)])


def finsler(rng: random.Random, s: Space) -> sympy.Expr:
    """Homogeneous of degree 2 in the velocities, and not quadratic."""
    v, k = s.velocities, positive(rng)
    if s.n == 1:
        return _factor(rng, s) * v[0] ** 2 / 2
    one, other = v[0], v[1]
    shape = rng.choice((other**3 / one, other**4 / one**2, sympy.sqrt(one**4 + k * other**4),
                        sympy.sqrt(one**3 * other), one * sympy.sqrt(one**2 + k * other**2)))  # fmt: skip
    rest = [w**2 for w in (v[2:] if shape.has(sympy.sqrt(one**3 * other)) else (one, *v[2:]))]
    return sum((positive(rng) * _factor(rng, s) * w for w in rest), _factor(rng, s) * shape)


def first_integrals(rng: random.Random, s: Space) -> sympy.Expr:
    """phi v_i^2 v_n^k + W v_n^m + v_n^2, where the last coordinate is cyclic and its momentum
    conserved.
    """
    *others, last = s.velocities
    if not others:
        return _factor(rng, s) * last ** rng.choice((2, 3, 4))
    space = Space(s.coordinates[:-1], s.velocities[:-1])
    shapes = [v**2 * last ** rng.choice((-1, sympy.Rational(1, 2), 1, 2)) for v in others]
    carried = function_of(rng, rng.choice(space.coordinates)) * last ** rng.choice(HALVES)
    return sum((positive(rng) * _factor(rng, space) * shape for shape in shapes), carried) + last**2


def arctangents(rng: random.Random, s: Space) -> sympy.Expr:
    """v atan v - log(1 + v^2)/2, squares and exponentials, with potentials."""
    shapes = []
    for v in s.velocities:
        k = positive(rng)
        arc = k * v * sympy.atan(k * v) - sympy.log(1 + k**2 * v**2) / 2
        shapes.append(rng.choice((arc, v**2, sympy.exp(v))))
    return (
        sum(shapes, sympy.Integer(0))
        + coefficient(rng) * monomial(rng, s.coordinates)
        + s.coordinates[0] ** 2
    )


SHAPES = {
    "powers": powers,
    "logarithms": logarithms,
    "products": products,
    "finsler": finsler,
    "arctangents": arctangents,
    "first integrals": first_integrals,
}
