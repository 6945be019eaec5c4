"""`inverse-service check`."""

from __future__ import annotations

from typing import Any

from inverse_service.cli.exits import ExitCode
from inverse_service.cli.files import read_bytes, write
from inverse_service.errors import InputError
from inverse_service.service.documents.reading import decode, read_document, read_json
from inverse_service.service.jobs import tasks
from inverse_service.service.jobs.alone import run_alone
from inverse_service.service.jobs.identity import write_json
from inverse_service.service.jobs.options import split_options
from inverse_service.settings import read_settings

MAX_RESULT_BYTES = 200_000_000


def check_file(name: str, document: str | None = None) -> ExitCode:
    """Run the checker in a process of its own; print its verdict and its reasons.

    `document` names the file of the system that was given; left out, it is the one that the result carries.
    """
    text = decode(read_bytes(name, MAX_RESULT_BYTES))
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
    from inverse_service.service.documents.answers import value_of

    found: dict[str, Any] = value_of(outcome)
    return found


def _exit(found: dict[str, Any]) -> ExitCode:
    return ExitCode.DONE if found["verdict"] == "valid" else ExitCode.OPEN
