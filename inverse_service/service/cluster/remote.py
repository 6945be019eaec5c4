"""What runs inside a Dask worker: hand an order to the host of killable workers there and wait.

Dask can neither stop a running task nor bound its memory; the host can. There is one host for each
Dask worker process, with one worker process for each of its threads.
"""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as WaitedTooLong
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from multiprocessing.connection import Connection
from typing import Any, Final

from inverse_service.service.jobs import model, workers
from inverse_service.service.jobs.outcome import Call, Outcome

# A cold machine loads the engine and its kernels first; the deadline itself is the host's.
GRACE = 60.0
MODULE = "inverse_service.service.cluster.host"
Report = Callable[[str, Any], None]


@dataclass(frozen=True, slots=True)
class Fingerprint:
    """Versions: of this program with a digest of its text, of Python, and of the packages that matter."""

    engine: str
    python: str
    distributed: str
    flint: str


def fingerprint() -> Fingerprint:
    """That of this process."""
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return Fingerprint(model.engine_version(), python, _version("distributed"), _version("python-flint"))


def difference(ours: Fingerprint, theirs: Fingerprint) -> str:
    """What differs, in words; empty where nothing does."""
    mine, yours = asdict(ours), asdict(theirs)
    return ", ".join(f"{name} {yours[name]} instead of {mine[name]}" for name in mine if mine[name] != yours[name])


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


REPORT: Final = "report"
DONE: Final = "done"


@dataclass(frozen=True, slots=True)
class Order:
    """Do what `call` says; `key` names it in what comes back."""

    key: str
    call: Call


@dataclass(frozen=True, slots=True)
class Cancel:
    """Kill the process that works on this order, or forget the order."""

    key: str


@dataclass(frozen=True, slots=True)
class Terms:
    """What every task of a front is sent with: its versions, MiB for a process, where reports go."""

    fingerprint: Fingerprint
    memory_limit: int
    topic: str


class HostProcess:
    """The host's process, seen from the Dask worker; its methods may be called from any thread."""

    def __init__(self, count: int, memory_limit: int) -> None:
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-m", MODULE, str(theirs.fileno()), str(count), str(memory_limit)]
        with theirs:
            self._process = subprocess.Popen(command, stdin=subprocess.DEVNULL, pass_fds=[theirs.fileno()])
        self._connection = Connection(ours.detach())
        self._lock = threading.Lock()
        self._waiting: dict[str, tuple[Future[Outcome], Report]] = {}
        self.memory_limit = memory_limit
        self.is_alive = True
        threading.Thread(target=self._listen, name="cluster-host", daemon=True).start()

    def order(self, order: Order, report: Report) -> Outcome:
        """Run it there; a host that dies or keeps silent past the deadline is a crash."""
        answer: Future[Outcome] = Future()
        with self._lock:
            self._waiting[order.key] = answer, report
            if not self._send(order):
                self._give_up()
        try:
            return answer.result(workers.MOST_CROWDED * order.call.deadline + GRACE)
        except WaitedTooLong:
            self.stop()
            return Outcome("crash", detail="the host of the worker processes kept silent past the deadline")

    def cancel(self, key: str) -> None:
        """Have the work on an order killed; nothing happens where there is no such order."""
        with self._lock:
            if key in self._waiting:
                self._send(Cancel(key))

    def stop(self) -> None:
        """End the process and with it its workers."""
        self._process.kill()
        self._process.wait()

    def _send(self, message: Order | Cancel) -> bool:
        with contextlib.suppress(OSError):
            self._connection.send(message)
            return self.is_alive
        return False

    def _listen(self) -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                self._receive(*self._connection.recv())
        with self._lock:
            self._give_up()
        self._process.wait()

    def _receive(self, kind: str, key: str, value: Any) -> None:
        with self._lock:
            found = self._waiting.pop(key, None) if kind == DONE else self._waiting.get(key)
        if found is None:
            return
        answer, report = found
        if kind == DONE:
            answer.set_result(value)
        else:
            report(key, value)

    def _give_up(self) -> None:
        self.is_alive = False
        waiting, self._waiting = self._waiting, {}
        for answer, _ in waiting.values():
            answer.set_result(Outcome("crash", detail="the host of the worker processes died"))


_lock = threading.Lock()
_host: HostProcess | None = None


def perform(order: Order, terms: Terms) -> Outcome | str:
    """The Dask task: the outcome of an order, or what differs between the front's program and this one."""
    if differs := difference(terms.fingerprint, fingerprint()):
        return differs
    from distributed import get_worker

    worker = get_worker()

    def report(key: str, value: Any) -> None:
        worker.log_event(terms.topic, {"key": key, "value": value})

    return _current_host(worker.state.nthreads, terms.memory_limit).order(order, report)


async def cancel(key: str) -> None:
    """Kill the work on an order if this machine has it; runs in parallel with the tasks, not as one of them.

    A coroutine, as Dask waits for all machines where it is a plain function.
    """
    if _host is not None:
        _host.cancel(key)


def _current_host(count: int, memory_limit: int) -> HostProcess:
    global _host
    with _lock:
        if _host is None or not _host.is_alive or _host.memory_limit != memory_limit:
            if _host is not None:
                _host.stop()
            _host = HostProcess(count, memory_limit)
        return _host
