"""Work on many machines: a Dask cluster whose tasks host the same killable worker processes (extra
`dask`).

Here: tasks out, outcomes back, and both again when something dies. Dask tells the truth about tasks
only as long as its scheduler lives. So every task stays here until its outcome is here: a scheduler
that comes back gets the open ones again. A worker that dies is the scheduler's affair, which runs
its tasks on another one; a task whose workers die again and again ends as a crash.

There (`perform`): a call on a pool of killable workers, because Dask can neither stop a running
task nor bound its memory. Each Dask worker process has one pool, with one worker process for each
of its threads. A Dask worker that is killed takes them with it: the death signal of `workers`
reaches them through the server that forked them.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import functools
import json
import logging
import multiprocessing
import sys
import threading
import time
import uuid
from collections import deque
from collections.abc import Coroutine
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any

import dask
import distributed
from distributed.scheduler import KilledWorker

from inverse_service.errors import InputError
from inverse_service.service.jobs import model, tasks, workers
from inverse_service.statements.stages import Stage

log = logging.getLogger(__name__)
LOOK = 0.5
CONNECT, CLOSE = 10.0, 2.0
FAILURES = 20
# How often (s) a task says how far it is; a line of a batch, which hardly anybody watches, more
# seldom. Each message costs worker, scheduler, and front a millisecond.
TELL, TELL_LINE = 0.2, 2.0
LOST = (asyncio.CancelledError, concurrent.futures.CancelledError)
Fingerprint = dict[str, str]
# A cold machine loads the engine and its kernels first; the deadline itself is the pool's.
GRACE = 60.0
_lock = threading.Lock()
_pools: dict[int, workers.Workers] = {}
_under_way: dict[str, workers.Running] = {}


@functools.cache
def fingerprint() -> Fingerprint:
    """Of this process: the engine with a digest of its text, Python, and the packages that
    matter.
    """
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return {"engine": model.engine_version(), "python": python} | {
        name: version(name) for name in ("distributed", "python-flint")
    }


def difference(ours: Fingerprint, theirs: Fingerprint) -> str:
    """What differs, in words; empty where nothing does."""
    return ", ".join(
        f"{name} {theirs[name]} instead of {ours[name]}"
        for name in ours
        if theirs[name] != ours[name]
    )


@dataclass(frozen=True, slots=True)
class Terms:
    """What every task of a front is sent with: its versions, MiB for a process, where reports
    go.
    """

    fingerprint: Fingerprint
    memory_limit: int
    topic: str


@dataclass(slots=True, eq=False)
class RemoteRunning(workers.Running):
    """A task of the cluster; `future` is Dask's when the scheduler has it."""

    key: str = ""
    cluster: Cluster | None = None
    future: Any = None
    # When it was heard of first; a machine that is told to stop says no more of what it used.
    heard: float | None = None

    @property
    def has_begun(self) -> bool:
        """Only the scheduler knows."""
        return True

    def cancel(self) -> None:
        """Drop it where it waits, kill its process where it runs: it ends here at once, there as
        soon as that hears.

        It counts as if it had had a processor all the time.
        """
        self.is_cancelled = True
        wall = 0.0 if self.heard is None else time.monotonic() - self.heard
        if (
            self.end(tasks.Outcome("cancelled", spent=tasks.Usage(wall, wall)))
            and self.cluster is not None
        ):
            self.cluster.abandon(self)


class Cluster:
    """An Executor (see `workers`) on the workers of a Dask scheduler; safe to use from any thread.

    A thread of its own has the loop on which everything of Dask happens; each task is a coroutine
    there.
    """

    def __init__(self, address: str, memory_limit: int) -> None:
        self._address = address
        self._terms = Terms(fingerprint(), memory_limit, f"inverse-service-{uuid.uuid4().hex}")
        self._open: dict[str, RemoteRunning] = {}
        self._stopped = False
        self._client: Any = None
        self._threads = 0
        self._loop, self._connecting = asyncio.new_event_loop(), asyncio.Lock()
        self._thread = threading.Thread(target=self._loop.run_forever, name="cluster", daemon=True)
        self._leaving: list[concurrent.futures.Future[None]] = []

    @property
    def capacity(self) -> int:
        """The threads of all workers, at least one: what is submitted waits for a worker to
        come.
        """
        return max(1, self._threads)

    def fault(self) -> str:
        """The scheduler may be away, or without workers."""
        if self._stopped or self._client is None or self._client.status != "running":
            return "The cluster's scheduler does not answer."
        return "" if self._threads else "The cluster has no worker."

    def start(self) -> None:
        """Connect; once. Raises InputError: no scheduler answers, or a worker has another
        program.
        """
        if self._client is None:
            _silence_dask()
            if not self._thread.is_alive():
                self._thread.start()
            self._on_loop(self._begin()).result()

    def submit(self, call: tasks.Call, report: tasks.Report | None = None) -> workers.Running:
        """Run the call on some worker; returns at once."""
        running = RemoteRunning(
            call, report, key=f"inverse-service-{uuid.uuid4().hex}", cluster=self
        )
        if self._stopped:
            running.end(tasks.Outcome("crash", detail="The cluster is given up."))
        else:
            self._open[running.key] = running
            self._on_loop(self._attend(running))
        return running

    def abandon(self, task: RemoteRunning) -> None:
        """Have the cluster stop a cancelled task; who cancels does not wait for that."""
        leaving = [each for each in self._leaving if not each.done()]
        self._leaving = [*leaving, self._on_loop(self._stop_there(task))]

    def stop(self) -> None:
        """Cancel everything and disconnect."""
        self._stopped = True
        for task in list(self._open.values()):
            task.cancel()
        if self._thread.is_alive():
            concurrent.futures.wait(self._leaving, CLOSE)
            concurrent.futures.wait([self._on_loop(_close(self._client))], CONNECT)
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(CONNECT)

    def _on_loop(self, work: Coroutine[Any, Any, None]) -> concurrent.futures.Future[None]:
        return asyncio.run_coroutine_threadsafe(work, self._loop)

    async def _begin(self) -> None:
        try:
            client = await self._new_client()
        except (OSError, ValueError) as error:
            raise InputError(
                f"No Dask scheduler answers at the cluster's address ({type(error).__name__}); "
                "start one with 'dask scheduler', or correct the address."
            ) from None
        try:
            await self._refuse_strangers(client)
        except InputError:
            await _close(client)
            raise
        self._client = client
        self._on_loop(self._look_after())

    async def _look_after(self) -> None:
        """Count the threads of the workers, which come and go."""
        while not self._stopped:
            client = await self._connected()
            with contextlib.suppress(Exception):  # whatever dies in Dask, it is connected again
                self._threads = sum((await client.nthreads()).values())
            await asyncio.sleep(LOOK)

    async def _attend(self, task: RemoteRunning) -> None:
        """Have a task run to its outcome; when a scheduler is lost the next one gets it."""
        lost, failures = None, 0
        while not task.is_cancelled:
            client = await self._connected(lost)
            if task.is_cancelled:  # meanwhile
                break
            key = f"{task.key}-{uuid.uuid4().hex[:8]}"
            task.future = client.submit(
                perform, task.key, task.call, self._terms, key=key, pure=False
            )
            try:
                found = await task.future
            except KilledWorker:
                found = tasks.Outcome(
                    "crash", detail="the machines that ran this task died one after another"
                )
            except LOST:
                lost = client
                continue
            except Exception as error:
                found = f"{type(error).__name__}: {error}"
            if isinstance(
                found, str
            ):  # the worker could not run it at all, as with another program; another one may
                log.error("a worker of the cluster cannot run a task: %s", found)
                failures += 1
                if failures < FAILURES:
                    continue
                found = tasks.Outcome(
                    "crash", detail=f"no worker of the cluster can run this task: {found}"
                )
            task.end(found)
            break
        self._open.pop(task.key, None)

    async def _stop_there(self, task: RemoteRunning) -> None:
        if task.future is not None:
            try:
                await task.future.cancel()
                await self._client.run(cancel, task.key, wait=False)
            except Exception as error:
                log.warning(
                    "a cancelled task could not be stopped on the cluster (%s)",
                    type(error).__name__,
                )

    async def _connected(self, lost: Any = None) -> Any:
        """The client of a scheduler that answers; not the one `lost`, which would come back without
        its topics.
        """
        async with self._connecting:
            while not self._stopped and (self._client is lost or self._client.status != "running"):
                self._threads = 0
                await _close(self._client)
                try:
                    self._client = await self._new_client()
                    log.warning("the cluster's scheduler answers again")
                except Exception as error:
                    log.warning(
                        "the cluster does not answer (%s); trying again", type(error).__name__
                    )
                    await asyncio.sleep(LOOK)
            return self._client

    async def _new_client(self) -> Any:
        """A new client; raises OSError where no scheduler answers."""
        with dask.config.set({"distributed.comm.timeouts.connect": f"{CONNECT}s"}):
            client: Any = await distributed.Client(  # type: ignore[no-untyped-call]
                self._address,
                timeout=CONNECT,
                set_as_default=False,
                name="inverse-service",
                asynchronous=True,
            )
        client.subscribe_topic(self._terms.topic, self._reported)
        return client

    def _reported(self, event: tuple[float, str]) -> None:
        said = json.loads(event[1])
        task = self._open.get(said["key"])
        if task is not None:
            task.heard = task.heard or time.monotonic()
        if task is not None and task.report is not None:
            task.report(Stage(**said["stage"]) if "stage" in said else said["value"])

    async def _refuse_strangers(self, client: Any) -> None:
        """Raises InputError where a worker that is there now has another program, or none of
        ours.
        """
        found = await client.run(fingerprint, on_error="return")
        for theirs in found.values():
            if not isinstance(theirs, dict):
                raise InputError(
                    "A worker of the cluster cannot load this program "
                    f"({type(theirs).__name__}); install inverse-service[dask] in its environment."
                )
            if differs := difference(self._terms.fingerprint, theirs):
                raise InputError(
                    f"A worker of the cluster has another program: {differs}; install the same on all."
                )
        self._threads = sum((await client.nthreads()).values())
        if not found:
            log.warning("the cluster has no worker yet; the work waits for one")


def _silence_dask() -> None:
    """Its tracebacks about a dead scheduler; what matters of them is said here in a line."""
    for name in list(logging.root.manager.loggerDict):
        if name.split(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)


async def _close(client: Any) -> None:
    """Disconnect, without waiting for a scheduler that is gone."""
    with contextlib.suppress(Exception):
        await asyncio.wait_for(client.close(), CLOSE)


def perform(key: str, call: tasks.Call, terms: Terms) -> tasks.Outcome | str:
    """The Dask task: the outcome of a call, or what differs between the front's program and this
    one.
    """
    if differs := difference(terms.fingerprint, fingerprint()):
        return differs
    worker = distributed.get_worker()

    stages = deque[Stage](maxlen=1)

    def tell(**said: Any) -> None:
        # As text: events hold plain data, and a part of a result has words of ours in it.
        worker.log_event(terms.topic, json.dumps({"key": key} | said))

    def report(value: Any) -> None:
        # Of the stages, a dozen in a short task, the latest is told now and then: each message is
        # read by the scheduler and by the front.
        if isinstance(value, Stage):
            stages.append(value)
        else:
            tell(value=value)

    pool = _pool(worker.state.nthreads, terms.memory_limit)
    running = _under_way[key] = pool.submit(call, report)
    end = time.monotonic() + workers.MOST_CROWDED * call.deadline + GRACE
    between = TELL_LINE if call.priority >= model.BULK else TELL
    try:
        while not concurrent.futures.wait([running.outcome], between).done:
            if stages:
                tell(stage=asdict(stages.pop()))
            if time.monotonic() > end:
                running.cancel()
                detail = "the worker processes kept silent past the deadline"
                return tasks.Outcome("crash", detail=detail)
        return running.outcome.result()
    finally:
        _under_way.pop(key, None)


async def cancel(key: str) -> None:
    """Kill the work on a call if this machine has it; runs in parallel with the tasks, not as one
    of them.

    A coroutine, as Dask waits for all machines where it is a plain function.
    """
    if (running := _under_way.get(key)) is not None:
        running.cancel()


def _pool(count: int, memory_limit: int) -> workers.Workers:
    """The pool of this process, of workers with this limit; one with another limit ends."""
    with _lock:
        if memory_limit in _pools:
            return _pools[memory_limit]
        for pool in _pools.values():
            pool.stop()
        _pools.clear()
        # Under a nanny this process is daemonic, which multiprocessing takes for one without
        # children.
        multiprocessing.current_process().daemon = False
        pool, started = workers.Workers(count, memory_limit), threading.Event()
        threading.Thread(
            target=_keep, args=(memory_limit, pool, started), name="pool", daemon=True
        ).start()
        started.wait()
        return pool


def _keep(memory_limit: int, pool: workers.Workers, started: threading.Event) -> None:
    """Start the pool, and never end: the kernel sends the death signal when the thread does that
    started the server.
    """
    try:
        pool.start()
        _pools[memory_limit] = pool
    finally:  # a pool that could not be started fails its task, and the next one makes another
        started.set()
    threading.Event().wait()
