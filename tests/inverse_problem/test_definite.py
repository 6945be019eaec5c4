"""Lagrangians with a definite Hessian at a point: each yes and no by the checker, and by hand where that is short."""

from __future__ import annotations

import copy
import json
from fractions import Fraction
from typing import Any

import pytest
import sympy

from inverse_service.certificate.checker import check_certificate
from inverse_service.errors import InputError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.checking import check_document
from inverse_service.service.documents.documents import solve_document
from tests.inverse_problem.test_kinds import residuals

YES, NO, OPEN = "variational", "not_variational", "undetermined"
ROTATING = {"x": "-y", "y": "x"}  # K with eigenvalues i, -i
SPIRAL = {"x": "-a*x - b*y", "y": "b*x - a*y"}
# source, equations, parameters, near, verdict
# q'' = -K q has a definite constant g just where K is a product of a definite and a symmetric matrix: where it is
# diagonalizable with real eigenvalues (Taussky 1972); and g(p) K is symmetric for any L.
KNOWN: list[tuple[str, dict[str, str], list[str], dict[str, Any], str]] = [
    ("space oscillator (Landau, Lifshitz 1976, 23)", {"x": "-x", "y": "-y"}, [], {}, YES),
    ("coupled so that T = x'y' is the first thing found (Taussky 1972)", {"x": "-y", "y": "-x"}, [], {}, YES),
    ("real distinct eigenvalues, K not symmetric (Taussky 1972)", {"x": "-x + y", "y": "-2*y"}, [], {}, YES),
    ("a Jordan block, as at the boundary of flutter (Taussky 1972)", {"x": "-x + y", "y": "-y"}, [], {}, NO),
    ("circulatory forces: eigenvalues i, -i (Merkin 1997, ch. 6)", ROTATING, [], {}, NO),
    ("circulatory forces beside springs (Merkin 1997, ch. 6)", SPIRAL, ["a", "b"], {"a": 2, "b": 1}, NO),
    ("charge in a magnetic field (Goldstein 1980, 1.5)", {"x": "y'", "y": "-x'"}, [], {}, YES),
    ("Kepler (Landau, Lifshitz 1976, 15)", {"x": "-x/(x^2+y^2)^(3/2)", "y": "-y/(x^2+y^2)^(3/2)"}, [], {}, YES),
    ("one coordinate always has one (Darboux 1894, 604)", {"x": "(1-x^2)*x' - x"}, [], {"x": 1, "x'": 2}, YES),
    ("q'' = -i q in two planes (Taussky 1972)", {"x": "-y", "y": "x", "z": "-w", "w": "z"}, [], {}, NO),
    ("a rotation and an oscillator (Taussky 1972)", {"x": "-y", "y": "x", "z": "-z"}, [], {}, NO),
    (
        "q'' = q^2 in C: the eigenvalues of dq''/dq are not real (Taussky 1972)",
        {"x": "x^2-y^2", "y": "2*x*y"},
        [],
        {},
        NO,
    ),
    ("three different springs (Landau, Lifshitz 1976, 23)", {"x": "-x", "y": "-2*y", "z": "-3*z"}, [], {}, YES),
    ("gyroscopic stabilization (Thomson, Tait 1879, 345)", {"x": "2*y' + x", "y": "-2*x' + y"}, [], {}, YES),
    ("two bars, follower load 2 < 7/2 - sqrt(2) (Ziegler 1952)", {"x": "-x/2", "y": "3*x/2 - y"}, [], {}, YES),
    ("the same, load 5/2: flutter (Ziegler 1952)", {"x": "-x/4 - y/4", "y": "5*x/4 - 3*y/4"}, [], {}, NO),
    ("the oscillator of fourth order, as two (Bolonek, Kosinski 2005)", {"x": "-x", "y": "-4*y"}, [], {}, YES),
    ("a Jordan block and a spring (Taussky 1972)", {"x": "-x + y", "y": "-y", "z": "-2*z"}, [], {}, NO),
    ("no Lagrangian at all (Douglas 1941)", {"x": "x^2+y^2", "y": "0"}, [], {}, NO),
]


def is_definite(equations: dict[str, str], lagrangian: str, near: dict[str, str]) -> bool:
    """The Hessian in the velocities at the point, or minus it, by SymPy alone."""
    letters = {name: sympy.Symbol(name) for q in equations for name in (q, q + "_v")}
    formula = sympy.sympify(lagrangian.replace("'", "_v").replace("^", "**"), locals=letters)
    point = {letters[name.replace("'", "_v")]: sympy.Rational(text) for name, text in near.items() if name != "t"}
    matrix = sympy.hessian(formula, [letters[q + "_v"] for q in equations]).subs(point)
    return bool(matrix.is_positive_definite or (-matrix).is_positive_definite)


def solved(equations: dict[str, str], parameters: list[str], near: dict[str, Any]) -> dict[str, Any]:
    document = {"equations": equations, "parameters": parameters, "near": near, "kinds": ["positive_definite"]}
    return solve_document(document, SolveOptions(time_limit=60))


@pytest.mark.parametrize(("source", "equations", "parameters", "near", "verdict"), KNOWN)
def test_known_answers(
    source: str, equations: dict[str, str], parameters: list[str], near: dict[str, Any], verdict: str
) -> None:
    result = solved(equations, parameters, near)
    found = result["kinds"]["positive_definite"]
    assert (found["verdict"], found["checked"]) == (verdict, "valid"), source
    assert check_document(json.dumps(result))["verdict"] == "valid"
    if found["lagrangian"] is not None:
        assert max(residuals(equations, found["lagrangian"]["text"])) < 1e-20
        assert is_definite(equations, found["lagrangian"]["text"], found["near"])
    named = {name: Fraction(text) for name, text in found["near"].items()}
    assert all(named[name] == value for name, value in near.items())


def test_what_is_forged_is_refused() -> None:
    certificate = solved(ROTATING, [], {})["kinds"]["positive_definite"]["certificate"]
    assert check_certificate(certificate).verdict == "valid"
    forgeries: list[dict[str, Any]] = [
        {"orthogonal": [["1", "0"], ["0", "-1"]]},
        {"orthogonal": [["0", "0"], ["0", "0"]]},
        {"orthogonal": [["1", "0"], ["0", "2"]]},
        {"orthogonal": [["1", "1"], ["0", "1"]]},
        {"orthogonal": [["1", "0"]]},
        {"rows": []},
        {"near": {}},
    ]
    for forged in forgeries:
        assert check_certificate(certificate | forged).verdict == "invalid", forged


def test_a_definite_matrix_has_to_be_one_that_is_left() -> None:
    certificate = solved({"x": "(1-x^2)*x' - x", "y": "-2*y"}, [], {})["kinds"]["positive_definite"]["certificate"]
    assert (certificate["kind"], check_certificate(certificate).verdict) == ("existence", "valid")
    forged = copy.deepcopy(certificate)
    forged["multiplier"] = [["1", "1/3"], ["1/3", "1"]]
    assert check_certificate(forged).verdict == "invalid"
    assert check_certificate(certificate | {"multiplier": [["1", "0"], ["0", "-1"]]}).verdict == "invalid"


def test_an_indefinite_lagrangian_is_no_definite_one() -> None:
    certificate = solved({"x": "-x", "y": "-y"}, [], {})["kinds"]["positive_definite"]["certificate"]
    assert certificate["kind"] == "lagrangian"
    assert check_certificate(certificate | {"lagrangian": "x'^2/2 - y'^2/2 - x^2/2 + y^2/2"}).verdict == "invalid"


@pytest.mark.parametrize("near", [{"w": 1}, {"x": "sqrt(2)"}, {"x": "1/0"}])
def test_a_point_that_is_none_is_refused(near: dict[str, Any]) -> None:
    with pytest.raises(InputError) as refused:
        solved({"x": "-x"}, [], near)
    assert refused.value.pointer == "/near"


def test_a_point_without_the_kind_is_refused() -> None:
    with pytest.raises(InputError, match="positive_definite"):
        solve_document({"equations": {"x": "-x"}, "near": {"x": 1}}, SolveOptions(time_limit=5))


def test_flutter_whose_proof_is_irrational_says_so() -> None:
    """K^3 = 2: the only Y >= 0 is that of the complex eigenvectors, with entries in Q(2^(1/3))."""
    found = solved({"x": "y", "y": "z", "z": "2*x"}, [], {})["kinds"]["positive_definite"]
    assert (found["verdict"], found["certificate"]) == (OPEN, None)
    assert "algebraic numbers" in found["reason"]


@pytest.mark.parametrize(("force", "x"), [("-sqrt(x)", -1), ("-1/x", 0), ("-abs(x)", -1)])
def test_a_point_outside_of_the_answer_says_so(force: str, x: int) -> None:
    """Where f has no value, or on x < 0 when the answer is about x > 0."""
    found = solved({"x": force}, [], {"x": x})["kinds"]["positive_definite"]
    assert (found["verdict"], found["certificate"]) == (OPEN, None)
    assert "this point" in found["reason"]


def test_a_sum_of_lagrangians_is_written_in_lowest_terms() -> None:
    found = solved({"x": "-k*y", "y": "-x"}, ["k"], {})["kinds"]["positive_definite"]
    assert found["lagrangian"]["text"].count("x'^2") == 1
