"""Questions that people asked elsewhere, put as a document: each gets what the asker wanted, or the reason why not.

Sources: the places where they were asked (Stack Exchange, MathOverflow, Physics Forums, MaplePrimes), with the number
of the question where it has one. Other Lagrangians than those in the answers given there are as good: what is compared
is the answer here, which the checker confirms.
"""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.errors import InputError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_system

Document = dict[str, Any]


def _asked(equations: Any, **more: Any) -> Document:
    return {"equations": equations, "parameters": "guess", **more}


# Question, document, L(q, q') and L(t, q, q') where they are compared.
ANSWERED: list[tuple[str, Document, str | None, str | None]] = [
    ("mathematica.SE 225496", _asked({"y": "-2*y'+y"}), None, "exp(2*t)*(y'^2 + y^2)/2"),
    ("math.techqa 4101140: with arbitrary f, g, h",
     _asked("y''+f(t)*y'+g(t)*y+h(t)=0"),
     None, "exp(F(t))*(y'^2 - 2*y*h(t) - y^2*g(t))/2"),
    ("mathematica.SE 276056: two rotors, the L that they came from",
     _asked("J1*th1''+k*(th1-th2)=0; J2*th2''-k*(th1-th2)=0"),
     "J1*th1'^2/2 + J2*th2'^2/2 - k*(th1 - th2)^2/2", None),
    ("physics.SE 735240: RLC", _asked("Lc*q''+R*q'+q/C=0", coordinates=["q"]), None,
     "exp(R*t/Lc)*(Lc*q'^2 - q^2/C)/2"),
    ("MathOverflow 290434: x'' = -x' in space", _asked({"x": "-x'", "y": "-y'", "z": "-z'"}),
     "log(x')*x' + log(y')*y' + log(z')*z' - x - y - z", "exp(t)*(x'^2 + y'^2 + z'^2)/2"),
    ("Physics Forums: spring pendulum with friction",
     _asked({"r": "r*th'^2+g*cos(th)-k*(r-l)/m-c*r'/m", "th": "-2*r'*th'/r-g*sin(th)/r-c*th'/m"}), None,
     "exp(c*t/m)*(r'^2 + r^2*th'^2 + 2*g*r*cos(th) - k*r^2/m + 2*k*l*r/m)/2"),
    ("Physics Forums 338305", _asked({"u": "-u+A*(1+2*u+3*u^2)"}), "u'^2/2 - u^2/2 + A*u*(u^2 + u + 1)", None),
    ("Physics Forums 338305, the other one", _asked({"u": "-u+A/(1-u)^2"}), "u'^2/2 - u^2/2 + A/(1 - u)", None),
    ("physics.SE: friction and any potential",
     _asked("m*x''=-beta*x'-diff(V(t,x,y),x); m*y''=-beta*y'-diff(V(t,x,y),y)", functions={"V": ["t", "x", "y"]}),
     None, "exp(beta*t/m)*(m*x'^2 + m*y'^2 - 2*V(t, x, y))/2"),
    ("physics.SE 17406: m x'' = -V'", _asked("m*x''=-diff(V(x),x)", coordinates=["x"], functions={"V": ["x"]}),
     "m*x'^2/2 - V(x)", None),
    ("physics.SE 580258: L with an arctangent", _asked({"x": "-l*x'-w^2*x"}), None, "exp(l*t)*(x'^2 - w^2*x^2)/2"),
    ("math.techqa 4876896: x' = 2 y, y' = -2 x", _asked("x'=2*y; y'=-2*x"), "x'^2/2 - 2*x^2", None),
    ("Friedmann's a''", _asked({"a": "-a'^2/(2*a)-k/(2*a)+Lambda*a/2"}), "a*a'^2/2 - a*k/2 + Lambda*a^3/6", None),
    ("Lane and Emden", _asked({"y": "-2*y'/t-y^n"}), None, "t^2*y'^2/2 - t^2*y^(n + 1)/(n + 1)"),
    ("Lotka and Volterra, EulerLagrange.jl", _asked("x'=a*x-b*x*y; y'=-c*y+d*x*y"), None, None),
    ("Gegenbauer", _asked("(1-t^2)*y''-(2*m+1)*t*y'+n*(n+2*m)*y=0", coordinates=["y"]), None,
     "y'^2*(1 - t^2)^(m + 1/2)/2 - n*(2*m + n)*y^2*(1 - t^2)^(m - 1/2)/2"),
    ("hypergeometric", _asked("t*(1-t)*y''+(c-(a+b+1)*t)*y'-a*b*y=0", coordinates=["y"]), None, None),
    ("y'' = k t^a y^b y'^c", _asked({"y": "k*t^a*y^b*y'^c"}), None, None),
    ("drag by a power of the speed", _asked({"x": "-k*x'^n"}), None, None),
    ("the same with weight", _asked({"x": "-k*x'^n-g"}), "F(x')*x' - G(x') - x", None),
    ("catenary", _asked({"y": "sqrt(1+y'^2)/a"}), None, None),
    ("Rayleigh and Plesset", _asked({"R": "-3*R'^2/(2*R)+(p0*R^(-3*k)-p1)/(rho*R)-2*sig/(rho*R^2)"}), None, None),
]  # fmt: skip


@pytest.mark.parametrize(
    ("document", "wanted", "timed"), [one[1:] for one in ANSWERED], ids=[one[0] for one in ANSWERED]
)
def test_a_question_gets_its_lagrangian(document: Document, wanted: str | None, timed: str | None) -> None:
    result = solve_system(document, SolveOptions())
    with_time = result["with_time"] or {}
    assert "variational" in {result["verdict"], result["verdict_with_time"]}
    found = [part["text"] for part in (result["lagrangian"], with_time.get("lagrangian")) if part]
    assert found
    assert {wanted, timed} - {None} <= set(found)


def test_vectors_of_position_in_a_magnetic_field_keep_their_mass() -> None:
    """math.techqa 3380378: the Lorentz force of an arbitrary A(x, y, z), L with m as written."""
    a, b, c = (f"A{k}(x, y, z)" for k in (1, 2, 3))
    z_field, y_field, x_field = (
        f"(diff({b},x)-diff({a},y))",
        f"(diff({a},z)-diff({c},x))",
        f"(diff({c},y)-diff({b},z))",
    )
    document = _asked(
        f"m*x''=Q*(y'*{z_field}-z'*{y_field}); "
        f"m*y''=Q*(z'*{x_field}-x'*{z_field}); m*z''=Q*(x'*{y_field}-y'*{x_field})",
        coordinates=["x", "y", "z"],
        functions={name: ["x", "y", "z"] for name in ("A1", "A2", "A3")},
    )
    text = solve_system(document, SolveOptions())["lagrangian"]["text"]
    assert "m*x'^2/2 + m*y'^2/2 + m*z'^2/2" in text
    assert all(part in text for part in ("Q*A1(x, y, z)*x'", "Q*A2(x, y, z)*y'", "Q*A3(x, y, z)*z'"))


# physics.SE 311168: existence is all that is known; another of physics.SE, and a projectile: no L at all, proven.
DECIDED = [
    ("an oscillator with gamma(x)",
     _asked({"x": "-gamma(x)*x'-w^2*x"}, coordinates=["x"], functions={"gamma": ["x"]}), "variational"),
    ("a force across the motion",
     _asked("r*phi''+2*r'*phi'+k(r)*r*r'*phi'=0; r''-r*phi'^2-k(r)*r^2*phi'^2=0", coordinates=["r", "phi"],
            functions={"k": ["r"]}), "not_variational"),
    ("a projectile with quadratic drag",
     _asked({"x": "-k*sqrt(x'^2+y'^2)*x'", "y": "-k*sqrt(x'^2+y'^2)*y'-g"}), "not_variational"),
]  # fmt: skip


@pytest.mark.parametrize(("document", "verdict"), [one[1:] for one in DECIDED], ids=[one[0] for one in DECIDED])
def test_a_question_is_settled_by_proof(document: Document, verdict: str) -> None:
    result = solve_system(document, SolveOptions())
    assert result["verdict"] == result["verdict_with_time"] == verdict
    assert result["checked"] == "valid"


# math.techqa 3574933 (its Lagrangian is singular) and MaplePrimes 225411 (L(w'') has a fourth-order equation).
REFUSED = [
    ({"coordinates": ["x", "y"], "equations": "x=0; 2*y''+3*y^2=0"}, "singular, as is every Lagrangian that has it"),
    ({"coordinates": ["w"], "equations": "w''''+w=0"}, "write equations of second order"),
]


@pytest.mark.parametrize(("document", "reason"), REFUSED, ids=["singular", "fourth order"])
def test_what_has_no_regular_lagrangian_is_refused_with_that_reason(document: Document, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        solve_system(document, SolveOptions())
