"""What a client does, call by call; see `calls` for what a flow is.

`patience` (s) is the client's: how long a busy or absent service is asked again. The other arguments are the caller's.
A stream may break at any byte (a proxy, a restart of the service). It is asked for again then, and nothing is handed
out twice.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, Protocol, TypeVar
from urllib.parse import quote, urlencode

from api_schemas.base import CheckAnswer
from api_schemas.job import FINAL, Batch, Job, JobList
from api_schemas.result import ResultDocument
from inverse_service.client import decoding, requests

Brought = TypeVar("Brought", covariant=True)
LONGEST_WAIT = 20.0
DISMISSED = 410
FIRST_LOOK, LONGEST_LOOK = 0.05, 1.0
JSON = {"Content-Type": "application/json"}
KINDS = {"solve": "/v1/solve", "check": "/v1/check", "simulate": "/v1/simulate", "work-precision": "/v1/work-precision"}


def accepted(call: requests.Call, patience: float) -> requests.Flow[requests.Answer]:
    """The answer of a call that succeeded; raises RequestRefused with the problem document otherwise."""
    answer = yield from requests.exchange(call, patience)
    if answer.status >= 400:
        raise refusal_of(answer)
    if answer.status >= 300 and answer.status != 304:
        raise decoding.unexpected(f"points elsewhere (status {answer.status})")
    return answer


def refusal_of(answer: requests.Answer) -> decoding.ClientError:
    """The error of an answer that is one: of the request, or of the job that it asked for."""
    problem, job_id = decoding.problem_of(answer.status, answer.body), id_in_location(answer)
    if job_id and answer.status == DISMISSED:
        return decoding.JobDismissed(job_id)
    return decoding.JobFailed(job_id, problem) if job_id else decoding.RequestRefused(answer.status, problem)


def solve(
    patience: float,
    document: Any,
    *,
    time_limit: float | None = None,
    fresh: bool = False,
    timeout: float | None = None,
) -> requests.Flow[ResultDocument]:
    """The result of one system. Raises JobFailed, JobDismissed, or WaitedTooLong after `timeout` s.

    `time_limit` (s) is the service's for the work; `fresh` computes again what has a stored answer.
    """
    result = yield from _asked(patience, document, "solve", time_limit, fresh, timeout)
    if not isinstance(result, ResultDocument):
        raise decoding.unexpected("is not the result of a system")
    return result


def check(patience: float, result: Any, *, timeout: float | None = None) -> requests.Flow[CheckAnswer]:
    """The independent checker's verdict on a result."""
    found = yield from _asked(patience, result, "check", None, False, timeout)
    if not isinstance(found, CheckAnswer):
        raise decoding.unexpected("is not a verdict of the checker")
    return found


def simulate(
    patience: float, scene: Any, *, fresh: bool = False, timeout: float | None = None
) -> requests.Flow[dict[str, Any]]:
    """The result of one scene."""
    result = yield from _asked(patience, scene, "simulate", None, fresh, timeout)
    return result if isinstance(result, dict) else result.model_dump(mode="json")


def _asked(
    patience: float, document: Any, kind: str, time_limit: float | None, fresh: bool, timeout: float | None
) -> requests.Flow[decoding.Result]:
    """The result of a document; a quick one comes with the first answer. All within `timeout` s."""
    begin = time.monotonic()
    seconds, patience = (
        (LONGEST_WAIT, patience) if timeout is None else (min(LONGEST_WAIT, timeout), min(patience, timeout))
    )
    call = replace(question(document, kind, f"wait={int(seconds)}", time_limit, fresh), timeout=timeout)
    answer = yield from accepted(call, patience)
    if answer.status == 200:
        return decoding.result_of(decoding.read_value(answer.body))
    left = None if timeout is None else timeout - (time.monotonic() - begin)
    return (yield from wait(patience, job_of(answer, kind), timeout=left))


def submit(
    patience: float, document: Any, kind: str = "solve", *, time_limit: float | None = None, fresh: bool = False
) -> requests.Flow[Job]:
    """The stored job of a document, at once; `kind` is solve, check, simulate or work-precision."""
    answer = yield from accepted(question(document, kind, "respond-async", time_limit, fresh), patience)
    return job_of(answer, kind)


def wait(patience: float, job: Job | str, *, timeout: float | None = None) -> requests.Flow[decoding.Result]:
    """The result of a job. Raises JobFailed, JobDismissed, or WaitedTooLong after `timeout` s."""
    end = None if timeout is None else time.monotonic() + timeout
    patience = patience if timeout is None else max(0.0, min(patience, timeout))
    for seconds in requests.pauses(FIRST_LOOK, LONGEST_LOOK):
        answer = yield from accepted(requests.Call("GET", job_path(job)), patience)
        found = decoding.read(Job, answer.body)
        if found.is_final:
            return outcome(found)
        seconds = min(seconds, requests.retry_after(answer.headers) or LONGEST_LOOK)
        if end is not None and time.monotonic() + seconds > end:
            raise decoding.WaitedTooLong(found.id, timeout or 0.0)
        yield requests.Pause(seconds)
    raise AssertionError("the pauses never end")


def outcome(job: Job) -> decoding.Result:
    """The result of a job that is final, or the error it ended with."""
    if job.status == "failed":
        raise decoding.JobFailed(job.id, job.problem or decoding.problem_from({}))
    if job.status == "dismissed":
        raise decoding.JobDismissed(job.id)
    return decoding.result_of(job.result)


def job(patience: float, job: Job | str) -> requests.Flow[Job]:
    """The job as it is now."""
    answer = yield from accepted(requests.Call("GET", job_path(job)), patience)
    return decoding.read(Job, answer.body)


def jobs(patience: float, cursor: str | None = None) -> requests.Flow[JobList]:
    """One page of the jobs; its `next` is the cursor of the page after it."""
    query = f"?{urlencode({'cursor': cursor})}" if cursor else ""
    answer = yield from accepted(requests.Call("GET", f"/v1/jobs{query}"), patience)
    return decoding.read(JobList, answer.body)


def cancel(patience: float, job: Job | str) -> requests.Flow[None]:
    """Have the work of a job stopped; one that is final already stays as it is."""
    yield from accepted(requests.Call("DELETE", job_path(job)), patience)


def submit_batch(
    patience: float, documents: Iterable[Mapping[str, Any]], kind: str = "solve", *, time_limit: float | None = None
) -> requests.Flow[Batch]:
    """The stored batch of documents, at once."""
    lines = b"".join(json.dumps(document).encode() + b"\n" for document in documents)
    path = "/v1/batches" + query_of(time_limit, kind=kind)
    answer = yield from accepted(requests.Call("POST", path, lines, {"Content-Type": requests.NDJSON}), patience)
    return decoding.read(Batch, answer.body)


def batch_status(patience: float, batch: Batch | str) -> requests.Flow[Batch]:
    """The batch as it is now: its counts by status."""
    answer = yield from accepted(requests.Call("GET", batch_path(batch)), patience)
    return decoding.read(Batch, answer.body)


def cancel_batch(patience: float, batch: Batch | str) -> requests.Flow[Batch]:
    """Have what is open in a batch, and in no other one, stopped; the batch as it is then."""
    answer = yield from accepted(requests.Call("DELETE", batch_path(batch)), patience)
    return decoding.read(Batch, answer.body)


def parse(patience: float, document: Any) -> requests.Flow[dict[str, Any]]:
    """What the service understands of a document."""
    answer = yield from accepted(requests.Call("POST", "/v1/parse", encoded(document), JSON), patience)
    return dict(decoding.read_value(answer.body))


def catalogue(patience: float, name: str | None = None) -> requests.Flow[dict[str, Any]]:
    """The named systems, or one of them."""
    path = "/v1/catalogue" if name is None else f"/v1/catalogue/{quote(name, safe='')}"
    answer = yield from accepted(requests.Call("GET", path), patience)
    return dict(decoding.read_value(answer.body))


def limits(patience: float) -> requests.Flow[dict[str, Any]]:
    """Every limit of the service."""
    answer = yield from accepted(requests.Call("GET", "/v1/limits"), patience)
    return dict(decoding.read_value(answer.body))


def items(patience: float, reader: Reader[Any]) -> requests.Flow[None]:
    """What a stream brings, each as an Item, up to its end; it is begun again where it breaks."""
    repetition, was_final = requests.Repetition(patience), False
    while not reader.done:
        try:
            answer: requests.Answer = yield requests.Open(reader.call())
            if answer.status != 200:
                problem = decoding.problem_of(answer.status, (yield from requests.body_of(reader.call())))
                if answer.status not in requests.BUSY:
                    raise decoding.RequestRefused(answer.status, problem)
                yield repetition.pause_after(decoding.ServiceBusy(answer.status, problem), answer.headers)
                continue
            lines = Lines()
            while data := (yield requests.More()):
                for item in filter(None, map(reader.feed, lines.feed(data))):
                    repetition.reset()
                    yield requests.Item(item)
                if reader.done:
                    return
        except decoding.ServiceUnreachable as error:
            yield repetition.pause_after(error)
            continue
        if was_final:
            return reader.close()
        answer = yield from accepted(requests.Call("GET", reader.status_path), patience)
        value = decoding.read_value(answer.body)
        was_final = isinstance(value, dict) and value.get("status") in FINAL
        if not was_final:
            yield requests.Pause(requests.LOOK_AGAIN)


def question(document: Any, kind: str, prefer: str, time_limit: float | None, fresh: bool) -> requests.Call:
    """The POST of a document; `fresh` asks again what the service has answered before."""
    headers = {**JSON, "Prefer": prefer, **({"Cache-Control": "no-cache"} if fresh else {})}
    return requests.Call("POST", KINDS[kind] + query_of(time_limit), encoded(document), headers)


def job_of(answer: requests.Answer, kind: str) -> Job:
    """The job that an answer is about: a 202 has its address; a 200 is the result of a finished one."""
    job_id = id_in_location(answer)
    if answer.status == 200:
        return Job(id=job_id, kind=kind, status="successful", result=decoding.read_value(answer.body))
    if not job_id:
        raise decoding.unexpected("has no address of a job")
    return Job(id=job_id, kind=kind, status="accepted")


def id_in_location(answer: requests.Answer) -> str:
    """The id at the end of the address that an answer names; empty where it names none."""
    return answer.headers.get("location", "").partition("?")[0].rstrip("/").rpartition("/")[2]


def encoded(document: Any) -> bytes:
    """A document as JSON; text and bytes are taken to be JSON already."""
    if isinstance(document, bytes):
        return document
    return document.encode() if isinstance(document, str) else json.dumps(document).encode()


def job_path(job: Job | str) -> str:
    """The address of a job that is given as itself or by its id."""
    return f"/v1/jobs/{quote(job if isinstance(job, str) else job.id, safe='')}"


def batch_path(batch: Batch | str) -> str:
    """The address of a batch."""
    return f"/v1/batches/{quote(batch if isinstance(batch, str) else batch.id, safe='')}"


def query_of(time_limit: float | None, **more: str) -> str:
    """`?time_limit=S&...`, or nothing."""
    fields = more if time_limit is None else {"time_limit": f"{time_limit:g}", **more}
    return f"?{urlencode(fields)}" if fields else ""


class Reader(Protocol[Brought]):
    """Turns the lines of a stream into items; `done` says that there is no need to ask again.

    `status_path` is the address that tells whether what the stream is about is final.
    """

    done: bool
    status_path: str

    def call(self) -> requests.Call:
        """The request of the stream, or of what is still missing of it."""

    def feed(self, line: str) -> Brought | None:
        """The item that a line completes, if it completes a new one."""

    def close(self) -> None:
        """The stream ended whole and nothing will be added; raises UnexpectedAnswer if something is missing."""


class Lines:
    """Whole lines from bytes as they come. Only a line feed ends one: JSON may hold U+2028 and its like."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        """The lines that are whole now, without their ends."""
        *whole, self._rest = (self._rest + data).split(b"\n")
        return [line.removesuffix(b"\r").decode("utf-8", "replace") for line in whole]


class JobEvents:
    """The events of a job up to its last one."""

    def __init__(self, job: Job | str) -> None:
        self.status_path = job_path(job)
        self._path = f"{self.status_path}/events"
        self._reader = decoding.EventReader()
        self.done = False

    def call(self) -> requests.Call:
        last = self._reader.last_id
        self._reader = decoding.EventReader(last)
        headers = {"Accept": "text/event-stream", **({"Last-Event-ID": last} if last else {})}
        return requests.Call("GET", self._path, headers=headers)

    def feed(self, line: str) -> decoding.Event | None:
        event = self._reader.feed(line)
        if event is not None and event.data.get("status") in FINAL:
            self.done = True
        return event

    def close(self) -> None:
        """The last event was lost; there is nothing to miss."""


class BatchResults:
    """The answers of a batch as they come, each one once."""

    def __init__(self, batch: Batch) -> None:
        self.status_path = batch_path(batch)
        self._path = f"{self.status_path}/results"
        self._total = batch.total
        self._seen: set[Any] = set()
        self.done = batch.total == 0

    def call(self) -> requests.Call:
        return requests.Call("GET", self._path, headers={"Accept": requests.NDJSON})

    def feed(self, line: str) -> decoding.BatchAnswer | None:
        if not line.strip():
            return None
        answer = decoding.batch_answer(line)
        key = ("line", answer.line) if answer.line is not None else ("id", answer.id)
        if key in self._seen:
            return None
        self._seen.add(key)
        self.done = len(self._seen) >= self._total
        return answer

    def close(self) -> None:
        missing = self._total - len(self._seen)
        if missing:
            raise decoding.unexpected(f"lacks {missing} of {self._total} results of a finished batch")
