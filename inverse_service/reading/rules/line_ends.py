r"""The end of a line: what is no part of the last equation, and words in brackets after one."""

from __future__ import annotations

from inverse_service.reading import signs
from inverse_service.reading.rules.sequences import (
    WORD,
    braced,
    either,
    first,
    follows,
    many,
    maybe,
    one,
    sign,
    then,
)
from inverse_service.reading.typed_text import Typed

_CLOSING = many(
    either(
        one("$", ";", ",", ".", "\u00b6", "\\]"),
        then("\\end", braced(WORD, maybe("*"))),
    ),
    None,
    1,
)
_OF_WORDS = sign(lambda text: text == "-" or (text.isascii() and text.isalpha()))
# (kinetic energy)
REMARK = then("(", many(_OF_WORDS, None, 1), ")", follows(lambda text: text == ""))


def without_closing(text: Typed) -> Typed:
    """The text without the signs at its end that are no part of its equation, and without the
    blanks before them.
    """
    line, place = signs.of(text.text), 0
    while place < len(line):
        stop = _CLOSING.match(line, place, [])
        if stop == len(line):
            break
        place = max(stop, place + 1)
    return text[: line[place - 1].stop if place else 0]


def remark_at_end(text: Typed) -> int | None:
    """Where words in brackets begin at the end of a text."""
    found = first(REMARK, text)
    return None if found is None else found.span.start
