"""Notes for the reader of an answer: what was left out of a text, or read differently from how it is written."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_NOTES: ContextVar[dict[str, str] | None] = ContextVar("notes", default=None)
LEFT_OUT, UNUSED = "left out", "a vector that is not used"


@contextmanager
def noted() -> Iterator[dict[str, str]]:
    """Collect texts that are interpreted differently from how they were typed (kx as k*x), and omitted lines."""
    notes: dict[str, str] = {}
    mark = _NOTES.set(notes)
    try:
        yield notes
    finally:
        _NOTES.reset(mark)


def note(text: str, meant: str = LEFT_OUT) -> None:
    """Record for the caller of `noted` that a text was interpreted as another."""
    if (notes := _NOTES.get()) is not None:
        notes[text] = meant
