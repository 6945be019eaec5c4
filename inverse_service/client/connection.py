"""What the two clients have in common: where they connect to, and how httpx's errors are told."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, TypedDict

import httpx

from api_schemas.job import Batch, Job
from api_schemas.problem import CheckAnswer
from api_schemas.result import ResultDocument
from inverse_service import __version__
from inverse_service.client.calls import BUSY
from inverse_service.client.failures import ClientError, RequestRefused, ServiceBusy, ServiceUnreachable
from inverse_service.client.reading import Result, problem_of, unexpected

ADDRESS: Final = "http://127.0.0.1:8000"
TIMEOUT: Final = 60.0
PATIENCE: Final = 30.0
# What an answer may take beyond the time that its caller waits, s.
GRACE: Final = 1.0


class Configuration(TypedDict):
    """The arguments of an httpx client."""

    base_url: str
    headers: dict[str, str]
    timeout: float


class Busy(Exception):
    """A stream that could not be opened now; `headers` may say when it can."""

    def __init__(self, failure: ServiceBusy, headers: Mapping[str, str]) -> None:
        super().__init__(failure.detail)
        self.failure, self.headers = failure, headers


def configuration(address: str, api_key: str | None, timeout: float) -> Configuration:
    """Raises ClientError where the address is none."""
    if not address.startswith(("http://", "https://")):
        raise ClientError("The address of the service must begin with http:// or https://.")
    headers = {"User-Agent": f"inverse-service-client/{__version__}", "Accept": "application/json, */*;q=0.5"}
    if api_key is not None:
        headers["Authorization"] = f"Bearer {api_key}"
    return {"base_url": address, "headers": headers, "timeout": timeout}


def unreachable(error: httpx.TransportError, address: httpx.URL) -> ServiceUnreachable:
    """httpx's error in one sentence."""
    if isinstance(error, httpx.TimeoutException):
        return ServiceUnreachable(f"The service at {address} did not answer in time.")
    if isinstance(error, httpx.ConnectError):
        return ServiceUnreachable(f"There is no service at {address}; is it started, and is the port right?")
    return ServiceUnreachable(f"The connection to the service at {address} broke ({type(error).__name__}).")


def refusal(status: int, body: bytes, headers: Mapping[str, str]) -> Exception:
    """Why a stream did not open: Busy, or RequestRefused for good."""
    problem = problem_of(status, body)
    return Busy(ServiceBusy(status, problem), headers) if status in BUSY else RequestRefused(status, problem)


def id_of(what: Job | Batch | str) -> str:
    """The id of a job or batch that is given as itself or by its id."""
    return what if isinstance(what, str) else what.id


def solved(result: Result) -> ResultDocument:
    """The result of a system; raises UnexpectedAnswer for another one."""
    if not isinstance(result, ResultDocument):
        raise unexpected("is not the result of a system")
    return result


def checked(result: Result) -> CheckAnswer:
    """The verdict of the checker; raises UnexpectedAnswer for another answer."""
    if not isinstance(result, CheckAnswer):
        raise unexpected("is not a verdict of the checker")
    return result


def plain(result: Result) -> dict[str, Any]:
    """A result as an object."""
    return result if isinstance(result, dict) else result.model_dump(mode="json")
