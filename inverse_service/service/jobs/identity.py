"""Ids, owners and options: a job's id is a hash of engine, canonical document and options; a batch's, of its jobs.

The same question has the same id, so it is answered from the store, and its link is permanent. Every call, page,
picture and stream asks `Viewer.seen` whose a job or a batch is, and nothing else. Options are what a caller may ask
for in addition to the document: bounds within the server's, and the seed.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from inverse_service import __version__
from inverse_service.errors import InputError, LimitError

if TYPE_CHECKING:
    from inverse_service.service.jobs.model import Batch, BatchLine, Job, JobRequest

DIGITS = 40
# A new page or command does not make an answer another one.
NOT_THE_ENGINE = frozenset({"web", "cli", "client", "benchmark", "service/jobs"})


def canonical(value: Any) -> str:
    """JSON with sorted keys and without spaces."""
    return write_json(value, sort=True)


def write_json(value: Any, sort: bool = False) -> str:
    """Plain data as JSON in ASCII; a Decimal is written as the number it was read from."""
    if isinstance(value, Mapping):
        keys = sorted(value) if sort else list(value)
        return "{" + ",".join(f"{json.dumps(key)}:{write_json(value[key], sort)}" for key in keys) + "}"
    if isinstance(value, list | tuple):
        return "[" + ",".join(write_json(part, sort) for part in value) + "]"
    return str(value) if isinstance(value, Decimal) else json.dumps(value, allow_nan=False)


def job_id(kind: str, document: Any, options: str) -> str:
    """The id: 40 hexadecimal digits. `options` are canonical JSON already."""
    parts = (engine_version(), kind, canonical(document), canonical(_order(document)), options)
    return hashlib.sha256("\x00".join(parts).encode()).hexdigest()[:DIGITS]


def document_digest(document: Any) -> str:
    """A hash of what is asked, whoever answers it: 64 hexadecimal digits."""
    return hashlib.sha256(f"{canonical(document)}\x00{canonical(_order(document))}".encode()).hexdigest()


def batch_id(kind: str, client: str, lines: Sequence[BatchLine], key: str, generation: int) -> str:
    """The id of a client's batch, so that one that is sent again after a lost answer is not stored twice.

    `key` tells batches of the same lines apart; `generation` counts those with cancelled lines before it.
    """
    digest = hashlib.sha256("\x00".join(("batch", kind, client, key, str(generation))).encode())
    for line in lines:
        question = line.problem or b"" if line.request is None else line.request.id.encode()
        digest.update(f"\n{line.number}\x00{line.identifier}\x00".encode() + question)
    return digest.hexdigest()[:DIGITS]


@functools.cache
def engine_version() -> str:
    """The version and a digest of the program's text, so that a changed engine answers again."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root).as_posix()
        if not any(name.startswith(part + "/") for part in NOT_THE_ENGINE):
            digest.update(name.encode() + b"\x00" + path.read_bytes())
    return f"{__version__}+{digest.hexdigest()[:12]}"


def _order(document: Any) -> list[str]:
    """Keys whose order means something: equations by coordinate where no coordinates are given."""
    if not isinstance(document, Mapping) or document.get("coordinates") is not None:
        return []
    equations = document.get("equations")
    return list(equations) if isinstance(equations, Mapping) else []


Owned = TypeVar("Owned", "Job", "Batch")


@dataclass(frozen=True, slots=True)
class Viewer:
    """Who asks: the client of a key, or an address. `sees_all` where nobody has a key."""

    name: str = ""
    sees_all: bool = True

    def seen(self, found: Owned | None) -> Owned | None:
        """What was found, where it is this client's; None, as for what is not there, where it is another's."""
        return found if found is not None and (self.sees_all or found.client == self.name) else None

    @property
    def listed(self) -> str | None:
        """Of which client jobs are listed; None: of all."""
        return None if self.sees_all else self.name

    def own(self, request: JobRequest) -> JobRequest:
        """The request as the store takes it.

        With keys each client has jobs of its own, also for the same question: otherwise the time of an answer would
        tell what another one asked, and one could cancel or renew what is another's.
        """
        if self.sees_all:
            return request
        id = hashlib.sha256(f"{self.name}\x00{request.id}".encode()).hexdigest()[: len(request.id)]
        return replace(request, id=id)

    def own_line(self, line: BatchLine) -> BatchLine:
        """The line of a batch as the store takes it."""
        return line if line.request is None else replace(line, request=self.own(line.request))


SMALLEST_MEMORY = 512
LARGEST_SEED = 2**31 - 1
KEYS = "time_limit, memory_limit, seed"


@dataclass(frozen=True, slots=True)
class JobOptions:
    """`time_limit` in seconds, `memory_limit` in MiB; both at most the server's."""

    time_limit: float = 60.0
    memory_limit: int = 4096
    seed: int = 1

    def canonical(self) -> str:
        """JSON with sorted keys: part of the identity of a job."""
        values = {"memory_limit": self.memory_limit, "seed": self.seed, "time_limit": float(self.time_limit)}
        return json.dumps(values, sort_keys=True, separators=(",", ":"))


def stored_options(text: str) -> JobOptions:
    """The options of a stored job."""
    return JobOptions(**json.loads(text))


def split_options(document: Any) -> tuple[Any, Any]:
    """The document without its key `options`, and what that key holds (None where it is not there)."""
    if not isinstance(document, Mapping) or "options" not in document:
        return document, None
    return {key: value for key, value in document.items() if key != "options"}, document["options"]


def read_options(given: Any, server: JobOptions) -> JobOptions:
    """The options asked for, the server's where nothing is said. Raises InputError with the pointer."""
    if given is None:
        return server
    if not isinstance(given, Mapping):
        raise InputError(f"'options' must be an object with some of the keys {KEYS}.", "/options")
    unknown = set(given) - {"time_limit", "memory_limit", "seed"}
    if unknown:
        raise InputError(f"'options' has a key that is not known here; the keys are {KEYS}.", "/options")
    return JobOptions(
        time_limit=read_time_limit(given.get("time_limit"), server.time_limit),
        memory_limit=_whole(given, "memory_limit", server.memory_limit, SMALLEST_MEMORY, server.memory_limit),
        seed=_whole(given, "seed", server.seed, 0, LARGEST_SEED),
    )


def read_time_limit(value: Any, largest: float, pointer: str = "/options/time_limit") -> float:
    """A number of seconds, `largest` where nothing is given."""
    if value is None:
        return largest
    is_number = isinstance(value, int | float | Decimal) and not isinstance(value, bool)
    seconds = float(value) if is_number else math.nan
    if not 0 < seconds <= largest:
        raise LimitError(f"time_limit must be a number of seconds above 0 and at most {largest:g}.", pointer)
    return seconds


def _whole(given: Mapping[str, Any], key: str, default: int, low: int, high: int) -> int:
    value = given.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise LimitError(f"{key} must be an integer from {low} to {high}.", f"/options/{key}")
    return value
