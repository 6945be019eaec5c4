"""Run one measurement in a process of its own, with a limit on its processor time.

Processor time and not the clock: other load on the machine then neither stops a run nor slows it.
"""

from __future__ import annotations

import json
import math
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any

# python-flint, once installed, changes SymPy's number types; a user of plain SymPy has these:
_ENVIRONMENT = {"SYMPY_GROUND_TYPES": "python"}


def measure(module: str, arguments: Sequence[str], document: Mapping[str, Any], limit: float) -> dict[str, Any] | None:
    """The JSON object that `python -m module arguments < document` prints, None past `limit` seconds of processor time.

    CalledProcessError, with what it wrote to standard error, where it fails.
    """
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
