"""Run work in forked processes with limits on processor time and memory, and return their
answers.
"""

from __future__ import annotations

import os
import resource
import warnings
from collections.abc import Callable, Iterator
from typing import TypeVar

Name = TypeVar("Name")
Job = Callable[[], str]
STOPPED = "stopped"
MEMORY = 8 << 30  # bytes of addresses; a mutant may ask for any amount


def answers(jobs: Iterator[tuple[Name, Job, float]], processes: int) -> Iterator[tuple[Name, str]]:
    """Yield the answer of each (name, job, seconds) when it arrives, STOPPED beyond the limit;
    limited concurrency.

    Raises RuntimeError if a job itself fails, because that is not an answer.
    """
    running: dict[int, tuple[Name, int]] = {}
    for name, job, seconds in jobs:
        if len(running) >= processes:
            yield _ended(running)
        reading, writing = os.pipe()
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", DeprecationWarning
            )  # newer Pythons warn about threads; libraries have some
            child = os.fork()
        if not child:
            os.close(reading)
            _answer(job, seconds, writing)
        os.close(writing)
        running[child] = (name, reading)
    while running:
        yield _ended(running)


def _ended(running: dict[int, tuple[Name, int]]) -> tuple[Name, str]:
    child, status = os.waitpid(-1, 0)
    name, reading = running.pop(child)
    with os.fdopen(reading) as stream:
        said = stream.read()
    if os.WIFEXITED(status) and os.WEXITSTATUS(status):
        raise RuntimeError(f"a child failed: {said}")
    return name, STOPPED if os.WIFSIGNALED(status) else said


def _answer(job: Job, seconds: float, writing: int) -> None:
    """Runs in the child; the process ends with this function."""
    code = 1
    try:
        limit = int(sum(os.times()[:2]) + seconds) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 2))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        quiet = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(quiet, stream)
        os.write(writing, job()[:4000].encode())
        code = 0
    except BaseException as error:
        os.write(writing, repr(error)[:4000].encode())
    finally:
        os._exit(code)
