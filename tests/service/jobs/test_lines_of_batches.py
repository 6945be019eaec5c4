"""The lines of a batch: the longest one, numbers, ids, and what stands between them."""

from __future__ import annotations

import io

import pytest

from inverse_service.errors import InputError
from inverse_service.service.jobs import batch

MOST = 40


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "MAX_LINE_BYTES", MOST)
    monkeypatch.setattr(batch, "MOST_BLANK", 3)


def line_of(size: int) -> bytes:
    """A line of so many bytes, its end not counted."""
    head, tail = b'{"equations": "', b'"}'
    return head + b"x" * (size - len(head) - len(tail)) + tail


def read(body: bytes) -> list[batch.Line]:
    return [*batch.read_lines(io.BytesIO(body))]


@pytest.mark.parametrize("end", [b"", b"\n"], ids=["at the end", "before others"])
def test_a_line_of_the_most_bytes_is_read_and_a_longer_one_is_not(end: bytes) -> None:
    (longest,) = read(line_of(MOST) + end)
    assert longest.fault is None
    assert longest.document is not None
    (longer,) = read(line_of(MOST + 1) + b"}" + end)
    assert longer.document is None
    assert longer.fault is not None
    assert str(MOST) in longer.fault.detail


@pytest.mark.parametrize("size", [MOST + 2, 2 * MOST, 2 * MOST + 1, 5 * MOST])
def test_what_follows_a_long_line_keeps_its_number(size: int) -> None:
    found = read(line_of(10_000)[:size] + b"\n" + line_of(20) + b"\n\n" + line_of(20))
    assert [line.number for line in found] == [1, 2, 4]
    assert [line.fault is None for line in found] == [False, True, True]
    assert [line.identifier for line in found] == [None, 2, 4]


def test_so_many_blank_lines_are_passed_over_and_more_are_refused() -> None:
    (found,) = read(b"\n" * 3 + line_of(20))
    assert found.number == 4
    assert len(read(b"\n" * 3 + line_of(20) + b"\n" * 4 + line_of(20))) == 2
    with pytest.raises(InputError, match="blank lines in a row"):
        read(b"\n" * 4 + line_of(20))


def test_an_id_that_was_used_names_the_line_that_used_it() -> None:
    found = read(b'{"id": 2}\n{"id": "a"}\n{"id": "a"}\n{"x": 1}')
    assert [line.duplicate_of for line in found] == [None, None, 2, None]
    found = read(b'{"x": 1}\n{"id": 1}')
    assert [line.duplicate_of for line in found] == [None, 1]  # the first has its number


@pytest.mark.parametrize(
    ("given", "is_good"),
    [("1", True), ('"a"', True), (f'"{"a" * 200}"', True), (f'"{"a" * 201}"', False), ("true", False),
     ("1.5", False), ("null", False), ("[1]", False)],
)  # fmt: skip
def test_an_id_is_a_short_text_or_a_whole_number(
    monkeypatch: pytest.MonkeyPatch, given: str, is_good: bool
) -> None:
    monkeypatch.setattr(batch, "MAX_LINE_BYTES", 1_000)
    (found,) = read(b'{"id": %s, "x": 1}' % given.encode())
    assert (found.fault is None) is is_good


def test_too_many_lines_are_refused_and_as_many_as_may_be_are_not() -> None:
    body = b"1\n\n2\n3"
    assert batch.numbers_of(body, 3) == [1, 3, 4]
    with pytest.raises(InputError, match="more than 2 lines"):
        batch.numbers_of(body, 2)
    with pytest.raises(InputError, match="empty"):
        batch.numbers_of(b"\n\n", 3)
