"""A page shows one verdict for both questions, the same in title, badge, and table."""

from __future__ import annotations

import copy
import json
import math
from typing import Any

import pytest

from inverse_service import check, solve
from inverse_service.service.documents import growing, printed_pages, sheets
from inverse_service.web.pages import rendering, result_tasks
from tests.values import present, slow

SLEIGH = {
    "lagrangian": "(x'^2+y'^2)/2 + phi'^2 + phi'*(-x'*sin(phi)+y'*cos(phi))",
    "constraints": ["x'*sin(phi)-y'*cos(phi)"],
}
PARTICLE = {"lagrangian": "(x'^2+y'^2+z'^2)/2", "constraints": ["z'+x*y'"]}
FORCED = {"lagrangian": "(x'^2+y'^2+z'^2)/2 - x^2/2", "constraints": ["z' - y*x'"]}
DISK = {
    "lagrangian": "M/2*(x'^2+y'^2)+I/2*theta'^2+J/2*phi'^2",
    "constraints": ["x' - R*cos(phi)*theta'", "y' - R*sin(phi)*theta'"],
    "parameters": "guess",
}


words = printed_pages.plain_text


@pytest.mark.parametrize(
    ("document", "verdict", "badge"),
    [
        ({"equations": "x'' = -x"}, "yes", "has a Lagrangian"),
        slow({"equations": "x'' = -x - x'/10"}, "yes", "has a Lagrangian"),
        ({"equations": "x'' = -x' - x; y'' = -y' - y - x^2 + y^2"}, "no", "no Lagrangian"),
        ({"equations": "x'' = -y; y'' = x*x'"}, "no", "no Lagrangian"),
        # Damped Henon-Heiles: no L without time, one with time.
        slow(
            {"equations": "x'' = -x - 2*x*y - x'/10; y'' = -y - x^2 + y^2 - y'/10"},
            "yes",
            "has a Lagrangian",
        ),
        ({"equations": "x'' = -x*abs(x)"}, "yes", "has a Lagrangian"),
        slow({**SLEIGH, "associated": "any"}, "no", "has no Hamiltonian"),
        slow({**PARTICLE, "associated": "any"}, "yes", "has a Hamiltonian"),
    ],
)
def test_title_badge_and_headline_say_the_same(
    document: dict[str, Any], verdict: str, badge: str
) -> None:
    result = solve(document)
    sheet = sheets.sheet_of(result)
    assert (sheet.verdict, sheet.badge) == (verdict, badge)
    assert sheet.title.endswith(f": {badge}")
    assert [piece.verdict for piece in sheet.sentence if isinstance(piece, sheets.Word)] == [
        verdict
    ]
    shown = words(sheet.sentence) + " ".join(map(words, sheet.notes))
    assert "undetermined" not in shown
    if sheet.table:
        main = next(row for row in sheet.table if row.is_main)
        assert main.verdict == verdict
        assert main.steps
        assert [row.name for row in sheet.table][-3:] == ["Any", "Reduced", "Another clock"]


def test_the_lagrangian_with_the_time_is_shown_where_there_is_no_other() -> None:
    equations = "x'' = -x - 2*x*y - x'/10; y'' = -y - x^2 + y^2 - y'/10"
    result = solve({"equations": equations, "first_integrals": False})
    (case,) = sheets.sheet_of(result).cases
    assert [formula.letter for formula in case.formulas] == ["L", "H"]
    assert "exp" in case.formulas[0].text


@pytest.mark.parametrize(("form", "shown"), [("1", "older version"), ("2", "checker verified")])
def test_an_older_proof_is_not_called_checked(form: str, shown: str) -> None:
    result = copy.deepcopy(dict(solve({"equations": "x'' = -x"})))
    result["certificate"]["format"] = f"inverse-service/certificate/{form}"
    assert any(shown in words(note) for note in sheets.sheet_of(result).notes)
    assert sheets.proof_of({"checked": "valid", "certificate": None}) == "valid"


def test_parts_that_are_missing_are_named() -> None:
    result = dict(solve({"equations": "x'' = -x"})) | {
        "incomplete": [{"part": "first_integrals", "reason": "time"}]
    }
    assert sheets.sheet_of(result).missing == ("first integrals",)


def test_cases_that_differ_or_are_open_are_all_listed() -> None:
    result = dict(solve({"equations": "x'' = -x*abs(x)"}))
    result["not_answered"] = [{"domain": ["x > 5"], "near": {}, "reason": "no time was left"}]
    sheet = sheets.sheet_of(result)
    assert sheet.verdict == sheets.DIFFERS
    assert words(sheet.sentence) == "Yes where x > 0, yes where x < 0, not answered where x > 5."
    assert any("no time was left" in words(note) for note in sheet.notes)


def test_a_glance_ends_with_the_first_l_and_h_and_shows_every_branch() -> None:
    """The damped oscillator also has an L without time, which takes ten times as long; |x| has two
    branches.
    """
    damped = present(
        result_tasks.glance_of({"equations": "m*x'' + d*x' + k*x = 0", "parameters": "guess"})
    )
    (case,) = damped["sheet"].cases
    assert [formula.letter for formula in case.formulas] == ["L", "H"]
    assert "with the time" in words(case.sentence)
    assert (
        len(present(result_tasks.glance_of({"equations": "x'' = -x*abs(x)"}))["sheet"].cases) == 2
    )


def test_a_glance_says_where_its_formulas_hold_and_for_which_constants() -> None:
    found = result_tasks.glance_of({"equations": "x'' = x'^n", "parameters": "guess"})
    html = rendering.render("glance.html", glance=found, question=[])
    notes = html[html.index('class="small notes"') :]
    assert "Where" in notes
    assert "except" in notes


@pytest.mark.parametrize(
    ("equations", "defined"),
    [("x'' = -F(x)", "dx"), ("x'' = -x*F(x^2 + y^2); y'' = -y*F(x^2 + y^2)", "du")],
)
def test_a_glance_defines_the_functions_in_its_lagrangian(equations: str, defined: str) -> None:
    asked = {"equations": equations, "functions": {"F": ["r"]}}
    found = present(result_tasks.glance_of(asked))
    html = rendering.render("glance.html", glance=found, question=[])
    of_lagrangian = html[html.index('aria-label="L = ') : html.index('aria-label="H = ')]
    assert "\u222b" in of_lagrangian
    [(note,)] = [formula.notes for formula in found["sheet"].cases[0].formulas[:1]]
    assert defined in words(note)


@pytest.mark.parametrize("patience", [0.0, math.inf])
def test_a_glance_that_lacks_l_or_h_is_cut_so_that_the_rest_is_asked_for(
    monkeypatch: pytest.MonkeyPatch, patience: float
) -> None:
    """Each part is told at once: L before H."""
    monkeypatch.setattr(growing, "AT_ONCE", -1.0)
    found = present(result_tasks.glance_of({"equations": "x'' = -x - x'/3"}, patience))
    letters = {formula.letter for case in found["sheet"].cases for formula in case.formulas}
    assert found["cut"] is (not {"L", "H"} <= letters)
    assert found["cut"] is (patience == 0.0)
    assert not any("undetermined" in words(note) for note in found["sheet"].notes)


def test_a_verdict_alone_does_not_say_that_no_formula_was_found() -> None:
    """That is known once all were looked for."""
    found = present(result_tasks.glance_of({"equations": "x'' = -x + (1 - x^2)*x'"}, 0.0))
    assert found["cut"]
    assert words(found["sheet"].sentence) == "Yes, there is a Lagrangian."


@pytest.mark.slow
def test_l_and_h_of_another_clock_are_not_shown_as_those_of_the_motion() -> None:
    result = copy.deepcopy(dict(solve(PARTICLE)))
    assert any(
        words(note).startswith("These formulas hold where")
        for note in sheets.sheet_of(result).notes
    )
    for part in (result["any_associated"], *result["nonholonomic"]["associated"]):
        part |= {"lagrangian": None, "hamiltonian": None}
    sheet = sheets.sheet_of(result)
    assert sheet.verdict == "yes"
    assert [row.name for row in sheet.table if row.formulas] == ["Reduced", "Another clock"]
    assert sheet.first is not None
    assert sheet.first.formulas == ()
    assert any("closed form" in words(note) for note in sheet.notes)


@pytest.mark.parametrize(
    ("equations", "headline"),
    [
        ("x'' = -abs(x)", "Yes, this equation comes from a Lagrangian, for every x."),
        slow("x'' = -abs(x)/x", "Yes, this equation comes from a Lagrangian in each of 2 cases."),
        slow(
            "x'' = abs(x)*y'; y'' = -y",
            "These equations do not come from any regular Lagrangian in any of 2 cases.",
        ),
        slow("x'' = (x + abs(x))*y'; y'' = -y", "No where x > 0, yes where x < 0."),
    ],
)
def test_the_headline_of_cases_is_true_of_each_and_each_has_its_condition(
    equations: str, headline: str
) -> None:
    sheet = sheets.sheet_of(solve({"equations": equations}))
    assert words(sheet.sentence) == headline
    assert [words(case.where) for case in sheet.cases] == ["x > 0", "x < 0"]
    for case in sheet.cases:
        assert not case.formulas or {formula.letter for formula in case.formulas} == {"L", "H"}
        assert case.equations
        assert not any("abs" in formula.text for formula in case.equations)
    assert [words(case.where) for _, case in sheet.across] == ["x < 0", "x > 0"]


@pytest.mark.slow
def test_the_proof_of_each_no_in_the_table_ends_in_its_contradiction() -> None:
    """First, second, any, and the reduced system of a sleigh with an offset mass; the checker's
    word comes after it.
    """
    table = {row.name: row for row in sheets.sheet_of(solve(SLEIGH)).table}
    for name in ("First", "Second", "Any", "Reduced"):
        *proof, checked = map(words, table[name].steps)
        assert table[name].verdict == "no"
        assert len(proof) >= 3, name
        assert "contradiction" in proof[-1], name
        assert "checker" in checked
    assert any("Phi" in step for step in map(words, table["Reduced"].steps))


def test_a_yes_without_a_formula_says_what_is_known_of_one() -> None:
    """van der Pol: v int I/v^2 dv for any first integral I, and no polynomial L (the energy would
    be a first integral).
    """
    found = solve({"equations": {"x": "(1-x^2)*x'-x"}, "conditions": False})
    notes = [words(note) for note in sheets.sheet_of(found).cases[0].notes]
    assert any("v int I/v^2 dv" in note for note in notes)
    assert any("degree at most 4" in note and "energy" in note for note in notes)


@pytest.mark.parametrize(
    ("equations", "function"),
    [
        ({"x": "(1-x^2)*x'-x+cos(t)"}, "d/dt M + M df/dv = 0"),
        slow({"x": "(1-x^2)*x'-x", "y": "(1-y^2)*y'-2*y"}, "v dI/dq + f dI/dv = 0"),
        slow({"theta": "(1-theta^2)*theta'-theta"}, "with q = theta, v = theta'"),
        ({"v": "(1-v^2)*v'-v"}, "w dI/dq + f dI/dw = 0, with q = v, w = v'"),
    ],
)
def test_a_yes_without_a_formula_names_the_function_that_is_not_known(
    equations: dict[str, str], function: str
) -> None:
    document = {"equations": equations, "conditions": False, "functions": {}}
    found = solve({**document, "time": "t"})
    notes = [words(note) for note in sheets.sheet_of(found).cases[0].notes]
    assert any(function in note for note in notes)


def test_integrals_with_the_time_are_not_excluded_by_a_count_without_it() -> None:
    """x'' = -2 x' - x has the first integral e^t (x' + x), but none without the time."""
    found = solve({"equations": {"x": "-2*x'-x"}, "conditions": False})
    assert found["first_integrals"]
    rows = [row for row in sheets.sheet_of(found).cases[0].more if row.name == "All integrals"]
    assert rows
    assert all("without the time" in words(row.hint) for row in rows)


def test_all_integrals_are_those_of_general_constants() -> None:
    """Hénon-Heiles: the energy is the only one up to degree 4, but for a = b, where x'y' + ... is another."""
    general = {"equations": {"x": "-x-2*a*x*y", "y": "-y-a*x^2-b*y^2"}, "conditions": False}
    found = solve({**general, "parameters": ["a", "b"]})
    assert found["first_integrals_complete"]["number"] == 3  # 1, H, H^2
    assert found["first_integrals_complete"]["exceptions"] == ["single values of a, b"]
    rows = {row.name: words(row.hint) for row in sheets.sheet_of(found).cases[0].more}
    assert rows["All integrals"].startswith("For general a, b, each first integral")
    assert rows["How many"] == "For general a, b, the multiplier depends on 1 constant."
    special = solve({"equations": {"x": "-x-2*x*y", "y": "-y-x^2-y^2"}, "conditions": False})
    assert any(one["name"] != "energy" for one in special["first_integrals"])
    assert special["first_integrals_complete"]["exceptions"] == []
    forged = json.loads(found.to_json())
    forged["first_integrals_complete"]["exceptions"] = []
    assert any(
        one["field"] == "/first_integrals_complete/exceptions"
        for one in check(forged)["contradictions"]
    )


def test_each_row_of_a_cell_says_its_cell() -> None:
    """x'' = -|x| x' conserves x' + x^2/2 where x > 0, and x' - x^2/2 where x < 0."""
    found = solve({"equations": {"x": "-abs(x)*x'"}, "conditions": False})
    cases = sheets.sheet_of(found).cases
    assert len(cases) == 2
    for case, where in zip(cases, ("x > 0", "x < 0"), strict=True):
        for row in case.more:
            assert where in words(row.domain if row.formulas else row.hint)


YES, NO, OPEN = "variational", "not_variational", "undetermined"


@pytest.mark.parametrize(
    ("plain", "timed", "verdict"),
    [
        (YES, None, sheets.YES),
        (NO, YES, sheets.YES),
        (YES, OPEN, sheets.YES),
        (NO, NO, sheets.NO),
        (NO, None, sheets.NO),
        (NO, OPEN, sheets.OPEN),  # an L(t, q, q') may still be found
        (OPEN, NO, sheets.OPEN),
        (OPEN, None, sheets.OPEN),
    ],
)
def test_a_verdict_is_no_only_where_all_questions_are_answered_so(
    plain: str, timed: str | None, verdict: str
) -> None:
    result = {"verdict": plain, "verdict_with_time": timed}
    assert sheets.verdict_of(result) == verdict
    # Of cells with two answers neither is that of all.
    other = {"verdict": NO if verdict != sheets.NO else YES, "verdict_with_time": None}
    assert sheets.verdict_of({"branches": [result, other]}) == sheets.DIFFERS


def test_while_a_motion_is_decided_what_follows_from_it_is_not_named() -> None:
    """Next are the question about the motion and the reduced system; then what is left."""
    parts = ["certificate", "any_associated", "explanation", "reduced"]
    result = {
        "nonholonomic": {"constraints": []},
        "incomplete": [{"part": part} for part in parts],
        "verdict": "undetermined",
        "verdict_with_time": "undetermined",
    }
    named = sheets._missing(result, True)
    assert len(named) == 2
    assert {*named} < {*sheets._missing(result | {"nonholonomic": None}, True)}


@pytest.mark.slow
def test_what_there_is_instead_says_where_it_is_defined() -> None:
    """For b = 0, L = exp(...) y'^2/(2 x') + ... is none where x' = 0."""
    equations = {"x": "a*x'^2+b*y'^2", "y": "c*x'*y'"}
    document = {"equations": equations, "parameters": ["a", "b", "c"], "first_integrals": False}
    (row,) = (row for row in sheets.sheet_of(solve(document)).more if row.name == "Instead")
    assert "x' != 0" in words(row.domain)


def test_a_lagrangian_of_a_kind_says_where_it_is_defined() -> None:
    damped = {"equations": {"x": "-x'"}, "kinds": ["positive_definite"], "conditions": False}
    found = solve({**damped, "first_integrals": False})
    (row,) = (row for row in sheets.sheet_of(found).more if row.formulas)
    domain = found["kinds"]["positive_definite"]["lagrangian"]["domain"]
    assert domain == ["x' > 0"]
    assert words(row.domain) == "x' > 0"


def test_a_system_that_was_not_asked_for_is_not_called_undetermined() -> None:
    """Any associated system with a Hamiltonian is an answer, and the others are left."""
    result = solve({**PARTICLE, "first_integrals": False}).to_dict()
    other = next(
        one
        for one in result["nonholonomic"]["associated"]
        if one["kind"] != result["nonholonomic"]["main"]
    )
    other["verdict"] = "undetermined"

    def word() -> str:
        table = sheets.sheet_of(result).table
        return next(row.word for row in table if row.name.lower().startswith(other["kind"]))

    result["system"]["given"].pop("associated", None)
    assert word() == "Undetermined"
    result["system"]["given"]["associated"] = "any"
    assert word() == "Not asked"
