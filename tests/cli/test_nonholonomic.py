"""Nonholonomic documents on the command line: YAML, exit codes, batches."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from inverse_service import catalogue
from inverse_service.cli.command_line import run
from inverse_service.service.jobs import tasks

EDGE = """
coordinates: [phi, x, y]
lagrangian: m/2*(x'^2 + y'^2) + J/2*phi'^2
constraints: ["x'*sin(phi) = y'*cos(phi)"]
parameters: {m: 2, J: null}
associated: third
"""


@pytest.fixture(scope="module", autouse=True)
def engine() -> None:
    """Processes are forked from this one: load the engine once, not in each of them."""
    tasks.load_engine()


def called(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> object:
    monkeypatch.setattr(sys, "argv", ["inverse-service", *arguments])
    with pytest.raises(SystemExit) as caught:
        run()
    return caught.value.code


@pytest.mark.slow
def test_yaml_is_accepted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "edge.yaml").write_text(EDGE)
    assert called(monkeypatch, "solve", str(tmp_path / "edge.yaml")) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["hamiltonian"]["constraints"] == ["p_y"]
    assert result["system"]["parameters"] == ["J"]


def test_a_redundant_constraint_is_bad_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    document = catalogue.document("nonholonomic-particle")
    document["constraints"] = [*document["constraints"], "x*y' = -z'"]
    (tmp_path / "twice.json").write_text(json.dumps(document))
    assert called(monkeypatch, "solve", str(tmp_path / "twice.json")) == 2
    error = capsys.readouterr().err
    assert "constraint 2 is redundant" in error
    assert error.count("\n") == 1


def test_a_batch_takes_both_kinds_of_documents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    particle = catalogue.document("nonholonomic-particle") | {"associated": "second"}
    lines = [{"id": "a", **particle}, {"id": "b", "coordinates": ["x"], "equations": {"x": "-x"}}]
    source, target = tmp_path / "in.ndjson", tmp_path / "out.ndjson"
    source.write_text("\n".join(map(json.dumps, lines)) + "\n")
    assert called(monkeypatch, "batch", str(source), "--output", str(target), "--workers", "1") == 0
    found = {line["id"]: line for line in map(json.loads, target.read_text().splitlines())}
    assert found["a"]["nonholonomic"]["main"] == "second"
    assert found["b"]["verdict"] == "variational"
