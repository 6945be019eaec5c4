"""A Dask cluster of real processes on loopback, started as users start it; all processes are
stopped at the end.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from inverse_service.service.jobs.workers import die_with_parent
from inverse_service.statements.stages import DECISION, Part, Stage

DASK = [sys.executable, "-m", "dask"]
# Dask's nanny needs semaphores in /dev/shm; without a nanny the test restarts the worker.
NANNY = [] if os.access("/dev/shm", os.W_OK) else ["--no-nanny"]
QUIET = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


def telling(report: Callable[[Any], None]) -> str:
    """A task that tells a stage and a part of a result, as the solver does."""
    report(Stage(DECISION, timed=True))
    report({"parts": [Part.EXISTENCE], "value": {"open": {"part": Part.EXISTENCE}}})
    return "told"


class Cluster:
    """One scheduler and some workers, each in a session of its own; they can be killed and started
    again.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        with socket.create_server(("127.0.0.1", 0)) as free:
            self._port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self._port}"
        self.scheduler: subprocess.Popen[bytes] | None = None
        self.workers: list[subprocess.Popen[bytes]] = []
        self._sessions: list[int] = []

    def start_scheduler(self) -> None:
        options = ["--host", "127.0.0.1", "--port", str(self._port), "--no-dashboard"]
        self.scheduler = self._start([*DASK, "scheduler", *options])

    def start_worker(self, threads: int = 1) -> None:
        options = [
            "--nthreads",
            str(threads),
            "--no-dashboard",
            "--local-directory",
            str(self._folder),
            *NANNY,
        ]
        self.workers.append(
            self._start([*DASK, "worker", self.address, "--host", "127.0.0.1", *options])
        )

    def kill_scheduler(self) -> None:
        assert self.scheduler is not None
        end(self.scheduler)

    def kill_worker(self, index: int = 0) -> None:
        """Kill the worker and its nanny at once, as when a machine is lost."""
        worker = self.workers.pop(index)
        for pid in [*processes(worker.pid)]:
            if b"forkserver" not in command_of(pid):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        worker.wait()

    def stop(self) -> None:
        for process in [*self.workers, *([self.scheduler] if self.scheduler else [])]:
            end(process)
        for session in self._sessions:
            for pid in processes(session):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)

    def left(self, seconds: float) -> list[int]:
        """Processes of all earlier sessions that are alive after this many seconds."""
        present = {worker.pid for worker in self.workers} | (
            {self.scheduler.pid} if self.scheduler else set()
        )
        gone = [session for session in self._sessions if session not in present]
        stop = time.monotonic() + seconds
        while (
            found := [pid for session in gone for pid in processes(session)]
        ) and time.monotonic() < stop:
            time.sleep(0.05)
        return found

    def _start(self, command: list[str]) -> subprocess.Popen[bytes]:
        # A test run that is killed leaves no cluster behind.
        process = subprocess.Popen(
            command, start_new_session=True, preexec_fn=die_with_parent, **QUIET
        )  # type: ignore[call-overload]
        self._sessions.append(process.pid)
        return process  # type: ignore[no-any-return]


@contextmanager
def dask_cluster(folder: Path, workers: int, threads: int = 1) -> Iterator[Cluster]:
    """A running cluster."""
    cluster = Cluster(folder)
    try:
        cluster.start_scheduler()
        for _ in range(workers):
            cluster.start_worker(threads)
        yield cluster
    finally:
        cluster.stop()


def end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()


def processes(session: int) -> list[int]:
    """Processes of a session that are not zombies."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            state, _, _, its_session = (folder / "stat").read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(its_session) == session and state != "Z":
            found.append(int(folder.name))
    return found


def command_of(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""
