"""Statements about unknown functions say for which functions they were proven.

Each family is answered with no for general functions, and members of it that have a Lagrangian are
known by hand: from separation of variables, from the force k(r) across the velocity with r (k r)' =
k r (1 + k r)(2 + k r), and from constant matrices.
"""

import json
from typing import Any

import pytest

import inverse_service
from inverse_service.service.documents.printed_pages import latex_page, text_page
from tests.values import slow

POLAR = {"r": "r*phi'^2 + k(r)*r^2*phi'^2", "phi": "-(2/r + k(r))*r'*phi'"}
# (equations, functions, constants, equations of members that have a Lagrangian)
FAMILIES: tuple[tuple[dict[str, str], dict[str, list[str]], list[str], list[dict[str, str]]], ...] = (
    ({"x": "F(x, y)", "y": "-y"}, {"F": ["x", "y"]}, [], [{"x": "x^3", "y": "-y"}]),
    ({"x": "f(x)*y'", "y": "x'"}, {"f": ["x"]}, [], [{"x": "-y'", "y": "x'"}]),
    (POLAR, {"k": ["r"]}, [], [{name: text.replace("k(r)", "(-1/r)") for name, text in POLAR.items()},
                               {name: text.replace("k(r)", "(-2/r)") for name, text in POLAR.items()}]),
    ({"x": "a*y", "y": "F(x, y)"}, {"F": ["x", "y"]}, ["a"], [{"x": "3*y", "y": "3*x - y^2"}]),
    ({"x": "F(x, y)", "y": "G(x, y)"}, {"F": ["x", "y"], "G": ["x", "y"]}, [], [{"x": "2*x*y", "y": "x^2"}]),
)  # fmt: skip
CASES = [
    pytest.param(*row, id=" ".join(row[0].values()), marks=[pytest.mark.slow] * (k not in (1, 2)))
    for k, row in enumerate(FAMILIES)
]


def general_no(
    equations: dict[str, str], functions: dict[str, list[str]], constants: list[str]
) -> dict[str, Any]:
    asked = {"equations": equations, "functions": functions, "parameters": constants}
    asked["first_integrals"] = False
    found: dict[str, Any] = json.loads(inverse_service.solve(asked, time_limit=20).to_json())
    return found


@pytest.mark.parametrize(("equations", "functions", "constants", "members"), CASES)
def test_a_no_about_unknown_functions_is_about_general_ones(
    equations: dict[str, str],
    functions: dict[str, list[str]],
    constants: list[str],
    members: list[dict[str, str]],
) -> None:
    found = general_no(equations, functions, constants)
    written = ", ".join(f"{name}({', '.join(of)})" for name, of in functions.items())
    assert found["verdict"] == "not_variational"
    assert f"special functions {written}" in found["exceptions"]
    assert found["left_out"]
    assert not any(part["decided"] for part in found["left_out"])
    head = text_page(found, False).split("\n\n")[1]
    assert head.startswith(f"For {'a ' if len(functions) == 1 else ''}general {written}, no:")
    assert "do not come" not in text_page(found, False)
    assert "general" in latex_page(found, False)
    checked = inverse_service.check(found)
    assert checked["verdict"] == "valid"
    assert f"general {written}" in checked["statement"]["text"]
    forged = found | {"exceptions": [one for one in found["exceptions"] if "special" not in one]}
    assert inverse_service.check(forged)["verdict"] == "invalid"
    for member in members:
        assert (
            inverse_service.solve({"equations": member, "first_integrals": False})["verdict"]
            == "variational"
        )


@pytest.mark.parametrize(
    ("equations", "functions"),
    [
        ({"x": "F(x)", "y": "-y"}, {"F": ["x"]}),
        slow({"x": "-F'(x) - x'"}, {"F": ["x"]}),
        slow({"x": "y", "y": "x + F(x)", "z": "0"}, {"F": ["x"]}),
    ],
)
def test_a_proof_that_divides_by_no_function_is_about_all_of_them(
    equations: dict[str, str], functions: dict[str, list[str]]
) -> None:
    found = general_no(equations, functions, [])
    assert found["exceptions"] == []
    assert "general" not in text_page(found, False).split("\n\n")[1]


def test_what_was_checked_is_said() -> None:
    for slope, said in (
        ("-y'", "L gives these equations"),
        ("f(x)*y'", "no regular solution near a general point"),
    ):
        asked = {"equations": {"x": slope, "y": "x'"}, "functions": {"f": ["x"]}}
        assert "An independent checker verified that" in (
            text := text_page(inverse_service.solve(asked), False)
        )
        assert said in text
