"""Verdicts as identities are exact over the rationals, and Coq compiles their proofs."""

from __future__ import annotations

import functools
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import sympy

import inverse_service
from inverse_service import catalogue
from inverse_service.explanation import identities
from inverse_service.explanation.proofs import proof_document
from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field
from tests.values import slow

COQC = shutil.which("coqc")
needs_coq = pytest.mark.skipif(COQC is None, reason="coqc is not installed")
QUICK = ["vertically-rolling-disk-first", "knife-edge-first", "vertically-rolling-disk-third"]
LETTERED = ["generic-class-three-first", "generic-class-with-potential-first"]
NEGATIVE = [
    "vertically-rolling-disk-first",
    "knife-edge-first",
    "generic-class-one-first",
    "extension",
]


def solved(document: dict[str, Any]) -> dict[str, Any]:
    return inverse_service.solve(document).to_dict()


def compiled(text: str, folder: Path) -> subprocess.CompletedProcess[str]:
    assert COQC is not None
    (folder / "verdict.v").write_text(text, encoding="utf-8")
    return subprocess.run(
        [COQC, "verdict.v"], cwd=folder, capture_output=True, text=True, check=False
    )


def theorems(result: dict[str, Any]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(proof_document(result, "identities", 1))["theorems"]
    return found


@pytest.mark.slow
@needs_coq
@pytest.mark.parametrize("name", QUICK)
def test_coq_accepts_the_proof(name: str, tmp_path: Path) -> None:
    text = proof_document(solved(catalogue.document(name)), "coq", 1)
    assert "Theorem " in text
    assert "Admitted" not in text
    assert "(* The system: phi'' = 0 *)" in text
    ended = compiled(text, tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.slow
@needs_coq
def test_coq_refuses_the_proof_for_another_f(tmp_path: Path) -> None:
    """The file contains the accelerations, and Coq computes their derivatives."""
    text = proof_document(solved({"equations": {"x": "-x - x'^2*y", "y": "-y + x'*y'"}}), "coq", 1)
    assert "  | 1%nat => (num (-1 # 1) * _y + _v_x * _v_y)%poly" in text
    assert compiled(text, tmp_path).returncode == 0
    spoilt = text.replace(
        "num (-1 # 1) * _y + _v_x * _v_y", "num (-1 # 1) * _y + num (2 # 1) * _v_x * _v_y"
    )
    assert compiled(spoilt, tmp_path).returncode != 0


LAGRANGIANS = [
    {"x": "-x/(x^2 + y^2)^(3/2)", "y": "-y/(x^2 + y^2)^(3/2)"},
    {"theta": "-sin(theta) - t"},
    {"x": "-k*x - c*x'"},
]


def of_lagrangian(equations: dict[str, str]) -> str:
    return proof_document(solved({"equations": equations, "parameters": "guess"}), "coq", 1)


@needs_coq
@pytest.mark.parametrize("equations", [*map(slow, LAGRANGIANS[:2]), LAGRANGIANS[2]])
def test_coq_differentiates_the_lagrangian(equations: dict[str, str], tmp_path: Path) -> None:
    text = of_lagrangian(equations)
    assert text.count("Motion.euler_lagrange ") == len(equations)
    assert compiled(text, tmp_path).returncode == 0


@pytest.mark.slow
@needs_coq
@pytest.mark.parametrize("equations", LAGRANGIANS)
def test_coq_refuses_another_lagrangian(equations: dict[str, str], tmp_path: Path) -> None:
    wrong = of_lagrangian(equations).replace(
        "Definition L : poly := (", "Definition L : poly := (_" + next(iter(equations)) + " + "
    )
    assert compiled(wrong, tmp_path).returncode != 0


@pytest.mark.slow
@needs_coq
def test_names_of_coq_may_be_names_of_a_system(tmp_path: Path) -> None:
    document = {
        "equations": {"forall": "-R*eq1", "eq1": "-nz1*forall - u1"},
        "parameters": ["R", "nz1", "u1"],
    }
    text = proof_document(solved(document), "coq", 1)
    assert "(* R_ is R *)" in text
    assert compiled(text, tmp_path).returncode == 0


@pytest.mark.nightly
@needs_coq
@pytest.mark.parametrize("name", catalogue.names())
def test_coq_accepts_the_proofs_of_the_catalogue(name: str, tmp_path: Path) -> None:
    text = proof_document(solved(catalogue.document(name)), "coq", 1)
    ended = compiled(text, tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "Theorem " in text or text.startswith("(* No proof by identities is written: ")


@pytest.mark.slow
@pytest.mark.parametrize("name", LETTERED)
def test_long_factors_are_symbols_with_their_meaning(name: str) -> None:
    (theorem,) = theorems(solved(catalogue.document(name)))
    assert any(text.count(" + ") + text.count(" - ") >= 4 for text in theorem["meanings"].values())


@pytest.mark.slow
@pytest.mark.parametrize("name", [*NEGATIVE, *LETTERED])
def test_the_identities_hold_over_the_rationals(name: str) -> None:
    """SymPy expands each step; together they give the determinant, and they divide only by named
    factors.
    """
    (theorem,) = theorems(solved(catalogue.document(name)))
    known = {
        key: sympy.sympify(text)
        for key, text in (theorem["relations"] | theorem["equations"]).items()
    }
    named = {sympy.expand(sympy.sympify(text)) for text in theorem["nonzero"]}
    for step in theorem["steps"]:
        gives, factor = sympy.sympify(step["gives"]), sympy.sympify(step["factor"])
        combined = sum(sympy.sympify(text) * known[key] for key, text in step["cofactors"].items())
        assert sympy.expand(factor * gives - combined) == 0
        parts = {sympy.expand(part) for part, _ in sympy.factor_list(factor)[1]}
        assert all(part in named or sympy.expand(-part) in named for part in parts)
        known[step["name"]] = gives
    size = len(catalogue.document(name)["coordinates"])
    entry = lambda i, j: sympy.Symbol(f"g_{min(i, j) + 1}{max(i, j) + 1}")  # noqa: E731
    assert (
        sympy.expand(known["det_g"] - sympy.Matrix(size, size, entry).det(method="berkowitz")) == 0
    )


def test_the_rows_are_those_of_the_conditions() -> None:
    """The knife edge: (Phi)_23 is g_2j Phi^j_3 - g_3j Phi^j_2 with the Phi of the result, up to a
    factor.
    """
    result = solved(catalogue.document("knife-edge-first"))
    (theorem,) = theorems(result)
    u = {letter: sympy.Symbol(letter) for letter in theorem["meanings"]}
    meanings = {"tan(phi)": "u3", "phi'": "v_phi", "x'": "v_x"}
    assert {text: letter for letter, text in theorem["meanings"].items()} == meanings
    g = sympy.Matrix(3, 3, lambda i, j: sympy.Symbol(f"g_{min(i, j) + 1}{max(i, j) + 1}"))
    phi = sympy.Matrix(
        3,
        3,
        lambda i, j: sympy.sympify(
            result["conditions"]["Phi"][i][j].replace("phi'", "v_phi").replace("x'", "v_x")
        ),
    ).subs(sympy.tan(sympy.Symbol("phi")), u["u3"])
    row = (g * phi)[1, 2] - (g * phi)[2, 1]
    assert sympy.simplify(row / sympy.sympify(theorem["equations"]["eq1"])).is_number


def test_a_lagrangian_is_a_theorem_for_each_coordinate() -> None:
    result = solved({"equations": {"x": "-x/(x^2 + y^2)^(3/2)", "y": "-y/(x^2 + y^2)^(3/2)"}})
    assert [theorem["theorem"] for theorem in theorems(result)] == [
        "euler_lagrange_x",
        "euler_lagrange_y",
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("equations", "reason"),
    [
        ({"x": "x'^2*y'", "y": "y'^2*x' + x"}, ""),
        ({"x": "-sqrt(2 + sin(atan(x)/3))"}, "the answer has no certificate"),
        ({"x": "-exp(-x^2)"}, "the Lagrangian holds integrals"),
    ],
)
def test_where_no_proof_is_written_a_sentence_says_why(
    equations: dict[str, str], reason: str
) -> None:
    result = solved({"equations": equations})
    text = proof_document(result, "coq", 1)
    assert ("Theorem " in text) != text.startswith("(* No proof by identities is written: ")
    assert reason in text


@pytest.mark.slow
def test_a_theorem_of_one_branch_says_which() -> None:
    result = solved({"equations": {"x": "sqrt((x - 1)^2)*y' - y^2", "y": "-(x - 1)*x' - 2*x*y"}})
    assert result["domain"]
    assert f"The formulas are those on {', '.join(result['domain'])}." in proof_document(
        result, "coq", 1
    )


def test_factored_rows_keep_their_ratios_and_share_no_factor() -> None:
    """(x + y) x u + (x + y)^2 P w/(y + 2) is x (y + 2) u + (x + y) P w."""
    letters = [*map(ex.Symbol, "xyuw")]
    x, y, u, w = letters
    shared, long = x + y, x**2 + x * y + y**2 + 3 * y + 1
    coefficients = [shared * x, shared**2 * long / (y + 2)]
    ring = exact_field.exact_ring([*coefficients, u, w], letters, 1, exact_field.Budget.long())
    symbols: Any = {"u": u, "w": w}
    row: Any = dict(zip(symbols, map(ring.value, coefficients), strict=True))
    one, other = (
        functools.reduce(lambda whole, part: whole * part[0] ** part[1], parts, number)
        for number, parts in identities._factored(ring, symbols, row).values()
    )
    assert one.gcd(other).is_constant()
    wanted = [ring.value(tree).numerator for tree in (x * (y + 2), shared * long)]
    assert one * wanted[1] == other * wanted[0]
