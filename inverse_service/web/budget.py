"""How many bytes of bodies may be under way at a time, in all and of one client."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from inverse_service.web.problems import Refusal

# How many times MAX_BODY each may have: a scene may hold a result, a result many certificates, a batch many systems.
FACTORS = {"solve": 1, "simulate": 5, "work-precision": 5, "check": 10, "batch": 16}
LARGEST_FACTOR = max(FACTORS.values())


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
