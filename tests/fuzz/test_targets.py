"""The fuzz targets: some Hypothesis examples always, and many with atheris if it is installed."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz.targets import TARGETS

ROOT = Path(__file__).parents[2]
RUNS = 20_000


@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_nothing_made_up_is_a_fault(name: str) -> None:
    TARGETS[name]()


@pytest.mark.nightly
@pytest.mark.skipif(importlib.util.find_spec("atheris") is None, reason="atheris is not installed")
@pytest.mark.parametrize("name", TARGETS)
def test_nothing_that_atheris_finds_is_a_fault(name: str, tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "tests.fuzz.with_atheris",
        name,
        f"-runs={RUNS}",
        f"-artifact_prefix={tmp_path}/",
    ]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=3600)
    assert run.returncode == 0, run.stderr[-4000:]
    assert f"Done {RUNS} runs" in run.stderr
