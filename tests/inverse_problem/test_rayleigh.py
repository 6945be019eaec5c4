"""Natural Lagrangians with friction: damped chains and pendulums have L and D, others are proven to have none."""

from __future__ import annotations

import json
from typing import Any

import pytest
import sympy

from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.checking import check_document
from inverse_service.service.documents.documents import solve_document

PENDULUM = (
    "2*a''+b''*cos(a-b)+b'^2*sin(a-b)+2*sin(a)+c*a'+k*(a'-b')=0; a''*cos(a-b)+b''-a'^2*sin(a-b)+sin(b)+k*(b'-a')=0"
)
CHAIN = {"x": "-2*x + y - 2*x' + y'", "y": "x - 2*y + z + x' - 2*y' + z'", "z": "y - z + y' - z'"}
SPEED = "sqrt(x'^2+y'^2+z'^2)"
DRAG = {"x": f"-{SPEED}*x'", "y": f"-{SPEED}*y'", "z": f"-1-{SPEED}*z'"}
# D and the forces dD/dv: Rayleigh 1877, 81; Goldstein 1980, 1.5.
WITH_FRICTION = [
    ("damped oscillator (Landau, Lifshitz 1976, 25)", {"x": "-x-c*x'"}),
    ("chain of three masses with springs and dampers (Rayleigh 1877, 81)", CHAIN),
    ("a damper and a gyroscopic force", {"x": "-x-x'", "y": "-y+x'"}),
    ("masses 2 and 1", {"x": "y-x'", "y": "2*x-y'"}),
    ("with gyroscopic terms (Merkin 1997, ch. 6)", {"x": "-x-c*x'+b*y'", "y": "-2*y-k*y'-b*x'"}),
    ("two masses between walls, each damped (Rayleigh 1877, 81)", {"x": "-2*x+y-x'", "y": "x-2*y-y'"}),
    ("damped absorber of vibrations (Den Hartog 1956, ch. 3)", {"x": "-x-(x-y)/2-(x'-y')/2", "y": "x-y+x'-y'"}),
    ("a damper between masses 2 and 1 (Rayleigh 1877, 81)", {"x": "-x-(x'-y')/2", "y": "-y+x'-y'"}),
    ("a damped gyroscope (Merkin 1997, ch. 6)", {"x": "-x-x'+2*y'", "y": "-y-y'-2*x'"}),
    (
        "Kepler with Stokes's law of drag (Goldstein 1980, 1.5)",
        {"x": "-x/(x^2+y^2)^(3/2)-c*x'", "y": "-y/(x^2+y^2)^(3/2)-c*y'"},
    ),
    ("pendulum with drag (Strogatz 1994, 6.7)", {"x": "-sin(x)-c*x'"}),
    ("an oscillator that feeds itself (van der Pol 1926)", {"x": "(1-x^2)*x'-x"}),
    ("circulatory forces with drag: T is indefinite", {"x": "-y-x'", "y": "x-y'"}),
    ("geodesics of the half plane, damped", {"x": "2*x'*y'/y-c*x'", "y": "(y'^2-x'^2)/y-c*y'"}),
]
WITHOUT = [
    ("friction of the third degree (Rayleigh 1883)", {"x": "-x-x'^3", "y": "-y"}),
    ("the potential part has no Lagrangian (Douglas 1941)", {"x": "x^2+y^2", "y": "-y'"}),
    ("a connection without a metric, damped (Thompson 2003)", {"x": "x'*y'-x'", "y": "-y'"}),
    (
        "drag that is not linear in the speed (Minguzzi 2015)",
        {"x": "-x-sqrt(1+x'^2+y'^2)*x'", "y": "-y-sqrt(1+x'^2+y'^2)*y'"},
    ),
    ("drag by the square of the speed (Minguzzi 2015)", DRAG),
    ("of degree 1 in the velocities, and not linear", {"x": "-x'^3/(x'^2+y'^2)", "y": "-y-y'"}),
]


def solved(equations: Any, *kinds: str) -> dict[str, Any]:
    document = {"equations": equations, "parameters": ["c", "k"], "kinds": list(kinds)}
    if not isinstance(equations, str):
        document["parameters"] = [name for name in "bck" if any(name in text for text in equations.values())]
    return solve_document(document, SolveOptions(time_limit=60))


def residuals(equations: dict[str, str], lagrangian: str, dissipation: str) -> list[float]:
    """d(dL/dv)/dt - dL/dq - dD/dv at a point, by SymPy alone."""
    values = {"b": sympy.Rational(3, 7), "c": sympy.Rational(2, 5), "k": sympy.Rational(4, 3)}
    q = {name: sympy.Symbol(name) for name in equations}
    v = {name: sympy.Symbol(name + "_v") for name in equations}
    table = values | q | {name + "_v": each for name, each in v.items()}

    def read(text: str) -> sympy.Expr:
        return sympy.sympify(text.replace("'", "_v").replace("^", "**"), locals=table)

    L, D, f = read(lagrangian), read(dissipation), {name: read(text) for name, text in equations.items()}
    found = []
    for name in equations:
        rate = sum(L.diff(v[name], q[j]) * v[j] + L.diff(v[name], v[j]) * f[j] for j in equations)
        point = {each: sympy.Rational(3 + 2 * k, 5) for k, each in enumerate([*q.values(), *v.values()])}
        found.append(abs(float((rate - L.diff(q[name]) - D.diff(v[name])).subs(point))))
    return found


@pytest.mark.parametrize(
    ("name", "equations"),
    [pytest.param(*case, marks=pytest.mark.slow if len(case[1]) > 2 else ()) for case in WITH_FRICTION],
)
def test_damped_systems_have_a_natural_lagrangian_and_a_dissipation(name: str, equations: Any) -> None:
    result = solved(equations, "rayleigh")
    found = result["kinds"]["rayleigh"]
    assert (found["verdict"], found["checked"]) == ("variational", "valid"), name
    assert max(residuals(equations, found["lagrangian"]["text"], found["dissipation"]["text"])) < 1e-12
    assert check_document(json.dumps(result))["verdict"] == "valid"


@pytest.mark.parametrize(("name", "equations"), WITHOUT)
def test_others_are_proven_to_have_none(name: str, equations: Any) -> None:
    result = solved(equations, "rayleigh")
    found = result["kinds"]["rayleigh"]
    assert (found["verdict"], found["checked"], found["lagrangian"]) == ("not_variational", "valid", None), name
    assert check_document(json.dumps(result))["verdict"] in ("valid", "incomplete")


@pytest.mark.parametrize(
    ("equations", "verdict"),
    [
        ({"x": "-x*t-t*x'-z'", "y": "-y-y'", "z": "-z+x'"}, "variational"),
        ({"x": "-x-t*x'^3", "y": "-y"}, "not_variational"),
        ({"x": "y*z'^2+t*x'*z'", "y": "x*x'^2+z", "z": "x'*y'"}, "not_variational"),
    ],
)
def test_friction_is_decided_where_f_contains_t(equations: dict[str, str], verdict: str) -> None:
    found = solved(equations, "rayleigh")["kinds"]["rayleigh"]
    assert (found["verdict"], found["checked"]) == (verdict, "valid")


def test_a_damped_double_pendulum_leaves_with_T_minus_V_and_D() -> None:
    result = solved(PENDULUM)
    instead = result["instead"]
    assert (result["verdict"], instead["kind"], instead["checked"]) == ("not_variational", "rayleigh", "valid")
    assert instead["hamiltonian"] is not None
    drag = instead["dissipation"]["text"]
    letters = sympy.symbols("c k a_v b_v")
    c, k, a, b = letters
    expected = -c * a**2 / 2 - k * (a - b) ** 2 / 2
    read = sympy.sympify(drag.replace("'", "_v").replace("^", "**"), locals={str(s): s for s in letters})
    assert sympy.expand(read - expected) == 0
    assert check_document(json.dumps(result))["verdict"] == "valid"


def test_a_wrong_dissipation_is_refused() -> None:
    result = solved({"x": "-x-c*x'", "y": "-y"}, "rayleigh")
    part = result["kinds"]["rayleigh"]
    wrong = {**part, "dissipation": {**part["dissipation"], "text": "-c*x'^2/3"}}
    assert check_document(json.dumps({**result, "kinds": {"rayleigh": wrong}}))["verdict"] == "invalid"
    wrong["certificate"] = {**part["certificate"], "dissipation": "-c*x'^2/3"}
    assert check_document(json.dumps({**result, "kinds": {"rayleigh": wrong}}))["verdict"] == "invalid"
    as_natural = {**part, "certificate": {**part["certificate"], "among": "natural"}}
    assert check_document(json.dumps({**result, "kinds": {"natural": as_natural}}))["verdict"] == "invalid"


def test_uniform_damping_has_a_lagrangian_with_time_instead() -> None:
    result = solved({"x": "-x-2*x*y-x'", "y": "-y-x^2+y^2-y'"})
    assert (result["verdict"], result["instead"]["kind"]) == ("not_variational", "time")
    assert result["instead"]["lagrangian"] == result["with_time"]["lagrangian"]


def test_a_system_with_a_lagrangian_needs_nothing_instead() -> None:
    assert solved({"x": "-x"})["instead"] is None
