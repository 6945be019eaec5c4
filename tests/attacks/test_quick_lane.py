"""Documents whose parsing does not end delay only their own client."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Iterator

import pytest

from tests.attacks.harness import ENDLESS, FREEZE, Attacked, Watch, attacked

EASY = {"coordinates": ["x"], "equations": {"x": "-x"}}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Attacked]:
    with attacked(tmp_path_factory.mktemp("quick")) as found:
        yield found


def sent(address: str, document: object, *headers: str) -> bytes:
    body = json.dumps(document).encode()
    lines = [
        f"POST {address} HTTP/1.1",
        "Host: 127.0.0.1",
        "Content-Type: application/json",
        f"Content-Length: {len(body)}",
    ]
    return "\r\n".join([*lines, *headers, "", ""]).encode() + body


def parsed_by_another(service: Attacked) -> float:
    with service.other() as client:
        began = time.monotonic()
        assert client.post("/v1/parse", json=EASY).status_code == 200
        return time.monotonic() - began


@pytest.mark.slow
def test_256_documents_that_do_not_end_leave_parsing_and_readiness_to_others(
    service: Attacked,
) -> None:
    with Watch(service) as watch:
        service.send_and_leave(sent("/v1/parse", ENDLESS), 256, 0.5)
        with service.other() as client:
            assert client.get("/readyz").status_code == 200
            assert client.post("/v1/check", json={}).status_code == 200
        seconds = [parsed_by_another(service) for _ in range(5)]
    assert sorted(seconds)[2] < 1.0
    watch.hold()


@pytest.mark.slow
def test_many_questions_that_look_ahead_leave_readiness_alone(service: Attacked) -> None:
    requests = [ENDLESS | {"name": f"look {k}"} for k in range(30)]
    with Watch(service) as watch:
        for document in requests:
            service.send_and_leave(
                sent("/v1/solve?time_limit=0.1", document, "Prefer: respond-async"), 1, 0.0
            )
        with service.other() as client:
            assert client.get("/readyz").status_code == 200
    watch.hold()


@pytest.mark.slow
def test_jobs_at_their_limit_are_finished_while_reading_is_busy(service: Attacked) -> None:
    with Watch(service) as watch:
        service.send_and_leave(sent("/v1/parse", ENDLESS), 32, 0.1)
        for k in range(4):
            document = sent(
                "/v1/solve?time_limit=0.3",
                ENDLESS | {"name": f"finish {k}"},
                "Prefer: respond-async",
            )
            service.send_and_leave(document, 1, 0.0)
        with service.other() as client:
            began = time.monotonic()
            question = {"coordinates": ["x"], "equations": {"x": "-4*x"}}
            answer = client.post("/v1/solve", json=question, headers={"Prefer": "wait=20"})
    assert answer.status_code == 200
    assert time.monotonic() - began < 10
    watch.hold()


@pytest.mark.slow
def test_a_document_that_does_not_end_is_refused_after_its_second(service: Attacked) -> None:
    with service.client() as client:
        answer = client.post("/v1/parse", json=ENDLESS)
    assert (answer.status_code, answer.json()["type"]) == (422, "urn:inverse-service:problem:limit")


@pytest.mark.slow
def test_a_loop_that_is_held_for_a_moment_is_seen(service: Attacked) -> None:
    with Watch(service) as watch:
        os.kill(service.process.pid, signal.SIGSTOP)
        time.sleep(1.0)  # longer than the watcher may wait for a core before its first look
        os.kill(service.process.pid, signal.SIGCONT)
    assert watch.longest > FREEZE


@pytest.mark.slow
def test_the_service_ends_within_five_seconds_while_it_is_attacked(service: Attacked) -> None:
    service.send_and_leave(sent("/v1/parse", ENDLESS), 64, 0.0)
    for k in range(8):
        document = sent(
            "/v1/solve?time_limit=0.3", ENDLESS | {"name": f"end {k}"}, "Prefer: respond-async"
        )
        service.send_and_leave(document, 1, 0.0)
    time.sleep(0.5)
    assert service.seconds_to_end() < 5
