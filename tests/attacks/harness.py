"""A separate service for each attack, and another client that watches it during the attack.

Everything stays on this machine: the attacker is 127.0.0.1, the other client 127.0.0.2.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType

import httpx

from tests.attacks.looking import OTHER, look, memory_of
from tests.serving import COMMAND, serving, until

# Longest allowed look, without the time for which the cores ran other programs; a blocked loop
# shows seconds.
FREEZE = 0.1
MEMORY = 500.0
# 250 bytes whose exponents have a common denominator of millions: parsing them does not end by
# itself.
ENDLESS = {
    "coordinates": ["x", "y", "z"],
    "lagrangian": "x'^2/2+y'^2/2+z'^2/2-("
    + "+".join(f"exp(x/{p})" for p in (2, 3, 5, 7, 11, 13, 17, 19, 23))
    + ")",
    "constraints": ["z'=y*x'"],
}


@dataclass(frozen=True)
class Attacked:
    """A service that runs for one test."""

    address: str
    process: subprocess.Popen[str]
    log: Path

    @property
    def port(self) -> int:
        return int(self.address.rpartition(":")[2])

    def client(self, timeout: float = 60.0) -> httpx.Client:
        """The attacker."""
        limits = httpx.Limits(max_connections=1_000)
        return httpx.Client(base_url=self.address, timeout=timeout, limits=limits)

    def other(self, timeout: float = 30.0) -> httpx.Client:
        """Another client, with another address."""
        transport = httpx.HTTPTransport(local_address=OTHER)
        return httpx.Client(base_url=self.address, timeout=timeout, transport=transport)

    def send_and_leave(self, request: bytes, count: int, seconds: float) -> None:
        """The same bytes on many connections, all of them closed after some seconds."""
        found = [socket.create_connection(("127.0.0.1", self.port)) for _ in range(count)]
        for connection in found:
            connection.sendall(request)
        time.sleep(seconds)
        for connection in found:
            connection.close()

    def memory(self) -> float:
        """Return the resident memory of the web process in MiB."""
        return memory_of(self.process.pid)

    def seconds_to_end(self) -> float:
        """Send SIGTERM and return how long the service takes to end."""
        began = time.monotonic()
        self.process.send_signal(signal.SIGTERM)
        assert self.process.wait(30) == 0
        return time.monotonic() - began


@contextmanager
def attacked(folder: Path, descriptors: int | None = None, **settings: str) -> Iterator[Attacked]:
    """A ready service with a new database, optionally with a limited number of descriptors."""
    command = (
        COMMAND
        if descriptors is None
        else ["sh", "-c", f'ulimit -n {descriptors}; exec "$@"', "sh", *COMMAND]
    )
    settings = {"database": str(folder / "jobs.sqlite")} | settings
    log = folder / "log"
    with log.open("wb") as stream, serving(command, stream, **settings) as (process, address):
        try:
            until(lambda: httpx.get(f"{address}/readyz", timeout=30).status_code == 200)
            yield Attacked(address, process, log)
        finally:
            process.kill()


@dataclass
class Watch:
    """Watches /livez as another client during an attack, and the memory of the web process. Each
    look excludes the time for which the threads of the service, or the watcher, waited for a core
    that other programs used. A look is never shorter than the work of the loop during it. The
    watcher is a separate process, because the attacker's threads would hold the interpreter lock.
    """

    service: Attacked
    seconds: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)
    memory: float = 0.0

    def __enter__(self) -> Watch:
        spawn = multiprocessing.get_context("spawn")
        self._end, theirs = spawn.Pipe()
        self._process = spawn.Process(
            target=look, args=(self.service.address, self.service.process.pid, theirs)
        )
        self._process.start()
        theirs.close()
        assert self._end.recv() == "looking"
        return self

    def __exit__(
        self, kind: type | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end.send("end")
        looks = self._end.recv()
        self._process.join()
        self.seconds = [each.held for each in looks]
        self.whole = [each.whole for each in looks]
        self.memory = max(each.memory for each in looks)

    @property
    def usual(self) -> float:
        """The longest of the fastest 9 of 10 looks, s."""
        return sorted(self.seconds)[int(0.9 * len(self.seconds))]

    @property
    def longest(self) -> float:
        """The freeze: the longest look, s."""
        return max(self.seconds)

    def hold(self) -> None:
        """Fail if the loop was blocked or the web process grew; `pytest -rP` shows the numbers."""
        figures = f"/livez at the longest {1e3 * self.longest:.0f} ms, 9 of 10 below {1e3 * self.usual:.0f} ms"
        print(
            f"{figures}, {1e3 * max(self.whole):.0f} ms with waiting for cores, web process {self.memory:.0f} MiB"
        )
        if (
            "PYTEST_XDIST_WORKER" not in os.environ
        ):  # other tests at the same time would be measured, too
            assert self.longest < FREEZE, f"/livez took {self.longest:.3f} s"
        assert self.memory < MEMORY, f"the web process had {self.memory:.0f} MiB"


def is_open(connection: socket.socket) -> bool:
    """Whether the service kept the connection open; reads its earlier output."""
    connection.setblocking(False)
    try:
        while connection.recv(65_536):
            pass
    except BlockingIOError:
        return True
    except OSError:
        pass
    connection.close()
    return False
