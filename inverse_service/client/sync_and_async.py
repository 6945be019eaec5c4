"""The blocking and the asynchronous client: the same flows, performed with and without waiting."""

from __future__ import annotations

import asyncio
import inspect
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Iterator, Mapping
from types import TracebackType
from typing import Any, Concatenate, Final, ParamSpec, Self, TypedDict, TypeVar

import httpx

from api_schemas.job import Batch, Job
from inverse_service import __version__
from inverse_service.client import flows
from inverse_service.client.decoding import BatchAnswer, ClientError, Event, ServiceUnreachable
from inverse_service.client.flows import BatchResults, JobEvents
from inverse_service.client.requests import Answer, Call, Flow, Item, Open, Pause

ADDRESS: Final = "http://127.0.0.1:8000"
TIMEOUT: Final = 60.0
PATIENCE: Final = 30.0
# What an answer may take beyond the time that its caller waits, s.
GRACE: Final = 1.0
P = ParamSpec("P")
Value = TypeVar("Value")
Method = Callable[Concatenate[float, P], Flow[Value]]


class Configuration(TypedDict):
    """The arguments of an httpx client."""

    base_url: str
    headers: dict[str, str]
    timeout: float


def configuration(address: str, api_key: str | None, timeout: float) -> Configuration:
    """Raises ClientError where the address is none."""
    if not address.startswith(("http://", "https://")):
        raise ClientError("The address of the service must begin with http:// or https://.")
    headers = {"User-Agent": f"inverse-service-client/{__version__}", "Accept": "application/json, */*;q=0.5"}
    if api_key is not None:
        headers["Authorization"] = f"Bearer {api_key}"
    return {"base_url": address, "headers": headers, "timeout": timeout}


def blocking(flow: Method[P, Value]) -> Callable[Concatenate[Client, P], Value]:
    """The method of the blocking client that performs a flow."""

    def method(self: Client, /, *arguments: P.args, **options: P.kwargs) -> Value:
        [value] = self._items(_told(flow(self._patience, *arguments, **options)))
        return value  # type: ignore[no-any-return]

    return _described(method, flow)


def awaited(flow: Method[P, Value]) -> Callable[Concatenate[AsyncClient, P], Coroutine[Any, Any, Value]]:
    """The method of the asynchronous client that performs a flow."""

    async def method(self: AsyncClient, /, *arguments: P.args, **options: P.kwargs) -> Value:
        [value] = [item async for item in self._items(_told(flow(self._patience, *arguments, **options)))]
        return value  # type: ignore[no-any-return]

    return _described(method, flow)


def _told(flow: Flow[Value]) -> Flow[None]:
    """The flow, with its value as its last Item."""
    yield Item((yield from flow))


F = TypeVar("F", bound=Callable[..., Any])


def _described(method: F, flow: Callable[..., Any]) -> F:
    """With the name, the help and the arguments of the flow, whose first one is the client's."""
    own = inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    arguments = list(inspect.signature(flow).parameters.values())[1:]
    method.__name__, method.__doc__ = flow.__name__, flow.__doc__
    method.__signature__ = inspect.Signature([own, *arguments])  # type: ignore[attr-defined]
    return method


def _timeout(call: Call, usual: httpx.Timeout) -> httpx.Timeout:
    return usual if call.timeout is None else httpx.Timeout(call.timeout + GRACE)


def _unreachable(error: httpx.RequestError, address: httpx.URL) -> ServiceUnreachable:
    """httpx's error in one sentence."""
    if isinstance(error, httpx.TimeoutException):
        return ServiceUnreachable(f"The service at {address} did not answer in time.")
    if isinstance(error, httpx.ConnectError):
        return ServiceUnreachable(f"There is no service at {address}; is it started, and is the port right?")
    return ServiceUnreachable(f"The connection to the service at {address} broke ({type(error).__name__}).")


class Client:
    """The service at an address; safe to use from several threads; close it or use it in a `with`.

    `timeout` (s) bounds one request, `patience` (s) how long a busy or absent service is asked again.
    Every method raises RequestRefused, ServiceBusy, ServiceUnreachable or UnexpectedAnswer.
    """

    def __init__(
        self,
        address: str = ADDRESS,
        *,
        api_key: str | None = None,
        timeout: float = TIMEOUT,
        patience: float = PATIENCE,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self._http = httpx.Client(**configuration(address, api_key, timeout), transport=transport)
        self._patience = patience

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    solve = blocking(flows.solve)
    check = blocking(flows.check)
    simulate = blocking(flows.simulate)
    submit = blocking(flows.submit)
    wait = blocking(flows.wait)
    job = blocking(flows.job)
    jobs = blocking(flows.jobs)
    cancel = blocking(flows.cancel)
    submit_batch = blocking(flows.submit_batch)
    batch_status = blocking(flows.batch_status)
    cancel_batch = blocking(flows.cancel_batch)
    parse = blocking(flows.parse)
    catalogue = blocking(flows.catalogue)
    limits = blocking(flows.limits)

    def stream(self, job: Job | str) -> Iterator[Event]:
        """The events of a job as they happen, up to the one that says how it ended."""
        return self._items(flows.items(self._patience, JobEvents(job)))

    def batch(
        self, documents: Iterable[Mapping[str, Any]], kind: str = "solve", *, time_limit: float | None = None
    ) -> Iterator[BatchAnswer]:
        """One answer a document, in the order in which they are done; `id` says to which it belongs."""
        return self.batch_results(self.submit_batch(documents, kind, time_limit=time_limit))

    def batch_results(self, batch: Batch) -> Iterator[BatchAnswer]:
        """The answers of a batch, those done first and the others as they come."""
        return self._items(flows.items(self._patience, BatchResults(batch)))

    def _items(self, flow: Flow[None]) -> Iterator[Any]:
        """Perform what a flow asks for; what it has for the caller."""
        response: httpx.Response | None = None
        parts: Iterator[bytes] = iter(())
        found: Answer | bytes | None = None
        failure: ServiceUnreachable | None = None
        try:
            while True:
                try:
                    step = flow.send(found) if failure is None else flow.throw(failure)
                except StopIteration:
                    return
                found = failure = None
                try:
                    if isinstance(step, Pause):
                        time.sleep(step.seconds)
                    elif isinstance(step, Item):
                        yield step.value
                    elif isinstance(step, Open):
                        if response is not None:
                            response.close()
                        response = self._sent(step.call)
                        parts, found = response.iter_bytes(), Answer(response.status_code, response.headers)
                    else:
                        found = next(parts, b"")
                except httpx.RequestError as error:
                    failure = _unreachable(error, self._http.base_url)
        finally:
            if response is not None:
                response.close()

    def _sent(self, call: Call) -> httpx.Response:
        timeout = _timeout(call, self._http.timeout)
        request = self._http.build_request(
            call.method, call.path, content=call.body, headers=dict(call.headers), timeout=timeout
        )
        return self._http.send(request, stream=True)


class AsyncClient:
    """The same methods, to be awaited; close it or use it in an `async with`."""

    def __init__(
        self,
        address: str = ADDRESS,
        *,
        api_key: str | None = None,
        timeout: float = TIMEOUT,
        patience: float = PATIENCE,
        transport: httpx.AsyncBaseTransport | None = None,
    ) -> None:
        self._http = httpx.AsyncClient(**configuration(address, api_key, timeout), transport=transport)
        self._patience = patience

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    solve = awaited(flows.solve)
    check = awaited(flows.check)
    simulate = awaited(flows.simulate)
    submit = awaited(flows.submit)
    wait = awaited(flows.wait)
    job = awaited(flows.job)
    jobs = awaited(flows.jobs)
    cancel = awaited(flows.cancel)
    submit_batch = awaited(flows.submit_batch)
    batch_status = awaited(flows.batch_status)
    cancel_batch = awaited(flows.cancel_batch)
    parse = awaited(flows.parse)
    catalogue = awaited(flows.catalogue)
    limits = awaited(flows.limits)

    def stream(self, job: Job | str) -> AsyncIterator[Event]:
        """The events of a job as they happen, up to the one that says how it ended."""
        return self._items(flows.items(self._patience, JobEvents(job)))

    async def batch(
        self, documents: Iterable[Mapping[str, Any]], kind: str = "solve", *, time_limit: float | None = None
    ) -> AsyncIterator[BatchAnswer]:
        """One answer a document, in the order in which they are done; `id` says to which it belongs."""
        async for answer in self.batch_results(await self.submit_batch(documents, kind, time_limit=time_limit)):
            yield answer

    def batch_results(self, batch: Batch) -> AsyncIterator[BatchAnswer]:
        """The answers of a batch, those done first and the others as they come."""
        return self._items(flows.items(self._patience, BatchResults(batch)))

    async def _items(self, flow: Flow[None]) -> AsyncIterator[Any]:
        """Perform what a flow asks for; what it has for the caller."""
        response: httpx.Response | None = None
        parts: AsyncIterator[bytes] | None = None
        found: Answer | bytes | None = None
        failure: ServiceUnreachable | None = None
        try:
            while True:
                try:
                    step = flow.send(found) if failure is None else flow.throw(failure)
                except StopIteration:
                    return
                found = failure = None
                try:
                    if isinstance(step, Pause):
                        await asyncio.sleep(step.seconds)
                    elif isinstance(step, Item):
                        yield step.value
                    elif isinstance(step, Open):
                        if response is not None:
                            await response.aclose()
                        response = await self._sent(step.call)
                        parts, found = response.aiter_bytes(), Answer(response.status_code, response.headers)
                    else:
                        found = b"" if parts is None else await anext(parts, b"")
                except httpx.RequestError as error:
                    failure = _unreachable(error, self._http.base_url)
        finally:
            if response is not None:
                await response.aclose()

    async def _sent(self, call: Call) -> httpx.Response:
        timeout = _timeout(call, self._http.timeout)
        request = self._http.build_request(
            call.method, call.path, content=call.body, headers=dict(call.headers), timeout=timeout
        )
        return await self._http.send(request, stream=True)
