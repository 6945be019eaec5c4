"""Random systems with a known Lagrangian, as a user might type them."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

import sympy

from tests.generator.euler_lagrange import accelerations, residual
from tests.generator.families import FAMILIES, with_time
from tests.generator.ingredients import Space, random_space
from tests.generator.shapes import SHAPES

LONGEST = 700
TIME_SHARE = 0.15


@dataclass(frozen=True, slots=True)
class GeneratedSystem:
    """q'' = f with a Lagrangian; `time_dependent` says whether t occurs in the Lagrangian."""

    id: str
    family: str
    n: int
    coordinates: tuple[str, ...]
    equations: dict[str, str]
    lagrangian: str
    time_dependent: bool
    space: Space
    accelerations: tuple[sympy.Expr, ...]
    lagrangian_expression: sympy.Expr

    @property
    def document(self) -> dict[str, object]:
        """The system as a user would send it."""
        return {
            "name": self.id,
            "coordinates": list(self.coordinates),
            "equations": dict(self.equations),
        }


def text(expression: sympy.Expr) -> str:
    """The expression in the canonical grammar; a velocity is a symbol whose name ends in a
    prime.
    """
    printed: str = sympy.sstr(expression)
    return printed.replace("**", "^")


def random_systems(
    count: int, seed: int, families: Sequence[str] = tuple(FAMILIES)
) -> list[GeneratedSystem]:
    """`count` systems that cycle through the families and n = 1 to 4; a seed determines them."""
    return [random_system(index, seed, families) for index in range(count)]


def random_system(
    index: int, seed: int, families: Sequence[str] = tuple(FAMILIES)
) -> GeneratedSystem:
    """The system with this number."""
    kinds = len(families)
    return _one(index, seed, families[index % kinds], 1 + index // kinds % 4)


def _one(index: int, seed: int, family: str, n: int) -> GeneratedSystem:
    rng = random.Random(f"{seed}/{index}")
    while True:
        s = random_space(rng, n)
        lagrangian = (FAMILIES | SHAPES)[family](rng, s)
        if rng.random() < TIME_SHARE:
            lagrangian = with_time(rng, s, lagrangian)
        try:
            f = accelerations(lagrangian, s)
        except ValueError:
            continue  # a singular draw, such as v1 v2 without v1^2 and v3^2
        if sum(len(text(a)) for a in f) <= LONGEST:
            return assembled(f"{family}-{seed}-{index}", family, s, f, lagrangian)


def assembled(
    name: str, family: str, s: Space, f: Sequence[sympy.Expr], lagrangian: sympy.Expr
) -> GeneratedSystem:
    """The system, after its Lagrangian is verified at two points with 40 digits. Raises
    AssertionError if it fails.
    """
    for seed in (1, 2):
        defect, determinant = residual(lagrangian, f, s, seed)
        if not (defect < 1e-30 and determinant > 1e-12):
            raise AssertionError(
                f"{name}: Euler-Lagrange residual {defect}, determinant {determinant}"
            )
    names = tuple(q.name for q in s.coordinates)
    equations = dict(zip(names, map(text, f), strict=True))
    timed = any(symbol.name == "t" for symbol in lagrangian.free_symbols)
    return GeneratedSystem(
        name, family, s.n, names, equations, text(lagrangian), timed, s, tuple(f), lagrangian
    )
