r"""The signs of a text with their spans, before anything in it is read: words, numbers, commands.

Rules about whole statements, as \mathcal{L} = ..., ds^2 = ..., and d/dt dL/dx' - dL/dx = 0, are
patterns over signs, the rows `signs` of `patterns.toml`: each sign stands between single blanks,
a line end is ¶, and blanks, \left, and \, of the text are no signs. What a rule finds is a span of
signs, and so a span of the text; no text is too wrong to have signs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import NamedTuple

from inverse_service.reading import components
from inverse_service.reading.names import pattern
from inverse_service.reading.typed_text import Change, Typed

_SIGN = re.compile(
    r"(?P<nothing>[^\S\n]+|\\[,;:! ]|~|\\(?:left|right|[bB]igg?[lrm]?)(?![A-Za-z])|&(?!&))"
    r"|\\[A-Za-z]+|\\.|[^\W\d_\u00b2\u00b3]+[0-9]*|[0-9]+(?:\.[0-9]+)?|['\u2032]+|.",
    re.DOTALL,
)
LINE_END = "\u00b6"
_OPENING, _CLOSING = ("(", "[", "{"), (")", "]", "}")


@cache
def _rule(name: str) -> re.Pattern[str]:
    return pattern("signs", name, "(?<= )(?:{})(?= )", bold="|".join(components.BOLD))


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

    __slots__ = ()

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


class _Signs:
    """The signs of a text between single blanks, and the span of each."""

    def __init__(self, text: str) -> None:
        line = of(text)
        self.words = [sign.text for sign in line]
        self.spans = [Span(sign.start, sign.stop) for sign in line]
        self.text = "".join(f" {word}" for word in self.words) + " "
        self._numbers: dict[int, int] = {}
        place = 1
        for number, word in enumerate(self.words):
            self._numbers[place] = number
            place += len(word) + 1

    def span(self, start: int, stop: int) -> Span:
        """The span in the text of the signs from one place to another."""
        inner = self.text[start:stop]
        start, stop = start + len(inner) - len(inner.lstrip()), start + len(inner.rstrip())
        first = self._numbers.get(start)
        if first is None:  # the x of dx
            before = self.text.rindex(" ", 0, start) + 1
            begun = self.spans[self._numbers[before]].start + start - before
        else:
            begun = self.spans[first].start
        last = self._numbers[self.text.rindex(" ", 0, max(start, stop - 1) + 1) + 1]
        return Span(begun, self.spans[last].stop)

    def end_before(self, place: int) -> int:
        """Where the last sign ends that begins before a place of the text."""
        return max((span.stop for span in self.spans if span.start < place), default=0)


_signs = lru_cache(maxsize=64)(_Signs)  # of a text that several rules look at


def _placed(text: str) -> Iterator[tuple[str, Span]]:
    """The signs of a text with their spans."""
    found = _signs(text)
    return zip(found.words, found.spans, strict=True)


@dataclass(frozen=True, slots=True)
class Found:
    """What a rule found in a text: the whole and its groups."""

    source: str
    signs: _Signs
    match: re.Match[str]

    def __getitem__(self, group: str) -> str | None:
        """The signs of a group without blanks; None if it took no part."""
        found = self.match[group]
        return None if found is None else found.replace(" ", "")

    @property
    def groups(self) -> list[str]:
        """The groups without a name that took part."""
        named = self.match.re.groupindex.values()
        every = enumerate(self.match.groups(), 1)
        return [one.replace(" ", "") for k, one in every if one is not None and k not in named]

    @property
    def text(self) -> str:
        """What was typed there."""
        start, stop = self.span()
        return self.source[start:stop]

    def span(self, group: str | int = 0) -> Span:
        """The span in the text of the whole or of a group."""
        return self.signs.span(*self.match.span(group))


def find(rule: str, text: Typed | str) -> Iterator[Found]:
    """Each place of a text where a rule holds."""
    source = text if isinstance(text, str) else text.text
    found = _signs(source)
    return (Found(source, found, match) for match in _rule(rule).finditer(found.text))


def first(rule: str, text: Typed | str) -> Found | None:
    """The first place where a rule holds."""
    return next(find(rule, text), None)


def begin(rule: str, text: Typed | str) -> Found | None:
    """What a rule finds at the beginning of a text."""
    source = text if isinstance(text, str) else text.text
    found = _signs(source)
    match = _rule(rule).match(found.text, 1)
    return None if match is None else Found(source, found, match)


def changed(text: Typed, rule: str, by: Callable[[Found], Typed | str | None]) -> Typed:
    """The text with what is read in the place of each span that a rule finds; None leaves it."""
    changes = [
        Change(*found.span(), new) for found in find(rule, text) if (new := by(found)) is not None
    ]
    return text.put(changes) if changes else text


def sides(text: Typed) -> list[Typed]:
    """The parts of a text between the = that no bracket holds."""
    found, start, depth = list[Typed](), 0, 0
    for word, span in _placed(text.text):
        depth += (word in _OPENING) - (word in _CLOSING)
        if word == "=" and depth <= 0:
            found.append(text[start : span.start])
            start = span.stop
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
    spans = _signs(text.text).spans
    return text[spans[0].start : spans[-1].stop] if spans else text[:0]


def words(text: Typed) -> list[str]:
    """The signs of a text, without what separates them."""
    return _signs(text.text).words


def beginning(text: Typed, after: int, start: int, stop: int) -> int:
    """Where an equation begins that takes the place from `start` to `stop`, and closes a bracket
    that is opened before: at the { of {\\dot x} = v, and at the Eq of Eq(x'', -x), which come after
    the place `after`.
    """
    opened: list[Span] = []
    for word, span in _placed(text.text):
        if not after <= span.start < stop:
            continue
        if word in (*_OPENING, "\\["):  # of Mathematica's \[Theta], too
            opened.append(span)
        elif word == "\\]":
            opened = opened[:-1]
        elif word in _CLOSING and opened:
            first = opened.pop()
            if span.start >= start > first.start:
                start = first.start if word == "}" else after
    return start


def ends_apart(text: Typed, place: int) -> bool:
    """Whether a blank, or another part that is no sign, stands before a place of a text."""
    return _signs(text.text).end_before(place) < place


def without_end(text: Typed, rule: str) -> Typed:
    """The text up to the signs at its end that a rule finds there, and without the blanks before
    them.
    """
    found = first(rule, text)
    place = len(text.text) if found is None else found.span().start
    return text[: _signs(text.text).end_before(place)]


def framed(text: Typed, command: str) -> Frame | None:
    r"""What \boxed{...} frames; None without the command."""
    if command not in text.text:
        return None
    found = _signs(text.text)
    for place, word in enumerate(found.words[:-1]):
        depth = 0
        for after in range(place + 1, len(found.words) * (word == command)):
            depth += {"{": 1, "}": -1}.get(found.words[after], 0)
            if not depth:
                opened = found.words[place + 1] == "{"
                before = Span(found.spans[place].start, found.spans[place + 1].stop)
                return Frame(before, found.spans[after]) if opened else None
    return None
