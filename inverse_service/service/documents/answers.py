"""From the outcome of a task to what the caller gets: a document, or an error of the tree."""

from __future__ import annotations

import dataclasses
import logging
from typing import Any

from api_schemas.result import ResultDocument, UnderstoodSystem
from inverse_service import __version__
from inverse_service.errors import NoWorker, WorkerFailed
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.refusals import DocumentRefused
from inverse_service.service.jobs.outcome import Outcome

log = logging.getLogger(__name__)
UNDERSTAND_DEADLINE = 2.0


def with_understood(outcome: Outcome, understood: Outcome) -> Outcome:
    """The outcome of a run that a limit ended, with how the system was understood as its value."""
    return dataclasses.replace(outcome, value=understood.value if understood.status == "done" else None)


def result_document(outcome: Outcome, options: SolveOptions, memory_limit: int) -> dict[str, Any]:
    """The result document of a solve task.

    A limit gives an undetermined result that names it. Raises DocumentRefused with the places of
    the faults, WorkerFailed where the program is at fault (its details go to the log only).
    """
    if outcome.status == "deadline":
        reason = f"The time limit of {options.time_limit:g} s was reached before a verdict was proven."
        return undetermined(outcome.value, reason, options)
    if outcome.status == "memory":
        reason = f"The memory limit of {memory_limit} MiB was reached before a verdict was proven."
        return undetermined(outcome.value, reason, options)
    found: dict[str, Any] = value_of(outcome)
    return found


def value_of(outcome: Outcome) -> Any:
    """The value of a task that is done; raises DocumentRefused or WorkerFailed for the others."""
    if outcome.status == "done":
        return outcome.value
    if outcome.status == "refused":
        raise DocumentRefused(outcome.places)
    log.error("task ended with %s: %s", outcome.status, outcome.detail)
    if outcome.status == "deadline":
        raise WorkerFailed("The work was stopped at its time limit.")
    if outcome.status == "memory":
        raise WorkerFailed("The work was stopped at its memory limit.")
    if outcome.status == "unstarted":
        raise NoWorker("No worker process can be started; try again in some seconds.")
    kind = f" ({outcome.value})" if outcome.value else ""
    raise WorkerFailed(f"The program failed on this document{kind}; that is a fault of the program.")


def undetermined(understood: Any, reason: str, options: SolveOptions) -> dict[str, Any]:
    """The result document of a run that a limit ended."""
    result = ResultDocument(
        system=None if understood is None else UnderstoodSystem.model_validate(understood),
        verdict="undetermined",
        verdict_with_time="undetermined",
        reason=reason,
        provenance={
            "program": "inverse-service",
            "version": __version__,
            "options": {"time_limit": options.time_limit, "seed": options.seed},
        },
    )
    return result.model_dump(mode="json")
