"""Fixtures shared by several test packages: a running service, and what is logged.

The process that only hands tests to others loads nothing of the package.
"""

from __future__ import annotations

import functools
import gc
import json
import logging
import os
import random
import re
import ssl
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import pytest
import xdist
from xdist.scheduler import LoadFileScheduling

from tests.logs import Logged

TESTS = Path(__file__).parent
BETWEEN_COLLECTIONS = 2_000_000  # new objects
OPTIMIZED = {"codegen", "golden", "integrators", "machine_code", "simulation"}


def pytest_sessionstart(session: pytest.Session) -> None:
    """By default, Hypothesis draws the same examples in each run, so that the result is that of the
    code; the nightly tests draw others each night. No time is kept. What is logged where nobody
    listens is not printed.
    """
    if xdist.is_xdist_controller(session):
        return
    from hypothesis import settings

    _wait_for_byte_code()
    gc.set_threshold(BETWEEN_COLLECTIONS, 10, 10)
    logging.getLogger().addHandler(logging.NullHandler())
    if settings.get_current_profile_name() == "default":
        settings.register_profile("nightly", deadline=None)
        settings.load_profile("nightly" if _is_nightly(session.config) else "ci")


def _collected() -> Path:
    """The file that says that the first worker of this run has collected the tests."""
    return Path(tempfile.gettempdir()) / f"collected-{os.environ['PYTEST_XDIST_TESTRUNUID']}"


def _wait_for_byte_code() -> None:
    """Where most files of tests are new, as in a fresh clone, the first worker compiles them, in 12 s
    of processor time, and the others wait for that.
    """
    if os.environ.get("PYTEST_XDIST_WORKER", "gw0") == "gw0" or sys.dont_write_bytecode:
        return
    new = [*map(_is_new, TESTS.rglob("test_*.py"))]
    if 2 * sum(new) < len(new):
        return
    end = time.monotonic() + 300
    while not _collected().exists() and time.monotonic() < end:
        time.sleep(0.1)


def _is_new(path: Path) -> bool:
    compiled = (path.parent / "__pycache__").glob(f"{path.stem}.*-pytest-*.pyc")
    return all(one.stat().st_mtime < path.stat().st_mtime for one in compiled)


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """A process that runs tests for another one tells it how each ended, and what else went wrong:
    of six messages for each test two. All of them take half of the time of most tests.
    """
    for plugin in config.pluginmanager.get_plugins():
        if type(plugin).__name__ == "WorkerInteractor":  # of xdist, which a worker runs as __main__
            plugin.sendevent = functools.partial(_send_if_it_counts, plugin.sendevent)


def _send_if_it_counts(send: Callable[..., None], name: str, **event: Any) -> None:
    report = event.get("data") if name == "testreport" else None
    if name in ("logstart", "logfinish") or (report is not None and "nodeid" not in report):
        return
    send(name, **event)


@pytest.hookimpl(tryfirst=True)
def pytest_report_to_serializable(report: object) -> dict[str, Any] | None:
    """Nothing of a passed beginning or end of a test, which is not sent."""
    if isinstance(report, pytest.TestReport) and report.when != "call" and report.passed:
        return {"when": report.when}
    return None


def pytest_collection_finish() -> None:
    """What is loaded stays, and is not looked through again and again."""
    gc.freeze()
    if os.environ.get("PYTEST_XDIST_WORKER") == "gw0":
        _collected().touch()


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish() -> None:
    """What was never closed is found here once; pytest looks twice, seconds each after all tests."""
    gc.collect()
    gc.freeze()
    if os.environ.get("PYTEST_XDIST_WORKER") == "gw0":
        _collected().unlink(missing_ok=True)


def _is_nightly(config: pytest.Config) -> bool:
    return "nightly" in config.option.markexpr


@pytest.fixture(scope="session", autouse=True)
def _the_checker_draws_the_same_numbers(request: pytest.FixtureRequest) -> Iterator[None]:
    """By default, those of the name of the test; other ones each night. Processes of their own, as
    those of the service, draw other ones each time.
    """
    from inverse_service.certificate import judging, stated_claims

    def drawing(seed: int | None = None) -> random.Random:
        name = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0]  # (call) is behind it
        return random.Random(name if seed is None else seed)

    drawn = SimpleNamespace(Random=random.Random if _is_nightly(request.config) else drawing)
    with (
        mock.patch.object(judging, "random", drawn),
        mock.patch.object(stated_claims, "random", drawn),
    ):
        yield


@pytest.fixture(scope="session", autouse=True)
def _garbage_is_looked_for_seldom() -> Iterator[None]:
    """A command in this process would set the number of a process that solves once: a twentieth of
    the processor time would go there, as a process of tests keeps more.
    """
    with mock.patch.object(gc, "set_threshold"):
        yield


@pytest.fixture(scope="module", autouse=True)
def _kernels_of_short_runs_are_not_optimized(request: pytest.FixtureRequest) -> Iterator[None]:
    """By default, and where steps are not themselves the subject: LLVM takes 20 ms for each of a
    thousand kernels that run for milliseconds. The operations are the same ones. They are stored
    under another digest, and processes of their own optimize theirs.
    """
    from inverse_service.kernels.codegen import compiled

    rooms = request.path.relative_to(TESTS).parts
    if request.config.option.markexpr != DEFAULT or OPTIMIZED & {*rooms}:
        yield
        return
    usual = compiled.code_digest
    plain = {"LARGE": 0, "code_digest": lambda: f"{usual()} not optimized"}
    with mock.patch.multiple(compiled, **plain):
        yield


@pytest.fixture
def logged() -> Iterator[Logged]:
    """What is logged meanwhile; pytest's own fixture costs each test half a millisecond."""
    handler, root = Logged(), logging.getLogger()
    root.addHandler(handler)
    yield handler
    root.removeHandler(handler)


@pytest.fixture(scope="session", autouse=True)
def _certificates_are_read_once() -> Iterator[None]:
    """Each call of httpx reads the certificates of all authorities, 15 ms of processor time, also
    for an address of this machine.
    """
    once = functools.lru_cache(ssl.create_default_context)
    with mock.patch.object(ssl, "create_default_context", once):
        yield


@pytest.fixture(scope="session", autouse=True)
def _commands_are_built_once() -> Iterator[None]:
    """Each call of a command in this process would make all options anew, 12 ms of processor time."""
    from typer import main

    @functools.cache
    def built(application: main.Typer, *_: int) -> object:
        return build(application)

    def known(application: main.Typer) -> object:
        parts = application.registered_commands, application.registered_groups
        return built(application, *map(len, parts))

    build = main.get_command
    with mock.patch.object(main, "get_command", known):
        yield


@pytest.fixture(scope="session", autouse=True)
def _a_busy_machine_may_answer_late() -> Iterator[None]:
    from tests.serving import waiting

    with waiting():
        yield


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a real service in a separate process."""
    yield from running_service(tmp_path_factory.mktemp("service"))


def running_service(folder: Path, frame_origins: str = "") -> Iterator[str]:
    """A service with its store in a folder. Its `time_limit` is in s by the clock, twice as many on a
    busy machine, and no test waits for it.
    """
    import httpx

    from tests.serving import TIME_LIMIT, serving, until

    more = {
        "database": str(folder / "jobs.sqlite"),
        "log_level": "warning",
        "frame_origins": frame_origins,
    }
    with serving(time_limit=str(TIME_LIMIT), **more) as (_, address):
        # What it loads first takes seconds of processor time, which no question of a test has to wait for.
        until(lambda: httpx.get(f"{address}/readyz").json().get("workers") == "running", pause=0.1)
        yield address


DEFAULT = "not slow and not nightly"
LONG = {"slow", "nightly"}


# Files by the one whose process they run in, with which they share what it has parsed or judged.
TOGETHER = {
    "tests/certificate/test_claims_of_the_corpus.py": "tests/doors/test_readings.py",
    "tests/golden/test_said.py": "tests/doors/test_readings.py",
    "tests/test_layering.py": "tests/test_house.py",
    "tests/test_no_sentence_is_parsed.py": "tests/test_house.py",
}


# What a file says that asks the service of all tests, or looks at its pages.
ASKS_SERVICE = re.compile(r"\b(?:service: str|visit: Visit|fresh: Visit|plain: Visit)\b")


@functools.cache
def _asks_service(file: str) -> bool:
    return ASKS_SERVICE.search((TESTS.parent / file).read_text(encoding="utf-8")) is not None


class _ByFiles(LoadFileScheduling):
    """Each worker gets the tests of a file, or of files that share. One of two workers gets all
    that ask the service: a second service and a second browser cost five seconds of processor
    time. Of more workers each starts its own, since these tests are two fifths of the set.
    """

    def _split_scope(self, nodeid: str) -> str:
        file = super()._split_scope(nodeid)
        first = TOGETHER.get(file, file)
        return "service" if self.numnodes == 2 and _asks_service(first) else first


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> _ByFiles | None:
    return _ByFiles(config, log) if config.option.dist == "loadfile" else None


LONG_FILE = re.compile(r"^pytestmark = \[?\s*pytest\.mark\.(?:slow|nightly)\b", re.MULTILINE)
LONG_TEST = re.compile(r"^@pytest\.mark\.(?:slow|nightly)\b", re.MULTILINE)
TEST = re.compile(r"^(?:async )?def test_", re.MULTILINE)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """A file without default tests is not imported by default, unless it is asked for by name."""
    asked = {Path(argument.partition("::")[0]).absolute() for argument in config.args}
    if config.option.markexpr != DEFAULT or collection_path in asked:
        return None
    tests = collection_path.match("test_*.py")
    return True if tests and _is_long(collection_path.read_text(encoding="utf-8")) else None


def _is_long(source: str) -> bool:
    """Whether a file, or each of its tests, is marked as long; two blank lines part functions."""
    tests = [part for part in source.split("\n\n\n") if TEST.search(part)]
    each = bool(tests) and all(LONG_TEST.search(part) for part in tests)
    return each or LONG_FILE.search(source) is not None


# Long cases by file and test, each with a short case of the same test; every block of the package
# that they run, another default test runs, too.
COVERED: dict[str, dict[str, list[str]]] = json.loads(
    (TESTS / "covered.json").read_text(encoding="utf-8")
)


@pytest.hookimpl(trylast=True)
def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Covered cases are slow ones. Rows that the default expression leaves out become no tests:
    collecting twelve thousand of them takes each worker longer than most files of tests. Of a test
    without other rows one stays, which is deselected.
    """
    calls = metafunc._calls
    covered = _covered(metafunc)
    if metafunc.config.option.markexpr != DEFAULT:
        for call in covered:
            call.marks.append(pytest.mark.slow)
        return
    own = {mark.name for mark in metafunc.definition.iter_markers()}
    quick = [
        call
        for call in calls
        if call not in covered and not LONG & {*own, *(mark.name for mark in call.marks)}
    ]
    metafunc._calls = quick or calls[:1]


def _covered(metafunc: pytest.Metafunc) -> list[Any]:
    """The calls of a test that are listed; UsageError where a listed one is none, or is the last."""
    file = metafunc.definition.path.relative_to(TESTS).as_posix()
    listed = COVERED.get(file, {}).get(metafunc.definition.originalname, [])
    covered = [call for call in metafunc._calls if call.id in listed]
    if len(covered) != len(listed) or (covered and len(covered) == len(metafunc._calls)):
        where = f"{file}::{metafunc.definition.originalname}"
        raise pytest.UsageError(
            f"tests/covered.json lists cases that {where} has not, or all of it."
        )
    return covered


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run browser tests last: their driver keeps an event loop in the thread, and other tests start
    their own.
    """
    items.sort(key=lambda item: item.get_closest_marker("browser") is not None)
