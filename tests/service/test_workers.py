"""Worker processes end in a known way, are killed on time, and leave no orphans."""

from __future__ import annotations

import errno
import gc
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from inverse_service.service.jobs import tasks, workers as workers_module
from inverse_service.service.jobs.tasks import Call, Outcome, outcome_of_exit
from inverse_service.service.jobs.workers import Workers, run_alone
from tests.logs import Logged
from tests.serving import until

MEMORY = 2048
ENDLESS = (pow, (3, 10**9))  # in C, with the interpreter held


def run(pool: Workers, task: Any, arguments: tuple[Any, ...], deadline: float) -> Any:
    return pool.submit(Call(task, arguments, deadline)).outcome.result()


def busy(seconds: float) -> Outcome:
    """Compute for this long."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass
    return Outcome("done")


def crowded(seconds: float) -> Outcome:
    """Compute for this long on a core that two other busy processes use."""
    core = {min(os.sched_getaffinity(0))}
    others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
    try:
        for pid in (0, *(one.pid for one in others)):
            os.sched_setaffinity(pid, core)
        return busy(seconds)
    finally:
        for one in others:
            one.kill()
            one.wait()


def reporting(report: Callable[[str], None]) -> Outcome:
    """Report two messages."""
    report("one")
    report("two")
    return Outcome("done")


def is_running(pid: int) -> bool:
    """Whether there is such a process, and it has not ended (the server that forks collects it)."""
    try:
        os.kill(pid, 0)
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except ProcessLookupError:
        return False
    except OSError:  # a system without /proc
        return not Path("/proc/self").exists()


def no_process(memory_limit: int) -> None:
    """The error of a system that cannot start a process."""
    raise OSError(errno.EAGAIN, "Resource temporarily unavailable")


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    pool = Workers(1, MEMORY)
    pool.start()
    yield pool
    pool.stop()


def test_processes_that_solve_look_for_garbage_seldom(workers: Workers) -> None:
    # With Python's default of 700 objects it takes half of the time of a long search in an old
    # worker.
    for outcome in (
        run(workers, gc.get_threshold, (), 30.0),
        run_alone(gc.get_threshold, (), 30.0, MEMORY),
    ):
        assert outcome.value[0] >= 100_000


def test_a_loop_in_c_that_holds_the_interpreter_is_killed_at_its_deadline(workers: Workers) -> None:
    pid = run(workers, os.getpid, (), 30.0).value
    ended = run(workers, *ENDLESS, 0.3)
    assert ended.status == "deadline"
    assert ended.spent.cpu < 10  # s; the loop takes many minutes
    until(lambda: not is_running(pid))
    assert run(workers, tasks.load_engine, (), 30.0).status == "done"


@pytest.mark.parametrize(("patience", "status"), [(0.0, "deadline"), (20.0, "done")])
def test_a_task_waits_for_a_processor_as_long_as_it_has_patience(
    workers: Workers, monkeypatch: pytest.MonkeyPatch, patience: float, status: str
) -> None:
    run(workers, tasks.load_engine, (), 30.0)
    monkeypatch.setattr(
        "inverse_service.service.jobs.workers._waited", lambda _: 1e6
    )  # others have had it all along
    call = tasks.Call(busy, (0.2,), 0.05, patience=patience)
    assert workers.submit(call).outcome.result(60).status == status


def test_the_command_line_waits_for_a_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the pool its deadline would be twice as late at most: 0.02 s by the clock."""
    others = {"self": 0.0}  # what they had before it began, and until now
    monkeypatch.setattr(
        "inverse_service.service.jobs.workers._waited", lambda pid: others.get(pid, 1e6)
    )
    assert run_alone(busy, (0.05,), 0.01, 16 * MEMORY).status == "done"


@pytest.mark.slow
@pytest.mark.skipif(
    not os.path.exists("/proc/self/schedstat"), reason="the system does not tell who waits"
)
def test_a_task_is_not_killed_while_others_have_the_processor() -> None:
    """In 1 s by the clock it gets about 0.3 s of processor time."""
    # The test process may already use more than MEMORY; then its fork could not start another
    # process.
    assert run_alone(crowded, (0.6,), 1.0, 16 * MEMORY).status == "done"


def test_cancelling_kills_a_loop_in_c_and_drops_a_task_that_waits(workers: Workers) -> None:
    pid = run(workers, os.getpid, (), 30.0).value
    running, waiting = (workers.submit(Call(*ENDLESS, 3600.0)) for _ in range(2))
    until(lambda: running.has_begun)
    assert not waiting.has_begun
    for task in (waiting, running):
        task.cancel()
        assert task.outcome.result(60).status == "cancelled"
    until(lambda: not is_running(pid))
    assert run(workers, tasks.load_engine, (), 30.0).status == "done"


def test_a_task_may_have_less_memory_and_tells_what_it_does(workers: Workers) -> None:
    call = Call(bytearray, (1500 * 2**20,), 30.0, memory_limit=1200)
    assert workers.submit(call).outcome.result().status == "memory"
    reports: list[str] = []
    assert (
        workers.submit(Call(reporting, (), 30.0, reports=True), reports.append)
        .outcome.result()
        .status
        == "done"
    )
    assert reports == ["one", "two"]


def test_a_fault_of_who_listens_is_logged_and_ends_no_task(
    workers: Workers, logged: Logged
) -> None:
    call = Call(reporting, (), 30.0, reports=True)
    assert workers.submit(call, lambda _: 1 / 0).outcome.result(60).status == "done"
    assert "what a task said was not told" in logged.text
    assert run(workers, tasks.load_engine, (), 30.0).status == "done"


def test_what_a_task_takes_is_measured(workers: Workers) -> None:
    spent = run(workers, busy, (0.1,), 30.0).spent
    assert 0.09 < spent.cpu <= spent.wall + 0.01  # two clocks, read one after the other
    assert spent.memory > 50


def test_a_task_that_uses_many_threads_is_ended_by_its_processor_time(workers: Workers) -> None:
    assert run(workers, signal.raise_signal, (signal.SIGXCPU,), 30.0).status == "deadline"


def test_a_neighbor_is_unharmed_by_five_gigabytes() -> None:
    pool = Workers(2, MEMORY)
    pool.start()
    neighbor = pool.submit(Call(busy, (0.5,), 30.0))
    assert run(pool, bytearray, (5 * 2**30,), 30.0).status == "memory"
    assert neighbor.outcome.result().status == "done"
    pool.stop()


def test_urgent_tasks_go_first(workers: Workers) -> None:
    order: list[int] = []
    first = workers.submit(Call(busy, (0.2,), 30.0))
    later = [workers.submit(Call(busy, (0.0,), 30.0, priority=p)) for p in (10, 0, 5)]
    for place, running in enumerate(later):
        running.outcome.add_done_callback(lambda _, place=place: order.append(place))  # type: ignore[misc]
    for running in (first, *later):
        assert running.outcome.result(30).status == "done"
    assert order == [1, 2, 0]


def test_workers_are_replaced_after_many_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("inverse_service.service.jobs.workers.TASKS_PER_WORKER", 2)
    pool = Workers(1, MEMORY)
    pool.start()
    # The first task of a pool is its own.
    pids = [run(pool, os.getpid, (), 30.0).value for _ in range(3)]
    pool.stop()
    assert len(set(pids)) == 2


def test_memory_is_bounded(workers: Workers) -> None:
    assert run(workers, bytearray, (MEMORY * 2**20,), 30.0).status == "memory"
    assert run(workers, tasks.load_engine, (), 30.0).status == "done"


def test_processes_that_answer_are_not_at_fault(workers: Workers) -> None:
    assert run(workers, busy, (0.0,), 30).status == "done"
    assert workers.first.result(30).status == "done"
    assert workers.fault() == ""


def test_an_abort_counts_as_memory_and_a_segmentation_fault_as_crash(workers: Workers) -> None:
    assert run(workers, os.abort, (), 30.0).status == "memory"
    killed = run(workers, signal.raise_signal, (signal.SIGKILL,), 30.0)
    assert (killed.status, killed.spent.cpu >= 0.0) == (
        "killed",
        True,
    )  # the system counts in units of 10 ms
    assert run(workers, signal.raise_signal, (signal.SIGSEGV,), 30.0).status == "crash"
    assert run(workers, os._exit, (7,), 30.0).status == "crash"
    assert run(workers, tasks.load_engine, (), 30.0).status == "done"


def test_an_exception_is_a_fault_that_is_named(workers: Workers) -> None:
    found = run(workers, int, ("x",), 30.0)
    assert (found.status, found.value) == ("fault", "ValueError")


def test_the_pool_heals_when_an_idle_worker_is_killed(workers: Workers) -> None:
    pid = run(workers, os.getpid, (), 30.0).value
    os.kill(pid, signal.SIGKILL)
    assert run(workers, tasks.load_engine, (), 30.0).status == "done"


@pytest.mark.parametrize(("stops", "status"), [(True, "cancelled"), (False, "done")])
def test_only_a_process_that_nobody_stopped_is_reported_as_found_dead(
    workers: Workers,
    monkeypatch: pytest.MonkeyPatch,
    logged: Logged,
    stops: bool,
    status: str,
) -> None:
    """Both die before they take the task, one because its client leaves just then."""
    kind, held = workers_module.WorkerProcess, queue.SimpleQueue[workers_module.Running]()
    run_of = kind.run

    def dying(process: Any, call: Call, report: Any = None) -> Outcome:
        monkeypatch.setattr(kind, "run", run_of)
        task = held.get()
        task.cancel() if stops else os.kill(process.pid, signal.SIGKILL)
        raise workers_module.NotStarted

    monkeypatch.setattr(kind, "run", dying)
    task = workers.submit(Call(tasks.load_engine, (), 30.0))
    held.put(task)
    assert task.outcome.result().status == status
    assert ["found dead" in one.getMessage() for one in logged.records] == [True] * (not stops)


def test_without_a_process_a_task_is_not_started_and_later_ones_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers_module, "START_PAUSE", 0.01)
    pool = Workers(1, MEMORY)
    with monkeypatch.context() as patched:
        patched.setattr(workers_module, "WorkerProcess", no_process)
        pool.start()
        assert run(pool, tasks.load_engine, (), 30.0).status == "unstarted"
    assert run(pool, tasks.load_engine, (), 30.0).status == "done"
    pool.stop()


def test_a_process_that_has_ended_is_told_and_left_to_who_waits_for_it() -> None:
    with subprocess.Popen(
        [sys.executable, "-S", "-c", "input()"], stdin=subprocess.PIPE
    ) as process:
        assert not workers_module.has_ended(process.pid)
        assert process.stdin is not None
        process.stdin.close()
        until(lambda: workers_module.has_ended(process.pid))
        assert process.wait() == 1
    assert workers_module.has_ended(process.pid)


KILLED_SERVER = """
import os, signal, time
from inverse_service.service.jobs import tasks, workers
if __name__ == "__main__":
    pool = workers.Workers(1, 4096)
    pool.start()
    assert pool.submit(tasks.Call(tasks.load_engine, (), 60.0)).outcome.result().status == "done"
    running = pool.submit(tasks.Call(time.sleep, (60.0,), 90.0))
    while not running.has_begun: time.sleep(0.01)
    time.sleep(0.2)
    os.kill(workers.forking_server(), signal.SIGKILL)
    print(running.outcome.result().status)
    print(pool.submit(tasks.Call(tasks.load_engine, (), 60.0)).outcome.result().status)
    pool.stop()
"""


@pytest.mark.slow
@pytest.mark.skipif(
    sys.platform != "linux", reason="elsewhere no death of a server reaches its workers"
)
def test_a_job_does_not_answer_for_the_death_of_the_server_that_forks(tmp_path: Path) -> None:
    (tmp_path / "killed.py").write_text(KILLED_SERVER)
    done = subprocess.run(
        [sys.executable, tmp_path / "killed.py"], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["unstarted", "done"]


def test_workers_that_are_stopped_before_their_first_answer_report_nothing_wrong(
    logged: Logged,
) -> None:
    pool = Workers(1, MEMORY)
    pool.start()
    pool.stop()
    assert pool.first.result(10).status in ("done", "cancelled")
    assert [record.getMessage() for record in logged.records if record.levelname != "INFO"] == []


def test_stopped_workers_refuse() -> None:
    pool = Workers(1, MEMORY)
    pool.stop()
    assert run(pool, tasks.load_engine, (), 1.0).status == "crash"


@pytest.mark.slow
def test_alone_a_task_answers_is_killed_and_is_bounded() -> None:
    assert run_alone(os.getppid, (), 30.0, MEMORY).value == os.getpid()
    assert run_alone(pow, (3, 10**9), 0.3, MEMORY).status == "deadline"
    assert run_alone(bytearray, (MEMORY * 2**20,), 30.0, MEMORY).status == "memory"
    assert run_alone(os.abort, (), 30.0, MEMORY).status == "memory"
    assert run_alone(os._exit, (7,), 30.0, MEMORY).status == "crash"
    assert run_alone(int, ("x",), 30.0, MEMORY).status == "fault"


def test_exit_codes_are_distinguished() -> None:
    told = {
        code: outcome_of_exit(code).status
        for code in (-signal.SIGKILL, -signal.SIGABRT, -signal.SIGXCPU, -11, 1)
    }
    assert list(told.values()) == ["killed", "memory", "deadline", "crash", "crash"]
    assert outcome_of_exit(None).status == "crash"


def test_a_wait_that_runs_out_takes_nothing_from_the_pool(workers: Workers) -> None:
    running = workers.submit(Call(busy, (0.1,), 30.0))
    assert not running.outcome.cancel()
    assert running.outcome.result(30).status == "done"
    assert run(workers, tasks.load_engine, (), 30.0).status == "done"


def test_a_second_pool_starts_while_the_first_process_of_all_still_loads() -> None:
    starting = threading.Thread(target=workers_module.start_server, daemon=True)
    with workers_module.starting:  # held until the server has loaded the engine
        starting.start()
        starting.join(30)
        assert not starting.is_alive()
