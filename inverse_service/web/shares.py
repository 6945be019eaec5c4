"""How much of the service a client may have at a time: bytes under way, and places among those who wait."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from inverse_service.web.problems import Refusal

QUICK_PROCESSES = 3
# Of one client so many run at the same time, and one is always left for the others.
QUICK_SHARE = QUICK_PROCESSES - 1
# Answers next to forms that are computed at the same time.
GLANCES = QUICK_PROCESSES - 1
# A client may have this part of the places of those who wait.
SHARE_OF_WAITING = 2


@dataclass(slots=True)
class ByteBudget:
    """Used on the loop only. `total` and `of_a_client` are in bytes; the largest body fits into both."""

    total: int
    of_a_client: int
    _held: Counter[str] = field(default_factory=Counter)

    @contextmanager
    def account(self, client: str) -> Iterator[Account]:
        """An account for one body, given back at the end."""
        account = Account(self, client)
        try:
            yield account
        finally:
            self._held[client] -= account.held
            if not self._held[client]:
                del self._held[client]

    def take(self, client: str, size: int) -> None:
        """Note so many bytes more; raises Refusal where there is no room for them."""
        self._held[client] += size
        if self._held[client] > self.of_a_client:
            detail = "Too much of what you sent is still under way; send it in smaller parts, one after the other."
            raise Refusal(429, "busy", detail, headers={"Retry-After": "2"})
        if self._held.total() > self.total:
            detail = "Too many bytes are under way to this service; try again in some seconds."
            raise Refusal(503, "busy", detail, headers={"Retry-After": "2"})


@dataclass(slots=True)
class Account:
    """What one body holds of the budget."""

    budget: ByteBudget
    client: str
    held: int = 0

    def take(self, size: int) -> None:
        """So many bytes came; raises Refusal."""
        self.held += size
        self.budget.take(self.client, size)


@dataclass(slots=True)
class Places:
    """The places of those who wait for a quick process: `total` in all, of one client half; used on the loop only."""

    total: int
    _taken: Counter[str] = field(default_factory=Counter)
    _glancing: set[str] = field(default_factory=set)

    def __len__(self) -> int:
        return self._taken.total()

    @contextmanager
    def take(self, client: str) -> Iterator[None]:
        """A place for the time of one request; raises Refusal where the client, or everybody, has enough."""
        if len(self) >= self.total or self._taken[client] >= max(1, self.total // SHARE_OF_WAITING):
            detail = "Too many requests wait for a worker; try again in some seconds."
            raise Refusal(429, "busy", detail, headers={"Retry-After": "2"})
        self._taken[client] += 1
        try:
            yield
        finally:
            self._taken[client] -= 1
            if not self._taken[client]:
                del self._taken[client]

    @contextmanager
    def glance(self, client: str) -> Iterator[bool]:
        """Whether a client may have an answer that is not stored now: one at a time, the others' echoes go on."""
        is_free = client not in self._glancing and len(self._glancing) < GLANCES
        if is_free:
            self._glancing.add(client)
        try:
            yield is_free
        finally:
            if is_free:
                self._glancing.discard(client)
