"""Values and Taylor series of trees at a point of a prime field."""

from __future__ import annotations

from fractions import Fraction

import pytest
from mpmath import mp, mpf

from inverse_service.algebra import truncated_series as ps
from inverse_service.algebra.elementary import to_kernels
from inverse_service.algebra.modular import is_positive, safe_prime
from inverse_service.algebra.point import Expansion, Point, evaluate
from inverse_service.algebra.real_point import find_real_point
from inverse_service.algebra.reduction import reduce_atoms
from inverse_service.algebra.tower import draw_point, moved_point
from inverse_service.algebra.truncated_series import SingularPoint
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.evaluation import evaluate as real
from inverse_service.expressions.tree import ELEMENTARY, Apply, Arbitrary, Expression, Symbol, number, walk
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

X, Y = Symbol("x"), Symbol("y")
NAMES = Names(("x", "y"), ())


def expansion_of(expression: Expression, order: int) -> Expansion:
    table = find_real_point([expression], (X, Y), 1)
    return Expansion(draw_point(reduce_atoms([expression], (X, Y), table), 1), (X, Y), order)


FORMULAS = [f"{name}(x/7+2*y/9)" for name in sorted(ELEMENTARY - {"acosh"})]
FORMULAS += ["acosh(2+x^2)", "x^y", "2^x", "(1+x)^(2/3)", "x*y/(x-y)", "sqrt(1+exp(x)*sin(y)^2)", "log(log(2+x^2))"]


@pytest.mark.parametrize("text", FORMULAS)
def test_the_linear_part_of_a_series_is_the_gradient(text: str) -> None:
    formula = parse(text, NAMES)
    slopes = [to_kernels(differentiate(formula, variable)) for variable in (X, Y)]
    together = [to_kernels(formula), *slopes]
    tower = reduce_atoms(together, (X, Y), find_real_point(together, (X, Y), 1))
    expansion = Expansion(draw_point(tower, 1), (X, Y), 3)
    series = expansion.expand(together[0])
    assert ps.value_at_point(series) == evaluate(together[0], expansion.point)
    for index, slope in enumerate(slopes):
        assert ps.derivative(series, index) == expansion.expand(slope)[:3]


def test_a_product_with_a_number_first_is_scaled() -> None:
    expression = parse("3*x*(x+y)*y", NAMES)
    expansion = expansion_of(expression, 3)
    x, y = expansion.expand(X), expansion.expand(Y)
    assert expansion.expand(expression) == ps.scale(ps.multiply(x, ps.multiply(ps.add(x, y), y)), 3)


def test_derivatives_of_an_arbitrary_function_are_those_of_its_series() -> None:
    function, slope = (Arbitrary("A", (X,), (k,)) for k in (0, 1))
    expansion = Expansion(Point(safe_prime(1), 5), (X, Y), 4)
    assert ps.derivative(expansion.expand(function), 0) == expansion.expand(slope)[:4]


def test_an_arbitrary_function_of_two_arguments_follows_the_chain_rule() -> None:
    arguments = (parse("x*y", NAMES), parse("x+y^2", NAMES))
    function = Arbitrary("A", arguments, (0, 0))
    expansion = Expansion(Point(safe_prime(1), 5), (X, Y), 3)
    first, second = (expansion.expand(Arbitrary("A", arguments, orders))[:3] for orders in ((1, 0), (0, 1)))
    inner = [expansion.expand(argument) for argument in arguments]
    for index in range(2):
        slopes = [ps.derivative(u, index) for u in inner]
        expected = ps.add(ps.multiply(first, slopes[0]), ps.multiply(second, slopes[1]))
        assert ps.derivative(expansion.expand(function), index) == expected


def test_an_arbitrary_function_has_equal_values_at_equal_places() -> None:
    point = Point(safe_prime(1), 5)
    same = [Arbitrary("A", (parse(text, NAMES),), (0,)) for text in ("x^2-y^2", "(x-y)*(x+y)", "x^2+y^2")]
    values = [evaluate(tree, point) for tree in same]
    assert values[0] == values[1] != values[2]


def test_signs_of_variables_are_residue_symbols() -> None:
    for seed in range(20):
        point = Point(safe_prime(1), seed, {X: 1, Y: -1})
        assert is_positive(point.variable(X), point.prime)
        assert not is_positive(point.variable(Y), point.prime)


def test_a_vanishing_denominator_is_a_singular_point() -> None:
    for text in ("1/(x-x)", "y/(x*y-y*x)", "(x-x)^(-1/2)"):
        with pytest.raises(SingularPoint):
            evaluate(parse(text, NAMES), Point(safe_prime(1), 1))
        with pytest.raises(SingularPoint):
            Expansion(Point(safe_prime(1), 1), (X, Y), 2).expand(parse(text, NAMES))


def test_a_number_with_the_prime_in_its_denominator_is_a_singular_point() -> None:
    prime = safe_prime(1)
    with pytest.raises(SingularPoint):
        evaluate(number(Fraction(1, prime)), Point(prime, 1))


@pytest.mark.parametrize("function", sorted(ELEMENTARY))
def test_kernels_are_six_and_have_the_real_values_of_what_they_replace(function: str) -> None:
    kernels = to_kernels(Apply(function, X))
    used = {node.function for node in walk(kernels) if isinstance(node, Apply)}
    assert used <= {"exp", "log", "sin", "cos", "atan"}
    table = {X: mpf("1.3") if function == "acosh" else mpf("0.3")}
    with mp.workdps(30):
        assert abs(real(kernels, table) - real(Apply(function, X), table)) < mpf(10) ** -25


def test_who_draws_differently_draws_derivatives_of_functions_too() -> None:
    """Points of small numbers need small derivatives as well."""

    prime = safe_prime(2)

    class Ones(Point):
        def draw(self, key: object) -> int:
            return 1

    assert Ones(prime, 1).jet("A", (5,), (2,)) == Ones(prime, 1).variable(Symbol("x")) == 1
    plain = Point(prime, 1)
    assert plain.jet("A", (5,), (2,)) == Point(prime, 1).jet("A", (5,), (2,)) != plain.jet("A", (5,), (1,))


def test_points_that_share_coordinates_are_found_beside_many_roots() -> None:
    names = tuple(f"q{k}" for k in range(1, 13))
    moving = [Symbol(name) for name in names]
    roots = "+".join(f"sqrt(1-{name}^2)" for name in names) + "+sqrt(2-q1^2-q2^2)*sqrt(3+x*q1)"
    formula = to_kernels(parse(roots, Names(("x", *names), ())))
    variables = (X, *moving)
    place = draw_point(tower := reduce_atoms([formula], variables, find_real_point([formula], variables, 1)), 1)
    values = set()
    for number_of_point in range(3):
        point = moved_point(tower, place, moving, number_of_point)
        assert point.variable(X) == place.variable(X)
        assert all(is_positive(evaluate(radicand, point), point.prime) for radicand in tower.radicands)
        assert all(is_positive(evaluate(p, point), point.prime) == (sign > 0) for p, sign in tower.signs)
        values.add(tuple(map(point.variable, moving)))
    assert len(values) == 3
