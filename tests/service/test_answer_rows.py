"""A row of a table says what its formulas need: sets, momenta, constraints, functions, and the
question.
"""

from __future__ import annotations

from typing import Any

import inverse_service
from inverse_service.service.documents import answer_rows

KNIFE_EDGE = {
    "coordinates": ["x", "y", "phi"],
    "lagrangian": "(x'^2 + y'^2 + phi'^2)/2",
    "constraints": ["y'*cos(phi) - x'*sin(phi)"],
}


def row_of(document: dict[str, Any]) -> dict[str, Any]:
    return answer_rows.first_row(dict(inverse_service.solve(document)))


def test_a_branch_of_the_inverse_has_its_set() -> None:
    """Modified Emden: L = 1/(x' + x^2) has p = -1/(x' + x^2)^2, and H = -2 sqrt(-p) - x^2 p where
    x' + x^2 > 0 only.
    """
    row = row_of({"equations": {"x": "-3*x*x' - x^3"}})
    assert row["L_where"] == "x^2 + x' != 0"
    assert "x^2 + x' > 0" in row["H_where"].split(", ")
    assert row["momenta"].startswith("p_x = ")
    assert (row["about"], row["with_time"], row["verdict"], row["checked"]) == (
        "main",
        False,
        "variational",
        "valid",
    )


def test_a_nonholonomic_motion_is_answered_as_in_the_text() -> None:
    """The first associated system of the knife edge has no Lagrangian, but the motion can be given
    a Hamiltonian.
    """
    row = row_of({**KNIFE_EDGE, "first_integrals": False})
    assert (row["about"], row["verdict"], row["checked"], row["open"]) == (
        "any",
        "variational",
        "valid",
        None,
    )
    assert row["L"]
    assert row["image"].endswith(" = 0")


def test_a_function_in_l_has_its_derivative() -> None:
    """x'' = -k(x) x'^2 - g has L = exp(2 F) x'^2/2 - g G with F' = k, G' = exp(2 F) (an integrating
    factor).
    """
    found = {"equations": {"x": "-k(x)*x'^2 - g"}, "parameters": ["g"], "functions": {"k": ["x"]}}
    row = row_of(found)
    assert "dF/dx = k(x)" in row["auxiliary"]
    assert "dG/dx = exp(2*F(x))" in row["auxiliary"]


def test_there_is_a_row_for_each_answer_and_for_a_line_without_one() -> None:
    damped = dict(
        inverse_service.solve({"equations": {"x": "-x - 2*x*y - x'", "y": "-y - x^2 + y^2 - y'"}})
    )
    rows = list(answer_rows.rows({"id": "damped", **damped}))
    assert [(row["id"], row["with_time"], row["verdict"]) for row in rows] == [
        ("damped", True, "variational"),
        ("damped", False, "not_variational"),
    ]
    assert rows[0]["L"].startswith("exp(t)*")
    assert rows[1]["L"] is None
    error = answer_rows.first_row({"id": 3, "line": 7, "error": {"detail": "no equations"}})
    assert (error["line"], error["verdict"], error["open"]) == (7, "error", "no equations")
    assert {tuple(row) for row in (*rows, error)} == {answer_rows.COLUMNS}


def test_an_energy_in_the_velocities_is_not_called_h() -> None:
    """p = x' + x'^5 is not solved for x' by roots: the energy is one in the velocities."""
    row = row_of({"equations": {"x": "-x/(1 + 5*x'^4)"}})
    assert row["L"]
    assert (row["H"] is None) is (row["E"] is not None) is True
    assert "x'" in row["E"]
