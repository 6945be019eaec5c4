"""Random Lagrangians of each kind, their equations made by SymPy, and near misses: every verdict with a valid proof."""

from __future__ import annotations

import random

import pytest
import sympy

from inverse_service.certificate.checker import check_certificate
from inverse_service.inverse_problem.decision import certify
from inverse_service.inverse_problem.decision.analysis import analyse
from inverse_service.inverse_problem.decision.deciding import decide
from inverse_service.inverse_problem.kinds.restricted import kind_named
from inverse_service.mechanics.reading import read_system

x, y, u, v = sympy.symbols("x y u v")
KINDS = ("natural", "riemannian", "finsler")
YES, NO = "variational", "not_variational"
EXPECTED = {"riemannian": (YES, YES, YES), "natural": (YES, NO, NO), "finsler": (NO, NO, YES)}
# What is added to the first equation: homogeneous of another degree, or such that no Finsler function has it.
MISSES = {"riemannian": "x'*y'^2/7", "finsler": "x'^3/y'"}


def random_lagrangian(kind: str, seed: int) -> sympy.Expr:
    draw = random.Random(seed).randint
    if kind == "finsler":
        return (1 + x**2 + draw(1, 3) * y) * u**4 / v**2
    kinetic = (1 + draw(-2, 2) * x + draw(1, 2) * y) * u**2 / 2 + draw(-1, 1) * x * u * v + (3 + draw(-2, 2) * x) * v**2
    return kinetic if kind == "riemannian" else kinetic - x * y**2 - draw(1, 3) * x + draw(1, 3) * y * u


def equations(lagrangian: sympy.Expr) -> dict[str, str]:
    """The accelerations, by SymPy."""
    q, w = (x, y), (u, v)
    g = sympy.Matrix(2, 2, lambda i, j: lagrangian.diff(w[i], w[j]))
    b = sympy.Matrix([lagrangian.diff(q[i]) - sum(lagrangian.diff(w[i], q[j]) * w[j] for j in (0, 1)) for i in (0, 1)])
    texts = [str(sympy.together(f)).replace("**", "^") for f in g.inv() * b]
    return dict(zip("xy", (text.replace("u", "x'").replace("v", "y'") for text in texts), strict=True))


def proven(forces: dict[str, str]) -> tuple[str, ...]:
    """The verdict on each kind, once the checker has found its certificate valid."""
    system = read_system(coordinates=["x", "y"], equations=forces, parameters=[], functions={})
    analysis, found = analyse(system), []
    for name in KINDS:
        kind = kind_named(name, system.coordinates)
        decision = decide(system, False, analysis=analysis, among=kind.derivations)
        assert check_certificate(certify.of_decision(analysis, decision, kind=kind), seed=1).verdict == "valid"
        found.append(decision.verdict)
    return tuple(found)


SEEDS = [1, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(2, 60))]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", EXPECTED)
def test_random_lagrangians_are_of_their_kind(kind: str, seed: int) -> None:
    assert proven(equations(random_lagrangian(kind, seed))) == EXPECTED[kind]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", MISSES)
def test_near_misses_are_of_no_kind(kind: str, seed: int) -> None:
    forces = equations(random_lagrangian(kind, seed))
    assert proven({**forces, "x": f"{forces['x']} + {MISSES[kind]}"}) == (NO, NO, NO)
