r"""Velocity and acceleration as vectors: \vec v and \vec a next to \vec r = (x, y) are \dot{\vec r} and
\ddot{\vec r}; of \vec F = m \vec a = -k \vec r the \vec F is left out.
"""

from __future__ import annotations

from functools import partial

from inverse_service.reading import components
from inverse_service.reading.rules.sequences import (
    BEGINS,
    ENDS,
    SQUARED,
    WORD,
    Found,
    Rule,
    ahead,
    braced,
    changed,
    either,
    find,
    many,
    maybe,
    one,
    part,
    then,
    unless,
    without,
)
from inverse_service.reading.typed_text import Typed

_BOLD = one(*(f"\\{command}" for command in components.BOLD))
_NAME = part("name", WORD)
_VECTOR = then(_BOLD, either(braced(_NAME), _NAME))
_LIST = then("=", "(", many(without("()=, "), None, 1), ",")
_GIVEN = then(_VECTOR, _LIST)
_D = one("d")
_RATE_OF_V = either(
    then("\\dot", either(braced(_VECTOR), _VECTOR)),
    then(_BOLD, braced("\\dot", either(braced(_NAME), _NAME))),
    then(one("\\frac", "\\dfrac"), braced(either(_D, braced("\\rm", "d")), _VECTOR), braced("dt")),
)
_SQUARED_D = either(then(_D, SQUARED), then(braced("\\rm", "d"), SQUARED))


def _rates(dots: str, upright: Rule) -> Rule:
    """The dotted vectors of a text."""
    return either(
        then(dots, either(braced(_VECTOR), _VECTOR)),
        then(_BOLD, braced(dots, either(braced(_NAME), _NAME))),
        then(
            one("\\frac", "\\dfrac"), braced(upright, _VECTOR), maybe(braced(many(without("{}= "))))
        ),
    )


_FIRST, _SECOND = _rates("\\dot", either(_D, braced("\\rm", "d"))), _rates("\\ddot", _SQUARED_D)
_IS_RATE = then(BEGINS, _FIRST, "=", part("named", _VECTOR), ENDS, maybe(one(",", ";")))
_RATE = then(either(part("rate", _RATE_OF_V), _VECTOR), unless(one("_")))
_NAMED_SIDE = then(BEGINS, _VECTOR, "=", ahead(then(many(without("=;,\u00b6")), "=")))
_FORCES = ("F", "f")


def with_dots(text: Typed) -> Typed:
    r"""The text with \dot{\vec r} for \vec v and \ddot{\vec r} for \vec a and \dot{\vec v}, where r is
    given by its components and v or a is not.
    """
    given = {str(found["name"]): found for found in find(_GIVEN, text)}
    vector = given.get("r") or given.get("x")
    if vector is None:
        return text
    place = str(vector["name"])
    text = changed(text, _IS_RATE, partial(_without_its_name, place))
    known = {*given}  # and the v of -c (dr/dt - v) is a wind
    for name, rule in (("v", _FIRST), ("a", _SECOND)):
        known |= {name for found in find(rule, text) if found["name"] == place}
    if any(found["rate"] is not None for found in find(_RATE, text)):
        known.add("a")  # dv/dt = a - k v
    position = vector.text.partition("=")[0].strip()
    text = changed(text, _NAMED_SIDE, lambda found: " " if found["name"] in _FORCES else None)
    return changed(text, _RATE, partial(_dotted, position, known))


def _without_its_name(place: str, found: Found) -> str | None:
    r"""Nothing for \dot{\vec r} = \vec v."""
    named = str(found["named"]).rstrip("}")
    return " " if named.endswith("v") and place in found.text.partition("=")[0] else None


def _dotted(position: str, given: set[str], found: Found) -> str | None:
    """What is read in the place of v, a, or the rate of v."""
    name, is_rate = str(found["name"]), found["rate"] is not None
    if name in given or name not in ("v", "a") or (is_rate and name == "a"):
        return None
    dots = "\\ddot" if is_rate or name == "a" else "\\dot"
    return f"{dots}{{{position}}}"
