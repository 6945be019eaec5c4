"""What people read of H: the momenta of x_A are p_A, p is the length of the momentum, and a long
determinant is said in words.
"""

from __future__ import annotations

from typing import Any

import pytest

import inverse_service
from inverse_service.reading.names import Names
from inverse_service.service.documents import readable_energies, sheets


def shown(energy: dict[str, Any], names: Names) -> tuple[str, tuple[str, ...]]:
    found = readable_energies.readable(energy, names)
    return found.text, (*found.definitions, *found.momenta)


@pytest.mark.parametrize(
    ("coordinates", "parameters", "momenta"),
    [
        (("x_A", "x_B"), (), ["p_A", "p_B"]),
        (("x_1", "y_1"), (), ["p_x_1", "p_y_1"]),  # both would be p_1
        (("x_A", "y"), ("p_A",), ["p_x_A", "p_y"]),
        (("r", "x_2"), (), ["p_r", "p_2"]),
        (("q1", "q2"), (), ["p1", "p2"]),
        (("q",), (), ["p"]),
        (("q", "x"), ("p",), ["p_q", "p_x"]),
    ],
)
def test_momenta_have_the_index_of_their_coordinates_where_it_is_free(
    coordinates: tuple[str, ...], parameters: tuple[str, ...], momenta: list[str]
) -> None:
    energy = {
        "text": " + ".join(f"p_{name}^2/2" for name in coordinates),
        "momenta": {f"p_{name}": f"{name}'" for name in coordinates},
    }
    names = Names(coordinates, (*parameters, *(f"p_{name}" for name in coordinates)))
    text, equations = shown(energy, names)
    assert text == " + ".join(f"{name}^2/2" for name in momenta)
    expected = [f"{p} = {q}'" for p, q in zip(momenta, coordinates, strict=True)]
    assert [*equations] == expected


@pytest.mark.parametrize(
    ("lagrangian", "potential"),
    [
        ("m*x'^2/2 - k*abs(x)^3/3", "k*abs(x)^3/3"),
        ("x1'^2 + x2'^2 - ((x1 - x2)^2 + x1^2)/2", "((x1 - x2)^2 + x1^2)/2"),
    ],
)
def test_h_has_the_potential_as_l_has_it(lagrangian: str, potential: str) -> None:
    found = inverse_service.solve({"lagrangian": lagrangian, "parameters": "guess"})
    assert found["hamiltonian"]["text"].endswith(f" + {potential}")


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("sqrt(m^2 + p_x^2 + p_y^2 + p_z^2) + V", "sqrt(m^2 + p^2) + V"),
        ("k*sqrt(p_x^2 + p_y^2 + p_z^2)", "k*p"),
        ("log(p_x^2 + p_y^2 + p_z^2)", "log(p^2)"),
        ("(p_x^2 + p_y^2 + p_z^2)/(2*m)", "(p_x^2 + p_y^2 + p_z^2)/(2*m)"),
        ("sqrt(m^2 + p_x^2 + p_y^2 + p_z^2) + p_x", "sqrt(m^2 + p_x^2 + p_y^2 + p_z^2) + p_x"),
    ],
)
def test_the_length_of_the_momentum_is_written_once(text: str, written: str) -> None:
    names = Names(("x", "y", "z"), ("m", "k", "V", "p_x", "p_y", "p_z"))
    found = readable_energies.readable(
        {"text": text, "momenta": dict.fromkeys(names.parameters[3:], "")}, names
    )
    assert found.text == written
    assert found.definitions == (("p = sqrt(p_x^2 + p_y^2 + p_z^2)",) if written != text else ())


def test_a_determinant_is_said_in_words_only_where_it_is_one() -> None:
    names = Names(("a", "b", "c"), ("m",))
    matrix = [
        ["3", "2*cos(a - b)", "cos(a - c)"],
        ["2*cos(a - b)", "2", "cos(b - c)"],
        ["cos(a - c)", "cos(b - c)", "1"],
    ]
    part = "-4*cos(b - a)*cos(c - a)*cos(c - b) + 4*cos(b - a)^2 + 2*cos(c - a)^2 + 3*cos(c - b)^2"
    conditions = [f"{part} - 6 != 0", f"{part} - 5 != 0", "m != 0"]
    found = readable_energies.said_by_regularity(matrix, conditions, names)
    assert found == {conditions[0]}
    assert not readable_energies.said_by_regularity(matrix[:2], conditions, names)


def test_two_particles_are_read_with_short_momenta() -> None:
    lagrangian = "m_A*x_A'^2/2 + m_B*x_B'^2/2 - k*(x_A - x_B)^2/2"
    result = inverse_service.solve({"lagrangian": lagrangian, "parameters": "guess"})
    (case,) = sheets.sheet_of(result).cases
    energy = case.formulas[-1]
    assert energy.whole == "H = p_A^2/(2*m_A) + p_B^2/(2*m_B) + k*(x_A - x_B)^2/2"
    assert "p_{A}" in energy.latex
    # The energy keeps the square of the Lagrangian.
    (conserved,) = result["conserved"]
    assert conserved["text"].endswith("k*(x_A - x_B)^2/2")
