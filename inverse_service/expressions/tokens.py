"""The token stream that the plain-text and the LaTeX reader share."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from inverse_service.errors import InputError, LimitError


@dataclass(frozen=True, slots=True)
class Limits:
    """Largest accepted sizes; all are counts.

    `depth` bounds the nesting of the text and of the tree (so that recursion over a tree is safe);
    `digits` those of one number, whether written or computed on reading (one bound for both, so that
    what was accepted and printed is accepted again); `exponent` a literal number power, above and
    below; `decimal_exponent` the k of 1e-k and 1ek; `derivative_nodes` the size of a formula that
    `diff` is carried out on.
    """

    characters: int = 20_000
    tokens: int = 5_000
    depth: int = 100
    digits: int = 200
    exponent: int = 4_096
    decimal_exponent: int = 150
    name_characters: int = 40
    derivative_order: int = 20
    derivative_nodes: int = 1_000
    coordinates: int = 12
    function_arguments: int = 6
    names: int = 200


LIMITS = Limits()


Kind = Literal["number", "name", "prime", "operator", "newline", "end"]
FACTOR = Fraction(1)


@dataclass(frozen=True, slots=True)
class Token:
    """One token; `column` counts from 1 in the original text.

    `value` is that of a number; for a prime it is the order of the derivative; for a ( it is FACTOR
    where no arguments can stand in it. Operators are + - * / ^ ( ) [ ] , = ; |, and < > & ~ true in
    conditions of pieces.
    """

    kind: Kind
    text: str
    column: int
    space_before: bool = False
    value: Fraction = Fraction(0)

    def is_operator(self, *texts: str) -> bool:
        return self.kind == "operator" and self.text in texts


_DECLARING = {
    "parameters": 'add it to "parameters"',
    "coordinates": 'add it to "coordinates"',
    "functions": 'declare a function of your own in "functions" with its arguments',
}
_IT_OCCURS = "; it occurs"  # before the column, where what is wrong is a sentence already


def refusal(
    what: str,
    column: int,
    instead: str,
    meant: tuple[str, ...] = (),
    span: tuple[int, int] | None = None,
    declare: str = "",
    kind: type[InputError] = InputError,
) -> InputError:
    """An InputError whose sentence says what is wrong, where, and what to write instead.

    `meant` are texts one of which may have been meant in the place of the name there, or of `span`; `declare` is the
    member of the document in which a name could be declared.
    """
    joint = "" if not instead else " else " if instead[-1] == "?" else "; else " if "?" in instead else ", or "
    ways = f"{instead}{joint}{_DECLARING[declare]}" if declare else instead
    plain = f"{what.removesuffix(_IT_OCCURS)}{f': {instead}' * bool(instead)}".removesuffix("?")
    ending = "?" if instead[-1:] == "?" else "."
    return kind(f"{what} at column {column}: {ways}.", "", column, meant, span, plain + ending, declare)


def closing(tokens: Sequence[Token], opening: int) -> int:
    """The place of the bracket that closes the one at `opening`; the end where none does."""
    depth = 0
    for place in range(opening, len(tokens)):
        depth += tokens[place].is_operator("(", "[") - tokens[place].is_operator(")", "]")
        if depth == 0:
            return place
    return len(tokens)


def split_at_commas(tokens: Sequence[Token]) -> list[list[Token]]:
    """The parts between commas that stand in no bracket."""
    parts: list[list[Token]] = [[]]
    depth = 0
    for token in tokens:
        depth += token.is_operator("(") - token.is_operator(")")
        if depth == 0 and token.is_operator(","):
            parts.append([])
        else:
            parts[-1].append(token)
    return parts


def refuse_decimal_commas(tokens: Sequence[Token]) -> None:
    """InputError for 1,5: a decimal comma to some, two numbers to others. B[1,0] holds orders and is none."""
    square = 0
    for place in range(1, len(tokens) - 1):
        comma, after = tokens[place], tokens[place + 1]
        square += tokens[place - 1].is_operator("[") - tokens[place - 1].is_operator("]")
        numbers = tokens[place - 1].kind == "number" and after.kind == "number"
        if comma.is_operator(",") and numbers and not square and not after.space_before:
            before = tokens[place - 1]
            meant = tuple(f"{before.text}{mark}{after.text}" for mark in (".", "")[: 1 + (len(after.text) == 3)])
            instead = "write a decimal point, or a space after a comma"
            span = (before.column, after.column + len(after.text))
            raise refusal("a comma occurs between digits", comma.column, instead, meant, span)


def limit_passed(what: str, column: int, bound: int) -> InputError:
    """A LimitError that names the bound."""
    return refusal(what, column, f"the limit is {bound:,}; write less", kind=LimitError)


def at_most(count: int | Fraction, bound: int, what: str, column: int) -> None:
    """LimitError that says what is too large where the count is above the bound."""
    if count > bound:
        raise limit_passed(what, column, bound)


def never_closed(opening: Token) -> InputError:
    """The refusal of a bracket without its end."""
    closing = {"(": ")", "[": "]", "{": "}"}.get(opening.text, opening.text)
    return refusal(f"the '{opening.text}' is never closed", opening.column, f"add the missing '{closing}'")


END = "an operator or the end"


def check_brackets(tokens: Sequence[Token]) -> None:
    """InputError for a round bracket without its other half."""
    opened: list[Token] = []
    for token in tokens:
        if token.is_operator("("):
            opened.append(token)
        elif token.is_operator(")") and not opened:
            raise unexpected(token, END)
        elif token.is_operator(")"):
            opened.pop()
    if opened:
        raise never_closed(opened[-1])


class TokenStream:
    """A position in a list of tokens, with the depth of nesting counted."""

    __slots__ = ("_depth", "_tokens", "position")

    def __init__(self, tokens: Sequence[Token], end_column: int) -> None:
        self._tokens = [*tokens, Token("end", "", end_column)]
        self._depth = 0
        self.position = 0

    @property
    def ahead(self) -> Token:
        return self._tokens[self.position]

    def look(self, distance: int) -> Token:
        """The token `distance` places on (or back), the end token beyond either end."""
        place = self.position + distance
        return self._tokens[place] if 0 <= place < len(self._tokens) else self._tokens[-1]

    def source(self, start: int, end: int) -> str:
        """The tokens from one position up to another as they may be written."""
        found = ""
        for token in self._tokens[start:end]:
            glued = found[-1:].isalnum() and token.kind in ("name", "number") and not found[-1:].isdigit()
            spaced = (token.space_before and token.text != ")") or glued
            found += f"{' ' * spaced}{token.text}"
        return found.strip()

    def take(self) -> Token:
        token = self.ahead
        if token.kind != "end":
            self.position += 1
        return token

    def take_operator(self, *texts: str) -> Token | None:
        """The next token if it is one of these operators, else None and nothing is taken."""
        return self.take() if self.ahead.is_operator(*texts) else None

    def close(self, opening: Token, closing: str = ")") -> None:
        """Take the closing bracket; InputError at the opening one where the formula ends before."""
        if self.take_operator(closing):
            return
        if self.ahead.kind == "end":
            raise never_closed(opening)
        raise unexpected(self.ahead, f"'{closing}'")

    def must_close(self) -> None:
        """InputError where the formula ends before the bracket ahead is closed."""
        if closing(self._tokens, self.position) == len(self._tokens):
            raise never_closed(self.ahead)

    def group(self) -> Sequence[Token]:
        """The tokens of the bracket ahead, up to its end or that of the formula."""
        return self._tokens[self.position : closing(self._tokens, self.position)]

    @contextmanager
    def nested(self) -> Iterator[None]:
        """One level further in; LimitError past `limits.depth`."""
        self._depth += 1
        at_most(self._depth, LIMITS.depth, "the formula is nested too deeply", self.ahead.column)
        yield
        self._depth -= 1


def unexpected(token: Token, wanted: str) -> InputError:
    """What stands here is not what can follow."""
    if token.kind == "end":
        return refusal("the formula ends", token.column, f"{wanted} is missing")
    if wanted == END and token.is_operator(")"):
        return refusal("')' is not expected", token.column, "leave it out, or add the '(' before it")
    shown = {"newline": "a new line", "prime": "a prime (')"}.get(token.kind, f"'{shorten(token.text)}'")
    return refusal(f"{shown} is not expected", token.column, f"{wanted} is expected")


def shorten(text: str, length: int = 30) -> str:
    """At most `length` characters, none but printable ASCII, to be shown in a message."""
    plain = "".join(c if " " <= c <= "~" else "?" for c in text[: length + 1])
    return plain if len(plain) <= length else plain[: length - 1] + "..."


def joined(names: Sequence[str], most: int = 8) -> str:
    """The names as a short list for a message."""
    shown = ", ".join(shorten(name) for name in names[:most])
    return shown + (", ..." if len(names) > most else "") if names else "none"


_LETTERS = [
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu", "nu", "xi",
    "omicron", "pi", "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi", "omega",
]  # fmt: skip
_SMALL = "\u03b1\u03b2\u03b3\u03b4\u03b5\u03b6\u03b7\u03b8\u03b9\u03ba\u03bb\u03bc\u03bd\u03be\u03bf\u03c0\u03c1"
_SMALL += "\u03c3\u03c4\u03c5\u03c6\u03c7\u03c8\u03c9"
# Letters of another shape are names of their own; the micro sign is the letter mu.
_VARIANTS = {
    "\u03d5": "varphi", "\u03d1": "vartheta", "\u03f5": "varepsilon", "\u03f1": "varrho", "\u03d6": "varpi",
    "\u03c2": "varsigma", "\u03f0": "varkappa",
}  # fmt: skip

GREEK: dict[str, str] = dict(zip(_SMALL, _LETTERS, strict=True))
GREEK |= {small.upper(): name.capitalize() for small, name in zip(_SMALL, _LETTERS, strict=True)}
GREEK |= _VARIANTS | {"\u00b5": "mu"}
# Names that look or sound alike, each with the one that it is read as where only that one is declared.
ALIKE = {name: name.removeprefix("var") for name in _VARIANTS.values()} | {"ell": "l"}
LETTER_COMMANDS: dict[str, str] = {name: ALIKE.get(name, name) for name in (*GREEK.values(), "ell")}
SCRIPT_L = "\u2113"

SUBSCRIPTS = {chr(0x2080 + digit): str(digit) for digit in range(10)}
SUPERSCRIPTS = dict(zip("\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079", "0123456789", strict=True))
SUPERSCRIPT_MINUS = "\u207b"
OPERATORS = {
    "\u00b7": "*", "\u22c5": "*", "\u00d7": "*", "\u2217": "*", "\u2219": "*", "\u00f7": "/", "\u2215": "/",
    "\u2022": "*", "\u2062": "*", "\u2044": "/", "\u2212": "-", "\u2013": "-", "\u2010": "-", "\u2011": "-",
}  # fmt: skip
PRIMES = {"'": 1, "\u2032": 1, "\u2019": 1, "\u02b9": 1, "\u02bc": 1, "\u00b4": 1, "\u2033": 2, "\u201d": 2}
SPACES = frozenset(" \t\r\f\u00a0\u2002\u2003\u2009\u200a\u202f")
_DOTS = {"\u0307": 1, "\u0308": 2}
_SLANTED = ("MATHEMATICAL ITALIC ", "PLANCK CONSTANT")


def letter(character: str) -> tuple[str, int] | None:
    """The ASCII of a character inside a name and the dots over it (x with two dots: ("x", 2)), else None."""
    if character.isascii():
        return (character, 0) if character.isalnum() or character == "_" else None
    if character in GREEK:
        return GREEK[character], 0
    if character == SCRIPT_L:
        return "ell", 0
    if character in SUBSCRIPTS:
        return SUBSCRIPTS[character], 0
    if character in _DOTS:
        return "", _DOTS[character]
    if unicodedata.name(character, "").startswith(_SLANTED):  # as word processors set formulas
        return letter(unicodedata.normalize("NFKC", character))
    return _dotted_letter(character)


def _dotted_letter(character: str) -> tuple[str, int] | None:
    parts = unicodedata.normalize("NFD", character)
    if len(parts) != 2 or parts[1] not in _DOTS or not parts[0].isascii():
        return None
    return parts[0], _DOTS[parts[1]]


def describe(character: str) -> str:
    """The character for a message: itself if printable ASCII, else its code point."""
    return f"'{character}'" if " " < character <= "~" else f"U+{ord(character):04X}"


_PARTS = re.compile(r"([A-Za-z]+)(.*)")
_SHOWN = {name: character for character, name in reversed(GREEK.items())} | {"ell": SCRIPT_L}


@dataclass(frozen=True, slots=True)
class Written:
    """The body of a name and the words of its subscript."""

    body: str
    subscript: tuple[str, ...]


def written(name: str) -> Written:
    """The parts of a name."""
    match = _PARTS.fullmatch(name)
    if match is None:
        return Written(name, ())
    return Written(match.group(1), tuple(word for word in match.group(2).split("_") if word))


def greek_letter(word: str) -> str | None:
    """The character of a Greek letter's name, None for any other word."""
    return _SHOWN.get(word)
