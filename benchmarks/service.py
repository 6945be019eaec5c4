"""The service under load: many clients at once, the cost of a request, and how busy a batch keeps the cores.

    python -m benchmarks service [--clients 200] [--seconds 60] [--lines 1000] [--output DIR]
                                [--page docs/records/reliability.md]

Starts a service of its own on loopback with an empty store in a temporary folder.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import httpx

from benchmarks.measured import conditions, put
from benchmarks.tables import table

SMALL = {"coordinates": ["x"], "equations": {"x": "-x"}}
SHARE_OF_FRESH = 0.05
THINK = 1.0


@dataclass(slots=True)
class Latencies:
    """Seconds of the answers of one sort, and the statuses that came."""

    name: str
    seconds: list[float] = field(default_factory=list)
    statuses: Counter[int] = field(default_factory=Counter)

    def row(self) -> dict[str, Any]:
        """Count, p50 and p99 in ms, statuses."""
        ordered = sorted(self.seconds) or [float("nan")]
        return {
            "sort": self.name,
            "count": len(self.seconds),
            "p50_ms": round(1e3 * statistics.median(ordered), 2),
            "p99_ms": round(1e3 * ordered[int(0.99 * (len(ordered) - 1))], 2),
            "statuses": {str(status): count for status, count in sorted(self.statuses.items())},
        }


@dataclass(frozen=True, slots=True)
class Overhead:
    """What the service adds to a request, in ms (medians)."""

    cached_ms: float
    fresh_ms: float
    compute_ms: float
    added_ms: float


@dataclass(frozen=True, slots=True)
class Busy:
    """A batch: seconds, and the share of the cores' time that the processes of the service used."""

    workers: int
    lines: int
    seconds: float
    lines_per_second: float
    busy_by_service: float
    busy_machine: float


def fresh_system(dice: random.Random) -> dict[str, Any]:
    """An n = 2 system that was not asked before."""
    a, b, c = (dice.randint(1, 10**6) for _ in range(3))
    return {"coordinates": ["x", "y"], "equations": {"x": f"-{a}*x+{c}*y", "y": f"-{b}*y+{c}*x"}}


@contextmanager
def service(**settings: str) -> Iterator[tuple[str, int]]:
    """The address and the process of a service of its own."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {"DATABASE": f"{folder}/jobs.sqlite", "LOG_LEVEL": "info", **settings}
        whole = os.environ | {f"INVERSE_SERVICE_{name}": value for name, value in environment.items()}
        command = [sys.executable, "-m", "inverse_service", "serve", "--port", "0"]
        with (
            open(f"{folder}/log", "wb") as log,
            subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True, env=whole) as process,
        ):
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            httpx.get(f"{address}/readyz", timeout=60).raise_for_status()
            try:
                yield address, process.pid
            finally:
                process.terminate()


async def load(address: str, clients: int, seconds: float) -> list[Latencies]:
    """Clients that ask, read the answer, and think for a second on average."""
    sorts = {"cached": Latencies("cached"), "fresh": Latencies("fresh n = 2")}
    end = time.monotonic() + seconds
    limits = httpx.Limits(max_connections=clients, max_keepalive_connections=clients)
    async with (
        httpx.AsyncClient(base_url=address, timeout=60, trust_env=False, limits=limits) as client,
        asyncio.TaskGroup() as group,
    ):
        for k in range(clients):
            group.create_task(_client(client, random.Random(k), end, sorts))
    return list(sorts.values())


async def _client(client: httpx.AsyncClient, dice: random.Random, end: float, sorts: dict[str, Latencies]) -> None:
    await asyncio.sleep(dice.uniform(0, THINK))
    while time.monotonic() < end:
        is_fresh = dice.random() < SHARE_OF_FRESH
        document = fresh_system(dice) if is_fresh else SMALL
        found = sorts["fresh" if is_fresh else "cached"]
        begin = time.perf_counter()
        response = await client.post("/v1/solve", json=document, headers={"Prefer": "wait=20"})
        found.seconds.append(time.perf_counter() - begin)
        found.statuses[response.status_code] += 1
        await asyncio.sleep(dice.expovariate(1 / THINK))


def overhead(address: str, count: int) -> Overhead:
    """One client, one question after the other."""
    dice = random.Random(7)
    with httpx.Client(base_url=address, timeout=60, trust_env=False) as client:
        client.post("/v1/solve", json=SMALL)
        cached = [_timed(client, SMALL)[0] for _ in range(count)]
        fresh = [_timed(client, fresh_system(dice)) for _ in range(count)]
        computed = [_computed(client, place) for _, place in fresh]
    added = [seconds - compute for (seconds, _), compute in zip(fresh, computed, strict=True)]
    middle = [statistics.median(values) for values in (cached, [seconds for seconds, _ in fresh], computed, added)]
    return Overhead(*(round(1e3 * value, 2) for value in middle))


def _timed(client: httpx.Client, document: dict[str, Any]) -> tuple[float, str]:
    begin = time.perf_counter()
    response = client.post("/v1/solve", json=document, headers={"Prefer": "wait=20"})
    seconds = time.perf_counter() - begin
    response.raise_for_status()
    return seconds, response.headers["location"]


def _computed(client: httpx.Client, place: str) -> float:
    """Seconds that the worker says it spent on a job."""
    return float(client.get(place).json()["usage"]["wall"])


def busy(address: str, pid: int, lines: int, workers: int) -> Busy:
    """A batch of fresh systems, with the time of all processes below the service."""
    dice = random.Random(11)
    body = "".join(json.dumps(fresh_system(dice)) + "\n" for _ in range(lines))
    with httpx.Client(base_url=address, timeout=None, trust_env=False) as client:
        response = client.post("/v1/batches", content=body, headers={"Content-Type": "application/x-ndjson"})
        before, idle, begin = _cpu_below(pid), _machine(), time.monotonic()
        text = client.get(response.headers["location"] + "/results").text
    seconds = time.monotonic() - begin
    assert sum(map(bool, text.splitlines())) == lines
    used, (total, free) = _cpu_below(pid) - before, (b - a for a, b in zip(idle, _machine(), strict=True))
    cores = len(os.sched_getaffinity(0))
    shares = (round(used / seconds / cores, 3), round(1 - free / total, 3))
    return Busy(workers, lines, round(seconds, 2), round(lines / seconds, 1), *shares)


def _cpu_below(pid: int) -> float:
    """Seconds of processor used by a process and its descendants that live (workers live through a batch)."""
    parents: dict[int, list[int]] = {}
    used: dict[int, float] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        parents.setdefault(int(fields[1]), []).append(int(folder.name))
        used[int(folder.name)] = sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
    total, stack = 0.0, [pid]
    while stack:
        one = stack.pop()
        total += used.get(one, 0.0)
        stack += parents.get(one, [])
    return total


def _machine() -> tuple[float, float]:
    """Ticks of all cores since the start: total and idle."""
    fields = [int(text) for text in Path("/proc/stat").read_text().splitlines()[0].split()[1:9]]
    return float(sum(fields)), float(fields[3] + fields[4])


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks service", description=__doc__)
    parser.add_argument("--clients", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--lines", type=int, default=1000)
    parser.add_argument("--count", type=int, default=200, help="questions for the overhead")
    parser.add_argument("--workers", type=int, default=2, help="most workers of the batch")
    parser.add_argument("--output", type=Path, help="folder for service.json")
    parser.add_argument("--page", type=Path, help="page whose place `load` gets the tables")
    chosen = parser.parse_args(arguments)
    found: dict[str, Any] = {"batch": []}
    for workers in range(1, chosen.workers + 1):
        with service(WORKERS=str(workers)) as (address, pid):
            found["batch"].append(asdict(busy(address, pid, chosen.lines, workers)))
    with service() as (address, _):
        found["overhead"] = asdict(overhead(address, chosen.count))
        found["load"] = [sort.row() for sort in asyncio.run(load(address, chosen.clients, chosen.seconds))]
    found["conditions"] = conditions()
    text = json.dumps(found, indent=1)
    print(text)
    if chosen.output:
        chosen.output.mkdir(parents=True, exist_ok=True)
        (chosen.output / "service.json").write_text(text, encoding="utf-8")
    if chosen.page:
        put(chosen.page, "load", markdown(found, chosen.clients, chosen.seconds))


def markdown(found: dict[str, Any], clients: int, seconds: float) -> str:
    """The tables of docs/records/reliability.md."""
    asked = [
        [row["sort"], str(row["count"]), f"{row['p50_ms']:.3g}", f"{row['p99_ms']:.3g}",
         ", ".join(f"{count} of {status}" for status, count in row["statuses"].items())]
        for row in found["load"]
    ]  # fmt: skip
    batches = [
        [
            str(row["workers"]),
            str(row["lines"]),
            f"{row['lines_per_second']:.3g}",
            f"{100 * row['busy_by_service']:.0f} %",
        ]
        for row in found["batch"]
    ]
    one = found["overhead"]
    return (
        f"{found['conditions']}. {clients} clients for {seconds:g} s, each asks about once a second:\n\n"
        + table(["question", "answers", "p50, ms", "p99, ms", "statuses"], asked)
        + f"\nOne client, one question after the other, medians: {one['cached_ms']:.2g} ms from the store, "
        f"{one['fresh_ms']:.3g} ms for a new system of which its worker spent {one['compute_ms']:.3g} ms.\n\n"
        + table(["workers", "lines of a batch", "lines a second", "of all cores' time, the service"], batches)
    )


if __name__ == "__main__":
    main(sys.argv[1:])
