r"""On what a name depends, as a text says beside its equations: u = u(r), syms y(x), Function('y')(x)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from inverse_service.reading import signs
from inverse_service.reading.rules import motion
from inverse_service.reading.signs import Line, Span

JOINS = ("where", "with", "and", "for")
_SEPARATORS = (",", ";", ":", ".", "$", signs.LINE_END)
_COMMANDS = ("\\quad", "\\qquad", "\\end", "\\\\")
_FUNCTIONS = ("Function", "function")
_QUOTES = ("'", '"')
_PRIMES, _TWO_PRIMES = ("'", "\u2032", "\u2033"), ("\u2033", "''")


class Name(NamedTuple):
    """A name, without braces and backslash, and the places of the signs from it to what follows."""

    text: str
    start: int
    stop: int


class Dependence(NamedTuple):
    """The V and the (x, y) of V = V(x, y), where that is said in the text, and by which signs."""

    name: str
    arguments: str
    span: Span
    places: range
    is_whole: bool = True  # nothing else is in its part of the text

    @property
    def argument(self) -> str:
        """The x of (x)."""
        return self.arguments[1:-1].strip()

    @property
    def called(self) -> str:
        return f"{self.name}{self.arguments}"

    @property
    def letters(self) -> list[str]:
        return [plain_name(one) for one in self.arguments[1:-1].split(",")]


def plain_name(written: str) -> str:
    r"""omega_0 for \omega_{0}."""
    return written.strip().lstrip("\\").replace("{", "").replace("}", "").replace(" ", "")


def name_at(line: Line, place: int) -> Name | None:
    r"""The name that begins here: V, \omega_0, or \omega_{0}."""
    text = line.at(place).text
    if not text.lstrip("\\")[:1].isalpha():
        return None
    if text.endswith("_") and line.says(place + 1, "{") and line.says(place + 3, "}"):
        return Name(plain_name(text + line.at(place + 2).text), place, place + 4)
    return Name(plain_name(text), place, place + 1)


def statements(text: str) -> Iterator[Dependence]:
    """Each V = V(x, y) that a part of a text begins with, perhaps after "where" or in brackets."""
    if "=" not in text or "(" not in text:
        return
    line = signs.with_whole_names(text)
    for place, sign in enumerate(line):
        if sign.text != "=":
            continue
        right = name_at(line, place + 1)
        names = (name_at(line, place - k) for k in (4, 1) if place >= k)
        left = next((name for name in names if name and name.stop == place), None)
        if left is None or right is None or left.text != right.text:
            continue
        end = next((k for k in range(right.stop, len(line)) if line[k].text == ")"), None)
        if end is None or not line.says(right.stop, "("):
            continue
        before, after = line.at(left.start - 1).text, line.at(end + 1).text
        start, stop = left.start - (before in JOINS), end + 1
        in_brackets = (before, after) == ("(", ")")  # x'' = -w^2 x (w = w(t))
        if in_brackets:
            start, stop = start - 1, stop + 1
        elif not _begins(before):
            continue
        span = Span(line[start].start, line[stop - 1].stop)
        inside = text[line[right.stop].start : line[end].stop]
        whole = in_brackets or _ends(after)
        yield Dependence(left.text, inside, span, range(start, stop), whole)


def _begins(before: str) -> bool:
    return before in ("", *JOINS) or before[-1] in _SEPARATORS or before.endswith("quad")


def _ends(after: str) -> bool:
    return after in ("", *JOINS) or after[0] in _SEPARATORS or after.startswith(_COMMANDS)


def said(text: str) -> Iterator[Dependence]:
    """Each u = u(r) of one letter."""
    for one in statements(text):
        if _is_letter(one.arguments[1:-1]) and text[: one.span.stop].rstrip(")").endswith(
            one.called.removesuffix(")")
        ):  # u = u (r) is a product
            yield one


def has_primes(text: str, name: str, least: int = 1) -> bool:
    """Whether a name has so many primes in a text."""
    line = signs.with_whole_names(text)
    marks = (line.at(place + 1) for place, sign in enumerate(line) if sign.text == name)
    return any(
        mark.glued and len(mark.text.replace(*_TWO_PRIMES)) >= least
        for mark in marks
        if mark.text.startswith(_PRIMES)
    )


def declared(text: str) -> Iterator[Dependence]:
    """Each y(x) that a program declares: syms y(x), @variables y(x), Function('y')(x)."""
    line = signs.with_whole_names(text)
    is_listed = False
    for place, sign in enumerate(line):
        is_variables = sign.text == "variables" and line.at(place - 1).text == "@"
        is_listed = sign.text not in (";", signs.LINE_END) and (
            is_listed or sign.text == "syms" or is_variables
        )
        if sign.text in _FUNCTIONS and line.says(place + 1, "(") and line[place + 1].glued:
            yield from _of_function(line, place + 2)
        argument = line.at(place + 2)
        is_called = line.says(place + 1, "(", argument.text, ")") and line[place + 1].glued
        if is_listed and is_called and _is_word(sign.text) and argument.is_name():
            yield _called(line, place, place + 3, sign.text, argument.text)


def _of_function(line: Line, place: int) -> Iterator[Dependence]:
    """The y and the x of 'y')(x) and 'y', x), which begin here."""
    quote, name = line.at(place), line.at(place + 1)
    after = place + 3 + (2 if line.says(place + 3, ")", "(") else 1)
    is_quoted = quote.text in _QUOTES and line.at(place + 2).text == quote.text
    is_called = line.says(place + 3, ")", "(") or line.says(place + 3, ",")
    argument = line.at(after)
    if is_quoted and is_called and argument.is_name() and line.says(after + 1, ")"):
        yield _called(line, place, after + 1, name.text, argument.text)


def _called(line: Line, first: int, last: int, name: str, argument: str) -> Dependence:
    span = Span(line[first].start, line[last].stop)
    return Dependence(name, f"({argument})", span, range(first, last + 1))


def are_called_with(text: str, argument: str) -> bool:
    """Whether an argument with this name, of whatever, is in a text: (t), or (x, t)."""
    line = signs.with_whole_names(text)
    places = (place for place, sign in enumerate(line) if sign.text == argument)
    return any(
        line.at(place - 1).text in (",", "(") and line.at(place + 1).text in (",", ")")
        for place in places
    )


def may_move(text: str, name: str) -> bool:
    r"""Whether a name may have primes or dots: t', t_dot, \dot t, \ddot{t}."""
    line = signs.with_whole_names(text)
    dotted = (place for place, sign in enumerate(line) if sign.text in ("\\dot", "\\ddot"))
    return (
        name in motion.moving(text)
        or any(line.at(place + 1 + line.says(place + 1, "{")).text == name for place in dotted)
        or (name == "t" and "\u1e97" in text)
    )


def _is_letter(text: str) -> bool:
    return len(text) == 1 and text.isascii() and text.islower()


def _is_word(text: str) -> bool:
    return text.replace("_", "a").isalnum()
