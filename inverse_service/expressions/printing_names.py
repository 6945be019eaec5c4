"""A name as a letter with a subscript, for LaTeX and MathML: r1 is r_1, x_left is x with "left"."""

from __future__ import annotations

import re
from dataclasses import dataclass

from inverse_service.expressions.characters import GREEK, SCRIPT_L

_PARTS = re.compile(r"([A-Za-z]+)(.*)")
_LETTERS = {name: character for character, name in reversed(GREEK.items())} | {"ell": SCRIPT_L}


@dataclass(frozen=True, slots=True)
class Written:
    """The body of a name and the words of its subscript."""

    body: str
    subscript: tuple[str, ...]


def written(name: str) -> Written:
    """The parts of a name."""
    match = _PARTS.fullmatch(name)
    if match is None:
        return Written(name, ())
    return Written(match.group(1), tuple(word for word in match.group(2).split("_") if word))


def greek_letter(word: str) -> str | None:
    """The character of a Greek letter's name, None for any other word."""
    return _LETTERS.get(word)
