r"""Differential forms, dz = y dx and dz = ydx; \delta x is a virtual displacement, or asked about."""

from __future__ import annotations

from itertools import pairwise

from inverse_service.reading import signs

_DELTA = "\u03b4"


def has_form(text: str) -> bool:
    r"""Whether dx, ydx, d\theta, or \delta x occurs."""
    line = signs.of(text)
    for place, sign in enumerate(line):
        word, after = sign.text, line.at(place + 1)
        begins = after.text[:1].isalnum() or after.text[:1] in ("_", "\\")
        if word.removeprefix("\\") == "delta" and begins and not after.glued:
            return True
        if word[:1] == "\\":
            continue
        if _DELTA in word[:-1] or (word[-1] == _DELTA and begins):
            return True
        if _has_differential(word, after.text[:1]):
            return True
    return False


def _has_differential(word: str, follows: str) -> bool:
    """Whether a d is in a word after one letter at most, and before a letter or a command."""
    for place, character in enumerate(word):
        before, after = word[max(place - 2, 0) : place], word[place + 1 : place + 2] or follows
        two = len(before) == 2 and before.isascii() and before.isalpha()
        is_last = place + 1 == len(word)
        begins = after == "\\" if is_last else after.isascii() and after.isalpha()
        if character == "d" and not two and begins:
            return True
    return False


def begins_with_form(text: str) -> bool:
    """Whether a side begins with dx or a virtual displacement."""
    return signs.of(text).at(0).text.startswith(("d", _DELTA))


def has_time(text: str) -> bool:
    """Whether dt or a second derivative occurs, so that dx is no form."""
    line = signs.of(text)
    pairs = pairwise(line)
    return any("dt" in sign.text or "''" in sign.text for sign in line) or any(
        one.text[-1] == "d" and other.text[0] == "t" for one, other in pairs
    )
