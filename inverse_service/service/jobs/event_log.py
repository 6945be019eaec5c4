"""Progress of running jobs: the latest for whoever asks, all of it for the store, a few times a second."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Mapping
from typing import Any

from inverse_service.service.documents import growing
from inverse_service.service.jobs import model
from inverse_service.service.jobs.store import JobStore

PART = "part"
ORDER = re.compile(r"^prolongation to order (\d+)$")
FAMILY = re.compile(r"^(ansatz|method): (.+)$")
DECISION = {"decision": "L(q, q')", "decision with time": "L(t, q, q')"}


def described(report: Any, before: Mapping[str, Any]) -> dict[str, Any]:
    """The progress after a report; counts of prolongations and families go on from `before`.

    Parts of a result (see `growing`) are merged into `so_far`.
    """
    if isinstance(report, Mapping) and "parts" in report:
        so_far = growing.merged((before.get("so_far", {}), report["value"]))
        return {**before, "so_far": so_far, "seconds": report["seconds"]}
    if isinstance(report, Mapping):
        return {**before, **{str(key): value for key, value in report.items()}}
    text = str(report)
    kept = {key: before[key] for key in KEPT if key in before}
    if order := ORDER.match(text):
        return {**kept, "stage": "prolongation", "order": int(order[1]), "counts": _counted(before, "prolongations")}
    if family := FAMILY.match(text):
        return {**kept, "stage": family[1], "family": family[2], "counts": _counted(before, "families")}
    if text in DECISION:
        return {**kept, "stage": "decision", "question": DECISION[text]}
    return {**kept, "stage": text}


KEPT = ("question", "counts", "so_far", "seconds")


def _counted(before: Mapping[str, Any], name: str) -> dict[str, int]:
    counts = dict(before.get("counts", {}))
    counts[name] = counts.get(name, 0) + 1
    return counts


# Numbers of a later attempt are greater than those of any earlier one.
NUMBERS_PER_ATTEMPT = 10_000
MOST_EVENTS = 1_000


def last_event(job: model.Job) -> model.Event:
    """The event that ends the stream of a final job; the greatest number of its attempt."""
    return model.Event((job.attempt + 1) * NUMBERS_PER_ATTEMPT - 1, "status", {"status": job.status})


class EventLog:
    """Collects events of jobs and writes them together; safe to use from any thread."""

    def __init__(self, store: JobStore) -> None:
        self._store = store
        self._lock = threading.Lock()
        self._latest: dict[str, dict[str, Any]] = {}
        self._earlier: dict[str, dict[str, Any]] = {}
        self._numbers: dict[str, int] = {}
        self._pending: list[tuple[str, model.Event]] = []

    def begin(self, job: model.Job) -> None:
        """The first event of an attempt; what an earlier one finished before it died is kept until this one has it."""
        earlier = self._of_earlier(job)
        with self._lock:
            self._latest[job.id] = {"elapsed": 0.0}
            self._earlier[job.id] = earlier
            self._numbers[job.id] = job.attempt * NUMBERS_PER_ATTEMPT
            self._append(job, "status", {"status": "running"})

    def _of_earlier(self, job: model.Job) -> dict[str, Any]:
        with self._lock:
            furthest = self._furthest(job.id)
        if furthest is not None:
            return furthest
        if job.restarts == 0 or job.priority >= model.BULK:
            return {}
        so_far = growing.merged(e.data["value"] for e in self._store.events(job.id) if e.kind == PART)
        return {"so_far": so_far, "seconds": {}} if so_far else {}

    def report(self, job: model.Job, began: float, value: Any) -> None:
        """Something that the worker says about a job."""
        with self._lock:
            if job.id not in self._latest:
                return
            is_part = isinstance(value, Mapping) and "parts" in value
            if is_part and "format" in value["value"]:  # another run of the same attempt begins from nothing
                self._earlier[job.id] = self._furthest(job.id) or {}
                self._latest[job.id].pop("so_far", None)
            progress = described(value, self._latest[job.id])
            progress["elapsed"] = round(time.monotonic() - began, 3)
            self._latest[job.id] = progress
            if is_part:
                for event in growing.events(value):
                    self._append(job, PART, event)
            else:
                self._append(job, "progress", {k: v for k, v in progress.items() if k not in ("so_far", "seconds")})

    def end(self, job: model.Job, again: bool = False) -> None:
        """Nothing more comes from this attempt; the store knows how it ended. `again`: another attempt comes."""
        with self._lock:
            is_latest = self._numbers.get(job.id, 0) // NUMBERS_PER_ATTEMPT == job.attempt
            for kept in (self._latest, self._earlier, self._numbers):
                if is_latest and not again:
                    kept.pop(job.id, None)

    def latest(self, id: str) -> Mapping[str, Any] | None:
        """Progress of a job that runs here."""
        with self._lock:
            found = self._latest.get(id)
            return None if found is None else {**found, **(self._furthest(id) or {})}

    def so_far(self, id: str) -> Mapping[str, Any] | None:
        """What is finished of the result of a job that runs here, as `so_far` and `seconds`: of this attempt or, where
        that came less far, of the one before."""
        with self._lock:
            return self._furthest(id)

    def _furthest(self, id: str) -> dict[str, Any] | None:
        tries = [self._latest.get(id, {}), self._earlier.get(id, {})]
        found = [{key: each[key] for key in ("so_far", "seconds")} for each in tries if each.get("so_far")]
        return min(found, key=lambda each: len(each["so_far"]["incomplete"]), default=None)

    def flush(self) -> None:
        """Write what was collected."""
        with self._lock:
            pending, self._pending = self._pending, []
        if pending:
            self._store.add_events(pending)

    def pending(self, id: str) -> list[model.Event]:
        """The events of a job that are not written yet; its end is written with them, and then it is `written`."""
        with self._lock:
            return [event for job, event in self._pending if job == id]

    def written(self, id: str, events: list[model.Event]) -> None:
        """These are in the store."""
        with self._lock:
            self._pending = [(job, event) for job, event in self._pending if job != id or event not in events]

    def _append(self, job: model.Job, kind: str, data: Mapping[str, Any]) -> None:
        # Nobody watches a single line of a batch.
        if job.priority >= model.BULK:
            return
        number = self._numbers[job.id] = self._numbers[job.id] + 1
        if number % NUMBERS_PER_ATTEMPT < MOST_EVENTS or kind == PART:
            self._pending.append((job.id, model.Event(number, kind, dict(data))))
