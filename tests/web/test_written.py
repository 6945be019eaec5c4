"""An answer has the form that `Accept` names: text, LaTeX, or a SymPy program; JSON by default."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from starlette.requests import Request

from inverse_service.web.job_answers import media_type_of

OSCILLATOR = {"equations": "x'' = -k*x - c*x'", "parameters": ["k", "c"]}
SEEN = {
    "text/plain": "Yes, this equation comes from a Lagrangian that contains the time.",
    "application/x-latex": r"\documentclass",
    "text/x-python": "from sympy import",
}


@pytest.mark.parametrize("media_type", SEEN)
def test_a_solved_system_is_written_as_accept_asks(service: str, media_type: str) -> None:
    with httpx.Client(
        base_url=service, timeout=60, headers={"Accept": media_type, "Prefer": "wait=20"}
    ) as client:
        answer = client.post("/v1/solve", json=OSCILLATOR)
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith(media_type)
        assert answer.headers["vary"] == "Accept"
        assert SEEN[media_type] in answer.text
        again = client.get(answer.headers["location"])
        assert again.text == answer.text
        known = client.get(
            answer.headers["location"], headers={"If-None-Match": again.headers["etag"]}
        )
        assert known.status_code == 304
        job = client.get(answer.headers["location"], headers={"Accept": "application/json"})
        assert job.json()["result"]["verdict"] == "variational"
        assert job.headers["etag"] != again.headers["etag"]


@pytest.mark.slow
def test_the_program_runs_and_its_residual_is_zero(service: str) -> None:
    headers = {"Accept": "text/x-python", "Prefer": "wait=20"}
    program = httpx.post(f"{service}/v1/solve", json=OSCILLATOR, headers=headers, timeout=60).text
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.strip() == "[0]"


@pytest.mark.slow
@pytest.mark.parametrize(
    "document",
    [
        {"lagrangian": "x'^2/2 - x^2/2"},
        {
            "coordinates": ["x", "y", "z"],
            "lagrangian": "(x'^2 + y'^2 + z'^2)/2",
            "constraints": ["z' + x*y'"],
        },
        {"equations": "x'' = -V'(x)", "functions": {"V": ["x"]}},
    ],
)
def test_every_kind_of_answer_can_be_written(service: str, document: dict[str, object]) -> None:
    for media_type in SEEN:
        headers = {"Accept": media_type, "Prefer": "wait=20"}
        answer = httpx.post(f"{service}/v1/solve", json=document, headers=headers, timeout=60)
        assert answer.status_code == 200, answer.text
        assert answer.headers["content-type"].startswith(media_type)


def lagrangians(part: Any) -> Iterator[dict[str, str]]:
    """Every L in a result, as text and LaTeX."""
    for key, value in (
        part.items()
        if isinstance(part, dict)
        else enumerate(part)
        if isinstance(part, list)
        else ()
    ):
        if key == "lagrangian" and isinstance(value, dict) and "latex" in value:
            yield value
        yield from lagrangians(value)


def test_text_and_latex_say_the_same(service: str) -> None:
    """Both contain the motion, the associated systems, the reduced system, and its time change."""
    document = {"lagrangian": "(x'^2 + y'^2 + z'^2)/2", "constraints": ["z' + x*y'"]}
    plain, text, latex = (
        httpx.post(
            f"{service}/v1/solve",
            json=document,
            headers={"Accept": form, "Prefer": "wait=20"},
            timeout=60,
        )
        for form in ("application/json", "text/plain", "application/x-latex")
    )
    found = list(lagrangians(plain.json()))
    assert len({one["text"] for one in found}) >= 4
    assert [one["text"] for one in found if one["text"] not in text.text] == []
    assert [one["latex"] for one in found if one["latex"] not in latex.text] == []
    assert (
        text.text.count("checker verified that") == latex.text.count("checker verified that") >= 4
    )


def test_a_refusal_stays_a_problem_document(service: str) -> None:
    answer = httpx.post(
        f"{service}/v1/solve",
        json={"equations": "x'' = -kx", "parameters": []},
        headers={"Accept": "text/plain"},
    )
    assert answer.status_code == 422
    assert answer.headers["content-type"].startswith("application/problem+json")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("accept", "found"),
    [
        ("", None),
        ("*/*", None),
        ("application/json", None),
        ("text/plain", "text/plain"),
        ("TEXT/PLAIN; charset=utf-8", "text/plain"),
        ("application/json, text/plain", None),
        ("text/plain, application/json", None),
        ("text/plain, */*", None),
        ("text/plain, */*;q=0.5", "text/plain"),
        ("text/plain;q=0.2, application/x-latex;q=0.9", "application/x-latex"),
        ("text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8", None),
        ("text/plain;q=0", None),
        ("text/plain;q=nan, text/x-python", "text/plain"),
        (",,;q=,", None),
    ],
)
def test_json_is_the_answer_where_it_is_as_good(accept: str, found: str | None) -> None:
    assert (
        media_type_of(Request({"type": "http", "headers": [(b"accept", accept.encode())]})) == found
    )
