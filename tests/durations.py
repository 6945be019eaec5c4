"""Which tests are not in the default suite for the time that they take: `make durations` writes tests/slow.txt.

As a plugin of pytest it measures the processor time of every test, that of its ended processes included, and lists the
slow ones. tests/conftest.py gives them the marker `slow`, as if it stood above them.
"""

from __future__ import annotations

import resource
from collections import defaultdict
from collections.abc import Generator, Iterable, Mapping
from pathlib import Path

import pytest

SLOW = Path(__file__).parent / "slow.txt"
SECONDS = 0.05
QUICKEST = 0.2  # of the tests of one function the quickest stays in the suite up to here
KEPT = ("tests/docs/test_documents.py", "tests/web/test_schema.py", "tests/test_house.py", "tests/test_layering.py")

_started = pytest.StashKey[float]()
_measured: dict[str, float] = {}


def slow_tests() -> frozenset[str]:
    return frozenset(SLOW.read_text().splitlines())


def chosen(measured: Mapping[str, float]) -> Iterable[str]:
    """The names of the slow tests among those that were measured, in s."""
    functions: dict[str, list[tuple[float, str]]] = defaultdict(list)
    for name, seconds in measured.items():
        functions[name.partition("[")[0]].append((seconds, name))
    for function, tests in functions.items():
        least, quickest = min(tests)
        staying = {quickest} if least <= QUICKEST else set()
        if not function.startswith(KEPT):
            yield from (name for seconds, name in tests if seconds > SECONDS and name not in staying)


def _processor_time() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    item.stash[_started] = _processor_time()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if call.when == "teardown":
        report.user_properties.append(("processor time", _processor_time() - item.stash[_started]))
    return report


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.when == "teardown":
        _measured[report.nodeid] = float(str(dict(report.user_properties)["processor time"]))


def pytest_sessionfinish(session: pytest.Session) -> None:
    if not hasattr(session.config, "workerinput"):  # in a worker of pytest-xdist only a part was measured
        SLOW.write_text("".join(f"{name}\n" for name in sorted(chosen(_measured))))
