"""What a client does, call by call; see `calls` for what a flow is."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any
from urllib.parse import quote, urlencode

from api_schemas.job import FINAL, Batch, Job, JobList
from inverse_service.client.calls import NDJSON, Answer, Call, Flow, Pause, exchange, pauses, retry_after
from inverse_service.client.failures import ClientError, JobDismissed, JobFailed, RequestRefused, WaitedTooLong
from inverse_service.client.reading import Result, problem_from, problem_of, read, read_value, result_of, unexpected

LONGEST_WAIT = 20.0
DISMISSED = 410
FIRST_LOOK, LONGEST_LOOK = 0.05, 1.0
JSON = {"Content-Type": "application/json"}
KINDS = {"solve": "/v1/solve", "check": "/v1/check", "simulate": "/v1/simulate", "work-precision": "/v1/work-precision"}


def accepted(call: Call, patience: float) -> Flow[Answer]:
    """The answer of a call that succeeded; raises RequestRefused with the problem document otherwise."""
    answer = yield from exchange(call, patience)
    if answer.status >= 400:
        raise refusal_of(answer)
    if answer.status >= 300 and answer.status != 304:
        raise unexpected(f"points elsewhere (status {answer.status})")
    return answer


def refusal_of(answer: Answer) -> ClientError:
    """The error of an answer that is one: of the request, or of the job that it asked for."""
    problem, job_id = problem_of(answer.status, answer.body), id_in_location(answer)
    if job_id and answer.status == DISMISSED:
        return JobDismissed(job_id)
    return JobFailed(job_id, problem) if job_id else RequestRefused(answer.status, problem)


def submit(document: Any, kind: str, time_limit: float | None, fresh: bool, patience: float) -> Flow[Job]:
    """The stored job of a document, without waiting for its result."""
    answer = yield from accepted(question(document, kind, "respond-async", time_limit, fresh), patience)
    return job_of(answer, kind)


def solve(
    document: Any, kind: str, time_limit: float | None, fresh: bool, timeout: float | None, patience: float
) -> Flow[Result]:
    """The result of a document; a quick one comes with the first answer. All within `timeout` s."""
    begin = time.monotonic()
    seconds, patience = (
        (LONGEST_WAIT, patience) if timeout is None else (min(LONGEST_WAIT, timeout), min(patience, timeout))
    )
    call = replace(question(document, kind, f"wait={int(seconds)}", time_limit, fresh), timeout=timeout)
    answer = yield from accepted(call, patience)
    if answer.status == 200:
        return result_of(read_value(answer.body))
    left = None if timeout is None else timeout - (time.monotonic() - begin)
    return (yield from wait(job_of(answer, kind).id, left, patience))


def wait(job_id: str, timeout: float | None, patience: float) -> Flow[Result]:
    """The result of a job; raises JobFailed, JobDismissed, or WaitedTooLong after `timeout` s."""
    end = None if timeout is None else time.monotonic() + timeout
    patience = patience if timeout is None else max(0.0, min(patience, timeout))
    for seconds in pauses(FIRST_LOOK, LONGEST_LOOK):
        answer = yield from accepted(Call("GET", job_path(job_id)), patience)
        job = read(Job, answer.body)
        if job.is_final:
            return outcome(job)
        seconds = min(seconds, retry_after(answer.headers) or LONGEST_LOOK)
        if end is not None and time.monotonic() + seconds > end:
            raise WaitedTooLong(job_id, timeout or 0.0)
        yield Pause(seconds)
    raise AssertionError("the pauses never end")


def outcome(job: Job) -> Result:
    """The result of a job that is final, or the error it ended with."""
    if job.status == "failed":
        raise JobFailed(job.id, job.problem or problem_from({}))
    if job.status == "dismissed":
        raise JobDismissed(job.id)
    return result_of(job.result)


def look(job_id: str, patience: float) -> Flow[Job]:
    """The job as it is now."""
    answer = yield from accepted(Call("GET", job_path(job_id)), patience)
    return read(Job, answer.body)


def jobs(cursor: str | None, patience: float) -> Flow[JobList]:
    """One page of the jobs."""
    query = f"?{urlencode({'cursor': cursor})}" if cursor else ""
    answer = yield from accepted(Call("GET", f"/v1/jobs{query}"), patience)
    return read(JobList, answer.body)


def cancel(job_id: str, patience: float) -> Flow[None]:
    """Have the work stopped; a job that is final already stays as it is."""
    yield from accepted(Call("DELETE", job_path(job_id)), patience)


def send_batch(lines: bytes, kind: str, time_limit: float | None, patience: float) -> Flow[Batch]:
    """The stored batch of NDJSON lines."""
    path = "/v1/batches" + query_of(time_limit, kind=kind)
    answer = yield from accepted(Call("POST", path, lines, {"Content-Type": NDJSON}), patience)
    return read(Batch, answer.body)


def cancel_batch(batch_id: str, patience: float) -> Flow[Batch]:
    """Have what is open in a batch, and in no other one, stopped."""
    answer = yield from accepted(Call("DELETE", batch_path(batch_id)), patience)
    return read(Batch, answer.body)


def look_at_batch(batch_id: str, patience: float) -> Flow[Batch]:
    """The batch as it is now."""
    answer = yield from accepted(Call("GET", batch_path(batch_id)), patience)
    return read(Batch, answer.body)


def is_final(path: str, patience: float) -> Flow[bool]:
    """Whether the job or batch at an address will not change any more."""
    answer = yield from accepted(Call("GET", path), patience)
    value = read_value(answer.body)
    return isinstance(value, dict) and value.get("status") in FINAL


def fetch(path: str, patience: float, body: Any = None) -> Flow[Any]:
    """Any JSON answer: what was understood, the catalogue, the limits."""
    call = Call("GET", path) if body is None else Call("POST", path, encoded(body), JSON)
    answer = yield from accepted(call, patience)
    return read_value(answer.body)


def question(document: Any, kind: str, prefer: str, time_limit: float | None, fresh: bool) -> Call:
    """The POST of a document; `fresh` asks anew what the service has answered before."""
    headers = {**JSON, "Prefer": prefer, **({"Cache-Control": "no-cache"} if fresh else {})}
    return Call("POST", KINDS[kind] + query_of(time_limit), encoded(document), headers)


def job_of(answer: Answer, kind: str) -> Job:
    """The job that an answer is about: a 202 has its address; a 200 is the result of a finished one."""
    job_id = id_in_location(answer)
    if answer.status == 200:
        return Job(id=job_id, kind=kind, status="successful", result=read_value(answer.body))
    if not job_id:
        raise unexpected("has no address of a job")
    return Job(id=job_id, kind=kind, status="accepted")


def id_in_location(answer: Answer) -> str:
    """The id at the end of the address that an answer names; empty where it names none."""
    return answer.headers.get("location", "").partition("?")[0].rstrip("/").rpartition("/")[2]


def encoded(document: Any) -> bytes:
    """A document as JSON; text and bytes are taken to be JSON already."""
    if isinstance(document, bytes):
        return document
    return document.encode() if isinstance(document, str) else json.dumps(document).encode()


def encoded_lines(documents: Iterable[Mapping[str, Any]]) -> bytes:
    """Documents as NDJSON, one a line."""
    return b"".join(json.dumps(document).encode() + b"\n" for document in documents)


def job_path(job_id: str) -> str:
    """The address of a job."""
    return f"/v1/jobs/{quote(job_id, safe='')}"


def batch_path(batch_id: str) -> str:
    """The address of a batch."""
    return f"/v1/batches/{quote(batch_id, safe='')}"


def catalogue_path(name: str | None) -> str:
    """The address of the catalogue or of one system in it."""
    return "/v1/catalogue" if name is None else f"/v1/catalogue/{quote(name, safe='')}"


def query_of(time_limit: float | None, **more: str) -> str:
    """`?time_limit=S&...`, or nothing."""
    fields = more if time_limit is None else {"time_limit": f"{time_limit:g}", **more}
    return f"?{urlencode(fields)}" if fields else ""
