"""Run one measurement in a process of its own, with a time limit."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any

# python-flint, once installed, changes SymPy's number types; a user of plain SymPy has these:
_ENVIRONMENT = {"SYMPY_GROUND_TYPES": "python"}


def measure(module: str, arguments: Sequence[str], document: Mapping[str, Any], limit: float) -> dict[str, Any] | None:
    """The JSON object that `python -m module arguments < document` prints, None past `limit` seconds.

    CalledProcessError, with what it wrote to standard error, where it fails.
    """
    command = [sys.executable, "-m", module, *arguments]
    try:
        done = subprocess.run(
            command,
            input=json.dumps(document),
            capture_output=True,
            text=True,
            timeout=limit,
            check=True,
            env={**os.environ, **_ENVIRONMENT},
        )
    except subprocess.TimeoutExpired:
        return None
    result: dict[str, Any] = json.loads(done.stdout)
    return result
