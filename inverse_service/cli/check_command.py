"""`inverse-service check`."""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from inverse_service.cli.batching import NAMES, progress
from inverse_service.cli.exits import ExitCode, read_bytes, write
from inverse_service.decision.solutions import SolveOptions
from inverse_service.errors import InputError
from inverse_service.service.documents.own_lagrangian import document_of
from inverse_service.service.documents.plain_data import decode, read_document, read_json
from inverse_service.service.documents.special_values import left_out
from inverse_service.service.jobs import tasks
from inverse_service.service.jobs.batch import BatchPlan, Summary, open_source, read_answers, run_batch
from inverse_service.service.jobs.model import JobOptions, split_options, write_json
from inverse_service.service.jobs.outcome import value_of
from inverse_service.service.jobs.workers import run_alone
from inverse_service.settings import read_settings

MAX_RESULT_BYTES = 200_000_000


def check_file(name: str, document: str | None = None, form: str | None = None) -> ExitCode:
    """Run the checker in a process of its own; print what it proved and what it did not compare.

    `document` names the file of the system that was given; left out, it is the one that the result carries.
    """
    result = _read(name)
    text = write_json(result)
    if document is not None:
        given, _ = split_options(read_document(read_bytes(document), document))
        text = write_json({"document": given, "result": result})
    return _told(_checked(text), form)


def check_own(name: str, lagrangian: str, form: str | None = None) -> ExitCode:
    """Whether a Lagrangian has the equations of the document, or of the result, in the file."""
    found = _read(name) if name.lower().endswith(".json") or name == "-" else read_document(read_bytes(name), name)
    given, _ = split_options(document_of(found))
    return _told(_checked(write_json({"system": given, "lagrangian": lagrangian})), form)


def check_exceptions(name: str, form: str | None = None) -> ExitCode:
    """Solve the systems of a result at the values of the parameters that it leaves out."""
    result, settings = _read(name), read_settings()
    decided = list[dict[str, Any]]()
    for text, document in left_out(result):
        entry: dict[str, Any] = {"where": text, "verdict": "undetermined", "verdict_with_time": None}
        if document is not None:
            work = (document, SolveOptions(time_limit=settings.time_limit))
            outcome = run_alone(tasks.solve_task, work, settings.time_limit, settings.memory_limit)
            if outcome.status not in ("deadline", "memory"):
                found = value_of(outcome)
                entry |= {key: found[key] for key in ("verdict", "verdict_with_time", "checked", "domain")}
                entry["lagrangian"] = (found["lagrangian"] or {}).get("text")
        decided.append(entry)
    if form == "json" or (form is None and not sys.stdout.isatty()):
        write(json.dumps({"exceptions": decided}, ensure_ascii=False, indent=2) + "\n")
    else:
        write("".join(f"{line}\n" for one in decided for line in _exception_lines(one)) or "no exceptions\n")
    return ExitCode.DONE if all(one["verdict"] != "undetermined" for one in decided) else ExitCode.OPEN


def _exception_lines(one: dict[str, Any]) -> Iterator[str]:
    yield f"{one['where']}: {one['verdict'].replace('_', ' ')}"
    if one["verdict_with_time"] not in (None, one["verdict"]):
        yield f"  with the time: {one['verdict_with_time'].replace('_', ' ')}"
    if one.get("lagrangian"):
        yield f"  L = {one['lagrangian']}"


def _read(name: str) -> dict[str, Any]:
    text = decode(read_bytes(name, MAX_RESULT_BYTES))
    if name.lower().endswith((".yaml", ".yml", ".toml")):
        text = write_json(read_document(text, name))
    found = read_json(text)
    if not isinstance(found, dict):
        raise InputError("The file is not a result: a JSON object with verdict, system and certificate is needed.")
    return found


def _told(found: dict[str, Any], form: str | None) -> ExitCode:
    if form == "json" or (form is None and not sys.stdout.isatty()):
        write(json.dumps(found, ensure_ascii=False, indent=2) + "\n")
    else:
        write("\n".join(check_lines(found)) + "\n")
    return ExitCode.DONE if found["verdict"] == "valid" else ExitCode.OPEN


def check_lines(found: dict[str, Any]) -> list[str]:
    """An answer of the checker for a person to read."""
    lines = [found["verdict"]]
    if found.get("statement"):
        lines += ["", *found["statement"]["text"].split("\n")]
    cells = found.get("cells") or []
    if found.get("residual") is not None or len(cells) > 1:
        lines += ["", *(line for cell in cells for line in _cell_lines(cell))]
    lines += [""] if found.get("contradictions") else []
    lines += [f"{one['field'] or '/'}: {one['proven']}" for one in found.get("contradictions") or []]
    if found["verdict"] != "valid":
        told = {f"{one['field'] or 'the result'}: {one['proven']}" for one in found.get("contradictions") or []}
        lines += [reason for reason in found["reasons"] if reason not in told]
    residual = (found.get("residual") or {}) if found["verdict"] in ("invalid", "differs") else {}
    lines += [f"  d/dt(dL/d{x}') - dL/d{x} = {part['text']}, where it should be 0" for x, part in residual.items()]
    lines += [f"  this L gives {x}'' = {part['text']}" for x, part in (found.get("equations") or {}).items()]
    left = found.get("not_checked") or []
    return [*lines, "", f"Not checked: {', '.join(left)}."] if left else lines


def _cell_lines(cell: dict[str, Any]) -> Iterator[str]:
    yield f"{', '.join(cell['domain']) or 'everywhere'}: {cell['verdict'].replace('_', ' ')}"
    if cell.get("at"):
        yield f"  at {', '.join(f'{name} = {value}' for name, value in cell['at'].items())}:"
        for name, value in (cell.get("accelerations") or {}).get("given", {}).items():
            yield f"  {name}'' = {value}, by this L {cell['accelerations']['lagrangian'][name]}"


def _checked(text: str) -> dict[str, Any]:
    """The verdict of the checker in a process of its own."""
    settings = read_settings()
    outcome = run_alone(tasks.check_task, (text,), settings.time_limit, settings.memory_limit)
    if outcome.status in ("deadline", "memory"):
        return {"verdict": "incomplete", "reasons": [f"The check was stopped at its {outcome.status} limit."]}
    found: dict[str, Any] = value_of(outcome)
    return found


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
