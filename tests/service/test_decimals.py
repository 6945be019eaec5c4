"""Decimal numbers and absolute values are printed as they were typed, and the checker confirms the
answer.
"""

from __future__ import annotations

import json
from typing import Any

import pytest

from inverse_service import check, solve
from inverse_service.service.documents import printed_pages, sheets
from inverse_service.web.pages import typesetting
from tests.values import slow


@pytest.mark.parametrize(
    ("document", "equation", "lagrangian", "hamiltonian"),
    [
        ({"equations": "x'' = -9.81*x"}, "-9.81*x", "x'^2/2 - 9.81*x^2/2", "p_x^2/2 + 9.81*x^2/2"),
        (
            {"equations": {"x": "-g"}, "parameters": {"g": "9.81"}},
            "-9.81",
            "x'^2/2 - 9.81*x",
            "p_x^2/2 + 9.81*x",
        ),
        (
            {"equations": "x'' = -2.5e-3x"},
            "-0.0025*x",
            "x'^2/2 - 0.0025*x^2/2",
            "p_x^2/2 + 0.0025*x^2/2",
        ),
        ({"equations": "x'' = -0.5*x"}, "-x/2", "x'^2/2 - x^2/4", "p_x^2/2 + x^2/4"),
        (
            {"equations": "x'' = -2.0*x - 1.5"},
            "-2*x - 1.5",
            "x'^2/2 - 1.5*x - x^2",
            "p_x^2/2 + 1.5*x + x^2",
        ),
    ],
)
def test_a_decimal_number_is_the_same_in_the_equations_l_and_h(
    document: dict[str, Any], equation: str, lagrangian: str, hamiltonian: str
) -> None:
    found = solve({**document, "time_dependent_lagrangian": False, "first_integrals": False})
    assert found["system"]["equations"]["x"] == equation
    assert found["lagrangian"]["text"] == lagrangian
    assert found["hamiltonian"]["text"] == hamiltonian
    assert check(json.dumps(found))["verdict"] == "valid"


def test_an_absolute_value_is_printed_as_one() -> None:
    found = solve(
        {
            "equations": "x'' = -k*abs(x)*x",
            "time_dependent_lagrangian": False,
            "first_integrals": False,
        }
    )
    assert found["system"]["equations"]["x"] == "-k*abs(x)*x"
    assert check(json.dumps(found))["verdict"] == "valid"


@pytest.mark.parametrize(
    ("typed", "shown"),
    [
        ("x'' = -9.8*x + 2", "x'' = -9.8*x + 2"),
        ("x'' = 1.5*x - 0.25*y; y'' = -0.25*x", "x'' = 1.5*x - 0.25*y"),
        ("x'' = x/2 - 0.25*y; y'' = -0.25*x", "x'' = x/2 - y/4"),  # halves are fractions there
        ("x'' = (-b + a)*x + 1e-3", "x'' = (-b + a)*x + 0.001"),
        ("x'' = -9.81/2.5*x", "x'' = -3.924*x"),
        ("x'' = -k*abs(x')*x'", "x'' = -k*abs(x')*x'"),
        ("x'' = -x - 3*max(x, 0)", "x'' = -x - 3*max(x, 0)"),
        ("x'' = -min(max(x, -1), 1)", "x'' = -min(max(x, -1), 1)"),
        ("x'' = -max(x, y); y'' = -y", "x'' = -max(x, y)"),
        slow("x'' = -max(x, y, 0); y'' = -y", "x'' = -max(x, y, 0)"),
    ],
)
def test_the_echo_keeps_the_order_the_brackets_and_the_numbers_of_the_writer(
    typed: str, shown: str
) -> None:
    """In the text, in LaTeX, and on the page."""
    document = {
        "equations": typed, "parameters": "guess", "first_integrals": False,
        "time_dependent_lagrangian": False,
    }  # fmt: skip
    asked = sheets.sheet_of(solve(document)).asked[0]
    assert asked.whole == shown
    latex, mathml = (
        printed_pages.latex_of(asked.text, asked.names),
        typesetting.inner_mathml(asked.text.partition(" = ")[2], asked.names) or "",
    )
    if "-b + a" in shown:
        assert "-b + a" in latex
        assert mathml.index(">b<") < mathml.index(">a<")
    for name in ("max", "min"):
        assert latex.count(name) == mathml.count(f"<mi>{name}</mi>") == shown.count(name)


def test_l_and_h_have_decimal_numbers_in_their_terms() -> None:
    found = solve({"equations": "x'' = -9.81*sin(x)/0.5 - 0.1*x'", "first_integrals": False})
    answer = found["answers"][0]
    assert answer["lagrangian"]["text"] == "exp(0.1*t)*(x'^2/2 + 19.62*cos(x))"
    assert answer["hamiltonian"]["text"] == "exp(-0.1*t)*p_x^2/2 - 19.62*exp(0.1*t)*cos(x)"
    assert check(json.dumps(found))["verdict"] == "valid"
