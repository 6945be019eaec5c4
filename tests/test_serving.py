"""In tests, a busy machine answers late and not otherwise."""

from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock

import httpx
import pytest

from inverse_service.web import engine
from tests import serving

BUSY = httpx.Response(503, text=f"problem: {engine.BUSY}")
PARTIAL = httpx.Response(202, text="what is known by now")
WHOLE = httpx.Response(200, text="the answer")


@contextmanager
def answering(*responses: httpx.Response) -> Iterator[mock.Mock]:
    """A service that gives these answers one after the other, to calls that wait for it."""
    given = mock.Mock(side_effect=responses)
    with (
        mock.patch.object(httpx.HTTPTransport, "handle_request", given),
        mock.patch.object(serving.time, "sleep"),
        serving.waiting(),
    ):
        yield given


@pytest.mark.parametrize("late", [BUSY, PARTIAL])
def test_a_call_that_waits_gets_the_whole_answer(late: httpx.Response) -> None:
    with answering(late, late, WHOLE) as asked:
        found = httpx.post("http://localhost/v1/solve", headers={"Prefer": "wait=20"})
    assert (found.status_code, asked.call_count) == (200, 3)


@pytest.mark.parametrize(
    "headers",
    [{}, {"Prefer": "wait=0"}, {"Prefer": "wait=20", "Cache-Control": "no-cache"}],
)
def test_a_call_that_does_not_wait_is_answered_at_once(headers: dict[str, str]) -> None:
    """An answer that is to be fresh would be computed again by another call."""
    with answering(PARTIAL, WHOLE) as asked:
        found = httpx.post("http://localhost/v1/solve", headers=headers)
    assert (found.status_code, asked.call_count) == (202, 1)
