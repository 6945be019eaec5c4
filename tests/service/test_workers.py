"""Worker processes end in one of the known ways, are killed on time, and leave no orphans."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator

import pytest

from inverse_service.service import tasks
from inverse_service.service.alone import run_alone
from inverse_service.service.outcome import outcome_of_exit
from inverse_service.service.workers import Workers

MEMORY = 2048


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    pool = Workers(1, MEMORY)
    pool.start()
    yield pool
    pool.stop()


def test_a_worker_answers(workers: Workers) -> None:
    assert workers.run(tasks.ping_task, (), 30.0).status == "done"


def test_a_loop_in_c_that_holds_the_interpreter_is_killed_at_its_deadline(workers: Workers) -> None:
    workers.run(tasks.ping_task, (), 30.0)
    begin = time.monotonic()
    assert workers.run(pow, (3, 10**9), 0.3).status == "deadline"
    assert time.monotonic() - begin < 3.0
    assert workers.run(tasks.ping_task, (), 30.0).status == "done"


def test_memory_is_bounded(workers: Workers) -> None:
    assert workers.run(bytearray, (MEMORY * 2**20,), 30.0).status == "memory"
    assert workers.run(tasks.ping_task, (), 30.0).status == "done"


def test_an_abort_counts_as_memory_and_a_segmentation_fault_as_crash(workers: Workers) -> None:
    assert workers.run(os.abort, (), 30.0).status == "memory"
    assert workers.run(signal.raise_signal, (signal.SIGSEGV,), 30.0).status == "crash"
    assert workers.run(os._exit, (7,), 30.0).status == "crash"
    assert workers.run(tasks.ping_task, (), 30.0).status == "done"


def test_an_exception_that_is_no_outcome_is_a_crash(workers: Workers) -> None:
    assert workers.run(int, ("x",), 30.0).status == "crash"


def test_the_pool_heals_when_an_idle_worker_is_killed(workers: Workers) -> None:
    pid = workers.run(tasks.guard, (os.getpid,), 30.0).value
    os.kill(pid, signal.SIGKILL)
    time.sleep(0.5)
    assert workers.run(tasks.ping_task, (), 30.0).status == "done"


def test_stopped_workers_refuse() -> None:
    pool = Workers(1, MEMORY)
    pool.stop()
    assert pool.run(tasks.ping_task, (), 1.0).status == "crash"


def test_alone_a_task_answers_is_killed_and_is_bounded() -> None:
    assert run_alone(tasks.guard, (os.getppid,), 30.0, MEMORY).value == os.getpid()
    assert run_alone(pow, (3, 10**9), 0.3, MEMORY).status == "deadline"
    assert run_alone(bytearray, (MEMORY * 2**20,), 30.0, MEMORY).status == "memory"
    assert run_alone(os.abort, (), 30.0, MEMORY).status == "memory"
    assert run_alone(os._exit, (7,), 30.0, MEMORY).status == "crash"
    assert run_alone(int, ("x",), 30.0, MEMORY).status == "crash"


def test_exit_codes_are_told_apart() -> None:
    assert outcome_of_exit(-9).status == "memory"
    assert outcome_of_exit(-11).status == "crash"
    assert outcome_of_exit(None).status == "crash"
