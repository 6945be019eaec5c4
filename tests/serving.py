"""Start a service in a separate process, keep it busy with a question, and wait for conditions."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import IO

COMMAND = [sys.executable, "-m", "inverse_service", "serve", "--port", "0"]
NAMES = [f"x{k}" for k in range(8)]
TERMS = "+".join(f"{a}*{b}'^2*sin({a}*{b})" for a in NAMES for b in NAMES)
HARD = {
    "coordinates": NAMES,
    "equations": dict.fromkeys(NAMES, TERMS),
}  # longer than the wait of any test


def until(holds: Callable[[], object], seconds: float = 60.0, pause: float = 0.02) -> None:
    """Wait until the condition holds, with a limit in seconds."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(pause)


def environment_of(settings: dict[str, str]) -> dict[str, str]:
    """The environment of a process with two workers and these settings, named as in `Settings`."""
    given = {"workers": "2"} | settings
    return os.environ | {f"INVERSE_SERVICE_{name.upper()}": value for name, value in given.items()}


@contextmanager
def serving(
    command: list[str] = COMMAND, stderr: IO[bytes] | int | None = None, **settings: str
) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The process and the address of a service, which is stopped at the end."""
    environment = environment_of(settings)
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=stderr, text=True, env=environment
    ) as process:
        assert process.stdout is not None
        try:
            yield process, process.stdout.readline().strip()
        finally:
            process.terminate()
