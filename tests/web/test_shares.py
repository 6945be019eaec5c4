"""What clients hold at a time: exactly as much as is allowed, of one and of all."""

from __future__ import annotations

from contextlib import ExitStack

import pytest

from inverse_service.service.jobs import model
from inverse_service.web.clients import Shares
from inverse_service.web.problems import Refusal


def test_a_client_holds_as_much_as_is_allowed_and_no_more() -> None:
    shares = Shares(total=5, of_a_client=3, much="enough")
    with ExitStack() as held:
        for size in (1, 2):
            held.enter_context(shares.hold("a", size))
        with pytest.raises(Refusal) as refused, shares.hold("a", 1):
            raise AssertionError
        assert (refused.value.status, refused.value.detail) == (429, "enough")
        take = held.enter_context(shares.hold("b"))
        assert take(2) == 2
        with pytest.raises(Refusal) as refused:  # there is no more, for whomever
            take(1)
        assert refused.value.status == 503
    assert len(shares) == 0


@pytest.mark.parametrize(
    ("waiting", "asks", "room"),
    [
        ({}, "ab", 3),
        ({"a": 2}, "a", 1),
        ({"a": 2}, "b", 3),
        ({"a": 2}, "ab", 1),  # a batch of both has room where both have
        ({"a": 1, "b": 3}, "ab", 0),
        ({"a": 1, "c": 6}, "ab", 1),
    ],
)
def test_the_room_for_jobs_is_that_of_the_client_who_has_least(
    waiting: dict[str, int], asks: str, room: int
) -> None:
    assert model.Bounds(total=8, client=3).room(waiting, [*asks]) == room
