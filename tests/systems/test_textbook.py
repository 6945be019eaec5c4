"""What comes out first at the door, beside what a person would write: the same Lagrangian, and not longer.

Two Lagrangians are the same where their Euler-Lagrange expressions are constant multiples of each other for all q'':
they differ by a constant factor and a total derivative. Those of the right column were worked out by hand.
"""

from __future__ import annotations

import random
from typing import Any

import mpmath
import pytest

from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.tree import (
    TIME,
    Acceleration,
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    subtract,
)
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents.documents import solve_document
from inverse_service.service.documents.text_page import answers_of

Equations = dict[str, str]
# A pair of brackets and a number more than a person needs.
_LONGER = 1.3


def _kepler(k: str) -> tuple[Equations, str]:
    equations = {q: f"-{k}*{q}/(x^2+y^2)^(3/2)" for q in "xy"}
    return equations, f"x'^2/2 + y'^2/2 + {k}/sqrt(x^2 + y^2)"


def _damped(c: str) -> tuple[Equations, str]:
    return {"x": f"-x - {c}*x'"}, f"exp({c}*t)*(x'^2 - x^2)/2"


# Equations, the Lagrangian that is to come first; parameters are guessed.
TEXTBOOK: dict[str, tuple[Equations | str, str]] = {
    **{f"Kepler, {k}": _kepler(k) for k in ("398600.4418", "6.674e-11", "1e9", "1.327e20", "0.123456789", "2^40")},
    "Kepler, a product": _kepler("6.674e-11*5.972e24"),
    **{f"damped, {c}": _damped(c) for c in ("3", "0.05", "0.01", "0.1", "c", "1", "1001/1000")},
    "damped, roots of any size": ({"x": "-3*x-(3/10)*x'"}, "exp(3*t/10)*(x'^2 - 3*x^2)/2"),
    "a long decimal": (
        {"x": "y'-sin(x)", "y": "-0.123456789*x'-2*y"},
        "0.123456789*(cos(x) + x'^2/2 + x*y') + y'^2/2 - y^2",
    ),
    "a symbolic power": ({"x": "-x^a*y", "y": "-x^(a+1)"}, "(a+1)*x'^2/2 + y'^2/2 - y*x^(a+1)"),
    "a constant velocity": ({"x": "-log(x)*y'", "y": "0"}, "x'^2/(2*sqrt(y')) - (x*log(x)-x)*sqrt(y')"),
    "a root of a constant velocity": (
        {"a": "0", "b": "a'/50+b'^2*tan(b)/2"},
        "cos(b)*b'^2/sqrt(a') + sqrt(a')*sin(b)/25",
    ),
    "products of velocities": (
        {
            "alpha": "-alpha'*gam'/(3*gam)",
            "beta": "-beta'*(2*beta*gam'+3*gam*beta')/(6*beta*gam)",
            "gam": "beta*alpha'^2*beta'^2/2",
        },
        "beta*gam*alpha'^2*beta'^2 + gam'^2",
    ),
    "squares of velocities": (
        {"x": "-exp(y^2)*sin(x)/(3*y'^2)", "y": "(3*x'*y'^3*y+2*exp(y^2)*sin(x))/(3*x'*y')"},
        "x'^2*y'^2*exp(-y^2) - 2*cos(x)",
    ),
    "powers of velocities": (
        {"u": "2*(2*sqrt(u)-u'^(5/2))/(5*u*sqrt(u'))", "h": "2*(14*h*h'^(3/2)-h'^2)/h"},
        "7*h^2/2 - h*sqrt(h') + 2*u^(3/2) + u*u'^(5/2)",
    ),
    "a golden ratio": (
        {"x": "(2+sqrt(5))^(1/3)*y'-y^2", "y": "-(1+sqrt(5))/2*x'-2*x*y"},
        "x'^2/2 + y'^2/2 + x*(1+sqrt(5))*y'/2 - x*y^2",
    ),
    "projectile": ({"x": "-k*x'", "y": "-k*y'-g"}, "exp(k*t)*(x'^2 + y'^2 - 2*g*y)/2"),
    "a ratio of velocities": (
        {"x": "-tan(x)*x'^2", "y": "-cot(x)*x'*y'"},
        "x'^2/(2*cos(x)^2) + sin(x)*cos(x)*y'^2/(2*x')",
    ),
    "a round field": (
        {"x": "-y'/(x^2+y^2)", "y": "x'/(x^2+y^2)"},
        "x'^2/2 + y'^2/2 - log(x^2+y^2)*(x*y'-y*x')/(2*(x^2+y^2))",
    ),
    "three bodies, restricted": (
        {
            "x": "2*y'+x-(1-m)*(x+m)/((x+m)^2+y^2)^(3/2)-m*(x-1+m)/((x-1+m)^2+y^2)^(3/2)",
            "y": "-2*x'+y-(1-m)*y/((x+m)^2+y^2)^(3/2)-m*y/((x-1+m)^2+y^2)^(3/2)",
        },
        "x'^2/2 + y'^2/2 + 2*x*y' + x^2/2 + y^2/2 + (1-m)/sqrt((x+m)^2+y^2) + m/sqrt((x-1+m)^2+y^2)",
    ),
    # Constants stay where the equations have them.
    "RLC": ("L*q'' + R*q' + q/C = 0", "exp(R*t/L)*(L*q'^2 - q^2/C)/2"),
    "mass, damper, spring": ("m*x'' + c*x' + k*x = 0", "exp(c*t/m)*(m*x'^2 - k*x^2)/2"),
    "two masses on one": ("(m+M)*x'' + c*x' + k*x = 0", "exp(c*t/(m+M))*((M + m)*x'^2 - k*x^2)/2"),
    "an odd factor": ("2*m*x'' = -c*x' - k*x", "exp(c*t/(2*m))*(2*m*x'^2 - k*x^2)/2"),
    "spring pendulum with friction": (
        "m*r'' = m*r*th'^2 + m*g*cos(th) - k*(r-l) - c*r'; m*r^2*th'' + 2*m*r*r'*th' + m*g*r*sin(th) + c*r^2*th' = 0",
        "exp(c*t/m)*(m*r'^2 + m*r^2*th'^2 - k*r^2 + 2*k*l*r + 2*g*m*r*cos(th))/2",
    ),
    "Legendre": ("(1-t^2)*y'' - 2*t*y' + n*(n+1)*y = 0", "(1 - t^2)*y'^2/2 - n*(n+1)*y^2/2"),
    "Bessel": ("t^2*y'' + t*y' + (t^2-n^2)*y = 0", "t*y'^2/2 - t*y^2/2 + n^2*y^2/(2*t)"),
    "Hermite": ("y'' - 2*t*y' + 2*n*y = 0", "exp(-t^2)*(y'^2 - 2*n*y^2)/2"),
    "Laguerre": ("t*y'' + (1-t)*y' + n*y = 0", "exp(-t)*(t*y'^2 - n*y^2)/2"),
    "Lotka and Volterra": ("x' = a*x-b*x*y; y' = -c*y+d*x*y", "(a - x'/x)*log(a*x - x') - d*x - (a-c)*log(x)"),
}


def _first(equations: Equations | str) -> dict[str, Any]:
    """The first answer on the page that has a Lagrangian."""
    result = solve_document({"equations": equations, "parameters": "guess"}, SolveOptions())
    answer = next(answer for answer, _ in answers_of(result, result) if answer["lagrangian"])
    return {**result["system"], **answer}


@pytest.mark.parametrize(("equations", "wanted"), TEXTBOOK.values(), ids=TEXTBOOK)
def test_the_first_lagrangian_is_that_of_a_textbook(equations: Equations | str, wanted: str) -> None:
    answer = _first(equations)
    text = answer["lagrangian"]["text"]
    coordinates = tuple(answer["coordinates"])
    names = Names(coordinates, tuple(answer["parameters"]))
    assert same_lagrangian(read_formula(text, names), read_formula(wanted, names), coordinates), text
    assert len(text) <= _LONGER * len(wanted) + 20, text
    assert not answer["hamiltonian"]["implicit"]


def same_lagrangian(left: Expression, right: Expression, coordinates: tuple[str, ...]) -> bool:
    """Whether the Euler-Lagrange expressions of one are a constant times those of the other, at random points.

    Their velocities are positive or, where a formula has no value there, negative.
    """
    try:
        pairs = [_pairs(left, right, coordinates, seed, 1) for seed in range(3)]
    except NoRealValue:
        pairs = [_pairs(left, right, coordinates, seed, -1) for seed in range(3)]
    ratios = [a / b for pair in pairs for a, b in zip(*pair, strict=True)]
    return all(abs(ratio / ratios[0] - 1) < 1e-25 for ratio in ratios)


def _pairs(
    left: Expression, right: Expression, coordinates: tuple[str, ...], seed: int, sign: int
) -> list[list[mpmath.mpf]]:
    return [_expressions(tree, coordinates, seed, sign) for tree in (left, right)]


def _expressions(tree: Expression, coordinates: tuple[str, ...], seed: int, sign: int) -> list[mpmath.mpf]:
    """d/dt dL/dv_i - dL/dq_i with any q''; parameters have the same values at all points."""
    draw, fixed = random.Random(seed), random.Random(7)

    def total(slope: Expression) -> Expression:
        parts = [differentiate(slope, TIME)]
        for q in coordinates:
            parts.append(multiply(differentiate(slope, Symbol(q)), Velocity(q)))
            parts.append(multiply(differentiate(slope, Velocity(q)), Acceleration(q)))
        return add(*parts)

    forms = [subtract(total(differentiate(tree, Velocity(q))), differentiate(tree, Symbol(q))) for q in coordinates]
    with mpmath.workdps(40):
        moving = [TIME, *(kind(q) for q in coordinates for kind in (Symbol, Acceleration))]
        table: dict[Expression, mpmath.mpf] = {leaf: mpmath.mpf(draw.uniform(0.2, 0.7)) for leaf in moving}
        table |= {Velocity(q): sign * mpmath.mpf(draw.uniform(3, 5)) for q in coordinates}
        letters = sorted({*"abcCdgklLmMnR"} - {*coordinates})
        table |= {Symbol(letter): mpmath.mpf(fixed.uniform(0.2, 0.9)) for letter in letters}
        return [evaluate(form, table) for form in forms]


@pytest.mark.parametrize(
    ("left", "right"),
    [("x'^2/2 - x^2", "x'^2/2 - x^3"), ("x'^2/2 + y'^2/2", "x'^2/2 + y'^2"), ("x'^2 + y'^2 + x*y'", "x'^2 + y'^2")],
)
def test_other_lagrangians_are_told_apart(left: str, right: str) -> None:
    names = Names(("x", "y"), ())
    one, other = read_formula(left + " + y'^2", names), read_formula(right + " + y'^2", names)
    assert not same_lagrangian(one, other, ("x", "y"))
    derivative = read_formula(f"3*({left} + y'^2) + 2*x*x'*y + x^2*y'", names)
    assert same_lagrangian(one, derivative, ("x", "y"))


# The two questions beside each other: what L(q, q') and its H look like where L(t, q, q') comes first.
SECOND = [
    ({"x": "-x-3*x'"}, "sqrt(5)*p_x*x/2 - 3*p_x*x/2 + log(2*sqrt(5)*x/(1 - exp(sqrt(5)*p_x*x)))"),
    ({"x": "-x-x'"}, "-p_x*x/2 + log(3*x^2/(4*cos(sqrt(3)*p_x*x/2)^2))/2"),
    ({"x": "-k*x'", "y": "-k*y'-g"}, "exp(p_x - 1) - g*p_y/k + exp(p_y - 1)/k + k*(x + y)"),
]


@pytest.mark.parametrize(("equations", "wanted"), SECOND)
def test_the_hamiltonian_without_the_time_is_short(equations: Equations, wanted: str) -> None:
    result = solve_document({"equations": equations, "parameters": "guess"}, SolveOptions())
    assert result["hamiltonian"]["text"] == wanted


# Velocities are solved for without roots of squares.
ENERGIES = [
    ({"x": "-y'*x", "y": "0"}, "-(p_x^2 + x^2)^2/(16*p_y)"),
    ({"x": "x^2*y'", "y": "0"}, "-(3*p_x^2 - 2*x^3)^2/(144*p_y)"),
    ("(1-t^2)*y'' - 2*t*y' + n*(n+1)*y = 0", "p_y^2/(2*(1 - t^2)) + n*(n + 1)*y^2/2"),
    ("m*x'' + c*x' + k*x = 0", "exp(-c*t/m)*p_x^2/(2*m) + k*x^2*exp(c*t/m)/2"),
]


@pytest.mark.parametrize(("equations", "wanted"), ENERGIES)
def test_the_first_hamiltonian_is_as_short(equations: Equations | str, wanted: str) -> None:
    assert _first(equations)["hamiltonian"]["text"] == wanted
