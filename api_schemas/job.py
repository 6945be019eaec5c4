"""Jobs and batches as the service reports them; the client's typed answers."""

from typing import Any, Final, Literal

from pydantic import BaseModel, Field, RootModel

from api_schemas.base import Document, ProblemDocument

JobStatus = Literal["accepted", "running", "successful", "failed", "dismissed"]
FINAL: Final[frozenset[str]] = frozenset({"successful", "failed", "dismissed"})


class Job(Document):
    """One piece of work. `id` is a hash of engine version, canonical document and options.

    `progress` holds what is known while the job runs: stage, order, family, counts; as `so_far` the result as far as
    it is finished and checked. `result` is there when it is successful, and with what was finished when it was
    dismissed; `problem` when it failed. Times are seconds since 1970, and as RFC 3339 writes them; `usage`: seconds of
    wall clock and processor, peak memory in MiB, of the run that gave the answer.
    """

    id: str
    kind: str
    status: JobStatus
    progress: dict[str, Any] | None = None
    result: Any = None
    problem: ProblemDocument | None = None
    created: float | None = None
    started: float | None = None
    finished: float | None = None
    accepted_at: str | None = None
    started_at: str | None = None
    ended_at: str | None = None
    usage: dict[str, float] = Field(default_factory=dict)
    links: dict[str, str] = Field(default_factory=dict)

    @property
    def is_final(self) -> bool:
        """Whether nothing about the job will change any more."""
        return self.status in FINAL


class JobList(Document):
    """One page of jobs, newest first; `next` is the cursor of the page after it."""

    jobs: list[Job]
    next: str | None = None


class Batch(Document):
    """A batch: how many lines it has, and how many of them are in each status."""

    id: str
    status: JobStatus
    total: int = Field(ge=0)
    counts: dict[JobStatus, int]
    kind: str = "solve"
    created: float | None = None
    accepted_at: str | None = None
    links: dict[str, str] = Field(default_factory=dict)

    @property
    def is_final(self) -> bool:
        """Whether every line has its answer."""
        return self.status in FINAL


class StatusEvent(BaseModel):
    """What the job is now; the last event of a job says how it ended."""

    status: JobStatus


class ProgressEvent(BaseModel):
    """What the job is doing: stage, order, family, counts."""

    elapsed: float = Field(description="seconds of this run")


class PartEvent(Document):
    """A part of the result, as soon as it is finished."""

    part: str
    value: dict[str, Any]


class JobEvent(RootModel[StatusEvent | ProgressEvent | PartEvent]):
    """The data of an event, by its name: `status`, `progress` or `part`."""


class JobOptions(Document):
    """Bounds of a job, each at most the service's, and the seed of its random choices."""

    time_limit: float = Field(60.0, gt=0)
    memory_limit: int = 4096
    seed: int = Field(1, ge=0)
