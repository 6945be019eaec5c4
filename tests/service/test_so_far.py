"""An answer that is confirmed before all is found is told meanwhile, and never says more than the final one."""

from __future__ import annotations

import json
from typing import Any

import pytest

from inverse_service.certificate.checker import CheckResult
from inverse_service.inverse_problem import confirming
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_document
from inverse_service.service.jobs.event_log import described
from inverse_service.web.pages.rendering import Visitor
from inverse_service.web.pages.result_tasks import so_far_task

DAMPED = {"equations": "x'' = -x - x'/10"}
NONE = {"equations": {"x": "y", "y": "-x*x'"}}  # no Lagrangian of either kind
CASES = {"equations": {"x": "-sqrt(x^2)"}}


def told(document: dict[str, Any], **options: Any) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """What is told before the end, and the end."""
    found: list[Any] = []
    result = solve_document(document, SolveOptions(time_limit=30.0, **options), found.append)
    return [report["so_far"] for report in found if isinstance(report, dict)], result


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(confirming, "_AT_ONCE", -1.0)


def test_first_that_a_lagrangian_exists_is_told_and_then_which() -> None:
    parts, result = told(DAMPED)
    assert [part["lagrangian"] is None for part in parts] == [True, False]
    assert {part["verdict"] for part in parts} == {result["verdict"]} == {"variational"}
    assert {part["checked"] for part in parts} == {"valid"}
    assert parts[1]["lagrangian"]["text"] == result["lagrangian"]["text"]
    assert parts[1]["lagrangian"]["domain"] == result["lagrangian"]["domain"] != []
    assert parts[1]["domain"] == result["domain"]


def test_what_the_checker_does_not_confirm_is_not_told(monkeypatch: pytest.MonkeyPatch) -> None:
    real = confirming.check_certificate

    def doubtful(certificate: Any, **options: Any) -> CheckResult:
        is_existence = certificate.get("kind") == "existence" or "symbol" in certificate
        return CheckResult("incomplete", ("no time",)) if is_existence else real(certificate, **options)

    monkeypatch.setattr(confirming, "check_certificate", doubtful)
    parts, _ = told(DAMPED)
    assert [part["lagrangian"] is None for part in parts] == [False]


@pytest.mark.parametrize(
    ("document", "verdict"),
    [(NONE, "not_variational"), (CASES, "variational")],
    ids=["no Lagrangian", "an answer for each sign"],
)
def test_what_is_settled_at_the_end_alone_is_not_told_before(document: dict[str, Any], verdict: str) -> None:
    parts, result = told(document)
    assert parts == []
    assert result["verdict"] == result["verdict_with_time"] == verdict


def test_it_is_told_in_the_names_of_the_document() -> None:
    parts, _ = told({"coordinates": ["x"], "equations": {"x": "-x*tau - x'/10"}, "time": "tau"})
    assert parts[0]["system"]["equations"] == {"x": "-x*tau - x'/10"}
    assert parts[0]["system"]["time"] == "tau"


def test_later_stages_keep_what_was_told() -> None:
    before = described({"so_far": {"verdict": "variational"}}, {"stage": "decision"})
    assert described("Hamiltonian", before) == {"so_far": {"verdict": "variational"}, "stage": "Hamiltonian"}


def test_the_page_says_no_more_than_is_known() -> None:
    """That none was found in closed form is true at the end only."""
    texts = []
    for part in told(DAMPED)[0]:
        job = {"id": "a", "status": "running", "progress": {"stage": "search", "so_far": json.loads(json.dumps(part))}}
        texts.append(bytes(so_far_task(job, Visitor(), 3).body).decode())
    assert "A regular Lagrangian L(q, q\u2032) exists." in texts[0]
    assert "none was found" not in texts[0]
    assert "These equations come from a regular Lagrangian L(q, q\u2032)." in texts[1]
    assert "<h2>Lagrangian</h2>" not in texts[0]
    assert "<h2>Lagrangian</h2>" in texts[1]
    for text in texts:
        assert "proof checked" in text
        assert 'data-events="/v1/jobs/a/events"' in text
