r"""Vector fields that span the allowed directions: D = span{\partial_x + y \partial_z, \partial_y}."""

from __future__ import annotations

from typing import NamedTuple

from inverse_service.reading.rules.sequences import (
    FRACTION,
    PARTIAL,
    Found,
    ahead,
    braced,
    changed,
    either,
    first,
    follows,
    is_word,
    is_word_or_command,
    many,
    maybe,
    one,
    part,
    sign,
    then,
    until,
    without,
)
from inverse_service.reading.typed_text import Typed

_LETTER = sign(lambda text: text[:1] in ("D", "\u0394") and len(text) < 3 and is_word(text))
_MATH = sign(lambda text: text.startswith("\\math") and len(text) > 5 and text[5:].islower())
_ONE = sign(lambda text: len(text) == 1 and is_word(text))
_SPAN = then(
    maybe(one("\\mathrm", "\\operatorname", "\\text")),
    either(braced(one("span", "\\span")), one("span", "\\span")),
)
CLOSED = then(
    one("}", ")", "\\}", "\\)"),
    follows(lambda text: text[:1] in ("", ";", ",", ".", "\u00b6", "\\")),
)
_INSIDE = either(without("{} "), braced(many(without("{} "))))
# D = and \mathcal{D}_q =
DISTRIBUTION = then(
    either(then(_MATH, either(braced(_LETTER), _LETTER)), _LETTER, one("\\Delta")),
    maybe(either(then("_", either(braced(_ONE), _ONE)), then("(", "q", ")"))),
    "=",
)
# D = span{∂_x + y ∂_z, ∂_y}
SPAN = then(
    DISTRIBUTION,
    _SPAN,
    one("{", "(", "\\{", "\\("),
    part("fields", until(_INSIDE, ahead(CLOSED), 10_000)),
    CLOSED,
)
_BY = part("by", sign(is_word_or_command))
_OVER = then(many(one("}", "{")), maybe("/"), maybe("("), PARTIAL)
# ∂_x and ∂/∂x in it
FIELD = then(
    maybe(FRACTION, "{"),
    PARTIAL,
    either(then("_", either(braced(_BY), _BY)), then(_OVER, _BY, maybe(one(")", "}")), maybe("}"))),
)


class WithoutFields(NamedTuple):
    """A text without its D = span{...}, and the fields in it."""

    text: Typed
    fields: Typed | None


def without_fields(text: Typed) -> WithoutFields:
    found = first(SPAN, text)
    if found is None:
        return WithoutFields(text, None)
    start, stop = found.span
    return WithoutFields(text[:start] + text[stop:], found.cut(text, "fields"))


def with_velocities(fields: Typed, latex: bool) -> str:
    """x' + y z' for ∂_x + y ∂_z."""

    def velocity(field: Found) -> str:
        return f" \\dot{{{field['by']}}} " if latex else f" {field['by']}' "

    return changed(fields, FIELD, velocity).text
