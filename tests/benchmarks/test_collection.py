"""The benchmark of a list of documents counts what it says; nothing is timed here."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.collection import main

ENTRIES = [
    {"id": "free", "coordinates": ["y"], "equations": {"y": "-y"}, "expected": "variational"},
    {
        "id": "quadrature",
        "document": {"coordinates": ["x"], "equations": {"x": "-k*x'^n-g"}, "parameters": ["g", "k", "n"]},
        "expected": "variational",
    },
    {"id": "unknown", "coordinates": ["x"], "equations": {"x": "(1-x^2)*x'-x"}, "expected": "variational"},
    {"id": "left out", "coordinates": ["y"], "equations": {"y": "I*y"}, "expected": None},
]


def test_a_list_is_answered_line_by_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "list.ndjson"
    file.write_text("\n".join(map(json.dumps, ENTRIES)), encoding="utf-8")
    main([str(file), "--limit", "20"])
    lines = capsys.readouterr().out.splitlines()
    counts = {line.split(" | ")[0]: line.split(" | ")[1:4] for line in lines if line.startswith("| ")}
    assert counts["| with L"] == ["2", "1", "1"]
    assert counts["| all"] == ["3", "1", "1"]
    assert [line.split(":")[0] for line in lines if line.startswith("- ")] == ["- quadrature", "- unknown"]
    main([str(file), "--only", "free"])
    assert "| all | 1 | 0 | 1 |" in capsys.readouterr().out
