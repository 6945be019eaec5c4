"""Dask schedulers and workers that die, freeze, or get messages from strangers, and large
results.
"""

from __future__ import annotations

import os
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.serving import until

pytest.importorskip("distributed")
from inverse_service.service.scenes.simulating import simulate
from tests.attacks.harness import Attacked, Watch, attacked
from tests.attacks.test_large_results import SCENE
from tests.cluster.processes import Cluster, dask_cluster, processes

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.filterwarnings(
        "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
    ),
]
PATIENT = {"Prefer": "wait=60"}
Both = tuple[Attacked, Cluster]


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Both]:
    folder = tmp_path_factory.mktemp("cluster")
    with (
        dask_cluster(folder, workers=1, threads=2) as machines,
        attacked(folder, cluster=machines.address) as service,
    ):
        yield service, machines


def verdict(client: httpx.Client, k: int) -> str:
    """The verdict of a new system, however long it waits."""
    question = {"coordinates": ["x"], "equations": {"x": f"-{k}*x"}}
    end = time.monotonic() + 180
    while time.monotonic() < end:
        answer = client.post("/v1/solve", json=question, headers=PATIENT)
        if answer.status_code == 200:
            return str(answer.json()["verdict"])
        assert answer.status_code in (202, 503)
    raise AssertionError("the cluster does not come back")


def test_a_large_result_comes_whole_through_the_cluster(both: Both) -> None:
    scene = SCENE | {
        "steps": 10_000,
        "methods": [{"method": "variational", "label": f"v{k}"} for k in range(24)],
    }
    with Watch(both[0]) as watch, both[0].client(timeout=300) as client:
        asked = client.post("/v1/simulate", json=scene, headers={"Prefer": "respond-async"})
        assert asked.status_code == 202, asked.text
        place, minimal = asked.headers["location"], {"Prefer": "return=minimal"}
        while (answer := client.get(place, headers=minimal)).json()["status"] in (
            "accepted",
            "running",
        ):
            time.sleep(0.5)
        assert answer.json()["status"] == "successful", answer.text
        body = client.get(place.replace("/v1/jobs", "/results") + "/result.json").content
    print(f"{len(body) / 1e6:.0f} MB")
    assert len(body) > 7e6
    watch.hold()
    small = SCENE | {"steps": 50}
    with both[0].client() as client:
        there = client.post("/v1/simulate", json=small, headers=PATIENT).json()
    here = simulate(small, lambda report: None, 60.0)
    assert [one["points"] for one in there["methods"]] == [one["points"] for one in here["methods"]]


def test_what_needs_too_much_memory_on_the_cluster_is_said_to(both: Both) -> None:
    many = SCENE | {"steps": 10**8, "methods": ["variational"]}
    with Watch(both[0]) as watch, both[0].client() as client:
        answer = client.post("/v1/simulate?time_limit=5", json=many, headers=PATIENT)
        assert answer.status_code in (200, 422), answer.text
        assert verdict(client, 3) == "variational"
    watch.hold()


def test_messages_of_strangers_to_scheduler_and_worker_are_ignored(both: Both) -> None:
    ports = [int(both[1].address.rpartition(":")[2]), *listening(both[1].workers[0].pid)]
    with Watch(both[0]) as watch, both[0].client() as client:
        for port in ports:
            for data in (b"", b"GET / HTTP/1.1\r\n\r\n", b"\xff" * 4096, bytes(8) * 1000):
                with socket.create_connection(("127.0.0.1", port)) as connection:
                    connection.sendall(data)
        assert verdict(client, 5) == "variational"
        assert client.get("/readyz").status_code == 200
    watch.hold()


def test_a_frozen_scheduler_delays_only_jobs(both: Both) -> None:
    service, machines = both
    assert machines.scheduler is not None
    with Watch(service) as watch, service.client() as client:
        os.kill(machines.scheduler.pid, signal.SIGSTOP)
        question = {"coordinates": ["x"], "equations": {"x": "-7*x"}}
        answer = client.post("/v1/solve", json=question, headers={"Prefer": "wait=5"})
        assert answer.status_code == 202
        assert (
            client.post(
                "/v1/parse", json={"coordinates": ["x"], "equations": {"x": "-x"}}
            ).status_code
            == 200
        )
        os.kill(machines.scheduler.pid, signal.SIGCONT)
        assert verdict(client, 7) == "variational"
    watch.hold()


def test_a_dead_scheduler_is_not_ready_and_a_new_one_gets_the_jobs(both: Both) -> None:
    service, machines = both
    with Watch(service) as watch, service.client() as client:
        machines.kill_scheduler()
        until(lambda: client.get("/readyz").status_code == 503)
        place = client.post(
            "/v1/solve",
            json={"coordinates": ["x"], "equations": {"x": "-11*x"}},
            headers={"Prefer": "respond-async"},
        ).headers["location"]
        machines.start_scheduler()
        machines.kill_worker()
        machines.start_worker(2)
        assert verdict(client, 11) == "variational"
        assert client.get(place).json()["status"] == "successful"
        assert client.get("/readyz").status_code == 200
    watch.hold()


def listening(session: int) -> list[int]:
    """The ports on which the processes of a session listen."""
    sockets = set()
    for pid in processes(session):
        for link in Path(f"/proc/{pid}/fd").iterdir():
            try:
                sockets.add(os.readlink(link))
            except OSError:
                continue
    found = []
    for line in Path("/proc/net/tcp").read_text().splitlines()[1:]:
        fields = line.split()
        if fields[3] == "0A" and f"socket:[{fields[9]}]" in sockets:
            found.append(int(fields[1].partition(":")[2], 16))
    return found
