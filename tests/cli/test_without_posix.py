"""Without the modules that Windows lacks: one system is solved, checked and simulated; pools of
workers are refused.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

LACKED = ("fcntl", "grp", "pwd", "resource", "termios")
BLOCKED = f"import sys; sys.modules.update(dict.fromkeys({LACKED})); "
SYMPY = """
import sympy as sp
from inverse_service import sympy
t = sp.Symbol("t")
x = sp.Function("x")(t)
print(sympy.solve([sp.Eq(x.diff(t, 2), -x)]).lagrangian)
"""


@pytest.mark.parametrize(
    "line", ["serve", "batch in.ndjson --output out.ndjson", "check answers.ndjson"]
)
def test_a_pool_is_refused_in_a_sentence(
    call: Any, monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    monkeypatch.setitem(sys.modules, "fcntl", None)
    found = call(*line.split())
    assert (found.code, found.out) == (2, "")
    assert "needs file locks and forked processes, which this system lacks" in found.err


@pytest.mark.slow
def test_one_system_is_solved_and_checked(tmp_path: Path) -> None:
    def run(*words: str) -> subprocess.CompletedProcess[str]:
        code = f"{BLOCKED}from inverse_service.cli.command_line import run; run()"
        return subprocess.run(
            [sys.executable, "-c", code, *words], capture_output=True, text=True, check=False
        )

    result = tmp_path / "result.json"
    assert run("solve", "sho", "--output", str(result)).returncode == 0
    checked = run("check", str(result))
    assert (checked.returncode, json.loads(checked.stdout)["verdict"]) == (0, "valid")


@pytest.mark.slow
def test_sympy_objects_go_in_and_out() -> None:
    done = subprocess.run(
        [sys.executable, "-c", BLOCKED + SYMPY], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "-x(t)**2/2 + Derivative(x(t), t)**2/2"
