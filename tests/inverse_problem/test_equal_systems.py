"""Equal systems written differently get equal verdicts and dimensions."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from inverse_service.inverse_problem.decision.deciding import decide
from inverse_service.mechanics.reading import read_system


@dataclass(frozen=True, slots=True)
class Pair:
    """One system written twice; `verdicts` for L(q, v) and L(t, q, v), "v" or "n"."""

    name: str
    verdicts: str
    first: dict[str, str]
    second: dict[str, str]
    parameters: tuple[str, ...] = ()
    functions: dict[str, list[str]] = field(default_factory=dict)


def xy(x: str, y: str) -> dict[str, str]:
    return {"x": x, "y": y}


PAIRS = (
    Pair("free", "vv", xy("0", "0"), xy("sin(x)^2+cos(x)^2-1", "exp(y)*exp(-y)-1")),
    Pair(
        "pendulum on a sphere",
        "vv",
        {"u": "sin(2*u)/2*w'^2-g*sin(u)", "w": "-2*u'*w'*cot(u)"},
        {"u": "sin(u)*cos(u)*w'^2-2*g*sin(u/2)*cos(u/2)", "w": "-2*u'*w'/tan(u)"},
        ("g",),
    ),
    Pair(
        "geodesics of the sphere",
        "vv",
        {"u": "sin(u)*cos(u)*w'^2", "w": "-2*u'*w'*cos(u)/sin(u)"},
        {"u": "(cos(u)-cos(u)^3)/sin(u)*w'^2", "w": "-2*u'*w'*sin(2*u)/(1-cos(2*u))"},
    ),
    Pair(
        "geodesics of the hyperbolic plane",
        "vv",
        {"u": "sinh(2*u)/2*w'^2", "w": "-2*coth(u)*u'*w'"},
        {"u": "(exp(2*u)-exp(-2*u))/4*w'^2", "w": "-2*(exp(2*u)+1)/(exp(2*u)-1)*u'*w'"},
    ),
    Pair(
        "upper half plane",
        "vv",
        xy("2*x'*y'/y", "(y'^2-x'^2)/y"),
        xy("2*x'*y'*exp(-log(y))", "y'^2*sqrt(1/y^2)-x'^2/sqrt(y^2)"),
    ),
    Pair(
        "Toda of two",
        "vv",
        xy("-exp(x-y)", "exp(x-y)"),
        xy("-exp(x)*exp(-y)", "exp(x)/exp(y)"),
    ),
    Pair(
        "Toda of three",
        "vv",
        {"x": "-exp(x-y)", "y": "exp(x-y)-exp(y-z)", "z": "exp(y-z)"},
        {"x": "-exp(x)/exp(y)", "y": "(exp(x-z)-exp(2*y-2*z))/exp(y-z)", "z": "exp(y/2-z/2)^2"},
    ),
    Pair(
        "Kepler",
        "vv",
        xy("-x/(x^2+y^2)^(3/2)", "-y/(x^2+y^2)^(3/2)"),
        xy("-x/sqrt(x^2+y^2)^3", "-y/((x^2+y^2)*sqrt(x^2+y^2))"),
    ),
    Pair(
        "Kepler with drag",
        "nv",
        xy("-x/(x^2+y^2)^(3/2)-x'", "-y/(x^2+y^2)^(3/2)-y'"),
        xy("-x*(x^2+y^2)^(-3/2)-x'", "-y/sqrt((x^2+y^2)^3)-y'"),
    ),
    Pair(
        "two fixed centers",
        "vv",
        xy("-(x-1)/((x-1)^2+y^2)^(3/2)-(x+1)/((x+1)^2+y^2)^(3/2)", "-y/((x-1)^2+y^2)^(3/2)-y/((x+1)^2+y^2)^(3/2)"),
        xy(
            "-(x-1)/sqrt(x^2-2*x+1+y^2)^3-(x+1)/sqrt(1+2*x+x^2+y^2)^3",
            "-y*(((x-1)^2+y^2)^(-3/2)+((x+1)^2+y^2)^(-3/2))",
        ),
    ),
    Pair(
        "logarithmic potential",
        "vv",
        xy("-log(x*y)-1", "-x/y"),
        xy("-log(x)-log(y)-1", "-exp(log(x)-log(y))"),
    ),
    Pair(
        "no potential, by a logarithm",
        "nn",
        xy("log(x*y)*y'", "log(x)"),
        xy("(log(x)+log(y))*y'", "log(x^2)/2"),
    ),
    Pair(
        "exponential coupling with a velocity",
        "nn",
        xy("exp(x+y)", "exp(x)*exp(y)*y'+x"),
        xy("exp(x)*exp(y)", "exp(x+y)*y'+log(exp(x))"),
    ),
    Pair("roots of products", "nn", xy("sqrt(x*y)", "y/sqrt(x)*x'"), xy("sqrt(x)*sqrt(y)", "y*sqrt(x)/x*x'")),
    Pair(
        "nested numbers",
        "nn",
        xy("sqrt(5+2*sqrt(6))*y*y'", "x'*sqrt(2)+y*sqrt(3)"),
        xy("(sqrt(2)+sqrt(3))*y*y'", "sqrt(2)*(x'+y*sqrt(3/2))"),
    ),
    Pair(
        "oscillators of golden frequency",
        "vv",
        xy("-(2+sqrt(5))^(1/3)*y", "-x*(1+sqrt(5))/2"),
        xy("-(1+sqrt(5))/2*y", "-x*sqrt((3+sqrt(5))/2)"),
    ),
    Pair(
        "coupled by the root of two",
        "vv",
        xy("-2*x-sqrt(2)*y", "-sqrt(2)*x-3*y"),
        xy("-2*x-2/sqrt(2)*y", "-2^(1/2)*x-3*y"),
    ),
    Pair(
        "nested functions",
        "nn",
        xy("sqrt(x+sqrt(x^2-1))*y", "x'*y'"),
        xy("(sqrt((x+1)/2)+sqrt((x-1)/2))*y", "x'*y'"),
    ),
    Pair(
        "a root that is a sine",
        "nn",
        xy("sqrt(1-cos(x)^2)*y*y'", "x'*sin(x)"),
        xy("sin(x)*y*y'", "2*x'*sin(x/2)*cos(x/2)"),
    ),
    Pair(
        "a product of roots that is a sine",
        "nn",
        xy("sqrt(1-cos(x))*sqrt(1+cos(x))*y*y'", "x'"),
        xy("sin(x)*y*y'", "x'"),
    ),
    Pair(
        "hyperbolic potential",
        "vv",
        xy("-sinh(2*x)-y", "-x-y"),
        xy("-2*sinh(x)*cosh(x)-y", "-x-exp(log(y))"),
    ),
    Pair(
        "hyperbolic damping",
        "nn",
        xy("cosh(x)^2*y*y'-y*y'", "sinh(x)"),
        xy("sinh(x)^2*y*y'", "(exp(x)-exp(-x))/2"),
    ),
    Pair(
        "powers of one letter",
        "nn",
        xy("x^(1/2)*x^(1/3)*y", "x'*y'"),
        xy("x^(5/6)*y", "x'*y'*(x^3)^(1/3)/x"),
    ),
    Pair("powers with a base", "nn", xy("2^x*y*y'", "4^x"), xy("exp(x*log(2))*y*y'", "(2^x)^2")),
    Pair(
        "sum of angles",
        "vv",
        xy("-sin(x+y)", "-sin(x+y)-cos(y)"),
        xy("-sin(x)*cos(y)-cos(x)*sin(y)", "-sin(y+x)-1+2*sin(y/2)^2"),
    ),
    Pair(
        "sum of angles without potential",
        "nn",
        xy("sin(x+y)*y'", "cos(x-y)"),
        xy("(sin(x)*cos(y)+cos(x)*sin(y))*y'", "cos(x)*cos(y)+sin(x)*sin(y)"),
    ),
    Pair(
        "coupled pendulums",
        "vv",
        xy("-sin(x)-k*sin(x-y)", "-sin(y)+k*sin(x-y)"),
        xy(
            "-tan(x)*cos(x)-k*(sin(x)*cos(y)-cos(x)*sin(y))",
            "-2*tan(y/2)/(1+tan(y/2)^2)+k*cos(y-x+pi/2)",
        ),
        ("k",),
    ),
    Pair(
        "planar rotor with friction on one angle",
        "nn",
        xy("-sin(x-y)-c*x'", "sin(x-y)"),
        xy("-cos(y)*sin(x)+cos(x)*sin(y)-c*x'", "sin(x-y+2*pi)"),
        ("c",),
    ),
    Pair(
        "vortex field",
        "nn",
        xy("atan(y/x)*y'", "x"),
        xy("asin(y/sqrt(x^2+y^2))*y'", "x"),
    ),
    Pair(
        "sine of an arctangent",
        "nn",
        xy("sin(atan(x))*y", "x'*y'"),
        xy("x/sqrt(1+x^2)*y", "x'*y'"),
    ),
    Pair(
        "relativistic",
        "vv",
        xy("-x*(1-x'^2-y'^2)^(3/2)*(1-x'^2)/(1-x'^2-y'^2)", "x*x'*y'*sqrt(1-x'^2-y'^2)"),
        xy("-x*sqrt(1-x'^2-y'^2)*(1-x'^2)", "x*x'*y'*(1-x'^2-y'^2)^(3/2)/(1-x'^2-y'^2)"),
    ),
    Pair(
        "inverse hyperbolic sine",
        "nn",
        xy("asinh(x)*y*y'", "x'*log(sqrt(1+x^2)-x)"),
        xy("log(x+sqrt(1+x^2))*y*y'", "-x'*asinh(x)"),
    ),
    Pair(
        "inverse hyperbolic tangent",
        "vv",
        xy("-atanh(x)-y", "-x"),
        xy("-log((1+x)/(1-x))/2-y", "-x"),
    ),
    Pair(
        "a friction that cancels",
        "vv",
        xy("sqrt(8)*y'-y'*2*sqrt(2)+y", "x"),
        xy("y", "x+(sin(2)-2*sin(1)*cos(1))*x'"),
    ),
    Pair(
        "shifted angles",
        "nn",
        xy("sin(x+pi/2)*y*y'", "cos(pi/4)*x'"),
        xy("cos(x)*y*y'", "x'/sqrt(2)"),
    ),
    Pair(
        "triple angle",
        "nn",
        xy("sin(3*x)*y*y'", "x'*sin(x)"),
        xy("(3*sin(x)-4*sin(x)^3)*y*y'", "x'*sin(x)"),
    ),
    Pair(
        "root of an exponential",
        "nn",
        xy("sqrt(exp(x))*y*y'", "exp(x)"),
        xy("exp(x/2)*y*y'", "exp(x/3)^3"),
    ),
    Pair("angles that add to a right one", "vv", xy("acos(x)*y+asin(x)*y", "x"), xy("pi/2*y", "x")),
    Pair("root of a square", "nn", xy("sqrt(x^2)*y'", "y"), xy("x*y'", "y")),
    Pair(
        "root of a square of a sum",
        "nn",
        xy("sqrt(x^2+2*x*y+y^2)*y'", "y"),
        xy("(x+y)*y'", "y"),
    ),
    Pair(
        "hyperbolic tangent",
        "nn",
        xy("tanh(x)*y*y'", "x'"),
        xy("(exp(2*x)-1)/(exp(2*x)+1)*y*y'", "x'"),
    ),
    Pair(
        "logarithms of numbers",
        "nn",
        xy("log(sqrt(2))*y*y'", "x'*log(8)"),
        xy("log(2)/2*y*y'", "x'*3*log(2)"),
    ),
    Pair(
        "paper, nonholonomic particle, second",
        "vv",
        {"x": "0", "y": "-x/(1+x^2)*x'*y'", "z": "x'*z'/(x*(1+x^2))"},
        {"x": "0", "y": "-sin(atan(x))*cos(atan(x))*x'*y'", "z": "(1/x-x/(1+x^2))*x'*z'"},
    ),
    Pair(
        "paper, knife edge, first",
        "nn",
        {"p": "0", "x": "-sin(2*p)*p'*x'/2", "y": "tan(p)*p'*x'*0+cos(2*p)*p'*x'"},
        {"p": "0", "x": "-sin(p)*cos(p)*p'*x'", "y": "(2*cos(p)^2-1)*p'*x'"},
    ),
    Pair(
        "a deviation along the motion in an arbitrary field",
        "vv",
        xy("-A(x)", "-A'(x)*y"),
        xy("-(A(x)^3)^(1/3)", "-A'(x)*exp(log(y))*B(x)/sqrt(B(x)^2)"),
        functions={"A": ["x"], "B": ["x"]},
    ),
    Pair(
        "two arbitrary functions",
        "nn",
        xy("-A(x)*y", "-B(x)"),
        xy("-A(x)*exp(log(y))", "-(B(x)^2)^(1/2)"),
        functions={"A": ["x"], "B": ["x"]},
    ),
    Pair(
        "a force that turns with time",
        "vv",
        xy("-sin(2*t)*x", "-cos(t)^2*y"),
        xy("-2*sin(t)*cos(t)*x", "-(1+cos(2*t))/2*y"),
    ),
    Pair(
        "a friction that grows with time",
        "vv",
        xy("-x-exp(t)*x'", "-y-x-exp(t)*y'"),
        xy("-x-exp(t/2)^2*x'", "-y-x-exp(t-1)*exp(1)*y'"),
    ),
)


def outcome(pair: Pair, equations: dict[str, str], time_dependent: bool) -> tuple[str, tuple[tuple[int, ...], ...]]:
    system = read_system(list(equations), equations, pair.parameters, pair.functions)
    found = decide(system, time_dependent)
    return found.verdict, found.history


@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: pair.name)
def test_equal_systems_have_equal_verdicts_and_dimensions(pair: Pair) -> None:
    for time_dependent, letter in zip((False, True), pair.verdicts, strict=True):
        first, second = (outcome(pair, written, time_dependent) for written in (pair.first, pair.second))
        assert first == second
        assert first[0] == {"v": "variational", "n": "not_variational"}[letter]


def test_at_least_forty_pairs_are_tried_and_no_pair_is_one_writing_twice() -> None:
    assert len(PAIRS) >= 40
    assert all(pair.first != pair.second for pair in PAIRS)
