"""The clients repeat safe requests, distinguish errors, and return nothing twice."""

from __future__ import annotations

import inspect
import socket
import time
from typing import Any

import httpx
import pytest

from api_schemas.result import ResultDocument
from inverse_service.client import (
    AsyncClient,
    Client,
    ClientError,
    JobDismissed,
    JobFailed,
    RequestRefused,
    ServiceBusy,
    ServiceUnreachable,
    UnexpectedAnswer,
    WaitedTooLong,
)
from tests.client.scripted import Broken, Script, answer, asynchronous, blocking, lines

SYSTEM = {"coordinates": ["x"], "equations": {"x": "-x"}}
RESULT = ResultDocument(system=None, verdict="variational").model_dump(mode="json")
PROBLEM = {
    "type": "urn:inverse-service:problem:bad-input",
    "title": "The document cannot be accepted",
    "status": 422,
    "detail": "omega is not declared.",
    "errors": [{"pointer": "/equations/x", "column": 6, "detail": "omega is not declared."}],
}
BATCH = {"id": "b", "status": "accepted", "total": 3, "counts": {"accepted": 3}}
both = pytest.mark.parametrize("ask", [blocking, asynchronous])


def job(status: str, **more: Any) -> dict[str, Any]:
    return {
        "id": "abc",
        "kind": "solve",
        "status": status,
        "progress": None,
        "result": None,
        **more,
    }


@both
def test_a_quick_result_comes_with_the_first_answer(ask: Any) -> None:
    script = Script([answer(200, RESULT)])
    assert ask(script, "solve", SYSTEM, time_limit=3.5) == RESULT
    (request,) = script.requests
    assert (request.method, request.url.path, request.url.query) == (
        "POST",
        "/v1/solve",
        b"time_limit=3.5",
    )
    assert request.headers["prefer"] == "wait=20"


@both
def test_a_slow_result_is_waited_for(ask: Any) -> None:
    script = Script(
        [
            answer(202, job("accepted"), location="/v1/jobs/abc", retry_after="1"),
            answer(202, job("running", progress={"stage": "decision"})),
            answer(200, job("successful", result=RESULT)),
        ]
    )
    assert ask(script, "solve", SYSTEM).verdict == "variational"
    assert [request.url.path for request in script.requests] == [
        "/v1/solve",
        "/v1/jobs/abc",
        "/v1/jobs/abc",
    ]


@both
def test_submit_does_not_wait(ask: Any) -> None:
    script = Script([answer(202, job("accepted"), location="http://service/v1/jobs/abc")])
    found = ask(script, "submit", SYSTEM, fresh=True)
    assert (found.id, found.kind, found.status) == ("abc", "solve", "accepted")
    assert script.requests[0].headers["prefer"] == "respond-async"
    assert script.requests[0].headers["cache-control"] == "no-cache"


@both
def test_a_busy_or_absent_service_is_asked_again(ask: Any) -> None:
    script = Script(
        [
            answer(503, PROBLEM, retry_after="0"),
            httpx.ConnectError("refused"),
            answer(429, PROBLEM, retry_after="1"),
            answer(200, RESULT),
        ]
    )
    begin = time.monotonic()
    assert ask(script, "solve", SYSTEM).verdict == "variational"
    assert time.monotonic() - begin >= 1.0, "the client ignored Retry-After"
    assert len({request.content for request in script.requests}) == 1


@both
def test_patience_ends(ask: Any) -> None:
    with pytest.raises(ServiceBusy, match="omega") as busy:
        ask(Script([answer(503, PROBLEM, retry_after="3600")]), "solve", SYSTEM)
    assert busy.value.status == 503
    assert busy.value.retry
    with pytest.raises(ServiceUnreachable, match="no service at"):
        ask(Script([httpx.ConnectError("refused")] * 99), "solve", SYSTEM, patience=0.3)


@both
def test_a_refusal_is_not_repeated_and_carries_its_problem(ask: Any) -> None:
    with pytest.raises(RequestRefused, match="/equations/x, column 6: omega") as refused:
        ask(Script([answer(422, PROBLEM)]), "solve", SYSTEM)
    assert refused.value.problem is not None
    assert refused.value.problem.errors[0].column == 6
    with pytest.raises(RequestRefused, match="status 403") as refused:
        ask(Script([httpx.Response(403, text="<html>")]), "solve", SYSTEM)
    assert refused.value.status == 403


@both
def test_the_ends_of_a_job_are_distinguished(ask: Any) -> None:
    failed = job(
        "failed",
        problem={"type": "urn:x", "title": "t", "status": 500, "detail": "three crashes", "new": 1},
    )
    with pytest.raises(JobFailed, match="three crashes"):
        ask(Script([answer(200, failed)]), "wait", "abc")
    with pytest.raises(JobDismissed):
        ask(Script([answer(200, job("dismissed"))]), "wait", "abc")
    with pytest.raises(WaitedTooLong, match=r"0\.2 s"):
        ask(Script([answer(202, job("running")) for _ in range(20)]), "wait", "abc", timeout=0.2)


@both
@pytest.mark.parametrize(
    ("status", "body", "headers"),
    [(200, "<html>", {}), (200, "[]", {}), (302, "", {"location": "/x"}), (202, "{}", {})],
)
def test_a_foreign_response_is_reported_as_unexpected(
    ask: Any, status: int, body: str, headers: dict[str, str]
) -> None:
    with pytest.raises(UnexpectedAnswer, match="version"):
        ask(Script([httpx.Response(status, text=body, headers=headers)]), "solve", SYSTEM)


@both
def test_fields_of_a_newer_service_are_attributes_too(ask: Any) -> None:
    newer = {**RESULT, "poetry": "none", "lagrangian": {"text": "L", "latex": "L", "sound": 1}}
    found = ask(Script([answer(200, newer)]), "solve", SYSTEM)
    assert (found.lagrangian.text, found.poetry) == ("L", "none")
    with pytest.raises(AttributeError, match="no prose"):
        _ = found.prose


@both
def test_checks_and_simulations_are_asked_for_too(ask: Any) -> None:
    valid = {"verdict": "valid", "reasons": []}
    assert ask(Script([answer(200, valid)]), "check", RESULT).verdict == "valid"
    scene = {"format": "inverse-service/trajectories/1", "methods": []}
    assert ask(Script([answer(200, scene)]), "simulate", {}) == scene


@both
def test_events_go_on_where_a_connection_broke(ask: Any) -> None:
    first = Broken(
        b'id: 1\nevent:progress\ndata: {"stage"',
        b': \ndata: "decision\xe2\x80\xa8"}\r\nretry: 5\n\n: beat\n\nid: 2\nevent: prog',
    )
    rest = b'id: 2\nevent: progress\ndata: {"order": 2}\n\nid: 3\nevent: status\ndata: {"status": "successful"}\n\n'
    script = Script([httpx.Response(200, stream=first), httpx.Response(200, content=rest)])
    events = ask(script, "stream", "abc")
    assert [(event.kind, event.data) for event in events] == [
        ("progress", {"stage": "decision\u2028"}),
        ("progress", {"order": 2}),
        ("status", {"status": "successful"}),
    ]
    assert script.requests[1].headers["last-event-id"] == "1"


@both
def test_events_end_with_the_job_even_if_the_last_one_is_lost(ask: Any) -> None:
    stream = b'id: 1\ndata: {"stage": "search"}\n\n'
    script = Script(
        [
            httpx.Response(200, content=stream),
            answer(200, job("successful", result=RESULT)),
            httpx.Response(200, content=b""),
        ]
    )
    assert [event.data for event in ask(script, "stream", "abc")] == [{"stage": "search"}]


@both
def test_a_batch_is_handed_out_once_through_a_broken_stream(ask: Any) -> None:
    one, two = {"id": "a", "line": 1, **RESULT}, {"id": "b", "line": 2, **RESULT}
    bad = {
        "id": None,
        "line": 3,
        "error": {"type": "bad-input", "detail": "Line 3: no.", "errors": []},
    }
    script = Script(
        [
            answer(202, BATCH, location="/v1/batches/b"),
            httpx.Response(200, stream=Broken(lines(two), lines(one)[:40])),
            answer(503, PROBLEM, retry_after="0"),
            httpx.Response(200, content=lines(two, one, bad)),
        ]
    )
    found = ask(script, "batch", [SYSTEM, SYSTEM, {}])
    assert [(found.id, found.line) for found in found] == [("b", 2), ("a", 1), (None, 3)]
    assert [answer.result for answer in found] == [RESULT, RESULT, None]
    assert found[2].problem.detail == "Line 3: no."
    assert script.requests[0].content.count(b"\n") == 3


@both
def test_a_finished_batch_without_results_is_not_an_answer(ask: Any) -> None:
    done = {**BATCH, "status": "successful", "counts": {"successful": 3}}
    empty = httpx.Response(200, content=b"")
    script = Script(
        [answer(202, BATCH), empty, answer(200, done), httpx.Response(200, content=b"")]
    )
    with pytest.raises(UnexpectedAnswer, match="3 of 3"):
        ask(script, "batch", [SYSTEM] * 3)


@both
def test_an_empty_batch_has_no_answers(ask: Any) -> None:
    assert ask(Script([answer(202, {**BATCH, "total": 0, "counts": {}})]), "batch", []) == []


def test_the_key_is_sent_and_ids_cannot_leave_their_place() -> None:
    script = Script(
        [answer(200, {"id": "b", "total": 1}), answer(200, job("dismissed")), answer(200, {"a": 1})]
    )
    with Client(
        "http://service/", api_key="secret", transport=httpx.MockTransport(script)
    ) as client:
        client.cancel(client.submit_batch([]))
        client.cancel("../../x?y#z")
    assert script.requests[0].headers["authorization"] == "Bearer secret"
    assert [request.url.raw_path for request in script.requests[1:]] == [
        b"/v1/batches/b",
        b"/v1/jobs/..%2F..%2Fx%3Fy%23z",
    ]


@pytest.mark.parametrize("address", ["", "localhost:8000", "ftp://x", "/v1"])
def test_an_address_without_http_is_refused(address: str) -> None:
    with pytest.raises(ClientError, match="http://"):
        Client(address)


def test_both_clients_have_the_same_methods() -> None:
    def methods(client: type) -> dict[str, list[str]]:
        found = inspect.getmembers(client, inspect.isfunction)
        return {
            name: list(inspect.signature(f).parameters)
            for name, f in found
            if not name.startswith("_")
        }

    assert methods(Client) == methods(AsyncClient)
    assert len(methods(Client)) > 10


def test_the_timeout_of_a_call_also_holds_without_a_server() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:  # accepts connections and never responds
        for address in (f"http://127.0.0.1:{silent.getsockname()[1]}", "http://127.0.0.1:9"):
            with Client(address) as client, pytest.raises(ServiceUnreachable):
                client.solve({"equations": "x'' = -x"}, timeout=0.3)


def test_the_help_of_a_method_lists_its_arguments() -> None:
    assert str(inspect.signature(Client.wait)).startswith("(self, job: 'Answer | str', *, timeout")
    assert (Client.wait.__doc__ or "").startswith("The result of a job.")
    assert Client.wait.__doc__ == AsyncClient.wait.__doc__
