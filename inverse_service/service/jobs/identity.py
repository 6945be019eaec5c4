"""Ids and owners: a job's id is a hash of engine, canonical document and options; a batch's, of its jobs.

The same question has the same id, so it is answered from the store, and its link is permanent. Every call, page,
picture and stream asks `Viewer.seen` whose a job or a batch is, and nothing else.
"""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from typing import Any, TypeVar

from inverse_service import __version__
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


Owned = TypeVar("Owned", Job, Batch)


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
