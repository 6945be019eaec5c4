"""Many systems at once, and their results as a table."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from inverse_service.errors import InputError
from inverse_service.sympy.result import Result, result_of

COLUMNS = ("id", "line", "verdict", "verdict_with_time", "checked", "question", "reason")


def answers_to_many(
    systems: Iterable[Any], workers: int, output: Path | None, time_limit: float
) -> Iterator[Result | dict[str, Any]]:
    """The answers in the order of the systems."""
    readings = [_document(system) for system in systems]
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "systems.ndjson"
        lines = (json.dumps({**document, "id": place}) for place, (document, _) in enumerate(readings))
        source.write_text("\n".join(lines) + "\n", encoding="utf-8")
        target = output or Path(folder) / "results.ndjson"
        _run(source, target, workers, time_limit)
        found = [json.loads(line) for line in target.read_text(encoding="utf-8").splitlines()]
    answers = {each["id"]: each for each in found}
    for place, (_, names) in enumerate(readings):
        answer = answers[place]
        yield result_of(answer, names) if str(answer.get("format", "")).startswith("inverse-service/") else answer


def _run(source: Path, target: Path, workers: int, time_limit: float) -> None:
    """The batch as a program of its own, so that a script needs no guard against being imported again."""
    command = [sys.executable, "-m", "inverse_service.cli", "batch", str(source), "--output", str(target)]
    command += ["--workers", str(workers), "--time-limit", str(time_limit)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not target.exists():
        raise InputError(done.stderr.strip()[-500:] or "The systems could not be answered.")


def _document(system: Any) -> tuple[dict[str, Any], Any]:
    if isinstance(system, str):
        return {"equations": system}, None
    if isinstance(system, Mapping) and all(isinstance(key, str) for key in system):
        return dict(system), None
    from inverse_service.sympy.reading import read

    found = read(system, None, None, None, {})
    return found.document, found.names


def table_of(results: Iterable[Mapping[str, Any]]) -> Any:
    """One row a result."""
    rows = [row_of(result) for result in results]
    if importlib.util.find_spec("pandas") is None:
        return rows
    return importlib.import_module("pandas").DataFrame(rows)


def row_of(result: Mapping[str, Any]) -> dict[str, Any]:
    """The columns that are compared first: verdicts, L, H, how many multipliers, seconds, size."""
    if not isinstance(result, Mapping):
        raise InputError("A table is made of results.")
    row = {key: result.get(key) for key in COLUMNS}
    if error := result.get("error"):
        row |= {"verdict": "error", "reason": error["detail"]}
    for letter, key in (("L", "lagrangian"), ("H", "hamiltonian")):
        row[letter] = (result.get(key) or {}).get("text")
    space, system = result.get("solution_space") or {}, result.get("system") or {}
    seconds = (result.get("provenance") or {}).get("seconds") or {}
    row |= {"statement": space.get("statement"), "n": len(system.get("coordinates", ())), "order": space.get("order")}
    return row | {"seconds": sum(seconds.values()) if seconds else None}
