"""A yes for the equations of the independent coordinates is a checked yes for the motion on the
constraints.
"""

from __future__ import annotations

import copy
import functools
from typing import Any

import pytest

import inverse_service
from inverse_service.service.documents.documents import parse_document
from tests.doors.rows import rows
from tests.values import slow


def heisenberg(pairs: int) -> dict[str, Any]:
    """The particle with z' = y_1 x_1' + … + y_k x_k', in 2 k + 1 dimensions (Bloch 2003, chapter 1
    for k = 1).
    """
    free = [f"{letter}{k}" for letter in "xy" for k in range(1, pairs + 1)]
    rate = "".join(f" - y{k}*x{k}'" for k in range(1, pairs + 1))
    energy = " + ".join(f"{name}'^2" for name in [*free, "z"])
    return {
        "coordinates": [*free, "z"],
        "lagrangian": f"({energy})/2",
        "constraints": [f"z'{rate}"],
    }


@functools.cache
def solved(pairs: int) -> inverse_service.Result:
    return inverse_service.solve(heisenberg(pairs) | {"associated": "any"}, time_limit=60)


@pytest.mark.parametrize("pairs", [1, *(slow(k) for k in (2, 3))])
def test_the_particle_of_any_dimension_can_be_given_a_hamiltonian(pairs: int) -> None:
    result = solved(pairs)
    answer = result["any_associated"]
    assert (answer["verdict"], answer["checked"]) == ("variational", "valid")
    assert inverse_service.check(result)["verdict"] == "valid"


def test_a_certificate_of_another_reduced_system_is_refused() -> None:
    forged = copy.deepcopy(dict(solved(1)))
    straight = inverse_service.solve({"equations": {"x1": "0", "y1": "0"}})
    forged["any_associated"] |= {
        "certificate": straight["certificate"],
        "lagrangian": straight["lagrangian"],
    }
    assert inverse_service.check(forged)["verdict"] == "invalid"


@pytest.mark.slow
def test_the_knife_edge_in_a_central_spring_has_a_lagrangian_in_closed_form() -> None:
    """R = x cos phi + y sin phi follows R'' = -(2 + phi'^2) R, and phi'' = 0."""
    document = {
        "coordinates": ["phi", "x", "y"],
        "lagrangian": "(x'^2 + y'^2 + phi'^2)/2 - x^2 - y^2",
        "constraints": ["x'*sin(phi) - y'*cos(phi)"],
        "associated": "any",
    }
    answer = inverse_service.solve(document, time_limit=20)["any_associated"]
    assert (answer["verdict"], answer["checked"]) == ("variational", "valid")
    assert len(answer["lagrangian"]["text"]) < 200


def test_angles_that_turn_together_are_taken_apart() -> None:
    """Uses differences of the headings; in the headings themselves the accelerations have 21,000
    characters.
    """
    (row,) = (row for row in rows("constrained") if row["id"] == "whole-trailer2")
    assert (
        sum(len(one["text"]) for one in parse_document(row["document"])["equations"].values())
        < 4000
    )


def test_other_equations_than_those_of_the_document_are_refused() -> None:
    forged = copy.deepcopy(dict(solved(1)))
    forged["system"]["equations"]["x1"] += " + 1"
    found = inverse_service.check(forged)
    assert "/system/equations" in [one["field"] for one in found["contradictions"]]
