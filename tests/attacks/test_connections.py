"""Connections that send nothing, send slowly, or are too many."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from inverse_service.web import connections as timing
from tests.attacks.harness import Attacked, Watch, attacked, is_open

HEAD = b"POST /v1/parse HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: 500000\r\n\r\n"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Attacked]:
    folder = tmp_path_factory.mktemp("connections")
    with attacked(folder, connections="80", client_connections="60") as found:
        yield found


def opened(
    service: Attacked, count: int, first: bytes = b"", source: str = "127.0.0.1"
) -> list[socket.socket]:
    found = [
        socket.create_connection(("127.0.0.1", service.port), source_address=(source, 0))
        for _ in range(count)
    ]
    for connection in found:
        connection.sendall(first)
    return found


def close(connections: list[socket.socket]) -> None:
    for connection in connections:
        connection.close()


@pytest.mark.slow
def test_one_address_has_so_many_connections_and_others_have_theirs(service: Attacked) -> None:
    with Watch(service) as watch:
        mine = opened(service, 100)
        time.sleep(0.3)
        head, _, body = mine[-1].recv(4096).partition(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 503")
        assert b"retry-after: 5" in head.lower()
        assert json.loads(body)["type"] == "urn:inverse-service:problem:busy"
        assert sum(map(is_open, mine)) == 60
    close(mine)
    watch.hold()


@pytest.mark.slow
def test_where_all_places_are_taken_the_longest_silent_one_is_closed(service: Attacked) -> None:
    found = [
        connection for k in range(2, 5) for connection in opened(service, 40, source=f"127.0.0.{k}")
    ]
    time.sleep(0.3)
    with service.client() as client:
        assert client.get("/livez").status_code == 200
    assert 60 <= sum(map(is_open, found)) <= 80
    close(found)


CHUNKED = HEAD.replace(b"Content-Length: 500000", b"Transfer-Encoding: chunked")
DOCUMENT = b'{"coordinates":["x"],"equations":{"x":"-x"}}'


def in_chunks_of_one_byte(body: bytes) -> bytes:
    return CHUNKED + b"".join(b"1\r\n%c\r\n" % byte for byte in body) + b"0\r\n\r\n"


@pytest.mark.slow
def test_a_document_in_chunks_of_one_byte_is_read(service: Attacked) -> None:
    body = DOCUMENT + b" " * 20_000
    with socket.create_connection(("127.0.0.1", service.port)) as connection:
        connection.sendall(in_chunks_of_one_byte(body))
        connection.settimeout(30)
        answer = connection.recv(65_536)
    assert answer.startswith(b"HTTP/1.1 200 "), answer


@pytest.mark.slow
def test_a_client_that_offers_http_2_is_answered_in_http_1(service: Attacked) -> None:
    """Java's client offers it with its first request, also with a body."""
    offer = b"\r\nConnection: Upgrade, HTTP2-Settings\r\nUpgrade: h2c\r\nHTTP2-Settings: AAMAAABkAAQAAP__\r\n\r\n"
    head = HEAD.replace(b"500000\r\n\r\n", b"%d" % len(DOCUMENT) + offer)
    with socket.create_connection(("127.0.0.1", service.port)) as connection:
        connection.settimeout(30)
        for parts in ((head + DOCUMENT,), (head, DOCUMENT)):
            for part in parts:
                connection.sendall(part)
                time.sleep(0.1)
            assert connection.recv(65_536).startswith(b"HTTP/1.1 200 ")


@pytest.mark.slow
def test_a_request_of_two_lengths_is_refused_with_all_that_follows_it(service: Attacked) -> None:
    hidden = b"GET /livez HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    with socket.create_connection(("127.0.0.1", service.port)) as connection:
        connection.sendall(HEAD[:-2] + b"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n" + hidden)
        connection.settimeout(30)
        answer = b"".join(iter(lambda: connection.recv(65_536), b""))
    assert answer.startswith(b"HTTP/1.1 400 ")
    assert answer.count(b"HTTP/1.1 ") == 1


@pytest.mark.nightly
def test_heads_and_bodies_that_do_not_come_are_not_waited_for(service: Attacked) -> None:
    began = time.monotonic()
    heads = opened(service, 5) + opened(service, 5, b"GET /livez HT")
    bodies = opened(service, 5, HEAD + b" " * 1_000)
    ends = {}
    while len(ends) < 2 and time.monotonic() - began < 60:
        for name, found in (("heads", heads), ("bodies", bodies)):
            if name not in ends and not any(map(is_open, found)):
                ends[name] = time.monotonic() - began
        time.sleep(0.2)
    close([*heads, *bodies])
    assert ends["heads"] == pytest.approx(timing.HEADERS, abs=4)
    assert ends["bodies"] == pytest.approx(timing.BODY_GRACE, abs=4)


@pytest.mark.nightly
def test_where_descriptors_are_few_the_log_stays_short(tmp_path: Path) -> None:
    with attacked(tmp_path, descriptors=256) as service:
        found = [c for k in range(2, 8) for c in opened(service, 50, source=f"127.0.0.{k}")]
        time.sleep(5)
        with service.client() as client:
            assert client.get("/livez").status_code == 200
        close(found)
        assert service.log.stat().st_size < 20_000
