"""What can go wrong between a client and the service; each error carries what the service said."""

from __future__ import annotations

from api_schemas.problem import ProblemDocument
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
