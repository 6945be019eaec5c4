"""Families of the literature: the tree against conditions found by hand and by SymPy.

For each family: the values for which a Lagrangian is known, as a predicate worked out by hand. Where it
is false, SymPy forms the algebraic Helmholtz conditions and finds only singular multipliers; where it is
true, SymPy confirms the Euler-Lagrange equations of the Lagrangian given here.
"""

from __future__ import annotations

import functools
import itertools
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import pytest
import sympy as sp

from inverse_service.inverse_problem.decision.deciding import decide
from inverse_service.inverse_problem.special_cases.case_tree import Node, SpecialCases, special_cases
from inverse_service.mechanics.reading import read_system

Values = Mapping[str, int]
# The search for closed forms takes its time there.
SLOW = {"sprays of a surface"}


@dataclass(frozen=True)
class Family:
    """f as texts, the question, and when there is a Lagrangian; `lagrangians` are (condition, L)."""

    equations: Mapping[str, str]
    parameters: str
    with_time: bool
    known: Callable[[Values], bool]
    lagrangians: tuple[tuple[Callable[[Values], bool], str], ...] = ()
    complete: bool = True


# v and w stand for x' and y'.
FAMILIES = {
    "damped coupled oscillators": Family(
        {"x": "-a*x' + b*y", "y": "-c*y' + d*x"},
        "abcd",
        True,
        lambda p: p["a"] == p["c"] or p["a"] == -p["c"] or p["b"] == p["d"] == 0,
        (
            (lambda p: p["a"] == p["c"] and p["b"] * p["d"] != 0, "exp(a*t)*(d*v**2/2 + b*w**2/2 + b*d*x*y)"),
            (lambda p: p["a"] == p["c"] and p["b"] == 0, "exp(a*t)*(v*w + d*x**2/2)"),
            (lambda p: p["a"] == -p["c"], "v*w + a/2*(x*w - y*v) + d*x**2/2 + b*y**2/2"),
            (lambda p: p["b"] == p["d"] == 0, "exp(a*t)*v**2 + exp(c*t)*w**2"),
        ),
    ),
    "damped coupled oscillators without t in L": Family(
        {"x": "-a*x' + b*y", "y": "-c*y' + d*x"},
        "abcd",
        False,
        lambda p: p["a"] == p["c"] or p["a"] == -p["c"] or p["b"] == p["d"] == 0,
    ),
    "two-dimensional potentials of degree three (Henon-Heiles)": Family(
        {"x": "-x - 2*a*x*y", "y": "-y - b*x^2 + c*y^2"},
        "abc",
        False,
        lambda p: (
            p["a"] * p["b"] != 0
            or (p["a"] == 0 and (p["b"] == 0 or p["c"] == 0))
            or (p["b"] == 0 and p["a"] == -p["c"])
        ),
        (
            (
                lambda p: p["a"] * p["b"] != 0,
                "b*v**2/2 + a*w**2/2 - b*x**2/2 - a*y**2/2 - a*b*x**2*y + a*c*y**3/3",
            ),
            (lambda p: p["a"] == p["c"] == 0, "v*w - x*y - b*x**3/3"),
            (lambda p: p["b"] == 0 and p["a"] == -p["c"], "v*w - x*y + c*x*y**2"),
        ),
    ),
    "coupled van der Pol oscillators": Family(
        {"x": "-x + e*(1 - x^2)*x' + a*y", "y": "-y + e*(1 - y^2)*y' + b*x"},
        "eab",
        False,
        lambda p: p["e"] == 0 or p["a"] == p["b"] == 0,
        ((lambda p: p["e"] == 0 != p["a"] * p["b"], "b*(v**2 - x**2)/2 + a*(w**2 - y**2)/2 + a*b*x*y"),),
    ),
    "gyroscopic forces and a potential": Family(
        {"x": "w*y' - k*x", "y": "-u*x' - m*y"},
        "wukm",
        True,
        lambda p: (p["w"] * p["u"] != 0) or p["k"] == p["m"] or p["w"] == p["u"] == 0,
        ((lambda p: p["w"] * p["u"] != 0, "u*(v**2 - k*x**2)/2 + w*(w_**2 - m*y**2)/2 - w*u*y*v"),),
    ),
    "a force quadratic in one velocity": Family(
        {"x": "-a*y", "y": "-b*x'^2"},
        "ab",
        False,
        lambda p: p["a"] * p["b"] == 0,
        (
            (lambda p: p["a"] == 0, "v**2 + (w + b*x*v)**2"),
            (lambda p: p["b"] == 0, "v*w - a*y**2/2"),
        ),
    ),
    "sprays of a surface": Family(
        {"x": "a*x'^2 + b*y'^2", "y": "c*x'*y'"},
        "abc",
        False,
        lambda p: p["b"] == 0 or p["c"] == 0 or 2 * p["a"] == p["c"],
        complete=False,  # depends on the time that the search for closed forms takes
    ),
    "a magnetic field exponential in x": Family(
        {"x": "-a*exp(k*x)*y'", "y": "b*x'"},
        "abk",
        True,
        lambda p: p["a"] * p["b"] * p["k"] == 0,
    ),
}


@functools.cache
def tree(name: str) -> SpecialCases:
    family = FAMILIES[name]
    system = read_system(list(family.equations), family.equations, list(family.parameters))
    return special_cases(system, family.with_time)


def verdict(node: Node, values: Values) -> str:
    """The verdict of the smallest case in the tree that holds these values."""
    for child in node.children:
        if holds(child, values):
            return verdict(child, values)
    case = node.case
    found = case.autonomous or case.with_time
    assert found is not None
    return found


def holds(node: Node, values: Values) -> bool:
    stratum = node.case.stratum
    numbers = [values[name] for name in stratum.space.names]
    return all(equation(*numbers) == 0 for equation in stratum.equations)


def grid(family: Family) -> list[dict[str, int]]:
    numbers = itertools.product((-1, 0, 1, 2), repeat=len(family.parameters))
    return [dict(zip(family.parameters, found, strict=True)) for found in numbers]


NAMES = [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in FAMILIES]


@pytest.mark.parametrize("name", NAMES)
def test_the_tree_agrees_with_what_is_known_for_all_small_values(name: str) -> None:
    family, found = FAMILIES[name], tree(name)
    verdicts = {tuple(values.values()): verdict(found.root, values) for values in grid(family)}
    known = {tuple(values.values()): family.known(values) for values in grid(family)}
    assert {True, False} == set(known.values())
    assert {key: value == "variational" for key, value in verdicts.items()} == known
    assert found.complete or not family.complete


@pytest.mark.parametrize("name", NAMES)
def test_the_tree_agrees_with_the_decision_at_numbers(name: str) -> None:
    family = FAMILIES[name]
    for values in random.Random(name).sample(grid(family), 4):
        system = read_system(list(family.equations), family.equations, values)
        assert decide(system, family.with_time).verdict == verdict(tree(name).root, values), values


X, Y, V, W, T = sp.symbols("x y v w_ t")


def forces(family: Family, values: Values) -> list[sp.Expr]:
    texts = [text.replace("x'", "v").replace("y'", "w_").replace("^", "**") for text in family.equations.values()]
    return [sp.sympify(text, locals={"w_": W}).subs(values) for text in texts]


@pytest.mark.parametrize("name", FAMILIES)
def test_sympy_confirms_each_lagrangian(name: str) -> None:
    family = FAMILIES[name]
    for condition, text in family.lagrangians:
        for values in [values for values in grid(family) if condition(values)][:3]:
            written = text if "w" in family.parameters else text.replace("w", "w_")
            lagrangian = sp.sympify(written.replace("w__", "w_"), locals={"w_": W}).subs(values)
            f = forces(family, values)
            for q, v in ((X, V), (Y, W)):
                p = sp.diff(lagrangian, v)
                rate = sum(sp.diff(p, a) * b for a, b in ((T, 1), (X, V), (Y, W), (V, f[0]), (W, f[1])))
                assert sp.simplify(rate - sp.diff(lagrangian, q)) == 0, values
            assert sp.simplify(sp.hessian(lagrangian, (V, W)).det()) != 0
            assert family.known(values)


@pytest.mark.parametrize("name", FAMILIES)
def test_sympy_finds_only_singular_multipliers_elsewhere(name: str) -> None:
    """g Phi, g nabla Phi, g nabla^2 Phi, … symmetric leave det g = 0 at a point."""
    family = FAMILIES[name]
    outside = [values for values in grid(family) if not family.known(values)]
    for values in random.Random(name).sample(outside, 2):
        f = forces(family, values)
        slopes = sp.Matrix(f).jacobian((V, W))

        def along(matrix: sp.Matrix, f: list[sp.Expr] = f) -> sp.Matrix:
            return sum((matrix.diff(a) * b for a, b in ((X, V), (Y, W), (V, f[0]), (W, f[1]))), sp.zeros(2))

        tensor = along(slopes) - 2 * sp.Matrix(f).jacobian((X, Y)) - slopes * slopes / 2
        rows = []
        for _ in range(4):
            rows.append([-tensor[0, 1], tensor[0, 0] - tensor[1, 1], tensor[1, 0]])
            tensor = (along(tensor) - slopes * tensor / 2 + tensor * slopes / 2).applyfunc(sp.expand)
        point = {X: sp.Rational(3, 7), Y: sp.Rational(5, 3), V: sp.Rational(2, 5), W: sp.Rational(7, 2)}
        kernel = sp.Matrix(rows).subs(point).applyfunc(sp.nsimplify).nullspace()
        letters = sp.symbols(f"c0:{max(len(kernel), 1)}")
        g = sum((c * k for c, k in zip(letters, kernel, strict=False)), sp.zeros(3, 1))
        assert sp.expand(g[0] * g[2] - g[1] ** 2) == 0, values
