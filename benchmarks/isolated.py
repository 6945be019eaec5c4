"""Run one measurement in its own process, with a limit on its processor time.

The limit is on processor time, not on the clock, so that other load on the machine does not stop a
run.
"""

from __future__ import annotations

import compileall
import json
import math
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

# python-flint, if installed, changes SymPy's number types; a user of plain SymPy has these:
_ENVIRONMENT = {"SYMPY_GROUND_TYPES": "python"}


def measure(
    module: str, arguments: Sequence[str], document: Mapping[str, Any], limit: float
) -> dict[str, Any] | None:
    """The JSON object that `python -m module arguments < document` prints, None past `limit`
    seconds of processor time. Raises CalledProcessError with its standard error if it fails.
    """
    _compile_packages()
    bound = math.ceil(limit)
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments],
        input=json.dumps(document),
        capture_output=True,
        text=True,
        env={**os.environ, **_ENVIRONMENT},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (bound, bound + 1)),
    )
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return None
    done.check_returncode()
    result: dict[str, Any] = json.loads(done.stdout)
    return result


@cache
def _compile_packages() -> None:
    """Byte code, as an installed package has it, also where the environment keeps Python from
    writing any.
    """
    for package in ("api_schemas", "benchmarks", "inverse_service"):
        compileall.compile_dir(Path(__file__).parent.parent / package, quiet=1)
