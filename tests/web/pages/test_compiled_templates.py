"""Templates are compiled once for all processes, and again when anything that they follow from changes."""

from __future__ import annotations

from pathlib import Path
from unittest import mock

import pytest
from jinja2 import Environment

from inverse_service.web.pages import rendering

TEMPLATE = "plain.html"


def compiled_by(environment: Environment) -> int:
    """How many templates an environment compiles for a page."""
    with mock.patch.object(environment, "compile", wraps=environment.compile) as compile_one:
        environment.get_template(TEMPLATE)
    return int(compile_one.call_count)


def test_a_second_process_compiles_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("INVERSE_SERVICE_CACHE", str(tmp_path / "cache"))
    make = rendering.environment.__wrapped__
    assert compiled_by(make()) == 1
    assert compiled_by(make()) == 0
    other = make()
    other.trim_blocks = False
    assert compiled_by(other) == 1
    for file in (tmp_path / "cache").iterdir():
        file.write_bytes(file.read_bytes()[:-9] + b"otherwise")  # damaged
    assert compiled_by(make()) == 1


def test_without_a_cache_pages_are_made_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("INVERSE_SERVICE_CACHE", "/proc/none")
    make = rendering.environment.__wrapped__
    assert compiled_by(make()) == 1
    assert compiled_by(make()) == 1
