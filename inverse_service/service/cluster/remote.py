"""What runs inside a Dask worker: run a call on a pool of killable workers there and wait.

Dask can neither stop a running task nor bound its memory; the pool can. There is one pool for each Dask worker process,
with one worker process for each of its threads. A Dask worker that is killed takes them with it: the death signal of
`workers` reaches them through the server that forked them.
"""

import multiprocessing
import sys
import threading
from concurrent.futures import TimeoutError as WaitedTooLong
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from inverse_service.service.jobs import model, workers
from inverse_service.service.jobs.outcome import Call, Outcome

# A cold machine loads the engine and its kernels first; the deadline itself is the pool's.
GRACE = 60.0


Fingerprint = dict[str, str]


def fingerprint() -> Fingerprint:
    """Of this process: the engine with a digest of its text, Python, and the packages that matter."""
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return {"engine": model.engine_version(), "python": python} | {
        name: version(name) for name in ("distributed", "python-flint")
    }


def difference(ours: Fingerprint, theirs: Fingerprint) -> str:
    """What differs, in words; empty where nothing does."""
    return ", ".join(f"{name} {theirs[name]} instead of {ours[name]}" for name in ours if theirs[name] != ours[name])


@dataclass(frozen=True, slots=True)
class Terms:
    """What every task of a front is sent with: its versions, MiB for a process, where reports go."""

    fingerprint: Fingerprint
    memory_limit: int
    topic: str


_lock = threading.Lock()
_pools: dict[int, workers.Workers] = {}
_under_way: dict[str, workers.Running] = {}


def perform(key: str, call: Call, terms: Terms) -> Outcome | str:
    """The Dask task: the outcome of a call, or what differs between the front's program and this one."""
    if differs := difference(terms.fingerprint, fingerprint()):
        return differs
    from distributed import get_worker

    worker = get_worker()

    def report(value: Any) -> None:
        worker.log_event(terms.topic, {"key": key, "value": value})

    pool = _pool(worker.state.nthreads, terms.memory_limit)
    running = _under_way[key] = pool.submit(call, report)
    try:
        return running.outcome.result(workers.MOST_CROWDED * call.deadline + GRACE)
    except WaitedTooLong:
        running.cancel()
        return Outcome("crash", detail="the worker processes kept silent past the deadline")
    finally:
        _under_way.pop(key, None)


async def cancel(key: str) -> None:
    """Kill the work on a call if this machine has it; runs in parallel with the tasks, not as one of them.

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
        # Under a nanny this process is daemonic, which multiprocessing takes for one without children.
        multiprocessing.current_process().daemon = False
        pool, started = workers.Workers(count, memory_limit), threading.Event()
        threading.Thread(target=_keep, args=(memory_limit, pool, started), name="pool", daemon=True).start()
        started.wait()
        return pool


def _keep(memory_limit: int, pool: workers.Workers, started: threading.Event) -> None:
    """Start the pool, and never end: the kernel sends the death signal when the thread does that started the server."""
    try:
        pool.start()
        _pools[memory_limit] = pool
    finally:  # a pool that could not be started fails its task, and the next one makes another
        started.set()
    threading.Event().wait()
