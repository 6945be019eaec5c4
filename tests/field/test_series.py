"""Power series over a prime field: identities between functions, derivatives, and sums of products
of series.
"""

from __future__ import annotations

from fractions import Fraction

import pytest

from inverse_service.expressions.calculus import differentiate
from inverse_service.expressions.tree import Expression, Symbol
from inverse_service.field.dense_series import (
    SeriesProgram,
    constants_at,
    derivative_along,
    run,
    series_of,
)
from inverse_service.field.modular import Point, SingularPoint, Variable, evaluate, gradient
from inverse_service.field.real_branch import find_real_point, reduce_atoms
from inverse_service.field.tower import draw_point, to_kernels
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

NAMES = Names(("x", "y"), ("k",), {"A": ("u",)})
VARIABLES: list[Variable] = [Symbol("x"), Symbol("y"), Symbol("k")]
PAIRS = [
    ("exp(x + k*y)", "exp(x)*exp(k*y)"),
    ("exp(log(x + y^2))", "x + y^2"),
    ("log(x*(1 + y^2))", "log(x) + log(1 + y^2)"),
    ("sin(x + y)", "sin(x)*cos(y) + cos(x)*sin(y)"),
    ("sin(x*y)^2 + cos(x*y)^2", "1"),
    ("tan(atan(x*y))", "x*y"),
    ("(1 + x^2)^(1/3)*(1 + x^2)^(2/3)", "1 + x^2"),
    ("sqrt(1 + y^2)^5", "(1 + y^2)^2*sqrt(1 + y^2)"),
    ("(x - y)^7", "(x - y)^3*(x - y)^4"),
    ("1/(x + y)", "(x + y)^(-3)*(x + y)^2"),
    ("A(x*y)", "A(y*x + 1 - 1)"),
]


def parsed(text: str) -> Expression:
    return to_kernels(read_formula(text, NAMES))


def point_of(trees: list[Expression]) -> Point:
    return draw_point(reduce_atoms(trees, VARIABLES, find_real_point(trees, VARIABLES, 1)), 3)


def coefficients(program: SeriesProgram, point: Point, *registers: int) -> list[list[int]]:
    instructions = program.listed
    found = run(program, instructions, constants_at(program, point), point.prime, program.order)
    return [found.numbers(register) for register in registers]


@pytest.mark.parametrize("order", [0, 1, 6])
@pytest.mark.parametrize(("left", "right"), PAIRS)
def test_equal_functions_have_equal_series(left: str, right: str, order: int) -> None:
    trees = [parsed(left), parsed(right)]
    point, program = point_of(trees), SeriesProgram(VARIABLES[:2], order)
    first, second = coefficients(program, point, *map(program.expand, trees))
    assert first == second
    assert first[0] == evaluate(trees[0], point)


@pytest.mark.parametrize("text", [text for pair in PAIRS for text in pair])
def test_derivatives_of_series_are_series_of_derivatives(text: str) -> None:
    tree, x = parsed(text), VARIABLES[0]
    slope = differentiate(tree, x)
    point, program = point_of([tree]), SeriesProgram(VARIABLES[:2], 4)
    registers = series_of(program, tree).derivative(0).register, program.expand(slope)
    first, second = coefficients(program, point, *registers)
    assert first[:10] == second[:10]  # to degree 3
    assert gradient(tree, [x], point) == first[:1]


def test_sums_products_and_derivations_of_series_are_those_of_functions() -> None:
    texts = ("sin(x)*y", "exp(x*y)", "x^2 - k")
    trees = [parsed(text) for text in texts]
    point, program = point_of(trees), SeriesProgram(VARIABLES[:2], 5)
    a, b, c = (series_of(program, tree) for tree in trees)
    found = (a + b.scaled(3)) * c - derivative_along([(0, a), (1, b)], c * b)
    product = trees[2] * trees[1]
    parts = [
        part * differentiate(product, x) for part, x in zip(trees, VARIABLES[:2], strict=False)
    ]
    expected = (trees[0] + 3 * trees[1]) * trees[2] - parts[0] - parts[1]
    first, second = coefficients(program, point, found.register, program.expand(expected))
    assert first[:15] == second[:15]  # to degree 4
    assert (a - a).scaled(Fraction(1, 2)).register != a.register
    assert not any(coefficients(program, point, (a - a).register)[0])


def test_what_vanishes_at_the_point_has_no_inverse() -> None:
    program = SeriesProgram(VARIABLES[:2], 3)
    register = program.expand(parsed("1/(x - k)"))
    point = Point(point_of([parsed("x")]).prime, 1, variables={Symbol("x"): 5, Symbol("k"): 5})
    with pytest.raises(SingularPoint):
        coefficients(program, point, register)
