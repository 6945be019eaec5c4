"""Many systems at once: their results in order, and as a table."""

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
from inverse_service.service.documents.text_page import branches_of, common_verdict, conditions_of, first_answer
from inverse_service.sympy.result_objects import Result, result_of

COLUMNS = ("id", "line", "verdict", "verdict_with_time", "checked", "question", "reason")


class Answers(Iterator[Result | dict[str, Any]]):
    """The answers as they come, each once; `to_pandas` takes those that are left."""

    def __init__(self, answers: Iterator[Result | dict[str, Any]]) -> None:
        self._answers = answers

    def __next__(self) -> Result | dict[str, Any]:
        return next(self._answers)

    def to_pandas(self) -> Any:
        """A DataFrame with one row a result, see `row_of`; needs pandas."""
        return _frame([row_of(answer) for answer in self])


class Run(dict[str, Any]):
    """The summary of a scene."""

    def to_pandas(self) -> Any:
        """A DataFrame with one row a method: its outcome, and every observed number; needs pandas."""
        methods = self.get("methods") or []
        return _frame([dict(_numbers(one)) for one in methods if isinstance(one, Mapping)])


def _numbers(part: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Numbers and texts of nested objects, named by their path."""
    for key, value in part.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{prefix}{key}.")
        elif isinstance(value, int | float | str | None):
            yield prefix + key, value


def _frame(rows: list[dict[str, Any]]) -> Any:
    try:
        pandas = importlib.import_module("pandas")
    except ImportError:
        raise InputError("This needs pandas: run `pip install pandas`, or use `table(results)`.") from None
    return pandas.DataFrame(rows)


def answers_to_many(
    systems: Iterable[Any], workers: int, output: Path | None, time_limit: float
) -> Iterator[Result | dict[str, Any]]:
    """The answers in the order of the systems."""
    from inverse_service.service.documents.answers import of_input_error

    readings = [_asked(system) for system in systems]
    lines = [
        json.dumps({**reading[0], "id": place}, default=str)
        for place, reading in enumerate(readings)
        if not isinstance(reading, InputError)
    ]
    answers = {each["id"]: each for each in _answered(lines, workers, output, time_limit)}
    for place, reading in enumerate(readings):
        if isinstance(reading, InputError):
            problem = of_input_error(reading)
            yield {"id": place, **problem, "error": problem}
        elif str(answers[place].get("format", "")).startswith("inverse-service/"):
            yield result_of(answers[place], reading[1])
        else:
            yield answers[place]


def _asked(system: Any) -> tuple[dict[str, Any], Any] | InputError:
    from inverse_service.sympy import asked

    try:
        return asked(system)
    except InputError as error:
        return error


def _answered(lines: list[str], workers: int, output: Path | None, time_limit: float) -> list[dict[str, Any]]:
    """The answers to the lines, from a batch of its own, so that a script needs no guard against being imported."""
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "systems.ndjson", output or Path(folder) / "results.ndjson"
        source.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
        command = [sys.executable, "-m", "inverse_service", "batch", str(source), "--output", str(target)]
        command += ["--workers", str(workers), "--time-limit", str(time_limit)]
        done = subprocess.run(command, capture_output=True, text=True, check=False) if lines else None
        found = [json.loads(line) for line in target.read_text("utf-8").splitlines()] if target.exists() else []
    if done is not None and len(found) < len(lines):
        raise InputError(done.stderr.strip()[-500:] or "The systems could not be answered.")
    return found


def table_of(results: Iterable[Mapping[str, Any]]) -> Any:
    """One row a result."""
    rows = [row_of(result) for result in results]
    if importlib.util.find_spec("pandas") is None:
        return rows
    return importlib.import_module("pandas").DataFrame(rows)


def row_of(result: Mapping[str, Any]) -> dict[str, Any]:
    """The columns that are compared first: verdicts, L, H, where they hold, how many multipliers, seconds, size.

    All of them are of the first of the `branches`, but the verdicts: "mixed" where the branches differ.
    """
    if not isinstance(result, Mapping):
        raise InputError("A table needs results.")
    row = {key: result.get(key) for key in COLUMNS}
    for key in ("verdict", "verdict_with_time"):
        row[key] = common_verdict(branches_of(result), key)
    if error := result.get("error"):
        row |= {"verdict": "error", "reason": error["detail"]}
    first = first_answer(result)
    for letter, key in (("L", "lagrangian"), ("H", "hamiltonian")):
        row[letter] = (first.get(key) or {}).get("text")
    space, system = result.get("solution_space") or {}, result.get("system") or {}
    seconds = (result.get("provenance") or {}).get("seconds") or {}
    row |= {"statement": space.get("statement"), "n": len(system.get("coordinates", ())), "order": space.get("order")}
    row |= {"seconds": sum(seconds.values()) if seconds else None}
    return row | {"where": ", ".join(conditions_of(first)), "branches": len(branches_of(result))}
