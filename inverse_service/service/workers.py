"""Killable worker processes: every task has a deadline that holds even inside C code.

A process is forked from a small server process that has the engine loaded already, so that the
replacement of a killed one costs some 10 ms; it never starts from the threads of the service.
"""

from __future__ import annotations

import logging
import multiprocessing
import threading
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as DeadlinePassed
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import pebble
from pebble.common.types import CONSTS

from inverse_service.errors import WorkerFailed
from inverse_service.service import tasks
from inverse_service.service.isolation import isolate
from inverse_service.service.outcome import Outcome, outcome_of_exit

log = logging.getLogger(__name__)
TASKS_PER_WORKER = 200
BOND = "inverse_service.service.bond"
CONSTS.term_timeout = 0.2


class Workers:
    """A pool of worker processes that heals itself; safe to use from any thread.

    `start` must be called from a thread that lives as long as the pool: Linux ties the death
    signal of a process to the thread that made it.
    """

    def __init__(self, count: int, memory_limit: int) -> None:
        self._count = count
        self._memory_limit = memory_limit
        self._lock = threading.Lock()
        self._pool: pebble.ProcessPool | None = None

    def start(self) -> None:
        """Start the processes; they load the engine while the caller goes on."""
        with self._lock:
            if self._pool is None:
                self._pool = self._new_pool()

    def submit(self, task: Callable[..., Outcome], arguments: tuple[Any, ...], deadline: float) -> Future[Outcome]:
        """Run `task(*arguments)`; the process is killed `deadline` s after it took the task.

        The future always ends with an Outcome, never with an exception.
        """
        answer: Future[Outcome] = Future()
        self._schedule(answer, task, arguments, deadline, attempts=2)
        return answer

    def run(self, task: Callable[..., Outcome], arguments: tuple[Any, ...], deadline: float) -> Outcome:
        """`submit` and wait."""
        return self.submit(task, arguments, deadline).result()

    def stop(self) -> None:
        """End all processes at once; tasks not done are lost."""
        with self._lock:
            if self._pool is not None:
                end(self._pool)
                self._pool = None

    def _schedule(
        self,
        answer: Future[Outcome],
        task: Callable[..., Outcome],
        arguments: tuple[Any, ...],
        deadline: float,
        attempts: int,
    ) -> None:
        def finish(done: Future[Outcome]) -> None:
            # A pool breaks when an idle process dies; the tasks it held are innocent.
            if isinstance(done.exception(), BrokenProcessPool) and attempts > 1:
                self._schedule(answer, task, arguments, deadline, attempts - 1)
            else:
                answer.set_result(outcome_of(done))

        try:
            pool = self._active_pool()
            future = pool.schedule(task, args=arguments, timeout=deadline)
        except (WorkerFailed, RuntimeError, OSError) as error:
            answer.set_result(Outcome("crash", detail=f"no worker process can be started: {error}"))
            return
        future.add_done_callback(finish)

    def _active_pool(self) -> pebble.ProcessPool:
        with self._lock:
            if self._pool is None:
                raise WorkerFailed("The worker processes are stopped.")
            if not self._pool.active:
                log.warning("worker pool broke; starting a new one")
                threading.Thread(target=end, args=(self._pool,), daemon=True).start()
                self._pool = self._new_pool()
            return self._pool

    def _new_pool(self) -> pebble.ProcessPool:
        pool = pebble.ProcessPool(
            max_workers=self._count,
            max_tasks=TASKS_PER_WORKER,
            initializer=begin,
            initargs=(self._memory_limit,),
            context=process_context(),
        )
        assert pool.active  # starts the processes now, from this thread
        return pool


def process_context() -> Any:
    """Processes forked from a server without threads where the system has it, else spawned."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([BOND, *tasks.ENGINE])
    return context


def end(pool: pebble.ProcessPool) -> None:
    """Kill the processes of a pool and wait for its threads."""
    pool.stop()  # type: ignore[no-untyped-call]
    pool.join()


def begin(memory_limit: int) -> None:
    """First act of a worker process.

    A process that fails here would be started again and again; an engine that cannot be loaded
    shows as a fault of the first task instead.
    """
    tasks.guard(tasks.load_engine)
    isolate(memory_limit)


def outcome_of(done: Future[Outcome]) -> Outcome:
    """What became of a task, read from pebble's future."""
    error = None if done.cancelled() else done.exception()
    if error is None and not done.cancelled():
        return done.result()
    if isinstance(error, DeadlinePassed):
        return Outcome("deadline")
    if isinstance(error, MemoryError):
        return Outcome("memory")
    if isinstance(error, pebble.ProcessExpired):
        return outcome_of_exit(error.exitcode)
    return Outcome("crash", detail=f"{type(error).__name__}: {error}")
