"""What a document says is shown in the order, the names, and the numbers of its author."""

from __future__ import annotations

from typing import Any

import pytest

import inverse_service
from inverse_service.service.documents import accepting, echo, printed_pages
from inverse_service.service.documents.documents import parse_document


def _lines(document: dict[str, Any]) -> tuple[list[str], list[str]]:
    prepared = accepting.prepared({"parameters": "guess", **document})
    found = echo.lines_of_stored({"given": prepared.document})
    return [one.text for one in found.lines], [one.text for one in found.definitions]


@pytest.mark.parametrize(
    ("document", "lines", "definitions"),
    [
        ({"equations": "x'' = mu*(1 - x^2)*x' - x"}, ["x'' = mu*(1 - x^2)*x' - x"], []),
        ({"equations": "2 + x'' - 3*x = x^2 - 1"}, ["2 + x'' - 3*x = x^2 - 1"], []),
        ({"equations": "x'' = -0.10*abs(x')*x'"}, ["x'' = -0.1*abs(x')*x'"], []),
        ({"equations": "m*(y'' + 9.81) = -k*y'"}, ["m*(y'' + 9.81) = -k*y'"], []),
        (
            {"equations": "w = 3/2; x'' = -w^2*x"},
            ["x'' = -w^2*x"],
            ["w = 3/2"],
        ),
        (
            {"equations": "a'' = -9.81/l*sin(a)", "where": {"l": "2*b"}},
            ["a'' = -9.81*sin(a)/l"],
            ["l = 2*b"],
        ),
        (
            {"equations": {"x": "-k*x"}, "parameters": {"k": "2.5"}, "coordinates": ["x"]},
            ["x'' = -k*x"],
            ["k = 2.5"],
        ),
        (
            {
                "coordinates": ["x", "y"],
                "lagrangian": "1/2*(x'^2 + y'^2) - 9.81*y",
                "constraints": ["y' = 0.3*x*x'"],
            },
            ["L = (x'^2 + y'^2)/2 - 9.81*y", "y' = 0.3*x*x'"],
            [],
        ),
        (
            {"lagrangian": "-m*c^2*sqrt(1 - x'^2/c^2) + k/r", "where": {"r": "sqrt(x^2 + a^2)"}},
            ["L = -m*c^2*sqrt(1 - x'^2/c^2) + k/r"],
            ["r = sqrt(x^2 + a^2)"],
        ),
        ({"equations": "x' = v; v' = -x"}, [], []),  # pairs are joined
        ({"equations": "x'' = " + " + ".join(["x"] * 2_000)}, [], []),  # too long to show twice
    ],
)
def test_lines_are_those_of_the_author(
    document: dict[str, Any], lines: list[str], definitions: list[str]
) -> None:
    assert _lines(document) == (lines, definitions)


@pytest.mark.parametrize(
    ("document", "accelerations", "lagrangian"),
    [
        ({"equations": "m x'' + min(x, b) = 0"}, {"x": "-min(x, b)/m"}, None),
        ({"equations": "x' = v; v' = -Max(0, x)"}, {"x": "-max(0, x)"}, None),
        ({"equations": "y'' = -max(y, x)", "time": "x"}, {"y": "-max(y, x)"}, None),
        ({"equations": "x'' = -k*x_min"}, {"x": "-k*x_min"}, None),
        (
            {"equations": "L = x'^2/2 - b*max(x, b)", "parameters": {"b": 2}},
            {"x": "-sign(x - 2) - 1"},
            "x'^2/2 - 2*max(x, 2)",
        ),
        (
            {"lagrangian": "(x'^2 + y'^2)/2 - max(y, 1)", "constraints": ["x' = 0"]},
            {"x": "0", "y": "-(abs(y - 1) + y - 1)/(2*abs(y - 1))"},
            "(x'^2 + y'^2)/2 - max(y, 1)",
        ),
    ],
)
def test_what_is_understood_has_max_and_min_where_they_were_typed(
    document: dict[str, Any], accelerations: dict[str, str], lagrangian: str | None
) -> None:
    found = parse_document(document)
    assert {name: one["text"] for name, one in found["equations"].items()} == accelerations
    assert found.get("lagrangian", {}).get("text") == lagrangian


def test_every_door_shows_these_lines() -> None:
    result = inverse_service.solve({"equations": "z'' = 1 - w*z; w = 3/2", "parameters": "guess"})
    (line,) = result["system"]["written"]
    assert line["text"] == "z'' = 1 - w*z"
    assert line["latex"] == "\\ddot{z} = 1 - w z"
    assert result["system"]["equations"] == {"z": "1 - 3*z/2"}
    assert "z'' = 1 - w*z\n  with w = 3/2\n" in printed_pages.text_page(dict(result), False)
    assert line["latex"] in printed_pages.latex_page(dict(result), False)


def test_a_result_of_an_earlier_program_is_shown_as_typed() -> None:
    result = dict(inverse_service.solve({"equations": "x'' = 1 - x"}))
    older = {
        key: value
        for key, value in result["system"].items()
        if key not in ("written", "definitions")
    }
    page = printed_pages.text_page({**result, "system": older}, False)
    assert page == printed_pages.text_page(result, False)


def test_the_time_has_the_name_that_the_author_gave_it() -> None:
    result = inverse_service.solve({"equations": "d^2 x/ds^2 = -s*x", "time": "s"})
    assert [one["text"] for one in result["system"]["written"]] == ["x'' = -s*x"]
