"""Quick trials: tests are collected once; for each mutant a child changes one function and runs what runs its lines.

Which test runs which lines is measured first. A mutant outside of functions has no quick trial.
"""

from __future__ import annotations

import ast
import importlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import CodeType, FunctionType

import coverage
import pytest

from tests.mutation.children import Job, answers
from tests.mutation.mutants import Mutant, mutated
from tests.mutation.trial import KILLED, OPTIONS, SURVIVED, FirstFailure, path_of

Found = Callable[[Mutant, str], object]
Lines = Mapping[str, frozenset[int]]


class Ready:
    """A collected session of pytest, held open in the place where it would run its tests."""

    def __init__(self, module: str, wanted: Sequence[Mutant], limit: int, processes: int) -> None:
        self.module, self.wanted, self.limit, self.processes = module, wanted, limit, processes
        self.found: Found = print
        self.failure = FirstFailure()

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        self.items = {item.nodeid: item for item in session.items}
        self.session = session
        session.config.pluginmanager.register(self.failure)
        self.lines, self.seconds = self.measured()
        for mutant, said in answers(self.jobs(), self.processes):
            self.found(mutant, said)
        return True

    def measured(self) -> tuple[Lines, Mapping[str, float]]:
        """The lines of the module that each test runs, and its seconds; in this process, for all that follow."""
        path, seconds = str(path_of(self.module)), {}
        tracer = coverage.Coverage(data_file=None, include=[path], config_file=False)
        with tracer.collect():
            for name, item in self.items.items():
                began = time.process_time()
                tracer.switch_context(name)
                self.run([item])
                seconds[name] = time.process_time() - began
        if self.failure.name:
            raise pytest.UsageError(f"{self.failure.name} fails without any mutant.")
        contexts = tracer.get_data().contexts_by_lineno(path)
        return {name: frozenset(line for line in contexts if name in contexts[line]) for name in self.items}, seconds

    def run(self, items: Sequence[pytest.Item]) -> None:
        for item, following in zip(items, [*items[1:], None], strict=True):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if self.failure.name:
                return

    def jobs(self) -> Iterator[tuple[Mutant, Job, float]]:
        source = path_of(self.module).read_text(encoding="utf-8")
        for mutant in self.wanted:
            first, last = mutant.lines
            statement = range(first, last + 1)
            chosen = [name for name, met in self.lines.items() if not met.isdisjoint(statement)]
            chosen.sort(key=self.seconds.__getitem__)
            limit = min(self.limit, 3 + 2 * sum(map(self.seconds.__getitem__, chosen)))
            yield mutant, self.job(mutated(source, mutant), mutant.function, chosen), limit

    def job(self, source: ast.Module, function: str, chosen: Sequence[str]) -> Job:
        def work() -> str:
            put(self.module, source, function)
            self.run([self.items[name] for name in chosen])
            return f"{KILLED} {self.failure.name}" if self.failure.name else SURVIVED

        return work


def put(module: str, source: ast.Module, function: str) -> None:
    """Give the function, wherever it is referred to, the code that it has in the source."""
    code = compile(source, str(path_of(module)), "exec", dont_inherit=True)
    place: object = importlib.import_module(module)
    for name in function.split("."):
        place = vars(place)[name]
    plain(place).__code__ = next(one for one in _codes(code) if one.co_qualname == function)


def plain(place: object) -> FunctionType:
    """The function behind a property, a method of a class or a cache."""
    for name in ("fget", "__func__", "__wrapped__"):
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
    """Hand (mutant, SURVIVED, STOPPED or KILLED and the test that noticed) to `found`, as they come."""
    ready.found = found
    code = pytest.main([*OPTIONS, *tests], plugins=[ready])
    if code not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
        raise SystemExit(int(code))
