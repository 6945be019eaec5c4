"""A Lagrangian is written as shortly as a book writes it, and gives the same equations."""

from __future__ import annotations

import pytest
from mpmath import mpf

from inverse_service.expressions import arrays, calculus, collecting, printing, tree as ex
from inverse_service.field.real_branch import vanishes
from inverse_service.mechanics import euler_lagrange, linear_equations, moves
from inverse_service.mechanics.second_order_system import SecondOrderSystem, system_of
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.search import tidy


def systems_of(names: str, letters: str) -> tuple[SecondOrderSystem, Names]:
    coordinates, parameters = tuple(names.split()), tuple(letters.split())
    system = system_of(coordinates, [ex.ZERO] * len(coordinates), parameters, ())
    return system, Names(coordinates, parameters, {})


@pytest.mark.parametrize(
    ("names", "letters", "found", "book"),
    [
        ("x y", "", "x'*(log(x') - 1) + y'*(log(y') - 1) + x*y", "log(x')*x' + log(y')*y' + x*y"),
        ("x y", "", "(x'^2 + y'^2)/2 + x*y' - y*x' + 1/sqrt(x^2 + y^2)", "x'^2/2 + y'^2/2 + 2*x*y' + 1/sqrt(x^2 + y^2)"),
        ("y", "n", "(1 - t)^(n + 1)*(t + 1)^(n + 1)*y'^2/2 + n*y^2*(1 - t)^n*(t + 1)^n/2",
         "y'^2*(1 - t^2)^(n + 1)/2 + n*y^2*(1 - t^2)^n/2"),
        ("y", "a b", "t*(1 - t)^a*y'^2/2 + (b^2 - a^2)*y^2*(1 - t)^a/(8*(t - 1)) + y^2*(1 - t)^a/(8*t*(1 - t))",
         "t*y'^2*(1 - t)^a/2 + y^2*(1 - t)^(a - 1)*(a^2*t - b^2*t + 1)/(8*t)"),
        ("x", "a", "(a*t + 1)^2*x'^2/2 - x^2/2 - a*t*x^2 - a^2*t^2*x^2/2", "(a*t + 1)^2*x'^2/2 - x^2*(a*t + 1)^2/2"),
        ("y", "", "y'*log(y' + sqrt(y'^2 + 1)) - sqrt(y'^2 + 1) + y", "asinh(y')*y' - sqrt(y'^2 + 1) + y"),
        ("x y", "", "exp(t)*(3*(x'^2 + y'^2) - 3*x^2 - 3*y^2 + 2*y^3 - 6*x^2*y)/6",
         "exp(t)*(x'^2/2 + y'^2/2 - x^2/2 - y^2/2 + y^3/3 - x^2*y)"),
        ("y", "a b", "y'^2/2 - y^2/2 + 2*exp(2*b*t^2)*a^2*b^2*t^2*y^2",
         "y'^2/2 - y^2/2 + 2*exp(2*b*t^2)*a^2*b^2*t^2*y^2"),
        ("x y", "w", "exp(t)*(x'^2 + y'^2 + 2*w*x*y' - w^2*y^2) + t*x^2*w^2",
         "exp(t)*(x'^2 + y'^2 + 2*w*x*y' - w^2*y^2) + t*x^2*w^2"),
        ("x y", "", "exp(t)*(cos(t)*(x'^2 - y'^2) - 2*sin(t)*x'*y' + cos(t)*(y^2 - x^2) + 2*x*y*sin(t))/2",
         "exp(t)*cos(t)*(y'^2 - x'^2 + x^2 - y^2)/2 + exp(t)*sin(t)*(x'*y' - x*y)"),
        # A gauge, a spring, a rotating frame, and brackets, as mechanics writes them.
        ("x y", "m B", "m*(x'^2 + y'^2)/2 + B*x*y'/2 - B*y*x'/2", "m*(x'^2 + y'^2)/2 + B*(x*y' - y*x')/2"),
        ("x", "a k", "x'^2/2 + a^2/(2*k*(1 + k*x^2))", "x'^2/2 - a^2*x^2/(2*(k*x^2 + 1))"),
        ("u q", "c", "u'^2/2 + sin(u)^2*q'^2/2 - c*cos(u)^2*q'", "u'^2/2 + sin(u)^2*(q'^2 + 2*c*q')/2"),
        ("x", "c k", "exp(c*t)*x'^2/2 - k*exp(c*t)*x^2/2", "exp(c*t)*(x'^2 - k*x^2)/2"),
        ("x y", "m n", "x'^2/2 + y'^2/2 - n^2*x^2 - 2*m*n*x^2", "(x'^2 + y'^2)/2 - (2*m + n)*n*x^2"),
        ("x", "a b", "x'^2/2 - a*t*x^2 - b*x^2", "x'^2/2 - (a*t + b)*x^2"),
        ("x y", "w", "x'^2/2 + y'^2/2 + 2*w*x*y' + w^2*x^2/2 + w^2*y^2/2", "((x' - w*y)^2 + (y' + w*x)^2)/2"),
        ("x", "c l", "x'^2/2 - c*x^2 + 2*c*l*x", "x'^2/2 - c*(x - l)^2"),
        ("r f", "m k l", "m*(r'^2 + r^2*f'^2)/2 - k*r^2/2 + k*l*r", "m*(r'^2 + r^2*f'^2)/2 - k*(r - l)^2/2"),
        ("a b", "k", "a'^2/2 + b'^2/2 + k*(cos(a)^2 + cos(b)^2 + 2*sin(a)*sin(b))",
         "(a'^2 + b'^2)/2 - k*(sin(a) - sin(b))^2"),
        ("x", "a b m", "(a/2 + 3*b/2)*x'^2/m - x", "(a + 3*b)*x'^2/(2*m) - x"),
        ("x y", "m a", "m*x'^2/2 + m*y'^2/2 + m*x^2*x'^2/(2*(a^2 - x^2 - y^2)) + m*x*y*x'*y'/(a^2 - x^2 - y^2)"
         " + m*y^2*y'^2/(2*(a^2 - x^2 - y^2))", "m*((x*x' + y*y')^2/(a^2 - x^2 - y^2) + x'^2 + y'^2)/2"),
        ("x y", "", "exp(t)*cos(t)*x'^2/2 - exp(t)*cos(t)*x^2/2 + exp(t)*sin(t)*x'*y'",
         "exp(t)*(cos(t)*(x'^2 - x^2) + 2*sin(t)*x'*y')/2"),
        ("x", "c w", "c*x'^2/2 + c*w*x'+ c*w^2/2 - x^2", "c*x'^2/2 - x^2"),
        # Legendre's equation, spheroidal waves, and Bessel's equation in log(t).
        ("y", "m n", "(1 - t^2)*y'^2/2 + y^2*(m^2 + n^2*t^2 - n^2 + n*t^2 - n)/(2*(1 - t^2))",
         "(1 - t^2)*y'^2/2 + y^2*(m^2/(1 - t^2) - n - n^2)/2"),
        ("y", "a m n", "(t^2 + 1)*y'^2/2 + y^2*(n^2*t^2 + n^2 + n*t^2 + n - a^2*t^4 - 2*a^2*t^2 - a^2 - m^2)/(2*(t^2 + 1))",
         "(t^2 + 1)*y'^2/2 + y^2*(n + n^2 - a^2 - a^2*t^2 - m^2/(t^2 + 1))/2"),
        ("y", "n", "exp(-t)*(exp(2*t)*y'^2 - n^2*y^2)/2", "exp(t)*y'^2/2 - exp(-t)*n^2*y^2/2"),
    ],
)  # fmt: skip
def test_what_is_found_costs_no_more_than_the_form_of_the_book(
    names: str, letters: str, found: str, book: str
) -> None:
    system, words = systems_of(names, letters)
    tree = read_formula(found, words)
    short = tidy.shorten_lagrangian(tree, system)
    assert moves.cost(short) <= moves.cost(read_formula(book, words))
    assert are_equations_proportional(tree, short, system)


def are_equations_proportional(
    one: ex.Expression, other: ex.Expression, system: SecondOrderSystem
) -> bool:
    """Whether the Euler-Lagrange expressions along arbitrary accelerations agree up to one
    factor, at three points with t below 1.
    """
    accelerations = [ex.Symbol(f"a_{name}") for name in system.coordinates]
    letters = [*map(ex.Symbol, (*system.coordinates, *system.parameters)), ex.TIME, *accelerations]
    letters += [*map(ex.Velocity, system.coordinates)]
    pairs = [
        euler_lagrange.euler_lagrange_sums(tree, system.coordinates, accelerations)
        for tree in (one, other)
    ]
    values = arrays.function_of([part for parts in pairs for part in parts], letters)
    points = [
        [0.21 + 0.043 * ((7 * k + 3 * j) % 11) for k in range(len(letters))] for j in range(3)
    ]
    size, factors = len(system.coordinates), []
    for point in points:
        found = values(point)
        factors += [a / b for a, b in zip(found[:size], found[size:], strict=True)]
    return max(factors) - min(factors) < 1e-9 * abs(factors[0])


def test_powers_stay_apart_where_both_bases_may_be_negative() -> None:
    """(t - 1)^a (t - 2)^a is defined for t > 2, ((t - 1) (t - 2))^a for t < 1 as well."""
    system, words = systems_of("y", "a")
    for text in ("(t - 1)^a*(t - 2)^a*y'^2", "(-1 - t)^a*(t - 1)^a*y'^2"):
        short = tidy.shorten_lagrangian(read_formula(text, words), system)
        assert printing.to_text(short).count("^a") == 2


def test_a_letter_keeps_the_symmetric_gauge() -> None:
    system, words = systems_of("x y", "B")
    tree = read_formula("(x'^2 + y'^2)/2 + B*x*y'/2 - B*y*x'/2", words)
    short = tidy.shorten_lagrangian(tree, system)
    assert collecting.collect(short - tree) == ex.ZERO


@pytest.mark.parametrize("text", ["log(x)", "sqrt(x)", "1/(x + 1/5)", "(x + 1/10)^(1/3)", "x^y"])
def test_a_function_of_formulas_agrees_with_arrays_or_has_no_value(text: str) -> None:
    tree = read_formula(f"{text} + cos(y)*atan(x)/tan(y) + {text}^2", Names(("x", "y"), (), {}))
    letters = [ex.Symbol("x"), ex.Symbol("y")]
    value = arrays.function_of([tree, letters[1]], letters)
    for x in (0.3, 1.7):
        seen = arrays.array_value(tree, dict(zip(letters, (x, 0.4), strict=True)))
        assert value((x, 0.4)) == pytest.approx([float(seen[0]), 0.4], rel=1e-13)
    with pytest.raises((ArithmeticError, ValueError)):
        value((-0.2, 0.4))


@pytest.mark.parametrize(
    ("lagrangian", "names", "letters", "book"),
    [
        # Landau and Lifshitz, section 5, problem 2, from the squares of both velocities.
        ("M*x'^2/2 + m*((x' + l*b'*cos(b))^2 + (l*b'*sin(b))^2)/2 + m*g*l*cos(b)", "x b", "M m l g",
         ["m*sin(b)*(g*cos(b) + l*b'^2)/(M + m*sin(b)^2)",
          "-sin(b)*(M*g + m*g + m*l*cos(b)*b'^2)/(l*(M + m*sin(b)^2))"]),
        # The double pendulum, as its equations are printed with sin(a - 2 b).
        ("M*l^2*a'^2/2 + m*((l*a'*cos(a) + k*b'*cos(b))^2 + (l*a'*sin(a) + k*b'*sin(b))^2)/2 + M*g*l*cos(a)"
         " + m*g*(l*cos(a) + k*cos(b))", "a b", "M m l k g",
         ["-(g*(2*M + m)*sin(a) + m*g*sin(a - 2*b) + 2*m*sin(a - b)*(k*b'^2 + l*a'^2*cos(a - b)))"
          "/(l*(2*M + m - m*cos(2*a - 2*b)))",
          "2*sin(a - b)*(l*a'^2*(M + m) + g*(M + m)*cos(a) + k*b'^2*m*cos(a - b))"
          "/(k*(2*M + m - m*cos(2*a - 2*b)))"]),
    ],
)  # fmt: skip
def test_equations_of_motion_from_squares_are_as_short_as_in_books(
    lagrangian: str, names: str, letters: str, book: list[str]
) -> None:
    system, known = systems_of(names, letters)
    sums = euler_lagrange.euler_lagrange_sums(
        read_formula(lagrangian, known),
        system.coordinates,
        [ex.Acceleration(name) for name in system.coordinates],
    )
    equations = [linear_equations.linear_equation(one) for one in sums]
    found = linear_equations.solve_accelerations(equations, system.coordinates)
    for ours, text in zip(found, book, strict=True):
        expected = read_formula(text, known)
        assert vanishes(ours - expected)
        assert ex.node_count(ours) <= 1.25 * ex.node_count(expected), printing.to_text(ours)


@pytest.mark.parametrize(
    "force",
    [
        "c*x'*abs(x') + k*x",
        "c*x*sqrt(x^2)*sin(b)^2 + c*x*sqrt(x^2)*cos(b)^2",
        "abs(x)*(x^2)^(3/2)*k - x^3*c",
    ],
)
def test_a_root_keeps_its_sign_in_what_is_solved_for(force: str) -> None:
    """|v| is (v^2)^(1/2), which is not v: drag c v |v| slows down in both directions."""
    system, known = systems_of("x b", "m k c")
    tree = read_formula(force, known)
    equations = [
        linear_equations.linear_equation(read_formula("m", known) * ex.Acceleration("x") + tree),
        linear_equations.linear_equation(ex.Acceleration("b") + read_formula("x", known)),
    ]
    found, _ = linear_equations.solve_accelerations(equations, system.coordinates)
    for v in (-2, 3):
        table = {
            node: mpf(v) if node in (ex.Symbol("x"), ex.Velocity("x")) else mpf(5) / 3
            for node in (*map(ex.Symbol, ("x", "b", "m", "k", "c")), ex.Velocity("x"))
        }
        expected = -calculus.evaluate(tree, table) / table[ex.Symbol("m")]
        assert abs(calculus.evaluate(found, table) - expected) < 1e-12
