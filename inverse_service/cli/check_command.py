"""`inverse-service check`."""

from __future__ import annotations

import json
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from inverse_service.cli.batching import NAMES, progress
from inverse_service.cli.exits import ExitCode, read_bytes, write
from inverse_service.errors import InputError
from inverse_service.service.documents.plain_data import decode, read_document, read_json
from inverse_service.service.jobs import tasks
from inverse_service.service.jobs.batch import BatchPlan, Summary, run_batch
from inverse_service.service.jobs.batch_files import open_source, read_answers
from inverse_service.service.jobs.model import JobOptions, split_options, write_json
from inverse_service.service.jobs.single_call import run_alone
from inverse_service.settings import read_settings

MAX_RESULT_BYTES = 200_000_000


def check_file(name: str, document: str | None = None) -> ExitCode:
    """Run the checker in a process of its own; print its verdict and its reasons.

    `document` names the file of the system that was given; left out, it is the one that the result carries.
    """
    text = decode(read_bytes(name, MAX_RESULT_BYTES))
    if name.lower().endswith((".yaml", ".yml", ".toml")):
        text = write_json(read_document(text, name))
    result = read_json(text)
    if not isinstance(result, dict):
        raise InputError("The file is not a result: a JSON object with verdict, system and certificate is needed.")
    if document is not None:
        given, _ = split_options(read_document(read_bytes(document), document))
        text = write_json({"document": given, "result": result})
    found = _checked(text)
    write(_lines(found))
    return _exit(found)


def check_own(name: str, lagrangian: str) -> ExitCode:
    """Whether a Lagrangian has the equations of the document in the file; prints what is left."""
    given, _ = split_options(read_document(read_bytes(name), name))
    found = _checked(write_json({"system": given, "lagrangian": lagrangian}))
    residual = (found.get("residual") or {}) if found["verdict"] != "valid" else {}
    left = [f"  d/dt(dL/d{x}') - dL/d{x} = {part['text']}, where it should be 0" for x, part in residual.items()]
    own = [f"  this L gives {x}'' = {part['text']}" for x, part in (found.get("equations") or {}).items()]
    write(_lines(found, *left, *own))
    return _exit(found)


def _lines(found: dict[str, Any], *more: str) -> str:
    return "\n".join([found["verdict"], *found["reasons"], *more]) + "\n"


def _checked(text: str) -> dict[str, Any]:
    """The verdict of the checker in a process of its own."""
    settings = read_settings()
    outcome = run_alone(tasks.check_task, (text,), settings.time_limit, settings.memory_limit)
    if outcome.status in ("deadline", "memory"):
        return {"verdict": "incomplete", "reasons": [f"The check was stopped at its {outcome.status} limit."]}
    from inverse_service.service.jobs.outcome import value_of

    found: dict[str, Any] = value_of(outcome)
    return found


def _exit(found: dict[str, Any]) -> ExitCode:
    return ExitCode.DONE if found["verdict"] == "valid" else ExitCode.OPEN


def is_batch(name: str) -> bool:
    """Whether the file is the output of a batch: by its ending, or because its first line is a whole object."""
    if name.endswith((".ndjson", ".jsonl", ".gz")):
        return True
    try:
        with Path(name).open(encoding="utf-8") as stream:
            first, second = stream.readline(MAX_RESULT_BYTES), stream.readline(2)
        return bool(second.strip()) and isinstance(json.loads(first), dict)
    except (OSError, ValueError):
        return False


def check_batch(name: str) -> ExitCode:
    """Check every line of a batch's output; prints what is not valid and the totals. 0: every claim is valid."""
    settings = read_settings()
    options, summary, others = JobOptions(settings.time_limit, settings.memory_limit), Summary(), Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        claims, answers = Path(folder) / "claims.ndjson", Path(folder) / "answers.ndjson"
        ids = _claims(name, claims, others)
        if ids:
            with progress(summary, len(ids)) as report:
                run_batch(BatchPlan(claims, answers, options, settings.workers, kind="check"), summary, report)
            for answer in map(json.loads, answers.open(encoding="utf-8")):
                if answer.get("verdict") != "valid":
                    number = answer["id"]
                    reasons = answer.get("reasons") or [answer["error"]["detail"]]
                    write(f"line {number}, id {ids[number]}: {answer.get('verdict', 'error')}: {' '.join(reasons)}\n")
    named = {what: NAMES.get(what, (what, what)) for what in (*sorted(summary.labels), *others)}
    counts = [
        f"{count} {named[what][count != 1]}" for what, count in (*sorted(summary.labels.items()), *others.items())
    ]
    write(f"{', '.join(counts) or 'no lines'}.\n")
    return ExitCode.OPEN if others["error"] or summary.labels.keys() - {"valid"} else ExitCode.DONE


def _claims(name: str, target: Path, others: Counter[str]) -> dict[int, str]:
    """Write the results that claim something, by their line numbers; the ids as they are. Counts the others."""
    ids = {}
    with open_source(Path(name)) as source, target.open("w", encoding="utf-8") as stream:
        for line, result in read_answers(source):
            if "error" in result:
                others["error"] += 1
            elif "verdict" not in result:
                others["without a verdict to check"] += 1
            else:
                ids[line.number] = json.dumps(line.identifier)
                stream.write(write_json({**result, "id": line.number}) + "\n")
    return ids
