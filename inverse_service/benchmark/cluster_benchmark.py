"""A batch on this machine's own pool and on a Dask cluster on loopback: lines a second, efficiency.

    python -m inverse_service.benchmark cluster [--lines N] [--rounds N] [--workers N] [--output DIR]

The pool and the cluster take turns, so that a machine that is busy with other things is so for both.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from inverse_service.benchmark import families
from inverse_service.benchmark.tables import table

LIMIT = 1800.0
# The first lines also pay for processes that load the engine.
WARM = 0.2
LOADS = {"small": (2, 1.0), "larger": (6, 0.2)}


@dataclass(frozen=True, slots=True)
class ClusterRow:
    """Lines a second once everything is warm, the medians of all rounds.

    `efficiency`: against the pool of one process, times the number of workers; the pool's own row
    says what the machine itself gives.
    """

    load: str
    where: str
    workers: int
    lines: int
    rate: float
    efficiency: float


def measure(lines: int, rounds: int, most: int) -> list[ClusterRow]:
    """Each load on pool and cluster with 1 to `most` workers."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for load, (size, share) in LOADS.items():
            source = folder / f"{load}.ndjson"
            count = max(20, int(lines * share))
            _write(source, size, count)
            rows += _rows(load, source, count, rounds, most)
    return rows


def _rows(load: str, source: Path, count: int, rounds: int, most: int) -> list[ClusterRow]:
    cases = [(where, workers) for workers in range(1, most + 1) for where in ("pool", "cluster")]
    rates: dict[tuple[str, int], list[float]] = {case: [] for case in cases}
    for turn in range(rounds):
        for where, workers in cases:
            print(f"{load}, round {turn + 1}: {where} of {workers}", file=sys.stderr, flush=True)
            rates[where, workers].append(_run(source, count, where, workers))
    one = statistics.median(rates["pool", 1])
    medians = {case: statistics.median(found) for case, found in rates.items()}
    return [ClusterRow(load, *case, count, rate, rate / (one * case[1])) for case, rate in medians.items()]


def _write(path: Path, n: int, count: int) -> None:
    documents = ({"id": k, **families.random_natural(n, k)} for k in range(count))
    path.write_text("".join(json.dumps(document) + "\n" for document in documents), encoding="utf-8")


def _run(source: Path, count: int, where: str, workers: int) -> float:
    """Lines a second between the first WARM of the answers and the last one."""
    output = source.with_suffix(f".{time.monotonic_ns()}.out")
    command = [sys.executable, "-m", "inverse_service.cli", "batch", str(source), "--output", str(output)]
    with _cluster(source.parent, workers) if where == "cluster" else contextlib.nullcontext("") as address:
        more = ["--cluster", address] if address else ["--workers", str(workers)]
        with subprocess.Popen([*command, *more], stderr=subprocess.DEVNULL) as process:
            try:
                return _rate(output, count)
            finally:
                process.terminate()


def _rate(output: Path, count: int) -> float:
    end, first, began = time.monotonic() + LIMIT, 0, 0.0
    while time.monotonic() < end:
        done = output.read_bytes().count(b"\n") if output.exists() else 0
        if not first and done >= WARM * count:
            first, began = done, time.monotonic()
        if done >= count:
            return (done - first) / (time.monotonic() - began)
        time.sleep(0.01)
    raise TimeoutError(f"the batch did not end within {LIMIT:g} s")


@contextlib.contextmanager
def _cluster(folder: Path, workers: int) -> Iterator[str]:
    """A scheduler and single-threaded workers on loopback."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    dask, quiet = [sys.executable, "-m", "dask"], ["--no-dashboard", "--host", "127.0.0.1"]
    commands = [[*dask, "scheduler", "--port", str(port), *quiet]]
    local = ["--nthreads", "1", "--local-directory", str(folder)]
    commands += [[*dask, "worker", address, *local, *quiet]] * workers
    started: list[subprocess.Popen[bytes]] = []
    try:
        for command in commands:
            started.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        yield address
    finally:
        for process in reversed(started):
            process.terminate()
        for process in started:
            process.wait(30)


def markdown(rows: Sequence[ClusterRow]) -> str:
    """The table of docs/scaling.md."""
    head = ["load", "where", "workers", "lines", "lines a second", "efficiency"]
    cells = (
        [r.load, r.where, str(r.workers), str(r.lines), f"{r.rate:.3g}", f"{100 * r.efficiency:.0f} %"] for r in rows
    )
    return table(head, cells)


def main(arguments: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m inverse_service.benchmark cluster", description=__doc__)
    parser.add_argument("--lines", type=int, default=500, help="lines of the small load (default 500)")
    parser.add_argument("--rounds", type=int, default=3, help="turns; the median counts (default 3)")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="most workers (default: cores)")
    parser.add_argument("--output", type=Path, help="folder for cluster.md and cluster.json")
    chosen = parser.parse_args(arguments)
    rows = measure(chosen.lines, chosen.rounds, chosen.workers)
    load = f"load average of the machine {os.getloadavg()[1]:.1f}\n" if hasattr(os, "getloadavg") else ""
    print(markdown(rows) + load)
    if chosen.output:
        chosen.output.mkdir(parents=True, exist_ok=True)
        (chosen.output / "cluster.md").write_text(markdown(rows), encoding="utf-8")
        found = [dataclasses.asdict(row) for row in rows]
        (chosen.output / "cluster.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
