"""How many questions a second the service acknowledges, beside procrastinate.

`python -m benchmarks.acceptance [--postgres] [--procrastinate PYTHON] [--formula F] [--seconds S]
[--ended N] [--waiting N]` asks each question once (`x'' = -N*F`, `Prefer: respond-async`) by 1 and
by 16 callers, while the operator lets no job begin, so that only acceptance counts. `--tree FOLDER`
serves another checkout; named twice, both are asked in turn. PYTHON is an interpreter with
procrastinate and psycopg, whose `defer_async` stores the same documents in the same server, without
reading them. So many jobs that have ended, and that wait, are in every store before. `--lines N`
sends eight batches of N new lines each instead, and prints the milliseconds until each is
acknowledged.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import itertools
import json
import os
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import httpx
import psycopg

from tests.store.server import server

CALLERS = (1, 16)
HEAD = (
    b"POST /v1/solve HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    b"Prefer: respond-async\r\nContent-Length: %d\r\n\r\n"
)
PEER = """
import asyncio, itertools, sys, time, procrastinate
async def main(address, callers, seconds, ended, waiting):
    app = procrastinate.App(connector=procrastinate.PsycopgConnector(conninfo=address, max_size=20))
    @app.task(name="solve")
    async def solve(document): ...
    async with app.open_async():
        await app.schema_manager.apply_schema_async()
        before = (
            "INSERT INTO procrastinate_jobs (queue_name, task_name, args, status)"
            " SELECT 'default', 'solve', '{}', '%s' FROM generate_series(1, %d)"
        )
        for status, count in (("succeeded", ended), ("todo", waiting)):
            await app.connector.execute_query_async(before % (status, count))
        await app.connector.execute_query_async("ANALYZE")
        numbers, end, done = itertools.count(), time.monotonic() + seconds, 0
        async def ask():
            nonlocal done
            while time.monotonic() < end:
                await solve.defer_async(document='{"equations": "x\\'\\' = -%d*x"}' % next(numbers))
                done += 1
        await asyncio.gather(*(ask() for _ in range(callers)))
        print(done / seconds)
given = sys.argv[1:]
asyncio.run(main(given[0], int(given[1]), float(given[2]), int(given[3]), int(given[4])))
"""


# Jobs that were there before, in the columns that every version of the store has.
BEFORE = """
INSERT INTO jobs (id, kind, document, options, status, client, priority, created, finished)
WITH RECURSIVE one (number) AS (SELECT 1 UNION ALL SELECT number + 1 FROM one WHERE number < {count})
SELECT '{status} ' || number, 'solve', '{{"equations": "x'''' = -' || number || '*x"}}', '{{}}',
'{status}', 'others', 0, 1e9, {finished} FROM one WHERE {count} > 0
"""


def fill(database: str, ended: int, waiting: int) -> None:
    """Store so many jobs in tables that are there already."""
    is_postgres = database.startswith("postgresql:")
    connect: Callable[[str], Any] = psycopg.connect if is_postgres else sqlite3.connect
    with contextlib.closing(connect(database)) as connection:
        if is_postgres:
            connection.execute("SET search_path TO inverse_service")
        for status, count, finished in (
            ("successful", ended, "1e9"),
            ("accepted", waiting, "NULL"),
        ):
            connection.execute(BEFORE.format(status=status, count=count, finished=finished))
        connection.execute("ANALYZE")
        connection.commit()


@contextlib.contextmanager
def drained_service(tree: Path, database: str, ended: int, waiting: int) -> Iterator[str]:
    """The address of a service of this checkout that starts no job, with so many in its store."""
    settings = {"DATABASE": database, "WORKERS": "1", "QUEUE": "1000000", "CLIENT_QUEUE": "1000000"}
    environment = os.environ | {f"INVERSE_SERVICE_{key}": value for key, value in settings.items()}
    environment["PYTHONPATH"] = str(tree)
    command = [sys.executable, "-m", "inverse_service"]
    with subprocess.Popen(
        [*command, "serve", "--port", "0"], cwd=tree, env=environment, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, text=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        try:
            address = process.stdout.readline().strip()
            drain = [*command, "admin", "drain"]
            subprocess.run(drain, cwd=tree, env=environment, check=True, stdout=subprocess.DEVNULL)
            fill(database, ended, waiting)
            parsed = httpx.post(f"{address}/v1/parse", json={"equations": "x'' = -x"}, timeout=60)
            parsed.raise_for_status()
            yield address
        finally:
            process.terminate()


async def acknowledged(address: str, callers: int, formula: str, seconds: float) -> float:
    """Questions a second that these callers, each on one connection, have acknowledged (202)."""
    host, _, port = address.removeprefix("http://").partition(":")
    numbers, end, done = itertools.count(1), time.monotonic() + seconds, 0

    async def ask() -> None:
        nonlocal done
        reader, writer = await asyncio.open_connection(host, int(port))
        while time.monotonic() < end:
            body = json.dumps({"equations": f"x'' = -{next(numbers)}*{formula}"}).encode()
            writer.write(HEAD % len(body) + body)
            lines = (await reader.readuntil(b"\r\n\r\n")).lower().split(b"\r\n")
            assert b" 202 " in lines[0], lines[0]
            (size,) = (int(line[15:]) for line in lines if line.startswith(b"content-length:"))
            await reader.readexactly(size)
            done += 1
        writer.close()

    await asyncio.gather(*(ask() for _ in range(callers)))
    return done / seconds


def batches(address: str, lines: int) -> list[float]:
    """Milliseconds until each of eight batches of so many new lines is acknowledged, sorted."""
    found, head = list[float](), {"Content-Type": "application/x-ndjson", "Prefer": "respond-async"}
    with httpx.Client(base_url=address, timeout=60, trust_env=False) as client:
        for batch in range(8):
            numbers = range(batch * lines, (batch + 1) * lines)
            body = "".join(
                json.dumps({"id": k, "equations": f"x'' = -{k}*x"}) + "\n" for k in numbers
            )
            client.get("/livez")
            began = time.monotonic()
            answer = client.post("/v1/batches", content=body, headers=head)
            found.append(1000 * (time.monotonic() - began))
            assert answer.headers["preference-applied"] == "respond-async"
            place = answer.headers["location"]
            while client.get(place).json()["counts"].get("accepted") != lines:
                time.sleep(0.5)
            time.sleep(lines / 2_000)  # its lines are read and stored meanwhile
    return sorted(found)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a row for each run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--postgres", action="store_true")
    parser.add_argument("--procrastinate", metavar="PYTHON")
    parser.add_argument("--formula", default="x")
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--ended", type=int, default=0)
    parser.add_argument("--waiting", type=int, default=0)
    parser.add_argument("--lines", type=int)
    parser.add_argument("--tree", type=Path, action="append")
    chosen = parser.parse_args(arguments)
    trees = chosen.tree or [Path(__file__).parents[1]]
    with contextlib.ExitStack() as opened:
        started = opened.enter_context(server()) if chosen.postgres else None
        folder = Path(opened.enter_context(tempfile.TemporaryDirectory()))
        for run, callers in itertools.product(range(2), CALLERS):
            for place, tree in enumerate(trees):
                name = f"run{run}_{callers}_{place}"
                database = started.database(name) if started else str(folder / f"{name}.sqlite")
                held = drained_service(tree, database, chosen.ended, chosen.waiting)
                with held as address:
                    if chosen.lines:
                        told = " ".join(f"{each:.0f}" for each in batches(address, chosen.lines))
                        print(f"| {tree.name} | {told} |", flush=True)
                        continue
                    rate = asyncio.run(
                        acknowledged(address, callers, chosen.formula, chosen.seconds)
                    )
                print(f"| {tree.name} | {callers} | {rate:.0f} |", flush=True)
            if chosen.lines:
                break
            if started is not None and chosen.procrastinate:
                words = [
                    started.database(f"peer{run}_{callers}"),
                    str(callers),
                    str(chosen.seconds),
                    str(chosen.ended),
                    str(chosen.waiting),
                ]
                peer = [chosen.procrastinate, "-c", PEER, *words]
                found = subprocess.run(peer, check=True, capture_output=True, text=True).stdout
                print(f"| procrastinate | {callers} | {float(found):.0f} |", flush=True)


if __name__ == "__main__":
    main()
