"""Jobs, events and batches as data, the states of a job and the ways between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from inverse_service.errors import InverseServiceError

JobStatus = Literal["accepted", "running", "successful", "failed", "dismissed"]
STATUSES: Final[tuple[JobStatus, ...]] = ("accepted", "running", "successful", "failed", "dismissed")
OPEN: Final[frozenset[JobStatus]] = frozenset({"accepted", "running"})
FINAL: Final[frozenset[JobStatus]] = frozenset({"successful", "failed", "dismissed"})
# accepted -> running -> successful or failed; accepted or running -> dismissed. running -> accepted: the worker or the
# service died; final -> accepted: the question is asked again; accepted -> successful or failed: cancelled while it was
# computed again, so its earlier answer holds.
# A job whose worker dies this often by itself is failed. The death of the service is seldom the fault of a
# job, which may only have been next in line; the bound ends the loop of one that takes the service along.
MAX_CRASHES: Final = 3
MAX_RESTARTS: Final = 100
# Runs of a job for which no process could be started; each of them takes a second and more.
MAX_UNSTARTED: Final = 100


# Answers that a clock, lack of memory or a fault of ours ended are given for so long (s) and computed again then.
TRANSIENT: Final = 600.0

INTERACTIVE = 0
BULK = 10
NO_BOUND: Final = 1_000_000


@dataclass(frozen=True, slots=True)
class JobRequest:
    """A question: `document` and `options` are canonical JSON texts; `priority` 0 goes before 10."""

    id: str
    kind: str
    document: str
    options: str = "{}"
    client: str = ""
    priority: int = INTERACTIVE
    fresh: bool = False


@dataclass(frozen=True, slots=True)
class Job:
    """A stored job; times in seconds since 1970.

    `attempt` counts the runs and marks who may write: a result of an earlier attempt is dropped.
    `crashes` counts workers that died by themselves, `restarts` deaths of the whole service, both
    since the question was asked. `body` is the JSON of the result (successful) or of the problem
    document (failed), read only where it is asked for. `revision` counts the answers. `wall`, `cpu`
    (seconds) and `memory` (MiB) are what the run took that gave the answer. `expires`: from this time
    on the question is computed again where it is asked again; None: never.
    """

    id: str
    kind: str
    document: str
    options: str
    status: JobStatus
    client: str = ""
    priority: int = INTERACTIVE
    created: float = 0.0
    started: float | None = None
    finished: float | None = None
    attempt: int = 0
    crashes: int = 0
    restarts: int = 0
    revision: int = 0
    sequence: int = 0
    wall: float = 0.0
    cpu: float = 0.0
    memory: float = 0.0
    expires: float | None = None
    body: bytes | None = None

    @property
    def is_open(self) -> bool:
        """Whether an answer is still to come."""
        return self.status in OPEN

    @property
    def is_final(self) -> bool:
        """Whether it is successful, failed or dismissed."""
        return self.status in FINAL

    def is_to_be_asked(self, fresh: bool, now: float) -> bool:
        """Whether a question for this job is computed: it was cancelled, its answer expired or is to be new."""
        is_old = fresh or (self.expires is not None and self.expires <= now)
        return self.status == "dismissed" or (self.is_final and is_old)


@dataclass(frozen=True, slots=True)
class Event:
    """One event of a job. Numbers grow, also over restarts; `data` is JSON. `kind`: status or progress."""

    number: int
    kind: str
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class BatchLine:
    """One line of a batch: a question, or the problem document (JSON) of a line that is none.

    `identifier` is the JSON of the line's own id.
    """

    number: int
    identifier: str
    request: JobRequest | None = None
    problem: bytes | None = None


@dataclass(frozen=True, slots=True)
class Batch:
    """A stored batch with the number of its lines in each status; a bad line counts as failed."""

    id: str
    kind: str
    client: str
    created: float
    total: int
    counts: Mapping[JobStatus, int]

    @property
    def status(self) -> JobStatus:
        """accepted before anything is done, successful when every line has its answer."""
        unfinished = self.counts.get("accepted", 0) + self.counts.get("running", 0)
        if unfinished == 0:
            return "successful"
        return "accepted" if unfinished == self.counts.get("accepted", 0) == self.total else "running"


@dataclass(frozen=True, slots=True)
class BatchAnswer:
    """The answer to one line; `order` grows in the order in which answers came, `digest` is that of the question.

    `size` is that of the body in the store, which is None here where more was not asked for; `job` has it.
    """

    number: int
    identifier: str
    status: JobStatus
    body: bytes | None
    order: int = 0
    digest: str = ""
    job: str = ""
    size: int = 0


@dataclass(frozen=True, slots=True)
class Bounds:
    """How many open jobs the store takes, in all and of one client; processor seconds a client may use in a day."""

    total: int = NO_BOUND
    client: int = NO_BOUND
    daily: float = NO_BOUND


@dataclass(frozen=True, slots=True)
class ClientUse:
    """What the store has of a client: jobs, the operator's rank, runs and processor seconds of today (UTC)."""

    client: str
    waiting: int
    running: int
    stored: int
    rank: int
    runs: int
    cpu: float


class TooManyJobs(InverseServiceError):
    """The bound on open jobs is reached; nothing was stored."""

    code = "too-many-jobs"
    retry = True


class StoreUnavailable(InverseServiceError):
    """The database does not answer, or not as it should."""

    code = "store-unavailable"
    retry = True


class DatabaseTaken(InverseServiceError):
    """Another process supervises this database."""

    code = "database-taken"


class WrongVersion(Exception):
    """The tables of the database are those of another version of this program."""

    def __init__(self, found: int, known: int) -> None:
        age = "a newer" if found > known else "an older"
        super().__init__(f"{age} version of this program wrote it (its tables are {found}, those known here {known})")
