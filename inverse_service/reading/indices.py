r"""Indices above letters, as in \ddot q^1 = -q^2 and q̈¹ = -q², put below: tokens in, tokens out.

An index is a digit above a letter that never occurs without one, if 1 is among these digits and
each of them moves somewhere. The letters of a document are those of all its texts together.
"""

from collections import defaultdict
from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

from inverse_service.reading import tokens as tk
from inverse_service.reading.names import GREEK_NAMES
from inverse_service.reading.tokens import Line, Token, Tokens, at

_DOTS = ("dot", "ddot")


class _Letter(NamedTuple):
    """A letter, the digit above it or "", and whether it has dots or primes."""

    name: str
    digit: str
    moves: bool


def raised_letters(texts: Iterable[Line]) -> frozenset[str]:
    """The letters of these texts whose raised digits are indices."""
    every, moving = defaultdict[str, set[str]](set), defaultdict[str, set[str]](set)
    for one in (letter for text in texts for letter in _letters(text)):
        every[one.name].add(one.digit)
        if one.moves:
            moving[one.name].add(one.digit)
    return frozenset(
        name
        for name, digits in moving.items()
        if digits == every[name] and "" not in digits and "1" in digits
    )


def with_indices_below(line: Line, letters: Container[str]) -> Tokens:
    """The tokens of plain text with q_1 for the q^1 of these letters."""
    return _changed(line, letters, _as_name)


def with_underscores(line: Line, letters: Container[str]) -> Tokens:
    """The tokens of LaTeX, before its commands are read, with _ for the ^ of these letters."""
    return _changed(line, letters, _as_subscript)


def _changed(
    line: Line, letters: Container[str], change: Callable[[Line, int], tuple[Tokens, int]]
) -> Tokens:
    found: Tokens = []
    place = 0
    while place < len(line):
        if _digit(line, place + 1) and _base(line[place]) in letters:
            read, place = change(line, place)
            found += read
            continue
        found.append(tk.within(line[place], lambda inside: _changed(inside, letters, change)))
        place += 1
    return found


def _as_subscript(line: Line, place: int) -> tuple[Tokens, int]:
    return [line[place], replace(line[place + 1], text="_")], place + 2


def _as_name(line: Line, place: int) -> tuple[Tokens, int]:
    token, above, after = line[place], line[place + 2], place + 3 + _primes(line, place + 3)
    sign = "" if above.is_bracket() else "_"  # q1 for the sign above, q_1 for q^1
    order = token.order + above.order + sum(int(t.value) for t in line[place + 3 : after])
    name = f"{token.text}{sign}{_digit(line, place + 1)}"
    primed = token.primed or token.column * (order > 0)
    return [replace(token, text=name, order=order, primed=primed)], after


def _letters(line: Line, dotted: bool = False) -> Iterator[_Letter]:
    """Each letter of the nested tokens; all of them are `dotted` in the braces of a dot."""
    for place, token in enumerate(line):
        if _base(token) and (token.kind in ("name", "command") or _digit(line, place + 1)):
            above = at(line, place + 2)
            moves = dotted or token.order > 0 or at(line, place - 1).text in _DOTS
            moves = moves or above.order > 0 or _primes(line, place + 3) > 0
            yield _Letter(_base(token), _digit(line, place + 1), moves)
        elif token.inside:
            yield from _letters(token.inside, dotted or at(line, place - 1).text in _DOTS)


def _base(token: Token) -> str:
    """q for q, \\theta, and {q}; "" for anything else."""
    if token.is_bracket("{") and len(token.inside) == 1:
        token = token.inside[0]
    letter = len(token.text) == 1 and token.kind == "name" and token.text.isalpha()
    command = token.kind == "command" and token.text in GREEK_NAMES
    return token.text if letter or command or token.text in GREEK_NAMES else ""


def _digit(line: Line, place: int) -> str:
    """The one digit of the exponent ^1, ^{1}, or a raised digit here; "" for another or none."""
    above = at(line, place + 1)
    one = above.inside[0] if len(above.inside) == 1 else above
    plain = one.kind == "number" and len(one.text) == 1 and one.text.isdigit()
    return one.text if at(line, place).is_operator("^") and plain else ""


def _primes(line: Line, place: int) -> int:
    """How many tokens of primes are here."""
    count = 0
    while at(line, place + count).kind == "prime":
        count += 1
    return count
