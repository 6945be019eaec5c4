"""The check of a user's own L says whether it leads to the equations, with the residual."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from unittest import mock

import httpx
import pytest
from typer.testing import CliRunner

from inverse_service.cli.command_line import application, load_commands
from inverse_service.decision import certify
from inverse_service.expressions import printing
from inverse_service.service.documents.checking import check_document
from tests.values import slow

OSCILLATOR = {"equations": "x'' = -k*x", "parameters": ["k"]}
KEPLER = {"equations": "x'' = -x/(x^2+y^2)^(3/2); y'' = -y/(x^2+y^2)^(3/2)"}


def verdict(document: dict[str, Any], lagrangian: str) -> dict[str, Any]:
    return check_document(json.dumps({"system": document, "lagrangian": lagrangian}))


@pytest.mark.parametrize(
    ("document", "lagrangian"),
    [
        (OSCILLATOR, "x'^2/2 - k*x^2/2"),
        (OSCILLATOR, "-3*x'^2 + 3*k*x^2 + x*x'"),
        (KEPLER, "(x'^2 + y'^2)/2 + 1/sqrt(x^2 + y^2)"),
        ({"equations": "x'' = -x - x'/10"}, "exp(t/10)*(x'^2 - x^2)/2"),
        ({"equations": "x'' = -x'"}, "x'*log(x') - x"),
        ({"equations": "x'' = 0"}, "x'^4"),
        ({"equations": "x'' = -x"}, "x'*atan(x'/x)/x - log(x'^2 + x^2)/2"),
        ({"equations": "x'' = abs(x)"}, "x'^2/2 + x*abs(x)/2"),
        slow({"equations": "x'' = 1/x"}, "x'^2/2 + log(abs(x))"),
    ],
)
def test_a_right_lagrangian_is_confirmed_and_leaves_nothing(
    document: dict[str, Any], lagrangian: str
) -> None:
    found = verdict(document, lagrangian)
    assert found["verdict"] == "valid"
    assert {part["text"] for part in found["residual"].values()} == {"0"}


def test_a_wrong_sign_is_shown_with_the_equations_that_l_has() -> None:
    found = verdict(OSCILLATOR, "x'^2/2 + k*x^2/2")
    assert found["verdict"] == "invalid"
    assert found["residual"]["x"]["text"] == "-2*k*x"
    assert found["equations"]["x"]["text"] == "k*x"


@pytest.mark.parametrize(
    ("equations", "lagrangian", "right", "wrong"),
    [
        ("x'' = abs(x)", "x'^2/2 + x^2/2", ["x > 0"], ["x < 0"]),
        ("x'' = x", "x'^2/2 + x*abs(x)/2", ["x > 0"], ["x < 0"]),
        ("x'' = abs(a)*x", "x'^2/2 + a*x^2/2", ["a > 0"], ["a < 0"]),
        slow(
            "x'' = asin(2*x/(1 + x^2))",
            "x'^2/2 + 2*x*atan(x) - log(1 + x^2)",
            ["x > -1", "x < 1"],
            ["x < -1"],
        ),
        slow(
            "x'' = -x",
            "(x'^2 - x^2)/2 + x*(atan(tan(x)) - x)",
            ["x > -pi/2", "x < pi/2"],
            ["x > pi/2", "x < 3*pi/2"],
        ),
        slow(
            "x'' = -x",
            "(x'^2 - x^2)/2 + x^3*(atan(2*x/(1 - x^2)) - 2*atan(x))",
            ["x > -1", "x < 1"],
            ["x < -1"],
        ),
        (
            "x'' = abs(x)*y' - y^2; y'' = -abs(x)*x' - 2*x*y",
            "(x'^2 + y'^2 + x^2*y')/2 - x*y^2",
            ["x > 0"],
            ["x < 0"],
        ),
    ],
)
def test_a_lagrangian_that_is_right_on_some_cells_only_differs_and_says_where(
    equations: str, lagrangian: str, right: list[str], wrong: list[str]
) -> None:
    found = verdict({"equations": equations, "parameters": ["a"]}, lagrangian)
    assert found["verdict"] == "differs"
    cells = {(cell["verdict"], *sorted(cell["domain"])): cell for cell in found["cells"]}
    assert ("valid", *sorted(right)) in cells
    failing = cells["invalid", *sorted(wrong)]  # without a member that follows from the others
    given, own = (failing["accelerations"][key] for key in ("given", "lagrangian"))
    assert given != own


# Each is 0 on a part of the line only, as a function of x (its complement in brackets).
PARTLY = [
    "atan(x) + atan(1/x) - pi/2",  # x < 0
    "atan(x) - atan(-1/x) - pi/2",  # x < 0
    "atan(2*x/(1-x^2)) - 2*atan(x)",  # |x| > 1
    slow("acos(1-2*x^2) - 2*asin(x)"),  # -1 < x < 0
    slow("acos(1/sqrt(1+x^2)) - atan(x)"),  # x < 0
    "atan(cot(x)) - pi/2 + x",  # outside (0, pi)
    "atan(sin(x)/(1+cos(x))) - x/2",  # outside (-pi, pi)
    slow("abs(x^2-1/10^6) - (x^2-1/10^6)"),  # |x| < 0.001
    slow("abs(x^2-1/10^20) - (x^2-1/10^20)"),  # |x| < 10^-10
    slow("abs((x-33)^2-1/25) - ((x-33)^2-1/25)"),  # |x - 33| < 0.2
    slow("asin(sin(x/30)) - x/30"),
    slow("sqrt((x+10^8)^2) - x - 10^8"),  # x < -10^8
    slow("asin(2*x/(1+x^2)) - 2*atan(x)"),  # |x| > 1
    "log(x^2) - 2*log(x)",
    "abs((x-10^9/7)^2-1/10^9) - ((x-10^9/7)^2-1/10^9)",  # where no point is found
]


@pytest.mark.parametrize("zero", PARTLY)
def test_what_holds_on_a_part_of_the_line_is_never_valid_beyond_it(zero: str) -> None:
    found = verdict({"equations": {"x": "-x"}}, f"x'^2/2 - x^2/2 + x^3*({zero})")
    whole = {"log(x^2) - 2*log(x)": "valid", PARTLY[-1]: "incomplete"}  # x > 0 is all of one
    assert found["verdict"] == whole.get(zero, "differs")
    for cell in found["cells"]:
        assert cell["verdict"] != "valid" or cell["domain"]


@pytest.mark.parametrize(
    "zero", ["sin(2*x) - 2*sin(x)*cos(x)", "sqrt(x^4) - x^2", "log(exp(x)) - x", "abs(x)^2 - x^2"]
)
def test_what_is_zero_everywhere_is_valid_everywhere(zero: str) -> None:
    found = verdict({"equations": {"x": "-x"}}, f"x'^2/2 - x^2/2 + x^3*({zero})")
    assert (found["verdict"], found["statement"]["domain"]) == ("valid", [])


def test_a_singular_lagrangian_is_invalid_even_if_its_equations_hold() -> None:
    found = verdict({"equations": "x'' = 0"}, "x*x'")
    assert (found["verdict"], found["equations"]) == ("invalid", None)
    assert "singular" in found["reasons"][0]


def test_the_command_says_what_is_left_and_what_l_gives(tmp_path: Path) -> None:
    path = tmp_path / "system.json"
    path.write_text(json.dumps(OSCILLATOR))
    load_commands("check")
    wrong = CliRunner().invoke(
        application, ["check", "--format", "text", "--lagrangian", "x'^2/2", str(path)]
    )
    assert wrong.exit_code == 1
    assert "= -k*x, where it should be 0" in wrong.output
    assert "this L gives x'' = 0" in wrong.output
    assert (
        CliRunner()
        .invoke(application, ["check", "--lagrangian", "x'^2 - k*x^2", str(path)])
        .exit_code
        == 0
    )


def test_http_answers_and_refuses_a_name_that_the_system_does_not_have(service: str) -> None:
    body = {"system": OSCILLATOR, "lagrangian": "x'^2/2 - k*x^2/2"}
    assert httpx.post(f"{service}/v1/check", json=body, timeout=60).json()["verdict"] == "valid"
    refused = httpx.post(f"{service}/v1/check", json={**body, "lagrangian": "m*x'^2/2"}, timeout=60)
    assert refused.status_code == 422
    assert "'m' is not declared" in refused.json()["detail"]


@pytest.mark.parametrize(
    ("equations", "lagrangian", "wanted"),
    [
        ("theta'' = -g/l*sin(theta)", "m*l^2*theta'^2/2 + m*g*l*cos(theta)", "valid"),
        ("x'' = -x", "m*(x'^2 - x^2)/2", "valid"),
        ("x'' = -x", "(x'^2 - x^2)/(2*m) + F(x)*x'", "valid"),
        ("x'' = -x", "x'^2/2 - k*x^2", "invalid"),
        ("x'' = -x", "x'^2/2 - F(x)", "invalid"),
        slow(
            "x'' = -x",
            "(x'^2 - x^2)/2 + x^3*(sqrt(x - 2*sqrt(x - 1)) - sqrt(x - 1) + 1)",
            "differs",
        ),  # right for x > 2
    ],
)
def test_constants_that_the_equations_do_not_contain_are_of_any_value(
    equations: str, lagrangian: str, wanted: str
) -> None:
    """The mass of a pendulum occurs in its L but not in its equation."""
    found = verdict({"equations": equations, "parameters": "guess"}, lagrangian)
    assert found["verdict"] == wanted
    assert all("token" not in reason for reason in found["reasons"])


def test_a_certificate_that_cannot_be_read_refuses_no_right_lagrangian() -> None:
    """The checker says "invalid" of a certificate in a wrong form as well. Of a right L that proves
    nothing, of a wrong one the points do.
    """

    def unread(root: Any, value: Any) -> dict[str, str]:
        return {"root": "not (a root", "is": printing.to_text(value)}

    system = {"equations": "x'' = -4^(1/4)*x"}
    with mock.patch.object(certify, "_entry", unread):
        right, wrong = (verdict(system, f"x'^2/2 {sign} 4^(1/4)*x^2/2") for sign in "-+")
    assert right["verdict"] == "incomplete"
    assert "certificate was refused" in right["reasons"][0]
    assert wrong["verdict"] == "invalid"
