"""A batch with expected answers: differences, exit codes, and the JUnit report."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

LINES: list[Any] = [
    {"id": "oscillator", "equations": "x'' = -x"},
    {"id": "none", "equations": {"x": "y", "y": "-x*x'"}},
    {"id": "bad\u0001", "equations": {"x": "omega"}, "parameters": []},
    "no document",
]
YES, NO = "variational", "not_variational"


def run(
    folder: Path, expected: list[dict[str, Any]] | None, *more: str
) -> subprocess.CompletedProcess[str]:
    source, wanted = folder / "in.ndjson", folder / "expected.ndjson"
    source.write_text("".join(json.dumps(line) + "\n" for line in LINES))
    command = [
        sys.executable,
        "-m",
        "inverse_service",
        "batch",
        str(source),
        "--output",
        str(folder / "out.ndjson"),
    ]
    if expected is not None:
        wanted.write_text("".join(json.dumps(line) + "\n" for line in expected))
        command += ["--expect", str(wanted)]
    return subprocess.run(
        [*command, *more], capture_output=True, text=True, timeout=300, check=False
    )


def test_differences_are_printed_and_reported(tmp_path: Path) -> None:
    report = tmp_path / "report.xml"
    right = [
        {"id": "oscillator", "verdict": YES, "verdict_with_time": YES},
        {"id": "none", "verdict": NO},
    ]
    found = run(tmp_path, [*right, {"id": "bad\u0001", "verdict": None}], "--junit", str(report))
    assert (found.returncode, found.stdout) == (1, ""), "an unexpected error line"
    suite = ElementTree.parse(report).getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("4", "0", "2")
    assert {case.get("name") for case in suite if case.find("error") is not None} == {
        "bad?",
        "line 4",
    }
    wrong = [
        {"id": "oscillator", "verdict": NO},
        {"id": "none", "verdict": NO},
        {"id": "absent", "verdict": YES},
    ]
    found = run(tmp_path, wrong, "--junit", str(report))
    assert found.returncode == 1
    assert found.stdout.splitlines() == [
        f'oscillator: verdict is "{YES}", expected "{NO}"',
        "absent: no answer",
    ]
    suite = ElementTree.parse(report).getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("5", "2", "2")


@pytest.mark.slow
def test_files_that_cannot_be_used_say_so(tmp_path: Path) -> None:
    for bad in ([{"verdict": YES}], [{"id": "none", "verdict": NO}] * 2):
        assert run(tmp_path, bad).returncode == 2
    for name in ("absent/report.xml", "out.ndjson"):
        found = run(tmp_path, None, "--junit", str(tmp_path / name))
        assert (found.returncode, "report" in found.stderr, (tmp_path / "out.ndjson").exists()) == (
            2,
            True,
            False,
        )
