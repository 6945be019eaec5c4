r"""Names of a Lagrangian: \mathcal{L}_{\rm rel}, Lagrangian:, L2:, and K.E. for an energy."""

from __future__ import annotations

from collections.abc import Callable, Collection
from itertools import zip_longest
from string import ascii_letters

from inverse_service.reading import signs
from inverse_service.reading.rules.sequences import (
    NAME,
    WORD,
    Found,
    ahead,
    behind,
    braced,
    changed,
    either,
    find,
    many,
    maybe,
    one,
    part,
    sign,
    then,
    unless,
    without,
)
from inverse_service.reading.typed_text import Change, Typed

_GIVES = then(either(then(":", "="), one(":"), one("=")), unless(one("=")))
_SCRIPT_L = then(one("\\mathcal", "\\mathscr", "\\mathrm", "\\cal"), either(braced("L"), one("L")))
_IN_BRACES = either(without("{} "), braced(many(without("{} "), 20)))
_BELOW = then("_", either(braced(many(_IN_BRACES, 20)), WORD))
_WORDS = ("lag", "lagr", "lagrange", "lagrangian")
_NAMED = then(
    behind(lambda text: text != "_"),
    either(
        then(one("L", "Lagrangian"), ":", maybe("L"), maybe("=")),
        then(one(*_WORDS, *map(str.capitalize, _WORDS)), _GIVES),
    ),
)
# \mathcal{L}_{\rm rel}, and the Lagrangian that it is called elsewhere
LETTER_L = either(
    then(
        either(braced(_SCRIPT_L), _SCRIPT_L, one("\u2112", "\U0001d4db")),
        maybe(part("below", _BELOW)),
    ),
    part("named", _NAMED),
)
_DIGIT = sign(lambda text: len(text) == 1 and text.isdecimal())
_L_WITH_DIGIT = sign(lambda text: len(text) == 2 and text[0] == "L" and text[1].isdecimal())
# The eff of L_eff, and not the z of an angular momentum L_z
_CALLED = sign(lambda text: len(text) > 2 and text.isalpha())
_UPRIGHT = either(then(one("\\text", "\\mathrm"), braced(_CALLED)), then("\\rm", _CALLED))
_INDEX = either(_DIGIT, _CALLED, _UPRIGHT)
# L2: of Maxima, and K.E., the kinetic energy
NUMBERED_L = then(either(_L_WITH_DIGIT, then("L", "_", either(braced(_INDEX), _INDEX))), _GIVES)
ABBREVIATED = then(part("letter", one("K", "P")), ".", "E", maybe("."))
# The la of D[la, s'[t]], the derivative of a Lagrangian by a velocity
_VELOCITY = either(
    then(one("Diff", "diff"), "("),
    then("D", one("(", "[")),
    then(NAME, maybe("_", WORD), one("'", "\u2032")),
)
BY_VELOCITY = then(
    one("Diff", "diff", "D", "derivative"), one("[", "("), part("name", NAME), ",", _VELOCITY
)
# L' = in a text with \dot, in which a prime is no derivative
_PRIME = either(one("'", "\u2032"), then("^", either(braced("\\prime"), one("\\prime"))))
_ARGUMENTS = then("(", many(without("()= ")), ")")
PRIMED_L = then("L", _PRIME, ahead(then(maybe(_ARGUMENTS), "=")))


def with_letter_l(text: Typed, moves: Callable[[str], bool], energies: Collection[str]) -> Typed:
    r"""L for \mathcal{L}, also for the L_rel of the only Lagrangian, L = for Lagrangian:, L for the
    la of D[la, x'[t]], and L for the L' of a text with \dot, in which a prime is no derivative.

    `moves` says whether something moves in a formula; `energies` are no names of a Lagrangian.
    """
    one_only = len({found["below"] for found in find(LETTER_L, text)}) == 1

    def letter(found: Found) -> str | None:
        if named := found["named"]:
            after = text.text[found.span.stop :][:1]
            value = named[:3] in ("lag", "Lag") and after.isalnum()  # of lag=0.5, a delay
            return None if value and named.rstrip(":=L") != "Lagrangian" else "L ="
        before = text.text[: found.span.start]
        command = before.rstrip(ascii_letters).endswith("\\") and before[-1:] != "\\"
        blank = " " * command  # \partial L, not \partialL, for \partial\mathcal{L}
        return blank + ("L" if one_only else "L" + (found["below"] or ""))

    text = changed(text, LETTER_L, letter)
    text = changed(text, ABBREVIATED, lambda found: f"{found['letter']}E")
    text = _with_numbered_l(text, moves)
    names = {found["name"] for found in find(BY_VELOCITY, text)} - {*energies, None}
    if len(names) == 1 and not {"L", "T"} & {*signs.words(text)}:  # R beside T is of friction
        text = changed(text, one(*(name for name in names if name)), lambda _: "L")
    return changed(text, PRIMED_L, lambda _: "L") if "\\dot" in text.text else text


def _with_numbered_l(text: Typed, moves: Callable[[str], bool]) -> Typed:
    """L = m*diff(x, t)^2/2 for the only L2: m*diff(x, t)^2/2 of a text."""
    numbered = [*find(NUMBERED_L, text)]
    if len(numbered) != 1:
        return text
    start, stop = numbered[0].span
    label = text.text[start:stop].rstrip(":= ")
    line = signs.of(text.text[stop:])
    end = next((sign.start for sign in line if sign.text in ";$\u00b6"), len(text.text))
    words = signs.words(text[stop:])
    pairs = zip_longest(words, words[1:])
    others = [word for word, after in pairs if word in ("L", label) and after != "_"]  # not L_z
    if not moves(text.text[stop:][:end]) or text.text.count(label) != 1 or others:
        return text
    return text[:start] + text.made("L =", start) + text[stop:]


def unframed(text: Typed) -> Typed:
    r"""L = f for \boxed{L = f}."""
    frames = signs.frames(text.text, "\\boxed")
    return text.put(Change(*span, "") for frame in frames for span in frame)
