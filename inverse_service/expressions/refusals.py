"""Size limits of formulas, and errors that say what is wrong, where, and what to write instead."""

import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

from inverse_service import errors

_TIMES: ContextVar[tuple[int, int]] = ContextVar("times", default=(1, 1))
DECLARING = {
    "parameters": 'add it to "parameters"',
    "coordinates": 'add it to "coordinates"',
    "functions": 'declare a function of your own in "functions" with its arguments',
}
_IT_OCCURS = "; it occurs"  # inserted before the column if the description is already a sentence
_MOST_LISTED = 8  # names in a message


@cache
def sentences() -> dict[str, dict[str, Any]]:
    """The rows of the table by name, which is read with the first error."""
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


@dataclass(frozen=True, slots=True)
class Limits:
    """The largest accepted sizes, all of them counts.

    `depth` bounds the nesting of the text and of the tree, so that recursion over a tree is safe.
    `digits` bounds the digits of one number, whether typed or computed while parsing (one bound for
    both, so that printed formulas are accepted again). `exponent` bounds the numerator and
    denominator of a numeric exponent, `decimal_exponent` the k of 1e-k and 1ek, and
    `derivative_nodes` the size of a formula that `diff` differentiates.
    """

    characters: int = 20_000
    tokens: int = 8_000
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
def longer_texts(times: int, more_tokens: int = 1) -> Iterator[None]:
    """Within the block, multiply the limits on characters and tokens, because programs print more
    than people type; that on tokens also by `more_tokens`.
    """
    token = _TIMES.set((times, times * more_tokens))
    try:
        yield
    finally:
        _TIMES.reset(token)


def most_characters() -> int:
    """The current limit on the characters of one text."""
    return LIMITS.characters * _TIMES.get()[0]


def most_tokens(equations: int = 1) -> int:
    """The current limit on the tokens of one text, which may have as many for each of its equations
    as long as these are not more than coordinates may be.
    """
    each = equations if 1 <= equations <= LIMITS.coordinates else 1
    return LIMITS.tokens * _TIMES.get()[1] * each


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

    `meant` are possible replacements of the name at the column, or of `span`; `declare` is the
    member of the document that could declare the name.
    """
    joint = (
        ""
        if not instead
        else " else "
        if instead[-1] == "?"
        else "; else "
        if "?" in instead
        else ", or "
    )
    ways = f"{instead}{joint}{DECLARING[declare]}" if declare else instead
    plain = f"{what.removesuffix(_IT_OCCURS)}{f': {instead}' * bool(instead)}".removesuffix("?")
    ending = "?" if instead[-1:] == "?" else "."
    return kind(
        f"{what} at column {column}: {ways}.", "", column, meant, span, plain + ending, declare
    )


def fault(
    key: str,
    at: int | str,
    span: tuple[int, int] | None = None,
    meant: tuple[str, ...] = (),
    /,
    **words: object,
) -> errors.InputError:
    """The error with the sentence of a row of `refusals.toml`, in which the words are put in their
    places.

    `at` is the column, or the pointer of a member of the document as a whole. Nothing is offered if
    a word is None.
    """
    row = sentences()[key]
    what, instead = (row.get(part, "").format(**words) for part in ("what", "instead"))
    if isinstance(at, str):
        return errors.InputError(f"{what}: {instead}.", at)
    offers = (
        *meant,
        *(offer.format(**words) for offer in row.get("meant", ()) if None not in words.values()),
    )
    return refusal(what, at, instead, offers, span, row.get("declare", ""))


def limit_passed(what: str, column: int, bound: int) -> errors.InputError:
    """A LimitError that names the bound."""
    return refusal(what, column, f"the limit is {bound:,}; shorten it", kind=errors.LimitError)


def at_most(count: int | Fraction, bound: int, what: str, column: int) -> None:
    """LimitError that says what is too large if the count exceeds the bound."""
    if count > bound:
        raise limit_passed(what, column, bound)


def shorten(text: str, length: int = 30) -> str:
    """At most `length` characters of printable ASCII for a message."""
    plain = "".join(c if " " <= c <= "~" else "?" for c in text[: length + 1])
    return plain if len(plain) <= length else plain[: length - 1] + "..."


def listed_names(names: Sequence[str]) -> str:
    """The names as a short list for a message."""
    shown = ", ".join(shorten(name) for name in names[:_MOST_LISTED])
    return shown + (", ..." if len(names) > _MOST_LISTED else "") if names else "none"
