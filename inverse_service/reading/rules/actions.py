r"""Actions: S[x] = \int_a^b (m x'^2/2 - V) dt, whose integrand is L."""

from __future__ import annotations

from typing import NamedTuple

from inverse_service.reading.rules.sequences import (
    D,
    Found,
    ahead,
    behind,
    braced,
    changed,
    either,
    first,
    follows,
    is_command,
    is_name,
    is_word,
    is_word_or_command,
    many,
    maybe,
    one,
    part,
    rest_of,
    sign,
    then,
    without,
)
from inverse_service.reading.typed_text import Typed

_LETTERS = one("S", "A", "I", "J")
_OF_ACTION = either(
    then(behind(lambda text: text[-1:] not in ("^", "_")), _LETTERS),
    then("L", ahead(one("["))),
    then(one("\\mathcal", "\\mathscr"), either(braced(_LETTERS), _LETTERS)),
)
_ARGUMENTS = then(
    one("[", "(", "\\[", "\\("),
    many(without("[]()=;\u00b6 "), 40),
    one("]", ")", "\\]", "\\)"),
)
_BOUND = then(
    one("_", "^"),
    either(
        braced(many(without("{} "), 40)),
        then("(", many(without("() "), 40), ")"),
        then(one("-", "+"), sign(is_word)),
        sign(is_word_or_command),
    ),
)


def _is_ascii(text: str) -> bool:
    return text.isascii() and text.isalpha()


_VARIABLE = sign(lambda text: _is_ascii(text) or is_command(text))
# S[x] = ∫_a^b (dt); its dt is at the beginning or the end
ACTION = then(
    _OF_ACTION,
    maybe(_ARGUMENTS),
    "=",
    maybe(part("minus", one("-"))),
    either(one("\u222b"), then("\\int", maybe("\\limits"))),
    many(_BOUND, 2),
    maybe(either(rest_of("glued", "d", _is_ascii), then(D, part("first", _VARIABLE)))),
)
_AFTER = follows(
    lambda text: (
        text in ("", "\\\\", "\\]")
        or text[0] in ";,.\u00b6$"
        or text.startswith(("\\end", "\\quad", "\\qquad"))
    )
)
MEASURE = then(
    either(
        rest_of("glued", "Ld", _is_ascii),
        rest_of("glued", "d", _is_ascii),
        then(D, part("last", _VARIABLE)),
    ),
    _AFTER,
)
_BY = sign(lambda text: len(text) == 1 and is_word(text))
# The u_x of an action of u(x)
SLOPE_BELOW = then(
    part("name", sign(lambda text: is_name(text) or is_command(text))),
    "_",
    either(braced(part("by", _BY)), part("by", _BY)),
    follows(lambda text: text[:1] not in ("_", "'", "\u2032")),
)


class OfAction(NamedTuple):
    """A text with L = f for its S = ∫ f dx, and x; no name without an action."""

    text: Typed
    variable: str


def of_action(text: Typed) -> OfAction:
    """The text with L = f for its S = ∫ f dt.

    Other integrals are refused where they are read: their sign stays.
    """
    action = first(ACTION, text)
    if action is None:
        return OfAction(text, "")
    start, stop = action.span
    before, after = text[:start], text[stop:]
    given = text.made("L = " + (action["minus"] or ""), start)
    name = action["glued"] or action["first"]
    if name is None:
        measure = first(MEASURE, after)
        if measure is None:
            return OfAction(text, "")
        name = measure["glued"] or measure["last"] or ""
        begun, ended = measure.span
        if measure["glued"]:
            begun = measure.parts["glued"].span.start - 1  # of Ldt
        after = after[:begun] + after[ended:]
    variable = name.lstrip("\\")

    def rate(found: Found) -> Typed | None:
        slope = found.cut(after, "name")
        return slope + slope.made("'", -1) if found["by"] == variable else None

    if "\\dot" not in after.text:
        after = changed(after, SLOPE_BELOW, rate)
    return OfAction(before + given + after, variable)
