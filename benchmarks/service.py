"""Measure the service under load next to a bare endpoint, and how busy a batch keeps the cores.

    python -m benchmarks service [--clients 1 20 100] [--seconds 8] [--lines 1000] [--output DIR]
                                [--page docs/records/reliability.md]

Starts a service of its own on loopback with an empty store in a temporary folder. The bare endpoint
is FastAPI with a pool of processes that run the same task, and a dictionary of answers: nothing
durable, no limits, no deadlines. The two are measured alternately, so that other work on the
machine slows both.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import random
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import httpx
from fastapi import FastAPI, Request, Response

from benchmarks.measured import conditions, put
from benchmarks.tables import table

KNOWN = b'{"equations": "x\'\' = -x"}'


@dataclass(frozen=True, slots=True)
class Loaded:
    """Answers per second, median and 99th percentile in ms, and ms of processor time of the web
    process per answer.
    """

    where: str
    question: str
    clients: int
    rate: float
    p50: float
    p99: float
    processor: float


@dataclass(frozen=True, slots=True)
class Busy:
    """A batch: seconds, and the share of the cores' time that the processes of the service used."""

    workers: int
    lines: int
    seconds: float
    lines_per_second: float
    busy_by_service: float
    busy_machine: float


def bare() -> Any:
    """The endpoint to compare with, an application for uvicorn."""
    application, answers = FastAPI(), dict[bytes, bytes]()
    pool = ProcessPoolExecutor(2)

    @application.post("/v1/solve")
    async def solve(request: Request) -> Response:
        body = await request.body()
        if body not in answers:
            answers[body] = await asyncio.wrap_future(pool.submit(solved, body))
        return Response(answers[body], media_type="application/json")

    return application


def solved(body: bytes) -> bytes:
    """Solve a document as the workers of the service do."""
    from inverse_service.decision.solutions import SolveOptions
    from inverse_service.service.jobs.tasks import solve_task

    return json.dumps(solve_task(json.loads(body), SolveOptions())).encode()


def fresh_system(dice: random.Random) -> dict[str, Any]:
    """A new system with n = 2."""
    a, b, c = (dice.randint(1, 10**6) for _ in range(3))
    return {"coordinates": ["x", "y"], "equations": {"x": f"-{a}*x+{c}*y", "y": f"-{b}*y+{c}*x"}}


@contextmanager
def service(**settings: str) -> Iterator[tuple[str, int]]:
    """Start a service; yield its address and its process."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {"DATABASE": f"{folder}/jobs.sqlite", "LOG_LEVEL": "info", **settings}
        whole = os.environ | {
            f"INVERSE_SERVICE_{name}": value for name, value in environment.items()
        }
        command = [sys.executable, "-m", "inverse_service", "serve", "--port", "0"]
        with (
            open(f"{folder}/log", "wb") as log,
            subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=log, text=True, env=whole
            ) as process,
        ):
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            try:
                _wait_until(lambda: httpx.get(f"{address}/readyz", timeout=60).status_code == 200)
                yield address, process.pid
            finally:
                process.terminate()


@contextmanager
def bare_service() -> Iterator[tuple[str, int]]:
    """Start the bare endpoint; yield its address and its process."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = [
        sys.executable,
        "-m",
        "uvicorn",
        "benchmarks.service:bare",
        "--factory",
        "--port",
        str(port),
    ]
    with subprocess.Popen([*command, "--log-level", "error"], process_group=0) as process:
        try:
            address = f"http://127.0.0.1:{port}"
            _wait_until(
                lambda: (
                    httpx.post(f"{address}/v1/solve", content=KNOWN, timeout=60).status_code == 200
                )
            )
            yield address, process.pid
        finally:
            os.killpg(process.pid, signal.SIGKILL)  # the processes of its pool too


def _wait_until(is_ready: Callable[[], bool]) -> None:
    end = time.monotonic() + 120
    while time.monotonic() < end:
        with contextlib.suppress(httpx.HTTPError):
            if is_ready():
                return
        time.sleep(0.2)
    raise TimeoutError("the service does not get ready")


def compared(clients: Sequence[int], seconds: float) -> list[Loaded]:
    """Send known and new questions from that many clients, alternately to the bare endpoint and to
    the service.
    """
    dice, found = random.Random(), list[Loaded]()

    def new() -> bytes:
        return json.dumps({"equations": f"x'' = -{dice.randrange(10**12)}*x"}).encode()

    with bare_service() as one, service() as two:
        for question, body in (("known", lambda: KNOWN), ("new", new)):
            for count in clients:
                for where, (address, pid) in (("bare", one), ("service", two)):
                    asyncio.run(
                        load(address, body, count, min(1.0, seconds))
                    )  # loads what is loaded once
                    spent = _thread_time(pid)
                    times = asyncio.run(load(address, body, count, seconds))
                    spent, ordered = _thread_time(pid) - spent, sorted(times)
                    figures = (
                        statistics.median(ordered),
                        ordered[int(0.99 * (len(ordered) - 1))],
                        spent / len(times),
                    )
                    row = Loaded(
                        where,
                        question,
                        count,
                        len(times) / seconds,
                        *(1e3 * figure for figure in figures),
                    )
                    print(row, file=sys.stderr, flush=True)
                    found.append(row)
    return found


async def load(
    address: str, body: Callable[[], bytes], clients: int, seconds: float
) -> list[float]:
    """Seconds per answer to clients that send the next request immediately, each on one
    connection.
    """
    host, port = address.removeprefix("http://").split(":")
    head = "POST /v1/solve HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nPrefer: wait=20\r\n"
    end, found = time.monotonic() + seconds, list[float]()

    async def client() -> None:
        reader, writer = await asyncio.open_connection(host, int(port))
        while time.monotonic() < end:
            begin, content = time.perf_counter(), body()
            writer.write(f"{head}Content-Length: {len(content)}\r\n\r\n".encode() + content)
            answer = (await reader.readuntil(b"\r\n\r\n")).lower()
            if not answer.startswith(b"http/1.1 200"):
                raise ValueError(answer.decode())
            await reader.readexactly(
                int(answer.partition(b"content-length: ")[2].partition(b"\r\n")[0])
            )
            found.append(time.perf_counter() - begin)
        writer.close()

    await asyncio.gather(*(client() for _ in range(clients)))
    return found


def _thread_time(pid: int) -> float:
    """Processor seconds that the live threads of a process have used."""
    found = 0.0
    for path in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        with contextlib.suppress(OSError):
            found += int(path.read_text().split()[0]) / 1e9
    return found


def busy(address: str, pid: int, lines: int, workers: int) -> Busy:
    """A batch of fresh systems, with the time of all processes below the service."""
    dice = random.Random(11)
    body = "".join(json.dumps(fresh_system(dice)) + "\n" for _ in range(lines))
    with httpx.Client(base_url=address, timeout=None, trust_env=False) as client:
        response = client.post(
            "/v1/batches", content=body, headers={"Content-Type": "application/x-ndjson"}
        )
        before, idle, begin = cpu_below(pid), _machine(), time.monotonic()
        text = client.get(response.headers["location"] + "/results").text
    seconds = time.monotonic() - begin
    assert sum(map(bool, text.splitlines())) == lines
    used, (total, free) = (
        cpu_below(pid) - before,
        (b - a for a, b in zip(idle, _machine(), strict=True)),
    )
    cores = len(os.sched_getaffinity(0))
    shares = (round(used / seconds / cores, 3), round(1 - free / total, 3))
    return Busy(workers, lines, round(seconds, 2), round(lines / seconds, 1), *shares)


def cpu_below(pid: int) -> float:
    """Processor seconds of a process and its live descendants (workers live through a batch)."""
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
    parser.add_argument("--clients", type=int, nargs="+", default=[1, 20, 100])
    parser.add_argument("--seconds", type=float, default=8.0, help="of each row")
    parser.add_argument("--lines", type=int, default=1000, help="of the batch; 0: no batch")
    parser.add_argument("--workers", type=int, default=2, help="most workers of the batch")
    parser.add_argument("--output", type=Path, help="folder for service.json")
    parser.add_argument("--page", type=Path, help="page whose place `load` gets the tables")
    chosen = parser.parse_args(arguments)
    found: dict[str, Any] = {"batch": []}
    for workers in range(1, chosen.workers + 1 if chosen.lines else 0):
        with service(WORKERS=str(workers)) as (address, pid):
            found["batch"].append(asdict(busy(address, pid, chosen.lines, workers)))
    found["load"] = [asdict(row) for row in compared(chosen.clients, chosen.seconds)]
    found["conditions"] = conditions()
    text = json.dumps(found, indent=1)
    print(text)
    if chosen.output:
        chosen.output.mkdir(parents=True, exist_ok=True)
        (chosen.output / "service.json").write_text(text, encoding="utf-8")
    if chosen.page:
        put(chosen.page, "load", markdown(found, chosen.seconds))


def number(value: float) -> str:
    """Format with three digits, or with all digits of the integer part."""
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def markdown(found: dict[str, Any], seconds: float) -> str:
    """The tables of docs/records/reliability.md."""
    rows = []
    for one, two in zip(found["load"][::2], found["load"][1::2], strict=True):
        cells = [
            number(row[key]) for row in (two, one) for key in ("rate", "p50", "p99", "processor")
        ]
        rows.append(
            [two["question"], str(two["clients"]), *cells, f"{two['rate'] / one['rate']:.2f}"]
        )
    head = [
        "question",
        "clients",
        "service, 1/s",
        "p50, ms",
        "p99, ms",
        "web process, ms",
        "bare, 1/s",
        "p50, ms",
    ]
    text = f"{found['conditions']}; {seconds:g} s for each row, measured alternately:\n\n"
    text += table([*head, "p99, ms", "web process, ms", "ratio of rates"], rows)
    batches = [
        [
            str(row["workers"]),
            str(row["lines"]),
            f"{row['lines_per_second']:.3g}",
            f"{row['busy_by_service']:.0%}",
        ]
        for row in found["batch"]
    ]
    head = ["workers", "lines of a batch", "lines a second", "of all cores' time, the service"]
    return f"{text}\n{table(head, batches)}" if batches else text


if __name__ == "__main__":
    main(sys.argv[1:])
