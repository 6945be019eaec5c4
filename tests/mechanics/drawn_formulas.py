"""Formulas of many shapes, drawn anew for each seed, and what two of them have in common."""

from __future__ import annotations

import random
from collections.abc import Iterator
from fractions import Fraction

from mpmath import mpf

from inverse_service.expressions import calculus, tree as ex

COORDINATES, CONSTANTS = ("x", "y"), ("a", "b", "m")
POSITIONS = [*map(ex.Symbol, COORDINATES)]
VELOCITIES = [*map(ex.Velocity, COORDINATES)]
LETTERS = [*map(ex.Symbol, CONSTANTS)]
LEAVES: list[ex.Expression] = [ex.TIME, *POSITIONS, *VELOCITIES, *LETTERS]
DIGITS, ROUND_OFF = 40, mpf(10) ** -20


class Drawn:
    """Formulas with the shapes that rewritings look for: sums of squares, quotients of sums, roots
    of both, functions of angles that belong together, logarithms and exponentials.
    """

    def __init__(self, seed: int) -> None:
        self.source = random.Random(seed)

    def number(self) -> ex.Expression:
        return ex.number(
            self.source.choice([1, 1, 1, 2, 3, -1, -2, Fraction(1, 2), Fraction(-3, 4)])
        )

    def leaf(self) -> ex.Expression:
        return self.source.choice(LEAVES)

    def monomial(self, leaves: list[ex.Expression] = LEAVES) -> ex.Expression:
        chosen = self.source.sample(leaves, self.source.randint(1, min(3, len(leaves))))
        powers = [one ** self.source.choice([1, 1, 1, 2, 3, -1, -2]) for one in chosen]
        return ex.multiply(self.number(), *powers)

    def linear(self) -> ex.Expression:
        several = self.source.sample(LEAVES, self.source.randint(2, 3))
        return ex.add(*(self.number() * one for one in several))

    def sum_of(self) -> ex.Expression:
        s, t = self.linear(), self.source.choice([self.linear(), self.monomial()])
        return self.source.choice([
            s, s + 1, s**2 + t**2, s * t + 1, s**2 - t**2, s**2 + 2 * s * t + t**2, 1 + t**2,
            ex.add(*(self.monomial() for _ in range(3))), self.monomial() * s + self.monomial() * t,
        ])  # fmt: skip

    def factor(self, depth: int) -> ex.Expression:
        u = self.sum_of() if depth else self.linear()
        kind = self.source.randrange(8)
        if kind < 3:
            return u ** self.source.choice([1, 1, 2, 3, -1, -2])
        if kind < 5:
            exponents = [Fraction(1, 2), Fraction(-1, 2), Fraction(3, 2), Fraction(1, 3)]
            return ex.power(u, self.source.choice(exponents))
        if kind == 5:
            return ex.power(u, self.source.choice(LETTERS) + self.source.randint(-1, 1))
        if kind == 6 and depth:
            inner = self.term(depth - 1)
            name = self.source.choice(["sin", "exp", "log", "atan", "tanh", "asinh", "abs"])
            return ex.square_root(inner**2) if name == "abs" else ex.Apply(name, inner)
        return self.function()

    def function(self) -> ex.Expression:
        angle, other = self.source.choice(
            [(self.leaf(), self.leaf()), (self.linear(), self.leaf())]
        )
        sin, cos = ex.Apply("sin", angle), ex.Apply("cos", angle)
        c, u = self.monomial(LETTERS), self.linear()
        return self.source.choice([
            sin, cos, sin / cos, sin**2, cos**2, c - c * cos**2, c * sin**2 + c * cos**2,
            cos * ex.Apply("cos", other) + sin * ex.Apply("sin", other), 1 + ex.Apply("tan", angle) ** 2,
            ex.Apply("log", u + ex.square_root(u**2 + 1)), c * ex.Apply("log", u) - c * ex.Apply("log", other),
            ex.Apply("exp", u) + ex.Apply("exp", -u), 1 / (1 + ex.Apply("exp", -u)), ex.Apply("exp", u),
            ex.power(u**2, Fraction(3, 2)), ex.Apply("cosh", angle) ** 2 - ex.Apply("sinh", angle) ** 2,
        ])  # fmt: skip

    def term(self, depth: int) -> ex.Expression:
        count = self.source.randint(0, 2)
        return ex.multiply(self.monomial(), *(self.factor(depth) for _ in range(count)))

    def shape(self) -> ex.Expression:
        """What one of the rewritings looks for, and nothing beside it that would hide it."""
        c, u, w = self.monomial(LETTERS), self.linear(), self.linear()
        x, y, z = self.source.sample(LEAVES, 3)
        sin, cos = ex.Apply("sin", x), ex.Apply("cos", x)
        log, e = ex.Apply("log", x / w), ex.Apply("exp", -x)
        return self.source.choice([
            c - c * cos**2, c - c * sin**2, y * sin**3 / cos**2, 1 + ex.Apply("tan", x) ** 2, -c * u * x, -c / u,
            ex.power(-x / u, Fraction(-1, 2)), ex.power(u**2, Fraction(3, 2)), ex.number(Fraction(981, 100)) * cos + x**2,
            (ex.number(981) * cos + ex.number(25) * x**2) / 50, ex.Apply("log", x + ex.square_root(x**2 + 1)) * y,
            1 - log, ex.Apply("log", e * y / (z - e * x)), (1 - u) ** 2 * x + 1 / (1 - u) ** 3, x**2 / c + y**2 / c,
            c * ex.Apply("log", u) - c * ex.Apply("log", w) / 2, (x**2 / 2 + 3 * y**2 / 2) / w, x / c - x * y / c,
            cos * ex.Apply("cos", y) + sin * ex.Apply("sin", y), sin**2 * u + cos**2 * u, 1 / (1 + ex.Apply("exp", -u)),
            18 * (c * x * y - x**2 / 3 - y**2 / 3) / (c**2 - 16), (x + 1) ** 2 * u * y + w * y * x, x**4 - 2 * x**2 + 1,
            -u * x, 1 / ex.square_root(-x / (y - z)),
            ex.power(u, Fraction(1, 2)) * ex.power(w, Fraction(1, 2)), x * y / u + z * y / w, (sin * y) ** 2 + (cos * y) ** 2,
            ex.square_root(u**2 / 4 + w**2 * x**2 / 9), c**2 - c**2 * sin**2 * cos**2 + sin**4, -(c * x) ** 2 + (c * y) ** 2,
        ])  # fmt: skip

    def tree(self) -> ex.Expression:
        shape = self.source.randrange(8)
        if shape == 4:
            return self.shape()
        if shape == 5:
            return self.shape() * self.monomial(LETTERS) + self.monomial()
        if shape > 5:
            return self.shape() + self.term(0) + self.source.choice([ex.ZERO, self.shape()])
        terms = [self.term(1) for _ in range(self.source.randint(1, 4))]
        if shape == 0:  # what terms have in common
            return self.factor(1) * ex.add(*terms) + self.monomial()
        if shape == 1:
            return ex.add(*terms) / self.sum_of()
        if shape == 2:
            return ex.add(*terms) + self.lagrangian()
        return ex.add(*terms)

    def lagrangian(self) -> ex.Expression:
        """A kinetic energy with cross terms, terms linear in velocities, and a potential."""
        m, n = (self.monomial(LETTERS) for _ in range(2))
        x, y = self.source.sample(POSITIONS, 2)
        v, w = (ex.Velocity(one.name) for one in (x, y))
        g = self.source.choice(
            [ex.ONE, x**2, ex.Apply("sin", x) ** 2, ex.Apply("cos", x), ex.Apply("exp", ex.TIME)]
        )
        kinetic = self.source.choice([
            m * (v**2 + g * w**2) / 2, m * v**2 / 2 + n * w**2 / 2 + self.number() * g * v * w,
            m * v**2 / 2 + m * g * w**2 / 2, m * (v + n * y) ** 2 / 2 + m * w**2, (v**2 + g * w**2) ** 2 / 4 + v * w,
            v * w - m * ex.square_root(1 + v**2), v * w * m + ex.Apply("log", v),
        ])  # fmt: skip
        linear = self.source.choice([
            ex.ZERO, self.number() * (x * w - y * v), n * x * w, n * ex.Apply("cos", x) ** 2 * w, n * v, -y * x**2 * v,
        ])  # fmt: skip
        k, f = self.source.sample(LETTERS, 2)
        linear += self.source.choice([
            ex.ZERO, -y * ex.Apply("cos", x) * v, n * x**2 * w, 3 * v,
            m * v**2 * ex.Apply("sin", x) ** 2 - n * ex.Apply("cos", x) ** 2 * v,
            -k * x**2 / 2 + k * f * x, k**2 / (2 * f * (1 + f * x**2)), -k * (x - f) ** 2 / 2, k * x * v * y - k * f * v,
        ])  # fmt: skip
        potential = ex.add(
            *(self.source.choice([self.monomial(POSITIONS), self.term(0)]) for _ in range(2))
        )
        kept = ex.substitute(potential, dict.fromkeys(VELOCITIES, ex.ONE))
        whole = kinetic + linear - kept + n * self.source.randint(0, 1)
        return whole * self.source.choice(
            [ex.ONE, ex.ONE, ex.ONE, k, 1 / f, ex.Apply("exp", ex.TIME), 1 + x**2, -ex.ONE]
        )


def points(seed: int, count: int) -> Iterator[dict[ex.Expression, mpf]]:
    """Points; at the first one, every letter is positive."""
    source = random.Random(seed)
    for k in range(count):
        yield {leaf: mpf(source.uniform(-2 if k else 0.2, 2)) for leaf in LEAVES}


def value(tree: ex.Expression, point: dict[ex.Expression, mpf]) -> mpf | None:
    try:
        return calculus.evaluate(tree, point)
    except calculus.NoRealValue:
        return None


def agree(one: mpf, other: mpf) -> bool:
    return bool(abs(one - other) <= ROUND_OFF * (1 + abs(one)))
