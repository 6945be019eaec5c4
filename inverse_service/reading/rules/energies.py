"""Energies: L = T - V = ..., T = ..., and V(x) = ..., also 2 T = ..."""

from inverse_service.reading.rules.sequences import (
    PLUS_OR_MINUS,
    WORD,
    ahead,
    braced,
    either,
    many,
    maybe,
    one,
    part,
    then,
    unless,
    without,
)

_OPENED = either(one("$", "\\[", "\u00b6"), then("\\begin", braced(WORD, maybe("*"))))
_ARGUMENTS = then("(", many(without("()= ")), ")")
_KINETIC = then("E", "_", either(braced(one("k", "kin")), one("k", "kin")))
_POTENTIAL = then("E", "_", either(braced(one("p", "pot")), one("p", "pot")))
_WHOLE = either(one("L"), then(one("T", "K"), one("-", "\u2212"), one("U", "V"), ahead(one("="))))
_EQUALS = either(
    then(":", "=", unless(one("="))),
    then("=", unless(one("="))),
    one("\u2254", "\u2261", "\\equiv", "\\triangleq", "\\coloneqq"),
    then(one("\\stackrel", "\\overset"), braced(many(without("{} "))), braced("=")),
)
# L, T, and V with an argument perhaps, and =; half of 2 T = ... is meant.
ENERGY = then(
    many(_OPENED),
    maybe(part("twice", one("2"))),
    either(
        part("whole", _WHOLE),
        part("kinetic", either(one("T", "K", "KE"), _KINETIC)),
        part("potential", either(one("U", "V", "\u03a0", "PE", "\\Pi", "Pi"), _POTENTIAL)),
    ),
    maybe(part("arguments", _ARGUMENTS)),
    _EQUALS,
)
_INDEX = then("_", either(braced(WORD), WORD))
_LETTER = one("T", "K", "U", "V", "E", "KE", "PE")
_TERM = then(
    maybe(PLUS_OR_MINUS),
    maybe(one("\\mathcal", "\\mathrm")),
    either(braced(_LETTER), _LETTER),
    maybe(_INDEX),
    maybe(_ARGUMENTS),
)
# The T - V of L = T - V = ...
ENERGIES = then(many(_TERM, None, 1), "=")
