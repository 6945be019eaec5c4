"""Random pieces of Lagrangians: numbers, functions of the coordinates, potentials, matrices."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

import sympy

COORDINATE_NAMES = (
    ("x", "y", "z", "w"),
    ("q1", "q2", "q3", "q4"),
    ("r", "a", "s", "b"),
    ("u", "v", "phi", "theta"),
)
TIME = sympy.Symbol("t")


@dataclass(frozen=True, slots=True)
class Space:
    """Coordinates and velocities as symbols; the velocity of x is the symbol named x'."""

    coordinates: tuple[sympy.Symbol, ...]
    velocities: tuple[sympy.Symbol, ...]

    @property
    def n(self) -> int:
        return len(self.coordinates)


def space(names: Sequence[str]) -> Space:
    """The symbols of some coordinate names."""
    return Space(tuple(map(sympy.Symbol, names)), tuple(sympy.Symbol(name + "'") for name in names))


def random_space(rng: random.Random, n: int) -> Space:
    return space(rng.choice(COORDINATE_NAMES)[:n])


def coefficient(rng: random.Random) -> sympy.Rational:
    """A small nonzero number, mostly an integer."""
    return sympy.Rational(
        rng.choice((-3, -2, -1, -1, 1, 1, 1, 2, 3)), rng.choice((1, 1, 1, 1, 2, 3))
    )


def positive(rng: random.Random) -> sympy.Rational:
    return abs(coefficient(rng))


def function_of(rng: random.Random, q: sympy.Symbol) -> sympy.Expr:
    """A short function of one coordinate that is neither zero nor infinite for 0 < q < 1/2."""
    k = positive(rng)
    algebraic = (q**2 + k, 1 + k * q, sympy.sqrt(1 + q**2), 1 / q, q)
    return rng.choice((*algebraic, sympy.exp(k * q), sympy.exp(-q), sympy.cos(q), sympy.sin(q)))


def monomial(rng: random.Random, q: Sequence[sympy.Symbol]) -> sympy.Expr:
    """One term of a potential: a polynomial, trigonometric, exponential, logarithmic or root
    term.
    """
    a, b = rng.choice(q), rng.choice(q)
    polynomial = (a * b, a**2 * b, a * b**2, a**2 * b**2, a**3 - a * b)
    smooth = (*polynomial, sympy.cos(a), b * sympy.sin(a), sympy.cos(a - 2 * b))
    other = (
        sympy.exp(a - 2 * b),
        sympy.exp(-a),
        sympy.log(a),
        1 / (a + b),
        sympy.sqrt(1 + a**2 + b**2),
    )
    return coefficient(rng) * rng.choice(smooth if rng.random() < 0.7 else other)


def potential(rng: random.Random, q: Sequence[sympy.Symbol]) -> sympy.Expr:
    """A sum of two to four terms that contains every coordinate."""
    total = sum((monomial(rng, q) for _ in range(rng.randint(1, 3))), sympy.Integer(0))
    for a in q:
        if a not in total.free_symbols:
            total += coefficient(rng) * rng.choice((a**2, a**4, a * rng.choice(q), sympy.cos(a)))
    return total


def constant_matrix(rng: random.Random, n: int) -> sympy.Matrix:
    """A regular symmetric matrix of small integers with few entries off the diagonal."""
    while True:
        matrix = sympy.diag(*(rng.choice((-1, 1, 1, 2, 3)) for _ in range(n)))
        for _ in range(rng.randint(0, min(n - 1, 2))):
            i, j = rng.sample(range(n), 2)
            matrix[i, j] = matrix[j, i] = rng.choice((-1, 1, 2))
        if matrix.det() != 0:
            return matrix


def quadratic(matrix: sympy.Matrix, v: Sequence[sympy.Expr]) -> sympy.Expr:
    """v^T matrix v / 2, expanded."""
    column = sympy.Matrix(list(v))
    return sympy.expand((column.T * matrix * column)[0, 0] / 2)
