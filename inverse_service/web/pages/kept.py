"""Parts of pages that a worker makes once and that are kept to be shown at once."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass, field

from markupsafe import Markup

from inverse_service.web.problems import Refusal


@dataclass(frozen=True, slots=True)
class Kept:
    """At most so many parts of pages, each made once at a time; the oldest goes first."""

    most: int
    made: dict[str, Markup] = field(default_factory=dict)
    asked: dict[str, asyncio.Future[None]] = field(default_factory=dict)

    async def of(
        self, key: str, make: Callable[[], Awaitable[Markup | None]], patience: float
    ) -> Markup | None:
        """The part of this key; None if it is not made in `patience` seconds: the work goes on for the next visitor."""
        if key not in self.made and key not in self.asked:
            running = self.asked[key] = asyncio.ensure_future(self._keep(key, make))
            running.add_done_callback(lambda _: self.asked.pop(key, None))
        return await self.soon(key, patience)

    async def soon(self, key: str, patience: float) -> Markup | None:
        """The part of this key if it is made or being made; None if it is neither, or takes longer."""
        if key not in self.made and (running := self.asked.get(key)) is not None:
            with suppress(TimeoutError):
                await asyncio.wait_for(asyncio.shield(running), patience)
        return self.made.get(key)

    async def _keep(self, key: str, make: Callable[[], Awaitable[Markup | None]]) -> None:
        with suppress(Refusal):
            found = await make()
            if found is not None:
                if len(self.made) >= self.most:
                    self.made.pop(next(iter(self.made)))
                self.made[key] = found
