"""Whose jobs and batches are whose. Every call, page, picture and stream asks `Viewer.seen`, and nothing else."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import TypeVar

from inverse_service.service.jobs.model import Batch, BatchLine, Job, JobRequest

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
