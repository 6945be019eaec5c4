"""The front's side of a Dask cluster: tasks out, outcomes back, and both again when something dies.

Dask tells the truth about tasks only as long as its scheduler lives. So every task stays here until
its outcome is here: a scheduler that comes back gets the open ones again. A worker that dies is the
scheduler's affair, which runs its tasks on another one; a task whose workers die again and again
ends as a crash.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
import time
import uuid
from concurrent.futures import CancelledError
from dataclasses import dataclass
from typing import Any

import dask
import distributed
from distributed.scheduler import KilledWorker

from inverse_service.errors import InputError
from inverse_service.service.cluster import remote
from inverse_service.service.cluster.remote import Terms, difference, fingerprint
from inverse_service.service.jobs.outcome import Call, Outcome, Usage
from inverse_service.service.jobs.workers import Report, Running

log = logging.getLogger(__name__)
LOOK = 0.5
CONNECT = 10.0
FAILURES = 20


@dataclass(slots=True, eq=False)
class RemoteRunning(Running):
    """A task of the cluster; `future` is Dask's while the scheduler has it."""

    key: str = ""
    cluster: Cluster | None = None
    future: Any = None
    failures: int = 0
    # When it was heard of first; a machine that is told to stop says no more of what it used.
    heard: float | None = None

    def spent(self) -> Usage:
        """What it has taken so far, as if it had had a processor all the time."""
        wall = 0.0 if self.heard is None else time.monotonic() - self.heard
        return Usage(wall, wall)

    @property
    def has_begun(self) -> bool:
        """Only the scheduler knows."""
        return True

    def cancel(self) -> None:
        """Drop it where it waits, kill its process where it runs."""
        self._cancelled = True
        if self.cluster is not None:
            self.cluster.abandon(self)


class Cluster:
    """An Executor (see `workers`) on the workers of a Dask scheduler; safe to use from any thread."""

    def __init__(self, address: str, memory_limit: int) -> None:
        self._address = address
        self._terms = Terms(fingerprint(), memory_limit, f"inverse-service-{uuid.uuid4().hex}")
        self._lock = threading.Lock()
        self._open: dict[str, RemoteRunning] = {}
        self._wake = threading.Event()
        self._stopped = False
        self._client: Any = None
        self._threads = 0
        self._next_look = 0.0
        self._scheduler_lost = False
        self._steward = threading.Thread(target=self._look_after, name="cluster", daemon=True)

    @property
    def capacity(self) -> int:
        """The threads of all workers, at least one: what is submitted waits for a worker to come."""
        return max(1, self._threads)

    def fault(self) -> str:
        """The scheduler may be away, or without workers."""
        if self._stopped or self._client is None or self._scheduler_lost or self._client.status != "running":
            return "The cluster's scheduler does not answer."
        return "" if self._threads else "The cluster has no worker."

    def start(self) -> None:
        """Connect; once. Raises InputError: no scheduler answers, or a worker has another program."""
        if self._client is not None:
            return
        _silence_dask()
        try:
            self._client = self._connected()
        except (OSError, ValueError) as error:
            raise InputError(
                f"No Dask scheduler answers at the cluster's address ({type(error).__name__}); "
                "start one with 'dask scheduler', or correct the address."
            ) from None
        try:
            self._refuse_strangers()
        except InputError:
            _close(self._client)
            self._client = None
            raise
        self._steward.start()

    def submit(self, call: Call, report: Report | None = None) -> Running:
        """Run the call on some worker; returns at once."""
        running = RemoteRunning(call, report, key=f"inverse-service-{uuid.uuid4().hex}", cluster=self)
        with self._lock:
            refused = self._stopped
            if not refused:
                self._open[running.key] = running
        if refused:
            running.end(Outcome("crash", detail="The cluster is given up."))
        self._wake.set()
        return running

    def withdraw(self, running: Running) -> None:
        """Cancel a task."""
        running.cancel()

    def abandon(self, running: RemoteRunning) -> None:
        """The task is cancelled: it ends here at once, and there as soon as the message arrives."""
        if not self._close_task(running, Outcome("cancelled", spent=running.spent())):
            return
        future, client = running.future, self._client
        if future is not None:
            threading.Thread(target=_stop_there, args=(client, future, running.key), daemon=True).start()

    def stop(self) -> None:
        """Cancel everything and disconnect."""
        with self._lock:
            self._stopped = True
            tasks = list(self._open.values())
        for task in tasks:
            task.cancel()
        self._wake.set()
        if self._steward.ident is not None:
            self._steward.join(CONNECT)
        _close(self._client)

    def _look_after(self) -> None:
        while not self._stopped:
            self._wake.clear()
            try:
                self._tend()
            except Exception as error:  # whatever dies in Dask, the tasks stay here and are sent again
                log.warning("the cluster does not answer (%s); trying again", type(error).__name__)
                self._threads = 0
            self._wake.wait(LOOK)

    def _tend(self) -> None:
        if self._scheduler_lost or self._client.status != "running":
            self._connect_again()
        if time.monotonic() >= self._next_look:
            self._threads = sum(self._client.nthreads().values())
            self._next_look = time.monotonic() + LOOK
        with self._lock:
            waiting = [task for task in self._open.values() if task.future is None]
        for task in waiting:
            self._send(task)

    def _send(self, task: RemoteRunning) -> None:
        future = self._client.submit(
            remote.perform,
            task.key,
            task.call,
            self._terms,
            key=f"{task.key}-{uuid.uuid4().hex[:8]}",
            pure=False,
        )
        task.future = future
        future.add_done_callback(lambda done: self._arrived(task, done))
        if task.is_cancelled:
            future.cancel()

    def _arrived(self, task: RemoteRunning, future: Any) -> None:
        """Dask says that a task ended: for good, or because its scheduler did."""
        if task.future is not future or task.is_cancelled:
            return
        try:
            found = future.result()
        except KilledWorker:
            found = Outcome("crash", detail="the machines that ran this task died one after another")
        except (asyncio.CancelledError, CancelledError):
            self._scheduler_lost = True  # the next one gets the task
            self._wake.set()
            return
        except Exception as error:
            found = f"{type(error).__name__}: {error}"
        if isinstance(found, Outcome):
            self._close_task(task, found)
        else:
            self._failed(task, found)

    def _failed(self, task: RemoteRunning, reason: str) -> None:
        """A worker could not run the task at all, as with another program; another one may."""
        log.error("a worker of the cluster cannot run a task: %s", reason)
        task.failures += 1
        if task.failures >= FAILURES:
            self._close_task(task, Outcome("crash", detail=f"no worker of the cluster can run this task: {reason}"))
        task.future = None

    def _close_task(self, task: RemoteRunning, outcome: Outcome) -> bool:
        """Hand the outcome over; False where that was done before."""
        with self._lock:
            is_open = self._open.pop(task.key, None) is not None
        if is_open:
            task.end(outcome)
        return is_open

    def _connected(self) -> Any:
        """A new client; raises OSError where no scheduler answers."""
        with dask.config.set({"distributed.comm.timeouts.connect": f"{CONNECT}s"}):
            client = distributed.Client(self._address, timeout=CONNECT, set_as_default=False, name="inverse-service")  # type: ignore[no-untyped-call]
        client.subscribe_topic(self._terms.topic, self._reported)  # type: ignore[no-untyped-call]
        return client

    def _reported(self, event: tuple[float, dict[str, Any]]) -> None:
        task = self._open.get(event[1]["key"])
        if task is not None:
            task.heard = task.heard or time.monotonic()
        if task is not None and task.report is not None:
            task.report(event[1]["value"])

    def _connect_again(self) -> None:
        """With a new client: the old one would come back without its topics."""
        self._threads, self._next_look = 0, 0.0
        _close(self._client)
        self._client = self._connected()
        self._scheduler_lost = False
        with self._lock:
            for task in self._open.values():
                task.future = None
        log.warning("the cluster's scheduler answers again")

    def _refuse_strangers(self) -> None:
        """Raises InputError where a worker that is there now has another program, or none of ours."""
        found = self._client.run(remote.fingerprint, on_error="return")
        for theirs in found.values():
            if not isinstance(theirs, dict):
                raise InputError(
                    "A worker of the cluster cannot load this program "
                    f"({type(theirs).__name__}); install inverse-service[dask] in its environment."
                )
            if differs := difference(self._terms.fingerprint, theirs):
                raise InputError(f"A worker of the cluster has another program: {differs}; install the same on all.")
        self._threads = sum(self._client.nthreads().values())
        if not found:
            log.warning("the cluster has no worker yet; the work waits for one")


def _silence_dask() -> None:
    """Its tracebacks about a dead scheduler; what matters of them is said here in a line."""
    for name in list(logging.root.manager.loggerDict):
        if name.split(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)


def _stop_there(client: Any, future: Any, key: str) -> None:
    """In a thread of its own: who cancels does not wait for a cluster."""
    try:
        future.cancel()
        client.run(remote.cancel, key, wait=False)
    except Exception as error:
        log.warning("a cancelled task could not be stopped on the cluster (%s)", type(error).__name__)


def _close(client: Any) -> None:
    """Disconnect, without waiting for a scheduler that is gone."""
    if client is not None:
        with contextlib.suppress(Exception):
            client.close(timeout=2)
