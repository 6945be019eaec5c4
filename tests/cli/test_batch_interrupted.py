"""Two thousand lines through signals, kill -9, changed lines, --again, .gz and -: none is lost or
mismatched.
"""

from __future__ import annotations

import contextlib
import gzip
import json
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX"),
]
COMMAND = [sys.executable, "-m", "inverse_service", "batch"]
LINES = 2000
SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGKILL)


def line(k: int, stiffness: int) -> dict[str, Any]:
    """A line whose answer identifies it: the Lagrangian contains the stiffness.

    Some lines are errors, some have no Lagrangian.
    """
    if k % 50 == 7:
        return {"id": k, "coordinates": ["x"], "equations": {"x": f"-omega{stiffness}*x"}}
    if k % 25 == 3:
        return {
            "id": k,
            "coordinates": ["x", "y"],
            "equations": {"x": f"{stiffness}*(x^2+y^2)", "y": "0"},
        }
    return {"id": k, "coordinates": ["x"], "equations": {"x": f"-{stiffness}*x"}}


def write(path: Path, lines: list[dict[str, Any]]) -> None:
    text = "".join(json.dumps(each) + "\n" for each in lines).encode()
    path.write_bytes(gzip.compress(text) if path.suffix == ".gz" else text)


def answers(path: Path) -> list[dict[str, Any]]:
    text = path.read_bytes()
    return [
        json.loads(each)
        for each in (gzip.decompress(text) if path.suffix == ".gz" else text).splitlines()
    ]


def interrupted(source: Path, output: Path, times: int) -> Counter[int]:
    """Run the batch to the end with interruptions at random times; return the exit codes."""
    dice, codes = random.Random(times), Counter[int]()
    for k in range(1000):
        process = subprocess.Popen(
            [*COMMAND, str(source), "--output", str(output), "--workers", "2"],
            stderr=subprocess.DEVNULL,
        )
        if k < times:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(dice.uniform(1.0, 12.0))
            if process.poll() is None:
                process.send_signal(SIGNALS[k % 3])
        codes[process.wait(1200)] += 1
        if k >= times:
            return codes
    raise AssertionError("it never ends")


def assert_each_is_answered_by_its_own(
    lines: list[dict[str, Any]], found: list[dict[str, Any]]
) -> None:
    assert Counter(answer["id"] for answer in found) == Counter(each["id"] for each in lines)
    asked = {each["id"]: each["equations"]["x"] for each in lines}
    for answer in found:
        equation = asked[answer["id"]]
        if "omega" in equation:
            assert equation.strip("-").removesuffix("*x") in answer["detail"]
        elif "^2" in equation:
            assert answer["verdict"] == "not_variational"
        else:
            stiffness = int(equation.strip("-*x"))
            half = str(stiffness // 2) if stiffness % 2 == 0 else f"{stiffness}"
            assert answer["verdict"] == "variational"
            assert half in answer["lagrangian"]["text"], (equation, answer["lagrangian"]["text"])


@pytest.mark.parametrize("ending", ["ndjson", "ndjson.gz"])
def test_two_thousand_lines_through_interruptions_changes_and_again(
    ending: str, tmp_path: Path
) -> None:
    source, output = tmp_path / f"in.{ending}", tmp_path / f"out.{ending}"
    lines = [line(k, 2 * (k + 100)) for k in range(LINES)]
    write(source, lines)
    began = time.monotonic()
    codes = interrupted(source, output, 9)
    assert_each_is_answered_by_its_own(lines, answers(output))
    # Every tenth line is changed, one line is new, and the errors are fixed: only these are
    # computed.
    changed = [
        line(each["id"], 3 * (each["id"] + 7000)) if each["id"] % 10 == 0 else each
        for each in lines
    ]
    mended = [
        each | {"equations": {"x": "-6*x"}} if "omega" in each["equations"]["x"] else each
        for each in changed
    ]
    mended.insert(5, line(LINES, 8))
    write(source, mended)
    codes += interrupted(source, output, 3)
    assert_each_is_answered_by_its_own(mended, answers(output))
    again = [*COMMAND, str(source), "--output", str(output), "--again", "errors,undetermined"]
    assert subprocess.run(again, stderr=subprocess.DEVNULL).returncode == 0
    assert_each_is_answered_by_its_own(mended, answers(output))
    print(f"{ending}: {LINES} lines, exit codes {dict(codes)}, {time.monotonic() - began:.0f} s")
    assert set(codes) <= {0, 1, 130, -signal.SIGKILL, -signal.SIGTERM, -signal.SIGINT}


def test_two_thousand_lines_from_standard_input_to_standard_output() -> None:
    lines = [line(k, 2 * (k + 100)) for k in range(LINES)]
    text = "".join(json.dumps(each) + "\n" for each in lines)
    done = subprocess.run(
        [*COMMAND, "-", "--output", "-"], input=text, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert_each_is_answered_by_its_own(
        lines, [json.loads(each) for each in done.stdout.splitlines()]
    )
