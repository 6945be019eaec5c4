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


# As books write central forces, pairs of bodies, and waves: V, its variable u, and dV/du.
COMBINATIONS = [
    ({"x": "-x*F(x^2+y^2)", "y": "-y*F(x^2+y^2)"}, "G(x^2 + y^2)/2", "F(u)"),
    ({"x": "-x*F(sqrt(x^2+y^2))", "y": "-y*F(sqrt(x^2+y^2))"}, "G(sqrt(x^2 + y^2))", "u*F(u)"),
    ({"x": "-F(x+y)", "y": "-F(x+y)"}, "G(x + y)", "F(u)"),
    ({"x": "-a*F(a*x-b*y)", "y": "b*F(a*x-b*y)"}, "G(a*x - b*y)", "F(u)"),
    ({"x": "-y*F(x*y)", "y": "-x*F(x*y)"}, "G(x*y)", "F(u)"),
    ({"x": "F(t-x)"}, "G(t - x)", "F(u)"),
    ({"x": "-F(x)", "y": "-y"}, None, None),
    ({"x": "-F(x, y)", "y": "-F(x, y)"}, None, None),
    slow({"x": "-F(x, y)*y", "y": "-F(x, y)*x"}, None, None),
]


@pytest.mark.parametrize(("equations", "potential", "rate"), COMBINATIONS)
def test_the_potential_of_a_function_of_a_combination_is_one(
    equations: dict[str, str], potential: str | None, rate: str | None
) -> None:
    arguments = ["x", "y"] if "F(x, y)" in equations["x"] else ["r"]
    names = [name for name in "ab" if name + "*" in equations["x"] + equations.get("y", "")]
    asked = {"equations": equations, "functions": {"F": arguments}, "parameters": names}
    found: dict[str, Any] = json.loads(inverse_service.solve(asked).to_json())
    if potential is None or rate is None:
        known = (found["lagrangian"] or {}).get("auxiliary", {})
        assert all(set(one["arguments"]) <= {"t", "x", "y"} for one in known.values())
        return
    assert found["verdict_with_time"] == "variational"
    (shown,) = (one for one in found["answers"] if one["about"] == "main" and one["lagrangian"])
    assert f" - {potential}" in shown["lagrangian"]["text"]
    assert f" + {potential}" in shown["hamiltonian"]["text"]
    defined = {"G": {"arguments": ["u"], "derivatives": {"u": rate}}}
    assert shown["lagrangian"]["auxiliary"] == defined
    assert inverse_service.check(found)["verdict"] == "valid"
    assert f"G(u) = \u222b {rate} du" in text_page(found, False)
    forged = {"G": {"arguments": ["u"], "derivatives": {"u": f"2*{rate}"}}}
    assert inverse_service.check(with_defined(found, forged))["verdict"] == "invalid"


def with_defined(found: Any, defined: dict[str, Any]) -> Any:
    """The result with another definition of the functions in its L, wherever it has one."""
    if isinstance(found, list):
        return [with_defined(one, defined) for one in found]
    if not isinstance(found, dict):
        return found
    changed = {key: with_defined(value, defined) for key, value in found.items()}
    return changed | {key: defined for key in ("auxiliary", "integrals") if found.get(key)}
