"""Forgeries of a second attack, each by a way that the first ones did not take; none is valid."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service import check
from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import Document, all_rows, check_result
from tests.certificate.test_forged_kinds import PLACE, claim, definite
from tests.certificate.test_forged_motions import ALL_FREE, FREE, no
from tests.certificate.test_known_attacks import TIMED, certificate, integral, of_lagrangian, result_of

FLAT = "x'^2/2+y'^2/2"
DOUGLAS = ("sqrt(x^2)*y'-y^2", "-x*x'-2*x*y", "x'^2/2+y'^2/2-x*y^2+x^2*y'/2")  # right where x > 0


def times(factor: str, **content: Any) -> Document:
    """The free particle's L for x'' = factor y', which is false as far as the factor is not 0."""
    return of_lagrangian(f"({factor})*y'", "0", FLAT, **content)


def no_lagrangian(x: str, y: str, **content: Any) -> Document:
    return certificate({"x": x, "y": y}, "nonexistence", order=2, rows=all_rows(2, 4, 2), **content)


A, B = {"functions": {"A": ["x"]}}, {"functions": {"B": ["x", "y"]}}
DIMENSIONS: Document = {"order": 1, "degree": 1, "dimensions": [3, 10],
                        "symbol": {"dimension": 7, "prolonged": 12, "characters": [3, 3, 1, 0]}}  # fmt: skip
FORGED = {
    # roots, and the choices of them
    "a root on its other branch": of_lagrangian(*DOUGLAS, roots=[{"root": "sqrt(x^2)", "is": "x"}], near={"x": "-2"}),
    "a condition that both branches satisfy": of_lagrangian(
        *DOUGLAS, roots=[{"root": "sqrt(x^2)", "is": "x"}], conditions=["x^2 > 0"], near={"x": "-2"}
    ),
    "a root that is itself": of_lagrangian(
        *DOUGLAS, roots=[{"root": "sqrt(x^2)", "is": "sqrt(x^2)"}], near={"x": "-2"}
    ),
    "a condition that reaches over the border": of_lagrangian(
        *DOUGLAS, conditions=["x > -1/10^300"], near={"x": "-1e-99"}
    ),
    "two differences, each zero for some choice": times("(sqrt(x^2)-x)*(sqrt(y^2)-y)", near={"x": "-2", "y": "-3"}),
    "large powers that agree for one choice": times("sqrt(x^2)^5001-x^5001", near={"x": "-2"}),
    "large powers that agree for each choice of a factor": times(
        "(sqrt(x^2)^9001+x^9001)*(sqrt(y^2)-y)", near={"x": "2", "y": "-2"}
    ),
    "large powers near each other": times("x^20000-x^20001", near={"x": "1/2"}),
    "a quotient of large powers": times("(x^4097/x^4096-2*x)*exp(x)", near={"x": "1/2"}),
    "a function that agrees for one choice": times("A(sqrt(x^2))-A(x)", **A, near={"x": "-2"}),
    "a function at a root of the other sign": times("A(sqrt(x^2))-A(-x)", **A, near={"x": "2"}),
    "a function at arguments that meet at the point": times("A(x)-A(2*x-1)+0*exp(x)", **A, near={"x": "1"}),
    "derivatives by exchanged arguments": times("B[1,0](x, y)-B[0,1](y, x)+0*exp(x)", **B),
    "a derivative of another order": times("A[2](x)-A'(x)+0*exp(x)", **A),
    # names and the grammar
    "a function called u": times("sinh(x)-u(x)", functions={"u": ["x"]}),
    "a parameter called u": times("sinh(u)-sinh(x)", parameters=["u"]),
    "an integral called u": of_lagrangian(
        "sinh(x)", "0", FLAT + "+cosh(x)+u(t)*x", integrals={"u": integral("1")["F"]}, **TIMED
    ),
    "a parameter that looks like a velocity": times("a-a", parameters=["a", "x'"]),
    "a parameter called i": times("cos(x)+i*sin(x)-exp(i*x)", parameters=["i"]),
    "an exponent of minus zero": times("x^(-0)-1+x^-1"),
    "a tower of powers": times("x^2^3-x^6"),
    "a minus before a power": times("(-x)^2-(-x^2)"),
    "a chain of quotients": times("8/4/2-4"),
    "blanks in an exponent": times("x^ (-2)-x^2"),
    "three hundred nines": times("0." + "9" * 300 + "-1+0*exp(x)"),
    # numbers and angles
    "an arctangent whose branch a parameter says": times("atan(a)+atan(1/a)-pi/2", parameters=["a"], near={"a": "-3"}),
    "half an arctangent": times("tan(atan(x)/2)-(sqrt(1+x^2)+1)/x", near={"x": "2"}),
    "half an arcsine as a root, beyond zero": times("sin(asin(x)/2)-sqrt((1-sqrt(1-x^2))/2)", near={"x": "-1/2"}),
    "half an arcsine with the other sign": times("sin(asin(x)/2)+x/(2*sqrt((1+sqrt(1-x^2))/2))", near={"x": "1/2"}),
    "half an arcsine said to be another root": times(
        "cos(asin(x)/2)-sqrt((1-sqrt(1-x^2))/2)",
        near={"x": "1/2"},
        roots=[{"root": "sqrt((1-sqrt(1-x^2))/2)", "is": "cos(asin(x)/2)"}],
    ),
    "a third of an arccosine on another branch": times("cos(acos(x)/3)-cos(acos(x)/3+2*pi/3)", near={"x": "1/2"}),
    "a third of an arcsine on another branch": times("cos(acos(x)/3)-cos(pi/6+asin(x)/3)", near={"x": "1/2"}),
    "a third of a triple beyond its interval": times("sin(asin(3*x-4*x^3)/3)-x", near={"x": "4/5"}),
    "Gudermann with the other sign": times("2*atan(tanh(x/2))+atan(sinh(x))"),
    "the arcsine of the next interval": times("asin(sin(x))-(pi-x)", near={"x": "1/2"}),
    "the arccosine of a negative angle": times("acos(cos(x))-x", near={"x": "-1/2"}),
    "almost a multiple of pi": times("sin(pi*(1+1/10^200))"),
    "almost Machin": times("4*atan(1/5)-atan(1/239)-pi/4+1/10^60"),
    "almost an integer": times("exp(pi*sqrt(163))-262537412640768744"),
    "the cosine of another twelfth": times("cos(pi/12)-(sqrt(6)-sqrt(2))/4"),
    "the cosine of two fifths of pi for that of one": times("cos(pi/5)-(sqrt(5)-1)/4"),
    "the other root of seven": times("8*sin(pi/7)*sin(2*pi/7)*sin(3*pi/7)+sqrt(7)"),
    "the other root of eleven": times("tan(3*pi/11)+4*sin(2*pi/11)+sqrt(11)"),
    "a cosine and its conjugate": times("cos(pi/7)-cos(3*pi/7)"),
    "another multiple of arctangents of integers": times("4*atan(1/5)-atan(1/238)-pi/4"),
    "a fine angle and the next": times("cos(pi/720)-cos(pi/719)"),
    "an arctangent and another part of pi": times("atan(tan(pi/5))-pi/7"),
    "a nested root with the other sign": times("sqrt(3-2*sqrt(2))-(1-sqrt(2))+0*exp(x)"),
    "a cube root of the conjugate": times("(2+sqrt(5))^(1/3)-(1-sqrt(5))/2"),
    "logarithms of negative numbers": times("log(x*y)-log(-x)-log(-y)+1/10^99", near={"x": "-2", "y": "-3"}),
    "steps on both sides": times("Heaviside(x)+Heaviside(-x)-1-Heaviside(y)", near={"x": "1", "y": "2"}),
    # Hessians and integrals
    "a Hessian that is regular for the other choice": of_lagrangian(
        "0", "0", "x'^2/2+(sqrt(y^2)-y)*y'^2", near={"y": "2"}
    ),
    "a Hessian that vanishes by an identity": of_lagrangian("0", "0", "x'^2/2+(sin(y')^2+cos(y')^2)*y'"),
    "a Hessian by a function less itself": of_lagrangian("0", "0", "x'^2/2+(A(y)-A(y))*y'^2", functions={"A": ["y"]}),
    "an integral over a parameter": of_lagrangian("0", "0", FLAT, integrals=integral("1", "a"), parameters=["a"]),
    "an integral named like a function": of_lagrangian(
        "0", "0", FLAT + "+A(x)", integrals={"A": integral("0", "x")["F"]}, functions={"A": ["x"]}
    ),
    "an integral with another slope": of_lagrangian("-x^3", "0", FLAT + "-F(x)", integrals=integral("x^2", "x")),
    # nonexistence and existence
    "none, by a root of the other sign": no_lagrangian("(sqrt(x^2)-x)*y'", "-y+(sqrt(x^2)-x)*x", near={"x": "2"}),
    "none, by a root said wrongly": no_lagrangian(
        "(sqrt(x^2)-x)*y'", "-y", roots=[{"root": "sqrt(x^2)", "is": "-x"}], near={"x": "2"}
    ),
    "none, by a condition on the other side": no_lagrangian("y'*(sqrt(x^2)-x)", "-y", conditions=["x > 0"]),
    "none, by a function less itself": no_lagrangian("(A(x)-A(x))*y'", "-y", **A),
    "none, by another piece": no_lagrangian("Heaviside(-x)*y'", "-y*Heaviside(-x)", near={"x": "2"}),
    "none, by large powers that cancel": no_lagrangian("(x^9999-x^9998*x)*y'", "-y"),
    "one, by a large power": certificate({"x": "-y'+0*x^9999", "y": "-y"}, "existence", **DIMENSIONS),
    "one, on one side of a root": certificate({"x": "-y'*sqrt(x^2)/x", "y": "-y"}, "existence", **DIMENSIONS),
    "one, for a function": certificate({"x": "-A(x)*y'", "y": "-y"}, "existence", **A, **DIMENSIONS),
    "one, where a condition reaches over the border": certificate(
        {"x": "(sqrt(x^2)+x)*y'", "y": "-y"}, "existence", conditions=["x > -1"], near={"x": "1/9"}, **DIMENSIONS
    ),
    # motions and kinds
    "a motion without constraints": of_lagrangian("-y'", "-y", FLAT)
    | {"system": {"coordinates": ["x", "y"], "equations": {"x": "-y'", "y": "-y"}, "velocities": {}}},
    "a motion with another force": of_lagrangian("0", "0", FLAT)
    | {"system": {"coordinates": ["x", "y"], "equations": {"x": "-x"}, "velocities": {"y": "x'"}}},
    "no motion, with rows of bivectors to come": no(FREE, 2, ALL_FREE, bivectors=3),
    "natural but for a quartic": claim("natural", "x'^2/2+x'^4/10^80", "0"),
    "finsler but for a potential": claim("finsler", "x'^2+x/10^90", "0"),
    "definite by a hidden zero": definite("x'^2/2-y'^2*(x-x+1/10^200)", "0", "0"),
    "definite on the other side of a root": definite("x'^2/2+sqrt(x^2)*y'^2/x", "0", "0", near=PLACE | {"x": "-1"}),
}


ROOTS = {  # that seem to be independent of each other; one choice of them would do in half of the checks
    "a root of what holds a root": times("sqrt(sqrt(x)^2-x+y^2)-y", near={"x": "2", "y": "-2"}),
    "a root of what holds a function of a root": times(
        "sqrt(A(sqrt(x)^2)-A(x)+y^2)-y", **A, near={"x": "2", "y": "-2"}
    ),
    "a root of what holds large powers": times("sqrt((sqrt(x)^2)^5001-x^5001+y^2)-y", near={"x": "2", "y": "-2"}),
    "a root of an integral": of_lagrangian(
        "0", "0", FLAT + "+(sqrt((F(t)-F(t)+y)^2)-y)*x*y", integrals=integral("1"), near={"y": "-2"}, **TIMED
    ),
    "two roots whose product is a square": times("sqrt(x)*sqrt(x*y^2)-x*y", near={"x": "2", "y": "-2"}),
    "three roots whose product is a square": times(
        "sqrt(x+9)*sqrt(y+9)*sqrt((x+9)*(y+9)*(x-y)^2)-(x+9)*(y+9)*(x-y)", near={"x": "1", "y": "2"}
    ),
    "a sixth root of a square": times("((y^2)^(1/6))^3-y", near={"y": "-2"}),
    "a tenth root of a square": times("((y^2)^(1/10))^5-y", near={"y": "-2"}),
    "a root of a square of exponentials": times("sqrt(exp(2*x)*y^2)-exp(x)*y", near={"y": "-2"}),
    "a root of a logarithm": times("sqrt(log(x)^2)-log(x)", near={"x": "1/2"}),
    "half an angle whose cosine is rational": times(
        "cos(atan(4*x*(1-x^2)/(1-6*x^2+x^4))/2)+(1-x^2)/(1+x^2)",
        conditions=["1-6*x^2+x^4 > 0", "1+x^2 > 0"],
        near={"x": "1/10"},
    ),
    "a root of half an angle": times("sqrt(2-2*cos(x))-2*sin(x/2)", near={"x": "-1"}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ROOTS)
def test_roots_that_depend_on_each_other_are_tried_with_both_signs(name: str) -> None:
    assert "valid" not in [check_certificate(ROOTS[name], seed=seed).verdict for seed in range(6)]


@pytest.mark.slow
@pytest.mark.parametrize("name", FORGED)
def test_a_second_attack_finds_no_way(name: str) -> None:
    for seed in (1, 2):
        found = check_certificate(FORGED[name], seed=seed)
        assert found.verdict != "valid", found.reasons


# --- results that were valid
FRICTION = {"x": "-x-2*x*y-x'", "y": "-y-x^2+y^2-y'"}  # Henon and Heiles with friction: no L, but one with D
NONE = certificate(FRICTION, "nonexistence", order=2, rows=all_rows(2, 4, 2))


@pytest.mark.parametrize("kind", ["rayleigh", "rayleigh_general", "time", "parameters", "spherical", ""])
def test_none_without_friction_says_nothing_of_friction_or_of_no_kind(kind: str) -> None:
    result = result_of(NONE) | {"kinds": {"natural": {"verdict": "not_variational", "certificate": NONE}}}
    assert check_result(result).verdict == "valid"
    forged = result | {"kinds": {kind: result["kinds"]["natural"]}}
    assert check_result(forged).verdict == "invalid"
    assert check(forged, {"equations": FRICTION, "kinds": ["rayleigh"]})["verdict"] == "invalid"


YES = of_lagrangian("0", "0", FLAT)
MAIN = result_of(YES) | {"verdict_with_time": "variational"}


@pytest.mark.parametrize(
    "branch",
    [
        {},
        {"verdict": "not_variational"},
        {"verdict": "not_variational", "certificate": NONE},
        {"verdict": "variational", "certificate": YES, "lagrangian": {"text": "x'^2"}},
        {"verdict": "undetermined"},
    ],
)
def test_every_branch_is_looked_at(branch: Document) -> None:
    first = {key: MAIN[key] for key in ("verdict", "certificate", "lagrangian", "verdict_with_time")}
    assert check_result(MAIN | {"branches": [first]}).verdict == "valid"
    assert check_result(MAIN | {"branches": [first, branch | {"domain": ["x > 0"]}]}).verdict != "valid"


@pytest.mark.slow
@pytest.mark.parametrize("border", ["10^9", "10^15", "1000^7"])
def test_a_border_far_away_is_part_of_the_domain(border: str) -> None:
    """On x < -border the system is not variational, so `domain` has to say where it ends."""
    u = f"(x+{border})"
    forces = {"x": f"sqrt({u}^2)*y'-y^2", "y": f"-{u}*x'-2*x*y"}
    lagrangian = f"x'^2/2+y'^2/2-x*y^2+{u}^2*y'/2"
    root = {"root": f"sqrt({u}^2)", "is": f"x+{border}"}
    proof = of_lagrangian(forces["x"], forces["y"], lagrangian, roots=[root], near={"x": "1"})
    stated = proof | {"conditions": [f"x > -{border}"]}
    assert check_result(result_of(stated) | {"domain": stated["conditions"]}).verdict == "valid"
    for seed in range(4):
        assert check_result(result_of(proof) | {"domain": []}, seed=seed).verdict != "valid"


def test_an_inequality_hides_behind_no_other() -> None:
    assert check_result(MAIN | {"domain": ["x != 0"]}).verdict == "valid"
    assert check_result(MAIN | {"domain": ["x > 5 != 0"]}).verdict != "valid"
