"""Jobs and batches as responses; results are sent as they are stored, in parts: a reader costs one
part at any pace.

As text, LaTeX or a SymPy program, for those who ask by `Accept`, workers write them.
"""

import datetime
import json
import re
from collections.abc import AsyncIterator, Mapping
from typing import Any

from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from inverse_service.service.documents import answers
from inverse_service.service.documents.printed_pages import PRINTERS
from inverse_service.service.jobs import batch, model, opening
from inverse_service.web import asking, clients, middleware, problems
from inverse_service.web.engine import PART, Engine

# Answers of a batch that come with their lines: at most so large, and so many at once.
SMALL = 16 * 1024
AT_ONCE = 50
JSON = "application/json"
RETRY_AFTER = "1"
MINIMAL = "return=minimal"
REVALIDATE = "private, no-cache"
VARY = {"Vary": "Accept"}
MEDIA_TYPES = {one.media_type: form for form, one in PRINTERS.items()} | {"text/x-python": "sympy"}
_QUALITY = re.compile(r";\s*q\s*=\s*([01](?:\.\d{0,3})?)\s*$")


async def stored_response(
    engine: Engine, id: str, headers: Mapping[str, str], around: tuple[bytes, bytes] = (b"", b""),
    body: bytes | None = None,
) -> Response:  # fmt: skip
    """200 with the body of a job's answer, which is read where it is not given, between two texts."""
    size, first = (
        await engine.read(engine.store.part, id, 0, PART) if body is None else (len(body), body)
    )
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
    """The remaining parts of a body of this size; raises StoreUnavailable if the body has changed
    since.
    """
    while offset < size:
        now, part = await engine.read(engine.store.part, id, offset, PART)
        if now != size or not part:
            raise model.StoreUnavailable("The answer changed while it was read.")
        offset += len(part)
        yield part


async def lines_of(engine: Engine, answers: list[model.BatchAnswer]) -> AsyncIterator[bytes]:
    """The lines of answers of a batch: small ones together, each large one in parts."""
    together: list[bytes] = []
    for answer in answers:
        if answer.body is not None or answer.status != "successful":
            together.append(batch.answer_line(answer))
            continue
        # A stored object after the head of its line: a comma replaces its first bracket.
        yield b"".join((*together, batch.line_head(answer), b", "))
        together = [b"\n"]
        async for part in parts_of(engine, answer.job, 1, answer.size):
            yield part
    if together:
        yield b"".join(together)


async def result_response(
    request: Request, job: model.Job, engine: Engine, preference: asking.Preference
) -> Response:
    """The answer to the call that asked: the result, the problem it ended with, or 202 and where to
    look.

    `Accept` of text, LaTeX or a SymPy program gives the result of `solve` in that form.
    """
    headers = {"Location": address(job)}
    if preference.applied:
        headers["Preference-Applied"] = preference.applied
    if job.is_open:
        return await job_document(job, engine, headers | {"Retry-After": RETRY_AFTER}, 202)
    if job.status == "successful":
        written = media_type_of(request) if job.kind == "solve" else None
        link = f'</results/{job.id}>; rel="canonical"'
        headers |= {"ETag": etag(job, written), "Cache-Control": REVALIDATE, "Link": link} | VARY
        if written:
            return await written_response(request, job, engine, written, headers)
        return await stored_response(engine, job.id, headers, body=job.body)
    body = await problem_of(job, engine)
    return Response(body, json.loads(body)["status"], headers, problems.MEDIA_TYPE)


async def job_response(request: Request, job: model.Job, engine: Engine) -> Response:
    """The job itself: 202 while it is open, then 200 with an ETag, 304 where the caller has it.

    `Prefer: return=minimal` leaves the result out.
    """
    if job.is_open:
        return await job_document(job, engine, {"Retry-After": RETRY_AFTER}, 202)
    written = media_type_of(request) if job.kind == "solve" and job.status == "successful" else None
    headers = {"ETag": etag(job, written), "Cache-Control": REVALIDATE} | VARY
    if is_known(request, headers["ETag"]):
        return Response(status_code=304, headers=headers)
    if written:
        return await written_response(request, job, engine, written, headers)
    is_whole = MINIMAL not in middleware.header_of(request.scope, b"prefer").lower()
    return await job_document(job, engine, headers, is_whole=is_whole)


async def job_document(
    job: model.Job,
    engine: Engine,
    headers: Mapping[str, str],
    status: int = 200,
    is_whole: bool = False,
) -> Response:
    """The Job document; where it `is_whole` with its result, which is not read and written again.

    One that was dismissed has as its result what was finished of it.
    """
    # The progress of a job that runs elsewhere is in the store.
    fields = (
        await engine.read(job_fields, job, engine)
        if job.status == "running"
        else job_fields(job, engine)
    )
    has_result = is_whole and job.status in ("successful", "dismissed")
    ended_badly = job.status == "failed" or (is_whole and job.status == "dismissed")
    problem = await problem_of(job, engine) if ended_badly else b"null"
    around = (json.dumps(fields)[:-1].encode() + b', "result": ', b', "problem": ' + problem + b"}")
    if has_result:
        return await stored_response(engine, job.id, headers, around, job.body)
    return Response(b"null".join(around), status, dict(headers), JSON)


def is_known(request: Request, tag: str) -> bool:
    """Whether the caller has the answer with this ETag already."""
    given = middleware.header_of(request.scope, b"if-none-match").split(",")
    known = {mark.strip().removeprefix("W/") for mark in given}
    return bool(known & {tag, "*"})


async def problem_of(job: model.Job, engine: Engine) -> bytes:
    """Why a job has no result."""
    dismissed = answers.as_bytes(
        answers.problem_document(410, "dismissed", "The job was dismissed while it ran.")
    )
    if job.status == "dismissed":
        return dismissed
    return job.body or (await engine.read(engine.store.part, job.id, 0, PART))[1] or dismissed


def job_fields(job: model.Job, engine: Engine) -> dict[str, Any]:
    """The summary of a job in a list."""
    fields = ("id", "kind", "status", "created", "started", "finished")
    return {name: getattr(job, name) for name in fields} | {
        "progress": progress_of(job, engine),
        "accepted_at": moment_of(job.created),
        "started_at": moment_of(job.started),
        "ended_at": moment_of(job.finished),
        "usage": {
            "wall": round(job.wall, 4),
            "cpu": round(job.cpu, 4),
            "memory": round(job.memory, 1),
        },
        "links": {
            "self": address(job),
            "events": f"{address(job)}/events",
            "page": f"/results/{job.id}",
        },
    }


def moment_of(seconds: float | None) -> str | None:
    """Seconds since 1970 as RFC 3339 writes them, in UTC."""
    if seconds is None:
        return None
    found = datetime.datetime.fromtimestamp(seconds, datetime.UTC)
    return found.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def progress_of(job: model.Job, engine: Engine) -> Mapping[str, Any] | None:
    """The latest progress of a job that runs, here or behind another front end."""
    if job.status != "running":
        return None
    here = engine.supervisor.events.latest(job.id)
    if here is not None:
        return here
    events = [event for event in engine.store.events(job.id) if event.kind == "progress"]
    return events[-1].data if events else None


def batch_fields(batch: model.Batch) -> dict[str, Any]:
    """The Batch document."""
    place = f"/v1/batches/{batch.id}"
    fields = ("id", "status", "total", "counts", "kind", "created")
    return {name: getattr(batch, name) for name in fields} | {
        "accepted_at": moment_of(batch.created),
        "links": {"self": place, "results": f"{place}/results"},
    }


def address(job: model.Job) -> str:
    """Where a job is."""
    return f"/v1/jobs/{job.id}"


def etag(job: model.Job, written: str | None = None) -> str:
    """Changes when the question is answered again; each form that it is written in has its own."""
    form = f"-{MEDIA_TYPES[written]}" if written else ""
    return f'"{job.id[:20]}-{job.revision}-{job.status[:1]}{form}"'


def media_type_of(request: Request) -> str | None:
    """The media type of MEDIA_TYPES that is asked for above JSON; None where JSON is as good."""
    best, quality = None, 0.0
    for part in middleware.header_of(request.scope, b"accept").lower().split(","):
        found = _QUALITY.search(part)
        name, weight = part.partition(";")[0].strip(), float(found[1]) if found else 1.0
        if weight > quality or (weight == quality and name not in MEDIA_TYPES):
            best, quality = name, weight
    return best if best in MEDIA_TYPES else None


async def written_response(
    request: Request, job: model.Job, engine: Engine, media_type: str, headers: Mapping[str, str]
) -> Response:
    """A solved job in this form; raises Refusal where writing it takes too long."""
    form, place = MEDIA_TYPES[media_type], f"{str(request.base_url).rstrip('/')}/results/{job.id}"
    about = (engine.store.address, job.id, form, place)
    text = await engine.made(clients.client_of(request), written_task, *about)
    return Response(text, 200, dict(headers), media_type)


def written_task(store: str, id: str, form: str, address: str) -> str:
    """A stored result as text, LaTeX or a SymPy program; SymPy is imported in workers only."""
    result = json.loads(opening.stored_answer(store, id)[1])
    if form == "sympy":
        from inverse_service.sympy import from_result

        return from_result(result).to_code(form)
    return PRINTERS[form].write(result, True, address)
