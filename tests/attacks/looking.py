"""A separate process that watches a service during an attack; it starts fast because it imports
little.
"""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass
from http.client import HTTPConnection
from multiprocessing.connection import Connection
from pathlib import Path

OTHER = "127.0.0.2"
LOOK_EVERY = 0.02
FEWEST_LOOKS = 40


@dataclass(frozen=True)
class Cores:
    """How long a thread ran on a core, and how long it waited for a busy one; s."""

    ran: float
    waited: float

    @staticmethod
    def of(thread: Path) -> Cores:
        ran, waited, _ = map(int, (thread / "schedstat").read_text().split())
        return Cores(ran / 1e9, waited / 1e9)


def cores_of(process: int) -> dict[str, Cores]:
    """The times of each thread of a process."""
    found = {}
    for place in Path(f"/proc/{process}/task").iterdir():
        with contextlib.suppress(OSError):  # the thread has ended
            found[place.name] = Cores.of(place)
    return found


def memory_of(process: int) -> float:
    """Resident memory of a process in MiB."""
    for line in Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    raise AssertionError("the service is gone")


@dataclass(frozen=True)
class Look:
    """One look: the time that the service took, the total time (s), and the memory of the web
    process (MiB).
    """

    held: float
    whole: float
    memory: float


def look(address: str, process: int, other: Connection) -> None:
    """Look at /livez until the other end stops the watch, then send it all looks."""
    own, looks = Path("/proc/thread-self"), list[Look]()
    client = HTTPConnection(
        address.removeprefix("http://"), timeout=30.0, source_address=(OTHER, 0)
    )
    with contextlib.closing(client):
        other.send("looking")
        while not other.poll() or len(looks) < FEWEST_LOOKS:
            before, waited, began = cores_of(process), Cores.of(own).waited, time.monotonic()
            client.request("GET", "/livez")
            with client.getresponse() as answer:
                assert answer.status == 200
                answer.read()
            whole = time.monotonic() - began
            held = _held(process, before, whole - (Cores.of(own).waited - waited))
            looks.append(Look(held, whole, memory_of(process)))
            time.sleep(LOOK_EVERY)
    other.send(looks)


def _held(process: int, before: dict[str, Cores], seconds: float) -> float:
    """The service's time in a look: no waits for a core by its loop or lock holder, at least the
    loop's own work.
    """
    loop = str(process)
    now = {name: found for name, found in cores_of(process).items() if name in before}
    others = (now[name].waited - before[name].waited for name in now if name != loop)
    waited = now[loop].waited - before[loop].waited + max(others, default=0.0)
    return max(now[loop].ran - before[loop].ran, seconds - waited)
