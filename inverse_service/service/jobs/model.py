"""What a job is: the question with its options and its identity, whose it is, the states and the
ways between them.

A job's id is a hash of engine, canonical document and options. The same question has the same id,
so it is answered from the store, and its link is permanent. Every call, page, picture and stream
asks `Viewer.seen` whose a job or a batch is, and nothing else. Options are what a caller may ask
for in addition to the document: bounds within the server's, and the seed.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from decimal import Decimal
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, TypeVar

from inverse_service import __version__, errors
from inverse_service.service.documents import plain_data

JobStatus = Literal["accepted", "running", "successful", "failed", "dismissed"]
STATUSES: Final[tuple[JobStatus, ...]] = (
    "accepted",
    "running",
    "successful",
    "failed",
    "dismissed",
)
OPEN: Final[frozenset[JobStatus]] = frozenset({"accepted", "running"})
FINAL: Final[frozenset[JobStatus]] = frozenset({"successful", "failed", "dismissed"})
# accepted -> running -> successful or failed; accepted or running -> dismissed. running ->
# accepted: the worker or the service died; final -> accepted: the question is asked again; accepted
# -> successful or failed: cancelled while it was computed again, so its earlier answer holds. A job
# whose worker dies this often by itself is failed. The death of the service is seldom the fault of
# a job, which may only have been next in line; the bound ends the loop of one that takes the
# service along.
MAX_CRASHES: Final = 3
MAX_RESTARTS: Final = 100
# Runs of a job for which no process could be started; each of them takes a second and more.
MAX_UNSTARTED: Final = 100
# Answers that a clock, lack of memory or a fault of ours ended are given for so long (s) and
# computed again then.
TRANSIENT: Final = 600.0

INTERACTIVE = 0
BULK = 10
NO_BOUND: Final = 1_000_000
LARGEST_BODY: Final = 2**31 - 1
DIGITS = 40
# A new page or command does not make an answer another one.
NOT_THE_ENGINE = ("web/", "cli/", "client.py", "service/jobs/", "service/compiling.py")
SMALLEST_MEMORY = 512
LARGEST_SEED = 2**31 - 1
KEYS = "time_limit, memory_limit, seed"


@dataclass(frozen=True, slots=True)
class JobRequest:
    """A question: `document` and `options` are canonical JSON texts; `priority` 0 goes before
    10.
    """

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
    (seconds) and `memory` (MiB) are what the run took that gave the answer. `expires`: from this
              time
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

    def is_to_be_asked(self, fresh: bool, now: float) -> bool:
        """Whether a question for this job is computed: it was cancelled, its answer expired or is
        to be new.
        """
        is_old = fresh or (self.expires is not None and self.expires <= now)
        return self.status == "dismissed" or (is_old and not self.is_open)


@dataclass(frozen=True, slots=True)
class Event:
    """One event of a job. Numbers grow, also over restarts; `data` is JSON. `kind`: status or
    progress.
    """

    number: int
    kind: str
    data: Mapping[str, Any] = field(default_factory=dict)


class Change(NamedTuple):
    """The id of a job ("": of several) and what it is now: a status, "event" for a new one, or
    "sent" for a batch that is to be read.

    `job` is the one that ended here, with its answer.
    """

    id: str
    what: str
    job: Job | None = None


@dataclass(frozen=True, slots=True)
class Bounds:
    """How many open jobs the store takes, in all and of one client; processor seconds a client may
    use in a day.
    """

    total: int = NO_BOUND
    client: int = NO_BOUND
    daily: float = NO_BOUND

    def room(self, open_jobs: Mapping[str, int], clients: Iterable[str]) -> int:
        """How many more jobs may be open, of each of these clients and in all; open ones by client."""
        most = max((open_jobs.get(client, 0) for client in clients), default=0)
        return min(self.total - sum(open_jobs.values()), self.client - most)


@dataclass(frozen=True, slots=True)
class ClientUse:
    """What the store has of a client: jobs, the operator's rank, runs and processor seconds of
    today (UTC).
    """

    client: str
    waiting: int
    running: int
    stored: int
    rank: int
    runs: int
    cpu: float


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
        return (
            "accepted" if unfinished == self.counts.get("accepted", 0) == self.total else "running"
        )


@dataclass(frozen=True, slots=True)
class SentBatch:
    """A batch as it came, NDJSON: its lines are read later, on these terms (`kind`, `time_limit`,
    `fresh`, `sees_all`), which are JSON.
    """

    id: str
    client: str
    terms: Mapping[str, Any]
    body: bytes


@dataclass(frozen=True, slots=True)
class BatchAnswer:
    """The answer to one line; `order` grows in the order in which answers came.

    `size` is that of the body in the store, which is None here where more was not asked for; `job`
    has it.
    """

    number: int
    identifier: str
    status: JobStatus
    body: bytes | None
    order: int = 0
    job: str = ""
    size: int = 0


Owned = TypeVar("Owned", Job, Batch)


@dataclass(frozen=True, slots=True)
class Viewer:
    """Who asks: the client of a key, or an address. `sees_all` where nobody has a key."""

    name: str = ""
    sees_all: bool = True

    def seen(self, found: Owned | None) -> Owned | None:
        """What was found, where it is this client's; None, as for what is not there, where it is
        another's.
        """
        return found if found is not None and (self.sees_all or found.client == self.name) else None

    @property
    def listed(self) -> str | None:
        """Of which client jobs are listed; None: of all."""
        return None if self.sees_all else self.name

    def own(self, request: JobRequest) -> JobRequest:
        """The request as the store takes it.

        With keys each client has jobs of its own, also for the same question: otherwise the time of
        an answer would tell what another one asked, and one could cancel or renew what is
        another's.
        """
        if self.sees_all:
            return request
        id = hashlib.sha256(f"{self.name}\x00{request.id}".encode()).hexdigest()[: len(request.id)]
        return replace(request, id=id)


def canonical(value: Any) -> str:
    """JSON with sorted keys and without spaces."""
    return plain_data.write_json(value, "sorted")


def job_id(kind: str, document: Any, options: str) -> str:
    """The id: 40 hexadecimal digits. `options` are canonical JSON already."""
    parts = (engine_version(), kind, canonical(document), canonical(_order(document)), options)
    return hashlib.sha256("\x00".join(parts).encode()).hexdigest()[:DIGITS]


def document_digest(document: Any) -> str:
    """A hash of what is asked, whoever answers it: 64 hexadecimal digits."""
    return hashlib.sha256(
        f"{canonical(document)}\x00{canonical(_order(document))}".encode()
    ).hexdigest()


@functools.cache
def engine_version() -> str:
    """The version and a digest of the program's text, so that a changed engine answers again."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root).as_posix()
        if not name.startswith(NOT_THE_ENGINE):
            digest.update(name.encode() + b"\x00" + path.read_bytes())
    return f"{__version__}+{digest.hexdigest()[:12]}"


def _order(document: Any) -> list[str]:
    """Keys whose order means something: equations by coordinate where no coordinates are given."""
    if not isinstance(document, Mapping) or document.get("coordinates") is not None:
        return []
    equations = document.get("equations")
    return list(equations) if isinstance(equations, Mapping) else []


@dataclass(frozen=True, slots=True)
class JobOptions:
    """`time_limit` in seconds, `memory_limit` in MiB; both at most the server's."""

    time_limit: float = 60.0
    memory_limit: int = 4096
    seed: int = 1

    @functools.lru_cache(maxsize=64)  # noqa: B019 - options are small, and their number is bounded here
    def canonical(self) -> str:
        """JSON with sorted keys: part of the identity of a job."""
        return canonical(asdict(self) | {"time_limit": float(self.time_limit)})


@functools.lru_cache(maxsize=64)
def stored_options(text: str) -> JobOptions:
    """The options of a stored job."""
    return JobOptions(**json.loads(text))


class SplitDocument(NamedTuple):
    """A document without its options, and these."""

    document: Any
    options: Any


def split_options(document: Any) -> SplitDocument:
    """The document without its key `options`, and what that key holds (None where it is not
    there).
    """
    if not isinstance(document, Mapping) or "options" not in document:
        return SplitDocument(document, None)
    return SplitDocument(
        {key: value for key, value in document.items() if key != "options"}, document["options"]
    )


def read_options(given: Any, server: JobOptions) -> JobOptions:
    """The options asked for, the server's where nothing is said. Raises InputError with the
    pointer.
    """
    if given is None:
        return server
    if not isinstance(given, Mapping):
        raise errors.InputError(
            f"'options' must be an object with some of the keys {KEYS}.", "/options"
        )
    unknown = set(given) - {"time_limit", "memory_limit", "seed"}
    if unknown:
        raise errors.InputError(
            f"'options' has a key that is not known here; the keys are {KEYS}.", "/options"
        )
    return JobOptions(
        time_limit=read_time_limit(given.get("time_limit"), server.time_limit),
        memory_limit=_whole(
            given, "memory_limit", server.memory_limit, SMALLEST_MEMORY, server.memory_limit
        ),
        seed=_whole(given, "seed", server.seed, 0, LARGEST_SEED),
    )


def read_time_limit(value: Any, largest: float, pointer: str = "/options/time_limit") -> float:
    """A number of seconds, `largest` where nothing is given."""
    if value is None:
        return largest
    is_number = isinstance(value, int | float | Decimal) and not isinstance(value, bool)
    seconds = float(value) if is_number else math.nan
    if not 0 < seconds <= largest:
        raise errors.LimitError(
            f"the time limit must be a number of seconds above 0 and at most {largest:g}.", pointer
        )
    return seconds


def _whole(given: Mapping[str, Any], key: str, default: int, low: int, high: int) -> int:
    value = given.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise errors.LimitError(
            f"{key} must be an integer from {low} to {high}.", f"/options/{key}"
        )
    return value


class TooManyJobs(errors.InverseServiceError):
    """A bound on open jobs or on the processor time of a day is reached; nothing was stored.

    `seconds` is the time after which it is worth to ask again; `quota` is the bound on the
    processor time of a day, where that is the one.
    """

    code = "too-many-jobs"
    retry = True

    def __init__(self, detail: str, seconds: int = 5, quota: float = 0.0) -> None:
        super().__init__(detail)
        self.seconds, self.quota = seconds, quota
        if quota:
            self.code = "quota-exceeded"


def until_tomorrow() -> int:
    """Seconds to the end of the day (UTC)."""
    return 86_400 - int(time.time()) % 86_400


class StoreUnavailable(errors.InverseServiceError):
    """The database does not answer, or not as it should."""

    code = "store-unavailable"
    retry = True


class DatabaseTaken(errors.InverseServiceError):
    """Another process supervises this database."""

    code = "database-taken"


class WrongVersion(Exception):
    """The tables of the database are those of another version of this program."""

    def __init__(self, found: int, known: int) -> None:
        age = "a newer" if found > known else "an older"
        super().__init__(
            f"{age} version of this program wrote it (its tables are {found}, those known here {known})"
        )
