"""Decimal numbers and absolute values are printed as they were typed, and the checker confirms the
answer.
"""

from __future__ import annotations

import json
from typing import Any

import pytest

from inverse_service import check, solve


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
