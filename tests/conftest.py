"""What tests of several rooms share: a running service."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a real service in a process of its own."""
    yield from running_service(tmp_path_factory.mktemp("service"))


@pytest.fixture(scope="session")
def patient(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A service with the time of a real one: the double pendulum takes 3 s of a processor that others use too."""
    yield from running_service(tmp_path_factory.mktemp("patient"), 60)


def running_service(folder: Path, time_limit: int = 10, frame_origins: str = "") -> Iterator[str]:
    """A service with its store in a folder; `time_limit` in s by the clock, so a busy machine needs more."""
    command = [sys.executable, "-m", "inverse_service", "serve", "--port", "0"]
    environment = {
        **os.environ,
        "INVERSE_SERVICE_TIME_LIMIT": str(time_limit),
        "INVERSE_SERVICE_WORKERS": "2",
        "INVERSE_SERVICE_DATABASE": str(folder / "jobs.sqlite"),
        "INVERSE_SERVICE_LOG_LEVEL": "warning",
        "INVERSE_SERVICE_FRAME_ORIGINS": frame_origins,
    }
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
        process.terminate()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Browser tests come last: their driver keeps an event loop in the thread, and others start one of their own."""
    items.sort(key=lambda item: item.get_closest_marker("browser") is not None)
