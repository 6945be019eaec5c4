"""Sizes that formulas may have, and how a refusal says what is wrong, where, and what to write instead."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from fractions import Fraction

from inverse_service import errors

_TIMES: ContextVar[int] = ContextVar("times", default=1)
_DECLARING = {
    "parameters": 'add it to "parameters"',
    "coordinates": 'add it to "coordinates"',
    "functions": 'declare a function of your own in "functions" with its arguments',
}
_IT_OCCURS = "; it occurs"  # before the column, where what is wrong is a sentence already


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
    coordinates: int = 64
    function_arguments: int = 6
    names: int = 200


LIMITS = Limits()


@contextmanager
def longer_texts(times: int) -> Iterator[None]:
    """Texts may have so many times the characters and tokens: programs print more than people type."""
    token = _TIMES.set(times)
    try:
        yield
    finally:
        _TIMES.reset(token)


def most_characters() -> int:
    """Characters of one text that is read now."""
    return LIMITS.characters * _TIMES.get()


def most_tokens() -> int:
    """Tokens of one text that is read now."""
    return LIMITS.tokens * _TIMES.get()


def refusal(
    what: str,
    column: int,
    instead: str,
    meant: tuple[str, ...] = (),
    span: tuple[int, int] | None = None,
    declare: str = "",
    kind: type[errors.InputError] = errors.InputError,
) -> errors.InputError:
    """An InputError whose sentence says what is wrong, where, and what to write instead.

    `meant` are texts one of which may have been meant in the place of the name there, or of `span`; `declare` is the
    member of the document in which a name could be declared.
    """
    joint = "" if not instead else " else " if instead[-1] == "?" else "; else " if "?" in instead else ", or "
    ways = f"{instead}{joint}{_DECLARING[declare]}" if declare else instead
    plain = f"{what.removesuffix(_IT_OCCURS)}{f': {instead}' * bool(instead)}".removesuffix("?")
    ending = "?" if instead[-1:] == "?" else "."
    return kind(f"{what} at column {column}: {ways}.", "", column, meant, span, plain + ending, declare)


def limit_passed(what: str, column: int, bound: int) -> errors.InputError:
    """A LimitError that names the bound."""
    return refusal(what, column, f"the limit is {bound:,}; shorten it", kind=errors.LimitError)


def at_most(count: int | Fraction, bound: int, what: str, column: int) -> None:
    """LimitError that says what is too large where the count is above the bound."""
    if count > bound:
        raise limit_passed(what, column, bound)


def shorten(text: str, length: int = 30) -> str:
    """At most `length` characters, none but printable ASCII, to be shown in a message."""
    plain = "".join(c if " " <= c <= "~" else "?" for c in text[: length + 1])
    return plain if len(plain) <= length else plain[: length - 1] + "..."


def joined(names: Sequence[str], most: int = 8) -> str:
    """The names as a short list for a message."""
    shown = ", ".join(shorten(name) for name in names[:most])
    return shown + (", ..." if len(names) > most else "") if names else "none"
