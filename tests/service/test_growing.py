"""A result grows: each part is reported when it is finished and checked, and a limit keeps all of
these parts.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import itertools
import json
import operator
from types import SimpleNamespace
from typing import Any, get_args
from unittest import mock

import pytest

import inverse_service
from api_schemas import base
from inverse_service import deadline
from inverse_service.certificate.checker import CheckResult
from inverse_service.decision import certify
from inverse_service.decision.solutions import SolveOptions
from inverse_service.expressions import refusals
from inverse_service.service.documents import comparison, growing
from inverse_service.service.documents.checking import check_plain
from inverse_service.service.documents.documents import solve_document
from inverse_service.service.jobs.supervisor import described
from inverse_service.solving import solving
from inverse_service.statements.reasons import Open, Reason
from inverse_service.statements.stages import Part, Stage
from inverse_service.web.pages.rendering import Visitor
from inverse_service.web.pages.result_tasks import Look, so_far_task

DAMPED = {"equations": "x'' = -x - x'/10", "time_dependent_lagrangian": False}
NONE = {"equations": {"x": "y", "y": "-x*x'"}}  # no Lagrangian of either kind
CASES = {"equations": {"x": "-sqrt(x^2)"}}
PARTICLE = {"lagrangian": "(x'^2 + y'^2 + z'^2)/2", "constraints": ["z' = y*x'"]}
MOTION = {
    "coordinates": ["x", "y", "z"],
    "motion": {"x": "0", "y": "0"},
    "constraints": ["z' = y*x'"],
}
BOTH = {"equations": "x'' = -x - x'/10"}
ALL = {
    "damped": DAMPED,
    "both questions": BOTH,
    "none": NONE,
    "branches": CASES,
    "particle": PARTICLE,
    "motion": MOTION,
}


_TOLD: dict[str, Any] = {}
_TAKEN: dict[str, float] = {}


def told_once(document: dict[str, Any]) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Cached `told` for tests without changes during the run; the caller gets a copy."""
    key = json.dumps(document)
    if key not in _TOLD:
        looks = itertools.count()
        clock = SimpleNamespace(monotonic=lambda: float(next(looks)))
        with mock.patch.object(growing, "time", clock):  # a second passes at each look
            _TOLD[key] = told(document)
        _TAKEN[key] = next(looks) - 1.0
    return copy.deepcopy(_TOLD[key])


def told(document: dict[str, Any], **options: Any) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The messages before the end, and the final result."""
    found: list[Any] = []
    result = solve_document(document, SolveOptions(time_limit=30.0, **options), found.append)
    return [report for report in found if isinstance(report, dict)], result


def states(messages: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The whole result after each message."""
    return [*itertools.accumulate((message["value"] for message in messages), operator.or_)]


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solving, "AT_ONCE", -1.0)
    monkeypatch.setattr(growing, "AT_ONCE", -1.0)


@pytest.mark.parametrize("document", ALL.values(), ids=ALL)
def test_together_the_parts_are_the_result_and_each_state_passes_the_check(
    document: dict[str, Any],
) -> None:
    messages, result = told_once(document)
    found = states(messages)
    assert found[-1] == result
    assert {check_plain(json.loads(json.dumps(state)))["verdict"] for state in found} <= {
        "valid",
        "incomplete",
    }
    names = [part for message in messages for part in message["parts"]]
    assert len(names) == len(set(names))
    assert result["incomplete"] == []


@pytest.mark.parametrize("document", ALL.values(), ids=ALL)
def test_a_definite_answer_is_never_taken_back(document: dict[str, Any]) -> None:
    seen: dict[str, Any] = {}
    for state in states(told_once(document)[0]):
        about = state.get("any_associated") or {}
        now = {key: state[key] for key in ("verdict", "verdict_with_time")} | {
            "any": about.get("verdict")
        }
        if state["branches"]:
            continue  # the first branch represents all branches
        for key, verdict in now.items():
            assert seen.get(key, verdict) == verdict
            if verdict in ("variational", "not_variational"):
                seen[key] = verdict


@pytest.mark.parametrize("document", ALL.values(), ids=ALL)
def test_the_seconds_of_the_parts_add_up(document: dict[str, Any]) -> None:
    """From the first look at the clock to the last, each second is counted once."""
    result = told_once(document)[1]
    assert sum(result["provenance"]["seconds"].values()) == _TAKEN[json.dumps(document)] > 1


def test_existence_of_a_lagrangian_is_reported_before_its_formula() -> None:
    messages, result = told(DAMPED)
    parts = [part for message in messages for part in message["parts"]]
    assert parts.index("existence") < parts.index("lagrangian") < parts.index("hamiltonian")
    known = [state for state in states(messages) if state["verdict"] == "variational"]
    assert known[0]["lagrangian"] is None
    assert {state["checked"] for state in known} == {"valid"}
    with_lagrangian = next(state for state in known if state["lagrangian"])
    assert with_lagrangian["lagrangian"]["text"] == result["lagrangian"]["text"]
    assert with_lagrangian["lagrangian"]["domain"] == result["lagrangian"]["domain"] != []


@pytest.mark.parametrize(("part", "patience"), [(Part.EXISTENCE, 0.3), (Part.CONDITIONS, 1.0)])
def test_a_verdict_waits_less_long_than_other_parts(
    monkeypatch: pytest.MonkeyPatch, part: Part, patience: float
) -> None:
    """However long the next part takes: a verdict is there before first integrals are looked for."""
    clock, told = [0.0], list[Any]()
    monkeypatch.setattr(growing, "AT_ONCE", 1.0)
    monkeypatch.setattr(deadline, "now", lambda: clock[0])
    known: Any = SimpleNamespace(statements=())
    grow = growing.Growing(told.append, lambda _: {"format": "new"})
    monkeypatch.setattr(grow, "_send", lambda found: told.append(found))
    for moment, is_sent in ((0.9 * patience, False), (patience, True)):
        clock[0] = moment
        grow.hand_over((part,), lambda: known)
        grow.begin(Part.FIRST_INTEGRALS)
        assert told == [known] * is_sent


@pytest.mark.slow
def test_that_a_lagrangian_exists_is_reported_before_one_with_the_time_is_looked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of Van der Pol's equation no formula is found, and the search with the time takes longest."""
    monkeypatch.setattr(solving, "AT_ONCE", 60.0)
    heard: list[Any] = []
    solve_document(
        {"equations": "x'' = -x + (1 - x^2)*x'"}, SolveOptions(time_limit=30.0), heard.append
    )
    known = [isinstance(one, dict) and "existence" in one["parts"] for one in heard]
    timed = [isinstance(one, Stage) and one.timed for one in heard]
    assert known.index(True) < timed.index(True)


def test_of_constraints_the_motion_comes_first_and_the_verdict_on_it_before_its_lagrangian() -> (
    None
):
    parts = [part for message in told_once(PARTICLE)[0] for part in message["parts"]]
    assert parts.index("motion") < parts.index("existence") < parts.index("any_associated")


def test_unconfirmed_parts_are_not_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    real = certify.prove

    def doubtful(analysis: Any, certificate: Any, *rest: Any) -> Any:
        found = real(analysis, certificate, *rest)
        is_existence = certificate.get("kind") == "existence" or "symbol" in certificate
        return (found[0], CheckResult("incomplete", ("no time",))) if is_existence else found

    monkeypatch.setattr(certify, "prove", doubtful)
    found = [state for state in states(told(DAMPED)[0]) if state["verdict"] == "variational"]
    assert all(state["lagrangian"] for state in found)


@pytest.mark.parametrize("late", [0, 1])
def test_what_was_told_is_not_taken_back_where_a_comparison_has_no_time(
    monkeypatch: pytest.MonkeyPatch, late: int
) -> None:
    """Of the messages the second or the third; its parts come with the next one."""
    real, calls = comparison.compared_with_document, itertools.count()

    def compared(given: Any, system: Any, limit: float) -> CheckResult:
        is_late = next(calls) == late
        return CheckResult("incomplete", ("no time",)) if is_late else real(given, system, limit)

    monkeypatch.setattr(comparison, "compared_with_document", compared)
    messages, result = told(DAMPED)
    whole = told_once(DAMPED)[0]
    assert len(messages) == len(whole) - 1
    parts = [*whole[late + 1]["parts"], *whole[late + 2]["parts"]]
    assert messages[late + 1]["parts"] == parts
    verdicts = [state["verdict"] for state in states(messages)]
    assert verdicts == sorted(verdicts) == ["undetermined", *["variational"] * (len(messages) - 1)]
    assert states(messages)[-1] == result


def test_parts_use_the_names_of_the_document() -> None:
    first = states(
        told({"coordinates": ["x"], "equations": {"x": "-x*tau - x'/10"}, "time": "tau"})[0]
    )[0]
    assert first["system"]["equations"] == {"x": "-x*tau - x'/10"}
    assert first["system"]["time"] == "tau"
    assert first["system"]["given"]["time"] == "tau"


def test_a_caller_of_python_hears_of_each_part() -> None:
    found: list[tuple[str, Any]] = []
    inverse_service.solve(DAMPED, progress=lambda part, value: found.append((part, value)))
    assert [part for part, _ in found][:2] == ["conditions", "existence"]


def test_each_part_of_an_immediate_answer_is_reported_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growing, "AT_ONCE", 60.0)
    found: list[tuple[str, Any]] = []
    result = inverse_service.solve(DAMPED, progress=lambda part, value: found.append((part, value)))
    merged = functools.reduce(operator.or_, (value for _, value in found))
    assert merged["verdict"] == result["verdict"]
    assert [part for part, _ in found][:2] == ["conditions", "existence"]


@pytest.mark.parametrize("place", [0, 3])
def test_cut_off_anywhere_the_result_is_what_was_finished(place: int) -> None:
    messages, result = told_once(PARTICLE)
    so_far = states(messages)[min(place, len(messages) - 2)]
    cut = growing.cut_off(
        so_far, Open(Reason.TIME, "The time limit of 1 s was reached."), {"motion": 0.5}, 1.0
    )
    assert {entry["reason"] for entry in cut["incomplete"]} <= {
        "The time limit of 1 s was reached."
    }
    assert sum(cut["provenance"]["seconds"].values()) == pytest.approx(
        1.0 if cut["incomplete"] else 0.5
    )
    assert check_plain(json.loads(json.dumps(cut)))["verdict"] in ("valid", "incomplete")
    assert (
        cut["nonholonomic"]["equations_of_motion"] == result["nonholonomic"]["equations_of_motion"]
    )
    assert "not decided yet" not in json.dumps(cut)


def test_later_stages_keep_the_reported_parts() -> None:
    before = described(
        {"parts": ["existence"], "value": {"verdict": "variational"}, "seconds": {}},
        {"stage": "decision"},
    )
    after = described("Hamiltonian", before)
    assert after == {"so_far": {"verdict": "variational"}, "seconds": {}, "stage": "Hamiltonian"}


@pytest.mark.parametrize("document", [DAMPED, PARTICLE])
def test_the_page_says_no_more_than_is_known(document: dict[str, Any]) -> None:
    """The statements "no closed form" and "undetermined" are true only at the end."""
    for part in states(told_once(document)[0])[:-1]:
        job = {
            "id": "a",
            "status": "running",
            "progress": {"stage": "search", "so_far": json.loads(json.dumps(part))},
        }
        text = bytes(so_far_task(job, Look(Visitor(), "http://localhost", 60.0), 3).body).decode()
        assert not [words for words in ("none was found", "ndetermined") if words in text]
        assert 'data-events="/v1/jobs/a/events"' in text


def test_a_result_longer_than_what_is_read_is_not_called_invalid(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The document has fewer parts than the limit, what is printed has more."""
    result = json.loads(inverse_service.solve({"equations": {"x": "-x - x'/10"}}).to_json())
    monkeypatch.setattr(refusals, "LIMITS", dataclasses.replace(refusals.LIMITS, tokens=2))
    found = check_plain(result)
    assert (found["verdict"], found["contradictions"]) == ("incomplete", [])
    assert "too long to be read again" in found["reasons"][0]


@pytest.mark.parametrize("part", [0.0, 0.1])
def test_in_the_first_half_of_a_limit_no_share_ends_a_decision(part: float) -> None:
    with deadline.whole(100.0):
        assert deadline.share(part, deadline.now() + 20.0) > deadline.now() + 49.0
    assert deadline.share(0.5, deadline.now() + 20.0) == pytest.approx(
        deadline.now() + 10.0, abs=0.1
    )


def test_each_part_has_a_row() -> None:
    assert {*growing.PARTS} == {*map(str, Part)}
    assert {str(one) for one in Reason} | {""} == {*get_args(base.ReasonCode)}


def test_what_is_wanted_most_is_told_sooner_after_a_first_message(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In s of processor time: 0.1 after the start, 0.03 after a message; other parts wait 0.1."""
    monkeypatch.setattr(growing, "AT_ONCE", 0.1)
    moment, heard = [0.0], list[tuple[float, Any]]()
    monkeypatch.setattr(deadline, "now", lambda: moment[0])
    grow = growing.Growing(
        lambda found: heard.append((moment[0], found["parts"])), lambda told: {"at": moment[0]}
    )
    told = SimpleNamespace(also=lambda **_: told)

    def finished(at: float, part: Part) -> None:
        moment[0] = at
        grow.hand_over([part], lambda: told)

    for at, part in ((0.05, Part.EXISTENCE), (0.11, Part.LAGRANGIAN), (0.15, Part.HAMILTONIAN)):
        finished(at, part)
    finished(0.2, Part.CONDITIONS)
    finished(0.26, Part.CONDITIONS)
    assert heard == [
        (0.11, [Part.EXISTENCE, Part.LAGRANGIAN]),
        (0.15, [Part.HAMILTONIAN]),
        (0.26, [Part.CONDITIONS]),
    ]
