"""Jobs and batches as the service reports them, the answers of the atlas, and unions of documents by `format`."""

from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, RootModel

from api_schemas import base
from api_schemas.result import ForwardResult, ResultDocument
from api_schemas.simulation import SimulationResult, WorkPrecisionResult
from api_schemas.system import LagrangianDocument, NonholonomicDocument, SystemDocument

JobStatus = Literal["accepted", "running", "successful", "failed", "dismissed"]
Documents = TypeVar("Documents")


class Described(BaseModel):
    """Any keys; built at the first use, as that of the description, which a service need not wait for."""

    model_config = ConfigDict(defer_build=True)


class OneOf(RootModel[Documents]):
    """One of several documents, built at the first use, too: together they take 0.4 s."""

    model_config = ConfigDict(defer_build=True)


class Job(base.Document):
    """One piece of work. `id` is a hash of engine version, canonical document and options.

    `progress` holds what is known while the job runs: stage, order, family; as `so_far` the result as far as
    it is finished and checked. `result` is there when it is successful, and with what was finished when it was
    dismissed; `problem` when it failed. Times are seconds since 1970, and as RFC 3339 writes them; `usage`: seconds of
    wall clock and processor, peak memory in MiB, of the run that gave the answer.
    """

    id: str
    kind: str
    status: JobStatus
    progress: dict[str, Any] | None = None
    result: Any = None
    problem: base.ProblemDocument | None = None
    created: float | None = None
    started: float | None = None
    finished: float | None = None
    accepted_at: str | None = None
    started_at: str | None = None
    ended_at: str | None = None
    usage: dict[str, float] = Field(default_factory=dict)
    links: dict[str, str] = Field(default_factory=dict)


class JobList(base.Document):
    """One page of jobs, newest first; `next` is the cursor of the page after it."""

    jobs: list[Job]
    next: str | None = None


class Batch(base.Document):
    """A batch: how many lines it has, and how many of them are in each status."""

    id: str
    status: JobStatus
    total: int = Field(ge=0)
    counts: dict[JobStatus, int]
    kind: str = "solve"
    created: float | None = None
    accepted_at: str | None = None
    links: dict[str, str] = Field(default_factory=dict)


class BatchList(base.Document):
    """One page of batches, newest first; `next` is the cursor of the page after it."""

    batches: list[Batch]
    next: str | None = None


class BatchProblem(base.ProblemDocument):
    """The answer to a line without a result; `error` holds the problem once more."""

    id: str | int | None = None
    line: int
    digest: str | None = None
    duplicate_of: int | None = None
    error: base.ProblemDocument


class StatusEvent(Described):
    """What the job is now; the last event of a job says how it ended."""

    status: JobStatus


class ProgressEvent(Described):
    """What the job is doing: stage, order, family."""

    elapsed: float = Field(description="seconds of this run")


class PartEvent(base.Document):
    """A part of the result, as soon as it is finished."""

    part: str
    value: dict[str, Any]


class JobEvent(OneOf[StatusEvent | ProgressEvent | PartEvent]):
    """The data of an event, by its name: `status`, `progress` or `part`."""


class JobOptions(base.Document):
    """Bounds of a job, each at most the service's, and the seed of its random choices."""

    time_limit: float = Field(60.0, gt=0)
    memory_limit: int = 4096
    seed: int = Field(1, ge=0)


ByFormat = Field(discriminator="format")
Solved = ResultDocument | ForwardResult


class SolveResult(OneOf[Annotated[Solved, ByFormat]]):
    """What came of a system, by `format`."""


class JobResult(
    OneOf[Annotated[Solved | SimulationResult | WorkPrecisionResult | base.CheckAnswer, ByFormat]]
):
    """What came of a job, by `format`."""


class ResultOfDocument(base.Document):
    """A result with the document that it is to be of."""

    document: SystemDocument | NonholonomicDocument | LagrangianDocument
    result: Annotated[Solved, ByFormat]


class OwnLagrangian(base.Document):
    """A Lagrangian that may yield the equations of a system."""

    system: SystemDocument | NonholonomicDocument
    lagrangian: str


class Certificate(Described):
    """A certificate alone, as older results had it."""

    format: Literal["inverse-service/certificate/2", "inverse-service/certificate/1"]
    system: dict[str, Any]


class Identities(Described):
    """The output of `solve --format identities`."""

    theorems: list[Any] = Field(description="The output of `solve --format identities`.")


class CheckedDocument(
    OneOf[ResultDocument | ResultOfDocument | OwnLagrangian | Certificate | Identities]
):
    """What the checker reads; of anything else it says itself what is missing."""


def told(words: str) -> Any:
    """A field with its description."""
    return Field(description=words)


class AtlasLine(Described):
    """A system of the atlas in a list."""

    name: str = told("the name in addresses")
    title: str = told("its title")
    source: str = told("its source as a citation; empty if the system is from this project")
    tags: list[str] = told("keywords for searches")
    equations: list[str] = told("the equations, or L and the constraints, as parsed")
    verdict: str = told("yes, no, open or differs, for both questions together")
    badge: str = told("the verdict in words")


class AtlasList(Described):
    """The results of a search: at most a hundred systems, and the total number."""

    count: int = told("how many systems were found")
    systems: list[AtlasLine] = told("the first hundred of them")
    license: str = told("the license of the atlas")
    cite: str = told("how to cite the atlas")


class AtlasEntry(AtlasLine):
    """One system with its document and its result.

    The result has the system and the `answers`, without proofs: solving the document makes these again.
    """

    document: dict[str, Any] = told("the document that was solved")
    form: str = told("a key that systems of the same form share")
    at_rest: str = told("the same key for velocities 0; empty if all accelerations are 0 there")
    seconds: float = told("the processor time of solving it")
    result: dict[str, Any] = told("`system`, `question`, verdicts, and `answers` as in a result")
