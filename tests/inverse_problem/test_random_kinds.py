"""Random Lagrangians of each kind, their equations made by SymPy, and near misses: every verdict with a valid proof."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from typing import Any

import pytest
import sympy

from inverse_service.certificate.checker import check_certificate
from inverse_service.expressions.tree import number
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.kinds.restricted import invariant, kind_named
from inverse_service.inverse_problem.of_kind.definite import answer_definite
from inverse_service.inverse_problem.of_kind.kind_answers import answer_kind
from inverse_service.inverse_problem.of_kind.rayleigh import answer_rayleigh
from inverse_service.inverse_problem.search.protocol import describe
from inverse_service.inverse_problem.search.row_factors import lagrangian_as_given
from inverse_service.inverse_problem.solutions import Answer, Solution, SolveOptions
from inverse_service.mechanics.reading import read_given, read_system

x, y, u, v, p, r = sympy.symbols("x y u v p r")
YES, NO = "variational", "not_variational"
Draw = Callable[[int, int], int]
Maker = Callable[[Draw], str]


def equations(lagrangian: sympy.Expr, drag: sympy.Expr = 0, more: sympy.Expr = 0) -> str:
    """E_i = dD/dv_i as they are written, with `more` for the first acceleration, by SymPy."""
    q, w, a = (x, y), (u, v), (p - more, r)
    lines = []
    for i in (0, 1):
        rate = sum(lagrangian.diff(w[i], q[j]) * w[j] + lagrangian.diff(w[i], w[j]) * a[j] for j in (0, 1))
        lines.append(sympy.expand(rate - lagrangian.diff(q[i]) - sympy.sympify(drag).diff(w[i])))
    text = " = 0; ".join(str(line) for line in lines).replace("**", "^") + " = 0"
    for letter, name in (("u", "x'"), ("v", "y'"), ("p", "x''"), ("r", "y''")):
        text = re.sub(rf"\b{letter}\b", name, text)
    return text


def metric(draw: Draw) -> sympy.Expr:
    return (1 + draw(-2, 2) * x + draw(1, 2) * y) * u**2 / 2 + draw(-1, 1) * x * u * v + (3 + draw(-2, 2) * x) * v**2


def natural(draw: Draw) -> sympy.Expr:
    return metric(draw) - x * y**2 - draw(1, 3) * x + draw(1, 3) * y * u


def finsler(draw: Draw) -> sympy.Expr:
    return (1 + x**2 + draw(1, 3) * y) * u**4 / v**2


def friction(draw: Draw) -> sympy.Expr:
    return -(draw(1, 3) + x**2) * u**2 / 2 - draw(1, 3) * v**2 / 2 + draw(-1, 1) * u * v


def cyclic(draw: Draw) -> sympy.Expr:
    """Without x."""
    return (1 + draw(1, 3) * y**2) * u**2 / 2 + draw(1, 3) * u * v + (2 + y) * v**2 + draw(1, 3) * y**2 * u - y**3


def springs(draw: Draw, sign: int) -> str:
    """K with real eigenvalues that differ, or with complex ones."""
    a, b, c, d = (draw(-3, 3) for _ in range(4))
    while ((a - d) ** 2 + 4 * b * c) * sign <= 0:
        a, b, c, d = (draw(-3, 3) for _ in range(4))
    return f"x'' = {a}*x + {b}*y; y'' = {c}*x + {d}*y"


# Of each kind: systems that have such a Lagrangian, and ones that just miss it.
CASES: dict[str, tuple[Maker, Maker]] = {
    "natural": (lambda d: equations(natural(d)), lambda d: equations(natural(d), more=u * v**2 / d(2, 9))),
    "riemannian": (lambda d: equations(metric(d)), lambda d: equations(metric(d), more=d(1, 5) * y)),
    "finsler": (lambda d: equations(finsler(d)), lambda d: equations(finsler(d), more=u**3 / v * d(1, 5))),
    "invariant": (lambda d: equations(cyclic(d)), lambda d: equations(cyclic(d), more=d(1, 5) * x)),
    "rayleigh": (
        lambda d: equations(natural(d), friction(d)),
        lambda d: equations(natural(d), friction(d), more=u**3 / d(2, 9)),
    ),
    "positive_definite": (lambda d: springs(d, 1), lambda d: springs(d, -1)),
}


def verdict_on(name: str, text: str) -> str:
    """The verdict about one kind; its certificate is valid."""
    variables = ["x", "y", "z"][: 2 + ("z" in text)]
    given = read_given(variables, text, [], {})
    system = read_system(coordinates=variables, equations=text, parameters=[], functions={})
    analysis, end, names = analyze(system), float("inf"), system.coordinates
    if name == "rayleigh":
        found = answer_rayleigh(analysis, given.residuals, lambda _: [], 1, end)
    else:
        kind = invariant([{"x": ("1", number(1))}], names) if name == "invariant" else kind_named(name, names)
        tree = lagrangian_as_given(system, given.residuals)
        known = None if tree is None else describe(analysis, tree, "")
        solution = Solution(system, Answer("undetermined", lagrangian=known), None, None)
        if name == "positive_definite":
            found = answer_definite(solution, kind, {}, 1, end)
        else:
            found = answer_kind(solution, kind, SolveOptions(), end)
    assert found.certificate is not None, found.reason
    assert check_certificate(found.certificate, seed=1).verdict == "valid"
    assert found.certificate["among"] == kind_name(name)
    return found.verdict


def kind_name(name: str) -> Any:
    return {"invariant": [{"x": "1"}]} if name == "invariant" else name


# Nightly: 500 of each.
SEEDS = [1, 2, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(3, 501))]


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", CASES)
def test_random_lagrangians_are_of_their_kind(name: str, seed: int) -> None:
    assert verdict_on(name, CASES[name][0](random.Random(seed).randint)) == YES


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", CASES)
def test_near_misses_are_not(name: str, seed: int) -> None:
    assert verdict_on(name, CASES[name][1](random.Random(seed).randint)) == NO
