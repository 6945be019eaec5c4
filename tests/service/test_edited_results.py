"""An edited result is not valid, or the check says that it does not compare the edited part."""

from __future__ import annotations

import copy
import functools
import json
from typing import Any

import pytest

from inverse_service import check, solve

Document = dict[str, Any]
DOCUMENTS: dict[str, Document] = {
    "branches": {
        "equations": "x''=sqrt((x-1)^2)*y'-y^2; y''=-(x-1)*x'-2*x*y",
        "kinds": ["natural"],
    },
    "emden": {"equations": {"x": "-3*x*x'-x^3"}},
    "friction": {"equations": {"x": "-sqrt(x)", "y": "-x'"}},
    "invariant": {
        "equations": {"x": "-x", "y": "-y"},
        "kinds": [{"invariant": [{"x": "-y", "y": "x"}]}],
    },
    "quartic": {"equations": "x'' = -2*x*y^2/(1 - x'^2); y'' = -2*x^2*y/(1 + 3*y'^2)"},
    "clock": {"equations": {"x": "-x*y'^2", "y": "-x'*y'"}, "clock": "exp(x)"},
}
QUARTIC = (  # by the real roots of x' - x'^3/3 = p_x and y' + y'^3 = p_y, too many to be proven
    "p_x*sin(asin(3*p_x/2)/3) - 4*sin(asin(3*p_x/2)/3)^4/3 + 2*sinh(asinh(3*sqrt(3)*p_y/2)/3)^2/3"
    " + 4*sinh(asinh(3*sqrt(3)*p_y/2)/3)^4/3 + x^2*y^2"
)


@functools.cache
def solved(name: str) -> str:
    return json.dumps(dict(solve(DOCUMENTS[name])))


def edited(name: str, path: tuple[str | int, ...], value: Any) -> Document:
    result: Document = json.loads(solved(name))
    place: Any = result
    for key in path[:-1]:
        place = place[key]
    assert place[path[-1]] != value
    place[path[-1]] = value
    return result


@pytest.mark.slow
@pytest.mark.parametrize("name", DOCUMENTS)
def test_what_was_not_edited_is_valid_and_says_what_was_not_checked(name: str) -> None:
    found = check(json.loads(solved(name)))
    assert found["verdict"] == "valid", found["reasons"]
    assert "explanation" in found["reasons"][-1]
    assert found["reasons"][-1].startswith("Not checked: ")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "path", "value"),
    [
        ("branches", ("domain",), []),
        ("friction", ("domain",), None),
        ("friction", ("domain",), []),
        ("branches", ("domain", 0), "x < 2"),
        ("branches", ("domain", 0), "x > 1"),
        ("branches", ("verdict",), "variational"),
        ("branches", ("branches", 0, "verdict"), "variational"),
        ("branches", ("branches", 0, "domain"), ["x < 2"]),
        ("branches", ("branches", 1, "verdict"), "not_variational"),
        ("branches", ("branches", 1, "verdict_with_time"), "not_variational"),
        ("branches", ("branches", 1, "domain", 0), "x > 0"),
        ("branches", ("branches", 1, "domain"), []),
        ("branches", ("branches", 1, "lagrangian", "text"), "x'^2/2"),
        ("branches", ("branches", 1, "lagrangian", "domain"), []),
        ("branches", ("branches", 1, "hamiltonian", "text"), "p_x^2/2 + p_y^2/2 + x*y^2"),
        ("branches", ("branches", 1, "hamiltonian", "momenta", "p_y"), "y'"),
        ("branches", ("branches",), []),
        ("branches", ("kinds", "natural", "verdict"), "variational"),
        ("branches", ("kinds", "natural", "near"), {"x": "3"}),
        ("branches", ("system", "given", "equations"), "x''=0; y''=0"),
        ("branches", ("system", "equations", "x"), "y' - y^2"),
        ("emden", ("lagrangian", "text"), "1/(x' + x^2) + x"),
        ("emden", ("hamiltonian", "text"), "-p_x*x^2 + 2*sqrt(-p_x)"),
        ("emden", ("hamiltonian", "momenta"), {"p_x": "1/(x^2 + x')^2"}),
        ("emden", ("hamiltonian", "domain"), []),
        ("emden", ("hamiltonian", "domain"), ["p_x > 0"]),
        ("emden", ("question",), "L(t, q, q') or none"),
        ("emden", ("checked",), "invalid"),
        ("emden", ("integrals",), {"F": {"arguments": ["x"], "derivatives": {"x": "x"}}}),
        ("friction", ("instead", "dissipation", "text"), "x'*y'/2"),
        ("friction", ("instead", "hamiltonian", "text"), "p_x^2/2"),
        ("quartic", ("hamiltonian", "text"), QUARTIC.replace("x^2", "x^3")),
        ("quartic", ("hamiltonian", "text"), QUARTIC.replace("*sinh", "*sin", 1)),
        ("quartic", ("hamiltonian", "momenta", "p_y"), "y' - y'^3"),
        ("quartic", ("hamiltonian", "domain"), []),
        ("friction", ("instead", "kind"), "time"),
        ("friction", ("domain",), ["x > -1"]),
        ("invariant", ("kinds", "invariant", "verdict"), "not_variational"),
        ("invariant", ("system", "given", "kinds"), [{"invariant": [{"x": "1"}]}]),
        ("invariant", ("kinds", "invariant", "certificate", "among", "invariant", 0, "x"), "-2*y"),
        ("clock", ("with_clock", "verdict"), "variational"),
        ("clock", ("with_clock", "equations", "x"), "0"),
    ],
)
def test_an_edited_result_is_not_valid(name: str, path: tuple[str | int, ...], value: Any) -> None:
    found = check(edited(name, path, value))
    assert found["verdict"] != "valid" or any(
        ("/" + "/".join(map(str, path))).startswith(one) for one in found["not_checked"]
    )


def test_a_domain_that_was_widened_everywhere_is_not_valid() -> None:
    """In the result and in its certificate: then formulas are undefined or L is wrong at random
    points.
    """
    result = json.loads(solved("branches"))
    for part in result["branches"][1], result["branches"][1]["lagrangian"]:
        part["domain"] = ["x > -5"]
    result["branches"][1]["certificate"]["conditions"] = ["x > -5"]
    assert check(result)["verdict"] != "valid"


@pytest.mark.slow
def test_a_motion_on_fewer_directions_is_another_motion() -> None:
    """phi'' = 0, z'' = 0 next to the knife edge: with z' = 0 in addition it is the knife edge
    alone.
    """
    document = {
        "coordinates": ["phi", "x", "y", "z"],
        "lagrangian": "(phi'^2 + x'^2 + y'^2 + z'^2)/2",
        "constraints": ["y' - tan(phi)*x'"],
        "associated": "any",
    }
    result = json.loads(json.dumps(dict(solve(document))))
    assert check(result)["verdict"] in ("valid", "incomplete")
    other = copy.deepcopy(result)
    system = other["any_associated"]["certificate"]["system"]
    assert system["equations"].pop("z") == "0"
    system["velocities"]["z"] = "0"
    system["coordinates"] = [*system["equations"], *system["velocities"]]
    assert check(other)["verdict"] == "invalid"


def test_a_hamiltonian_with_too_many_roots_is_compared_at_points_and_noted() -> None:
    """No wrong H passes; the check says that H is not proven, without an effect on L."""
    result = json.loads(solved("quartic"))
    assert result["hamiltonian"]["text"] == QUARTIC
    assert "/hamiltonian" in check(result)["not_checked"]


def test_the_statement_writes_the_equations_in_latex_as_the_result_does() -> None:
    result = dict(
        solve(
            {
                "equations": {"phi": "-sin(phi)", "theta_1": "-theta_1"},
                "time_dependent_lagrangian": False,
                "first_integrals": False,
            }
        )
    )
    written = check(result)["statement"]["latex"]
    assert all(equation in written for equation in result["system"]["latex"].values())
    assert "\\ddot{phi}" not in written
