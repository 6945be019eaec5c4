"""Tasks on a real Dask cluster run in the same killable workers; none is lost or answered twice."""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from inverse_service import errors
from inverse_service.service.jobs import opening, tasks
from tests.serving import HARD, serving, until

pytest.importorskip("distributed")
pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
    # Dask leaves sockets and loops to the garbage collector when it closes.
    pytest.mark.filterwarnings(
        "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
    ),
]
from inverse_service.service.jobs import cluster as on_dask  # noqa: E402
from inverse_service.service.jobs.cluster import Cluster  # noqa: E402
from inverse_service.service.jobs.tasks import Call  # noqa: E402
from tests.cluster import processes  # noqa: E402

MEMORY = 2048


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> Iterator[processes.Cluster]:
    with processes.dask_cluster(tmp_path_factory.mktemp("dask"), workers=1, threads=2) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def cluster(machines: processes.Cluster) -> Iterator[Cluster]:
    connected = Cluster(machines.address, MEMORY)
    connected.start()
    # A front end that starts before any worker finds no mismatched version.
    connected.submit(Call(tasks.load_engine, (), 60.0)).outcome.result(90)
    yield connected
    connected.stop()


def outcome(
    cluster: Cluster, task: Any, arguments: tuple[Any, ...] = (), deadline: float = 60.0
) -> Any:
    return cluster.submit(Call(task, arguments, deadline)).outcome.result(90)


def test_a_task_is_answered_from_another_process(cluster: Cluster) -> None:
    found = outcome(cluster, os.getpid)
    assert found.status == "done"
    assert found.value != os.getpid()
    assert cluster.capacity == 2
    assert cluster.fault() == ""


def test_what_a_task_says_is_heard_here(cluster: Cluster) -> None:
    heard = list[Any]()
    call = Call(processes.telling, (), 60.0, reports=True)
    found = cluster.submit(call, heard.append).outcome.result(90)
    assert (found.status, found.value) == ("done", "told")
    part = {"parts": ["existence"], "value": {"open": {"part": "existence"}}}
    until(lambda: part in heard)


def test_the_deadline_holds_in_c_and_memory_is_bounded(cluster: Cluster) -> None:
    outcome(cluster, tasks.load_engine)
    ended = outcome(cluster, pow, (3, 10**9), 0.5)
    assert ended.status == "deadline"
    assert ended.spent.cpu < 10  # s; the loop takes many minutes
    assert outcome(cluster, bytearray, (MEMORY * 2**20,)).status == "memory"
    assert outcome(cluster, signal.raise_signal, (signal.SIGSEGV,)).status == "crash"
    assert outcome(cluster, tasks.load_engine).status == "done"


def test_a_cancelled_task_stops_there_too(cluster: Cluster, machines: processes.Cluster) -> None:
    outcome(cluster, tasks.load_engine)
    running = cluster.submit(Call(pow, (3, 10**9), 600.0))
    busy: list[int] = []
    until(lambda: busy.extend(_busy(machines.workers[0].pid)) or busy)
    running.cancel()
    assert running.outcome.result(60).status == "cancelled"
    until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in busy))


def _busy(session: int) -> list[int]:
    """The worker processes of a session that computed for most of a fifth of a second."""

    def ticks() -> dict[int, int]:
        found = {}
        for pid in processes.processes(session):
            with contextlib.suppress(OSError):
                fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
                found[pid] = int(fields[11]) + int(fields[12])
        return found

    before = ticks()
    time.sleep(0.2)
    used = {pid: now - before.get(pid, now) for pid, now in ticks().items()}
    return [
        pid
        for pid, spent in used.items()
        if spent >= 4 and b"forkserver" in processes.command_of(pid)
    ]


def test_progress_comes_through(cluster: Cluster) -> None:
    heard: list[Any] = []
    options = json.dumps({"time_limit": 20.0, "memory_limit": MEMORY, "seed": 1})
    call = Call(tasks.job_task, ("solve", json.dumps(HARD), options), 20.0, None, True)
    running = cluster.submit(call, heard.append)  # for longer than `TELL`
    until(lambda: heard)
    running.cancel()


@pytest.mark.slow
def test_a_batch_is_answered_once_a_line(machines: processes.Cluster, tmp_path: Path) -> None:
    lines: list[dict[str, Any]] = [
        {"id": f"line {k}", "coordinates": ["x"], "equations": {"x": f"-{k % 5 + 1}*x"}}
        for k in range(20)
    ]
    lines[7]["equations"] = {"x": "omega"}
    lines.append(
        {"id": "family", "family": True, "equations": ["x'' = -a*x' + y", "y'' = -c*y' + x"]}
    )
    source, output = tmp_path / "in.ndjson", tmp_path / "out.ndjson"
    source.write_text("".join(json.dumps(line) + "\n" for line in lines))
    command = [
        sys.executable,
        "-m",
        "inverse_service",
        "batch",
        str(source),
        "--output",
        str(output),
    ]
    done = subprocess.run(
        [*command, "--cluster", machines.address], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 1, done.stderr  # one line is an error
    answers = [json.loads(line) for line in output.read_text().splitlines()]
    assert sorted(answer["id"] for answer in answers) == sorted(line["id"] for line in lines)
    assert [answer["id"] for answer in answers if "error" in answer] == ["line 7"]
    (family,) = (answer["family"] for answer in answers if answer["id"] == "family")
    assert family["covered"]
    assert {leaf["verdict"] for leaf in family["leaves"]} == {"variational", "not_variational"}


@pytest.mark.slow
def test_the_service_solves_on_the_cluster(machines: processes.Cluster, tmp_path: Path) -> None:
    settings = {
        "cluster": machines.address,
        "database": str(tmp_path / "jobs.sqlite"),
        "log_level": "error",
    }
    with serving(**settings) as (_, address):
        document = {"coordinates": ["x"], "equations": {"x": "-x"}}
        answer = httpx.post(
            f"{address}/v1/solve", json=document, headers={"Prefer": "wait=20"}, timeout=60
        )
        assert answer.status_code == 200, answer.text
        assert answer.json()["verdict"] == "variational"
        scene = {
            "system": {"equations": "x'' = -x"},
            "methods": ["adaptive"],
            "step": 0.1,
            "time": 1,
        }
        starts = [{"positions": {"x": k}, "velocities": {"x": 0}} for k in range(1, 9)]
        sweep = httpx.post(
            f"{address}/v1/batches",
            params={"kind": "simulate"},
            json=[scene | {"id": k, "initial": start} for k, start in enumerate(starts)],
            timeout=60,
        )
        runs = httpx.get(f"{address}{sweep.headers['location']}/results", timeout=120).text
        ended = [json.loads(line) for line in runs.splitlines() if line]
        assert sorted(run["id"] for run in ended) == [*range(8)]
        for run in ended:  # x = (k + 1) cos t
            reached = run["methods"][0]["final"]["positions"]["x"]
            assert reached == pytest.approx((run["id"] + 1) * math.cos(1.0))


def test_a_cluster_with_another_program_is_refused(
    machines: processes.Cluster, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = on_dask.fingerprint() | {"engine": "9.9"}
    with monkeypatch.context() as patched:
        patched.setattr(on_dask, "fingerprint", lambda: other)
        stranger = Cluster(machines.address, MEMORY)
    with pytest.raises(
        errors.InputError, match=r"another program: engine .* instead of 9\.9; install the same"
    ):
        stranger.start()
    answer = on_dask.perform(
        "k", Call(tasks.load_engine, (), 1.0), on_dask.Terms(other, MEMORY, "t")
    )
    assert isinstance(answer, str), "a worker that joins later must reject too"
    assert "engine" in answer


def test_what_differs_is_named() -> None:
    ours = on_dask.fingerprint()
    assert on_dask.difference(ours, ours) == ""
    assert (
        on_dask.difference(ours, ours | {"python": "3.1"})
        == f"python 3.1 instead of {ours['python']}"
    )


@pytest.mark.slow
@pytest.mark.parametrize("address", ["", "localhost:8786", "http://localhost:8786", "file:///x"])
def test_an_address_of_something_else_is_refused(address: str) -> None:
    with pytest.raises(errors.InputError, match="tcp://"):
        opening.executor(address, 1, MEMORY)


@pytest.mark.slow
def test_an_absent_scheduler_is_said_to_be_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(on_dask, "CONNECT", 0.5)
    with pytest.raises(errors.InputError, match="No Dask scheduler answers"):
        opening.executor("tcp://127.0.0.1:9", 1, MEMORY).start()
