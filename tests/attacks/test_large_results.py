"""The service holds only one part of a large answer at a time, however fast or slowly clients read
it.
"""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from inverse_service.service.jobs.model import BatchLine, JobOptions
from inverse_service.service.jobs.statements import batch_id
from inverse_service.service.jobs.stores import SqliteStore
from inverse_service.service.jobs.tasks import Usage, request_of
from inverse_service.service.scenes.simulating import simulate
from tests.attacks.harness import Attacked, Watch, attacked

pytestmark = pytest.mark.nightly
SCENE: dict[str, Any] = {
    "system": {"catalogue": "vertically-rolling-disk"},
    "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"},
    "initial": {
        "positions": {"phi": 0.1, "theta": 0, "x": 0, "y": 0},
        "velocities": {"phi": 1, "theta": 1},
    },
    "step": 0.05,
    "steps": 2000,
    "methods": ["variational", "nonholonomic"],
    "observe": ["trajectory", "energy", "constraints"],
}
COPIES, LINES = 24, 24
MOST = 300.0


@pytest.fixture(scope="module")
def body() -> bytes:
    """A result of 12 MB or more: one method many times, as in a scene with many methods."""
    result = simulate(SCENE, lambda report: None, 60.0)
    first = result["methods"][0]
    columns = {name: values * 4 for name, values in first["points"]["columns"].items()}
    points = first["points"] | {"columns": columns}
    methods = [first | {"label": f"variational {k}", "points": points} for k in range(COPIES)]
    found = json.dumps(result | {"methods": methods}).encode()
    assert len(found) > 12e6
    return found


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory, body: bytes) -> Iterator[Attacked]:
    folder = tmp_path_factory.mktemp("large")
    store = SqliteStore(folder / "jobs.sqlite", durable=False)
    requests = [
        request_of("simulate", SCENE | {"name": f"line {k}"}, JobOptions()) for k in range(LINES)
    ]
    lines = [
        BatchLine(k, json.dumps(f"line {k}"), request) for k, request in enumerate(requests, 1)
    ]
    (folder / "ids").write_text("\n".join([batch_id("simulate", "", lines, "", 0), requests[0].id]))
    store.create_batch(batch_id("simulate", "", lines, "", 0), "simulate", "", lines)
    for job in store.claim("test", LINES):
        store.finish(job.id, job.attempt, body, Usage())
    store.close()
    with attacked(folder) as found:
        yield found


def ids(service: Attacked) -> list[str]:
    """The ids of the batch and of one of its jobs."""
    return Path(service.log.parent / "ids").read_text().split()


@pytest.mark.parametrize(
    "place",
    [
        "",
        "/figures.json",
        "/figures/coordinates.svg",
        "/figures/energy.png",
        "/result.json",
        "/data/variational 0.csv",
    ],
)
def test_a_small_request_for_a_large_result_delays_no_other_client(
    service: Attacked, place: str
) -> None:
    address = f"/results/{ids(service)[1]}{place}"
    with Watch(service) as watch, service.client() as client:
        answers = [client.get(address) for _ in range(2)]
        assert {answer.status_code for answer in answers} == {200}
        if place:
            tag = {"If-None-Match": answers[0].headers["etag"]}
            assert client.get(address, headers=tag).status_code == 304
    watch.hold()
    assert watch.memory < MOST


def test_a_large_result_comes_whole(service: Attacked, body: bytes) -> None:
    batch, job = ids(service)
    with service.client() as client:
        assert client.get(f"/results/{job}/result.json").content == body
        whole = client.get(f"/v1/jobs/{job}")
        assert whole.json()["result"] == json.loads(body)
        assert int(whole.headers["content-length"]) == len(whole.content)
        assert (
            client.get(f"/v1/jobs/{job}", headers={"Prefer": "return=minimal"}).json()["result"]
            is None
        )
        with client.stream("GET", f"/v1/batches/{batch}/results") as stream:
            first = json.loads(next(stream.iter_lines()))
    assert (first["line"], first["methods"]) == (1, json.loads(body)["methods"])


def twenty_readers(service: Attacked) -> list[socket.socket]:
    request = (
        f"GET /v1/batches/{ids(service)[0]}/results HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode()
    )
    readers = [socket.create_connection(("127.0.0.1", service.port), timeout=30) for _ in range(20)]
    for reader in readers:
        reader.sendall(request)
    return readers


def test_readers_that_do_not_read_cost_one_part_each(service: Attacked) -> None:
    with Watch(service) as watch:
        readers = twenty_readers(service)
        time.sleep(3)
        for reader in readers:
            reader.close()
    watch.hold()
    assert watch.memory < MOST


def test_twenty_readers_of_all_answers(service: Attacked, body: bytes) -> None:
    with Watch(service) as watch:
        readers = twenty_readers(service)
        read = [0] * len(readers)
        while min(read) < LINES * len(body):
            for k, reader in enumerate(readers):
                if read[k] < LINES * len(body):
                    read[k] += len(reader.recv(2**20 >> (k % 5)))
        for reader in readers:
            reader.close()
    watch.hold()
    assert watch.memory < MOST
