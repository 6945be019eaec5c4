"""No request body stops the service for other clients or exhausts its memory."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest

from tests.attacks.harness import Attacked, Watch, attacked

JSON = "application/json"
FORM = "application/x-www-form-urlencoded"
MULTIPART = "multipart/form-data; boundary=zz"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Attacked]:
    with attacked(tmp_path_factory.mktemp("bodies"), waiting="64") as found:
        yield found


def upload(name: str, data: bytes) -> bytes:
    head = f'--zz\r\nContent-Disposition: form-data; name="document"; filename="{name}"\r\n\r\n'
    return head.encode() + data + b"\r\n--zz--\r\n"


def field(name: str, data: bytes) -> bytes:
    return (
        f'--zz\r\nContent-Disposition: form-data; name="{name}"\r\n\r\n'.encode()
        + data
        + b"\r\n--zz--\r\n"
    )


def dotted(parts: int) -> bytes:
    """A TOML key for which tomllib needs memory quadratic in the number of its parts."""
    return upload("d.toml", b".".join([b"a"] * parts) + b"=1")


def filled(before: bytes, part: bytes, after: bytes, size: int) -> bytes:
    return before + part * ((size - len(before) - len(after)) // len(part)) + after


SYSTEM = b'{"coordinates":["x"],"equations":{"x":"0"},'
ATTACKS = {
    "TOML with a key of 20,000 parts": ("/", MULTIPART, dotted(20_000)),
    "TOML with a key of 20,000 parts, echoed": ("/understood", MULTIPART, dotted(20_000)),
    "TOML of nested lists": ("/", MULTIPART, upload("d.toml", b"a=" + b"[" * 400_000)),
    "YAML with a list": ("/", MULTIPART, upload("d.yaml", filled(b"[", b"a,", b"a]", 90_000))),
    "YAML that is nested": ("/", MULTIPART, upload("d.yaml", b"[" * 100_000)),
    "JSON upload of empty lists": (
        "/",
        MULTIPART,
        upload("d.json", filled(b"[", b"[],", b"1]", 990_000)),
    ),
    "a long field": ("/understood", MULTIPART, field("ansatz", b"x'^2+" * 120_000)),
    "a field of many equations": (
        "/understood",
        MULTIPART,
        field("equations", b"x''=-x;" * 100_000),
    ),
    "a form of escaped characters": ("/understood", FORM, b"equations=" + b"%41" * 300_000),
    "objects in a system": (
        "/v1/solve",
        JSON,
        filled(SYSTEM + b'"a":[', b'{"a":1},', b"1]}", 190_000),
    ),
    "escaped quotes": ("/v1/parse", JSON, filled(b'{"a":"', b'\\"', b'"}', 990_000)),
    "a string that does not end": ("/v1/parse", JSON, filled(b'{"a":"', b'\\"', b"", 990_000)),
}
LARGE = {
    "many objects in a system": (
        "/v1/solve",
        JSON,
        filled(SYSTEM + b'"a":[', b'{"a":1},', b"1]}", 990_000),
    ),
    "YAML with a long list": (
        "/",
        MULTIPART,
        upload("d.yaml", filled(b"[", b"a,", b"a]", 990_000)),
    ),
    "empty lists to check": ("/v1/check", JSON, filled(b'{"a":[', b"[],", b"1]}", 10_000_000)),
    "one string to check": ("/v1/check", JSON, filled(b'{"a":"', b"0", b'"}', 10_000_000)),
    "a batch that is one string": ("/v1/batches", JSON, filled(b'["', b"0", b'"]', 16_000_000)),
    "a batch of empty lists": ("/v1/batches", JSON, filled(b"[", b"[],", b"1]", 16_000_000)),
    "objects in a scene": ("/v1/simulate", JSON, filled(b'{"a":[', b'{"a":1},', b"1]}", 5_000_000)),
    "a batch as a form of escaped characters": ("/batch", FORM, b"lines=" + b"%41" * 5_000_000),
}


@pytest.mark.parametrize(
    "name", [*ATTACKS, *(pytest.param(name, marks=pytest.mark.nightly) for name in LARGE)]
)
def test_a_body_delays_no_other_client(service: Attacked, name: str) -> None:
    address, content_type, body = {**ATTACKS, **LARGE}[name]
    with Watch(service) as watch, service.client() as client:
        answers = [
            client.post(address, content=body, headers={"Content-Type": content_type})
            for _ in range(2)
        ]
    assert {answer.status_code for answer in answers} <= {200, 202, 303, 400, 413, 422}
    watch.hold()


@pytest.mark.slow
def test_a_check_says_that_it_is_json(service: Attacked) -> None:
    with service.client() as client:
        answer = client.post("/v1/check", content=b"{}", headers={"Content-Type": "text/plain"})
    assert answer.status_code == 415


@pytest.mark.nightly
def test_bodies_that_one_client_leaves_half_sent_are_bounded(service: Attacked) -> None:
    head = b"POST /v1/solve HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: 990000"
    connections = []
    with Watch(service) as watch:
        for _ in range(200):
            connection = socket.create_connection(("127.0.0.1", service.port))
            connections.append(connection)
            try:
                connection.sendall(head + b"\r\n\r\n" + b" " * 900_000)
            except OSError:  # rejected with 429
                continue
        with service.other() as client:
            answer = client.post("/v1/parse", json={"coordinates": ["x"], "equations": {"x": "-x"}})
        assert answer.status_code == 200
    for connection in connections:
        connection.close()
    watch.hold()
