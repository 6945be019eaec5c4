"""Families of motions on constraints: which potentials leave a Lagrangian of any associated system.

A knife edge on a plane that is tilted, V = V_0 x + V_1, moves as it does for some L; for V = x^2 it
does not. The same holds for the particle with z' = -x y' and V(x).
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from typing import Any
from unittest import mock

import pytest

import inverse_service
from inverse_service import check
from inverse_service.constrained import motion_families
from inverse_service.decision.solutions import SolveOptions
from inverse_service.expressions import printing
from inverse_service.mechanics.constrained_motion import read_motion
from inverse_service.reading.declarations import Declared
from inverse_service.service.documents import family_parts

KNIFE_EDGE = {
    "lagrangian": "x'^2/2 + y'^2/2 + phi'^2/2 - V(x)",
    "coordinates": ["phi", "x", "y"],
    "constraints": ["y' = tan(phi)*x'"],
    "functions": {"V": ["x"]},
    "associated": "any",
    "first_integrals": False,
}
YES, NO = "variational", "not_variational"


@pytest.fixture(scope="module")
def particle() -> motion_families.FamilyOfMotions:
    """x'' = -V'(x) + c, y'' = -x x' y'/(1 + x^2), z' = -x y', decided without answers."""
    declared = Declared(["x", "y", "z"], [], {"V": ["x"]}, {}, 10)
    rates = {"x": "-diff(V(x), x)", "y": "-x*x'*y'/(1 + x^2)"}
    motion = read_motion(declared, rates, ["z' = -x*y'"])
    with mock.patch.object(motion_families, "_with_answers", lambda _, one: one):
        return motion_families.explore(motion, [], ["V"], SolveOptions(), float("inf"))


def test_sets_of_potentials_are_decided_at_points(
    particle: motion_families.FamilyOfMotions,
) -> None:
    """Yes where V'' = 0."""
    trees = [map(particle.unknowns.tree, one.leaf.equations) for one in particle.leaves]
    assert [[*map(printing.to_text, each)] for each in trees] == [[], ["V''(x)"]]
    assert [one.verdicts for one in particle.leaves] == [(NO, NO), (YES, YES)]


def test_a_set_without_an_answer_is_shown_without_a_lagrangian(
    particle: motion_families.FamilyOfMotions,
) -> None:
    shown = [family_parts._leaf_of_motions(particle, number) for number in (0, 1)]
    assert [(leaf.lagrangian, leaf.proof) for leaf in shown] == [(None, None)] * 2
    assert [leaf.verdict for leaf in shown] == [NO, YES]


def test_the_member_of_a_leaf_is_a_document() -> None:
    leaf = {
        "equations": [{"text": "V''(x) = 0"}],
        "solved": [{"text": "V(x) = c*x + V_1", "new_constants": ["c", "V_1"], "new_functions": []}],
    }  # fmt: skip
    made = family_parts.document_of_leaf(KNIFE_EDGE, leaf)
    assert made is not None
    assert family_parts.follows(KNIFE_EDGE, leaf)
    assert made["parameters"] == ["c", "V_1"]
    assert "V(" not in made["lagrangian"]
    assert "c*x" in made["lagrangian"]
    leaf["equations"] = [{"text": "V'(x) = 0"}]
    assert family_parts.follows(KNIFE_EDGE, leaf) is False


@pytest.fixture(scope="module")
def knife_edge() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(
        inverse_service.solve(KNIFE_EDGE | {"family": True}).to_json()
    )
    return found


@pytest.mark.slow
def test_a_knife_edge_on_a_tilted_plane(knife_edge: dict[str, Any]) -> None:
    first, tilted = knife_edge["family"]["leaves"]
    assert (first["verdict"], tilted["verdict"]) == (NO, YES)
    assert tilted["solved"][0]["text"] == "V(x) = V_0*x + V_1"
    assert tilted["lagrangian"]
    assert knife_edge["family"]["covered"] is False
    assert len(knife_edge["family"]["open"]) == 1
    assert check(knife_edge)["verdict"] == "valid"


@pytest.mark.slow
@pytest.mark.parametrize(("potential", "verdict"), [("3*x - 1", YES), ("x^2", NO), ("5", YES), ("exp(x)", NO)])  # fmt: skip
def test_members_alone_agree(potential: str, verdict: str) -> None:
    lagrangian = KNIFE_EDGE["lagrangian"].replace("V(x)", f"({potential})")  # type: ignore[attr-defined]
    alone = {key: value for key, value in KNIFE_EDGE.items() if key != "functions"}
    found = json.loads(inverse_service.solve(alone | {"lagrangian": lagrangian}).to_json())
    assert found["any_associated"]["verdict"] == verdict


@pytest.mark.slow
def test_forged_sets_are_not_valid(knife_edge: dict[str, Any]) -> None:
    def leaf_of(result: dict[str, Any], number: int) -> dict[str, Any]:
        found: dict[str, Any] = result["family"]["leaves"][number]
        return found

    forged = [copy.deepcopy(knife_edge) for _ in range(6)]
    leaf_of(forged[0], 1)["equations"][0]["text"] = "V'''(x) = 0"
    leaf_of(forged[1], 0)["verdict"] = leaf_of(forged[1], 0)["verdict_with_time"] = YES
    leaf_of(forged[2], 1)["proof"] = leaf_of(forged[2], 0)["proof"]
    leaf_of(forged[3], 1)["lagrangian"]["text"] = "x'^2/2"
    forged[4]["family"]["covered"] = True
    leaf_of(forged[5], 1)["solved"][0]["text"] = "V(x) = V_0*x^2 + V_1"
    for place, one in enumerate(forged):
        assert check(one)["verdict"] != "valid", place


@pytest.mark.slow
def test_a_forged_proof_that_there_are_no_others_is_not_valid(knife_edge: dict[str, Any]) -> None:
    assert knife_edge["family"]["checked"] == "valid"
    other = "-tan(phi)*phi'*x' - 2*V'(x)/(tan(phi)^2 + 1)"
    changes: list[Callable[[dict[str, Any]], object]] = [
        lambda part: part.update(covered=True, open=[]),
        lambda part: (
            part.update(covered=True, open=[]),
            part["certificate"].update(open=[]),
        ),
        lambda part: part["certificate"]["system"]["equations"].update(x=other),
        lambda part: part["certificate"]["system"]["velocities"].update(y="2*tan(phi)*x'"),
        lambda part: part["certificate"]["system"].pop("velocities"),
        lambda part: part.update(functions={"W": ["x"]}),
        lambda part: part["leaves"].pop(),
        lambda part: part["leaves"][1]["equations"][0].update(text="V'(x) = 0"),
        lambda part: part["leaves"][1].update(verdict=NO, verdict_with_time=NO),
        lambda part: part.update(checked="invalid"),
        lambda part: part.update(certificate=None),
    ]
    for place, change in enumerate(changes):
        one = copy.deepcopy(knife_edge)
        change(one["family"])
        assert check(one)["verdict"] != "valid", place
