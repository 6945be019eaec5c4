"""Both sides of an identity are one function to the decision, and a difference is always seen."""

from __future__ import annotations

from fractions import Fraction

import pytest

from inverse_service import check, solve
from inverse_service.inverse_problem.decision.deciding import Decision, decide
from inverse_service.mechanics.reading import read_system

# Of the multiplier of the Henon-Heiles system, by degree: it is constant, and unique up to a factor.
HENON_HEILES = (1, 1, 1, 9)

IDENTITIES = """
sin(2*x) == 2*sin(x)*cos(x)
cos(2*x) == 1-2*sin(x)^2
cos(2*x) == 2*cos(x)^2-1
sin(3*x) == 3*sin(x)-4*sin(x)^3
sin(x) == 2*sin(x/2)*cos(x/2)
tan(x) == sin(x)/cos(x)
tan(x)^2+1 == sec(x)^2
cot(x)*sin(x) == cos(x)
csc(x) == 1/sin(x)
sin(x+y) == sin(x)*cos(y)+cos(x)*sin(y)
cos(x-y) == cos(x)*cos(y)+sin(x)*sin(y)
sin(x+pi/2) == cos(x)
sin(x+pi/3) == sin(x)/2+sqrt(3)/2*cos(x)
tan(x/2) == sin(x)/(1+cos(x))
exp(x+y) == exp(x)*exp(y)
exp(2*x) == exp(x)^2
exp(x/2) == sqrt(exp(x))
exp(x+1) == exp(1)*exp(x)
exp(-x) == 1/exp(x)
2^x == exp(x*log(2))
4^x == 2^x*2^x
cosh(x)^2 == 1+sinh(x)^2
tanh(x) == (exp(2*x)-1)/(exp(2*x)+1)
cosh(2*x) == 2*cosh(x)^2-1
sinh(x+y) == sinh(x)*cosh(y)+cosh(x)*sinh(y)
sech(x)^2 == 1-tanh(x)^2
log(x*y) == log(x)+log(y)
log(x^3) == 3*log(x)
log(x/y) == log(x)-log(y)
log(8*x) == 3*log(2)+log(x)
log(exp(x)*y) == x+log(y)
exp(log(x)+y) == x*exp(y)
exp(log(x)/2) == sqrt(x)
exp(2*log(x)) == x^2
log(sqrt(x)) == log(x)/2
log(x^2-y^2) == log(x-y)+log(x+y)
asinh(x) == log(x+sqrt(x^2+1))
log(sqrt(1+x^2)-x) == -asinh(x)
acosh(x+2) == log(x+2+sqrt((x+1)*(x+3)))
atanh(x) == log(1+x)/2-log(1-x)/2
asin(x) == pi/2-acos(x)
atan(x) == asin(x/sqrt(1+x^2))
atan(1/x) == pi/2-atan(x)
sin(atan(x)) == x/sqrt(1+x^2)
cos(asin(x)) == sqrt(1-x^2)
sin(2*atan(x)) == 2*x/(1+x^2)
sin(asin(x)+y) == x*cos(y)+sqrt(1-x^2)*sin(y)
atan(sin(x)/cos(x)) == x
sqrt(x*y) == sqrt(x)*sqrt(y)
sqrt(x^2) == x
sqrt(x)*x^(1/3) == x^(5/6)
x^(1/3)*y^(1/3) == (x*y)^(1/3)
(x^3)^(1/3) == x
sqrt(x^2+2*x*y+y^2) == x+y
sqrt(x^2-y^2) == sqrt(x-y)*sqrt(x+y)
sqrt(8) == 2*sqrt(2)
sqrt(2)*sqrt(3) == sqrt(6)
sqrt(1/2) == sqrt(2)/2
2^(1/3)*4^(1/3) == 2
sqrt(17)*sqrt(34) == 17*sqrt(2)
sqrt(5+2*sqrt(6)) == sqrt(2)+sqrt(3)
sqrt(3-2*sqrt(2)) == sqrt(2)-1
(2+sqrt(5))^(1/3) == (1+sqrt(5))/2
sqrt(2+sqrt(3)) == (sqrt(6)+sqrt(2))/2
sqrt(x+sqrt(x^2-1)) == sqrt((x+1)/2)+sqrt((x-1)/2)
sqrt(x+2*sqrt(x)+1) == sqrt(x)+1
sqrt(1-cos(x)^2) == sin(x)
sqrt(1-cos(x))*sqrt(1+cos(x)) == sin(x)
sqrt((1-cos(x))/2) == sin(x/2)
sqrt(1+sin(2*x)) == sin(x)+cos(x)
sqrt(cosh(2*x)-1) == sqrt(2)*sinh(x)
sqrt(exp(2*x)+2*exp(x)+1) == exp(x)+1
cos(pi/4) == 1/sqrt(2)
cos(pi/12) == (sqrt(6)+sqrt(2))/4
cos(pi/6)^2 == 3/4
exp(log(2)*3) == 8
cos(1)^2+sin(1)^2 == 1
sin(2) == 2*sin(1)*cos(1)
sin(x+1) == sin(x)*cos(1)+cos(x)*sin(1)
sin(sin(x)+y) == sin(sin(x))*cos(y)+cos(sin(x))*sin(y)
exp(sin(2*x)) == exp(sin(x)*cos(x))^2
log(sin(2*x)) == log(2)+log(sin(x))+log(cos(x))
x^y == exp(y*log(x))
(x*y)^pi == x^pi*y^pi
sqrt(x^4+2*x^2+1) == x^2+1
exp(sqrt(2)*x)^2 == exp(sqrt(8)*x)
sqrt(sqrt(x)*sqrt(x)) == sqrt(x)
x^sqrt(2)*x^(1-sqrt(2)) == x
(x^sqrt(2))^sqrt(2) == x^2
x^((1+sqrt(5))/2)*x^((1-sqrt(5))/2) == x
exp(sqrt(2)*x)*exp(sqrt(3)*x) == exp((sqrt(2)+sqrt(3))*x)
cos(pi/5) == (1+sqrt(5))/4
tan(pi/8) == sqrt(2)-1
8*sin(pi/7)*sin(2*pi/7)*sin(3*pi/7) == sqrt(7)
tan(3*pi/11)+4*sin(2*pi/11) == sqrt(11)
sin(20*pi/180) == cos(7*pi/18)
sin(x+pi/5) == sin(x)*cos(pi/5)+cos(x)*sin(pi/5)
""".strip().splitlines()

# Identities that need the sign of something under a root, parts of pi, or fine fractions of an angle.
BRANCHES = """
exp(sqrt((x-y)^2))+exp(-sqrt((x-y)^2)) == exp(x-y)+exp(y-x)
sin(sqrt((x-y)^2))^2 == sin(x-y)^2
atan(sqrt((x-y)^2))^2 == atan(x-y)^2
log(sqrt((x-y)^2)) == log((x-y)^2)/2
cos(sqrt((x-y)^2+4*x*y)) == cos(x+y)
sin(atan(1/x)) == cos(atan(x))
sin(atan(x)+atan(1/x)) == 1
exp(atan(x)) == exp(pi/2)*exp(-atan(1/x))
sin(x+atan(1)) == (sin(x)+cos(x))/sqrt(2)
atan(2)+atan(1/2) == pi/2
4*atan(1/5)-atan(1/239) == pi/4
sin(x+atan(3/4)) == (4*sin(x)+3*cos(x))/5
atan(tan(4*pi/5)) == -pi/5
asin(1/2) == pi/6
acos(0) == pi/2
asin(2*x*sqrt(1-x^2)) == 2*asin(x)
acos(1-2*x^2) == 2*asin(x)
atanh(sin(x)) == asinh(tan(x))
exp(asinh(x)) == x+sqrt(1+x^2)
sinh(log(x)) == (x-1/x)/2
cosh(acosh(x)) == x
tan(asin(x)) == x/sqrt(1-x^2)
sin(acos(x)) == sqrt(1-x^2)
cos(3*acos(x)) == 4*x^3-3*x
exp(2*atanh(x)) == (1+x)/(1-x)
sin(acos(x)/2) == sqrt((1-x)/2)
sin(asin(x)/2) == x/(2*sqrt((1+sqrt(1-x^2))/2))
sqrt(1-sqrt(1-x^2)) == sqrt(2)*sin(asin(sqrt(x^2))/2)
tan(atan(x)/2) == (sqrt(1+x^2)-1)/x
cos(acos(x)/3) == cos(pi/6-asin(x)/3)
cos(acos(-x)/3-pi/3) == cos(acos(x)/3)
4*cos(acos(x)/3)^3 == 3*cos(acos(x)/3)+x
sqrt(1-4*x^2*(1-x^2)) == 1-2*x^2
sqrt(1-4*x^2*sqrt(1-x^2)^2) == 1-2*x^2
sqrt(1-(-8*x^3)^(2/3)) == sqrt(1-4*x^2)
sqrt(1+(-8*x^3)^(1/3)+x^2) == 1-x
sqrt(-x)*sqrt(-y) == sqrt(x*y)
sqrt(1+sin(50*x)) == sqrt((sin(25*x)+cos(25*x))^2)
sin(123*x) == sin(100*x)*cos(23*x)+cos(100*x)*sin(23*x)
sin(1001*x/500) == sin(2*x)*cos(x/500)+cos(2*x)*sin(x/500)
exp(20001*x) == exp(20000*x)*exp(x)
exp(0.12345*x)*exp(0.87655*x) == exp(x)
exp(log(200560490130)*x) == 200560490130^x
sqrt(sec(x)^2-1) == tan(x)
sqrt(x+y+2*sqrt(x*y)) == sqrt(x)+sqrt(y)
(26+15*sqrt(3))^(1/3) == 2+sqrt(3)
sqrt(x'^2) == x'
sqrt((2+log(2*x)+log(x))^2) == 2+log(x^2)+log(2)
sqrt((2+sin(x+1)+sin(x))^2) == 2+sin(x)+sin(x)*cos(1)+cos(x)*sin(1)
sqrt((x+1+sin(2))^2) == x+1+2*sin(1)*cos(1)
sqrt((x+1+exp(2))^2) == x+1+exp(1)^2
sqrt((x+1+log(6))^2) == x+1+log(2)+log(3)
""".strip().splitlines()

# True identities that the reduction of atoms does not reach; it must say so and never be wrong.
UNREACHED = """
log(2+sqrt(3)) == 2*log((sqrt(3)+1)/sqrt(2))
cos(pi/8) == sqrt(2+sqrt(2))/2
sqrt(2+sqrt(2))*sqrt(2-sqrt(2)) == sqrt(2)
""".strip().splitlines()


def disturbed(difference: str) -> Decision:
    """Henon-Heiles with a term that destroys its Lagrangian unless the difference is zero."""
    x = f"-x-2*x*y+({difference})*x'*y'^2"
    return decide(read_system(["x", "y"], {"x": x, "y": "-y-x^2+y^2"}), False)


@pytest.mark.parametrize("identity", IDENTITIES + BRANCHES)
def test_both_sides_of_an_identity_cancel_and_a_difference_is_seen(identity: str) -> None:
    left, right = identity.split(" == ")
    for difference in (f"({left})-({right})", f"({right})-({left})"):
        found = disturbed(difference)
        assert (found.verdict, found.history[-1:]) == ("variational", (HENON_HEILES,)), found.reason
    assert disturbed(f"({left})-({right})+{Fraction(1, 1000)}").verdict == "not_variational"


@pytest.mark.parametrize("identity", UNREACHED)
def test_what_cannot_be_reduced_is_undetermined_with_a_reason(identity: str) -> None:
    left, right = identity.split(" == ")
    for difference in (f"({left})-({right})", f"({right})-({left})", f"({left})-({right})+{Fraction(1, 1000)}"):
        found = disturbed(difference)
        assert found.verdict == "undetermined"
        assert len(found.reason) > 20


# Halves and thirds of inverse functions to the end: the verdict, and the Lagrangian or a part of it (by hand).
PARTS = [
    ("x'' = -sin(asin(x)/2)", "variational", "x'^2/2 - 4*x*sin(asin(x)/2)/3 - 2*cos(asin(x)/2)*sqrt(1 - x^2)/3"),
    ("x'' = -tan(acos(x)/2)", "variational", "x'^2/2 - asin(x) - sqrt(1 - x^2)"),
    ("x'' = -cos(atan(x)/2)", "variational", "x'^2/2 - F(x)"),
    ("x'' = -cos(acos(x)/3)", "variational", "x'^2/2 - 9*x*cos(acos(x)/3)/8 - 3*sin(acos(x)/3)*sqrt(1 - x^2)/8"),
    ("x'' = -cos(acos(x*y)/3)*y; y'' = -cos(acos(x*y)/3)*x", "variational", "9*x*y*cos(acos(x*y)/3)/8"),
    ("x'' = -y*sin(asin(x)/3); y'' = -x*cos(acos(y)/3)", "not_variational", ""),
    ("x'' = -x + (cos(acos(x)/3) - cos(pi/6 + asin(x)/3))*y'; y'' = -y", "not_variational", ""),
    ("x'' = -x + (sin(asin(x)/2) - x/(2*sqrt((1 + sqrt(1 - x^2))/2)))*y'; y'' = -y", "variational", ""),
    ("x'' = -x + (sin(asin(x)/2) + x/(2*sqrt((1 + sqrt(1 - x^2))/2)))*y'; y'' = -y", "not_variational", ""),
    ("x'' = -sin(asin(x)/2) - sqrt((1 - sqrt(1 - x^2))/2)", "variational", "x'^2/2 - 4*cos(asin(x)/2)/3"),
]


@pytest.mark.parametrize(("equations", "verdict", "part"), PARTS)
def test_parts_of_inverse_functions_are_decided_and_the_checker_agrees(equations: str, verdict: str, part: str) -> None:
    result = solve({"equations": equations})
    assert (result["verdict"], result["verdict_with_time"]) == (verdict, verdict)
    assert part in (result["lagrangian"] or {"text": ""})["text"]
    assert check(result)["verdict"] == "valid"


def test_the_argument_of_a_half_may_hold_a_parameter() -> None:
    result = solve({"equations": "x'' = -sin(asin(x/a)/2)", "parameters": ["a"]})
    potential = "4*x*sin(asin(x/a)/2)/3 - 2*a*cos(asin(x/a)/2)*sqrt(1 - x^2/a^2)/3"
    assert result["lagrangian"]["text"] == f"x'^2/2 - {potential}"
    assert check(result)["verdict"] == "valid"
