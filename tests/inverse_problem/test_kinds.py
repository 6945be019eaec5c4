"""Systems of the literature and kinds of Lagrangians: each yes by SymPy or the checker, each no by the checker."""

from __future__ import annotations

import json
from typing import Any

import pytest
import sympy

from inverse_service.errors import InputError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.checking import check_document
from inverse_service.service.documents.documents import solve_document

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

SCHWARZSCHILD = {"s": "-2*r'*s'/(r*(r-2))", "r": "-(r-2)/r^3*s'^2+r'^2/(r*(r-2))+(r-2)*b'^2", "b": "-2*r'*b'/r"}
PARABOLOID = {"u": "-(4*u*u'^2-u*b'^2)/(1+4*u^2)", "b": "-2*u'*b'/u"}
HELICOID = {"u": "u*b'^2", "b": "-2*u*u'*b'/(1+u^2)"}
SWINGING_SPRING = {"r": "r*b'^2+cos(b)-(r-1)", "b": "-2*r'*b'/r-sin(b)/r"}
TODA = {"x": "-exp(x-y)", "y": "exp(x-y)-exp(y-z)", "z": "exp(y-z)"}
HILL = {"x": "2*y'+3*x-x/(x^2+y^2)^(3/2)", "y": "-2*x'-y/(x^2+y^2)^(3/2)"}
FIELD, AFFINE = {"x": "y'", "y": "-x'"}, {"x": "x'*y'", "y": "0"}

KNOWN: list[tuple[str, dict[str, str], Any, str]] = [
    ("free particle (Landau, Lifshitz 1976, 4)", {"x": "0", "y": "0"}, "riemannian", YES),
    ("straight lines are geodesics of every norm (Hamel 1903)", {"x": "0", "y": "0"}, "finsler", YES),
    ("geodesics of the sphere (do Carmo 1992, ch. 3)", SPHERE, "riemannian", YES),
    ("geodesics of the half plane (do Carmo 1992, ch. 3)", HALF_PLANE, "riemannian", YES),
    ("a translation is an isometry (do Carmo 1992, ch. 3)", HALF_PLANE, {"invariant": ["x"]}, YES),
    ("a dilation is one (do Carmo 1992, ch. 3)", HALF_PLANE, {"invariant": [{"x": "x", "y": "y"}]}, YES),
    ("L would make it a symmetry of the motion (Olver 1986, ch. 4)", HALF_PLANE, {"invariant": ["y"]}, NO),
    ("affine group of the line, its Ricci tensor is not symmetric (Thompson 2003)", AFFINE, "riemannian", NO),
    ("the holonomy distribution kills dF/dx' (Muzsnay 2006)", AFFINE, "finsler", NO),
    ("space oscillator (Landau, Lifshitz 1976, 23)", OSCILLATOR, "natural", YES),
    ("geodesic sprays are homogeneous (Shen 2001)", OSCILLATOR, "riemannian", NO),
    ("geodesic sprays are homogeneous (Shen 2001)", OSCILLATOR, "finsler", NO),
    ("space oscillator, angular momentum (Landau, Lifshitz 1976, 9)", OSCILLATOR, ROTATION, YES),
    ("L would make it a symmetry of the motion (Olver 1986, ch. 4)", OSCILLATOR, {"invariant": ["x"]}, NO),
    ("damped oscillator: no standard Lagrangian (Bateman 1931)", {"x": "-x - x'"}, "natural", NO),
    ("charge in a magnetic field (Goldstein 1980, 1.5)", FIELD, "natural", YES),
    ("geodesic sprays are homogeneous (Shen 2001)", FIELD, "riemannian", NO),
    ("Kepler (Landau, Lifshitz 1976, 15)", KEPLER, "natural", YES),
    ("Kepler, angular momentum (Landau, Lifshitz 1976, 14)", KEPLER, ROTATION, YES),
    ("spherical pendulum (Landau, Lifshitz 1976, 14)", PENDULUM, "natural", YES),
    ("geodesic sprays are homogeneous (Shen 2001)", PENDULUM, "finsler", NO),
    ("on a line every metric will do: L = exp(2x) x'^2 (Darboux 1894, 604)", {"x": "-x'^2"}, "riemannian", YES),
    ("(dx^2 - dy^2)/y^2 (O'Neill 1983)", {"x": "2*x'*y'/y", "y": "(x'^2+y'^2)/y"}, "riemannian", YES),
    ("geodesics of the torus (do Carmo 1976, 4-4)", TORUS, "riemannian", YES),
    ("geodesics of a paraboloid (do Carmo 1976, 4-4)", PARABOLOID, "riemannian", YES),
    ("geodesics of the helicoid (do Carmo 1976, 4-4)", HELICOID, "riemannian", YES),
    ("polar coordinates (Goldstein 1980, 1.6)", {"r": "r*b'^2", "b": "-2*r'*b'/r"}, "riemannian", YES),
    ("no torsion, no curvature (Kobayashi, Nomizu 1963)", {"x": "0", "y": "x'^2"}, "riemannian", YES),
    ("left invariant metric of the Heisenberg group (Milnor 1976)", HEISENBERG, "riemannian", YES),
    ("orbits round a black hole (Schwarzschild 1916)", SCHWARZSCHILD, "riemannian", YES),
    ("canonical connection of SO(3) (Thompson 2003)", ROTATIONS, "riemannian", YES),
    ("canonical connection of E(2): variational, no metric (Thompson 2003)", EUCLIDEAN, "riemannian", NO),
    ("canonical connection of E(2) (Thompson 2003)", EUCLIDEAN, "natural", NO),
    ("a constant spray (Antonelli, Ingarden, Matsumoto 1993)", {"x": "x'^2", "y": "0"}, "finsler", YES),
    ("a spray is homogeneous of degree 2 (Shen 2001)", {"x": "x'*y", "y": "0"}, "finsler", NO),
    ("case IIIb: no Lagrangian at all (Douglas 1941)", {"x": "x^2+y^2", "y": "0"}, "natural", NO),
    ("swinging spring (Vitt, Gorelik 1933)", SWINGING_SPRING, "natural", YES),
    ("two coupled oscillators (Landau, Lifshitz 1976, 23)", {"x": "-x+y/3", "y": "-y+x/3"}, "natural", YES),
    ("Foucault's pendulum (Landau, Lifshitz 1976, 39)", {"x": "-x+2*y'", "y": "-y-2*x'"}, "natural", YES),
    ("bead on a spinning hoop (Taylor 2005, ch. 7)", {"b": "sin(b)*cos(b)-sin(b)"}, "natural", YES),
    ("motion of a star in a galaxy (Henon, Heiles 1964)", {"x": "-x-2*x*y", "y": "-y-x^2+y^2"}, "natural", YES),
    ("lattice of three particles (Toda 1967)", TODA, "natural", YES),
    ("lattice of three particles (Toda 1967)", TODA, {"invariant": [dict.fromkeys("xyz", "1")]}, YES),
    ("the moon (Hill 1878)", HILL, "natural", YES),
    ("inverse cubes of the distance (Calogero 1971)", {"x": "2/(x-y)^3", "y": "-2/(x-y)^3"}, "natural", YES),
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


def test_fields_may_hold_parameters_that_have_values() -> None:
    document = {"equations": OSCILLATOR, "parameters": {"k": 2}, "kinds": [{"invariant": [{"x": "-k*y", "y": "k*x"}]}]}
    found = solve_document(document, SolveOptions(time_limit=60))["kinds"]["invariant"]
    assert (found["verdict"], found["certificate"]["among"]) == (YES, {"invariant": [{"x": "-2*y", "y": "2*x"}]})


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
