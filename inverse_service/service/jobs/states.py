"""The states of a job and the ways between them."""

from __future__ import annotations

from typing import Final, Literal

JobStatus = Literal["accepted", "running", "successful", "failed", "dismissed"]
STATUSES: Final[tuple[JobStatus, ...]] = ("accepted", "running", "successful", "failed", "dismissed")
OPEN: Final[frozenset[JobStatus]] = frozenset({"accepted", "running"})
FINAL: Final[frozenset[JobStatus]] = frozenset({"successful", "failed", "dismissed"})
# running -> accepted: the worker or the service died; final -> accepted: the question is asked again;
# accepted -> successful or failed: cancelled while it was computed again, so its earlier answer holds.
NEXT: Final[dict[JobStatus, frozenset[JobStatus]]] = {
    "accepted": frozenset({"running", "dismissed", "successful", "failed"}),
    "running": frozenset({"successful", "failed", "dismissed", "accepted"}),
    "successful": frozenset({"accepted"}),
    "failed": frozenset({"accepted"}),
    "dismissed": frozenset({"accepted"}),
}
# A job whose worker dies this often by itself is failed. The death of the service is seldom the fault of a
# job, which may only have been next in line; the bound ends the loop of one that takes the service along.
MAX_CRASHES: Final = 3
MAX_RESTARTS: Final = 100
# Runs of a job for which no process could be started; each of them takes a second and more.
MAX_UNSTARTED: Final = 100


def may_become(now: JobStatus, then: JobStatus) -> bool:
    """Whether a job may go from one status to the other."""
    return then in NEXT[now]


# Answers that a clock, lack of memory or a fault of ours ended are given for so long (s) and computed again then.
TRANSIENT: Final = 600.0
