"""Sets cut out by inequalities contain their point, are connected, and everything asked for is positive on them."""

from __future__ import annotations

import random

import mpmath
import pytest

from inverse_service.algebra.components import component
from inverse_service.algebra.real_point import are_positive, find_real_point, requirements
from inverse_service.expressions.inequalities import inequality_text
from inverse_service.expressions.tree import Symbol, Velocity, walk
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

NAMES = Names(("x", "y"), ("a", "k"), {"F": ("x",)})
VARIABLES = [Symbol("x"), Symbol("y"), Velocity("x"), Velocity("y"), Symbol("a"), Symbol("k")]
CONSTANTS = [Symbol("a"), Symbol("k")]

EXPECTED = {
    "sqrt(x-1)": ["x > 1"],
    "sqrt(x*y)": ["y > 0", "x > 0"],
    "1/sqrt(x^2+y^2)": ["x^2 + y^2 > 0"],
    "acosh(x)": ["x > 1"],
    "log(sin(x))": ["x > 0", "x < pi"],
    "sqrt(1-sin(x))": ["x > -3*pi/2", "x < pi/2"],
    "sqrt(x^2+y^2-1)": ["x^2 + y^2 > 1"],
    "sqrt(1-x^2-y^2)": ["x^2 + y^2 < 1"],
    "sqrt(x*y-1)": ["y > 0", "x*y > 1"],
    "log(x+sqrt(x^2+1))": [],
    "log(exp(x)-2)": ["x > log(2)"],
    "sqrt(k*x^2+a*y^2)": ["k > 0", "a > 0", "k*x^2 + a*y^2 > 0"],
    "x^a*x^k*y": ["x > 0"],
    "sqrt(F(x))": ["F(x) > 0"],
    "atan(1/x)": ["x > 0"],
}
# Sets that are cut smaller, or with many inequalities.
FURTHER = [
    "sqrt(x^2-1)", "sqrt(x^2-2)", "log(x^3-3*x+1)", "asin(x*y)", "sqrt(x^2-y^2)", "log(1-sqrt(x))", "sqrt(y-sqrt(x))",
    "log(cos(y)*x' - x*sin(y)*y')", "sqrt(x'^2+y'^2-(x*y'-y*x')^2)", "sqrt(1-x^2*y^2)", "log(1-exp(x*y)*x')",
]  # fmt: skip


@pytest.mark.parametrize("text", EXPECTED)
def test_domains_are_written_as_a_person_would(text: str) -> None:
    formula = read_formula(text, NAMES)
    table = find_real_point([formula], VARIABLES, 1)
    assert table is not None
    found = component(requirements([formula], table), table, CONSTANTS)
    assert [inequality_text(tree) for tree in found] == EXPECTED[text]


@pytest.mark.slow
@pytest.mark.parametrize("text", [*EXPECTED, *FURTHER])
def test_what_is_asked_for_is_positive_wherever_the_conditions_are(text: str) -> None:
    formula, rng, inside = read_formula(text, NAMES), random.Random(text), 0
    for seed in (1, 2, 3):
        table = find_real_point([formula], VARIABLES, seed)
        assert table is not None
        wanted = requirements([formula], table)
        found = component(wanted, table, CONSTANTS)
        assert are_positive(found, table), "the point belongs to its set"
        for _ in range(400):
            there = {name: mpmath.mpf(value) + rng.gauss(0, 1) for name, value in table.items()}
            if are_positive(found, there):
                inside += 1
                assert are_positive(wanted, there)
    assert inside


def test_a_narrow_box_contains_its_point() -> None:
    """What is positive at the point grows towards the point of three digits: a box about that one may leave it out."""
    table = {Symbol("x"): mpmath.mpf("1.2251"), Symbol("y"): mpmath.mpf("0.765")}
    limit = mpmath.exp(table[Symbol("x")] * table[Symbol("y")]) + mpmath.sin(sum(table.values())) - 0.0005
    formula = read_formula(f"sqrt(exp(x*y) + sin(x+y) - {mpmath.nstr(limit, 12)})", NAMES)
    assert are_positive(component(requirements([formula], table), table), table)


@pytest.mark.slow
@pytest.mark.parametrize("text", [*EXPECTED, *FURTHER])
def test_two_points_of_a_domain_are_joined_by_a_path_in_it(text: str) -> None:
    """By a walk of small random steps among many points: a coarse test, but it fails for two components."""
    formula, rng = read_formula(text, NAMES), random.Random(text)
    table = find_real_point([formula], VARIABLES, 1)
    assert table is not None
    found = component(requirements([formula], table), table, CONSTANTS)
    names = [name for name in table if any(name in _names(tree) for tree in found)]
    if not 0 < len(names) <= 2:
        return
    grid = _grid(names, table, found)
    start = min(grid, key=lambda cell: rng.random())
    reached, front = {start}, [start]
    while front:
        cell = front.pop()
        for k in range(len(cell)):
            for step in (-1, 1):
                other = (*cell[:k], cell[k] + step, *cell[k + 1 :])
                if other in grid and other not in reached:
                    reached.add(other)
                    front.append(other)
    assert len(reached) > 0.97 * len(grid)


def _names(tree: object) -> set[object]:
    return set(walk(tree))  # type: ignore[arg-type]


def _grid(names: list[object], table: dict, found: list) -> set[tuple[int, ...]]:  # type: ignore[type-arg]
    """The cells of a grid whose middles are in the set."""
    steps = range(-40, 41)
    cells = [(i,) for i in steps] if len(names) == 1 else [(i, j) for i in steps for j in steps]
    inside = set()
    for cell in cells:
        there = dict(table) | {
            name: mpmath.mpf(k) / 8 + mpmath.mpf("0.03") for name, k in zip(names, cell, strict=True)
        }
        if are_positive(found, there):
            inside.add(cell)
    return inside
