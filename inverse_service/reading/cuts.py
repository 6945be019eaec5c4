r"""Parts of a text that are no formula, by their places: the text itself is never changed.

    x'' = -k x   where k is a constant       the cut from "where" on, which a ; replaces
    import numpy as np; x'' = -x             the cut of the first statement, which nothing replaces

Whoever looks for words, statements, or tokens goes through what is `kept_parts`, in its places, so that
every error points to what was written.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True, order=True)
class Cut:
    """The part of a text from `start` to `stop`, the signs that are read in its place, and what
    the reader of the answer is told of it.
    """

    start: int
    stop: int
    sign: str = ""
    notes: tuple[str, ...] = ()


Cuts = tuple[Cut, ...]


def merged(cuts: Iterable[Cut]) -> Cuts:
    """The cuts in their order, each within another one joined to it."""
    found: list[Cut] = []
    for cut in sorted(cuts, key=lambda cut: (cut.start, -cut.stop)):
        last = found[-1] if found else None
        if last is None or cut.start >= last.stop or cut.stop == cut.start:
            found.append(cut)
            continue
        sign = last.sign if cut.stop <= last.stop else last.sign or cut.sign
        found[-1] = replace(
            last, stop=max(last.stop, cut.stop), sign=sign, notes=(*last.notes, *cut.notes)
        )
    return tuple(found)


def kept_parts(
    text: str, cuts: Sequence[Cut], start: int = 0, stop: int | None = None
) -> Iterator[tuple[int, int, Cut | None]]:
    """(start, stop, the cut after it) of each part between the cuts."""
    last = len(text) if stop is None else stop
    for cut in cuts:
        if cut.stop <= start or cut.start >= last:
            continue
        yield start, max(start, cut.start), cut
        start = cut.stop
    yield start, max(start, last), None


def text_between_cuts(
    text: str, cuts: Sequence[Cut], start: int = 0, stop: int | None = None
) -> str:
    """What is kept of a part, to be looked at or shown."""
    return " ".join(text[begin:end] for begin, end, _ in kept_parts(text, cuts, start, stop))
