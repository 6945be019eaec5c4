"""Systems of any size, as documents: families that show how cost grows, and random systems for
medians.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

Document = dict[str, Any]


def _document(name: str, equations: list[str]) -> Document:
    coordinates = [f"x{i}" for i in range(1, len(equations) + 1)]
    return {
        "name": name,
        "coordinates": coordinates,
        "equations": dict(zip(coordinates, equations, strict=True)),
    }


def oscillator_chain(n: int) -> Document:
    """Linear springs of different stiffness between neighbors: variational."""
    equations = []
    for i in range(1, n + 1):
        left = f" + {i - 1}*x{i - 1}" if i > 1 else ""
        right = f" + {i}*x{i + 1}" if i < n else ""
        equations.append(f"-{2 * i - 1 + (i == n)}*x{i}{left}{right}")
    return _document(f"oscillator chain, n = {n}", equations)


def cubic_chain(n: int) -> Document:
    """Springs with a cubic force between neighbors and walls (Fermi, Pasta, Ulam, Tsingou):
    variational.
    """

    def stretch(i: int) -> str:
        left, right = (f"x{k}" if 1 <= k <= n else "0" for k in (i, i + 1))
        return f"({right} - {left})"

    equations = [
        f"{stretch(i)} - {stretch(i - 1)} + {stretch(i)}^3 - {stretch(i - 1)}^3"
        for i in range(1, n + 1)
    ]
    return _document(f"cubic chain, n = {n}", equations)


def nilpotent_group(n: int) -> Document:
    """Geodesics of the canonical connection of a Lie group with an abelian ideal: variational."""
    equations = [f"-x{n}'*x{i + 1}'" for i in range(1, n - 1)] + ["0", "0"][: min(n, 2)]
    return _document(f"nilpotent group, n = {n}", equations)


def random_quadratic(n: int, seed: int = 1) -> Document:
    """Random quadratic forms in positions and velocities: not variational for n >= 2."""
    rng = random.Random(f"quadratic/{n}/{seed}")
    atoms = [f"x{i}{mark}" for i in range(1, n + 1) for mark in ("", "'")]
    equations = []
    for _ in range(n):
        terms = (f"{rng.randint(1, 5)}*{rng.choice(atoms)}*{rng.choice(atoms)}" for _ in range(3))
        equations.append(" - ".join(terms))
    return _document(f"random quadratic {seed}, n = {n}", equations)


def random_natural(n: int, seed: int = 1) -> Document:
    """x'' = -dV/dx for a random polynomial V: variational."""
    rng = random.Random(f"natural/{n}/{seed}")
    parts: list[list[str]] = [[f"-{rng.randint(1, 5)}*x{i}"] for i in range(1, n + 1)]
    for _ in range(n):
        i, j, c = rng.randint(1, n), rng.randint(1, n), rng.randint(1, 4)
        # the term c xi xj^2 of V
        parts[i - 1].append(f"- {c}*x{j}^2")
        parts[j - 1].append(f"- {2 * c}*x{i}*x{j}")
    return _document(f"random natural {seed}, n = {n}", [" ".join(terms) for terms in parts])


GROWING: dict[str, Callable[[int], Document]] = {
    "oscillator chain": oscillator_chain,
    "cubic chain": cubic_chain,
    "nilpotent group": nilpotent_group,
    "random quadratic": random_quadratic,
}
