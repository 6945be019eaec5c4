"""Factors under roots, the real point that chooses their signs, and disguised squares."""

from __future__ import annotations

from fractions import Fraction

import pytest
from mpmath import mpf

from inverse_service.algebra.elementary import to_kernels
from inverse_service.algebra.generators import Generators, factors, positive_factors, reduce_roots, to_quotient
from inverse_service.algebra.modular import is_positive
from inverse_service.algebra.point import evaluate
from inverse_service.algebra.real_point import find_real_point, real_sign, turns
from inverse_service.algebra.reduction import reduce_atoms
from inverse_service.algebra.tower import Tower, draw_point
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import PI, Apply, Expression, Number, Symbol, number, walk
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

X, Y = Symbol("x"), Symbol("y")


def tree(text: str) -> Expression:
    return to_kernels(parse(text, Names(("x", "y"), ())))


def reduced(*texts: str) -> tuple[Tower, list[Expression]]:
    trees = [tree(text) for text in texts]
    return reduce_atoms(trees, (X, Y), find_real_point(trees, (X, Y), 1)), trees


@pytest.mark.parametrize(
    "text", ["sqrt(x)", "sqrt(-x)", "log(x-5)", "sqrt(1-x^2-y^2)", "asin(30*x)", "sqrt(x-y)+log(y)"]
)
def test_the_real_point_is_one_at_which_all_is_real(text: str) -> None:
    table = find_real_point([tree(text)], (X, Y), 1)
    assert table is not None
    x, y = table[X], table[Y]
    domain = {
        "sqrt(x)": x > 0, "sqrt(-x)": x < 0, "log(x-5)": x > 5, "sqrt(1-x^2-y^2)": x * x + y * y < 1,
        "asin(30*x)": abs(30 * x) < 1, "sqrt(x-y)+log(y)": x > y > 0,
    }  # fmt: skip
    assert domain[text]


@pytest.mark.parametrize("text", ["sqrt(-1-x^2)", "log(x)*log(-x)", "asin(2+x^2)", "1/(x-x)"])
def test_there_is_no_real_point_where_nothing_is_real(text: str) -> None:
    assert find_real_point([tree(text)], (X, Y), 1) is None


def test_the_sign_of_zero_is_refused() -> None:
    with pytest.raises(IrreducibleAtoms, match="sign"):
        real_sign(tree("x-y"), {X: mpf(1), Y: mpf(1)})
    assert real_sign(tree("x-2*y"), {X: mpf(1), Y: mpf(1)}) == -1


def test_what_is_left_of_arctangents_is_told_in_pi_and_constant_ones() -> None:
    table, two = {X: mpf("0.7")}, tree("atan(2)")
    assert turns(table, tree("atan(1/x)"), ((tree("atan(x)"), Fraction(-1)),), []) == ((PI, Fraction(1, 2)),)
    assert turns(table, two, (), []) is None
    assert turns(table, tree("atan(3)"), (), [two]) == ((two, Fraction(-1)), (PI, Fraction(3, 4)))
    with pytest.raises(IrreducibleAtoms, match="real point"):
        turns(None, tree("atan(1)"), (), [])


@pytest.mark.parametrize(
    ("text", "multiplicities"),
    [("x^2-y^2", [1, 1]), ("12*(x+y)^3/x", [2, 1, 3, -1]), ("1/8", [-3]), ("exp(2*x)-1", [1, 1]), ("-5*x", [1, 1])],
)
def test_irreducible_factors_multiply_to_the_expression_up_to_its_sign(text: str, multiplicities: list[int]) -> None:
    tower, (_, expression) = reduced("exp(x)", text)
    point, ring = draw_point(tower, 1), Generators(tower)
    found = list(positive_factors(ring, to_quotient(ring, expression)))
    product = 1
    for factor, multiplicity in found:
        product = product * pow(evaluate(factor, point), multiplicity, point.prime) % point.prime
    value = evaluate(expression, point)
    assert product in (value, point.prime - value)
    assert sorted(multiplicity for _, multiplicity in found) == sorted(multiplicities)


@pytest.mark.parametrize(
    "text",
    [
        *("(x+y)^3/(x-y)", "sin(x)^2+cos(2*x)", "exp(x)+exp(x/2)", "1/sqrt(2)+sqrt(x)", "log(2*x)*log(x)"),
        *("sqrt(1-x^2)", "sin(x+1)*sin(x)", "exp(x+1/2)*exp(x)", "(-8*x)^(1/3)", "(1-x)^(2/3)/y", "atan(x)+x"),
    ],
)
def test_the_quotient_of_polynomials_has_the_value_of_the_tree(text: str) -> None:
    tower, (expression,) = reduced(text)
    ring, point = Generators(tower), draw_point(tower, 1)
    quotient = to_quotient(ring, expression)
    values = [evaluate(ring.tree_of(polynomial), point) for polynomial in (quotient.numerator, quotient.denominator)]
    assert values[0] == values[1] * evaluate(expression, point) % point.prime


def test_squares_of_roots_are_their_radicands() -> None:
    tower, (expression,) = reduced("sqrt(1+x^2)")
    ring = Generators(tower)
    root = to_quotient(ring, expression).numerator
    x = ring.generator(X)
    assert reduce_roots(ring, root**2) == x**2 + 1
    assert reduce_roots(ring, root**5) == (x**2 + 1) ** 2 * root
    assert ring.has_roots(root)
    assert not ring.has_roots(reduce_roots(ring, root**4))


def test_contents_are_rational_and_factors_primitive() -> None:
    tower, _ = reduced("x")
    ring = Generators(tower)
    content, found = factors(to_quotient(ring, tree("-3*x^2/2+6*x*y-6*y^2")).numerator)
    product = ring.constant(content)
    for factor, k in found:
        product *= factor**k
    assert product == to_quotient(ring, tree("-3*(x-2*y)^2/2")).numerator
    assert [k for _, k in found] == [2]


@pytest.mark.parametrize(
    "text", ["sqrt(5+2*sqrt(6))", "sqrt(x+2*sqrt(x)+1)", "sqrt(x+sqrt(x^2-1))", "sqrt((x-y)^2)", "sqrt(1-cos(x)^2)"]
)
def test_signs_at_random_points_are_those_at_the_real_point(text: str) -> None:
    tower, trees = reduced(text)
    table = find_real_point(trees, (X, Y), 1)
    assert table is not None
    assert tower.signs or tower.radicands
    for seed in range(4):
        point = draw_point(tower, seed)
        for factor, sign in tower.signs:
            assert is_positive(evaluate(factor, point), point.prime) == (sign > 0)
            assert real_sign(factor, table) == sign


@pytest.mark.parametrize(
    ("left", "right"), [("sqrt((x-y)^2)", "x-y"), ("sqrt(1-cos(x)^2)", "sin(x)"), ("sqrt(x^2)", "x")]
)
def test_the_root_of_a_square_is_the_absolute_value_at_the_real_point(left: str, right: str) -> None:
    tower, (root, base) = reduced(left, right)
    table = find_real_point([root, base], (X, Y), 1)
    assert table is not None
    for seed in range(6):
        point = draw_point(tower, seed)
        assert evaluate(root, point) == real_sign(base, table) * evaluate(base, point) % point.prime


def test_an_angle_that_is_a_large_multiple_under_a_root_is_refused() -> None:
    with pytest.raises(IrreducibleAtoms, match="too large a multiple"):
        reduced("sqrt(2+sin(900*x)+sin(x))")


def test_too_many_atoms_under_roots_are_refused() -> None:
    names = tuple(f"x{k}" for k in range(60))
    total = to_kernels(parse(f"sqrt({'+'.join(names)})", Names(names, ())))
    variables = tuple(map(Symbol, names))
    with pytest.raises(IrreducibleAtoms, match="too many"):
        reduce_atoms([total], variables, find_real_point([total], variables, 1))


def test_numbers_under_roots_need_no_factors() -> None:
    tower, trees = reduced("sqrt(2)*sqrt(3)*7^(1/4)")
    assert tower.rules == []
    assert tower.signs == []
    assert all(isinstance(node, Number) or not isinstance(node, Apply) for node in walk(trees[0]))
    point = draw_point(tower, 1)
    assert pow(evaluate(trees[0], point), 4, point.prime) == evaluate(number(252), point)


@pytest.mark.parametrize(
    ("root", "square_of"),
    [
        ("sqrt(x+1-2*sqrt(x))", "sqrt(x)-1"),
        ("sqrt(exp(2*y)*x+1-2*exp(y)*sqrt(x))", "exp(y)*sqrt(x)-1"),
        ("sqrt(x+y-2*sqrt(x)*sqrt(y))", "sqrt(x)-sqrt(y)"),
    ],
)
def test_a_square_in_disguise_is_the_absolute_value_of_its_root(root: str, square_of: str) -> None:
    tower, (found, base) = reduced(root, square_of)
    table = find_real_point([found, base], (X, Y), 1)
    assert table is not None
    for seed in range(3):
        point = draw_point(tower, seed)
        assert evaluate(found, point) == real_sign(base, table) * evaluate(base, point) % point.prime


@pytest.mark.parametrize("text", ["sqrt(x+y+1+2*sqrt(x)*sqrt(y)+2*sqrt(x)+2*sqrt(y))", "sqrt(x^(1/2)+1+2*x^(1/4))"])
def test_a_square_of_three_roots_is_refused_and_never_taken_for_independent(text: str) -> None:
    with pytest.raises(IrreducibleAtoms, match="denest it by hand"):
        reduced(text)


def test_a_root_that_is_no_square_has_the_sign_of_the_real_point() -> None:
    tower, _ = reduced("sqrt(x+sqrt(y))")
    ((factor, sign),) = tower.signs
    assert sign == 1
    assert factor == tree("x+sqrt(y)")
    for seed in range(4):
        point = draw_point(tower, seed)
        assert is_positive(evaluate(factor, point), point.prime)


def test_a_root_of_what_is_negative_at_the_real_point_is_refused() -> None:
    with pytest.raises(IrreducibleAtoms, match="negative quantity"):
        reduce_atoms([tree("sqrt(x-y)")], (X, Y), {X: mpf(1), Y: mpf(2)})


def test_roots_without_a_real_point_are_refused() -> None:
    with pytest.raises(IrreducibleAtoms, match="no real point"):
        reduce_atoms([tree("sqrt(x)")], (X, Y), None)
    assert reduce_atoms([tree("x^2")], (X, Y), None).signs == []
