r"""Equations d/dt dL/dx' - dL/dx = Q beside a Lagrangian, and \delta \int L dt = 0."""

from __future__ import annotations

from typing import NamedTuple

from inverse_service.expressions.refusals import fault
from inverse_service.reading import names as nm, signs
from inverse_service.reading.rules.sequences import (
    BEGINS,
    DT,
    ENDS,
    FRACTION,
    PART,
    PARTIAL,
    PLUS_OR_MINUS,
    PRIMES,
    WORD,
    D,
    braced,
    changed,
    either,
    find,
    first,
    is_word,
    is_word_or_command,
    many,
    maybe,
    one,
    part,
    rest_of,
    side_until,
    sign,
    then,
    until,
    without,
)
from inverse_service.reading.typed_text import Typed

_MOST = 60
_OF_L = either(then(either(PARTIAL, one("d")), "L"), one("dL"))
_ACCENT = one("\u0307", "\u0308")
_LETTER = sign(is_word_or_command)
_INDEX = then("_", either(braced(WORD), WORD))
_MARKS = then(maybe(_ACCENT), maybe(PRIMES), maybe(_INDEX), maybe(PRIMES))
_PLAIN = then(_LETTER, _MARKS)
_DOTTED = then(maybe(one("\\dot", "\\ddot")), either(then(braced(_PLAIN), _MARKS), _PLAIN))
_NAME = either(then(braced(_DOTTED), _MARKS), _DOTTED)  # \dot{q}_1, q', {\dot q}
_BY = either(
    then(either(PARTIAL, one("d")), part("by", _NAME)),
    rest_of("by", "d", is_word, _MARKS),
)
_OF_PACKAGES = nm.meanings("packages")
_TOTAL, _PARTIAL = (  # \dv{t} and \pdv{L}{x}
    one(*(f"\\{name}" for name, meaning in _OF_PACKAGES.items() if meaning == kind))
    for kind in ("derivative", "partial derivative")
)
_SLOPE = either(
    then(FRACTION, braced(_OF_L), braced(_BY)),
    then(_OF_L, "/", _BY),
    then(either(_PARTIAL, _TOTAL), either(braced("L"), one("L")), braced(part("by", _NAME))),
)
_IN_TIME = either(
    then(FRACTION, braced(D), braced(DT)),
    then(D, "/", DT),
    then(_TOTAL, maybe(braced()), braced("t")),
)
_RATE = then(
    _IN_TIME,
    maybe(one("\\qty")),
    maybe(one("(", "[", "{")),
    _SLOPE,
    maybe(one(")", "]", "}")),
)
_VARIATION = then(
    one("\\delta", "\u03b4"),
    one("\\int", "\u222b"),
    many(without(";\u00b6=LT "), 30),
    either(one("Ldt"), then("L", until(without(";\u00b6=L "), DT, 20))),
    "=",
    "0",
    ENDS,
)
_IN_FRONT = sign(
    lambda text: (
        not text.startswith(("\\quad", "\\qquad", "\\\\"))
        and not any(character in ";,\u00b6=$" for character in text)
    )
)
_TO_RATE = then(BEGINS, until(_IN_FRONT, then(PLUS_OR_MINUS, _RATE), _MOST))
_RIGHT = side_until(ENDS)
EQUATION = either(
    _VARIATION,
    then(either(_TO_RATE, _RATE), many(PART, _MOST), "=", _RIGHT),
    then(
        BEGINS,
        side_until(one("=")),
        either(_RATE, side_until(then(PLUS_OR_MINUS, _RATE))),
        either(ENDS, then(PLUS_OR_MINUS, _RIGHT)),
    ),
)
OF_RATE = then(maybe(part("sign", PLUS_OR_MINUS)), _RATE)
OF_SLOPE = then(maybe(part("sign", PLUS_OR_MINUS)), _SLOPE)
_NEEDED = frozenset(("L", "dL", "Ldt"))


class WithoutEquations(NamedTuple):
    """A text without its equations of Lagrange, and these."""

    text: Typed
    equations: list[Typed]


def without_equations(text: Typed) -> WithoutEquations:
    if signs.of(text.text).texts.isdisjoint(_NEEDED):
        return WithoutEquations(text, [])
    found = [*find(EQUATION, text)]
    equations = [text[each.span.start : each.span.stop] for each in found]
    return WithoutEquations(changed(text, EQUATION, lambda _: " "), equations)


def has_rate(text: str) -> bool:
    """Whether d/dt dL/dx' is in a text."""
    return first(OF_RATE, text) is not None


class Force(NamedTuple):
    """The names after dL/d in d/dt dL/dx' and in dL/dx, if there is this, and Q."""

    moving: str
    still: str
    text: str


def force(line: Typed) -> Force | None:
    """The Q of d/dt dL/dx' - dL/dx = Q, with all other terms of the equation; None for a variation
    of the action.
    """
    rate = first(OF_RATE, line)
    if rate is None:
        return None
    sides, still = list[Typed](), ""
    place = next(k for k, side in enumerate(signs.sides(line)) if first(OF_RATE, side))
    is_positive = (rate["sign"] or "+") == "+"
    is_positive = is_positive is (place == 0)
    for k, side in enumerate(signs.sides(line)):
        side = changed(side, OF_RATE, lambda _: " ") if k == place else side
        if slope := first(OF_SLOPE, side):
            plus = (slope["sign"] or "+") == "+"
            if still or plus is not (is_positive is (k == 1)):
                raise fault("sign in an equation of Lagrange", "")
            still = slope["by"] or ""
            side = changed(side, OF_SLOPE, lambda _: " ")
        side = signs.trimmed(side)
        signed = not side.text or signs.words(side)[0] in ("+", "-", "*", "\u2212")
        sides.append(side.made("0 ") + side if signed else side)
    left, right = sides if is_positive else reversed(sides)
    if signs.words(left) != ["0"]:
        right = right + left.made(" - (") + left + left.made(")", -1)
    return Force(rate["by"] or "", still, right.text)
