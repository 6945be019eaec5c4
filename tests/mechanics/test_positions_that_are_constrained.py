"""Constraints on positions: sums of squares become angles, others are refused."""

from __future__ import annotations

import random

import pytest
from mpmath import mp, mpf

import inverse_service
from inverse_service.expressions import calculus, tree as ex
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


CENTERED = [
    "{a}*(x - {b})^2 + {c}*y^2 - m", "{a}*(x - {b})^2 + {c}*(y + {d}*w)^2 + (z - 1)^2 - m^2", "{a}*x + {b}*y - {c}*w - m",
    "{a}*x^2 + {c}*y^2 + {d}*z^2 - {c}*m", "{a}*(x + {b}*t)^2 + (y - {d})^2 - {c}", "{b}*w*x - z + {a}*x^2",
    "2*m*(x^2 + y^2) - {c}", "{a}*(x - w)^2 + {c}*(z - {b}*w)^2 - w^2",
]  # fmt: skip


@pytest.mark.parametrize("shape", CENTERED)
def test_definitions_fulfil_their_constraint_wherever_the_angles_are(shape: str) -> None:
    """For random centers, factors, and radii; in as many directions as the constraint leaves."""
    source, names = random.Random(shape), nm.Names(("x", "y", "z", "w"), ("m",))
    energy = reader.read_formula("m*y", names)
    for _ in range(4):
        numbers = {letter: source.randint(1, 5) for letter in "abcd"}
        tree = reader.read_formula(shape.format(**numbers), names)
        found = definitions_on([tree], energy, names.coordinates, ("m",))
        assert found is not None
        (definitions,), left = found
        assert len(left) == 3
        assert {*definitions}.isdisjoint(left)
        assert not {*definitions} & {
            node.name
            for one in definitions.values()
            for node in ex.walk(one)
            if isinstance(node, ex.Symbol)
        }
        whole = ex.substitute(tree, {ex.Symbol(name): one for name, one in definitions.items()})
        ways = []
        with mp.workdps(30):
            for _ in range(6):
                place = {ex.Symbol(name): mpf(source.uniform(0.2, 3)) for name in (*left, "m", "t")}
                place[ex.TIME] = place[ex.Symbol("t")]
                assert abs(calculus.evaluate(whole, dict(place))) < mpf(10) ** -20
                ways.append([calculus.evaluate(one, dict(place)) for one in definitions.values()])
        assert all(
            len({mp.sign(way[k] - ways[0][k]) for way in ways}) > 1 for k in range(len(definitions))
        )
