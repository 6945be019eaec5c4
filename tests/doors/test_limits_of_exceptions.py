"""A limit while the excluded values are computed: they are open then, and nothing fails."""

import itertools
import json
import time
from typing import Any

import pytest

import inverse_service
from inverse_service import deadline
from inverse_service.certificate import checker
from inverse_service.certificate.exceptions import LEAST_TIME
from inverse_service.decision.solutions import SolveOptions
from inverse_service.mechanics import second_order_system
from inverse_service.solving import leaves, members
from tests.values import slow

FORCES = [
    slow({"parameters": ["a"]}, {"single values of a"}),
    ({"functions": {"F": ["x", "y"]}}, {"special functions F(x, y)"}),
    slow(
        {"parameters": ["a"], "functions": {"F": ["x", "y"]}},
        {"special functions F(x, y)", "single values of a"},
    ),
]


def no_about(more: dict[str, Any]) -> dict[str, Any]:
    force = " + ".join(
        ["x^2*y", *(["F(x, y)"] * ("functions" in more)), *(["a*y^2"] * ("parameters" in more))]
    )
    document = {"equations": {"x": force, "y": "-sqrt(2)*y"}, "first_integrals": False, **more}
    found: dict[str, Any] = json.loads(inverse_service.solve(document).to_json())
    assert found["verdict"] == "not_variational"
    return found


@pytest.mark.parametrize(("more", "expected"), FORCES)
def test_no_time_leaves_the_excluded_values_open(
    more: dict[str, Any], expected: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = no_about(more)
    proof = checker.check_certificate(found["certificate"], seed=1)
    assert proof.verdict == "valid"
    # Each look at the clock ends any time.
    clock = itertools.count(time.thread_time(), 100 * (LEAST_TIME + 60))
    with monkeypatch.context() as patched:
        patched.setattr(time, "thread_time", lambda: next(clock))
        assert {*proof.exceptions} == expected
    cut = {key: value for key, value in found.items() if key != "answers"}
    cut["exceptions"] = sorted(expected)
    assert inverse_service.check(cut)["verdict"] != "invalid"


def test_a_family_without_time_for_its_general_member_is_open() -> None:
    system = second_order_system.read_system(["x"], {"x": "-a*x"}, ["a"])
    with pytest.raises(leaves.NotSplit, match="the time was over"):
        members.explore(system, ["a"], (), SolveOptions(), deadline.now())
