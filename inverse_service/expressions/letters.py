"""Tables of non-ASCII letters and signs."""

import unicodedata

_SMALL = "\u03b1\u03b2\u03b3\u03b4\u03b5\u03b6\u03b7\u03b8\u03b9\u03ba\u03bb\u03bc\u03bd\u03be\u03bf\u03c0\u03c1"
_SMALL += "\u03c3\u03c4\u03c5\u03c6\u03c7\u03c8\u03c9"
_LETTERS = [
    unicodedata.name(small).split()[-1].lower().replace("lamda", "lambda") for small in _SMALL
]
# Variant letter shapes are separate names; the micro sign is the letter mu.
_VARIED = ("phi", "theta", "epsilon", "rho", "pi", "sigma", "kappa")
_VARIANTS = dict(
    zip("\u03d5\u03d1\u03f5\u03f1\u03d6\u03c2\u03f0", map("var".__add__, _VARIED), strict=True)
)

GREEK: dict[str, str] = dict(zip(_SMALL, _LETTERS, strict=True))
GREEK |= {small.upper(): name.capitalize() for small, name in zip(_SMALL, _LETTERS, strict=True)}
GREEK |= _VARIANTS | {"\u00b5": "mu", "\u0127": "hbar", "\u210f": "hbar"}
# Names that look or sound alike, each with the name that replaces it if only that one is declared.
ALIKE = {name: name.removeprefix("var") for name in _VARIANTS.values()} | {"ell": "l"}
LETTER_COMMANDS: dict[str, str] = {name: ALIKE.get(name, name) for name in (*GREEK.values(), "ell")}
SCRIPT_L = "\u2113"

SUBSCRIPTS = {chr(0x2080 + digit): str(digit) for digit in range(10)}
# Unicode has no subscript y, so people write the subscript gamma instead.
_LOW = "\u2090\u2091\u2092\u2093\u2095\u2096\u2097\u2098\u2099\u209a\u209b\u209c\u1d62\u1d63\u1d64\u1d65\u2c7c\u1d67"
SUBSCRIPTS |= dict(zip(_LOW, map("_".__add__, "aeoxhklmnpstiruvjy"), strict=True))
SUPERSCRIPTS = dict(
    zip("\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079", "0123456789", strict=True)
)
SUPERSCRIPT_MINUS = "\u207b"
PRIMES = dict.fromkeys("'\u2032\u2018\u2019\u02b9\u02bc\u00b4\u02d9", 1) | dict.fromkeys(
    "\u2033\u201d\u00a8", 2
)
SPACES = frozenset(" \t\r\f\u00a0\u2002\u2003\u2009\u200a\u202f")
DOTS = {"\u0307": 1, "\u0308": 2}
