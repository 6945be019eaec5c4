"""From the bytes of an answer to typed documents.

Fields that this version does not know are left out, so a client outlives an update of the service.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import ValidationError

from api_schemas.base import CheckAnswer, Document, ProblemDocument
from api_schemas.result import FORMAT, ResultDocument
from inverse_service.errors import InverseServiceError


class ClientError(InverseServiceError):
    """Root of the client's errors; `problem` is the problem document (RFC 9457) where there is one."""

    code = "client"

    def __init__(self, detail: str, problem: ProblemDocument | None = None) -> None:
        super().__init__(detail)
        self.problem = problem


class RequestRefused(ClientError):
    """The service refused the request: `problem.errors` names the places, `status` is the HTTP status."""

    code = "request-refused"

    def __init__(self, status: int, problem: ProblemDocument) -> None:
        super().__init__(_sentence(problem), problem)
        self.status = status


class ServiceBusy(RequestRefused):
    """429 or 503 for longer than the client's patience."""

    code = "service-busy"
    retry = True


class ServiceUnreachable(ClientError):
    """No connection, or none that lasted, for longer than the client's patience."""

    code = "service-unreachable"
    retry = True


class UnexpectedAnswer(ClientError):
    """The answer is not one of this service, or of another version of it."""

    code = "unexpected-answer"


class JobFailed(RequestRefused):
    """The job ended without a result: its document was refused, or the program failed on it."""

    code = "job-failed"

    def __init__(self, job_id: str, problem: ProblemDocument) -> None:
        super().__init__(problem.status, problem)
        self.job_id = job_id


class JobDismissed(ClientError):
    """The job was cancelled."""

    code = "job-dismissed"

    def __init__(self, job_id: str) -> None:
        super().__init__(f"Job {job_id} was cancelled; submit the document again to have it solved.")
        self.job_id = job_id


class WaitedTooLong(ClientError):
    """The job is still open after the time that the caller gave it; it goes on in the service."""

    code = "waited-too-long"
    retry = True

    def __init__(self, job_id: str, seconds: float) -> None:
        super().__init__(f"Job {job_id} is still open after {seconds:g} s; wait for it again, or cancel it.")
        self.job_id = job_id


def _sentence(problem: ProblemDocument) -> str:
    place = problem.errors[0] if problem.errors else None
    if place is None or not place.pointer:
        return problem.detail
    column = f", column {place.column}" if place.column is not None else ""
    return f"{place.pointer}{column}: {problem.detail}"


Model = TypeVar("Model", bound=Document)
Result = ResultDocument | CheckAnswer | dict[str, Any]


@dataclass(frozen=True, slots=True)
class Event:
    """One event of a job: `kind` such as progress, `data` such as the stage and its counts."""

    kind: str
    data: dict[str, Any]
    id: str = ""


@dataclass(frozen=True, slots=True)
class BatchAnswer:
    """The answer to one line of a batch: `result`, or the `problem` of a line that has none."""

    id: str | int | None
    line: int | None
    result: Result | None = None
    problem: ProblemDocument | None = None


def read(model: type[Model], body: bytes) -> Model:
    """The document in a body; raises UnexpectedAnswer."""
    try:
        return model.model_validate_json(body, extra="ignore")
    except ValidationError as error:
        raise unexpected(f"is no {model.__name__} ({error.error_count()} faults)") from None


def read_value(body: bytes) -> Any:
    """The JSON value of a body; raises UnexpectedAnswer."""
    try:
        return json.loads(body)
    except (ValueError, RecursionError):
        raise unexpected("is not JSON") from None


def unexpected(what: str) -> UnexpectedAnswer:
    """The error of an answer that is not what it should be."""
    return UnexpectedAnswer(f"The answer {what}; is the address that of this service, and its version that of this?")


def result_of(value: Any) -> Result:
    """A result as its type: what solves, what checks, or an object as it came (a simulation)."""
    if not isinstance(value, dict):
        raise unexpected("is not a result")
    if value.get("format") == FORMAT:
        return read(ResultDocument, json.dumps(value).encode())
    if {"verdict", "reasons"} <= set(value) <= set(CheckAnswer.model_fields):
        return read(CheckAnswer, json.dumps(value).encode())
    return value


def problem_of(status: int, body: bytes) -> ProblemDocument:
    """The problem document of a body; one that says so where the body is none (a proxy in between)."""
    value = None
    with contextlib.suppress(ValueError, RecursionError):
        value = json.loads(body)
    if isinstance(value, dict):
        return problem_from(value, status)
    return problem_from({"detail": f"The service answered with status {status} and no explanation."}, status)


def problem_from(value: Mapping[str, Any], status: int = 0) -> ProblemDocument:
    """A problem document from an object that may lack some of its fields."""
    whole = {"type": "about:blank", "title": "", "status": status, "detail": "No explanation was given."}
    whole.update(value)
    try:
        return ProblemDocument.model_validate(whole, extra="ignore")
    except ValidationError:
        return ProblemDocument(type="about:blank", title="", status=status, detail="No explanation was given.")


def batch_answer(line: str) -> BatchAnswer:
    """One line of a batch's results; raises UnexpectedAnswer."""
    value = read_value(line.encode())
    if not isinstance(value, dict) or "id" not in value:
        raise unexpected("has a line without an id")
    identifier, number = value.pop("id"), value.pop("line", None)
    if "format" in value or "verdict" in value:
        return BatchAnswer(identifier, number, result=result_of(value))
    problem = value.get("error", value)
    return BatchAnswer(identifier, number, problem=problem_from(problem if isinstance(problem, dict) else {}))


class EventReader:
    """Server-sent events (the WHATWG format) from their lines; comments and unknown fields are skipped."""

    def __init__(self, last_id: str = "") -> None:
        self.last_id = self._id = last_id
        self._kind, self._data = "", list[str]()

    def feed(self, line: str) -> Event | None:
        """The event that this line ends, if it ends one."""
        if not line:
            return self._end()
        name, _, value = line.partition(":")
        value = value.removeprefix(" ")
        if name == "event":
            self._kind = value
        elif name == "data":
            self._data.append(value)
        elif name == "id" and "\0" not in value:
            self._id = value
        return None

    def _end(self) -> Event | None:
        kind, text = self._kind or "message", "\n".join(self._data)
        self._kind, self._data = "", []
        self.last_id = self._id  # an event that broke off was not had
        if not text:
            return None
        value = read_value(text.encode())
        return Event(kind, value if isinstance(value, dict) else {"value": value}, self.last_id)
