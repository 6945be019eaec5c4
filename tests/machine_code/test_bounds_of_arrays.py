"""No kernel reads or writes beyond an array: numba checks each index here, which stored machine
code does not do. A word written past its row can crash the process much later.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CHECKED = """
import json, sys
from inverse_service.kernels.machine_code.kernels import Kernel
Kernel._entry = lambda kernel, kinds: None  # numba compiles each kernel, with checks
import numpy
from inverse_service.errors import InputError
from inverse_service.decision.solutions import SolveOptions
from inverse_service.kernels.machine_code.kernels import compiled
from inverse_service.service.documents.documents import solve_document

@compiled
def beyond(numbers):
    return numbers[numbers.size]

try:
    beyond(numpy.zeros(3, dtype=numpy.int64))
except IndexError:
    print("checked")
for line in sys.stdin:
    try:
        result = solve_document(json.loads(line), SolveOptions(time_limit=30))
    except InputError as error:
        print("refused", error.detail[:60])
        continue
    fault = result["provenance"].get("fault")
    print(fault or result["verdict"])
"""
MOVING = """{"lagrangian": "(x'^2+y'^2+z'^2+u'^2+v'^2+w'^2)/2", "constraints": ["w' - t*y*x'"], "associated": "any"}"""


def documents(count: int) -> list[str]:
    """A sample of the systems of papers and textbooks, and a motion whose constraints depend on
    time.
    """
    lines = (
        (ROOT / "tests" / "corpus" / "literature.ndjson").read_text(encoding="utf-8").splitlines()
    )
    return [json.dumps(json.loads(line)["document"]) for line in lines[:: len(lines) // count]] + [
        MOVING
    ]


@pytest.mark.nightly
def test_every_index_of_every_kernel_is_inside_its_array() -> None:
    given = documents(60)
    done = subprocess.run(
        [sys.executable, "-c", CHECKED],
        input="\n".join(given),
        env={**os.environ, "NUMBA_BOUNDSCHECK": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=3000,
    )
    said = done.stdout.split("\n")
    assert done.returncode == 0, done.stderr[-2000:]
    assert said[0] == "checked"
    assert len(said) == len(given) + 2
    assert sum(word in ("variational", "not_variational") for word in said) > 50, said
    assert "IndexError" not in done.stdout + done.stderr
