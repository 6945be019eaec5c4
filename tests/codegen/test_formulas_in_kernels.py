"""Kernels agree with 40-digit values of the formulas."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
import symengine
from mpmath import mp

from inverse_service.errors import InputError
from inverse_service.expressions.calculus import evaluate
from inverse_service.expressions.tree import Expression, Symbol
from inverse_service.kernels.codegen.compiled import kernel_text, load, object_code
from inverse_service.kernels.codegen.symengine_trees import (
    closure,
    symbol,
    table_of_leaves,
    translate,
)
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from tests.codegen.run_program import call, card_of, memory_for, program_for, values_of

FORMULAS = [
    "x + 2*y - 3", "-x", "-x - y", "x*y/(1 + x^2)", "1/x/y", "-1/(x*y)", "x^3*y^-2", "(x + y)^7", "sqrt(x)*y",
    "1/sqrt(x)", "x^(3/2)", "x^(-5/2)", "x^y", "x^0.3", "exp(x)", "exp(-x^2)", "log(x)", "sin(x)", "cos(x)*sin(x)",
    "tan(x)", "cot(x)", "sec(x)", "csc(x)", "sinh(x)", "cosh(x)", "tanh(x)", "sech(x)", "csch(x)", "coth(x)", "atan(x)",
    "asinh(x)", "asin(x/4)", "acos(x/4)", "acosh(3 + x)", "atanh(x/4)", "pi*x", "x/3", "sin(x + y)/cos(x + y)^2",
    "x*y + x*y*pi", "(x + y)*(x + y + 1)/(x + y)", "sin(x)^2 + cos(x)^2", "1e100*x/1e100", "x - x",
]  # fmt: skip
POINTS = [
    {"c0": 0.7, "c1": 1.3},
    {"c0": 1.9, "c1": -0.4},
    {"c0": 2.5, "c1": 3.1},
    {"c0": 1e-3, "c1": 0.2},
]


def tree_of(text: str) -> Expression:
    return read_formula(text, Names((), ("x", "y")))


def exact(tree: Expression, point: dict[str, float]) -> float:
    with mp.workdps(40):
        return float(
            evaluate(tree, {Symbol("x"): mp.mpf(point["c0"]), Symbol("y"): mp.mpf(point["c1"])})
        )


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [1, 4])
def test_values_agree_with_forty_digits(lanes: int) -> None:
    table = table_of_leaves((), ("x", "y"))
    trees = [tree_of(text) for text in FORMULAS]
    formulas = [translate(tree, table) for tree in trees]
    groups = [POINTS] if lanes == 4 else [[point] for point in POINTS]
    for group in groups:
        for text, tree, row in zip(FORMULAS, trees, values_of(formulas, group), strict=True):
            for value, point in zip(row, group, strict=True):
                expected = exact(tree, point)
                assert value == pytest.approx(expected, rel=2e-14, abs=1e-15), (text, point)


def test_numbers_and_names_above_and_below_a_fraction_stay() -> None:
    """Products are written constants first: no factor is lost, whether a loop changes it or not."""
    texts = [
        "x/sqrt(2)",
        "x/cos(1/2)*y",
        "-x*y/(sqrt(3)*(1 + y))",
        "2/(3*sqrt(2))",
        "-y^2/pi - x/y + x/y^2",
    ]
    trees, table = [tree_of(text) for text in texts], table_of_leaves((), ("x", "y"))
    formulas = [translate(tree, table) for tree in trees]
    moving = [formula.subs({symbol("c1"): symbol("s0")}) for formula in formulas]
    row = [value for (value,) in values_of([*formulas], [POINTS[0]])]
    assert row == pytest.approx([exact(tree, POINTS[0]) for tree in trees], rel=1e-14)
    program = program_for(moving, ["c0"])
    card = card_of(program)
    memory = memory_for(card, [{"c0": POINTS[0]["c0"], "s0": POINTS[0]["c1"]}])
    call(load(object_code(kernel_text(program))), card, memory)
    first = card.layout.names.index("s0")
    found = memory[first : first + len(texts), 0] - [POINTS[0]["c1"], 0, 0, 0, 0]
    assert found == pytest.approx([exact(tree, POINTS[0]) for tree in trees], rel=1e-14)


@pytest.mark.slow
def test_sine_and_cosine_are_good_to_two_units() -> None:
    """For small and large arguments, multiples of pi/2, beyond the fast range, and for values that
    are not finite.
    """
    generator = random.Random(1)
    points = [generator.uniform(-10, 10) for _ in range(4000)]
    points += [generator.uniform(-6e7, 6e7) for _ in range(4000)]
    points += [k * math.pi / 2 for k in range(-2000, 2000)]
    points += [10.0**k for k in range(-300, 300, 7)] + [
        0.0,
        -0.0,
        5e-324,
        6.7108864e7,
        6.7108865e7,
        1.7e308,
    ]
    points += [0.0] * (-len(points) % 8)
    x = symbol("x")
    worst = 0.0
    from inverse_service.kernels.codegen.compiled import kernel_text, load, object_code

    for lanes in (1, 8):
        program = program_for([symengine.sin(x), symengine.cos(x)], ["x"])
        card = card_of(program, lanes)
        machine = load(object_code(kernel_text(program, lanes)))
        for first in range(0, len(points), lanes):
            group = points[first : first + lanes]
            memory = memory_for(card, [{"x": value} for value in group])
            call(machine, card, memory)
            for row, function in ((4, math.sin), (5, math.cos)):
                for lane, value in enumerate(group):
                    expected = function(value)
                    worst = max(worst, abs(memory[row, lane] - expected) / math.ulp(expected))
    assert worst <= 2.0
    assert np.isnan(values_of([symengine.sin(x)], [{"x": float("inf")}])).all()


def test_an_expression_without_a_formula_is_rejected() -> None:
    names = Names(("x",), (), {"A": ("x",)})
    with pytest.raises(InputError, match="The function A has"):
        translate(read_formula("A(x)", names), table_of_leaves(("x",), ()))
    with pytest.raises(InputError, match="t is neither"):
        translate(read_formula("x + t", names), table_of_leaves(("x",), ()))
    with pytest.raises(InputError, match="accelerations"):
        translate(read_formula("x''", names), table_of_leaves(("x",), ()))


def test_names_of_the_user_never_reach_the_kernel() -> None:
    """A parameter named alpha, h, or like a function is an ordinary number."""
    table = table_of_leaves(("a", "d0", "h"), ("alpha", "q0", "weights"))
    assert {str(value) for value in table.values()} == {
        "pi", "c0", "c1", "c2", "p0", "p1", "p2", "q0", "q1", "q2", "v0", "v1", "v2",
    }  # fmt: skip


def test_closures_have_the_values_of_their_formulas_for_any_names() -> None:
    """Common subexpressions get names that no formula contains, such as x0 here."""
    names = ["x0", "x1", "x2", "x3", "x4", "x5"]
    a, b, c = map(symbol, names[3:])
    common = symengine.sin(a * b + c) + (a + b) ** 3
    formulas = [common * a, common / (1 + b**2), common + common**2 * c]
    numbers = [5.0, 6.0, 7.0, 0.3, 0.7, -1.1]
    u = math.sin(0.3 * 0.7 - 1.1) + 1.0**3
    expected = [u * 0.3, u / (1 + 0.7**2), u - 1.1 * u**2]
    assert closure(tuple(names), tuple(formulas))(numbers).ravel().tolist() == pytest.approx(
        expected, rel=1e-14
    )
