r"""What moves in a text, before its names are known: x', x_dot, \dot x, dx/dt, diff(x, t)."""

from __future__ import annotations

from collections.abc import Iterator

from inverse_service.reading import signs
from inverse_service.reading.rules.sequences import WORD, first, many, one, then
from inverse_service.reading.signs import Line

_DOTTED = "\u0307\u1e8b\u1e8f\u017c"
_PRIMES = ("'", "\u2032", "\u2033")
_CALLS = frozenset(("diff", "dot"))
_RATE = then("der", "(", many(WORD, None, 1), ")", one("="))  # of Modelica


def _name(text: str) -> str:
    r"""theta of \theta, and x of 2x; no text for what is no name."""
    name = text.lstrip("\\").lstrip("0123456789")
    is_letter = (name[:1].isascii() and name[:1].isalpha()) or "\u0391" <= name[:1] <= "\u03c9"
    return name if is_letter else ""


def _with_dots(line: Line) -> Iterator[str]:
    """The x of x', x_dot, and xddot."""
    for place, sign in enumerate(line):
        name = _name(sign.text)
        if name and line.at(place + 1).text.startswith(_PRIMES):
            yield name
        elif name.endswith("dot") and len(name) > len("dot"):
            base = name.removesuffix("dot")
            yield base.removesuffix("d").removesuffix("_") or base


def moving(text: str) -> set[str]:
    """The names with primes and dots in a plain text."""
    return {*_with_dots(signs.with_whole_names(text))}


def moves(text: str) -> bool:
    """Whether a name has dots or primes, or dx/dt occurs."""
    line = signs.with_whole_names(text)
    rates = (
        _name(sign.text)[:1] == "d"
        and _name(sign.text)[1:2].isalpha()
        and line.says(place + 1, "/")
        and line.at(place + 2).text.startswith("dt")
        for place, sign in enumerate(line)
    )
    return (
        "\\dot" in line.texts
        or not set(_DOTTED).isdisjoint(text)
        or any(True for _ in _with_dots(line))
        or any(rates)
    )


def is_differentiated(text: str) -> bool:
    """The same, or whether diff(x, t) or dot(x) occurs."""
    words = signs.with_whole_names(text).texts
    return moves(text) or not _CALLS.isdisjoint(word.lstrip("\\") for word in words)


def accelerates(text: str) -> bool:
    r"""Whether a name has two primes, no argument, or two dots: x'', \ddot x, x_ddot."""
    line = signs.with_whole_names(text)
    for place, sign in enumerate(line):
        primes, after = line.at(place + 1), line.at(place + 2).text
        name = _name(sign.text)
        if name and primes.glued and primes.text in ("''", "\u2033") and after not in ("(", "["):
            return True
        if name and primes.glued and primes.text.startswith("'''"):
            return True
        if name.endswith("ddot") and len(name) > len("ddot"):
            return True
    return "\\ddot" in line.texts


def has_rates_of_modelica(text: str) -> bool:
    """Whether der(x) = occurs."""
    return first(_RATE, text) is not None
