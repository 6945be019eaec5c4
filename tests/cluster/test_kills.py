"""kill -9 of Dask's scheduler and workers during a batch: every line is answered once, nothing is
left behind.
"""

from __future__ import annotations

import json
import random
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("distributed")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")]

from tests.cluster import processes  # noqa: E402

Kill = Callable[[processes.Cluster], None]
LINES = 1000


def write_source(path: Path) -> None:
    """Write distinct systems, some of them invalid, so that no answer fits another line."""
    with path.open("w") as stream:
        for k in range(LINES):
            force = "omega" if k % 97 == 5 else f"-{k + 1}*x - y^3"
            line = {
                "id": k,
                "coordinates": ["x", "y"],
                "equations": {"x": force, "y": f"-{k + 2}*y - 3*x*y^2"},
            }
            stream.write(json.dumps(line) + "\n")


def answered(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


def kill_scheduler(cluster: processes.Cluster) -> None:
    """Kill the scheduler: all workers lose their work, and the operator restarts everything."""
    cluster.kill_scheduler()
    cluster.start_scheduler()
    for _ in range(2):
        cluster.kill_worker()
        cluster.start_worker()


def kill_worker(cluster: processes.Cluster) -> None:
    cluster.kill_worker()
    cluster.start_worker()


@pytest.mark.parametrize(
    ("kill", "kills"),
    [
        (kill_scheduler, 10),
        (kill_worker, 10),
        pytest.param(kill_scheduler, 50, marks=pytest.mark.nightly),
    ],
)
def test_every_line_is_answered_once_through_all_kills(
    kill: Kill, kills: int, tmp_path: Path
) -> None:
    source, output = tmp_path / "in.ndjson", tmp_path / "out.ndjson"
    write_source(source)
    command = [
        sys.executable,
        "-m",
        "inverse_service",
        "batch",
        str(source),
        "--output",
        str(output),
    ]
    moments, killed, end = random.Random(1), 0, time.monotonic() + 900
    with processes.dask_cluster(tmp_path / "dask", workers=2) as cluster:
        with subprocess.Popen(
            [*command, "--cluster", cluster.address], stderr=subprocess.PIPE, text=True
        ) as batch:
            try:
                while batch.poll() is None and time.monotonic() < end:
                    # Each kill comes at a random time in its share of the work.
                    due = (killed + moments.random()) * LINES / (kills + 1)
                    if killed < kills and answered(output) > due:
                        kill(cluster)
                        killed += 1
                    time.sleep(0.05)
            finally:
                batch.kill()
            assert batch.stderr is not None
            assert batch.returncode == 1, batch.stderr.read()  # there are bad lines
        assert cluster.left(2.0) == [], "processes outlived their Dask worker"
    assert killed == kills
    answers = [json.loads(line) for line in output.read_text().splitlines()]
    assert Counter(answer["id"] for answer in answers) == dict.fromkeys(range(LINES), 1)
    wrong = {answer["id"] for answer in answers if "error" in answer}
    assert wrong == {k for k in range(LINES) if k % 97 == 5}
