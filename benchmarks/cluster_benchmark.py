"""Measure a batch on the local pool, a Dask cluster on loopback, and front ends over PostgreSQL:
lines per second.

    python -m benchmarks cluster [--lines N] [--rounds N] [--workers N] [--least N]
                                [--output DIR]
                                [--page docs/records/reliability.md] [--postgres postgresql://...]

They take turns, so that other load on the machine affects all of them. A front end is a service
with one worker; all share the store at the address of --postgres, whose server is not counted.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import functools
import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import httpx

from benchmarks import families, service
from benchmarks.measured import conditions, put
from benchmarks.tables import table

LIMIT = 1800.0
# Until Dask's processes have started, and how long they are looked at while they have nothing to
# do, s.
SETTLED, IDLE = 8.0, 8.0
Machines = contextlib.AbstractContextManager[tuple[str, list[int]]]
# The first lines also pay for processes that load the engine.
WARM = 0.2
# The last lines end while the batch releases its processes.
LAST = 0.97
LOADS = {"n = 2": (2, 1.0), "n = 4": (4, 0.4)}
# As docs/how-to/scale.md advises, and deploy/ has it.
CALM = {
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s",
    "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL": "5s",
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "false",
}


@dataclass(frozen=True, slots=True)
class ClusterRow:
    """Lines per second once everything is warm, the medians of all rounds.

    `efficiency`: relative to the pool of one process, or of the fewest that were measured, times
    the number of workers; the pool's own row shows what the machine itself gives. `processor`:
    milliseconds of processor time per line, of all processes together (Linux only), without `idle`,
    the milliseconds a second that they take when there is nothing to do. Unlike the rate, these do
    not depend on other load on the machine. `share`: of the pool's rate, with as many workers, what
    they leave of a core for each worker.
    """

    load: str
    where: str
    workers: int
    lines: int
    rate: float
    efficiency: float
    processor: float
    idle: float
    share: float


@dataclass(frozen=True, slots=True)
class Sample:
    """Lines per second, milliseconds of processor time per line, and of idle processes a second."""

    rate: float
    processor: float
    idle: float = 0.0


def measure(
    lines: int, rounds: int, workers: tuple[int, int], postgres: str | None
) -> list[ClusterRow]:
    """Run each load on the pool, the cluster, and the front ends over `postgres`, with 1, 2, 4 ...
    workers, from the fewest to the most.
    """
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for load, (size, share) in LOADS.items():
            source = folder / f"{load}.ndjson"
            count = max(20, int(lines * share))
            _write(source, size, count)
            rows += _rows(load, source, count, rounds, workers, postgres)
    return rows


def _rows(
    load: str,
    source: Path,
    count: int,
    rounds: int,
    bounds: tuple[int, int],
    postgres: str | None,
) -> list[ClusterRow]:
    least, most = bounds
    places = ("pool", "cluster", *(["front ends"] if postgres else []))
    doubled = [2**k for k in range(most.bit_length()) if 2**k >= least]
    cases = [(where, workers) for workers in sorted({*doubled, most}) for where in places]
    samples: dict[tuple[str, int], list[Sample]] = {case: [] for case in cases}
    for turn in range(rounds):
        for where, workers in cases:
            is_front = where == "front ends"
            sample = (
                _fronts(source, count, workers, str(postgres))
                if is_front
                else _run(source, count, where, workers)
            )
            samples[where, workers].append(sample)
            told = (
                f"{sample.rate:.3g} lines/s, {sample.processor:.3g} ms of processor time per line"
            )
            print(
                f"{load}, round {turn + 1}: {where} of {workers}: {told}",
                file=sys.stderr,
                flush=True,
            )
    rates = {
        case: statistics.median(sample.rate for sample in found) for case, found in samples.items()
    }
    spent = {
        case: statistics.median(sample.processor for sample in found)
        for case, found in samples.items()
    }
    idle = {
        case: statistics.median(sample.idle for sample in found) for case, found in samples.items()
    }
    fewest = min(workers for _, workers in cases)
    one = rates["pool", fewest] / fewest
    rows = []
    for case in cases:
        _, workers = case
        left = 1 - idle[case] / (1000 * workers)
        share = left * spent["pool", workers] / spent[case]
        efficiency = rates[case] / (one * workers)
        row = ClusterRow(
            load, *case, count, rates[case], efficiency, spent[case], idle[case], share
        )
        rows.append(row)
    return rows


def _write(path: Path, n: int, count: int) -> None:
    documents = ({"id": k, **families.random_natural(n, k)} for k in range(count))
    path.write_text(
        "".join(json.dumps(document) + "\n" for document in documents), encoding="utf-8"
    )


def _run(source: Path, count: int, where: str, workers: int) -> Sample:
    """Measure from the end of the first WARM answers to the last one."""
    output = source.with_suffix(f".{time.monotonic_ns()}.out")
    command = [
        sys.executable,
        "-m",
        "inverse_service",
        "batch",
        str(source),
        "--output",
        str(output),
    ]
    alone: Machines = contextlib.nullcontext(("", []))
    machines: Machines = _cluster(source.parent, workers) if where == "cluster" else alone
    with machines as found:
        address, sessions = found
        more = ["--cluster", address] if address else ["--workers", str(workers)]
        idle = _idle({*sessions}) if sessions else 0.0
        with subprocess.Popen(
            [*command, *more], stderr=subprocess.DEVNULL, start_new_session=True
        ) as process:
            try:
                answered = functools.partial(_lines_of, output)
                spent = functools.partial(_processor_time, {process.pid, *sessions})
                return _sample(answered, count, spent, idle)
            finally:
                process.terminate()


def _fronts(source: Path, count: int, workers: int, postgres: str) -> Sample:
    """Give a batch to the first of several services with one worker each; its lines are new to the
    store.
    """
    with contextlib.ExitStack() as stack:
        settings = {"DATABASE": postgres, "WORKERS": "1", "LOG_LEVEL": "error"}
        fronts = [stack.enter_context(service.service(**settings)) for _ in range(workers)]
        client = stack.enter_context(
            httpx.Client(base_url=fronts[0][0], timeout=60, trust_env=False)
        )
        headers = {"Content-Type": "application/x-ndjson", "Cache-Control": "no-cache"}
        place = client.post("/v1/batches", content=source.read_bytes(), headers=headers).headers[
            "location"
        ]
        return _sample(
            lambda: int(client.get(place).json()["counts"].get("successful", 0)), count,
            lambda: sum(service.cpu_below(pid) for _, pid in fronts),
        )  # fmt: skip


def _idle(sessions: set[int]) -> float:
    """Milliseconds of processor time a second of these processes while there is nothing to do."""
    time.sleep(SETTLED)
    before = _processor_time(sessions)
    time.sleep(IDLE)
    return 1000 * (_processor_time(sessions) - before) / IDLE


def _sample(
    answered: Callable[[], int], count: int, processor_time: Callable[[], float], idle: float = 0.0
) -> Sample:
    end, first, began, spent = time.monotonic() + LIMIT, 0, 0.0, 0.0
    while time.monotonic() < end:
        done = answered()
        if not first and done >= WARM * count:
            first, began, spent = done, time.monotonic(), processor_time()
        if done >= LAST * count:
            lines, seconds = done - first, time.monotonic() - began
            processor = (1000 * (processor_time() - spent) - idle * seconds) / lines
            return Sample(lines / seconds, processor, idle)
        time.sleep(0.05)
    raise TimeoutError(f"the batch did not end within {LIMIT:g} s")


def _lines_of(output: Path) -> int:
    return output.read_bytes().count(b"\n") if output.exists() else 0


def _processor_time(sessions: set[int]) -> float:
    """Processor seconds of all processes of these sessions and of their ended children; nan if
    there is no /proc.
    """
    ticks, seen = 0, False
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, IndexError):
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            if int(fields[3]) in sessions:
                ticks, seen = ticks + sum(map(int, fields[11:15])), True
    return ticks / os.sysconf("SC_CLK_TCK") if seen else float("nan")


@contextlib.contextmanager
def _cluster(folder: Path, workers: int) -> Iterator[tuple[str, list[int]]]:
    """A scheduler and single-threaded workers on loopback: the address, and the sessions of the
    processes.
    """
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    dask, quiet = [sys.executable, "-m", "dask"], ["--no-dashboard", "--host", "127.0.0.1"]
    commands = [[*dask, "scheduler", "--port", str(port), *quiet]]
    # As in a cluster that starts its workers again by itself: no nanny beside each of them.
    local = ["--nthreads", "1", "--no-nanny", "--local-directory", str(folder)]
    commands += [[*dask, "worker", address, *local, *quiet]] * workers
    started: list[subprocess.Popen[bytes]] = []
    try:
        for command in commands:
            quiet_process = subprocess.Popen(
                command,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
                env=os.environ | CALM,
            )
            started.append(quiet_process)
        yield address, [process.pid for process in started]
    finally:
        for process in reversed(started):
            process.terminate()
        for process in started:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:  # it looks for the scheduler, which has ended
                process.kill()
                process.wait()


def markdown(rows: Sequence[ClusterRow]) -> str:
    """The table of docs/records/reliability.md."""
    head = [
        "load",
        "where",
        "workers",
        "lines",
        "lines a second",
        "efficiency",
        "processor ms a line",
        "idle, ms a second",
        "of the pool",
    ]
    return table(head, [_cells(row) for row in rows])


def _cells(row: ClusterRow) -> list[str]:
    figures = [f"{row.rate:.3g}", f"{100 * row.efficiency:.0f} %", f"{row.processor:.3g}"]
    figures += [f"{row.idle:.0f}", f"{100 * row.share:.0f} %"]
    return [row.load, row.where, str(row.workers), str(row.lines), *figures]


def main(arguments: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks cluster", description=__doc__)
    parser.add_argument(
        "--lines", type=int, default=500, help="lines of the small load (default 500)"
    )
    parser.add_argument(
        "--rounds", type=int, default=3, help="turns; the median counts (default 3)"
    )
    parser.add_argument(
        "--workers", type=int, default=os.cpu_count() or 1, help="most workers (default: cores)"
    )
    parser.add_argument("--least", type=int, default=1, help="fewest workers (default 1)")
    parser.add_argument("--postgres", help="address of a database for front ends")
    parser.add_argument("--page", type=Path, help="page whose place `cluster` gets the table")
    parser.add_argument("--output", type=Path, help="folder for cluster.md and cluster.json")
    chosen = parser.parse_args(arguments)
    rows = measure(chosen.lines, chosen.rounds, (chosen.least, chosen.workers), chosen.postgres)
    text = f"{conditions()}, medians over rounds: {chosen.rounds}.\n\n{markdown(rows)}"
    print(text)
    if chosen.page:
        put(chosen.page, "cluster", text)
    if chosen.output:
        chosen.output.mkdir(parents=True, exist_ok=True)
        (chosen.output / "cluster.md").write_text(text, encoding="utf-8")
        found = [dataclasses.asdict(row) for row in rows]
        (chosen.output / "cluster.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
