"""Answers of the store in parts: a reader costs the service no more than one part, at whatever pace it reads."""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping

from starlette.responses import Response, StreamingResponse

from inverse_service.service.jobs.line_answers import answer_line, line_head
from inverse_service.service.jobs.model import BatchAnswer, StoreUnavailable
from inverse_service.web.engine import Engine

PART = 256 * 1024
# Answers of a batch that come with their lines: at most so large, and so many at once.
SMALL = 16 * 1024
AT_ONCE = 50
JSON = "application/json"


async def stored_response(
    engine: Engine, id: str, headers: Mapping[str, str], around: tuple[bytes, bytes] = (b"", b"")
) -> Response:
    """200 with the body of a job's answer, between two texts."""
    size, first = await engine.read(engine.store.part, id, 0, PART)
    before, after = around
    if len(first) == size:
        return Response(before + (first or b"null") + after, 200, dict(headers), JSON)

    async def parts() -> AsyncIterator[bytes]:
        yield before + first
        async for part in parts_of(engine, id, len(first), size):
            yield part
        yield after

    length = {"Content-Length": str(len(before) + size + len(after))}
    return StreamingResponse(parts(), 200, {**headers, **length}, JSON)


async def parts_of(engine: Engine, id: str, offset: int, size: int) -> AsyncIterator[bytes]:
    """The rest of a body of this size; raises StoreUnavailable where it is another one by now."""
    while offset < size:
        now, part = await engine.read(engine.store.part, id, offset, PART)
        if now != size or not part:
            raise StoreUnavailable("The answer changed while it was read.")
        offset += len(part)
        yield part


async def lines_of(engine: Engine, answers: list[BatchAnswer]) -> AsyncIterator[bytes]:
    """The lines of answers of a batch: small ones together, each large one in parts."""
    together: list[bytes] = []
    for answer in answers:
        if answer.body is not None or answer.status != "successful":
            together.append(answer_line(answer))
            continue
        yield b"".join((*together, line_head(answer)))
        together = []
        async for part in _large(engine, answer):
            yield part
    if together:
        yield b"".join(together)


async def _large(engine: Engine, answer: BatchAnswer) -> AsyncIterator[bytes]:
    """A stored object after the head of its line: a comma stands for its first bracket."""
    yield b", "
    async for part in parts_of(engine, answer.job, 1, answer.size):
        yield part
    yield b"\n"
