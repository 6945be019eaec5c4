"""`inverse-service solve` from a cold start, for entries of the catalogue."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from inverse_service import catalogue

Report = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class ColdStart:
    """Seconds of one command by the clock and of processor time, its exit code (0: a definite
    verdict).

    None past the limit. If other programs use the machine, the processor time is the fairer number.
    """

    name: str
    seconds: float | None
    processor: float | None
    exit_code: int | None


def cold_starts(names: Sequence[str], limit: float, report: Report) -> list[ColdStart]:
    """Run each entry once, each in a fresh process."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            report(f"solve {name}")
            path = Path(folder) / f"{name}.json"
            path.write_text(json.dumps(catalogue.document(name)), encoding="utf-8")
            found.append(_cold_start(name, path, limit))
    return found


def _cold_start(name: str, path: Path, limit: float) -> ColdStart:
    command = [sys.executable, "-m", "inverse_service", "solve", str(path)]
    began, used = time.perf_counter(), _used_by_children()
    try:
        done = subprocess.run(
            command, capture_output=True, timeout=limit, check=False, env=dict(os.environ)
        )
    except subprocess.TimeoutExpired:
        return ColdStart(name, None, None, None)
    return ColdStart(name, time.perf_counter() - began, _used_by_children() - used, done.returncode)


def _used_by_children() -> float:
    """Processor seconds of all ended child processes and of their children."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
