"""Heads of requests that no application sees: of two readings a proxy may believe the other."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from inverse_service.web import middleware

HOST = (b"host", b"service.example")
CHUNKED, LENGTH = (b"transfer-encoding", b"chunked"), (b"content-length", b"5")


def status_of(
    *heads: tuple[bytes, bytes],
    version: str = "1.1",
    hosts: frozenset[str] = frozenset(),
    **more: Any,
) -> int | None:
    """The status with which a head is refused, None where it is not."""
    scope = {"type": "http", "headers": [*heads], "http_version": version, "query_string": b"",
             "path": "/livez", **more}  # fmt: skip
    entrance: Any = SimpleNamespace(_hosts=hosts)
    found = middleware.Entrance._refusal(entrance, scope)
    return None if found is None else found.status_code


@pytest.mark.parametrize(
    ("heads", "status"),
    [
        ([LENGTH], None),
        ([CHUNKED], None),
        ([(b"transfer-encoding", b"Chunked")], None),
        ([CHUNKED, LENGTH], 400),
        ([LENGTH, CHUNKED], 400),
        ([CHUNKED, CHUNKED], 400),
        ([(b"transfer-encoding", b"gzip, chunked")], 400),
        ([(b"transfer-encoding", b"identity")], 400),
    ],
)
def test_a_body_has_one_length(heads: list[tuple[bytes, bytes]], status: int | None) -> None:
    assert status_of(HOST, *heads) == status


def test_there_is_one_host() -> None:
    assert status_of() == 400
    assert status_of(HOST, HOST) == 400
    assert status_of(version="1.0") is None
    assert status_of(HOST, HOST, version="1.0") == 400
    assert status_of(HOST, hosts=frozenset({"service.example"})) is None
    assert status_of(HOST, hosts=frozenset({"*"})) is None
    assert status_of(HOST, hosts=frozenset({"other.example"})) == 421


def test_as_many_and_as_large_headers_as_may_be_are_let_through() -> None:
    rest = [(b"a", b"")] * (middleware.MOST_HEADERS - 1)
    assert status_of(HOST, *rest) is None
    assert status_of(HOST, *rest, (b"a", b"")) == 431
    size = middleware.LARGEST_HEADERS - sum(map(len, HOST)) - 1
    assert status_of(HOST, (b"a", b"x" * size)) is None
    assert status_of(HOST, (b"a", b"x" * (size + 1))) == 431


def test_a_nul_is_in_no_address() -> None:
    assert status_of(HOST, path="/a\x00b") == 404
    assert status_of(HOST, query_string=b"x=%00") == 422
