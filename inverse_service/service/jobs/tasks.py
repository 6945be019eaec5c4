"""The tasks that worker processes run. Light to import: the engine is loaded inside the process."""

from __future__ import annotations

import importlib
import json
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from inverse_service.errors import InputError
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.reading import read_json
from inverse_service.service.jobs.kinds import KINDS, label_of
from inverse_service.service.jobs.options import stored_options
from inverse_service.service.jobs.outcome import Outcome, Place, faults_of

ENGINE = tuple(
    f"inverse_service.service.documents.{name}" for name in ("documents", "solving", "nonholonomic", "checking")
)


def load_engine() -> None:
    """Import everything that a task needs."""
    for module in ENGINE:
        importlib.import_module(module)


@dataclass(frozen=True, slots=True)
class Answer:
    """A result as it is stored and sent, what it is counted as, and the fault of ours that ended it, if one did."""

    body: bytes
    label: str
    fault: str = ""


def job_task(kind: str, document: str, options: str, report: Callable[[Any], None]) -> Outcome:
    """A stored job to its Answer; JSON is read and written here, so that the service has its hands free."""
    return guard(_job, kind, document, options, report)


def understand_job_task(document: str) -> Outcome:
    """The document of a stored solve job to the `system` part of a result."""
    return guard(lambda: _documents().understand_document(read_json(document)))


def solve_task(document: Any, options: SolveOptions, report: Callable[[str], None] | None = None) -> Outcome:
    """A System document to its result document; `report` is told the stages."""
    return guard(lambda: _documents().solve_document(document, options, report))


def look_ahead_task(document: str) -> Outcome:
    """Whether the document of a solve job, which is JSON, can be read to its last formula."""
    return guard(lambda: _documents().parse_document(read_json(document)) and None)


def understand_task(document: Any) -> Outcome:
    """A System document to the `system` part of a result."""
    return guard(lambda: _documents().understand_document(document))


def proof_task(result: dict[str, Any], form: str, seed: int) -> Outcome:
    """The verdict of a result as theorems for another prover."""
    return guard(lambda: _documents().proof_document(result, form, seed))


def check_task(text: str) -> Outcome:
    """The text of a result to the checker's verdict."""
    return guard(lambda: _documents().check_document(text))


def ping_task() -> Outcome:
    """Shows that a worker process answers and has the engine loaded."""
    return guard(load_engine)


def _job(kind: str, document: str, options: str, report: Callable[[Any], None]) -> Answer:
    result = KINDS[kind].work(read_json(document), stored_options(options), report)
    fault = result.get("provenance", {}).get("fault", "") if isinstance(result, dict) else ""
    return Answer(json.dumps(result, ensure_ascii=False, allow_nan=False).encode(), label_of(result), fault)


def _documents() -> ModuleType:
    """The use cases, imported in the worker only."""
    from inverse_service.service.documents import documents

    return documents


def guard(function: Callable[..., Any], *arguments: Any) -> Outcome:
    """Run it and say as data how it ended; nothing but process death gets past."""
    try:
        return Outcome("done", function(*arguments))
    except InputError as error:
        return Outcome("refused", places=faults_of(error))
    except MemoryError:
        return Outcome("memory")
    except OverflowError:
        detail = "A number of this document leaves the range that can be computed with; write smaller numbers."
        return Outcome("refused", places=(Place(detail, code="limit"),))
    except Exception as error:  # the boundary of the process: a fault of ours becomes data for the log
        trace = "".join(traceback.format_exception(error))[-8000:]
        return Outcome("fault", value=f"{type(error).__name__}", detail=trace)
