"""Random right-hand sides without any structure; almost none of them has a Lagrangian for n >=
2.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

import sympy

from tests.generator.ingredients import Space, coefficient, random_space
from tests.generator.systems import text

KINDS = ("polynomial", "rational", "trigonometric")


@dataclass(frozen=True, slots=True)
class RandomRightSide:
    """q'' = f without any known structure."""

    id: str
    kind: str
    n: int
    coordinates: tuple[str, ...]
    equations: dict[str, str]

    @property
    def document(self) -> dict[str, object]:
        """The system as a user would send it."""
        return {
            "name": self.id,
            "coordinates": list(self.coordinates),
            "equations": dict(self.equations),
        }


def random_right_sides(count: int, seed: int) -> list[RandomRightSide]:
    """`count` systems that cycle through the kinds and n = 2 to 4; a seed determines them."""
    return [random_right_side(index, seed) for index in range(count)]


def random_right_side(index: int, seed: int) -> RandomRightSide:
    """The system with this number."""
    return _one(index, seed, KINDS[index % 3], 2 + index // 3 % 3)


def _one(index: int, seed: int, kind: str, n: int) -> RandomRightSide:
    rng = random.Random(f"right side/{seed}/{index}")
    s = random_space(rng, n)
    f = [_right_side(rng, s, kind) for _ in s.coordinates]
    names = tuple(q.name for q in s.coordinates)
    return RandomRightSide(
        f"{kind}-{seed}-{index}", kind, n, names, dict(zip(names, map(text, f), strict=True))
    )


def _right_side(rng: random.Random, s: Space, kind: str) -> sympy.Expr:
    atoms = (*s.coordinates, *s.velocities)
    polynomial = sum((_term(rng, atoms) for _ in range(rng.randint(2, 4))), sympy.Integer(0))
    if kind == "rational":
        return polynomial / (1 + rng.choice(atoms) ** rng.randint(1, 2))
    if kind == "trigonometric":
        a, b = rng.choice(s.coordinates), rng.choice(s.coordinates)
        return polynomial + coefficient(rng) * rng.choice(
            (sympy.sin(a), sympy.cos(a - b))
        ) * rng.choice(atoms)
    return polynomial


def _term(rng: random.Random, atoms: Sequence[sympy.Symbol]) -> sympy.Expr:
    factors = (rng.choice(atoms) for _ in range(rng.randint(1, 3)))
    return sympy.Mul(coefficient(rng), *factors)
