r"""The signs of a text with their spans, before anything in it is read: words, numbers, commands.

Rules about whole statements, as \mathcal{L} = ..., ds^2 = ..., and d/dt dL/dx' - dL/dx = 0, are
rules over signs (`reading.rules`): a line end is the sign ¶, and blanks, \left, and \, of the text
are no signs. What a rule finds is a span of signs, and so a span of the text; no text is too wrong
to have signs.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cached_property, lru_cache
from typing import NamedTuple

from inverse_service.reading.typed_text import Typed

_SIGN = re.compile(
    r"(?P<nothing>[^\S\n]+|\\[,;:! ]|~|\\(?:left|right|[bB]igg?[lrm]?)(?![A-Za-z])|&(?!&))"
    r"|\\[A-Za-z]+|\\.|[^\W\d_\u00b2\u00b3]+[0-9]*|[0-9]+(?:\.[0-9]+)?|['\u2032]+|.",
    re.DOTALL,
)
LINE_END = "\u00b6"
_OPENING, _CLOSING = ("(", "[", "{"), (")", "]", "}")


class Span(NamedTuple):
    """The place of signs in a text."""

    start: int
    stop: int


class Frame(NamedTuple):
    r"""The \boxed{ before a formula, and the } after it."""

    before: Span
    after: Span


class Sign(NamedTuple):
    """One sign of a text with its span; `glued` if nothing is between the sign before it and it."""

    text: str
    start: int
    stop: int
    glued: bool = False

    def is_name(self) -> bool:
        """Whether it begins as a name of a program does: with a letter of ASCII."""
        return self.text[:1].isascii() and self.text[:1].isalpha()


_BEYOND = Sign("", 0, 0)


class Line(tuple[Sign, ...]):
    """The signs of a text in their order."""

    @cached_property
    def texts(self) -> frozenset[str]:
        return frozenset(sign.text for sign in self)

    def at(self, place: int) -> Sign:
        """The sign at this place; one without a text beyond either end."""
        return self[place] if 0 <= place < len(self) else _BEYOND

    def says(self, place: int, *texts: str) -> bool:
        """Whether the signs from this place on have these texts."""
        return all(self.at(place + k).text == text for k, text in enumerate(texts))


def _line(text: str) -> Iterator[Sign]:
    end = 0
    for one in _SIGN.finditer(text):
        if one["nothing"] is None:
            start, stop = one.span()
            yield Sign(LINE_END if one[0].isspace() else one[0], start, stop, start == end > 0)
            end = stop


@lru_cache(maxsize=64)
def of(text: str) -> Line:
    """The signs of a text."""
    return Line(_line(text))


@lru_cache(maxsize=64)
def with_whole_names(text: str) -> Line:
    r"""The signs of a text in which x_dot, a1b, and \tau_0 are one sign each, as in a program."""
    found: list[Sign] = []
    for sign in of(text):
        last = found[-1] if found else _BEYOND
        if sign.glued and _is_of_name(sign.text) and _is_of_name(last.text.lstrip("\\")):
            found[-1] = last._replace(text=last.text + sign.text, stop=sign.stop)
        else:
            found.append(sign)
    return Line(found)


def _is_of_name(text: str) -> bool:
    return text[:1].isalnum() or text[:1] == "_"


def sides(text: Typed) -> list[Typed]:
    """The parts of a text between the = that no bracket holds."""
    found, start, depth = list[Typed](), 0, 0
    for sign in of(text.text):
        depth += (sign.text in _OPENING) - (sign.text in _CLOSING)
        if sign.text == "=" and depth <= 0:
            found.append(text[start : sign.start])
            start = sign.stop
    return [*found, text[start:]]


class Halves(NamedTuple):
    """What is before the first = that no bracket holds, and what is after it."""

    left: Typed
    right: Typed


def halves(text: Typed) -> Halves:
    left = sides(text)[0]
    return Halves(left, text[len(left.text) + 1 :])


def trimmed(text: Typed) -> Typed:
    """The text from its first sign to its last one."""
    line = of(text.text)
    return text[line[0].start : line[-1].stop] if line else text[:0]


def words(text: Typed) -> list[str]:
    """The signs of a text, without what separates them."""
    return [sign.text for sign in of(text.text)]


def beginning(text: Typed, after: int, start: int, stop: int) -> int:
    """Where an equation begins that takes the place from `start` to `stop`, and closes a bracket
    that is opened before: at the { of {\\dot x} = v, and at the Eq of Eq(x'', -x), which come after
    the place `after`.
    """
    opened: list[Sign] = []
    for sign in of(text.text):
        if not after <= sign.start < stop:
            continue
        if sign.text in (*_OPENING, "\\["):  # of Mathematica's \[Theta], too
            opened.append(sign)
        elif sign.text == "\\]":
            opened = opened[:-1]
        elif sign.text in _CLOSING and opened:
            first = opened.pop()
            if sign.start >= start > first.start:
                start = first.start if sign.text == "}" else after
    return start


def ends_apart(text: Typed, place: int) -> bool:
    """Whether a blank, or another part that is no sign, stands before a place of a text."""
    return all(sign.stop < place for sign in of(text.text) if sign.start < place)


def frames(text: str, command: str) -> list[Frame]:
    r"""What each \boxed{...} frames."""
    found, opened, last = list[Frame](), list[Sign | None](), _BEYOND
    for sign in of(text):
        if sign.text == "{":
            opened.append(last if last.text == command else None)
        elif sign.text == "}" and opened and (frame := opened.pop()) is not None:
            brace = text.index("{", frame.stop) + 1
            found.append(Frame(Span(frame.start, brace), Span(sign.start, sign.stop)))
        last = sign
    return found
