r"""The allowed velocities as a set, D = {z' = y x'}, or a kernel, D = ker(dz - y dx), and the forms
that are 0 on them where they are numbered, \omega^1 = dz - y dx.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from inverse_service.reading import names as nm, signs
from inverse_service.reading.rules.sequences import (
    BEGINS,
    ENDS,
    PART,
    Found,
    Rule,
    ahead,
    braced,
    either,
    find,
    is_command,
    is_word,
    many,
    maybe,
    one,
    part,
    rest_of,
    sign,
    then,
    unless,
    until,
    without,
)
from inverse_service.reading.rules.vector_fields import CLOSED, DISTRIBUTION
from inverse_service.reading.signs import Line, Span

_MOST = 10_000  # signs of one set


def _such_that(line: Line, place: int, _: object) -> int:
    """The : of {v : z' = y x'}, and no | of |x|."""
    after = line.at(place + 1)
    glued = after.glued and (is_word(after.text) or after.text == "=")
    return place + 1 if line.at(place).text in (":", "\\mid", "|") and not glued else -1


_INSIDE = either(without("{}"), braced(many(without("{}"))))
SET = then(
    DISTRIBUTION,
    one("{", "\\{"),
    maybe(until(without("{}="), Rule(_such_that), 60)),
    part("equations", until(_INSIDE, ahead(one("}", "\\}")), _MOST)),
    one("}", "\\}"),
)
KERNEL = then(
    DISTRIBUTION,
    either(one("ker", "\\ker"), then("\\mathrm", braced("ker"))),
    one("(", "{", "\\(", "\\{"),
    part("form", until(without("=;"), ahead(CLOSED), _MOST)),
    CLOSED,
)
_SET_OR_KERNEL = either(SET, KERNEL)
_OF_EITHER = ("{", "\\{", "ker", "\\ker")  # one of these signs is in it
_LETTERS = ("omega", "eta", "theta", "alpha", "\u03c9", "\u03b7", "\u03b8", "\u03b1")


def _has_d(text: str) -> bool:
    return any(a == "d" and "a" <= b <= "z" for a, b in pairwise(text))


def _is_differential(text: str) -> bool:
    """Whether this is dx, ydx, or dtheta_1, and not dt."""
    start = text[:2].find("d")
    rest = text[start + 1 :].rstrip("0123456789") if start >= 0 else ""
    return text != "dt" and ((len(rest) == 1 and rest.isalpha()) or rest in nm.GREEK_NAMES)


_DIFFERENTIAL = then(
    either(sign(_is_differential), then("d", sign(is_command))),
    unless(either(one("/"), then("}", "{"))),  # dx/dt
)
_OF_ONE = either(then("^", either(braced("1"), one("1"))), one("\u00b9"))
_DIGIT = sign(lambda text: len(text) == 1 and text.isdecimal())
_RAISED = either(then("^", either(braced(_DIGIT), _DIGIT)), one("\u00b2", "\u00b3"))
_EQUALS = then(maybe(":"), "=")
_FIRST = ahead(then(_EQUALS, until(without(";=\u00b6"), either(sign(_has_d), _DIFFERENTIAL), 200)))
_LETTER = one(*_LETTERS, *(f"\\{name}" for name in _LETTERS[:4]))
# The index of \omega^1 = dz - y dx. That of \omega^2 = k/m, \ddot x = -\omega^2 x is a power.
NUMBERED = then(
    BEGINS,
    either(
        then(_LETTER, part("index", _OF_ONE), _FIRST),
        *(rest_of("index", name, lambda rest: rest == "\u00b9", _FIRST) for name in _LETTERS[4:]),
        then(
            _LETTER,
            part("index", _RAISED),
            ahead(then(_EQUALS, until(then(unless(ENDS), PART), _DIFFERENTIAL, 200))),
        ),
    ),
)


class Allowed(NamedTuple):
    """A set of allowed velocities and the equations in it, or the form that is 0 on it."""

    whole: Span
    inside: Span
    is_form: bool


def allowed(text: str) -> Iterator[Allowed]:
    """Each D = {...} and D = ker(...) of a text."""
    if signs.of(text).texts.isdisjoint(_OF_EITHER):
        return
    found: list[Found] = [*find(_SET_OR_KERNEL, text)]
    for each in found:
        name = "form" if each["form"] is not None else "equations"
        inside = each.parts[name]
        if name == "form" or "=" in inside.text:
            yield Allowed(each.span, inside.span, name == "form")


def indices(text: str) -> Iterator[Span]:
    """The index of each form that is numbered."""
    for found in find(NUMBERED, text):
        yield found.parts["index"].span
