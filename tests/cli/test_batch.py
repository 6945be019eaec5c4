"""A batch answers every line exactly once, whatever the lines are and whenever it is killed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

SYSTEM = {"coordinates": ["x"], "equations": {"x": "-x"}}
COMMAND = [sys.executable, "-m", "inverse_service.cli", "batch"]


def batch(source: Path, output: Path) -> subprocess.CompletedProcess[str]:
    command = [*COMMAND, str(source), "--output", str(output), "--workers", "2", "--time-limit", "20"]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def answers(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    return tmp_path / "in.ndjson", tmp_path / "out.ndjson"


def test_bad_lines_become_error_lines_and_the_rest_goes_on(files: tuple[Path, Path]) -> None:
    source, output = files
    lines = [
        json.dumps({"id": "good", **SYSTEM}),
        "",
        "{not json",
        json.dumps({"id": "unknown", **SYSTEM, "colour": "red"}),
        json.dumps({"id": "good", **SYSTEM}),
        json.dumps(SYSTEM),
        json.dumps({"id": "name", "coordinates": ["x"], "equations": {"x": "-k*x"}}),
        '{"id": "nan", "coordinates": NaN}',
    ]
    source.write_text("\n".join(lines))
    run = batch(source, output)
    assert run.returncode == 0, run.stderr
    found = {answer["line"]: answer for answer in answers(output)}
    assert sorted(found) == [1, 3, 4, 5, 6, 7, 8]
    assert [found[k]["verdict"] for k in (1, 6)] == ["variational", "variational"]
    assert [found[k]["id"] for k in (1, 3, 4, 5, 6, 7, 8)] == ["good", None, "unknown", "good", 6, "name", None]
    for k in (3, 4, 5, 7, 8):
        assert found[k]["error"]["detail"].startswith(f"Line {k}: ")
    assert found[5]["duplicate_of"] == 1
    assert found[7]["error"]["errors"][0]["pointer"] == "/equations/x"
    assert found[7]["error"]["errors"][0]["column"] == 2
    assert "2 variational" in run.stderr
    assert "Traceback" not in run.stderr
    before = output.read_bytes()
    assert "answered by an earlier run" in batch(source, output).stderr
    assert output.read_bytes() == before


def test_a_batch_that_is_killed_half_way_and_started_again_answers_every_line_once(files: tuple[Path, Path]) -> None:
    source, output = files
    count = 60
    source.write_text("".join(json.dumps({"id": f"s{k}", **SYSTEM, "name": f"{k}"}) + "\n" for k in range(count)))
    command = [*COMMAND, str(source), "--output", str(output), "--workers", "2"]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        end = time.monotonic() + 120
        while (not output.exists() or output.read_bytes().count(b"\n") < 10) and time.monotonic() < end:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    done = output.read_bytes().count(b"\n")
    assert 10 <= done < count
    with output.open("ab") as stream:
        stream.write(b'{"id": "s149", "line"')  # as if killed within a write
    run = batch(source, output)
    assert run.returncode == 0, run.stderr
    assert sorted(answer["id"] for answer in answers(output)) == sorted(f"s{k}" for k in range(count))
    assert {answer["verdict"] for answer in answers(output)} == {"variational"}


@pytest.mark.parametrize("content", ["", "\n\n  \n"])
def test_an_empty_batch_has_an_empty_output(files: tuple[Path, Path], content: str) -> None:
    source, output = files
    source.write_text(content)
    assert batch(source, output).returncode == 0
    assert output.read_bytes() == b""


def test_files_that_cannot_be_used_are_exit_2(files: tuple[Path, Path]) -> None:
    source, output = files
    missing = batch(source, output)
    assert (missing.returncode, missing.stderr.count("\n")) == (2, 1)
    source.write_text(json.dumps(SYSTEM) + "\n")
    for bad in (source, source.parent / "no" / "out", source.parent):
        run = batch(source, bad)
        assert (run.returncode, run.stderr.count("\n")) == (2, 1), run.stderr
    assert source.read_text() == json.dumps(SYSTEM) + "\n"
    output.write_text("my thesis\n")
    assert batch(source, output).returncode == 2
    assert output.read_text() == "my thesis\n"
