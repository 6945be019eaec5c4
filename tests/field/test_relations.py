"""Values at a random point of a prime field obey every relation that holds among the atoms."""

from __future__ import annotations

from fractions import Fraction
from unittest import mock

import pytest

from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import PI, Apply, Expression, Symbol, nesting, number
from inverse_service.field import real_branch, tower as towers
from inverse_service.field.modular import evaluate, is_positive, positive_power, safe_prime
from inverse_service.field.real_branch import find_real_point, reduce_atoms, turns
from inverse_service.field.tower import (
    Tower,
    atoms_in_order,
    circle_power,
    circle_product,
    circle_turn,
    draw_point,
    to_kernels,
)
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

VARIABLES = (Symbol("x"), Symbol("y"))


def tree(text: str) -> Expression:
    return to_kernels(parse(text, Names(("x", "y"), ())))


def tower_of(*texts: str) -> tuple[Tower, list[Expression]]:
    trees = [tree(text) for text in texts]
    return reduce_atoms(trees, VARIABLES, find_real_point(trees, VARIABLES, 1)), trees


def free_count(tower: Tower) -> int:
    return sum(rule.free for rule in tower.rules if hasattr(rule, "free"))


@pytest.mark.parametrize(
    ("texts", "free"),
    [
        (["exp(x)", "exp(2*x)", "exp(-x/3)"], 1),
        (["exp(x)", "exp(y)", "exp(x-2*y)"], 2),
        (["exp(x)", "exp(x^2)"], 2),
        (["log(x)", "log(x^3)", "log(5*x)"], 1),
        (["log(x)", "log(y)", "log(x^2/y)"], 2),
        (["log(x)", "log(1+x)"], 2),
        (["exp(y*log(x))", "x^(2*y)"], 2),
        (["sin(x)", "cos(x)", "sin(x/2)", "cos(7*x)"], 1),
        (["sin(x)", "sin(y)", "cos(x+3*y)"], 2),
        (["sin(x)", "sin(x+pi/3)"], 1),
        (["sin(x)", "sin(x+1)"], 1),
        (["sin(x)", "exp(x)", "log(x)"], 3),
        (["atan(x)", "atan(1/x)"], 1),
        (["asin(x)", "acos(x)"], 1),
        (["atan(x)", "sin(2*atan(x))"], 1),
        (["asinh(x)", "log(x+sqrt(1+x^2))"], 1),
        (["exp(sin(x))", "exp(sin(x)+x)", "exp(x)"], 3),
        (["exp(sqrt((x-y)^2))", "exp(x-y)"], 1),
        (["sin(1)", "cos(1)", "sin(2)"], 0),
        (["x^2+1"], 0),
    ],
)
def test_as_many_generators_are_free_as_atoms_are_independent(texts: list[str], free: int) -> None:
    assert free_count(tower_of(*texts)[0]) == free


@pytest.mark.slow
@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("sin(2*x)", "2*sin(x)*cos(x)"),
        ("exp(x+y)", "exp(x)*exp(y)"),
        ("log(x*y)", "log(x)+log(y)"),
        ("sqrt(x^2-y^2)", "sqrt(x-y)*sqrt(x+y)"),
        ("sqrt(5+2*sqrt(6))", "sqrt(2)+sqrt(3)"),
        ("tan(x+y)", "(tan(x)+tan(y))/(1-tan(x)*tan(y))"),
        ("sin(asin(x)/2)", "x/(2*sqrt((1+sqrt(1-x^2))/2))"),
        ("tan(atan(x)/2)", "(sqrt(1+x^2)-1)/x"),
        ("cos(acos(y)/2)", "sqrt((1+y)/2)"),
        ("4*cos(acos(x)/3)^3-3*cos(acos(x)/3)", "x"),
        ("cos(acos(x)/3)", "cos(pi/6-asin(x)/3)"),
        ("sin(asin(x)/2)", "3*sin(asin(x)/6)-4*sin(asin(x)/6)^3"),
        ("sin(atan(x)/5+atan(y)/2)", "sin(atan(x)/5)*cos(atan(y)/2)+cos(atan(x)/5)*sin(atan(y)/2)"),
    ],
)
def test_equal_functions_have_equal_values_at_every_point(left: str, right: str) -> None:
    tower, (first, second) = tower_of(left, right)
    for seed in range(5):
        point = draw_point(tower, seed)
        assert evaluate(first, point) == evaluate(second, point)


@pytest.mark.slow
@pytest.mark.parametrize("angle", ["asin(x)/2", "atan(x*y)/2", "acos(x)/3", "asin(x*y)/9"])
def test_a_part_of_an_inverse_function_is_on_its_own_branch(angle: str) -> None:
    values = (
        f"sin({angle})",
        f"-sin({angle})",
        f"cos({angle})",
        f"-cos({angle})",
        f"cos({angle}+2*pi/3)",
    )
    tower, trees = tower_of(*values)
    point = draw_point(tower, 3)
    assert len({evaluate(found, point) for found in trees}) == len(trees)


def test_functions_that_differ_have_different_values() -> None:
    tower, trees = tower_of("sin(x)", "cos(x)", "exp(x)", "sqrt(1+x)", "log(1+x)", "atan(x)", "x")
    point = draw_point(tower, 3)
    assert len({evaluate(found, point) for found in trees}) == len(trees)


def test_a_point_is_the_same_for_the_same_seed_and_another_for_another() -> None:
    tower, (found,) = tower_of("sqrt(1+sin(x))*exp(y)")
    values = [
        (draw_point(tower, seed).prime, evaluate(found, draw_point(tower, seed)))
        for seed in (1, 1, 2)
    ]
    assert values[0] == values[1] != values[2]


def test_many_roots_of_different_variables_find_a_point_at_once() -> None:
    names = tuple(f"x{k}" for k in range(8))
    variables = tuple(map(Symbol, names))
    trees = [to_kernels(parse(f"sqrt(1+sin({a}))*sqrt({a}+2)", Names(names, ()))) for a in names]
    tower = reduce_atoms(trees, variables, find_real_point(trees, variables, 1))
    point = draw_point(tower, 1)
    # a product of positive roots is positive
    assert all(is_positive(evaluate(found, point), point.prime) for found in trees)


@pytest.mark.parametrize(
    "text",
    [
        "log(x-x)",
        "log(1/(x-x))",
        "exp(1/(y-y))",
        "sin(1/(x-x))",
        "sqrt(x-x)",
        "sqrt(-1-x^2)",
        "1/sqrt(x-x)",
        "sqrt(2+sin(atan(x)/3))",
    ],
)
def test_what_has_no_value_or_no_reduction_is_refused_with_a_sentence(text: str) -> None:
    with pytest.raises(IrreducibleAtoms) as caught:
        tower_of(text)
    assert " " in caught.value.detail


def test_atoms_come_once_and_inner_ones_first() -> None:
    found = atoms_in_order([tree("exp(sin(x)+log(y))+sin(x)"), tree("sqrt(1+exp(sin(x)+log(y)))")])
    assert found == [
        tree(text)
        for text in ("sin(x)", "log(y)", "exp(sin(x)+log(y))", "sqrt(1+exp(sin(x)+log(y)))")
    ]


def test_a_root_of_an_exponential_is_an_exponential() -> None:
    assert tree("sqrt(exp(x))") == tree("exp(x/2)")


@pytest.mark.parametrize("steps", range(-25, 26))
def test_angles_of_a_twelfth_of_pi_lie_on_the_circle_and_add(steps: int) -> None:
    prime = safe_prime(1)
    cosine, sine = circle_turn(Fraction(steps, 12), prime)
    assert (cosine * cosine + sine * sine) % prime == 1
    assert circle_power(circle_turn(Fraction(1, 12), prime), steps, prime) == (cosine, sine)


def test_known_angles_have_their_known_cosines_and_sines() -> None:
    prime = safe_prime(1)
    half, root3 = pow(2, -1, prime), positive_power(3, Fraction(1, 2), prime)
    assert circle_turn(Fraction(1), prime) == (prime - 1, 0)
    assert circle_turn(Fraction(1, 2), prime) == (0, 1)
    assert circle_turn(Fraction(1, 3), prime) == (half, root3 * half % prime)


@pytest.mark.parametrize("parts", [5, 7, 9, 16, 17, 180, 360])
def test_parts_of_pi_add_and_are_of_the_order_that_they_should_be(parts: int) -> None:
    prime = safe_prime(1, order=2 * parts)
    turn = circle_turn(Fraction(1, parts), prime)
    assert circle_power(turn, parts, prime) == (prime - 1, 0)
    for k in (2, 3, parts - 1):
        assert circle_power(turn, k, prime) == circle_turn(Fraction(k, parts), prime)
    third = circle_turn(Fraction(1, 3), prime)
    assert circle_product(turn, third, prime) == circle_turn(
        Fraction(1, parts) + Fraction(1, 3), prime
    )


def test_angles_that_are_finer_than_the_prime_has_are_refused() -> None:
    with pytest.raises(IrreducibleAtoms, match="too fine a part"):
        circle_turn(Fraction(1, 10007), safe_prime(1))


def test_powers_on_the_circle_are_repeated_products() -> None:
    prime = safe_prime(1)
    turn = circle_turn(Fraction(5, 12), prime)
    product = (1, 0)
    for k in range(6):
        assert circle_power(turn, k, prime) == product
        assert circle_product(circle_power(turn, -k, prime), product, prime) == (1, 0)
        product = circle_product(product, turn, prime)


def atan(above: int, below: int = 1) -> Expression:
    return Apply("atan", number(Fraction(above, below)))


@pytest.mark.parametrize(
    ("angle", "other", "found"),
    [
        (atan(2), atan(3), {PI: Fraction(3, 4), atan(3): Fraction(-1)}),
        (atan(4, 3), atan(1, 2), {atan(1, 2): Fraction(2)}),
        (atan(3, 4), atan(1, 2), {PI: Fraction(1, 2), atan(1, 2): Fraction(-2)}),
        (atan(1, 2), atan(1, 5), None),
    ],
)
def test_an_arctangent_of_a_number_is_found_among_others(
    angle: Expression, other: Expression, found: dict[Expression, Fraction] | None
) -> None:
    relation = turns({}, angle, (), [other])
    assert (relation and dict(relation)) == found


def nested_roots(number: int) -> str:
    """A root of a root of a root …"""
    text = "x"
    for _ in range(number):
        text = f"sqrt({text} + y^2) + x"
    return text


def test_nested_roots_are_read_once_at_each_level() -> None:
    """Each with its base and the factors of that: twice as many readings for each level more."""
    with mock.patch.object(real_branch, "_root", wraps=real_branch._root) as read:
        tower_of(nested_roots(8))
    assert read.call_count <= 8 * 8


@pytest.mark.parametrize("text", [nested_roots(32), f"exp(sqrt({nested_roots(12)})/2)"])
def test_more_nested_roots_than_are_looked_at_are_counted_before_any_work(text: str) -> None:
    with (
        mock.patch.object(towers, "build_tower", side_effect=AssertionError),
        pytest.raises(IrreducibleAtoms, match="roots are nested in one another"),
    ):
        tower_of(text)


def test_roots_side_by_side_are_not_nested() -> None:
    """As many roots of other names, and odd ones, which are unique."""
    beside = "+".join(f"sqrt({k} + x^2)" for k in range(1, 9))
    odd = "x"
    for _ in range(9):
        odd = f"({odd} + y)^(1/3)"
    for text in (beside, odd):
        tower, _ = tower_of(text)
        assert nesting([tree(text)], towers.is_even_root) <= 1
        assert tower is not None
