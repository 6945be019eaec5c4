"""Jobs, events and batches as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from inverse_service.errors import InverseServiceError
from inverse_service.service.jobs.states import FINAL, OPEN, JobStatus

INTERACTIVE = 0
BULK = 10


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
        """Whether a question for this job is computed: it was cancelled, its answer expired or shall be a new one."""
        is_old = fresh or (self.expires is not None and self.expires <= now)
        return self.status == "dismissed" or (self.is_final and is_old)


@dataclass(frozen=True, slots=True)
class Usage:
    """What a run took: seconds of wall clock and processor, peak memory in MiB."""

    wall: float = 0.0
    cpu: float = 0.0
    memory: float = 0.0


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
    """How many open jobs the store takes: in all, and of one client."""

    total: int = 1_000_000
    client: int = 1_000_000


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
    """The database was written by a newer version of this program."""

    def __init__(self, found: int, known: int) -> None:
        super().__init__(f"a newer version of this program wrote it (its tables are {found}, those known here {known})")
