"""Constraints on positions: sums of squares become angles, others are refused."""

from __future__ import annotations

import pytest

import inverse_service
from inverse_service.mechanics.position_constraints import definitions_on
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents.documents import parse_document


@pytest.mark.parametrize("constraint", ["x^4+y^2=1", "sin(x)^2+y^4=2", "(x*y)^2+(x+y)^4=1"])
def test_a_constraint_on_positions_is_refused_in_one_sentence(constraint: str) -> None:
    document = {"lagrangian": "(x'^2+y'^2)/2", "constraints": [constraint]}
    with pytest.raises(inverse_service.InputError, match=r"eliminate a coordinate"):
        inverse_service.solve(document)


@pytest.mark.parametrize(
    ("lagrangian", "constraint", "means", "equations"),
    [
        (
            "m*(x'^2+y'^2)/2 - m*g*y", "x^2+y^2=l^2", "x = l*sin(theta), y = -l*cos(theta)",
            {"theta": "-g*sin(theta)/l"},
        ),
        (
            "(x'^2+y'^2+z'^2)/2 - g*z", "x^2+y^2+z^2=l^2",
            "x = l*sin(theta)*cos(phi), y = l*sin(theta)*sin(phi), z = -l*cos(theta)",
            {"theta": "-g*sin(theta)/l + cos(theta)*sin(theta)*phi'^2",
             "phi": "-2*cos(theta)*phi'*theta'/sin(theta)"},
        ),
    ],
)  # fmt: skip
def test_a_circle_and_a_sphere_are_angles_from_the_lowest_point(
    lagrangian: str, constraint: str, means: str, equations: dict[str, str]
) -> None:
    found = parse_document(
        {"lagrangian": lagrangian, "constraints": [constraint], "parameters": ["m", "g", "l"]}
    )
    assert [part["as"] for part in found["readings"]] == [means]
    assert {name: part["text"] for name, part in found["equations"].items()} == equations


@pytest.mark.parametrize(
    ("constraints", "left"),
    [
        (["x^2 + y^2 - z^2"], ("z", "theta")),
        (["z - x - 1", "x^2 + y^2 - 4"], ("theta1",)),
        (["x^2 + y^2 - z^2", "z - x - 1"], None),  # x = z sin(theta) and z = x + 1
        (["x^2 + y^2 + 1"], None),  # nowhere
    ],
)
def test_no_coordinate_is_defined_by_itself(
    constraints: list[str], left: tuple[str, ...] | None
) -> None:
    known = nm.Names(("x", "y", "z"), (), {})
    *trees, lagrangian = (
        reader.read_formula(text, known) for text in (*constraints, "x'^2 + y'^2 + z'^2")
    )
    found = definitions_on(trees, lagrangian, known.coordinates, known.coordinates)
    assert (found and found[1]) == left
