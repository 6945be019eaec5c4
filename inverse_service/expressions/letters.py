"""Non-ASCII letters and signs: their meaning in a formula, and the display of Greek letters."""

import re
import unicodedata

_SMALL = "\u03b1\u03b2\u03b3\u03b4\u03b5\u03b6\u03b7\u03b8\u03b9\u03ba\u03bb\u03bc\u03bd\u03be\u03bf\u03c0\u03c1"
_SMALL += "\u03c3\u03c4\u03c5\u03c6\u03c7\u03c8\u03c9"
_LETTERS = [unicodedata.name(small).split()[-1].lower().replace("lamda", "lambda") for small in _SMALL]
# Variant letter shapes are separate names; the micro sign is the letter mu.
_VARIED = ("phi", "theta", "epsilon", "rho", "pi", "sigma", "kappa")
_VARIANTS = dict(zip("\u03d5\u03d1\u03f5\u03f1\u03d6\u03c2\u03f0", map("var".__add__, _VARIED), strict=True))

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
SUPERSCRIPTS = dict(zip("\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079", "0123456789", strict=True))
SUPERSCRIPT_MINUS = "\u207b"
PRIMES = dict.fromkeys("'\u2032\u2019\u02b9\u02bc\u00b4\u02d9", 1) | dict.fromkeys("\u2033\u201d\u00a8", 2)
SPACES = frozenset(" \t\r\f\u00a0\u2002\u2003\u2009\u200a\u202f")
DOTS = {"\u0307": 1, "\u0308": 2}
_MEANT = {sign: (name, 0) for sign, name in (GREEK | SUBSCRIPTS | {SCRIPT_L: "ell"}).items()}
_MEANT |= {sign: ("", count) for sign, count in DOTS.items()}
_SLANTED = ("MATHEMATICAL ITALIC ", "PLANCK CONSTANT")
_PARTS = re.compile(r"([A-Za-z]+)(.*)")
_LETTER_AND_NUMBER = re.compile(r"([A-Za-z]+?)_?([0-9]+)")
_SHOWN = {name: character for character, name in reversed(GREEK.items())} | {"ell": SCRIPT_L}


def letter(character: str) -> tuple[str, int] | None:
    """The ASCII name of a character and the number of dots over it (x with two dots: ("x", 2)), or None."""
    if character.isascii():
        return (character, 0) if character.isalnum() or character == "_" else None
    if character in _MEANT:
        return _MEANT[character]
    if unicodedata.name(character, "").startswith(_SLANTED):  # produced by word processors
        return letter(unicodedata.normalize("NFKC", character))
    body, marks = (parts := unicodedata.normalize("NFD", character))[:1], parts[1:]
    return (body, DOTS[marks]) if marks in DOTS and body.isascii() else None


def describe(character: str) -> str:
    """The character for a message: itself if printable ASCII, else its code point."""
    return f"'{character}'" if " " < character <= "~" else f"U+{ord(character):04X}"


def written(name: str) -> tuple[str, list[str]]:
    """The body of a name and the words of its subscript, each a name or a number.

    p_q_1 and p_q1 are momenta, whose subscript is one name with a numeric subscript.
    """
    match = _PARTS.fullmatch(name)
    body, rest = match.groups() if match else (name, "")
    is_momentum = body == "p" and is_letter_with_number(rest[1:])
    return body, [rest[1:]] if is_momentum else [word for word in rest.split("_") if word]


def is_letter_with_number(word: str) -> bool:
    """Whether this is one letter with a numeric subscript, such as x1, theta1, theta_1."""
    found = _LETTER_AND_NUMBER.fullmatch(word)
    return found is not None and (len(found[1]) == 1 or found[1] in _SHOWN)


def shown(name: str) -> str:
    """The displayed form of a name: a Greek letter as its character, any other name unchanged."""
    return _SHOWN.get(name, name)
