"""Motions on constraints whose Lagrangian is another formula on either side of a zero."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import pytest

from inverse_service.cli.solve_command import _is_open
from inverse_service.errors import InputError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.checking import check_plain
from inverse_service.service.documents.documents import solve_document
from inverse_service.service.documents.latex_page import latex_page
from inverse_service.service.documents.text_page import text_page
from inverse_service.sympy.many import row_of
from inverse_service.web.pages import shown_results
from inverse_service.web.pages.rendering import Visitor
from inverse_service.web.pages.result_tasks import Look, solve_result

KINETIC = "(x'^2 + y'^2 + z'^2)/2"
# A force on one side of y = 0, none on the other.
ONE_SIDED = {"lagrangian": f"{KINETIC} - (y + abs(y))/2", "constraints": ["z' = x*y'"], "coordinates": ["x", "y", "z"]}


@cache
def one_sided() -> dict[str, Any]:
    return solve_document(ONE_SIDED, SolveOptions(time_limit=60))


def test_each_side_has_an_answer_of_its_own() -> None:
    found = one_sided()
    sides = {tuple(one["domain"]): one["any_associated"] for one in found["branches"]}
    verdicts = {side: one["verdict"] for side, one in sides.items()}
    assert verdicts == {("y > 0",): "not_variational", ("y < 0",): "variational"}
    assert all(one["checked"] == "valid" for one in sides.values())
    assert {key: found[key] for key in found["branches"][0]} == found["branches"][0]


def test_the_lagrangian_of_a_side_says_where_it_is_one() -> None:
    free = next(one["any_associated"] for one in one_sided()["branches"] if one["domain"] == ["y < 0"])
    assert "y < 0" in free["lagrangian"]["domain"]
    assert free["statement"].endswith("associated system, where y < 0.")


def test_the_checker_confirms_all_sides_and_refuses_them_changed() -> None:
    found = one_sided()
    assert check_plain(found)["verdict"] == "valid"
    first, second = found["branches"]
    changed = found | {
        "branches": [first, second | {"any_associated": first["any_associated"] | {"verdict": "variational"}}]
    }
    assert check_plain(changed)["verdict"] == "invalid"


def test_the_checker_compares_the_motion_of_every_side_with_the_document() -> None:
    free = solve_document(ONE_SIDED | {"lagrangian": KINETIC}, SolveOptions(time_limit=60))["any_associated"]
    found = one_sided()
    first, second = found["branches"]
    sides = (second, second | {"any_associated": free})
    assert [check_plain(found | {"branches": [first, one]})["verdict"] for one in sides] == ["valid", "invalid"]


def test_the_motion_alone_has_an_answer_on_each_side() -> None:
    found = solve_document(ONE_SIDED | {"associated": "any"}, SolveOptions(time_limit=60))
    verdicts = {tuple(one["domain"]): one["any_associated"]["verdict"] for one in found["branches"]}
    assert verdicts == {("y > 0",): "not_variational", ("y < 0",): "variational"}
    assert {one["verdict"] for one in found["branches"]} == {"undetermined"}
    assert check_plain(found)["verdict"] == "valid"


def test_text_and_latex_say_what_holds_on_each_side() -> None:
    for page, mark in ((text_page(one_sided(), False), ""), (latex_page(one_sided(), False), "$")):
        assert f"cannot be given a Hamiltonian, by any associated system, where {mark}y > 0{mark}." in page
        assert re.search(
            rf"can be given a Hamiltonian, by the \w+ associated system, where {re.escape(mark)}y < 0", page
        )


def test_a_side_that_is_open_keeps_the_command_from_saying_done() -> None:
    first, second = one_sided()["branches"]
    left = second | {"any_associated": second["any_associated"] | {"verdict": "undetermined"}}
    assert not _is_open(one_sided())
    assert _is_open(one_sided() | {"branches": [first, left]})


def test_no_door_shows_the_verdict_of_one_side_as_that_of_all() -> None:
    equations = {"x": "-(y + abs(y))*x'^2 - x'*y'", "y": "-x'^2*abs(y) - y*x'^2"}
    found = solve_document({"equations": equations, "coordinates": ["x", "y"]}, SolveOptions(time_limit=60))
    assert {one["verdict"] for one in found["branches"]} == {"variational", "not_variational"}
    assert row_of(found)["verdict"] == "mixed"
    assert "2 cases, which differ" in text_page(found, False)
    assert "2 cases, which differ" in latex_page(found, False)
    assert shown_results.title_of(found).endswith(shown_results.VERDICTS["mixed"])
    glance = shown_results.glance_of(found)
    assert glance is not None
    assert {one.verdict for one in glance["answers"]} == {"variational", "not_variational"}


@pytest.mark.parametrize("part", ["lagrangian", "constraints"])
def test_a_step_is_refused_at_its_place(part: str) -> None:
    stepped = {"lagrangian": f"{KINETIC} - y*Heaviside(x)", "constraints": ["z' = Heaviside(x)*y'"]}
    with pytest.raises(InputError, match="piecewise") as refused:
        solve_document(ONE_SIDED | {part: stepped[part]}, SolveOptions(time_limit=20))
    assert refused.value.pointer.startswith(f"/{part}")


def test_the_page_says_first_that_the_sides_differ() -> None:
    job = {"id": "a" * 64, "result": one_sided(), "kind": "solve", "status": "successful"}
    page = solve_result(Look(Visitor(), "http://localhost", 60.0), job, None).body
    html = bytes(page).decode()
    boxes = re.findall(r'<div class="verdict (\w+)">', html)
    assert boxes[:3] == ["mixed", "not_variational", "variational"]
    sides = [re.search(rf"where <math>.*<mo>{sign}</mo>.*</h2>", html) for sign in ("&gt;", "&lt;")]
    starts = [html.index("not the same everywhere"), *(side.start() for side in sides if side)]
    assert len(starts) == 3
    assert starts == sorted(starts)
