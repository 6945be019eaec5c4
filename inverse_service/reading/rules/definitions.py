"""Definitions, omega = ..., V(x) = ..., and r^2 = ...; f = x^2 + y^2 - l^2 = 0, a constraint with a
name.
"""

from __future__ import annotations

from inverse_service.reading import signs
from inverse_service.reading.rules.sequences import (
    SQUARED,
    WORD,
    ahead,
    behind,
    braced,
    changed,
    either,
    find,
    is_word,
    many,
    maybe,
    part,
    sign,
    then,
    without,
)
from inverse_service.reading.typed_text import Typed


def _begins_name(text: str) -> bool:
    letter = text.removeprefix("\\")
    is_letter = "\u0391" <= letter[:1] <= "\u03c9" or (
        letter[:1].isascii() and letter[:1].isalpha()
    )
    return is_letter and is_word(letter)


_NAME = then(
    sign(_begins_name),
    many(
        either(
            then("_", braced(many(WORD, None, 1))),
            sign(lambda text: is_word(text) and text != "\u00b2"),
        )
    ),
)
_ARGUMENTS = then("(", many(without("() ")), ")")
DEFINED = then(
    part("name", _NAME),
    maybe(either(part("arguments", _ARGUMENTS), part("square", SQUARED))),
    maybe(":"),
    "=",
)
_BODY = without("=,;\u00b6 ")
_ONE_LETTER = sign(lambda text: len(text) == 1 and text.isascii() and text.isalpha())
ZERO = then(
    behind(lambda text: text == "" or text[-1] in ",;\u00b6"),
    part("name", _ONE_LETTER),
    "=",
    part("body", many(_BODY, None, 1)),
    ahead(then("=", "0")),
)


def without_names(text: Typed) -> Typed:
    """x^2 + y^2 - l^2 = 0 for f = x^2 + y^2 - l^2 = 0."""
    return changed(text, ZERO, lambda zero: zero.cut(text, "body"))


def named_zeros(text: str) -> dict[str, str]:
    """The x^2 + y^2 - l^2 of f = x^2 + y^2 - l^2 = 0, by f."""
    parts = [found.parts for found in find(ZERO, text)]
    return {each["name"].text: text[slice(*each["body"].span)] for each in parts}


def gives_number(line: Typed) -> bool:
    """Whether a name is defined by a number."""
    right = signs.of(signs.halves(line).right.text)
    return all(
        each.text[0].isdecimal() or each.text in (".", "/", "-", signs.LINE_END) for each in right
    )
