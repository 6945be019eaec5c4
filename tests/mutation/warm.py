"""Quick trials: tests are collected once; for each mutant a child changes one function and runs the
tests of its lines. First a child measures which test runs which lines, so that no cache keeps a
result. A mutant outside functions has no quick trial. A survivor whose lines ran before any test
needs a slow trial.
"""

from __future__ import annotations

import ast
import importlib
import itertools
import json
import math
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import CodeType, FunctionType
from typing import TextIO

import coverage
import pytest
from coverage.exceptions import CoverageWarning

from tests.mutation.children import Job, answers
from tests.mutation.mutants import Mutant, mutated
from tests.mutation.trial import KILLED, OPTIONS, QUICK, SURVIVED, FirstFailure, path_of

Found = Callable[[Mutant, str], object]
Lines = Mapping[str, frozenset[int]]


class Ready:
    """A collected pytest session, paused before it runs its tests."""

    def __init__(
        self,
        module: str,
        wanted: Sequence[Mutant],
        limit: int,
        processes: int,
        budget: float = math.inf,
    ) -> None:
        self.module, self.wanted, self.limit, self.processes = module, wanted, limit, processes
        self.budget, self.kills = (
            budget,
            Counter[tuple[str, str]](),
        )  # keys (function or "" for all, test)
        self.found: Found = print
        self.failure, self.tracer = FirstFailure(), tracer_of(module)

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        self.items = {item.nodeid: item for item in session.items}
        session.config.pluginmanager.register(self.failure)
        self.tracer.stop()
        self.early = lines_met(self.tracer, self.module).get("", frozenset())
        self.lines, self.seconds = self.measured()
        for mutant, said in answers(self.jobs(), self.processes):
            if said.startswith(KILLED):
                self.kills.update(
                    (place, said.removeprefix(f"{KILLED} ")) for place in {mutant.function, ""}
                )
            early = said == SURVIVED and not self.early.isdisjoint(self.statement(mutant))
            self.found(mutant, QUICK if early else said)
        return True

    @staticmethod
    def statement(mutant: Mutant) -> range:
        return range(mutant.lines[0], mutant.lines[1] + 1)

    def measured(self) -> tuple[Lines, Mapping[str, float]]:
        """The lines of the module that each test runs, and its seconds."""
        with tempfile.TemporaryFile("w+") as stream:
            for _, said in answers(iter([("", lambda: self.measure(stream), 3600)]), 1):
                if said != SURVIVED:
                    raise pytest.UsageError(f"{said} without any mutant.")
            stream.seek(0)
            lines, seconds = json.load(stream)
        return {name: frozenset(met) for name, met in lines.items()}, seconds

    def measure(self, stream: TextIO) -> str:
        seconds, tracer = {}, tracer_of(self.module)
        with tracer.collect():
            for name, item in self.items.items():
                began = time.process_time()
                tracer.switch_context(name)
                self.run([item])
                seconds[name] = time.process_time() - began
        lines = lines_met(tracer, self.module)
        json.dump([{name: list(lines.get(name, ())) for name in self.items}, seconds], stream)
        stream.flush()
        return f"{KILLED} {self.failure.name}" if self.failure.name else SURVIVED

    def run(self, items: Sequence[pytest.Item]) -> None:
        for item, following in itertools.zip_longest(items, items[1:]):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if self.failure.name:
                return

    def jobs(self) -> Iterator[tuple[Mutant, Job, float]]:
        source = path_of(self.module).read_text(encoding="utf-8")
        for mutant in self.wanted:
            chosen = self.chosen(mutant)
            limit = min(self.limit, 3 + 2 * sum(map(self.seconds.__getitem__, chosen)))
            yield mutant, self.job(mutated(source, mutant), mutant.function, chosen), limit

    def chosen(self, mutant: Mutant) -> list[str]:
        """The tests that run the statement, within the budget, in descending order of detections
        per time.
        """
        statement, kills, seconds = self.statement(mutant), self.kills, self.seconds
        met = [name for name, met in self.lines.items() if not met.isdisjoint(statement)]
        met.sort(
            key=lambda name: (
                (seconds[name] + 0.01) / (1 + kills["", name] + 10 * kills[mutant.function, name])
            )
        )
        return [name for name, spent in zip(met, itertools.accumulate(map(seconds.__getitem__, met)), strict=True)
                if spent <= self.budget]  # fmt: skip

    def job(self, source: ast.Module, function: str, chosen: Sequence[str]) -> Job:
        def work() -> str:
            try:
                put(self.module, source, function)
            except (KeyError, StopIteration, TypeError, ValueError):
                return QUICK
            self.run([self.items[name] for name in chosen])
            return f"{KILLED} {self.failure.name}" if self.failure.name else SURVIVED

        return work


def tracer_of(module: str) -> coverage.Coverage:
    return coverage.Coverage(data_file=None, include=[str(path_of(module))], config_file=False)


def lines_met(tracer: coverage.Coverage, module: str) -> Lines:
    """The lines run in each context; none where no test imports the module before it runs."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CoverageWarning)
        contexts = tracer.get_data().contexts_by_lineno(str(path_of(module)))
    names = {name for named in contexts.values() for name in named}
    return {
        name: frozenset(line for line, named in contexts.items() if name in named) for name in names
    }


def put(module: str, source: ast.Module, function: str) -> None:
    """Give the function its code from the source, for all references to it."""
    code = compile(source, str(path_of(module)), "exec", dont_inherit=True)
    place: object = importlib.import_module(module)
    for name in function.split("."):
        place = vars(place)[name]
    plain(place).__code__ = next(one for one in _codes(code) if one.co_qualname == function)


def plain(place: object) -> FunctionType:
    """The function behind a property, cached property, class method, or cache. Raises TypeError for
    machine code.
    """
    if hasattr(place, "py_func"):
        raise TypeError(f"{place} is compiled")
    for name in ("fget", "func", "__func__", "__wrapped__"):
        place = getattr(place, name, place)
    if not isinstance(place, FunctionType):
        raise TypeError(f"{place} has no code that could be changed")
    return place


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield from _codes(part)


def run(ready: Ready, tests: Sequence[str], found: Found) -> None:
    """Pass (mutant, SURVIVED, STOPPED, or KILLED and the detecting test) to `found` as they
    arrive.
    """
    ready.found = found
    ready.tracer.start()
    code = pytest.main([*OPTIONS, *tests], plugins=[ready])
    if code not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
        raise SystemExit(int(code))
