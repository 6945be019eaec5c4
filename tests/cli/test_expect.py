"""A batch with expected answers: differences, exit codes, and the JUnit report."""

import json
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


def run(call: Any, folder: Path, expected: list[dict[str, Any]] | None, *more: str) -> Any:
    source, wanted = folder / "in.ndjson", folder / "expected.ndjson"
    source.write_text("".join(json.dumps(line) + "\n" for line in LINES))
    command = ["batch", str(source), "--output", str(folder / "out.ndjson"), "--workers", "1"]
    if expected is not None:
        wanted.write_text("".join(json.dumps(line) + "\n" for line in expected))
        command += ["--expect", str(wanted)]
    return call(*command, *more)


def test_differences_are_printed_and_reported(call: Any, tmp_path: Path) -> None:
    report = tmp_path / "report.xml"
    right = [
        {"id": "oscillator", "verdict": YES, "verdict_with_time": YES},
        {"id": "none", "verdict": NO},
    ]
    found = run(
        call, tmp_path, [*right, {"id": "bad\u0001", "verdict": None}], "--junit", str(report)
    )
    assert (found.code, found.out) == (1, ""), "an unexpected error line"
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
    found = run(call, tmp_path, wrong, "--junit", str(report))
    assert found.code == 1
    assert found.out.splitlines() == [
        f'oscillator: verdict is "{YES}", expected "{NO}"',
        "absent: no answer",
    ]
    suite = ElementTree.parse(report).getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("5", "2", "2")


@pytest.mark.slow
def test_files_that_cannot_be_used_say_so(call: Any, tmp_path: Path) -> None:
    for bad in ([{"verdict": YES}], [{"id": "none", "verdict": NO}] * 2):
        assert run(call, tmp_path, bad).code == 2
    for name in ("absent/report.xml", "out.ndjson"):
        found = run(call, tmp_path, None, "--junit", str(tmp_path / name))
        assert (found.code, "report" in found.err, (tmp_path / "out.ndjson").exists()) == (
            2,
            True,
            False,
        )
