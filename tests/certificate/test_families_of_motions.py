"""Proofs that motions of a family have no Lagrangian of any associated system.

A knife edge on a plane has one only if the plane is tilted, V = a x + b y, or a spring pulls it to a
point, V = k (x^2 + y^2)/2 + a x + b y: V_xy = 0 and V_xx = V_yy.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from inverse_service.certificate.brackets import Motion
from inverse_service.certificate.checker import check_certificate
from inverse_service.certificate.member_sets import Ring

Certificate = dict[str, Any]
NO = {"autonomous": "not_variational", "time_dependent": "not_variational"}
YES = {"autonomous": "variational", "time_dependent": "variational"}


def knife_edge(force: str, of: list[str], opened: list[str]) -> Certificate:
    """phi'' = 0, x'' of a knife edge with V, and y' = tan(phi) x'."""
    points = [{"values": {"x'": "0", "tan(phi/2)": value}} for value in ("0", "1/2")]
    rows = [[str(j), "0", "1"] for j in range(1, 9)]
    return {
        "format": "inverse-service/family/1",
        "system": {
            "coordinates": ["phi", "x", "y"],
            "equations": {"phi": "0", "x": f"-tan(phi)*phi'*x' - ({force})/(tan(phi)^2 + 1)"},
            "velocities": {"y": "tan(phi)*x'"},
            "parameters": [],
            "functions": {"V": of},
        },
        "letters": [],
        "functions": ["V"],
        "cells": [
            {
                "equations": [],
                **NO,
                "proofs": [{"kind": "brackets", "rows": rows, "points": points}],
            }
        ],
        "leaves": [{"equations": [], **NO}],
        "open": [{"equations": opened}],
    }


def tilted() -> Certificate:
    return knife_edge("V'(x)", ["x"], ["V''(x)"])


def test_a_knife_edge_needs_a_tilted_plane() -> None:
    found = check_certificate(tilted())
    assert found.verdict == "valid"
    assert found.reasons == (
        "Nothing is claimed of members with V''(x) = 0.",
        "For all other members: no regular Lagrangian of any associated system.",
    )


@pytest.mark.slow
def test_a_knife_edge_with_two_coordinates_needs_a_spring_to_a_point() -> None:
    slope = "V[1,0](x, y) + V[0,1](x, y)*tan(phi)"
    spring = ["V[1,1](x, y)", "V[2,0](x, y) - V[0,2](x, y)"]
    assert check_certificate(knife_edge(slope, ["x", "y"], spring)).verdict == "valid"
    larger = knife_edge(slope, ["x", "y"], [spring[0], "V[2,0](x, y) - 2*V[0,2](x, y)"])
    assert check_certificate(larger).verdict != "valid"


def forged() -> Iterator[tuple[str, Certificate]]:
    def change(name: str, work: Callable[[Certificate], object]) -> tuple[str, Certificate]:
        certificate = copy.deepcopy(tilted())
        work(certificate)
        return name, certificate

    def proof(one: Certificate) -> Certificate:
        found: Certificate = one["cells"][0]["proofs"][0]
        return found

    def sides(one: Certificate) -> dict[str, str]:
        found: dict[str, str] = one["system"]["equations"]
        return found

    free = "-tan(phi)*phi'*x'"
    yield change("no open set", lambda one: one["open"].clear())
    yield change("smaller open set", lambda one: one["open"][0].update(equations=["V'(x)"]))
    yield change("other open set", lambda one: one["open"][0].update(equations=["V'''(x) - 1"]))
    yield change("with an inequation", lambda one: one["open"][0].update(nonzero=["V'(x)"]))
    yield change("a yes", lambda one: [one["cells"][0].update(YES), one["leaves"][0].update(YES)])
    yield change("a yes in the leaf", lambda one: one["leaves"][0].update(YES))
    yield change("no proof", lambda one: one["cells"][0]["proofs"].clear())
    yield change("one row less", lambda one: proof(one)["rows"].pop())
    yield change("one row more", lambda one: proof(one)["rows"].append(["9", "0", "1"]))
    yield change("a row twice", lambda one: proof(one)["rows"].__setitem__(0, ["8", "0", "1"]))
    yield change("a row of one velocity", lambda one: proof(one)["rows"].append(["3", "1", "1"]))
    yield change("no points", lambda one: proof(one)["points"].clear())
    yield change("x fixed", lambda one: proof(one)["points"][0]["values"].update({"x": "0"}))
    yield change("an unknown name", lambda one: proof(one)["points"][0].update(values={"z": "0"}))
    yield change("y'", lambda one: sides(one).update(x=f"{free} - V'(x)*y'"))
    yield change("V(y')", lambda one: (
        one["system"]["functions"].update(V=["y'"]), sides(one).update(x=f"{free} - V(y')")))  # fmt: skip
    yield change("a plain proof", lambda one: proof(one).update(kind="isotropic"))
    yield change("rows of a tensor", lambda one: proof(one).update(
        kind="rank", rows=[[["Phi", "0", "0", "1"]]]))  # fmt: skip
    yield change("a free edge", lambda one: sides(one).update(x=free))
    yield change("no velocities", lambda one: one["system"].pop("velocities"))


FORGED = list(forged())


@pytest.mark.parametrize(("name", "certificate"), FORGED, ids=[name for name, _ in FORGED])
def test_no_false_claim_about_motions_is_valid(name: str, certificate: Certificate) -> None:
    assert check_certificate(certificate).verdict != "valid", name


def test_brackets_prove_nothing_of_a_system_without_constraints() -> None:
    certificate = tilted()
    certificate["system"] = {
        "coordinates": ["x", "y"],
        "equations": {"x": "V'(x)", "y": "0"},
        "parameters": [],
        "functions": {"V": ["x"]},
    }
    certificate["cells"][0]["proofs"][0]["points"] = [{"values": {"x'": "0"}}]
    assert check_certificate(certificate).verdict != "valid"


def test_a_derived_bivector_is_that_of_brackets() -> None:
    """x'' = u, z' = x y': [Gamma, d/dy'] = -d/dy - x d/dz, whose next bracket has -x' d/dz."""
    ring = Ring(["x", "y", "z"], [], [], {}, 0, time.thread_time() + 10)
    motion = Motion(ring, ["x", "y"], {"z": "x*y'"}, {"x": "0", "y": "0"})
    assert [motion.names[k] for k in motion.axes] == ["x", "y", "z", "x'", "y'"]

    def shown(j: int) -> dict[tuple[int, int], str]:
        found = motion.bivector(j, 0, 1)
        return {pair: str(value.above) for pair, value in sorted(found.items())}

    x, y = (str(ring.gens[ring.variables.index(one)]) for one in ("x'", "y'"))
    place = str(ring.gens[ring.variables.index("x")])
    # d/dx' ^ d/dy' -> -d/dx ^ d/dy' - d/dx' ^ (d/dy + x d/dz)
    assert shown(1) == {(0, 4): "-1", (1, 3): "1", (2, 3): place}
    # -> 2 d/dx ^ (d/dy + x d/dz) + y' d/dz ^ d/dy' - x' d/dx' ^ d/dz
    assert shown(2) == {(0, 1): "2", (0, 2): f"2*{place}", (2, 3): x, (2, 4): y}


def test_values_are_those_of_variables_on_which_no_function_depends() -> None:
    ring = Ring(["phi", "x"], [], [], {"V": ["x"]}, 2, time.thread_time() + 10, True)
    motion = Motion(ring, ["phi", "x"], {}, {"phi": "0", "x": "V'(x)*sin(phi)"})
    place = ring.variables.index("phi")
    found = motion.values({"tan(phi/2)": "1/2"})
    assert {k: str(value) for k, value in found.items()} == {ring.tangents[place]: "1/2"}
