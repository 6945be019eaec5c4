"""The token stream that the plain-text and the LaTeX reader share."""

from __future__ import annotations

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


def refusal(what: str, column: int, instead: str, meant: tuple[str, ...] = ()) -> InputError:
    """An InputError whose sentence says what is wrong, where, and what to write instead.

    `meant` are texts one of which may have been meant in the place of the token there.
    """
    return InputError(f"{what} at column {column}: {instead}.", column=column, instead=meant)


def refuse_decimal_commas(tokens: Sequence[Token]) -> None:
    """InputError for 1,5: a decimal comma to some, two numbers to others. B[1,0] holds orders and is none."""
    square = 0
    for place in range(1, len(tokens) - 1):
        comma, after = tokens[place], tokens[place + 1]
        square += tokens[place - 1].is_operator("[") - tokens[place - 1].is_operator("]")
        numbers = tokens[place - 1].kind == "number" and after.kind == "number"
        if comma.is_operator(",") and numbers and not square and not after.space_before:
            raise refusal(
                "a comma occurs between digits", comma.column, "write a decimal point, or a space after a comma"
            )


def limit_passed(what: str, column: int, bound: int) -> LimitError:
    """A LimitError that names the bound."""
    return LimitError(f"{what} at column {column}: the limit is {bound:,}; write less.", column=column)


class TokenStream:
    """A position in a list of tokens, with the depth of nesting counted."""

    __slots__ = ("_depth", "_tokens", "limits", "position")

    def __init__(self, tokens: Sequence[Token], end_column: int, limits: Limits = LIMITS) -> None:
        self._tokens = [*tokens, Token("end", "", end_column)]
        self._depth = 0
        self.position = 0
        self.limits = limits

    @property
    def ahead(self) -> Token:
        return self._tokens[self.position]

    def look(self, distance: int) -> Token:
        """The token `distance` places on (or back), the end token beyond either end."""
        place = self.position + distance
        return self._tokens[place] if 0 <= place < len(self._tokens) else self._tokens[-1]

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
            raise refusal(f"the '{opening.text}' is never closed", opening.column, f"add the missing '{closing}'")
        raise unexpected(self.ahead, f"'{closing}'")

    @contextmanager
    def nested(self) -> Iterator[None]:
        """One level further in; LimitError past `limits.depth`."""
        self._depth += 1
        if self._depth > self.limits.depth:
            raise limit_passed("the formula is nested too deeply", self.ahead.column, self.limits.depth)
        yield
        self._depth -= 1


def unexpected(token: Token, wanted: str) -> InputError:
    """What stands here is not what can follow."""
    if token.kind == "end":
        return refusal("the formula ends", token.column, f"{wanted} is missing")
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
