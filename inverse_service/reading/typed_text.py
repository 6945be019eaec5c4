"""Parts of texts that know where they were typed, so that a text can be cut, joined, and changed
while errors keep pointing to what its writer wrote.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

from inverse_service import errors


class Change(NamedTuple):
    """What is read in the place of a part of a text, from `start` to before `stop`."""

    start: int
    stop: int
    new: Typed | str


@dataclass(frozen=True, slots=True)
class Typed:
    """A text, and for each of its characters, and for its end, the pointer and the column at which
    it was typed.
    """

    text: str
    places: tuple[tuple[str, int], ...]

    @classmethod
    def of(cls, text: str, pointer: str) -> Typed:
        """A whole text of a document."""
        return cls(text, tuple((pointer, column) for column in range(1, len(text) + 2)))

    @property
    def pointer(self) -> str:
        return self.places[0][0]

    def __getitem__(self, part: slice) -> Typed:
        start, stop, _ = part.indices(len(self.text))
        return Typed(self.text[start:stop], self.places[start : max(start, stop) + 1])

    def __add__(self, other: Typed) -> Typed:
        return Typed(self.text + other.text, (*self.places[:-1], *other.places))

    def made(self, text: str, at: int = 0) -> Typed:
        """Another text in the place of the character `at`."""
        return Typed(text, (self.places[at],) * (len(text) + 1))

    def or_blank(self) -> Typed:
        """The text, or a blank in its place if it is empty, for documents without empty texts."""
        return self if self.text else self.made(" ")

    def strip(self) -> Typed:
        """The text without the blanks around it."""
        start = len(self.text) - len(self.text.lstrip())
        return self[start : max(start, len(self.text.rstrip()))]

    def in_brackets(self, opening: str = "(") -> Typed:
        """The text in brackets that it does not have yet."""
        return self.made(opening) + self + self.made(")", -1)

    def put(self, changes: Iterable[Change]) -> Typed:
        """The text with each of these parts replaced; a new text has the place of its part."""
        parts, end = list[Typed](), 0
        for start, stop, new in sorted(changes, key=lambda change: change.start):
            typed = self.made(new, start) if isinstance(new, str) else new
            parts += [self[end:start], typed]
            end = stop
        last = self[end:]
        places = [place for part in parts for place in part.places[:-1]]
        text = "".join(part.text for part in parts) + last.text
        return Typed(text, (*places, *last.places))

    def error(self, error: errors.InputError) -> errors.InputError:
        """The error about this text at the place where the text was typed."""
        if error.column is None:
            return error.placed(self.pointer)
        pointer, column = self._place(error.column)
        detail = error.detail.replace(f" at column {error.column}", f" at column {column}", 1)
        span = None
        if error.span is not None:
            (first, start), (last, stop) = map(self._place, error.span)
            span = (start, stop) if first == last == pointer else None
        return error.moved(detail, pointer, column, span)

    def _place(self, column: int) -> tuple[str, int]:
        return self.places[min(max(column, 1), len(self.places)) - 1]

    @contextmanager
    def placed(self) -> Iterator[None]:
        """Errors about this text that are raised inside point to where it was typed."""
        try:
            yield
        except errors.InputError as error:
            raise self.error(error) from None


class Columns(NamedTuple):
    """The columns of the first sign of a part and after its last one."""

    first: int
    after: int


def columns_of(text: str) -> Columns:
    """Those of a text without the blanks around it."""
    return Columns(len(text) - len(text.lstrip()) + 1, len(text.rstrip()) + 1)
