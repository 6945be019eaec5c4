"""Run commands in this process."""

import io
import sys
from typing import Any, NamedTuple

import pytest

from inverse_service.cli.command_line import run


class Call(NamedTuple):
    """The outcome of a command."""

    code: int
    out: str
    err: str


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Any:
    def run_command(*arguments: str, given: bytes = b"") -> Call:
        monkeypatch.setattr(sys, "argv", ["inverse-service", *arguments])
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(given)))
        with pytest.raises(SystemExit) as ended:
            run()
        return Call(int(ended.value.code or 0), *capfd.readouterr())

    return run_command
