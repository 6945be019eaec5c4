"""Start a service in a separate process, keep it busy with a question, and wait for conditions."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import IO
from unittest import mock

import httpx

from inverse_service.web import engine

COMMAND = [sys.executable, "-m", "inverse_service", "serve", "--port", "0"]
NAMES = [f"x{k}" for k in range(8)]
TERMS = "+".join(f"{a}*{b}'^2*sin({a}*{b})" for a in NAMES for b in NAMES)
HARD = {
    "coordinates": NAMES,
    "equations": dict.fromkeys(NAMES, TERMS),
}  # longer than the wait of any test


WAITING = "wait=20"  # `Prefer`, the longest that a service waits
TIME_LIMIT = 300  # s, of the service that tests share
PATIENCE = 600.0  # s that a machine may take on which other programs have the processor


def until(holds: Callable[[], object], seconds: float = PATIENCE, pause: float = 0.02) -> None:
    """Wait until the condition holds, with a limit in seconds."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(pause)


def _is_owed(request: httpx.Request, response: httpx.Response) -> bool:
    """Whether the service was too busy for an answer: it had no processor for a quick one, or the wait
    was over before the answer to a question that may be asked again. A batch is accepted, no more.
    """
    if response.status_code == 503:
        return engine.BUSY in response.read().decode()
    waits = request.headers.get("prefer") == WAITING and request.url.path != "/v1/batches"
    return response.status_code == 202 and waits and "cache-control" not in request.headers


@contextmanager
def waiting() -> Iterator[None]:
    """Within, a call with `Prefer: wait=20` ends with its answer, however busy the machine is, and one
    that finds no processor is made again.
    """
    at_once = httpx.HTTPTransport.handle_request

    def answered(self: httpx.HTTPTransport, request: httpx.Request) -> httpx.Response:
        given = request.extensions.get("timeout", {})
        # Less than a second is what a test is about.
        longer = {part: PATIENCE for part, seconds in given.items() if seconds and seconds >= 1}
        request.extensions["timeout"] = given | longer
        end = time.monotonic() + PATIENCE
        while _is_owed(request, response := at_once(self, request)) and time.monotonic() < end:
            response.close()
            time.sleep(0.2)
        return response

    with mock.patch.object(httpx.HTTPTransport, "handle_request", answered):
        yield


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
