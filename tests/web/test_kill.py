"""kill -9 at random times: no accepted job is lost, none is answered twice, and no process is left
behind.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.serving import until
from tests.values import slow

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
SIZES = pytest.mark.parametrize(
    ("count", "kills"),
    [slow(60, 1), pytest.param(1000, 50, marks=pytest.mark.nightly)],
)
EXTRA = {"coordinates": ["x"], "equations": {"x": "-x^5"}}


def processes(mark: str) -> dict[int, str]:
    """Command lines of live processes with the mark in their environment."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            alive = (folder / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
            if alive and mark.encode() in (folder / "environ").read_bytes():
                found[int(folder.name)] = (
                    (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                )
    return found


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port


class Service:
    """A service on one database that can be killed and restarted."""

    def __init__(self, folder: Path) -> None:
        self.mark = f"TEST_MARK={folder.name}-{os.getpid()}-{time.monotonic_ns()}"
        name, _, value = self.mark.partition("=")
        self._environment = os.environ | {
            name: value,
            "INVERSE_SERVICE_DATABASE": str(folder / "jobs.sqlite"),
            "INVERSE_SERVICE_WORKERS": "2",
            "INVERSE_SERVICE_LOG_LEVEL": "error",
        }
        self.port = free_port()
        self.longest_end = 0.0
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{self.port}", timeout=30)
        self.start()

    def start(self) -> None:
        command = [sys.executable, "-m", "inverse_service", "serve", "--port", str(self.port)]
        self._process = subprocess.Popen(command, env=self._environment, stdout=subprocess.DEVNULL)
        end = time.monotonic() + 60
        while time.monotonic() < end:
            with contextlib.suppress(httpx.TransportError):
                if self.client.get("/livez").status_code == 200:
                    return
            time.sleep(0.02)
        raise AssertionError("the service does not start")

    def kill(self) -> list[str]:
        """Send SIGKILL; return the processes alive 20 s later, as a starting fork server first
        imports modules.
        """
        self._process.kill()
        self._process.wait()
        began = time.monotonic()
        while processes(self.mark) and time.monotonic() < began + 20:
            time.sleep(0.02)
        self.longest_end = max(self.longest_end, time.monotonic() - began)
        return list(processes(self.mark).values())

    def workers(self) -> list[int]:
        """The ids of the worker processes: children of the fork server."""
        return [
            pid
            for pid, line in processes(self.mark).items()
            if "forkserver" in line and pid != self.forking_server()
        ]

    def forking_server(self) -> int:
        """The id of the process that forks the workers; 0 if there is none at the moment."""
        servers = [pid for pid, line in processes(self.mark).items() if "forkserver" in line]
        return min(servers, default=0)

    def batch(self, place: str) -> dict[str, Any]:
        found: dict[str, Any] = self.client.get(place).json()
        return found

    def close(self) -> None:
        self.kill()
        self.client.close()


def system(k: int) -> dict[str, Any]:
    """Different questions; a few take longer, and some are repeated."""
    if k % 10 == 0:
        return {"id": k, "coordinates": ["x", "y"], "equations": {"x": f"-{k}*x+y^3", "y": "x*y'"}}
    return {"id": k, "coordinates": ["x"], "equations": {"x": f"-{k - k % 7}*x"}}


@pytest.fixture
def service(tmp_path: Path) -> Any:
    service = Service(tmp_path)
    yield service
    service.close()


def send(service: Service, count: int, prefer: str = "") -> str:
    body = "".join(json.dumps(system(k)) + "\n" for k in range(1, count + 1))
    headers = {"Content-Type": "application/x-ndjson", "Prefer": prefer}
    response = service.client.post("/v1/batches", content=body, headers=headers)
    assert response.status_code == 202
    assert response.headers.get("preference-applied", "") == prefer
    place: str = response.headers["location"]
    return place


def assert_each_line_is_answered_once(
    service: Service, place: str, count: int, most_failed: int = 0
) -> None:
    """Assert that each has a verdict, except for `most_failed` jobs whose worker was killed three
    times.
    """
    text = service.client.get(place + "/results", timeout=600).text
    lines = [
        json.loads(line) for line in text.splitlines() if line
    ]  # an empty one is a sign of life
    assert Counter(line["id"] for line in lines) == Counter(range(1, count + 1))
    failed = [line["detail"] for line in lines if "verdict" not in line]
    assert all("worker process was killed" in detail for detail in failed)
    print(f"{count} lines, each answered once, {len(failed)} without a verdict")
    assert len(failed) <= most_failed
    assert {line["verdict"] for line in lines if "verdict" in line} <= {
        "variational",
        "not_variational",
    }
    assert service.batch(place)["counts"].get("successful") == count - len(failed)


@SIZES
@pytest.mark.parametrize("prefer", ["", "respond-async"])
def test_a_killed_service_loses_and_doubles_nothing_and_leaves_no_process(
    service: Service, count: int, kills: int, prefer: str
) -> None:
    place, left = send(service, count, prefer), []
    extra = service.client.post(
        "/v1/solve", json=EXTRA, headers={"Prefer": "respond-async"}
    ).headers["location"]
    dice = random.Random(kills)
    for _ in range(kills):
        time.sleep(dice.uniform(0.0, 0.8))
        left += service.kill()
        service.start()
        assert service.batch(place)["total"] == count
    assert_each_line_is_answered_once(service, place, count)
    until(lambda: service.client.get(extra).status_code != 202)
    assert service.client.get(extra).json()["status"] == "successful"
    assert left + service.kill() == []
    print(f"{kills} kills, all processes gone after {service.longest_end:.1f} s at the longest")


@SIZES
def test_killed_workers_lose_and_double_nothing(service: Service, count: int, kills: int) -> None:
    place, killed = send(service, count), 0
    dice = random.Random(kills)
    while killed < kills and service.batch(place)["status"] != "successful":
        time.sleep(dice.uniform(0.0, 0.6))
        for pid in [dice.choice(found) for found in [service.workers()] if found]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
                killed += 1
    assert killed > 0
    assert_each_line_is_answered_once(service, place, count, most_failed=killed // 3)
    assert service.kill() == []


@SIZES
def test_killed_forking_servers_lose_and_double_nothing_and_no_job_answers_for_them(
    service: Service, count: int, kills: int
) -> None:
    place, killed = send(service, count), 0
    dice = random.Random(kills)
    while killed < kills and service.batch(place)["status"] != "successful":
        time.sleep(dice.uniform(0.0, 0.6))
        # The id 0 would be that of our own process and its group.
        if service.workers() and (server := service.forking_server()):
            with contextlib.suppress(ProcessLookupError):
                os.kill(server, signal.SIGKILL)
                killed += 1
    print(f"{killed} forking servers killed")
    assert killed > 0
    assert_each_line_is_answered_once(service, place, count)
    assert service.kill() == []


KNIFE = {  # a knife edge between springs: its motion is known at once, the full result after some seconds
    "coordinates": ["x", "y", "phi"],
    "lagrangian": "(x'^2+y'^2+phi'^2)/2 - (x^2+y^2)/2",
    "constraints": ["sin(phi)*x' - cos(phi)*y' = 0"],
}
Job = dict[str, Any]


def look(service: Service, place: str, is_enough: Callable[[Job], Any]) -> Job:
    """The job when the condition holds."""
    end = time.monotonic() + 240
    while time.monotonic() < end:
        job: Job = service.client.get(place).json()
        if is_enough(job):
            return job
        time.sleep(0.05)
    raise AssertionError("The job comes no further.")


def motion_of(job: Job) -> Any:
    """The known parts of the motion, or None."""
    so_far = (job.get("progress") or {}).get("so_far") or {}
    return (so_far.get("nonholonomic") or {}).get("equations_of_motion")


def kill_those_of(service: Service) -> None:
    for pid in service.workers():
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def began(service: Service) -> tuple[str, Any]:
    """The address of a running job with its motion, and the motion."""
    asked = service.client.post("/v1/solve", json=KNIFE, headers={"Prefer": "respond-async"})
    place = asked.headers["location"]
    return place, motion_of(look(service, place, motion_of))


@pytest.mark.slow
def test_parts_outlive_the_worker_and_the_service_and_the_job_continues(service: Service) -> None:
    place, motion = began(service)
    kill_those_of(service)
    assert motion_of(service.client.get(place).json()) == motion
    time.sleep(1.0)  # parts are written three times a second
    service.kill()
    service.start()
    assert motion_of(look(service, place, lambda job: job["status"] != "accepted")) == motion
    job = look(service, place, lambda job: job["status"] not in ("accepted", "running"))
    result = job["result"]
    assert (result["any_associated"]["verdict"], result["incomplete"]) == ("variational", [])
    assert result["nonholonomic"]["equations_of_motion"] == motion


@pytest.mark.slow
def test_a_job_whose_workers_are_killed_again_and_again_ends_with_its_parts(
    service: Service,
) -> None:
    place, motion = began(service)
    while service.client.get(place).json()["status"] in ("accepted", "running"):
        kill_those_of(service)
        time.sleep(0.5)
    result = service.client.get(place).json()["result"]
    assert result["nonholonomic"]["equations_of_motion"] == motion
    assert "killed repeatedly" in result["incomplete"][0]["reason"]
    assert service.client.post("/v1/check", json=result).json()["verdict"] in (
        "valid",
        "incomplete",
    )
