"""A service of its own for each attack, and another client that looks at it meanwhile.

Everything stays on this machine: the attacker is 127.0.0.1, the other client 127.0.0.2.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType

import httpx

COMMAND = [sys.executable, "-m", "inverse_service.cli", "serve", "--port", "0"]
OTHER = "127.0.0.2"
LOOK_EVERY = 0.02
FEWEST_LOOKS = 40
# What the longest look may take, without the time for which the cores did something else; a loop that is held shows
# seconds.
FREEZE = 0.1
MEMORY = 500.0
# 250 bytes whose exponents have a common denominator of millions: its reading does not end by itself.
ENDLESS = {
    "coordinates": ["x", "y", "z"],
    "lagrangian": "x'^2/2+y'^2/2+z'^2/2-(" + "+".join(f"exp(x/{p})" for p in (2, 3, 5, 7, 11, 13, 17, 19, 23)) + ")",
    "constraints": ["z'=y*x'"],
}


@dataclass(frozen=True)
class Cores:
    """For how long a thread was on a core, and ready for one that did something else; s."""

    ran: float
    waited: float

    @staticmethod
    def of(thread: Path) -> Cores:
        ran, waited, _ = map(int, (thread / "schedstat").read_text().split())
        return Cores(ran / 1e9, waited / 1e9)


def cores_of(process: int) -> dict[str, Cores]:
    """Those of each thread of a process."""
    found = {}
    for place in Path(f"/proc/{process}/task").iterdir():
        with contextlib.suppress(OSError):  # ended meanwhile
            found[place.name] = Cores.of(place)
    return found


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
        """Somebody else, from another address."""
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
        """Resident memory of the web process in MiB."""
        for line in Path(f"/proc/{self.process.pid}/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) / 1024
        raise AssertionError("the service is gone")

    def seconds_to_end(self) -> float:
        """SIGTERM, and how long the service takes."""
        began = time.monotonic()
        self.process.send_signal(signal.SIGTERM)
        assert self.process.wait(30) == 0
        return time.monotonic() - began


@contextmanager
def attacked(folder: Path, descriptors: int | None = None, **settings: str) -> Iterator[Attacked]:
    """A service with a fresh database, ready to be asked; it may have only so many descriptors."""
    command = COMMAND if descriptors is None else ["sh", "-c", f'ulimit -n {descriptors}; exec "$@"', "sh", *COMMAND]
    environment = os.environ | {"INVERSE_SERVICE_DATABASE": str(folder / "jobs.sqlite"), "INVERSE_SERVICE_WORKERS": "2"}
    environment |= {f"INVERSE_SERVICE_{name.upper()}": value for name, value in settings.items()}
    log = folder / "log"
    with (
        log.open("wb") as stream,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stream, text=True, env=environment) as process,
    ):
        assert process.stdout is not None
        found = Attacked(process.stdout.readline().strip(), process, log)
        try:
            end = time.monotonic() + 60
            while httpx.get(f"{found.address}/readyz", timeout=30).status_code != 200 and time.monotonic() < end:
                time.sleep(0.1)
            yield found
        finally:
            process.kill()


@dataclass
class Watch:
    """Looks at /livez as another client while an attack goes on, and at the memory of the web process.

    What other programs on the same cores take is no work of the service: the time for which its threads, or who looks,
    waited for a core is taken off each look. A look is never shorter than what the loop itself did meanwhile.
    """

    service: Attacked
    seconds: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)
    memory: float = 0.0

    def __enter__(self) -> Watch:
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._look)
        self._thread.start()
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._end.set()
        self._thread.join()

    @property
    def usual(self) -> float:
        """What 9 of 10 looks took at most, s."""
        return sorted(self.seconds)[int(0.9 * len(self.seconds))]

    @property
    def longest(self) -> float:
        """The freeze: the longest look, s."""
        return max(self.seconds)

    def hold(self) -> None:
        """Fail where the loop was held or the web process grew; `pytest -rP` shows the figures."""
        figures = f"/livez at the longest {1e3 * self.longest:.0f} ms, 9 of 10 below {1e3 * self.usual:.0f} ms"
        print(f"{figures}, {1e3 * max(self.whole):.0f} ms with waiting for cores, web process {self.memory:.0f} MiB")
        assert self.longest < FREEZE, f"/livez took {self.longest:.3f} s"
        assert self.memory < MEMORY, f"the web process had {self.memory:.0f} MiB"

    def _look(self) -> None:
        own = Path("/proc/thread-self")
        with self.service.other() as client:
            while not self._end.is_set() or len(self.seconds) < FEWEST_LOOKS:
                before, waited, began = cores_of(self.service.process.pid), Cores.of(own).waited, time.monotonic()
                assert client.get("/livez").status_code == 200
                self.whole.append(time.monotonic() - began)
                self.seconds.append(self._held(before, self.whole[-1] - (Cores.of(own).waited - waited)))
                self.memory = max(self.memory, self.service.memory())
                time.sleep(LOOK_EVERY)

    def _held(self, before: dict[str, Cores], seconds: float) -> float:
        """What of a look the service took: all but the time for which its loop, or a thread that had the interpreter,
        waited for a core; never less than what the loop did meanwhile."""
        loop = str(self.service.process.pid)
        now = {name: found for name, found in cores_of(self.service.process.pid).items() if name in before}
        others = (now[name].waited - before[name].waited for name in now if name != loop)
        waited = now[loop].waited - before[loop].waited + max(others, default=0.0)
        return max(now[loop].ran - before[loop].ran, seconds - waited)
