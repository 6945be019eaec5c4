"""Progress of running jobs: the latest for whoever asks, all of it for the store, a few times a second."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Mapping
from typing import Any

from inverse_service.service.jobs.model import BULK, Event, Job
from inverse_service.service.jobs.store import JobStore

ORDER = re.compile(r"^prolongation to order (\d+)$")
FAMILY = re.compile(r"^(ansatz|method): (.+)$")
DECISION = {"decision": "L(q, q')", "decision with time": "L(t, q, q')"}


def described(report: Any, before: Mapping[str, Any]) -> dict[str, Any]:
    """The progress after a report; counts of prolongations and families go on from `before`."""
    if isinstance(report, Mapping):
        return {**before, **{str(key): value for key, value in report.items()}}
    text = str(report)
    kept = {key: before[key] for key in ("question", "counts", "so_far") if key in before}
    if order := ORDER.match(text):
        return {**kept, "stage": "prolongation", "order": int(order[1]), "counts": _counted(before, "prolongations")}
    if family := FAMILY.match(text):
        return {**kept, "stage": family[1], "family": family[2], "counts": _counted(before, "families")}
    if text in DECISION:
        return {**kept, "stage": "decision", "question": DECISION[text]}
    return {**kept, "stage": text}


def _counted(before: Mapping[str, Any], name: str) -> dict[str, int]:
    counts = dict(before.get("counts", {}))
    counts[name] = counts.get(name, 0) + 1
    return counts


# Numbers of a later attempt are greater than those of any earlier one.
NUMBERS_PER_ATTEMPT = 10_000
MOST_EVENTS = 1_000


def last_event(job: Job) -> Event:
    """The event that ends the stream of a final job; the greatest number of its attempt."""
    return Event((job.attempt + 1) * NUMBERS_PER_ATTEMPT - 1, "status", {"status": job.status})


class EventLog:
    """Collects events of jobs and writes them together; safe to use from any thread."""

    def __init__(self, store: JobStore) -> None:
        self._store = store
        self._lock = threading.Lock()
        self._latest: dict[str, dict[str, Any]] = {}
        self._numbers: dict[str, int] = {}
        self._pending: list[tuple[str, Event]] = []

    def begin(self, job: Job) -> None:
        """The first event of an attempt."""
        with self._lock:
            self._latest[job.id] = {"elapsed": 0.0}
            self._numbers[job.id] = job.attempt * NUMBERS_PER_ATTEMPT
            self._append(job, "status", {"status": "running"})

    def report(self, job: Job, began: float, value: Any) -> None:
        """Something that the worker says about a job."""
        with self._lock:
            if job.id not in self._latest:
                return
            progress = described(value, self._latest[job.id])
            progress["elapsed"] = round(time.monotonic() - began, 3)
            self._latest[job.id] = progress
            # An answer so far is written once: with the report that brings it.
            shown = progress if isinstance(value, Mapping) else {k: v for k, v in progress.items() if k != "so_far"}
            self._append(job, "progress", shown)

    def end(self, job: Job) -> None:
        """Nothing more comes from this attempt; the store knows how it ended."""
        with self._lock:
            self._latest.pop(job.id, None)
            self._numbers.pop(job.id, None)

    def latest(self, id: str) -> Mapping[str, Any] | None:
        """Progress of a job that runs here."""
        with self._lock:
            found = self._latest.get(id)
            return None if found is None else dict(found)

    def flush(self) -> None:
        """Write what was collected."""
        with self._lock:
            pending, self._pending = self._pending, []
        if pending:
            self._store.add_events(pending)

    def _append(self, job: Job, kind: str, data: Mapping[str, Any]) -> None:
        # Nobody watches a single line of a batch.
        if job.priority >= BULK:
            return
        number = self._numbers[job.id] = self._numbers[job.id] + 1
        if number % NUMBERS_PER_ATTEMPT < MOST_EVENTS:
            self._pending.append((job.id, Event(number, kind, dict(data))))
