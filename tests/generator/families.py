"""Families of random Lagrangians L(t, q, v), each regular at a generic point."""

from __future__ import annotations

import random
from collections.abc import Callable

import sympy

from tests.generator.ingredients import (
    TIME,
    Space,
    coefficient,
    constant_matrix,
    function_of,
    positive,
    potential,
    quadratic,
)

Family = Callable[[random.Random, Space], sympy.Expr]


def natural(rng: random.Random, s: Space) -> sympy.Expr:
    """Constant kinetic matrix and a potential."""
    return _constant(rng, s) - potential(rng, s.coordinates)


def _constant(rng: random.Random, s: Space) -> sympy.Expr:
    return quadratic(constant_matrix(rng, s.n), s.velocities)


def metric(rng: random.Random, s: Space) -> sympy.Expr:
    """Kinetic energy of a metric that depends on q: diagonal, conformal, or sheared; sometimes a
    potential.
    """
    kind = rng.choice((_diagonal, _conformal, _sheared))
    energy = kind(rng, s)
    return energy - potential(rng, s.coordinates) if rng.random() < 0.5 else energy


def _diagonal(rng: random.Random, s: Space) -> sympy.Expr:
    return sum(
        (function_of(rng, rng.choice(s.coordinates)) * v**2 / 2 for v in s.velocities),
        sympy.Integer(0),
    )


def _conformal(rng: random.Random, s: Space) -> sympy.Expr:
    signs = (rng.choice((-1, 1, 1)) for _ in s.velocities)
    factor = function_of(rng, rng.choice(s.coordinates)) + rng.randint(0, 1) * rng.choice(
        s.coordinates
    )
    return (
        factor
        * sum((sign * v**2 for sign, v in zip(signs, s.velocities, strict=True)), sympy.Integer(0))
        / 2
    )


def _sheared(rng: random.Random, s: Space) -> sympy.Expr:
    forms = list(s.velocities)
    for i in range(s.n - 1):
        if rng.random() < 0.6:
            forms[i] += (
                rng.choice((1, -1))
                * rng.choice(s.coordinates)
                * s.velocities[rng.randrange(i + 1, s.n)]
            )
    weights = [rng.choice((1, 1, 2, function_of(rng, s.coordinates[0]))) for _ in forms]
    return sum(
        (weight * form**2 / 2 for weight, form in zip(weights, forms, strict=True)),
        sympy.Integer(0),
    )


def magnetic(rng: random.Random, s: Space) -> sympy.Expr:
    """A kinetic energy with terms A_i(q) v_i and a potential."""
    kind = rng.choice((_constant, _constant, _diagonal))
    return kind(rng, s) + _linear(rng, s) - potential(rng, s.coordinates)


def _linear(rng: random.Random, s: Space) -> sympy.Expr:
    terms = []
    for v in s.velocities[: rng.randint(1, s.n)]:
        q, other = rng.choice(s.coordinates), rng.choice(s.coordinates)
        terms.append(
            coefficient(rng) * v * rng.choice((q, q**2, q * other, sympy.sin(q), sympy.exp(-q)))
        )
    return sum(terms, sympy.Integer(0))


def velocity_ratio(rng: random.Random, s: Space) -> sympy.Expr:
    """w'^2/2 + v^T S(w) v / (2 w') with functions of the single coordinate w; sometimes a
    potential.
    """
    w, rate = s.coordinates[0], s.velocities[0]
    if s.n == 1:
        return function_of(rng, w) / rate - rng.randint(0, 1) * function_of(rng, w)
    ratio = sum((_weight(rng, w) * v**2 for v in s.velocities[1:]), sympy.Integer(0))
    if s.n > 2 and rng.random() < 0.4:
        ratio += function_of(rng, w) * s.velocities[1] * s.velocities[2]
    lagrangian = positive(rng) * rate**2 / 2 + ratio / (2 * rate)
    return lagrangian - rng.choice((0, 0, 1)) * rng.choice(
        (w**2, sympy.cos(w), w * s.coordinates[-1])
    )


def _weight(rng: random.Random, w: sympy.Symbol) -> sympy.Expr:
    return coefficient(rng) * rng.choice((function_of(rng, w), sympy.Integer(1)))


def quartic(rng: random.Random, s: Space) -> sympy.Expr:
    """Fourth powers of the velocities plus a quadratic form."""
    if s.n < 4 and rng.random() < 0.5:  # for n = 4 the right-hand sides fill a page
        square = sum((v**2 for v in s.velocities), sympy.Integer(0))
        kinetic = square / 2 + positive(rng) * square**2 / 4
    else:
        kinetic = sum(
            (positive(rng) * v**2 / 2 + coefficient(rng) * v**4 / 12 for v in s.velocities),
            sympy.Integer(0),
        )
    return kinetic + rng.randint(0, 1) * _linear(rng, s) - potential(rng, s.coordinates)


def relativistic(rng: random.Random, s: Space) -> sympy.Expr:
    """-m sqrt(1 - |v|^2), of all velocities together or of each one, with a potential and sometimes
    a magnetic term.
    """
    if rng.random() < 0.6:
        kinetic = -positive(rng) * sympy.sqrt(1 - sum(v**2 for v in s.velocities))
    else:
        kinetic = -sum(
            (positive(rng) * sympy.sqrt(1 - v**2) for v in s.velocities), sympy.Integer(0)
        )
    return kinetic + rng.choice((0, 0, 1)) * _linear(rng, s) - potential(rng, s.coordinates)


def exponential(rng: random.Random, s: Space) -> sympy.Expr:
    """Exponentials of velocities or of sums of two of them, with a potential."""
    kinetic = sympy.Integer(0)
    for i, v in enumerate(s.velocities):
        partner = s.velocities[i - 1] if i and rng.random() < 0.3 else 0
        kinetic += coefficient(rng) * sympy.exp(rng.choice((1, 1, -1, 2)) * v + partner)
    return kinetic + rng.choice((0, 0, 1)) * _linear(rng, s) - potential(rng, s.coordinates)


def velocity_logarithm(rng: random.Random, s: Space) -> sympy.Expr:
    """c_i(q_i) v_i log v_i with terms A_i(q) v_i and a potential."""
    kinetic = sympy.Integer(0)
    for q, v in zip(s.coordinates, s.velocities, strict=True):
        weight = function_of(rng, q) if rng.random() < 0.25 else sympy.Integer(1)
        kinetic += coefficient(rng) * weight * v * sympy.log(v)
    return kinetic + rng.randint(0, 1) * _linear(rng, s) - potential(rng, s.coordinates)


FAMILIES: dict[str, Family] = {
    "natural": natural,
    "metric": metric,
    "magnetic": magnetic,
    "velocity-ratio": velocity_ratio,
    "quartic": quartic,
    "relativistic": relativistic,
    "exponential": exponential,
    "velocity-logarithm": velocity_logarithm,
}


def with_time(rng: random.Random, s: Space, lagrangian: sympy.Expr) -> sympy.Expr:
    """The same with explicit time: a factor exp(c t), or a driving force."""
    if rng.random() < 0.6:
        return sympy.exp(rng.choice((1, 1, 2, -1)) * TIME) * lagrangian
    return lagrangian + rng.choice((TIME, sympy.cos(TIME), sympy.exp(-TIME))) * rng.choice(
        s.coordinates
    )
