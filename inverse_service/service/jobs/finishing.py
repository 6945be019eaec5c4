"""What becomes of a job when its task ended: stored, tried again, or given back."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from inverse_service import errors
from inverse_service.service.documents import answers
from inverse_service.service.jobs import model, tasks
from inverse_service.service.jobs.outcome import Outcome, Usage
from inverse_service.service.jobs.store import JobStore

log = logging.getLogger(__name__)
LIMITS = ("deadline", "memory")
# What is undetermined after this part of its time and more may be so for lack of time.
CLOCK_SHARE = 0.5


def is_undetermined(job: model.Job, outcome: Outcome) -> bool:
    """Whether a limit stopped the job and this is its answer."""
    return outcome.status in LIMITS and tasks.KINDS[job.kind].limit_is_answer


def finish(
    store: JobStore,
    job: model.Job,
    outcome: Outcome,
    so_far: Mapping[str, Any] | None = None,
    events: Sequence[model.Event] = (),
) -> str:
    """Store what came of the job, and its last `events`; the label it is counted under ("again": it runs once more).

    A job that was ended has as its result what is finished of it, `so_far`; where that is not known, and a limit
    stopped it, its value is how the system was understood.
    """
    usage, options = outcome.spent, model.stored_options(job.options)
    if outcome.status == "cancelled":
        # Dismissed: it is so in the store already. Otherwise the service stops, and the job runs later.
        left = None if so_far is None else as_body(undetermined(outcome, options, so_far))
        store.add_events((job.id, event) for event in events)
        store.release(job.id, job.attempt, crashed=False, usage=usage, left=left)
        return "cancelled"
    if outcome.status in ("crash", "killed") and job.crashes + 1 < model.MAX_CRASHES:
        log.warning("worker died: %s", outcome.detail, extra={"job": job.id})
        store.release(job.id, job.attempt, crashed=True, usage=usage)
        return "again"
    if outcome.status == "unstarted" and job.attempt < model.MAX_UNSTARTED:
        store.release(job.id, job.attempt, crashed=False, usage=usage)
        return "again"
    if outcome.status == "done":
        label, fault = outcome.value.label, outcome.value.fault
        if fault:
            log.error("no verdict for a fault of the program (%s)", fault, extra={"job": job.id})
        by_clock = label == "undetermined" and usage.cpu > CLOCK_SHARE * options.time_limit
        store.finish(
            job.id, job.attempt, outcome.value.body, usage, model.TRANSIENT if by_clock or fault else None, events
        )
        return str(label)
    if outcome.status in ("crash", "fault", "unstarted"):
        log.error("task ended with %s: %s", outcome.status, outcome.detail, extra={"job": job.id})
    if is_undetermined(job, outcome) or (so_far is not None and outcome.status in ("crash", "killed")):
        result = undetermined(outcome, options, so_far)
        store.finish(job.id, job.attempt, as_body(result), usage, model.TRANSIENT, events)
        return tasks.label_of(result)
    problem = answers.of_outcome(outcome, options.time_limit, options.memory_limit)
    kept = None if outcome.status == "refused" else model.TRANSIENT
    store.fail(job.id, job.attempt, answers.as_bytes(problem), usage, kept, events)
    return outcome.status


def give_up(store: JobStore, job: model.Job) -> None:
    """Fail a job that saw the service die again and again while it ran."""
    detail = f"The service died {job.restarts} times while this job ran; it is not tried again."
    problem = answers.problem_document(500, "fault", detail)
    store.fail(job.id, job.attempt, answers.as_bytes(problem), Usage(), model.TRANSIENT)


def lose(store: JobStore, job: model.Job) -> None:
    """Fail a job whose answer cannot be stored by a fault of ours."""
    problem = answers.problem_document(500, "fault", "The answer was computed and could not be stored.")
    store.fail(job.id, job.attempt, answers.as_bytes(problem), Usage(), model.TRANSIENT)


def undetermined(
    outcome: Outcome, options: model.JobOptions, so_far: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """The result of a solve job that was ended."""
    asked = tasks.solve_options(options), options.memory_limit
    try:
        return answers.result_document(outcome, *asked, so_far)
    except errors.InverseServiceError:
        return answers.result_document(replace(outcome, value=None), *asked)


def as_body(result: dict[str, Any]) -> bytes:
    """A result as the store has it."""
    return json.dumps(result, ensure_ascii=False, separators=(",", ":")).encode()
