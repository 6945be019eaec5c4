"""Every common way to write a system is read as what its writer means; the canonical texts stand beside."""

from __future__ import annotations

import itertools
import json
import re
from pathlib import Path
from typing import Any

import pytest

from inverse_service.errors import DocumentRefused, InputError
from inverse_service.expressions.collecting import collect
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents.checking import check_document, check_plain
from inverse_service.service.documents.documents import parse_document, solve_document
from inverse_service.service.documents.text_page import forward_text


def read(equations: Any, **keys: Any) -> dict[str, str]:
    found = parse_document({"equations": equations, "parameters": "guess", **keys})
    return {name: formula["text"] for name, formula in found["equations"].items()}


OSCILLATOR = [
    "Eq(Derivative(x(t), (t, 2)), -x(t))",
    "Eq(Derivative(x(t), t, t), -x(t))",
    "[Eq(Derivative(x(t), (t, 2)), -x(t))]",
    "x(t).diff(t, 2) + x(t)",
    "x.diff(t).diff(t) = -x",
    "Eq(x(t).diff(t, t), -x(t))",
    "sp.Eq(sp.Derivative(x(t), t, 2), -x(t))",
    "Equality(Derivative(Function('x')(Symbol('t')), Tuple(Symbol('t'), Integer(2))), "
    "Mul(Integer(-1), Function('x')(Symbol('t'))))",
    "x''[t] == -x[t]",
    "x''[t] + x[t] == 0",
    "{x''[t] == -x[t]}",
    "D[x[t],{t,2}] == -x[t]",
    "D[x[t], t, t] == -x[t]",
    "Derivative[2][x][t] == -x[t]",
    "Equal[D[x[t],{t,2}],Times[-1,x[t]]]",
    "diff(x(t),t$2) = -x(t)",
    "diff(x(t), t $ 2) + x(t) = 0",
    "diff(x(t),t,t) = -x(t);",
    "diff(diff(x(t),t),t) = -x(t)",
    "(D@@2)(x)(t) = -x(t)",
    "'diff(x,t,2) = -x",
    "'diff(x(t),t,2) + x(t) = 0$",
    "der(der(x)) = -x",
    "der(x') = -x",
    "x'' = -x",
    "x'' == -x",
    "x''(t) = -x(t)",
    "x''(t) + x(t) = 0",
    "x\u2033 = \u2212x",
    "x\u0308 = -x",
    "\u1e8d = -x",
    "x_ddot = -x",
    "xddot = -x",
    r"\ddot x = -x",
    r"\ddot{x}(t) = -x(t)",
    r"x^{\prime\prime} = -x",
    r"\frac{d^2x}{dt^2} = -x",
    r"\frac{\mathrm{d}^2 x}{\mathrm{d}t^2} + x = 0",
    r"\frac{d^{2}}{d t^{2}} x{\left(t \right)} = - x{\left(t \right)}",
    "d^2x/dt^2 = -x",
    "d\u00b2x/dt\u00b2 = -x",
    "d2x/dt2 = -x",
    "d^2x/dt^2 + x = 0",
    "d^2/dt^2 (x) = -x",
    "d/dt(dx/dt) = -x",
    "d/dt(x') = -x",
    "x'' =\n -x",
    "x''\n + x\n = 0",
    "x'' = -x   # the oscillator",
    "x' = v; v' = -x",
    "v' = -x\nx' = v",
    "2 x'' = -2x",
    "diff(x, t, 2) = -x",
]


@pytest.mark.parametrize("equations", OSCILLATOR)
def test_the_oscillator_is_read_in_every_notation(equations: str) -> None:
    assert read(equations) == {"x": "-x"}


OTHERS = [
    ("x''[t] == -Sin[x[t]]", {"x": "-sin(x)"}),
    ("x''[t] == -k E^(2 x[t]) Sqrt[2] + ArcTan[x[t]]", {"x": "-k*exp(2*x)*sqrt(2) + atan(x)"}),
    ("Derivative[1][A][x]; x''[t] == A'[x[t]]", None),
    ("{x''[t] == -y'[t], y''[t] == x'[t]}", {"x": "-y'", "y": "x'"}),
    ("\\[Theta]''[t] == -Sin[\\[Theta][t]]", {"theta": "-sin(theta)"}),
    ("diff(x(t),t$2) = -diff(x(t),t)*exp(x(t)) - Pi", {"x": "-x'*exp(x) - pi"}),
    ("'diff(x,t,2) = -%pi*x + %e^x$", {"x": "-pi*x + exp(x)"}),
    ("der(der(phi)) = -g/l*sin(phi)", {"phi": "-g*sin(phi)/l"}),
    ("d^2x/dt^2 = -dx/dt", {"x": "-x'"}),
    ("d^2x/dt^2 = -c (dx/dt)^2", {"x": "-c*x'^2"}),
    ("x'' = -dV/dx", None),
    ("Eq(x.diff(t, 2), -sp.sin(x)*x.diff(t)**2)", {"x": "-sin(x)*x'^2"}),
    ("(m*x.diff(t)).diff(t) = -k*x", {"x": "-k*x/m"}),
    ("Pow(Symbol('x'), Rational(3, 2)) + Derivative(Symbol('x'), Tuple(Symbol('t'), Integer(2)))", {"x": "-x^(3/2)"}),
    ("x'' = -\u00bd x", {"x": "-x/2"}),
    ("m x'' = -k x\n  - c x'\n  + F", {"x": "-(k*x + c*x' - F)/m"}),
    ("x'' = -x # first\ny'' = -y # second", {"x": "-x", "y": "-y"}),
    ("x' = p_x/m; p_x' = -k*x", {"x": "-k*x/m"}),
    ("x' = v; y' = u; v' = u; u' = -v", {"x": "y'", "y": "-x'"}),
    ("x' = 2*v + x; v' = -x", {"x": "x' - 2*x"}),
]


@pytest.mark.parametrize(("equations", "found"), OTHERS)
def test_other_systems_are_read_or_refused(equations: str, found: dict[str, str] | None) -> None:
    if found is None:
        with pytest.raises(InputError):
            read(equations)
    else:
        assert read(equations) == found


def test_derivatives_of_declared_functions_may_be_quotients() -> None:
    found = read("x'' = -dV/dx; y'' = -\u2202B/\u2202y", functions={"V": ["x"], "B": ["x", "y"]})
    assert found == {"x": "-V'(x)", "y": "-diff(B(x, y), y)"}


@pytest.mark.parametrize(
    ("equations", "fragment"),
    [
        ("x' = v^2; v' = -x", "affine"),
        ("x' = y; y' = x + z'; z' = 1", "first-order"),
        ("x' = v; v' = -x; w' = 1", "first-order"),
        ("x''' = -x", "third"),
        ("x'' = dx/dt^2", "dx"),
        ("x'' = a/dx/dt", "dx"),
        ("x'' = Float('0.333', precision=53)", "exact"),
        ("x.subs(x, 1) = x''", "dot"),
    ],
)
def test_what_is_no_second_order_system_is_refused_with_the_reason(equations: str, fragment: str) -> None:
    with pytest.raises(InputError) as caught:
        read(equations)
    assert fragment in caught.value.detail


def test_a_name_may_stand_for_a_formula() -> None:
    found = read("x'' = -mu*x/r^3; y'' = -mu*y/r^3", where={"r": "sqrt(s2)", "s2": "x^2 + y^2"})
    assert found == {"x": "-mu*x/sqrt(x^2 + y^2)^3", "y": "-mu*y/sqrt(x^2 + y^2)^3"}
    with pytest.raises(InputError, match="leads back"):
        read("x'' = -a", where={"a": "b", "b": "a + x"})


TIMES = [
    ({"equations": "x'' = -x + cos(tau)", "time": "tau"}, "tau", {"x": "-x + cos(tau)"}),
    ({"equations": "y''(x) = -2/x*y'(x) - y(x)^5"}, "x", {"y": "-2*y'/x - y^5"}),
    ({"equations": "diff(y(x), x, 2) = -x*y(x)"}, "x", {"y": "-x*y"}),
    ({"equations": "d^2r/dtau^2 = -1/r^2 + sin(tau)"}, "tau", {"r": "-1/r^2 + sin(tau)"}),
    ({"equations": r"\frac{d^2 y}{dx^2} = -x y"}, "x", {"y": "-x*y"}),
    ({"equations": "y''[x] == -x y[x]"}, "x", {"y": "-x*y"}),
    ({"equations": "Eq(Derivative(y(s), (s, 2)), -s*y(s))"}, "s", {"y": "-s*y"}),
    ({"equations": "t'' = -x'^2; x'' = -x*t'", "time": "s"}, "s", {"t": "-x'^2", "x": "-x*t'"}),
    ({"equations": r"\ddot t = -\dot x \dot t; \ddot x = -s", "time": "s"}, "s", {"t": "-x'*t'", "x": "-s"}),
    ({"equations": "x''(t) = -x(t) + t"}, "t", {"x": "-x + t"}),
    ({"equations": "x'' = -V''(x)*x'", "functions": ["V(x)"]}, "t", {"x": "-V''(x)*x'"}),
]


@pytest.mark.parametrize(("document", "time", "equations"), TIMES)
def test_the_time_has_the_name_that_the_writer_gives_it(
    document: dict[str, Any], time: str, equations: dict[str, str]
) -> None:
    found = solve_document(document, SolveOptions(time_limit=20))
    assert (found["system"]["time"], found["system"]["equations"]) == (time, equations)
    assert found["system"]["given"] == document
    assert check_plain(found)["verdict"] == "valid"


def test_a_lagrangian_shows_the_name_of_the_time() -> None:
    found = solve_document({"equations": "y'' = -2/x*y' - y", "time": "x"}, SolveOptions(time_limit=20))
    assert "x^2" in found["lagrangian"]["text"]
    assert "t" not in found["lagrangian"]["text"]
    assert "x^{2}" in found["lagrangian"]["latex"]


def test_a_name_cannot_be_the_time_and_something_else() -> None:
    for keys in ({"parameters": ["tau"]}, {"coordinates": ["x", "tau"]}):
        with pytest.raises(InputError, match="is the time"):
            parse_document({"equations": "x'' = -tau", "time": "tau", **keys})


def test_what_is_not_for_the_solver_is_handed_back_or_left_aside() -> None:
    document = {"equations": "x'' = -x", "id": "a7", "$schema": "https://example.org", "_comment": "spring"}
    assert solve_document(document, SolveOptions(time_limit=20))["id"] == "a7"


def test_names_in_one_text_are_names() -> None:
    found = parse_document(
        {"equations": "x'' = -k*x + V(x); y'' = m", "parameters": "k, m", "coordinates": "x y", "functions": {"V": "x"}}
    )
    assert (found["coordinates"], found["parameters"], found["functions"]) == (["x", "y"], ["k", "m"], {"V": ["x"]})


def test_a_result_is_not_a_document() -> None:
    result = solve_document({"equations": "x'' = -x"}, SolveOptions(time_limit=20))
    with pytest.raises(InputError, match=r"system\.given"):
        parse_document(result)


def test_a_lagrangian_alone_gives_its_equations_momenta_energy_and_what_is_conserved() -> None:
    document = {"lagrangian": "m/2*(r'^2 + r^2*phi'^2) + mu/r", "parameters": ["m", "mu"]}
    found = solve_document(document, SolveOptions(time_limit=20))
    assert found["format"] == "inverse-service/forward/1"
    assert {name: part["text"] for name, part in found["equations"].items()} == {
        "r": "-mu/(m*r^2) + r*phi'^2",
        "phi": "-2*phi'*r'/r",
    }
    assert found["momenta"]["phi"]["text"] == "m*r^2*phi'"
    names = Names(("r", "phi"), ("m", "mu", "p_r", "p_phi"))
    expected = "p_phi^2/(2*m*r^2) + p_r^2/(2*m) - mu/r"
    assert collect(read_formula(found["hamiltonian"]["text"], names)) == collect(read_formula(expected, names))
    assert [part["name"] for part in found["conserved"]] == ["momentum of phi", "energy"]
    assert parse_document(document)["lagrangian"]["text"].startswith("m*(r'^2")


def test_a_degenerate_lagrangian_has_no_equations_of_motion() -> None:
    with pytest.raises(InputError, match="singular"):
        solve_document({"lagrangian": "x*y' - y*x'"}, SolveOptions(time_limit=20))
    driven = solve_document({"lagrangian": "x'^2/2 - x*cos(t)"}, SolveOptions(time_limit=20))
    assert driven["conserved"] == []


@pytest.mark.parametrize(
    ("lagrangian", "hamiltonian", "domain"),
    [
        ("1/x'", "-2*sqrt(-p_x)", ["x' > 0", "p_x < 0"]),  # it is 2*sqrt(-p_x) where x' < 0
        ("x'^3/3", "2*p_x^(3/2)/3", ["x' > 0", "p_x > 0"]),
        ("abs(x')^3", "2*sqrt(3)*p_x^(3/2)/9", ["x' > 0", "p_x > 0"]),
        ("-sqrt(1 - x'^2)", "sqrt(p_x^2 + 1)", []),
    ],
)
def test_a_hamiltonian_says_on_which_branch_it_holds(lagrangian: str, hamiltonian: str, domain: list[str]) -> None:
    found = solve_document({"lagrangian": lagrangian}, SolveOptions(time_limit=20))
    assert (found["hamiltonian"]["text"], found["hamiltonian"]["domain"]) == (hamiltonian, domain)
    lines = forward_text(found).splitlines()
    place = lines.index(f"  H = {hamiltonian}") + 1
    assert lines[place : place + len(domain)] == [f"      where {condition}" for condition in domain]


SPELLINGS = [
    json.loads(line) for line in (Path(__file__).parents[1] / "systems" / "spellings.ndjson").read_text().splitlines()
]


@pytest.mark.parametrize("row", SPELLINGS, ids=lambda row: row["given"])
def test_what_people_paste_is_read_as_they_mean_it_or_asked_back(row: dict[str, Any]) -> None:
    document = {"equations": row["given"], "parameters": "guess"}
    if "refused" in row:
        with pytest.raises(InputError, match=re.escape(row["refused"])):
            parse_document(document)
    else:
        found = parse_document(document)
        assert {name: formula["text"] for name, formula in found["equations"].items()} == row["read"]
        assert (found["guessed"] or []) == row["guessed"]


def test_two_thousand_spellings_are_tried_and_most_of_them_are_read() -> None:
    assert len(SPELLINGS) > 2_000
    assert sum("read" in row for row in SPELLINGS) > 1_000


def test_an_answer_without_a_verdict_is_not_called_invalid() -> None:
    document = {"lagrangian": "x'^2/2 - x^2/2"}
    found = solve_document(document, SolveOptions(time_limit=20))
    for checked in (
        check_plain(found),
        check_document(json.dumps(found)),
        check_document(json.dumps({"document": document, "result": found})),
    ):
        assert checked["verdict"] == "incomplete"
        assert "claims no verdict" in checked["reasons"][0]
    assert check_plain({**found, "verdict": "variational"})["verdict"] == "invalid"


def test_two_hundred_masses_get_their_equations_from_their_lagrangian() -> None:
    names = [f"x{k}" for k in range(1, 201)]
    kinetic = "+".join(f"m*{x}'^2/2" for x in names)
    springs = "+".join(f"k*({b}-{a})^2/2" for a, b in itertools.pairwise(names))
    document = {"coordinates": names, "parameters": ["m", "k"], "lagrangian": f"{kinetic}-({springs})"}
    result = solve_document(document, SolveOptions())
    assert result["equations"]["x1"]["text"] == "-k*x1/m + k*x2/m"
    assert result["equations"]["x100"]["text"] == "-2*k*x100/m + k*x101/m + k*x99/m"
    assert not result["hamiltonian"]["implicit"]
    with pytest.raises(DocumentRefused, match="at most 256"):
        solve_document({**document, "coordinates": [f"y{k}" for k in range(257)]}, SolveOptions())
