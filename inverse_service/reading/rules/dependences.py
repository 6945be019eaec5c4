r"""On what a name depends, as a text says beside its equations: u = u(r), syms y(x), Function('y')(x)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from inverse_service.reading import signs
from inverse_service.reading.rules import motion
from inverse_service.reading.signs import Line, Span

_PARTS = (",", ";", signs.LINE_END)
_FUNCTIONS = ("Function", "function")
_QUOTES = ("'", '"')
_PRIMES, _TWO_PRIMES = ("'", "\u2032", "\u2033"), ("\u2033", "''")


class Dependence(NamedTuple):
    """The u and the r of u = u(r), and where that is said."""

    name: str
    argument: str
    span: Span
    is_whole: bool = True  # nothing else is in its part of the text


def said(text: str) -> Iterator[Dependence]:
    """Each u = u(r) that a part of a text begins with, perhaps after "where"."""
    if "=" not in text or "(" not in text:
        return
    line = signs.with_whole_names(text)
    for place, sign in enumerate(line):
        start = place - (line.at(place - 1).text == "where")
        begins = start <= 0 or line[start - 1].text in _PARTS
        opening, argument, closing = (line.at(place + k) for k in (3, 4, 5))
        if (
            begins
            and sign.is_name()
            and line.says(place + 1, "=", sign.text, "(", argument.text, ")")
            and _is_letter(argument.text)
            and opening.glued
            and argument.glued
            and closing.glued
        ):
            is_whole = line.at(place + 6).text in ("", *_PARTS)
            where = Span(line[start].start, closing.stop)
            yield Dependence(sign.text, argument.text, where, is_whole)


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
            yield Dependence(sign.text, argument.text, Span(sign.start, line[place + 3].stop))


def _of_function(line: Line, place: int) -> Iterator[Dependence]:
    """The y and the x of 'y')(x) and 'y', x), which begin here."""
    quote, name = line.at(place), line.at(place + 1)
    after = place + 3 + (2 if line.says(place + 3, ")", "(") else 1)
    is_quoted = quote.text in _QUOTES and line.at(place + 2).text == quote.text
    is_called = line.says(place + 3, ")", "(") or line.says(place + 3, ",")
    argument = line.at(after)
    if is_quoted and is_called and argument.is_name() and line.says(after + 1, ")"):
        yield Dependence(name.text, argument.text, Span(quote.start, line[after + 1].stop))


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
