"""Systems of the literature and kinds of Lagrangians: each yes by SymPy or the checker, each no by the checker."""

from __future__ import annotations

import json
from typing import Any

import pytest
import sympy

from inverse_service.errors import InputError
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.documents import check_document, solve_document

YES, NO, OPEN = "variational", "not_variational", "undetermined"
OSCILLATOR = {"x": "-x", "y": "-y"}
SPHERE = {"a": "sin(a)*cos(a)*b'^2", "b": "-2*cot(a)*a'*b'"}
HALF_PLANE = {"x": "2*x'*y'/y", "y": "(y'^2-x'^2)/y"}
KEPLER = {"x": "-x/(x^2+y^2)^(3/2)", "y": "-y/(x^2+y^2)^(3/2)"}
PENDULUM = {"a": "sin(a)*cos(a)*b'^2 - sin(a)", "b": "-2*cot(a)*a'*b'"}
TORUS = {"a": "-(2+cos(a))*sin(a)*b'^2", "b": "2*sin(a)*a'*b'/(2+cos(a))"}
HEISENBERG = {"x": "-y'*(z'-x*y')", "y": "x'*(z'-x*y')", "z": "x*x'*(z'-x*y') + x'*y'"}
ROTATIONS = {"a": "b'*(c'-cos(b)*a')/sin(b)", "b": "-sin(b)*a'*c'", "c": "b'*(a'-cos(b)*c')/sin(b)"}
EUCLIDEAN = {"x": "-y'*z'", "y": "x'*z'", "z": "0"}
ROTATION = {"invariant": [{"x": "-y", "y": "x"}]}

KNOWN: list[tuple[str, dict[str, str], Any, str]] = [
    ("free particle", {"x": "0", "y": "0"}, "riemannian", YES),
    ("free particle", {"x": "0", "y": "0"}, "finsler", YES),
    ("geodesics of the sphere (do Carmo, Riemannian Geometry, ch. 3)", SPHERE, "riemannian", YES),
    ("geodesics of the half plane (do Carmo, ch. 3)", HALF_PLANE, "riemannian", YES),
    ("geodesics of the half plane", HALF_PLANE, {"invariant": ["x"]}, YES),
    ("geodesics of the half plane", HALF_PLANE, {"invariant": [{"x": "x", "y": "y"}]}, YES),
    ("geodesics of the half plane", HALF_PLANE, {"invariant": ["y"]}, NO),
    ("a connection with Ricci tensor not symmetric", {"x": "x'*y'", "y": "0"}, "riemannian", NO),
    ("the same, whose sprays Finsler functions would share", {"x": "x'*y'", "y": "0"}, "finsler", NO),
    ("oscillator", OSCILLATOR, "natural", YES),
    ("oscillator", OSCILLATOR, "riemannian", NO),
    ("oscillator", OSCILLATOR, "finsler", NO),
    ("oscillator", OSCILLATOR, ROTATION, YES),
    ("oscillator", OSCILLATOR, {"invariant": ["x"]}, NO),
    ("damped oscillator: no standard Lagrangian (Bateman 1931)", {"x": "-x - x'"}, "natural", NO),
    ("charge in a magnetic field", {"x": "y'", "y": "-x'"}, "natural", YES),
    ("charge in a magnetic field", {"x": "y'", "y": "-x'"}, "riemannian", NO),
    ("Kepler", KEPLER, "natural", YES),
    ("Kepler", KEPLER, ROTATION, YES),
    ("spherical pendulum", PENDULUM, "natural", YES),
    ("spherical pendulum", PENDULUM, "finsler", NO),
    ("on a line every metric will do: L = exp(2x) x'^2", {"x": "-x'^2"}, "riemannian", YES),
    ("geodesics of (dx^2 - dy^2)/y^2, indefinite", {"x": "2*x'*y'/y", "y": "(x'^2+y'^2)/y"}, "riemannian", YES),
    ("geodesics of the torus (do Carmo, Curves and Surfaces, 4.4)", TORUS, "riemannian", YES),
    ("the flat plane in polar coordinates", {"r": "r*b'^2", "b": "-2*r'*b'/r"}, "riemannian", YES),
    ("a parabola of the flat plane: y - x^2/2 moves freely", {"x": "0", "y": "x'^2"}, "riemannian", YES),
    ("left invariant metric of the Heisenberg group (Milnor 1976)", HEISENBERG, "riemannian", YES),
    ("canonical connection of SO(3) (Thompson 2003)", ROTATIONS, "riemannian", YES),
    (
        "canonical connection of E(2): variational, no metric (Ghanam, Thompson, Miller 2004)",
        EUCLIDEAN,
        "riemannian",
        NO,
    ),
    ("canonical connection of E(2)", EUCLIDEAN, "natural", NO),
    ("a conformally Minkowskian quartic spray", {"x": "x'^2", "y": "0"}, "finsler", YES),
    ("a Finsler spray is homogeneous of degree 2", {"x": "x'*y", "y": "0"}, "finsler", NO),
    ("Douglas 1941, case IIIb: no Lagrangian at all", {"x": "x^2+y^2", "y": "0"}, "natural", NO),
]


def solved(equations: dict[str, str], *kinds: Any) -> dict[str, Any]:
    return solve_document({"equations": equations, "kinds": list(kinds)}, SolveOptions(time_limit=60))


def residuals(equations: dict[str, str], lagrangian: str) -> list[float]:
    """The Euler-Lagrange equations at a point to 30 digits, by SymPy alone."""
    t = sympy.Symbol("t")
    paths = {name: sympy.Function(name)(t) for name in equations}
    letters = {name: sympy.Symbol(name) for name in equations}
    letters |= {name + "_v": sympy.Symbol(name + "_v") for name in equations}
    formula = sympy.sympify(lagrangian.replace("'", "_v").replace("^", "**"), locals=letters)
    forces = {k: sympy.sympify(f.replace("'", "_v").replace("^", "**"), locals=letters) for k, f in equations.items()}
    moving = {letters[name]: path for name, path in paths.items()}
    moving |= {letters[name + "_v"]: path.diff(t) for name, path in paths.items()}
    found = []
    for name in equations:
        rate = formula.diff(letters[name + "_v"]).subs(moving).diff(t)
        rate = rate.subs({path.diff(t, 2): forces[k].subs(moving) for k, path in paths.items()})
        rest = rate - formula.diff(letters[name]).subs(moving)
        point = {path.diff(t): sympy.Rational(7 + 2 * k, 11) for k, path in enumerate(paths.values())}
        rest = rest.subs(point).subs({path: sympy.Rational(5 + 3 * k, 7) for k, path in enumerate(paths.values())})
        found.append(abs(float(sympy.N(rest, 30))))
    return found


@pytest.mark.parametrize(("source", "equations", "kind", "verdict"), KNOWN)
def test_known_answers(source: str, equations: dict[str, str], kind: Any, verdict: str) -> None:
    result = solved(equations, kind)
    ((name, found),) = result["kinds"].items()
    assert (name, found["verdict"]) == (next(iter(kind)) if isinstance(kind, dict) else kind, verdict), source
    assert found["checked"] == "valid"
    assert check_document(json.dumps(result))["verdict"] == "valid"
    if found["lagrangian"] is not None:
        assert max(residuals(equations, found["lagrangian"]["text"])) < 1e-20


def test_an_open_kind_has_no_certificate() -> None:
    """Translations along x and y together: g is invariant, L only up to dF/dt (a central extension)."""
    found = solved({"x": "y'", "y": "-x'"}, {"invariant": ["x", "y"]})["kinds"]["invariant"]
    assert (found["verdict"], found["certificate"], found["checked"]) == (OPEN, None, None)


def test_a_certificate_of_one_kind_proves_no_other() -> None:
    result = solved(OSCILLATOR, "natural", "finsler")
    kinds = result["kinds"]
    for forged in (
        {"natural": kinds["finsler"], "finsler": kinds["finsler"]},
        {"natural": {**kinds["natural"], "verdict": NO, "certificate": kinds["finsler"]["certificate"]}},
        {"riemannian": kinds["finsler"]},
        {"natural": {**kinds["natural"], "certificate": None}},
    ):
        assert check_document(json.dumps({**result, "kinds": forged}))["verdict"] == "invalid"


def test_that_a_kind_has_none_does_not_prove_that_there_is_no_lagrangian() -> None:
    result = solved(OSCILLATOR, "finsler")
    none = {**result, "verdict": NO, "verdict_with_time": NO, "lagrangian": None}
    none["certificate"] = {**result["kinds"]["finsler"]["certificate"], "question": "time_dependent"}
    assert check_document(json.dumps(none))["verdict"] == "invalid"


@pytest.mark.parametrize(
    "kinds",
    [["convex"], "natural", [{"invariant": ["z"]}], [{"invariant": [{"x": "sin(y)"}]}], ["natural", "natural"],
     [{"invariant": [{"x": "x'"}]}], [{"invariant": []}], [{"invariant": ["x"]}, {"invariant": ["y"]}]],
)  # fmt: skip
def test_kinds_that_cannot_be_read_are_refused_with_their_place(kinds: Any) -> None:
    with pytest.raises(InputError) as refused:
        solve_document({"equations": OSCILLATOR, "kinds": kinds}, SolveOptions(time_limit=5))
    assert refused.value.pointer.startswith("/kinds")
    assert "literal" not in refused.value.pointer + refused.value.detail
