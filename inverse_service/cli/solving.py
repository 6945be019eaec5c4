"""`inverse-service solve`."""

from __future__ import annotations

import json
import sys
from typing import Any

from inverse_service.cli.exits import ExitCode
from inverse_service.cli.files import read_bytes
from inverse_service.errors import InputError
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.reading import read_document
from inverse_service.service.jobs import tasks
from inverse_service.service.jobs.alone import run_alone
from inverse_service.service.jobs.options import JobOptions, read_options, split_options
from inverse_service.settings import read_settings

MAX_TIME_LIMIT = 86_400.0
STAGE_WIDTH = 78


def solve_file(
    name: str, form: str, time_limit: float | None, seed: int, explain: bool, special_cases: bool = False
) -> ExitCode:
    """Solve the document in a process of its own and print the result."""
    settings = read_settings()
    limit = time_limit_or(settings.time_limit, time_limit)
    document, given = split_options(read_document(read_bytes(name), name))
    asked = read_options(given, JobOptions(limit, settings.memory_limit, seed))
    if special_cases and isinstance(document, dict):
        document = {**document, "special_cases": True}
    result = _solve(document, SolveOptions(seed=asked.seed, time_limit=asked.time_limit), asked.memory_limit)
    sys.stdout.write(_written(result, form, explain))
    sys.stdout.flush()
    return ExitCode.OPEN if result["verdict"] == "undetermined" else ExitCode.DONE


def time_limit_or(default: float, given: float | None) -> float:
    """The time limit that was given, or the default; raises InputError where it is no such time."""
    limit = default if given is None else given
    if not 0 < limit <= MAX_TIME_LIMIT:
        raise InputError(f"--time-limit must be a number of seconds above 0 and at most {MAX_TIME_LIMIT:.0f}.")
    return limit


def _solve(document: Any, options: SolveOptions, memory_limit: int) -> dict[str, Any]:
    report = show_stage if sys.stderr.isatty() else None
    outcome = run_alone(tasks.solve_task, (document, options), options.time_limit, memory_limit, report)
    if report is not None:
        report("")
    from inverse_service.service.documents.answers import UNDERSTAND_DEADLINE, result_document, with_understood

    if outcome.status in ("deadline", "memory"):
        understood = run_alone(tasks.understand_task, (document,), UNDERSTAND_DEADLINE, memory_limit)
        outcome = with_understood(outcome, understood)
    return result_document(outcome, options, memory_limit)


def show_stage(text: str) -> None:
    """The stage on the last line of the terminal, in the place of the one before."""
    sys.stderr.write(f"\r\x1b[K{text[:STAGE_WIDTH]}")
    sys.stderr.flush()


def _written(result: dict[str, Any], form: str, explain: bool) -> str:
    if form == "json":
        return json.dumps(result, ensure_ascii=False, indent=2) + "\n"
    if form == "latex":
        from inverse_service.cli.latex_page import latex_page

        return latex_page(result, explain)
    from inverse_service.cli.text_page import text_page

    return text_page(result, explain)
