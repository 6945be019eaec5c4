"""The blocking client."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from types import TracebackType
from typing import Any, Self, TypeVar

import httpx

from api_schemas.job import Batch, Job, JobList
from api_schemas.problem import CheckAnswer
from api_schemas.result import ResultDocument
from inverse_service.client import flows
from inverse_service.client.calls import LOOK_AGAIN, Answer, Call, Flow, Pause, Repetition
from inverse_service.client.connection import (
    ADDRESS,
    GRACE,
    PATIENCE,
    TIMEOUT,
    Busy,
    checked,
    configuration,
    id_of,
    plain,
    refusal,
    solved,
    unreachable,
)
from inverse_service.client.failures import ServiceUnreachable
from inverse_service.client.reading import BatchAnswer, Event, Result
from inverse_service.client.streams import BatchResults, JobEvents, Lines, Reader

Value = TypeVar("Value")
Item = TypeVar("Item")


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

    def solve(
        self,
        document: Any,
        *,
        time_limit: float | None = None,
        fresh: bool = False,
        timeout: float | None = None,
    ) -> ResultDocument:
        """The result of one system. Raises JobFailed, JobDismissed, or WaitedTooLong after `timeout` s.

        `time_limit` (s) is the service's for the work; `fresh` computes anew what has a stored answer.
        """
        return solved(self._run(flows.solve(document, "solve", time_limit, fresh, timeout, self._patience)))

    def check(self, result: Any, *, timeout: float | None = None) -> CheckAnswer:
        """The independent checker's verdict on a result."""
        return checked(self._run(flows.solve(result, "check", None, False, timeout, self._patience)))

    def simulate(self, scene: Any, *, fresh: bool = False, timeout: float | None = None) -> dict[str, Any]:
        """The result of one scene."""
        return plain(self._run(flows.solve(scene, "simulate", None, fresh, timeout, self._patience)))

    def submit(
        self, document: Any, kind: str = "solve", *, time_limit: float | None = None, fresh: bool = False
    ) -> Job:
        """The stored job of a document, at once; `kind` is solve, check, simulate or work-precision."""
        return self._run(flows.submit(document, kind, time_limit, fresh, self._patience))

    def wait(self, job: Job | str, *, timeout: float | None = None) -> Result:
        """The result of a job. Raises JobFailed, JobDismissed, or WaitedTooLong after `timeout` s."""
        return self._run(flows.wait(id_of(job), timeout, self._patience))

    def job(self, job: Job | str) -> Job:
        """The job as it is now."""
        return self._run(flows.look(id_of(job), self._patience))

    def jobs(self, cursor: str | None = None) -> JobList:
        """One page of the jobs; its `next` is the cursor of the page after it."""
        return self._run(flows.jobs(cursor, self._patience))

    def stream(self, job: Job | str) -> Iterator[Event]:
        """The events of a job as they happen, up to the one that says how it ended."""
        return self._items(JobEvents(id_of(job)))

    def cancel(self, job: Job | str) -> None:
        """Have the work of a job stopped."""
        self._run(flows.cancel(id_of(job), self._patience))

    def batch(
        self, documents: Iterable[Mapping[str, Any]], kind: str = "solve", *, time_limit: float | None = None
    ) -> Iterator[BatchAnswer]:
        """One answer a document, in the order in which they are done; `id` says to which it belongs."""
        batch = self.submit_batch(documents, kind, time_limit=time_limit)
        return self.batch_results(batch)

    def submit_batch(
        self, documents: Iterable[Mapping[str, Any]], kind: str = "solve", *, time_limit: float | None = None
    ) -> Batch:
        """The stored batch of documents, at once."""
        return self._run(flows.send_batch(flows.encoded_lines(documents), kind, time_limit, self._patience))

    def batch_status(self, batch: Batch | str) -> Batch:
        """The batch as it is now: its counts by status."""
        return self._run(flows.look_at_batch(id_of(batch), self._patience))

    def batch_results(self, batch: Batch) -> Iterator[BatchAnswer]:
        """The answers of a batch, those done first and the others as they come."""
        return self._items(BatchResults(batch.id, batch.total))

    def cancel_batch(self, batch: Batch | str) -> Batch:
        """Have what is open in a batch, and in no other one, stopped; the batch as it is then."""
        return self._run(flows.cancel_batch(id_of(batch), self._patience))

    def parse(self, document: Any) -> dict[str, Any]:
        """What the service understands of a document."""
        return dict(self._run(flows.fetch("/v1/parse", self._patience, document)))

    def catalogue(self, name: str | None = None) -> dict[str, Any]:
        """The named systems, or one of them."""
        return dict(self._run(flows.fetch(flows.catalogue_path(name), self._patience)))

    def limits(self) -> dict[str, Any]:
        """Every limit of the service."""
        return dict(self._run(flows.fetch("/v1/limits", self._patience)))

    def _run(self, flow: Flow[Value]) -> Value:
        """Perform what a flow asks for, up to its value."""
        answer: Answer | None = None
        failure: ServiceUnreachable | None = None
        while True:
            try:
                step = flow.throw(failure) if failure is not None else flow.send(answer)
            except StopIteration as end:
                return end.value  # type: ignore[no-any-return]
            answer = failure = None
            if isinstance(step, Pause):
                time.sleep(step.seconds)
                continue
            try:
                answer = self._send(step)
            except httpx.TransportError as error:
                failure = unreachable(error, self._http.base_url)

    def _send(self, call: Call) -> Answer:
        timeout = self._http.timeout if call.timeout is None else httpx.Timeout(call.timeout + GRACE)
        response = self._http.request(
            call.method, call.path, content=call.body, headers=dict(call.headers), timeout=timeout
        )
        return Answer(response.status_code, response.headers, response.content)

    def _items(self, reader: Reader[Item]) -> Iterator[Item]:
        repetition, was_final = Repetition(self._patience), False
        while not reader.done:
            try:
                for item in self._open(reader):
                    repetition.reset()
                    yield item
            except httpx.TransportError as error:
                time.sleep(repetition.pause_after(unreachable(error, self._http.base_url)).seconds)
                continue
            except Busy as busy:
                time.sleep(repetition.pause_after(busy.failure, busy.headers).seconds)
                continue
            if reader.done:
                return
            if was_final:
                reader.close()
                return
            was_final = self._run(flows.is_final(reader.status_path, self._patience))
            time.sleep(0.0 if was_final else LOOK_AGAIN)

    def _open(self, reader: Reader[Item]) -> Iterator[Item]:
        call, lines = reader.call(), Lines()
        with self._http.stream(call.method, call.path, headers=dict(call.headers)) as response:
            if response.status_code != 200:
                raise refusal(response.status_code, response.read(), response.headers)
            for data in response.iter_bytes():
                for line in lines.feed(data):
                    if (item := reader.feed(line)) is not None:
                        yield item
                    if reader.done:
                        return
