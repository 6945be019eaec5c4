"""Many items on several processes: same answers, deadlines, no children left."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from inverse_service.inverse_problem.families.forked import cores, forked_map


@pytest.mark.parametrize("processes", [1, 2, 3])
@pytest.mark.parametrize("count", [0, 1, 2, 17])
def test_results_come_in_the_order_of_the_items(processes: int, count: int) -> None:
    assert forked_map(lambda k: k * k, list(range(count)), processes=processes) == [k * k for k in range(count)]


def test_work_is_done_in_other_processes() -> None:
    found = forked_map(lambda _: os.getpid(), list(range(8)), processes=2)
    assert len(set(found)) == 2
    assert os.getpid() not in found
    assert cores() >= 1


@pytest.mark.parametrize("processes", [1, 2])
def test_a_deadline_leaves_the_rest_undone(processes: int) -> None:
    began = time.monotonic()
    found = forked_map(lambda k: time.sleep(0.05) or k, list(range(100)), began + 0.3, processes=processes)
    assert found[0] == 0
    assert None in found
    assert time.monotonic() - began < 5


def children() -> set[str]:
    """The processes that this thread has started and that are still there, dead ones not waited for included."""
    return set(Path(f"/proc/self/task/{threading.get_native_id()}/children").read_text().split())


def test_a_child_that_hangs_is_ended_after_the_deadline() -> None:
    began, before = time.monotonic(), children()
    found = forked_map(lambda k: time.sleep(60 * k), [0, 1], began + 0.1, processes=2)
    assert found == [None, None]
    assert time.monotonic() - began < 30
    assert children() <= before


def test_a_child_that_fails_leaves_its_items_undone() -> None:
    def fragile(k: int) -> int:
        if k == 3:
            os._exit(1)
        return k

    found = forked_map(fragile, [0, 1, 2, 3], processes=2)
    assert found[::2] == [0, 2]
    assert found[3] is None


def test_large_results_cross_whole() -> None:
    found = forked_map(lambda k: "x" * (300_000 + k), list(range(4)), processes=2)
    assert [len(text or "") for text in found] == [300_000, 300_001, 300_002, 300_003]


@pytest.mark.parametrize("processes", [1, 2])
def test_progress_counts_up_to_all(processes: int) -> None:
    said: list[int] = []
    forked_map(lambda k: k, list(range(10)), progress=said.append, processes=processes)
    assert said[-1] == 10
    assert said == sorted(said)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux ends children with their parent")
def test_children_die_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    program = (
        "import os, time\n"
        "from inverse_service.inverse_problem.families.forked import forked_map\n"
        "def work(k):\n"
        f"    open(f'{tmp_path}/{{os.getpid()}}', 'w').close()\n"
        "    time.sleep(60)\n"
        "forked_map(work, [0, 1], processes=2)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", program])
    try:
        wait_for(lambda: len(list(tmp_path.iterdir())) == 2)
    finally:
        parent.kill()
        parent.wait()
    numbers = [int(path.name) for path in tmp_path.iterdir()]
    assert len(numbers) == 2
    wait_for(lambda: not any(is_running(number) for number in numbers))


def is_running(number: int) -> bool:
    try:
        return "\nState:\tZ" not in Path(f"/proc/{number}/status").read_text()
    except OSError:
        return False


def wait_for(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "what was waited for did not happen"
        time.sleep(0.02)
