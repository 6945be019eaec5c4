r"""Line ends in LaTeX: spaces to LaTeX, but people also write one equation a line."""

from __future__ import annotations

import re

_SEPARATOR = re.compile(r"\\\\|;")
_ESCAPED = re.compile(r"\\[{}]")
_EXPECTS_MORE = ("+", "-", "*", "/", "^", "_", "=", ",", "&", "(", "[", "{")
_GOES_ON = ("+", "*", "/", "^", "_", "=", ",", "&", ")", "]", "}")


def line_ends(text: str, start: int, stop: int) -> frozenset[int]:
    """The places of the line ends between two equations: an = on either side, no bracket open, no sign in the air."""
    ends: list[int] = []
    equals, open_now, last, place = False, (0, 0, 0), "", start - 1
    for line in text[start:stop].split("\n"):
        first = _SEPARATOR.split(line, maxsplit=1)[0].strip()
        complete = equals and open_now == (0, 0, 0) and not last.endswith(_EXPECTS_MORE)
        if complete and "=" in first and not first.startswith(_GOES_ON):
            ends.append(place)
            equals, open_now, last = False, (0, 0, 0), ""
        *earlier, rest = _SEPARATOR.split(line)
        if earlier:
            equals, open_now, last = False, (0, 0, 0), ""
        equals = equals or "=" in rest
        open_now = _opened(rest, open_now)
        last = rest.strip() or last
        place += len(line) + 1
    return frozenset(ends)


def _opened(part: str, before: tuple[int, int, int]) -> tuple[int, int, int]:
    """How many { ( [ are open after the part."""
    plain = _ESCAPED.sub("", part)
    braces, round_ones, square = (plain.count(a) - plain.count(b) for a, b in ("{}", "()", "[]"))
    return before[0] + braces, before[1] + round_ones, before[2] + square
