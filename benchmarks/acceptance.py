"""How many questions a second the service acknowledges, beside procrastinate.

`python -m benchmarks.acceptance [--postgres] [--procrastinate PYTHON] [--formula F] [--seconds S]`
asks each question once (`x'' = -N*F`, `Prefer: respond-async`) by 1 and by 16 callers, while the
operator lets no job begin, so that only acceptance counts. `--tree FOLDER` serves another checkout;
named twice, both are asked in turn. PYTHON is an interpreter with procrastinate and psycopg, whose
`defer_async` stores the same documents in the same server, without reading them.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import httpx

from tests.store.server import server

CALLERS = (1, 16)
HEAD = (
    b"POST /v1/solve HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    b"Prefer: respond-async\r\nContent-Length: %d\r\n\r\n"
)
PEER = """
import asyncio, itertools, sys, time, procrastinate
async def main(address, callers, seconds):
    app = procrastinate.App(connector=procrastinate.PsycopgConnector(conninfo=address, max_size=20))
    @app.task(name="solve")
    async def solve(document): ...
    async with app.open_async():
        await app.schema_manager.apply_schema_async()
        numbers, end, done = itertools.count(), time.monotonic() + seconds, 0
        async def ask():
            nonlocal done
            while time.monotonic() < end:
                await solve.defer_async(document='{"equations": "x\\'\\' = -%d*x"}' % next(numbers))
                done += 1
        await asyncio.gather(*(ask() for _ in range(callers)))
        print(done / seconds)
asyncio.run(main(sys.argv[1], int(sys.argv[2]), float(sys.argv[3])))
"""


@contextlib.contextmanager
def drained_service(tree: Path, database: str) -> Iterator[str]:
    """The address of a service of this checkout that starts no job."""
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


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a row for each run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--postgres", action="store_true")
    parser.add_argument("--procrastinate", metavar="PYTHON")
    parser.add_argument("--formula", default="x")
    parser.add_argument("--seconds", type=float, default=4.0)
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
                with drained_service(tree, database) as address:
                    rate = asyncio.run(
                        acknowledged(address, callers, chosen.formula, chosen.seconds)
                    )
                print(f"| {tree.name} | {callers} | {rate:.0f} |", flush=True)
            if started is not None and chosen.procrastinate:
                words = [
                    started.database(f"peer{run}_{callers}"),
                    str(callers),
                    str(chosen.seconds),
                ]
                peer = [chosen.procrastinate, "-c", PEER, *words]
                found = subprocess.run(peer, check=True, capture_output=True, text=True).stdout
                print(f"| procrastinate | {callers} | {float(found):.0f} |", flush=True)


if __name__ == "__main__":
    main()
