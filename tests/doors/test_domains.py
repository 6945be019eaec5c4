"""The domains of a verdict and of its Lagrangian's formula: in the result, the statement, text, and
page.
"""

import copy
import json
import random
from typing import Any

import pytest

import inverse_service
from inverse_service.service.documents import checking, sheets
from inverse_service.service.documents.printed_pages import text_page
from tests.doors.formulas import Point
from tests.values import slow

OSCILLATOR = {
    "equations": {"x": "-x - c*x'"},
    "parameters": ["c"],
    "time_dependent_lagrangian": False,
}


def solved(document: Any) -> inverse_service.Result:
    """Without first integrals, which have their own tests: to look for them takes longer than the rest."""
    return inverse_service.solve(document, first_integrals=False)


def test_dependent_roots_are_answered_on_both_sides() -> None:
    """x y is the square of y times x/y, so both roots are real where x and y have one sign."""
    found = solved({"equations": {"x": "sqrt(x*y)*y'", "y": "sqrt(x/y)"}})
    sides = [branch["domain"] for branch in found["branches"]]
    assert sides == [["x > 0", "y > 0"], ["x < 0", "y < 0"]]
    assert not found["not_answered"]


@pytest.fixture(scope="module")
def damped() -> dict[str, Any]:
    return json.loads(inverse_service.solve(OSCILLATOR).to_json())


def without_answers(result: dict[str, Any]) -> dict[str, Any]:
    """A copy of a result as older programs wrote it, whose fields are compared with its
    certificates alone.
    """
    return {key: value for key, value in copy.deepcopy(result).items() if key != "answers"}


def test_the_damped_oscillator_has_a_lagrangian_for_all_c(damped: dict[str, Any]) -> None:
    assert damped["domain"] == []
    assert {"x != 0", "c^2 < 4"} <= {*damped["lagrangian"]["domain"]}
    said = inverse_service.check(damped)
    assert (said["verdict"], said["statement"]["domain"]) == ("valid", [])
    assert {*said["statement"]["lagrangian_domain"]} == {"x != 0", "c^2 < 4"}
    assert "not both 0" in said["statement"]["text"]  # at rest at 0 it has none


def test_text_and_page_say_which_of_both_the_conditions_belong_to(damped: dict[str, Any]) -> None:
    lines = text_page(damped, explain=False).splitlines()
    assert "  This formula holds where x != 0, c^2 < 4." in lines
    assert not [line for line in lines if line.startswith("  Where")]


@pytest.mark.parametrize("missing", ["x != 0", "c^2 < 4"])
def test_a_formula_needs_its_own_domain(damped: dict[str, Any], missing: str) -> None:
    forged = without_answers(damped)
    forged["lagrangian"]["domain"].remove(missing)
    assert inverse_service.check(forged)["verdict"] == "incomplete"


@pytest.mark.parametrize(
    ("force", "domain"),
    [
        ("sqrt(x)*x'", ["x > 0"]),
        ("x'*log(x)/k", ["k != 0", "x > 0"]),
        slow("-x'^3/(x - 1)", ["x - 1 != 0"]),
        slow("-x - (x^2 - 1)*x'", []),
        ("-x'/t - x^5", ["t != 0"]),
    ],
)
def test_a_verdict_on_one_coordinate_holds_where_f_is_analytic(
    force: str, domain: list[str]
) -> None:
    result = solved({"equations": {"x": force}, "parameters": ["k"] if "k" in force else []})
    assert result["domain"] == domain
    forged = without_answers(json.loads(result.to_json())) | {"domain": []}
    assert inverse_service.check(forged)["verdict"] == ("incomplete" if domain else "valid")


@pytest.mark.parametrize(
    ("lines", "domain"),
    [
        ({"equations": "x x'' = 0"}, ["x != 0"]),
        ({"equations": ["x'' H(x) = 0"], "functions": {"H": ["x"]}}, ["H(x) != 0"]),
        ({"equations": "(x - y) x'' = 0; y'' = -y"}, ["x - y != 0"]),
        (
            {"equations": "x'' + cos(x - y) y'' = 0; cos(x - y) x'' + y'' = 0"},
            [f"cos(x - y) {s} 1 != 0" for s in "+-"],
        ),
        ({"equations": "x''/x = -1"}, ["x != 0"]),
        ({"equations": "sqrt(x) x'' = 0"}, ["x > 0"]),
        slow({"equations": "(x + abs(x)) x'' = 0"}, ["x > 0"]),
        ({"equations": "(1 + x^2) x'' = 0"}, []),
        ({"equations": ["m x'' = -m x"], "parameters": ["m"]}, []),
        slow({"equations": "x''/(cos(y)^2 + sin(y)^2) = -x; y'' = -y/(cos(x)^2 + sin(x)^2)"}, []),
    ],
)
def test_lines_are_the_system_only_where_what_they_are_divided_by_is_not_0(
    lines: Any, domain: list[str]
) -> None:
    """M(t, q, q') q'' = -b means q'' = f where det M != 0; where det M = 0 it does not determine
    the motion.
    """
    result = json.loads(solved(lines).to_json())
    assert (result["verdict"], result["domain"], result["not_answered"]) == (
        "variational",
        domain,
        [],
    )
    said = inverse_service.check(result)
    assert (said["verdict"], said["statement"]["domain"]) == ("valid", domain)
    if domain:
        (headline,) = (
            line
            for line in text_page(result, explain=False).splitlines()
            if line.startswith("  Where")
        )
        assert all(one in headline for one in domain)
    own = {"system": lines, "lagrangian": result["lagrangian"]["text"]}
    assert {*inverse_service.check(own)["cells"][0]["domain"]} >= {*domain}
    for forged in (without_answers(result) | {"domain": []}, everywhere(without_answers(result))):
        assert inverse_service.check(forged)["verdict"] == ("incomplete" if domain else "valid")
    found = checking.check_plain(everywhere(result)["certificate"], lines)["statement"]["domain"]
    assert {*found} >= {*domain} or found == ["sin(x - y) != 0"]


@pytest.mark.parametrize("never", ["1 < 0", "0 != 0", "sin(x)^2 + cos(x)^2 != 1"])
def test_a_condition_that_holds_nowhere_is_not_proven(damped: dict[str, Any], never: str) -> None:
    assert "/domain" in inverse_service.check(damped | {"domain": [never]})["not_checked"]


@pytest.mark.parametrize(
    ("first", "second", "domain"),
    [
        ("z' - x'", "x*w'", ["x != 0"]),
        slow("z' - y*x'", "(x^2 - 1)*w'", ["x - 1 != 0", "x + 1 != 0"]),
    ],
)
def test_where_constraints_are_dependent_the_motion_is_open(
    first: str, second: str, domain: list[str]
) -> None:
    document = {
        "lagrangian": "(x'^2 + y'^2 + z'^2 + w'^2)/2",
        "constraints": [first, f"{first} + {second}"],
    }
    result = json.loads(solved(document).to_json())
    assert {*result["domain"]} >= {*domain}
    assert {*result["any_associated"]["lagrangian"]["domain"]} >= {*domain}
    assert inverse_service.check(result)["verdict"] == "valid"
    assert inverse_service.check(everywhere(result))["verdict"] == "incomplete"


def everywhere(value: Any) -> Any:
    """The same without any condition, also in the certificate."""
    if isinstance(value, dict):
        kept = {
            key: [] if key == "domain" else everywhere(part)
            for key, part in value.items()
            if key != "conditions"
        }
        return kept if "given" not in value else {**kept, "given": value["given"]}
    return [everywhere(part) for part in value] if isinstance(value, list) else value


@pytest.mark.slow
def test_sides_on_which_f_is_another_formula_are_cells_of_their_own() -> None:
    result = inverse_service.solve({"equations": {"x": "abs(x) - x'"}})
    assert [branch["domain"] for branch in result["branches"]] == [["x > 0"], ["x < 0"]]
    assert inverse_service.check(result)["verdict"] == "valid"


@pytest.mark.slow
def test_several_coordinates_have_the_domain_of_the_proof() -> None:
    result = solved({"equations": {"x": "-x - c*x'", "y": "-y"}, "parameters": ["c"]})
    said = inverse_service.check(result)
    assert result["domain"] == said["statement"]["domain"]
    assert "lagrangian_domain" not in said["statement"]


LINES = [{"equations": {"x": f"-x - {name}*x'"}, "time": name} for name in ("t", "tau")]
FREE = {
    "lagrangian": "(x'^2 + y'^2)/2",
    "constraints": ["y' = x*x'"],
    "associated": "any",
}  # no formula contains t


@pytest.mark.parametrize("document", [*LINES, FREE])
def test_the_name_of_the_time_is_that_of_the_document(document: dict[str, Any]) -> None:
    result = json.loads(solved(document).to_json())
    found = inverse_service.check(result)
    assert (found["verdict"], "/system/time" in found["not_checked"]) == ("valid", False)
    result["system"]["time"] = "s"
    assert inverse_service.check(result)["verdict"] == "invalid"


def test_a_part_beyond_a_pole_of_an_arctangent_has_no_answer_of_its_own() -> None:
    result = solved({"equations": {"x": f"{HALF}*y' - y^2", "y": "-x*x'/2 - 2*x*y"}})
    (left,) = result["not_answered"]
    assert result["domain"] == left["domain"] == ["cos(x) > -1"]
    assert abs(float(left["near"]["x"])) > 3.2
    assert "radian" not in left["near"]


LINE = ["(x - y)*x'' = 1", "(x - y)*y'' = -1"]
ODD = "with real odd roots of negative values the same equations hold there"
SAME = "the same equations hold there"


@pytest.mark.parametrize(
    ("lines", "branches", "beyond"),
    [
        ({"x": "cbrt(x)*y'", "y": "-cbrt(x)*x'"}, 0, [(["x < 0"], ODD)]),
        (LINE, 0, [(["x > y"], SAME)]),
        ("x'' = -x'; y'' = -y'", 0, [(["x' < 0"], SAME), (["x' > 0", "y' < 0"], SAME)]),
        ("x'' = cbrt(x)^2*x' + log(t)", 0, [(["t > 0", "x < 0"], ODD)]),
        ({"x": "sqrt(x*y)*y'", "y": "-sqrt(x*y)*x'"}, 0, [(["y < 0", "x < 0"], SAME)]),
        ("x'' = -abs(x)*cbrt(x)", 0, [(["x < 0"], ODD)]),
        ("x'' = sqrt(1 + cbrt(x))", 0, [(["(-x)^(1/3) < 1", "x < 0"], ODD)]),
        ("x'' = sqrt(x)*x'", 0, []),
        ("x'' = log(x)", 0, []),
        ("x'' = sqrt(x)^2*cbrt(x)", 0, []),  # f is real where x > 0 only
        ("log(x)*x'' = log(x)*cbrt(x)", 0, []),  # and so are these lines
        ("sqrt(x)*x'' = 0", 0, []),
        ("x'' = -x*abs(x)", 2, []),
        ("x'' = gammafunction(x)", 0, [(["x < 0"], SAME)]),
        slow("x'' = polygamma(2, 1 - x)*x'", 0, [(["x > 1"], SAME)]),
        slow("x'' = gammafunction(x)*log(x)", 0, []),
    ],
)
def test_a_set_beyond_the_domain_where_the_equations_are_real_is_listed(
    lines: Any, branches: int, beyond: list[tuple[list[str], str]]
) -> None:
    result = json.loads(solved({"equations": lines}).to_json())
    left = result["not_answered"]
    assert (result["verdict"], len(result["branches"])) == ("variational", branches)
    assert [(one["domain"], one["reason"]) for one in left] == [
        (where, why) for where, why in beyond
    ]
    names = ("x", "y", "x'", "y'", "t")
    for one in left:
        point = Point({name: float(one["near"].get(name, 0)) for name in names})
        assert all(map(point.holds, one["domain"]))
        assert not all(map(point.holds, result["domain"]))
    assert inverse_service.check(result)["verdict"] == "valid"
    sheet = sheets.sheet_of(result)
    assert sheet.verdict == sheets.YES
    page = text_page(result, explain=False)
    for where, why in beyond:
        place = ", ".join(where)
        other = f"Where {place}, it is open whether an L without the time exists, although {why}."
        assert f"Not answered where {place}, although {why}." in page or other in page
    assert beyond or "Not answered" not in page


@pytest.mark.parametrize(
    "lines",
    [
        {"x": "atan(tan(x))*y'", "y": "-x*x'"},
        slow({"x": "atan(tan(x*y))*y' - y^2", "y": "-x*y*x' - 2*x*y"}),
        slow({"x": "atan(tan(x))*y' - y^2", "y": "-x*x' - 2*x*y"}),
    ],
)
def test_cells_and_what_is_left_open_cover_the_plane(lines: dict[str, str]) -> None:
    """There are infinitely many cells; the result lists sets that contain the cells without an
    answer.
    """
    result = solved({"equations": lines})
    domains = [one["domain"] for one in (*result["branches"], *result["not_answered"])]
    draw = random.Random(1)
    for _ in range(200):
        point = Point({name: draw.uniform(-9, 9) for name in ("x", "y", "x'", "y'")})
        assert any(all(map(point.holds, domain)) for domain in domains)


HALF = "atan(sin(x)/(1 + cos(x)))"  # x/2 between -pi and pi
ZERO = {
    "asinh(sinh(x)) - x": "valid",
    "asin(cos(x)) - pi/2 + x": "differs",
    f"{HALF} - x/2": "differs",
}


@pytest.mark.parametrize("term", ZERO)
def test_a_term_of_inverse_functions_is_zero_on_its_sides(term: str) -> None:
    own = {"system": {"equations": {"x": "-x"}}, "lagrangian": f"x'^2/2 - x^2/2 + x^3*({term})"}
    assert inverse_service.check(own)["verdict"] == ZERO[term]
