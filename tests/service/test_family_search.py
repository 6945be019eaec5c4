"""`"associated": "search"` in documents and on the pages."""

from __future__ import annotations

import functools
from typing import Any

import pytest

from inverse_service.cli.latex_page import latex_page
from inverse_service.cli.text_page import text_page
from inverse_service.errors import InputError
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.nonholonomic import solve_nonholonomic

PARTICLE = {
    "coordinates": ["x", "y", "z"],
    "lagrangian": "1/2*(x'^2 + y'^2 + z'^2)",
    "constraints": ["z' + x*y'"],
    "associated": "search",
    "search": {"families": ["products"]},
    "time_dependent_lagrangian": False,
}
INCLINED = {
    "coordinates": ["phi", "x", "y"],
    "lagrangian": "1/2*(x'^2 + y'^2) + 1/2*phi'^2 + x",
    "constraints": ["x'*sin(phi) - y'*cos(phi)"],
    "associated": "search",
    "search": {"families": ["forces"], "depth": 1, "members": 5},
    "time_dependent_lagrangian": False,
}


@functools.cache
def result() -> Any:
    return solve_nonholonomic(PARTICLE, SolveOptions(time_limit=120))


def test_the_second_and_third_system_are_listed_with_their_hamiltonians() -> None:
    members = {member["kinds"][0]: member for member in result()["search"]["variational"]}
    assert members.keys() == {"second", "third"}
    assert members["third"]["constraints"][0]["text"] == "p_z"
    assert all(member["holds"] and member["checked"] == "valid" for member in members.values())


def test_the_main_fields_answer_one_of_the_systems_found() -> None:
    assert result()["verdict"] == "variational"
    assert result()["checked"] == "valid"
    assert result()["nonholonomic"]["main"] in ("second", "third")


def test_the_counts_are_a_table_on_the_page() -> None:
    page = text_page(result(), explain=False)
    assert "products: 4 of 4 members decided" in page
    assert "the flow of H on the constraints is the nonholonomic motion: confirmed" in page
    assert r"products & 4 & 4 & 2 & 2 & 0 \\" in latex_page(result(), explain=False)


def test_where_none_is_found_the_first_system_is_answered() -> None:
    found = solve_nonholonomic(INCLINED, SolveOptions(time_limit=60))
    assert found["verdict"] == "not_variational"
    assert found["checked"] == "valid"
    assert found["nonholonomic"]["main"] == "first"
    assert found["search"]["variational"] == []
    assert found["search"]["families"][0]["not_variational"] == 5


def test_multiples_and_a_search_do_not_go_together() -> None:
    with pytest.raises(InputError, match="do not go together"):
        solve_nonholonomic(PARTICLE | {"multiples": {"y": "z' + x*y'"}}, SolveOptions())


@pytest.mark.parametrize("search", [{"families": ["none"]}, {"depth": 0}, {"members": 10**9}, [], {"power": 2}])
def test_wrong_options_are_refused_with_their_place(search: Any) -> None:
    with pytest.raises(InputError) as caught:
        solve_nonholonomic(PARTICLE | {"search": search}, SolveOptions())
    assert caught.value.pointer.startswith("/search")


def test_special_cases_of_an_associated_system() -> None:
    document = {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "1/2*(x'^2 + y'^2 + z'^2)",
        "constraints": ["z' + k*x*y'"],
        "parameters": ["k"],
        "associated": "first",
        "special_cases": True,
    }
    part = solve_nonholonomic(document, SolveOptions(time_limit=60))["special_cases"]
    texts = [[condition["text"] for condition in case["conditions"]] for case in part["variational_when"]]
    assert texts == [["k = 0"]]
