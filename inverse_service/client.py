"""The Python client of the service. Unlike a generated client, it can wait for results, stream, and
resume::

    with Client("http://127.0.0.1:8000") as client:
        result = client.solve({"coordinates": ["x"], "equations": {"x": "-x"}})

`AsyncClient` has the same methods as coroutines; `Client` runs it on a separate thread. A request
to a busy or absent service is repeated for `patience` seconds: every call may be repeated, even
POST, because a job's id is a hash of its document. A broken stream is requested again, and nothing
is delivered twice. docs/how-to/http.md has examples.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import json
import random
import threading
import time
from collections.abc import (
    AsyncGenerator,
    AsyncIterator,
    Callable,
    Coroutine,
    Iterable,
    Iterator,
    Mapping,
)
from typing import Any, Concatenate, Final, ParamSpec, TypeVar
from urllib.parse import quote, urlencode

import httpx

from inverse_service import __version__, errors

ADDRESS: Final = "http://127.0.0.1:8000"
TIMEOUT, PATIENCE = 60.0, 30.0
# Seconds that the service waits for a result before it names the job, and that its answer may
# exceed the caller's time.
LONGEST_WAIT, GRACE = 20.0, 1.0
BUSY: Final = frozenset({429, 502, 503, 504})
# Pauses double from the first to the longest one. Clients that were refused together do not all
# retry together.
FIRST_PAUSE, LONGEST_PAUSE, JITTER = 0.1, 5.0, 1.25
FIRST_LOOK, LONGEST_LOOK = 0.05, 1.0
NDJSON: Final = "application/x-ndjson"
JSON: Final = {"Content-Type": "application/json"}
FINAL: Final = frozenset({"successful", "failed", "dismissed"})
CANCELLED: Final = "Job {} was cancelled; submit the document again to have it solved."

P = ParamSpec("P")
Value = TypeVar("Value")
Seconds = float | None
Documents = Iterable[Mapping[str, Any]]


class Answer(dict[str, Any]):
    """An object in an answer, with its keys as attributes: `answer.lagrangian.text`. openapi.json describes them."""

    def __getattr__(self, name: str) -> Any:
        if name in self:
            return self[name]
        raise AttributeError(f"The answer has no {name}; it has {', '.join(self)}.")


class ClientError(errors.InverseServiceError):
    """Root of the client's errors; `problem` is the problem document (RFC 9457) if there is one."""

    code = "client"

    def __init__(self, detail: str, problem: Answer | None = None) -> None:
        super().__init__(detail)
        self.problem = problem


class RequestRefused(ClientError):
    """The service refused the request: `problem.errors` names the places, `status` is the HTTP status."""

    code = "request-refused"

    def __init__(self, problem: Answer, job_id: str = "", retry_after: float = 0.0) -> None:
        place = next(iter(problem.errors), Answer())
        column = f", column {place.column}" if place.get("column") is not None else ""
        where = f"{place.pointer}{column}: " if place.get("pointer") else ""
        super().__init__(f"{where}{problem.detail}", problem)
        self.status, self.job_id, self.retry_after = problem.status, job_id, retry_after


class ServiceBusy(RequestRefused):
    """The service answered 429, 502, 503 or 504 for longer than the client's patience."""

    code, retry = "service-busy", True


class JobFailed(RequestRefused):
    """The job `job_id` ended without a result: its document was refused, or the program failed on it."""

    code = "job-failed"


class ServiceUnreachable(ClientError):
    """No connection, or none that lasted, for longer than the client's patience."""

    code, retry = "service-unreachable", True


class UnexpectedAnswer(ClientError):
    """The answer does not come from this service, or comes from another version of it."""

    code = "unexpected-answer"

    def __init__(self, what: str) -> None:
        super().__init__(
            f"The answer {what}; is the address that of this service, and its version that of this?"
        )


class JobDismissed(ClientError):
    """The job was cancelled."""

    code = "job-dismissed"


class WaitedTooLong(ClientError):
    """The job is still open after the caller's timeout; it continues in the service."""

    code, retry = "waited-too-long", True


class AsyncClient(contextlib.AbstractAsyncContextManager["AsyncClient"]):
    """A client for the service at an address; close it or use it in an `async with`.

    Requests to a busy or absent service are repeated for `patience` s; `timeout` (s) and other
    options are httpx's. Every method raises RequestRefused, ServiceBusy, ServiceUnreachable or
    UnexpectedAnswer.
    """

    def __init__(
        self,
        address: str = ADDRESS,
        *,
        api_key: str | None = None,
        patience: float = PATIENCE,
        **options: Any,
    ) -> None:
        if not address.startswith(("http://", "https://")):
            raise ClientError("The address of the service must begin with http:// or https://.")
        headers = {
            "User-Agent": f"inverse-service-client/{__version__}",
            "Accept": "application/json, */*;q=0.5",
        }
        if api_key is not None:
            headers["Authorization"] = f"Bearer {api_key}"
        self._http = httpx.AsyncClient(
            base_url=address, headers=headers, **{"timeout": TIMEOUT} | options
        )
        self._patience = patience

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    async def solve(
        self, /, document: Any, kind: str = "solve", *, timeout: Seconds = None, **options: Any
    ) -> Answer:
        """The result of a document; `kind` and options are those of `submit`. A quick one comes
        with the first answer.

        Raises JobFailed, JobDismissed, or WaitedTooLong after `timeout` s.
        """
        began, seconds = (
            time.monotonic(),
            LONGEST_WAIT if timeout is None else min(LONGEST_WAIT, timeout),
        )
        job = await self._asked(document, kind, f"wait={int(seconds)}", timeout, **options)
        left = None if timeout is None else max(0.0, timeout - (time.monotonic() - began))
        return (
            Answer(job.result) if job.status == "successful" else await self.wait(job, timeout=left)
        )

    async def check(self, result: Any, *, timeout: Seconds = None) -> Answer:
        """The independent checker's verdict on a result."""
        return await self.solve(result, "check", timeout=timeout)

    async def simulate(self, scene: Any, *, fresh: bool = False, timeout: Seconds = None) -> Answer:
        """The result of one scene."""
        return await self.solve(scene, "simulate", fresh=fresh, timeout=timeout)

    async def submit(self, /, document: Any, kind: str = "solve", **options: Any) -> Answer:
        """Submit a document and return its stored job at once; `kind` is solve, check, simulate or
        work-precision.

        A text is JSON or equations, bytes are JSON. Options: `time_limit` (s) limits the work in
        the service; `fresh` repeats the computation even if an answer is stored.
        """
        return await self._asked(document, kind, "respond-async", None, **options)

    async def _asked(
        self,
        document: Any,
        kind: str,
        prefer: str,
        patience: Seconds,
        time_limit: Seconds = None,
        fresh: bool = False,
    ) -> Answer:
        headers = JSON | {"Prefer": prefer} | ({"Cache-Control": "no-cache"} if fresh else {})
        path, body = f"/v1/{kind}?{_query(time_limit)}", _encoded(document)
        response = await self._sent("POST", path, patience, content=body, headers=headers)
        job_id = _id_in_location(response)
        if response.status_code == 200:
            return Answer(id=job_id, kind=kind, status="successful", result=_value(response))
        if not job_id:
            raise UnexpectedAnswer("has no address of a job")
        return Answer(id=job_id, kind=kind, status="accepted")

    async def wait(self, job: Answer | str, *, timeout: Seconds = None) -> Answer:
        """The result of a job. Raises JobFailed, JobDismissed, or WaitedTooLong after `timeout` s."""
        began, pause = time.monotonic(), FIRST_LOOK
        while True:
            response = await self._sent("GET", _path("jobs", job), timeout)
            found = _value(response, "id", "status")
            if found.status == "failed":
                raise JobFailed(_problem(found.get("problem") or {}), found.id)
            if found.status == "dismissed":
                raise JobDismissed(CANCELLED.format(found.id))
            if found.status == "successful":
                return Answer(found.result)
            seconds = min(pause, _retry_after(response) or LONGEST_LOOK)
            if timeout is not None and time.monotonic() - began + seconds > timeout:
                raise WaitedTooLong(
                    f"Job {found.id} is still open after {timeout:g} s; wait again, or cancel it."
                )
            await asyncio.sleep(seconds)
            pause = min(2 * pause, LONGEST_LOOK)

    async def cancel(self, work: Answer | str) -> None:
        """Stop a job or all open jobs of a batch; final results are kept."""
        await self._sent(
            "DELETE",
            _path("batches" if isinstance(work, Answer) and "total" in work else "jobs", work),
        )

    async def call(self, path: str, document: Any = None) -> Answer:
        """The answer at any other address, such as /v1/limits; a document is sent with POST."""
        body = None if document is None else _encoded(document)
        return _value(await self._sent("POST" if body else "GET", path, content=body, headers=JSON))

    async def submit_batch(
        self, documents: Documents, kind: str = "solve", *, time_limit: Seconds = None
    ) -> Answer:
        """Submit documents and return their stored batch at once."""
        lines = b"".join(json.dumps(document).encode() + b"\n" for document in documents)
        path, headers = f"/v1/batches?{_query(time_limit, kind=kind)}", {"Content-Type": NDJSON}
        return _value(await self._sent("POST", path, content=lines, headers=headers), "id", "total")

    async def batch(
        self, /, documents: Documents, kind: str = "solve", **options: Any
    ) -> AsyncIterator[Answer]:
        """One answer for each document, in order of completion: id, line, and result or problem."""
        async for answer in self.batch_results(await self.submit_batch(documents, kind, **options)):
            yield answer

    async def batch_results(self, batch: Answer) -> AsyncIterator[Answer]:
        """The answers of a batch, each once: first those that are complete, then the others as they arrive."""
        seen, repetition = set[tuple[str, Any]](), Repetition(self._patience)
        if batch.total == 0:
            return
        whole = self._lines(_path("batches", batch), "results", {"Accept": NDJSON}, repetition)
        async with contextlib.aclosing(whole) as lines:
            async for line in lines:
                if not line or not line.strip():
                    continue
                answer = _batch_answer(line)
                key = ("id", answer.id) if answer.line is None else ("line", answer.line)
                if key in seen:
                    continue
                seen.add(key)
                repetition.reset()
                yield answer
                if len(seen) >= batch.total:
                    return
        raise UnexpectedAnswer(
            f"lacks {batch.total - len(seen)} of {batch.total} results of a finished batch"
        )

    async def stream(self, job: Answer | str) -> AsyncIterator[Answer]:
        """The events of a job as they happen: kind, data, id; the last one reports how the job ended."""
        repetition, headers = Repetition(self._patience), {"Accept": "text/event-stream"}
        fields: dict[str, str] = {}
        async with contextlib.aclosing(
            self._lines(_path("jobs", job), "events", headers, repetition)
        ) as lines:
            async for line in lines:
                if line is None:  # the stream restarts: drop an incomplete event
                    fields = {"id": headers.get("Last-Event-ID", "")}
                elif line:
                    name, _, text = line.partition(":")
                    text = text.removeprefix(" ")
                    fields[name] = (
                        f"{fields['data']}\n{text}" if name == "data" and "data" in fields else text
                    )
                else:
                    headers |= {"Last-Event-ID": fields["id"]} if fields["id"] else {}
                    found, fields = fields, {"id": fields["id"]}
                    if "data" in found:
                        repetition.reset()
                        data = _value(found["data"])
                        yield Answer(kind=found.get("event", "message"), data=data, id=found["id"])
                        if data.get("status") in FINAL:
                            return

    async def _sent(
        self, method: str, path: str, patience: Seconds = None, **request: Any
    ) -> httpx.Response:
        """The answer to a call, which is repeated with pauses while the service is busy or unreachable."""
        repetition = Repetition(
            self._patience if patience is None else min(self._patience, patience)
        )
        timeout = self._http.timeout if patience is None else httpx.Timeout(patience + GRACE)
        while True:
            try:
                return _accepted(await self._http.request(method, path, timeout=timeout, **request))
            except (ServiceBusy, httpx.RequestError) as error:
                await repetition.pause(error)

    async def _lines(
        self, path: str, name: str, headers: Mapping[str, str], repetition: Repetition
    ) -> AsyncGenerator[str | None, None]:
        """The lines of a stream about `path`, first None; a broken stream is restarted until one
        ends as final.

        Only a line feed ends a line: JSON may contain U+2028 and similar characters.
        """
        was_final = False
        while True:
            try:
                async with self._http.stream("GET", f"{path}/{name}", headers=headers) as response:
                    if response.is_error:
                        await response.aread()
                    _accepted(response)
                    yield None
                    rest = b""
                    async for data in response.aiter_bytes():
                        *whole, rest = (rest + data).split(b"\n")
                        for line in whole:
                            yield line.removesuffix(b"\r").decode("utf-8", "replace")
            except (ServiceBusy, httpx.RequestError) as error:
                await repetition.pause(error)
                continue
            if was_final:
                return
            was_final = _value(await self._sent("GET", path)).get("status") in FINAL
            await asyncio.sleep(0 if was_final else LONGEST_LOOK / 2)


Call = Callable[Concatenate[AsyncClient, P], Value]


def _blocking(
    method: Call[P, Coroutine[Any, Any, Value]],
) -> Callable[Concatenate[Client, P], Value]:
    @functools.wraps(method)
    def blocking(self: Client, /, *arguments: P.args, **options: P.kwargs) -> Value:
        return self._run(method(self._client, *arguments, **options))

    return blocking


def _iterating(
    method: Call[P, AsyncIterator[Value]],
) -> Callable[Concatenate[Client, P], Iterator[Value]]:
    @functools.wraps(method)
    def iterating(self: Client, /, *arguments: P.args, **options: P.kwargs) -> Iterator[Value]:
        items: Any = method(self._client, *arguments, **options)
        try:
            while (item := self._run(anext(items, None))) is not None:
                yield item
        finally:
            self._run(items.aclose())

    return iterating


class Client(contextlib.AbstractContextManager["Client"]):
    """The blocking client, with the arguments and errors of AsyncClient; safe to use from several threads."""

    def __init__(self, address: str = ADDRESS, **options: Any) -> None:
        self._client = AsyncClient(address, **options)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections, and end the thread."""
        if not self._loop.is_closed():
            self._run(self._client.close())
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()
            self._loop.close()

    def _run(self, work: Coroutine[Any, Any, Value]) -> Value:
        future = asyncio.run_coroutine_threadsafe(work, self._loop)
        try:
            return future.result()
        finally:
            future.cancel()

    solve = _blocking(AsyncClient.solve)
    check = _blocking(AsyncClient.check)
    simulate = _blocking(AsyncClient.simulate)
    submit = _blocking(AsyncClient.submit)
    wait = _blocking(AsyncClient.wait)
    cancel = _blocking(AsyncClient.cancel)
    call = _blocking(AsyncClient.call)
    submit_batch = _blocking(AsyncClient.submit_batch)
    batch = _iterating(AsyncClient.batch)
    batch_results = _iterating(AsyncClient.batch_results)
    stream = _iterating(AsyncClient.stream)


class Repetition:
    """Pauses that double up to LONGEST_PAUSE, or as long as Retry-After asks; `patience` s in all."""

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self.reset()

    def reset(self) -> None:
        """The call succeeded, so the next failure counts as the first."""
        self._end, self._pause = time.monotonic() + self._patience, FIRST_PAUSE

    async def pause(self, failure: ServiceBusy | httpx.RequestError) -> None:
        """Wait for the next attempt; raises ServiceBusy or ServiceUnreachable when `patience` has expired."""
        seconds = max(self._pause, getattr(failure, "retry_after", 0.0)) * random.uniform(
            1.0, JITTER
        )
        self._pause = min(2 * self._pause, LONGEST_PAUSE)
        if time.monotonic() + seconds < self._end:
            return await asyncio.sleep(seconds)
        if isinstance(failure, ServiceBusy):
            raise failure
        reason = f"{failure.request.url} ({type(failure).__name__})"
        raise ServiceUnreachable(
            f"There is no service at {reason}, or it does not answer."
        ) from None


def _retry_after(response: httpx.Response) -> float:
    text = response.headers.get("retry-after", "").strip()
    return float(text) if text.isascii() and text.isdigit() and len(text) < 9 else 0.0


def _accepted(response: httpx.Response) -> httpx.Response:
    """Raise the error that an answer reports, either for the request or for the job that it asked for."""
    status, job_id = response.status_code, _id_in_location(response)
    if 300 <= status < 400:
        raise UnexpectedAnswer(f"points elsewhere (status {status})")
    if status < 400:
        return response
    problem = Answer(detail=f"The service answered with status {status} and no explanation.")
    with contextlib.suppress(UnexpectedAnswer):
        problem = _value(response)
    problem = _problem(problem | {"status": status})
    if status in BUSY:
        raise ServiceBusy(problem, retry_after=_retry_after(response))
    if job_id and status == 410:
        raise JobDismissed(CANCELLED.format(job_id), problem)
    raise JobFailed(problem, job_id) if job_id else RequestRefused(problem)


def _problem(value: Mapping[str, Any]) -> Answer:
    """A problem document from an object that may lack some of its fields."""
    return Answer({"status": 0, "detail": "No explanation was given.", "errors": []} | dict(value))


def _id_in_location(response: httpx.Response) -> str:
    return str(
        response.headers.get("location", "").partition("?")[0].rstrip("/").rpartition("/")[2]
    )


def _encoded(document: Any) -> str | bytes:
    """JSON as it is, any other text as equations, and what is no text as JSON."""
    if isinstance(document, str) and not document.lstrip().startswith(("{", "[")):
        document = {"equations": document, "parameters": "guess"}
    return document if isinstance(document, str | bytes) else json.dumps(document)


def _path(kind: str, work: Answer | str) -> str:
    return f"/v1/{kind}/{quote(work if isinstance(work, str) else work.id, safe='')}"


def _query(time_limit: float | None, **more: str) -> str:
    return urlencode(more if time_limit is None else {"time_limit": f"{time_limit:g}", **more})


def _value(answer: httpx.Response | str, *keys: str) -> Answer:
    """The object in an answer, which must have these keys."""
    try:
        value = json.loads(
            answer if isinstance(answer, str) else answer.content, object_hook=Answer
        )
    except (ValueError, RecursionError):
        raise UnexpectedAnswer("is not JSON") from None
    if not isinstance(value, Answer) or not value.keys() >= set(keys):
        raise UnexpectedAnswer("is not the object that was asked for")
    return value


def _batch_answer(text: str) -> Answer:
    value = _value(text, "id")
    identifier, line, problem = value.pop("id"), value.pop("line", None), value.get("error", value)
    result = value if "format" in value or "verdict" in value else None
    return Answer(
        id=identifier, line=line, result=result, problem=None if result else _problem(problem)
    )
