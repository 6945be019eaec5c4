"""Piecewise formulas: an answer for each piece, right on the whole of its set, and one sentence for what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import sympy as sp

from inverse_service import sympy as bridge
from inverse_service.algebra.sign_cases import sign_cases
from inverse_service.cli import solve_command
from inverse_service.cli.exits import ExitCode
from inverse_service.errors import InputError
from inverse_service.expressions.pieces import STEP
from inverse_service.expressions.tree import Apply, Symbol, number, subtract
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents import documents
from inverse_service.service.documents.checking import check_plain
from inverse_service.service.documents.documents import solve_system
from inverse_service.service.documents.latex_page import latex_page
from inverse_service.service.documents.text_page import text_page
from inverse_service.web.pages.rendering import environment
from inverse_service.web.pages.shown_results import answer_of
from tests.inverse_problem.all_over import assert_holds_all_over
from tests.inverse_problem.test_branches import cases

# x'' = u y' - y^2, y'' = -x x' - 2 x y is variational exactly where u = x.
DOUGLAS = {"x": "piecewise((x, x > 1), (x^2, x > 0), (2*x, true))*y' - y^2", "y": "-x*x' - 2*x*y"}


def solved(equations: object, **rest: Any) -> dict[str, Any]:
    return solve_system({"equations": equations, **rest}, SolveOptions(time_limit=900.0))


def test_each_piece_has_its_own_verdict_and_domain() -> None:
    result = solved(DOUGLAS)
    assert cases(result) == {"x > 1": "variational", "x < 1, x > 0": "not_variational", "x < 0": "not_variational"}
    assert {each["checked"] for each in result["branches"]} == {"valid"}
    assert check_plain(result)["verdict"] == "valid"
    assert assert_holds_all_over(result) >= 8


FORMULAS = [
    ("piecewise((-x, x < 0), (-4*x, true))", 2),
    ("Piecewise((-x, x < 0), (-x**3, x >= 0))", 2),
    ("-x*Heaviside(x - 1)", 2),
    ("piecewise((-x, -1 < x < 1), (-1, x > 0), (1, otherwise))", 4),
    ("Piecewise((-k*x, (x > 0) & (x' > 0)), (-x, True))", 3),
    ("piecewise((-x, not (x > 0) or x > 2), (0, true))", 3),
    ("-2*x*piecewise((1, x^2 + x'^2 < 1), (2, true))", 2),
    ("piecewise((-x, t > 1), (-2*x, true))", 2),
    ("-piecewise((x, 2*x > 2), (1, true)) - piecewise((x^3, 1 > x), (1, true))", 2),
    ("piecewise((exp(x), a > 0), (-sin(x), true))", 2),
]


@pytest.mark.parametrize(("force", "count"), FORMULAS)
def test_lagrangians_of_pieces_hold_on_the_whole_of_each(force: str, count: int) -> None:
    result = solved({"x": force}, parameters=["k", "a"])
    assert len(result["branches"]) == count
    assert {each["verdict"] for each in result["branches"]} == {"variational"}
    assert check_plain(result)["verdict"] == "valid"
    assert assert_holds_all_over(result) >= 4 * count


@pytest.mark.parametrize(
    ("force", "verdicts", "alone"),
    [
        ("piecewise((log(x), x > 0), (-x, true))", {"x > 0": "variational", "x < 0": "undetermined"}, ["-x"]),
        ("piecewise((sqrt(x - 1), x > 1), (sqrt(1 - x), true))", {"x > 1": "undetermined", "x < 1": "undetermined"},
         ["sqrt(1 - x)", "sqrt(x - 1)"]),
    ],
)  # fmt: skip
def test_a_piece_that_another_is_undefined_on_is_asked_back_alone(
    force: str, verdicts: dict[str, str], alone: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    result = solved({"x": force})
    assert cases(result) == verdicts
    reasons = [each["reason"] for each in result["branches"] if each["verdict"] == "undetermined"]
    assert sorted(reason.rpartition(": ask about this piece alone, x'' = ")[2] for reason in reasons) == alone
    assert not caplog.records  # no Lagrangian was looked for in vain
    for piece in alone:
        assert solved({"x": piece})["verdict"] == "variational"


def test_the_answer_of_one_piece_is_not_accepted_for_another() -> None:
    result = solved(DOUGLAS)
    yes, no = (next(b for b in result["branches"] if b["verdict"] == v) for v in ("variational", "not_variational"))
    moved = {**yes, "domain": no["domain"], "lagrangian": {**yes["lagrangian"], "domain": no["domain"]}}
    moved["certificate"] = {**yes["certificate"], **{k: no["certificate"][k] for k in ("near", "conditions", "roots")}}
    others = [each for each in result["branches"] if each["domain"] not in (yes["domain"], no["domain"])]
    assert check_plain({**result, **yes, "branches": [yes, no, *others]})["verdict"] == "valid"
    forged = [
        {**result, **yes, "branches": [yes, moved, *others]},
        {**result, **yes, "branches": [yes, yes, *others]},
        {**result, **yes, "branches": [yes, {**no, "domain": yes["domain"]}, *others]},
        {**result, "branches": []},
        yes["certificate"] | {"conditions": no["certificate"]["conditions"]},
        yes["certificate"] | {"roots": no["certificate"]["roots"]},
    ]
    assert all(check_plain(each)["verdict"] != "valid" for each in forged)


def test_text_latex_and_command_line_name_the_pieces(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = solved(DOUGLAS)
    text = text_page(result, False)
    assert "3 cases, which differ:" in text
    assert "Variational on x > 1, at generic points" in text
    assert "Not variational on x < 0" in text
    assert r"\item" in latex_page(result, False)
    path = tmp_path / "pieces.json"
    path.write_text(json.dumps({"equations": DOUGLAS}), encoding="utf-8")
    assert solve_command.solve_file(str(path), "text", 900.0, 1, False) == ExitCode.DONE
    assert "x > 1: variational" in capsys.readouterr().out


def test_objects_of_sympy_are_read_as_their_text_is() -> None:
    t = sp.Symbol("t")
    x = sp.Function("x")(t)
    force = sp.Piecewise((-x, (x > 0) & (x < 1)), (-2 * x, ~(x > 0)), (-3 * x, True)) + sp.Heaviside(x - 1)
    result = bridge.solve([sp.Eq(x.diff(t, 2), force)])
    assert len(result["branches"]) == 3
    written = solved({"x": str(force).replace("x(t)", "x")})
    assert [each["domain"] for each in result["branches"]] == [each["domain"] for each in written["branches"]]


NINE = ", ".join(f"({k}, x < {k})" for k in range(1, 9))


def test_more_than_eight_pieces_or_boundaries_get_one_sentence() -> None:
    for formula in (
        f"piecewise({NINE}, (9, true))",
        f"piecewise((1, {' or '.join(f'x > {k}' for k in range(8))}), (2, true))",
    ):
        with pytest.raises(InputError, match=r"write at most|at most 7"):
            solved({"x": formula})


def test_many_cases_of_several_formulas_are_counted() -> None:
    steps = [f"Heaviside(x - {k})" for k in range(9)]
    result = solved({"x": " + ".join(steps)})
    assert result["verdict"] == "undetermined"
    assert "10 cases" in result["reason"]


def test_a_lagrangian_in_pieces_is_refused_with_a_sentence() -> None:
    with pytest.raises(InputError, match="write one piece here"):
        documents.solve_document(
            {"coordinates": ["x"], "lagrangian": "x'^2/2 - piecewise((x, x > 0), (0, true))"}, SolveOptions()
        )


def test_where_a_lagrangian_is_regular_is_told_in_every_form() -> None:
    everywhere, generic = solved({"x": "-x"}), solved({"a": "-a", "b": "a*b'^2"})
    told = "at generic points, where det g is not 0"
    assert (everywhere["lagrangian"]["regular"], generic["lagrangian"]["regular"]) == ("everywhere", told)
    assert f"      regular {told}\n" in text_page(generic, False)
    assert f"Regular {told}." in latex_page(generic, False)
    parts: Any = environment().get_template("result_parts.html").module
    assert f"regular {told}" in parts.lagrangian_card(answer_of(generic, "L(q, q')", generic))
    assert all("generic" not in form(everywhere, False) for form in (text_page, latex_page))


def test_sides_that_no_point_has_are_no_cases() -> None:
    steps = [Apply(STEP, subtract(Symbol("x"), number(k))) for k in range(9)]
    assert len(list(sign_cases(steps))) == 10
