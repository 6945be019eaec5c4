"""A recently answered question is answered from memory until its job changes."""

from __future__ import annotations

import threading
from typing import Any

import httpx
from starlette.responses import Response

from inverse_service.service.jobs.model import Change
from inverse_service.web.engine import KnownAnswers

SYSTEM = {"name": "known", "coordinates": ["x"], "equations": {"x": "-3*x"}}
WAIT = {"Prefer": "wait=20"}


def answers_from_store(client: httpx.Client) -> float:
    lines = client.get("/metrics").text.splitlines()
    return sum(
        float(line.split()[-1])
        for line in lines
        if line.startswith("inverse_service_answers_from_store_total")
    )


def test_the_same_bytes_have_the_same_answer_and_headers(service: str) -> None:
    with httpx.Client(base_url=service, timeout=60) as client:
        first = client.post("/v1/solve", json=SYSTEM, headers=WAIT)
        before = answers_from_store(client)
        for _ in range(3):
            again = client.post("/v1/solve", json=SYSTEM, headers=WAIT)
            assert (again.status_code, again.content) == (200, first.content)
            for name in ("location", "etag", "link", "content-type", "preference-applied", "vary"):
                assert again.headers[name] == first.headers[name]
        assert answers_from_store(client) == before + 3
        # Other options and other forms are other questions; `no-cache` computes again.
        other = client.post("/v1/solve?time_limit=5", json=SYSTEM, headers=WAIT)
        assert other.headers["location"] != first.headers["location"]
        text = client.post("/v1/solve", json=SYSTEM, headers=WAIT | {"Accept": "text/plain"})
        assert text.headers["content-type"].startswith("text/plain")
        new = client.post("/v1/solve", json=SYSTEM, headers=WAIT | {"Cache-Control": "no-cache"})
        assert new.headers["etag"] != first.headers["etag"]
        assert (
            client.post("/v1/solve", json=SYSTEM, headers=WAIT).headers["etag"]
            == new.headers["etag"]
        )


def test_what_changes_is_forgotten_and_memory_is_bounded(monkeypatch: Any) -> None:
    known = KnownAnswers()
    first = Response(b"body" * 100, headers={"ETag": "1"})
    known.keep(b"a", "job", first)
    known.keep(b"b", "job", Response(b"body"))
    known.keep(b"c", "other", Response(b"else"))
    assert known.get(b"a", "solve") is first
    known.drop(Change("job", "accepted"))
    assert (known.get(b"a", "solve"), known.get(b"b", "solve")) == (None, None)
    assert known.get(b"c", "solve") is not None
    monkeypatch.setattr("inverse_service.web.engine.MOST_BYTES", 1_000)
    threads = [
        threading.Thread(
            target=lambda n=n: [
                known.keep(b"%d of %d" % (k, n), str(k), Response(b"x" * 10)) for k in range(200)
            ]
        )
        for n in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert known.kept_bytes <= 1_000
    monkeypatch.setattr("inverse_service.web.engine.KEPT", -1.0)
    known.keep(b"d", "old", Response(b"x"))
    assert known.get(b"d", "solve") is None
