"""Lines that give the value of a length L, L = 1, or only say L = L."""

from __future__ import annotations

from inverse_service.reading import signs
from inverse_service.reading.rules.sequences import (
    begin,
    follows,
    many,
    maybe,
    one,
    sign,
    then,
    without,
)

_END = follows(lambda text: text == "")
_DIGITS = sign(lambda text: text[:1].isdecimal())
_EXPONENT = then(
    sign(lambda text: text[:1] in ("e", "E") and (text[1:] or "0").isdecimal()),
    maybe(maybe(one("+", "-")), _DIGITS),
)
_NUMBER = then(_DIGITS, maybe("."))
_BLANKS = many(one("$", signs.LINE_END))
# The length L = 1
_VALUE = then(
    many(one(signs.LINE_END)),
    "L",
    maybe(":"),
    "=",
    _NUMBER,
    maybe(_EXPONENT),
    maybe("/", _NUMBER),
    many(one(signs.LINE_END)),
    _END,
)
_ARGUMENTS = then("(", many(without("()")), ")")
_OF_ITSELF = then(_BLANKS, "L", "=", "L", maybe(_ARGUMENTS), _BLANKS, _END)


def is_value(text: str) -> bool:
    """Whether this is L = 1, L = 0.5, or L = 1/2."""
    return begin(_VALUE, text) is not None


def is_of_itself(text: str) -> bool:
    """Whether this is the L = L of S = ∫ L dt next to L = ..."""
    return begin(_OF_ITSELF, text) is not None
