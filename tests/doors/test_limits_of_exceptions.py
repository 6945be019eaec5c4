"""A limit while the excluded values are computed: they are open then, and nothing fails."""

import itertools
import json
import time
from typing import Any

import pytest

import inverse_service
from inverse_service import deadline
from inverse_service.certificate import checker, exceptions
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
    clock = itertools.count(time.thread_time(), 6_000)
    with monkeypatch.context() as patched:
        patched.setattr(time, "thread_time", lambda: next(clock))
        assert {*proof.exceptions} == expected
    cut = {key: value for key, value in found.items() if key != "answers"}
    cut["exceptions"] = sorted(expected)
    assert inverse_service.check(cut)["verdict"] != "invalid"


@pytest.fixture(scope="module")
def no_for_most() -> Any:
    """The certificate of a no with two parameters."""
    document = {"equations": {"x": "a*x*y'", "y": "b*y*x'"}, "first_integrals": False}
    return dict(inverse_service.solve(document))["certificate"]


def test_the_excluded_values_are_the_same_on_a_slow_machine(
    no_for_most: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The work for them is counted, not timed."""
    clock = time.thread_time
    monkeypatch.setattr(time, "thread_time", lambda: 500 * clock())
    proof = checker.check_certificate(no_for_most, 3600, seed=1)
    assert [*proof.exceptions] == ["a = 0", "b = 0"]


def test_work_beyond_the_limit_leaves_the_excluded_values_open(
    no_for_most: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exceptions, "LEAST_WORK", 1_000)
    proof = checker.check_certificate(no_for_most, seed=1)
    assert (proof.verdict, [*proof.exceptions]) == ("valid", ["single values of a, b"])


def claim(equations: dict[str, str], parameters: list[str], lagrangian: str) -> dict[str, Any]:
    """The certificate of a yes by this Lagrangian."""
    system = {
        "coordinates": [*equations],
        "equations": equations,
        "parameters": parameters,
        "functions": {},
    }
    return {
        "format": checker.FORMAT,
        "kind": "lagrangian",
        "claim": "variational",
        "question": "autonomous",
        "system": system,
        "lagrangian": lagrangian,
    }


MANY = [
    ("0", "(p*q+3*r*c)*x'^2/2+b*y'^2/2", {"b = 0", "p*q + 3*r*c = 0"}),
    ("0", "x'^2/(2*p)+r*y'^2/2", {"p = 0", "r = 0"}),
    ("0", "x'^2/2+p*y'^3/6+q*y'^2*x'/2", {"p = q = 0"}),
    ("1/(p+q)", "x'^2/2+y'^2/2+x/(p+q)", set[str]()),
]


@pytest.mark.parametrize(("force", "lagrangian", "expected"), MANY)
def test_many_letters_do_not_hide_the_excluded_values(
    force: str, lagrangian: str, expected: set[str]
) -> None:
    """Those of one factor depend on few of the letters, and most letters may be 0 together."""
    names = [f"w{k}" for k in range(1, 13)]
    well = "".join(f"-{name}*z^{k + 1}/{k + 1}" for k, name in enumerate(names, 1))
    pull = "".join(f"-{name}*z^{k}" for k, name in enumerate(names, 1))
    certificate = claim(
        {"x": force, "y": "0", "z": pull},
        ["p", "q", "r", "b", "c", *names],
        f"{lagrangian}+z'^2/2{well}",
    )
    proof = checker.check_certificate(certificate, seed=1)
    assert (proof.verdict, {*proof.exceptions}) == ("valid", expected)


@pytest.mark.parametrize("seed", range(4))
def test_the_excluded_values_are_found_where_few_points_have_all_roots(seed: int) -> None:
    """Six roots exist at one of 64 points modulo a prime, as the distances of four bodies."""
    roots = [f"sqrt(x+{k})" for k in (1, 2, 3, 5, 7, 11)]
    force = "+".join(f"1/(2*{root})" for root in roots)
    certificate = claim(
        {"x": f"-({force}+y)", "y": "-x"},
        ["m"],
        f"m*((x'^2+y'^2)/2-x*y-{'-'.join(roots)})",
    )
    proof = checker.check_certificate(certificate, seed=seed)
    assert (proof.verdict, [*proof.exceptions]) == ("valid", ["m = 0"])


def test_a_family_without_time_for_its_general_member_is_open() -> None:
    system = second_order_system.read_system(["x"], {"x": "-a*x"}, ["a"])
    with pytest.raises(leaves.NotSplit, match="the time was over"):
        members.explore(system, ["a"], (), SolveOptions(), deadline.now())
