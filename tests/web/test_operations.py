"""Keys, bounds for each client, logs, a second service on one database, and a shutdown with open
streams.
"""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest

from inverse_service.settings import hash_of_key
from tests.serving import COMMAND, HARD, environment_of, serving, until

EASY = {"coordinates": ["x"], "equations": {"x": "-x"}}
ALICE, BOB = {"Authorization": "Bearer alice-key"}, {"X-API-Key": "bob-key"}
ASYNC = {"Prefer": "respond-async"}


@dataclass(frozen=True)
class Guarded:
    """A service with keys and small bounds."""

    process: subprocess.Popen[str]
    address: str
    settings: dict[str, str]
    log: Path


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Guarded]:
    folder = tmp_path_factory.mktemp("guarded")
    settings = {
        "database": str(folder / "jobs.sqlite"),
        "api_keys": f"alice:{hash_of_key('alice-key')}, bob:{hash_of_key('bob-key')}",
        "client_queue": "3",
        "client_running": "1",
        "cors_origins": "https://a.example",
    }
    log = folder / "log"
    with log.open("wb") as stream, serving(stderr=stream, **settings) as (process, address):
        yield Guarded(process, address, settings, log)


@pytest.fixture(scope="module")
def client(guarded: Guarded) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=guarded.address, timeout=30) as client:
        yield client


def test_without_a_good_key_nothing_under_v1_is_answered(client: httpx.Client) -> None:
    for headers in (
        {},
        {"Authorization": "Bearer wrong"},
        {"Authorization": "Basic alice-key"},
        {"X-API-Key": ""},
    ):
        for call in (
            client.get("/v1/jobs", headers=headers),
            client.post("/v1/solve", json=EASY, headers=headers),
        ):
            assert (call.status_code, call.json()["type"]) == (
                401,
                "urn:inverse-service:problem:key",
            )
            assert call.headers["www-authenticate"].startswith("Bearer")
    until(lambda: client.get("/readyz").status_code != 503)
    for place in ("/livez", "/readyz", "/metrics", "/openapi.json"):
        assert client.get(place).status_code == 200
    assert client.get("/v1/jobs", headers=ALICE).status_code == 200


def test_a_client_sees_and_cancels_its_own_jobs_only(client: httpx.Client) -> None:
    place = client.post(
        "/v1/solve", json=HARD | {"name": "alice's"}, headers=ALICE | ASYNC
    ).headers["location"]
    identifier = place.rpartition("/")[2]
    assert identifier in {job["id"] for job in client.get("/v1/jobs", headers=ALICE).json()["jobs"]}
    assert identifier not in {
        job["id"] for job in client.get("/v1/jobs", headers=BOB).json()["jobs"]
    }
    assert client.delete(place, headers=BOB).status_code == 404
    assert client.delete(place, headers=ALICE).json()["status"] == "dismissed"


def test_a_client_with_too_many_open_jobs_is_told_to_wait_and_others_are_not(
    client: httpx.Client,
) -> None:
    def ask(k: int, who: dict[str, str]) -> httpx.Response:
        return client.post("/v1/solve", json=HARD | {"name": f"many {k}"}, headers=who | ASYNC)

    places = [ask(k, ALICE).headers["location"] for k in range(3)]
    refused = ask(3, ALICE)
    assert (refused.status_code, refused.json()["type"]) == (
        429,
        "urn:inverse-service:problem:too-many-jobs",
    )
    assert int(refused.headers["retry-after"]) > 0
    # One job of a client runs at a time: the other worker is free for bob.
    assert (
        client.post("/v1/solve", json=EASY, headers=BOB | {"Prefer": "wait=20"}).status_code == 200
    )
    statuses = [client.get(place, headers=ALICE).json()["status"] for place in places]
    assert sorted(statuses) == ["accepted", "accepted", "running"]
    for place in places:
        client.delete(place, headers=ALICE)
    accepted = ask(3, ALICE)
    assert accepted.status_code == 202
    client.delete(accepted.headers["location"], headers=ALICE)  # else it runs to its time limit


def test_another_page_may_call_where_the_settings_say_so(client: httpx.Client) -> None:
    headers = {"Origin": "https://a.example", "Access-Control-Request-Method": "DELETE"}
    answer = client.options("/v1/jobs/0", headers=headers)
    assert answer.headers["access-control-allow-origin"] == "https://a.example"
    assert "DELETE" in answer.headers["access-control-allow-methods"]
    assert (
        "access-control-allow-origin"
        not in client.get("/livez", headers={"Origin": "https://b.example"}).headers
    )


def test_every_answer_tells_the_browser_to_be_strict(client: httpx.Client) -> None:
    for place in ("/livez", "/v1/jobs", "/nothing"):
        headers = client.get(place).headers
        assert "default-src 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert "server" not in headers


def test_a_header_of_a_hundred_kilobytes_is_refused(client: httpx.Client) -> None:
    assert client.get("/livez", headers={"X-Long": "a" * 100_000}).status_code == 431


def test_a_large_header_that_comes_in_parts_is_refused_alike(guarded: Guarded) -> None:
    """The response comes before the header has ended, and later input does not destroy it."""
    port = int(guarded.address.rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port), timeout=30) as sent:
        sent.sendall(b"GET /livez HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Long: " + b"a" * 48_000)
        answer = sent.recv(65_536)
        sent.sendall(b"a" * 60_000 + b"\r\n\r\n")
        while more := sent.recv(65_536):
            answer += more
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 431 ")
    assert json.loads(body)["status"] == 431


POST = b"POST /v1/parse HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"


@pytest.mark.parametrize(
    "sent",
    [
        b"GET /\r\n\r\n",
        b"GET /livez HTTP/1.1\r\n\r\n",
        b"GET /livez HTTP/1.1\r\nHost : 127.0.0.1\r\n\r\n",
        POST + b"Content-Length: many\r\n\r\n",
        POST + b"Transfer-Encoding: chunked\r\n\r\nzz\r\nabc\r\n0\r\n\r\n",
    ],
)
def test_input_that_is_not_http_gets_a_problem_document(service: str, sent: bytes) -> None:
    with socket.create_connection(
        ("127.0.0.1", int(service.rpartition(":")[2])), timeout=30
    ) as connection:
        connection.sendall(sent)
        answer = b"".join(iter(lambda: connection.recv(65_536), b""))
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 400 Bad Request")
    assert b"content-type: application/problem+json" in head
    assert b"x-content-type-options: nosniff" in head.lower()
    assert json.loads(body)["status"] == 400


def test_the_next_head_may_begin_right_after_a_large_body(service: str) -> None:
    body = b'{"equations": "x\'\'=-x"' + b" " * 60_000 + b"}"
    with socket.create_connection(
        ("127.0.0.1", int(service.rpartition(":")[2])), timeout=30
    ) as sent:
        sent.sendall(POST + b"Content-Length: %d\r\n\r\n" % len(body) + body + POST)
        answer = sent.recv(65_536)
        sent.sendall(b"Connection: close\r\nContent-Length: %d\r\n\r\n" % len(body) + body)
        answer += b"".join(iter(lambda: sent.recv(65_536), b""))
    assert answer.count(b"HTTP/1.1 200") == 2


@pytest.mark.parametrize(("lines", "status"), [(400, b"200"), (7_000, b"431")])
@pytest.mark.parametrize("size", [1_000, 100_000])
def test_a_head_of_thousands_of_lines_is_refused(
    service: str, lines: int, status: bytes, size: int
) -> None:
    """Lines of the body do not count, for any split into parts."""
    port = int(service.rpartition(":")[2])
    body = b'{"equations": "x\'\'=-x"' + b"\n" * 2_000 + b"}"
    head = b"POST /v1/parse HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
    head += b"Content-Length: %d\r\n" % len(body) + b"a:\r\n" * lines + b"\r\n"
    for shift in range(4):
        data = head + body
        with socket.create_connection(("127.0.0.1", port), timeout=30) as sent:
            sent.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            first = len(head) - shift
            for part in (data[:first], data[first:]):
                for begin in range(0, len(part), size):
                    sent.sendall(part[begin : begin + size])
            answer = sent.recv(65_536)
        assert answer.startswith(b"HTTP/1.1 " + status), answer[:80]


@pytest.mark.slow
def test_a_second_service_on_the_same_database_says_so(guarded: Guarded) -> None:
    run = subprocess.run(
        COMMAND, capture_output=True, text=True, env=environment_of(guarded.settings), timeout=60
    )
    assert run.returncode == 2
    assert "INVERSE_SERVICE_DATABASE" in run.stderr
    assert "Traceback" not in run.stderr


def test_the_log_is_json_with_the_ids_of_jobs(client: httpx.Client, guarded: Guarded) -> None:
    response = client.post("/v1/solve", json=EASY, headers=BOB | {"Prefer": "wait=20"})
    identifier = response.headers["location"].rpartition("/")[2]
    until(
        lambda: f'"job": "{identifier}"' in guarded.log.read_text()
    )  # the answer may be sent before it is logged
    records = [json.loads(line) for line in guarded.log.read_text().splitlines()]
    ended = [record for record in records if record.get("job") == identifier]
    assert ended[-1]["what"] == "job ended"
    assert {"time", "level", "where", "kind", "outcome", "wall", "cpu", "memory", "attempt"} <= set(
        ended[-1]
    )
    assert "alice-key" not in guarded.log.read_text()


def test_every_request_has_an_id_in_its_answer_and_in_the_access_log(
    client: httpx.Client, guarded: Guarded
) -> None:
    trace = "4bf92f3577b34da6a3ce929d0e0e4736"
    sent = (
        {"X-Request-Id": "mine-1"},
        {"traceparent": f"00-{trace}-00f067aa0ba902b7-01"},
        {"X-Request-Id": "no good"},
    )
    ids = [
        client.get("/v1/limits", headers=headers | ALICE).headers["x-request-id"]
        for headers in sent
    ]
    assert (ids[0], ids[1]) == ("mine-1", trace)
    assert len(ids[2]) == 32
    assert client.get("/v1/limits", headers={"X-API-Key": "guess"}).status_code == 401
    until(lambda: '"status": 401' in guarded.log.read_text())
    records = [json.loads(line) for line in guarded.log.read_text().splitlines()]
    lines = {record.get("request"): record for record in records if record["what"] == "request"}
    assert {lines[id]["client"] for id in ids} == {"alice"}
    assert (lines["mine-1"]["path"], lines["mine-1"]["status"]) == ("/v1/limits", 200)
    assert [r["client"] for r in records if r["what"] == "request" and r["level"] == "warning"][
        -1
    ] == "127.0.0.1"


def test_leaving_a_page_during_its_response_is_not_an_error(
    client: httpx.Client, guarded: Guarded
) -> None:
    headers = ALICE | {"X-Request-Id": "left", "Sec-Fetch-Site": "same-origin"}
    with pytest.raises(httpx.ReadTimeout):
        client.post(
            "/answer",
            data={"kind": "equations", "equations": json.dumps(HARD)},
            headers=headers,
            timeout=0.3,
        )
    for _ in range(50):
        lines = [json.loads(line) for line in guarded.log.read_text().splitlines()]
        if found := [
            line for line in lines if line.get("request") == "left" and line["what"] == "request"
        ]:
            break
        time.sleep(0.1)
    assert [line["status"] for line in found] == [499]


def test_an_operator_sees_what_holds_up_the_service(client: httpx.Client) -> None:
    client.post("/v1/parse", json=EASY, headers=ALICE)
    # Labels of jobs are there from the first one on.
    client.post("/v1/solve", json=EASY, headers=ALICE | {"Prefer": "wait=20"})
    text = client.get("/metrics").text
    names = {
        line.split("{")[0].split(" ")[0] for line in text.splitlines() if not line.startswith("#")
    }
    assert names >= {
        "inverse_service_loop_lag_seconds_count", "inverse_service_queue_age_seconds", "inverse_service_connections",
        "inverse_service_store_bytes", "inverse_service_store_seconds_count", "inverse_service_quick_waiting",
        "inverse_service_quick_tasks_total", "process_cpu_seconds_total",
        "inverse_service_worker_deaths_total", "inverse_service_http_requests_total",
    }  # fmt: skip
    assert 'inverse_service_quick_tasks_total{outcome="done",task="parse_task"}' in text
    assert (
        'inverse_service_http_requests_total{method="POST",route="/v1/parse",status="200"}' in text
    )
    of_families = {name.removesuffix("_count") for name in names} | names
    asked = re.compile(r"\b(?:inverse_service|process)_[a-z_]+")
    for file in ("alerts.yaml", "dashboard.json"):
        used = {*asked.findall((Path(__file__).parents[2] / "deploy" / file).read_text())}
        assert len(used) >= 10
        assert {name.removesuffix("_bucket") for name in used} <= of_families, file
    assert float(text.split("\ninverse_service_connections ")[1].split("\n")[0]) >= 1


def test_another_host_name_is_not_answered_to(client: httpx.Client) -> None:
    for host in ("attacker.example", "attacker.example:80", "127.0.0.1.attacker.example"):
        assert client.get("/livez", headers={"Host": host}).status_code == 421
    for host in ("localhost", "LOCALHOST:1", "127.0.0.1:9"):
        assert client.get("/livez", headers={"Host": host}).status_code == 200


@pytest.mark.slow
def test_who_says_to_come_from_elsewhere_is_not_believed(
    client: httpx.Client, guarded: Guarded
) -> None:
    client.get("/v1/limits", headers={"X-API-Key": "guess", "X-Forwarded-For": "8.8.8.8"})
    records = [json.loads(line) for line in guarded.log.read_text().splitlines()]
    assert "8.8.8.8" not in {record.get("client") for record in records}


@pytest.mark.slow
def test_a_cookie_of_another_program_may_hold_any_bytes(client: httpx.Client) -> None:
    for name in (b"Cookie", b"Authorization", b"X-API-Key"):
        answer = client.get("/", headers=[(name, b"name=J\xe9r\xf4me")])  # type: ignore[list-item]
        assert answer.status_code in (200, 303)


def open_jobs(client: httpx.Client) -> int:
    """The number of bob's jobs without an answer."""
    jobs = client.get("/v1/jobs", headers=BOB).json()["jobs"]
    return sum(job["status"] in ("accepted", "running") for job in jobs)


@pytest.mark.slow
def test_a_stopped_service_ends_its_streams_and_keeps_its_jobs(
    client: httpx.Client, guarded: Guarded
) -> None:
    place = client.post("/v1/solve", json=HARD | {"name": "open"}, headers=BOB | ASYNC).headers[
        "location"
    ]
    found: list[Any] = []

    def listen() -> None:
        with httpx.stream(
            "GET", guarded.address + place + "/events", headers=BOB, timeout=30
        ) as stream:
            found.extend(stream.iter_lines())

    def wait() -> None:
        document = HARD | {"name": "waiting"}
        headers = BOB | {"Prefer": "wait=19"}  # after 20 s our clients ask again
        found.append(
            httpx.post(
                guarded.address + "/v1/solve", json=document, headers=headers, timeout=30
            ).status_code
        )

    threads = [threading.Thread(target=work) for work in (listen, wait)]
    for thread in threads:
        thread.start()
    until(lambda: found and open_jobs(client) >= 2)
    guarded.process.send_signal(signal.SIGTERM)
    assert guarded.process.wait(60) == 0
    for thread in threads:
        thread.join(60)
    assert 202 in found
    with serving(**guarded.settings) as (_, address):
        assert httpx.get(address + place, headers=BOB, timeout=30).json()["status"] in (
            "accepted",
            "running",
        )
