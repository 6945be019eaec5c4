"""What is said of roots, |u| and inverse functions holds on all of the set named, and each side has its answer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from inverse_service.cli import solve_command
from inverse_service.cli.exits import ExitCode
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.checking import check_plain
from inverse_service.service.documents.documents import solve_system
from inverse_service.service.documents.latex_page import latex_page
from inverse_service.service.documents.text_page import text_page
from tests.inverse_problem.all_over import assert_holds_all_over


def solved(equations: dict[str, str], **rest: Any) -> dict[str, Any]:
    return solve_system({"equations": equations, **rest}, SolveOptions(time_limit=900.0))


def cases(result: dict[str, Any]) -> dict[str, str]:
    return {", ".join(each["domain"]): each["verdict"] for each in result["branches"] or [result]}


# x'' = u y' - y^2, y'' = -w x' - 2 x y is variational exactly where u = w.
TWO_SIDED = [
    ("sqrt((x-1)^2)", "x-1", {}, {"x > 1": "variational", "x < 1": "not_variational"}),
    ("abs(1-x)", "x-1", {}, {"x < 1": "not_variational", "x > 1": "variational"}),
    ("sqrt(1-2*x+x^2)", "x-1", {}, {"x > 1": "variational", "x < 1": "not_variational"}),
    ("sqrt(x^2+2*x+1)", "x+1", {}, {"x > -1": "variational", "x < -1": "not_variational"}),
    ("sqrt(x*y)", "y*sqrt(x/y)", {}, {"x > 0, y > 0": "variational", "x < 0, y < 0": "not_variational"}),
    ("sqrt(a^2)", "a", {"parameters": ["a"]}, {"a > 0": "variational", "a < 0": "not_variational"}),
    ("sign(x)*x^2", "x^2", {}, {"x > 0": "variational", "x < 0": "not_variational"}),
]


@pytest.mark.parametrize(("left", "right", "rest", "expected"), TWO_SIDED)
def test_each_side_of_a_zero_has_its_own_verdict(
    left: str, right: str, rest: dict[str, Any], expected: dict[str, str]
) -> None:
    result = solved({"x": f"{left}*y' - y^2", "y": f"-({right})*x' - 2*x*y"}, **rest)
    assert cases(result) == expected
    assert all(each["checked"] == "valid" for each in result["branches"])
    assert assert_holds_all_over(result) >= 8


@pytest.mark.parametrize(("function", "inverse"), [("sin", "asin"), ("tan", "atan")])
def test_an_inverse_function_of_its_function_has_an_answer_on_each_interval(function: str, inverse: str) -> None:
    result = solved({"x": f"-y*{inverse}({function}(x))", "y": "-x^2/2"})
    found = cases(result)
    assert list(found.values()) == ["variational", "not_variational"]
    assert list(found) == ["x > -pi/2, x < pi/2", "x > pi/2, x < 3*pi/2"]
    assert_holds_all_over(result)


ONE_COORDINATE = [
    "-sqrt(x^2)", "-k*sqrt(x'^2)*x'", "-sqrt(sin(x)^2)", "-(x^2)^(3/2)", "-sqrt(x^6)", "-sqrt(x^2+2*x+1)",
    "-x/sqrt(x^2)", "-sqrt(4*x^2)", "-sqrt(x^2)*x'^2", "-sqrt(x^2*(1+x^2))", "-k*abs(x)*sign(x')",
]  # fmt: skip


@pytest.mark.parametrize("force", ONE_COORDINATE)
def test_lagrangians_with_roots_of_squares_hold_on_both_sides(force: str) -> None:
    result = solved({"x": force}, parameters=["k"])
    assert len(result["branches"]) == (4 if "sign" in force else 2)
    assert {each["verdict"] for each in result["branches"]} == {"variational"}
    assert assert_holds_all_over(result) >= 16


@pytest.mark.parametrize("force", ["-(x^6)^(1/3)", "-sqrt(x^3*x)", "-x/(x^2+1)^(3/2)", "-abs(x)^2", "-sqrt(x^2+1)"])
def test_what_has_one_formula_on_both_sides_has_one_answer(force: str) -> None:
    result = solved({"x": force})
    assert result["branches"] == []
    assert result["domain"] == []
    assert_holds_all_over(result)


DOMAINS = [
    ({"x": "atanh(x)*y'-y^2", "y": "-log((1+x)/(1-x))/2*x'-2*x*y"}, (), {"x > -1", "x < 1"}),
    ({"x": "acosh(x)*y'-y^2", "y": "-acosh(x)*x'-2*x*y"}, (), {"x > 1"}),
    ({"x": "cos(asin(x))*y'-y^2", "y": "-sqrt(1-x^2)*x'-2*x*y"}, (), {"x > -1", "x < 1"}),
    ({"x": "x^a*x^b*y", "y": "x^(a+b+1)/(a+b+1)"}, ("a", "b"), {"x > 0"}),
    ({"x": "-log(x-3)"}, (), {"x > 3"}),
    ({"x": "-x*sqrt(x^2-1)"}, (), {"x > 1"}),
    ({"x": "sqrt(1-x^2-y^2)*x", "y": "sqrt(1-x^2-y^2)*y"}, (), {"x^2 + y^2 < 1"}),
    ({"x": "-x/sqrt(x^2+y^2)^3", "y": "-y/sqrt(x^2+y^2)^3"}, (), {"x^2 + y^2 > 0"}),
]  # fmt: skip


@pytest.mark.parametrize(("equations", "parameters", "expected"), DOMAINS)
def test_domains_are_strict_inequalities_that_cut_out_a_connected_set(
    equations: dict[str, str], parameters: tuple[str, ...], expected: set[str]
) -> None:
    result = solved(equations, parameters=list(parameters))
    assert set(result["domain"]) == expected
    assert set(result["domain"]) <= set(result["lagrangian"]["domain"])
    assert assert_holds_all_over(result) >= 8


@pytest.mark.parametrize("force", ["-3*x*x'-x^3", "-x'^3", "1001*(16*x+21*exp(x))/(12000*(4*x'+1))"])
def test_a_hamiltonian_says_on_which_branch_of_the_legendre_map_it_holds(force: str) -> None:
    result = solved({"x": force})
    assert result["hamiltonian"]["domain"]
    assert_holds_all_over(result)


def test_more_than_eight_cases_are_left_undetermined_with_their_number() -> None:
    result = solved({"x": "abs(x)*abs(y)*abs(x')*abs(y')", "y": "0"})
    assert result["verdict"] == "undetermined"
    assert "16 cases" in result["reason"]


def test_sides_without_a_real_point_are_no_cases() -> None:
    assert cases(solved({"x": "-sqrt(x)*sqrt((1+x)^2)"})) == {"x > 0": "variational"}


def test_a_false_certificate_of_any_branch_is_refused() -> None:
    document = {"equations": {"x": "abs(x-1)*y' - y^2", "y": "-(x-1)*x' - 2*x*y"}}
    result = solve_system(document, SolveOptions(time_limit=900.0))
    assert check_plain(result)["verdict"] == "valid"
    right = next(branch for branch in result["branches"] if branch["verdict"] == "variational")
    right["lagrangian"]["text"] = right["certificate"]["lagrangian"] = "x'^2/2 + y'^2/2"
    assert check_plain(result)["verdict"] == "invalid"


def test_the_text_page_begins_with_all_cases_and_says_where_each_holds() -> None:
    page = text_page(solved({"x": "-sqrt(x^2)"}), explain=False)
    assert "2 cases:\n  x > 0: variational\n  x < 0: variational\n" in page
    assert "Variational on x > 0, at generic points: a regular Lagrangian L(q, q') exists." in page
    assert "Variational on x < 0, at generic points" in page


def test_the_latex_page_begins_with_all_cases_too() -> None:
    page = latex_page(solved({"x": "-sqrt(x^2)"}), explain=False)
    cases = page.index("2 cases: \\begin{itemize}\n\\item $x > 0$: variational\n\\item $x < 0$: variational\n")
    assert cases < page.index("At generic points of the connected set where $x > 0$:\nVariational")


@pytest.mark.parametrize(("verdict", "code"), [("variational", ExitCode.DONE), ("undetermined", ExitCode.OPEN)])
def test_solve_is_done_only_if_every_branch_has_a_definite_verdict(
    verdict: str, code: ExitCode, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    result = {"verdict": "variational", "branches": [{"verdict": "variational"}, {"verdict": verdict}]}
    monkeypatch.setattr(solve_command, "_solve", lambda *arguments: result)
    path = tmp_path / "system.json"
    path.write_text('{"equations": {"x": "abs(x)"}}')
    assert solve_command.solve_file(str(path), "json", 1.0, 1, False) == code


@pytest.mark.parametrize(
    "force",
    ["-sqrt(c^2)*x", "-(c^2)^(3/2)*x^3 - sqrt(a^2)*x", "-sqrt(c^2*x^2 + c^2)*x", "-abs(a*c)*x", "-sign(a - 2*c)*c*x"],
)
def test_the_case_with_positive_parameters_is_shown_first(force: str) -> None:
    result = solved({"x": force}, parameters=["a", "c"])
    first = [text.split() for text in result["domain"]]
    assert len(result["branches"]) > 1
    assert not [text for text in first if text[1:] == ["<", "0"]]


@pytest.mark.parametrize("border", [40, 1000, 9999])
def test_cases_with_a_border_far_away_have_an_answer_each(border: int) -> None:
    u = f"(x + {border})"
    result = solved({"x": f"abs({u})*y' - y^2", "y": f"-{u}*x' - 2*x*y"})
    assert cases(result) == {f"x > -{border}": "variational", f"x < -{border}": "not_variational"}
    assert check_plain(result)["verdict"] == "valid"
