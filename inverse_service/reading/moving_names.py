"""Which coordinates a document means where it does not list them."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence

from inverse_service import errors
from inverse_service.expressions import refusals
from inverse_service.reading import reader
from inverse_service.reading.names import (
    DERIVATIVE_NAMES,
    DOTTED,
    GREEK_NAMES,
    Names,
    declared_name,
    escaped,
    looks_like_a_coordinate,
)
from inverse_service.reading.tokens import Token, closing, split_at_commas

_LONGEST_ARGUMENTS = 400


def moving_products(texts: Mapping[str, str], declared: Names, order: int = 2) -> dict[str, tuple[str, ...]]:
    """The runs of letters with primes that are products, mx'' of m and x'', y y'' and L I'' typed without a space."""
    lines = [line for text in texts.values() if (line := _tokens_or_none(text, declared))]
    words = [(line[k].text, is_primed(line, k)) for line in lines for k in range(len(line)) if line[k].kind == "name"]
    alone, primed = ({word for word, moves in words if moves is which} for which in (False, True))
    found: dict[str, tuple[str, ...]] = {}
    for line in lines:
        for name in moving_names(line, order):
            if (
                name in alone | GREEK_NAMES
                or declared.role(declared.spelling(name))
                or not name.replace("_", "").isalnum()
            ):
                continue
            for cut in range(1, len(name)):
                factor, moving = name[:cut], name[cut:]
                single = len(moving) == 1 or moving in GREEK_NAMES or re.fullmatch("[A-Za-z]_?[0-9]", moving)
                elsewhere = moving in alone | primed
                mechanical = _FACTOR_OF_MOTION.fullmatch(factor) or factor in GREEK_NAMES
                named = (looks_like_a_coordinate(moving) or moving in GREEK_NAMES) and mechanical
                plain = mechanical or (len(factor) < 3 and factor.isalpha() and not {*factor} & {*"dDeij"})
                bending = len(factor) == 2 and factor.isupper() and looks_like_a_coordinate(moving)  # E I y
                if single and moving != "t" and plain and (bending or elsewhere or named):
                    factors = [factor] if factor in GREEK_NAMES else re.findall("[A-Za-z][0-9]?", factor)
                    found.setdefault(name, (*factors, moving))
    return found


def _refuse_products(tokens: Sequence[Token], products: Mapping[str, tuple[str, ...]]) -> None:
    """InputError for mx'', which is m*x'' to its writer."""
    for place, token in enumerate(tokens):
        if token.text in products and is_primed(tokens, place):
            meant, primes = "*".join(products[token.text]), "'" * _primes(tokens[place + 1 :])[0]
            instead = f"did you mean {meant}{primes}?"
            raise refusals.refusal(
                f"{token.text}{primes} occurs", token.column, instead, (meant,), declare="coordinates"
            )


def _tokens_or_none(text: str, declared: Names) -> list[Token]:
    try:
        return reader.read_tokens(text, declared)
    except errors.InputError:
        return []


def inferred_coordinates(texts: Mapping[str, str], declared: Names, order: int = 2) -> tuple[str, ...]:
    """The names with this many time derivatives (x'', x_ddot, diff(x, t, 2), …), each once, in order.

    `texts` are given by their pointers; `declared` holds parameters and functions, which are no coordinates.
    """
    found: dict[str, None] = {}
    for pointer, text in texts.items():
        with reader.placed_at(pointer):
            tokens = reader.read_tokens(text, declared)
            if not declared.guesses:
                _refuse_products(tokens, moving_products({pointer: text}, declared, order))
        names = [name for name in moving_names(tokens, order) if declared.role(declared.spelling(name)) is None]
        found.update(dict.fromkeys(declared_name(name, pointer, "coordinate") for name in names))
    return tuple(found)


# What stands before an acceleration without a sign: m, ml, I, r.
_FACTOR_OF_MOTION = re.compile("([mMIJLCRlrabckgh][0-9]?){1,3}")


def key_coordinate(key: str, names: Names, pointer: str) -> str:
    """The coordinate that a key x, x'', x_ddot or \\ddot{x} of `equations` means; InputError if it is none."""
    name = names.spelling(key_name(key, names))
    if name not in names.coordinates:
        raise errors.InputError(
            f"there is an equation for '{refusals.shorten(key)}', which is not a coordinate: the coordinates are "
            f"{refusals.joined(names.coordinates)}.",
            pointer,
        )
    return name


def key_name(key: str, names: Names) -> str:
    """The name that a key of `equations` holds, with or without two derivatives."""
    pointer = f"/equations/{escaped(key)}"
    if names.role(key):
        return key
    try:
        tokens = reader.read_tokens(key[:200], names)
    except errors.InputError:
        tokens = []
    accelerated = moving_names(tokens, 2)
    if len(accelerated) == 1 and all(token.kind == "prime" for token in tokens[1:]):
        return accelerated[0]
    return declared_name(key, pointer, "coordinate")


def moving_names(tokens: Sequence[Token], order: int) -> list[str]:
    """The names that stand with at least this many time derivatives, in order of appearance; V''(x) is no motion."""
    return [name for name, times in _motions(tokens) if times >= order]


def _motions(tokens: Sequence[Token]) -> list[tuple[str, int]]:
    """Names with the number of their time derivatives, those of diff(diff(x, t), t) together."""
    found: list[tuple[str, int]] = []
    place = 0
    while place < len(tokens):
        token = tokens[place]
        place += 1
        if token.kind != "name":
            continue
        primes, after = _primes(tokens[place:])
        if token.text in DERIVATIVE_NAMES:
            inner, length = _differentiated(tokens[place : place + _LONGEST_ARGUMENTS])
            found += inner
            place += length
        elif primes and (after[:1] != ["("] or after == ["(", "t", ")"] or _multiplies_a_sum(token, tokens[place:])):
            found.append((token.text, primes))
        elif stem := derived_stem(token.text, 2) or derived_stem(token.text):
            found.append((stem, 2 if derived_stem(token.text, 2) else 1))
    return found


def _multiplies_a_sum(name: Token, after: Sequence[Token]) -> bool:
    """Whether the brackets after the primes are a factor: x''(1 + x^2), r'' (M + m); V''(x - y) is a function."""
    opening = next(place for place, token in enumerate(after) if token.kind != "prime")
    inside = after[opening + 2 : closing(after, opening)]
    plain = looks_like_a_coordinate(name.text) or name.text in GREEK_NAMES
    return plain and any(token.is_operator("+", "-") for token in inside)


def derived_stem(word: str, order: int = 1) -> str:
    """The x of x_ddot, xddot, x_dot_dot, of at least this order; empty for other words."""
    endings = (ending for ending, times in DOTTED if times >= order and word.endswith(ending))
    return next((word.removesuffix(ending) for ending in endings), "").rstrip("_")


def _primes(tokens: Sequence[Token]) -> tuple[int, list[str]]:
    """The order of the primes that come first, and the three texts after them."""
    primes = list(itertools.takewhile(lambda token: token.kind == "prime", tokens[:4]))
    after = [token.text for token in tokens[len(primes) : len(primes) + 3]]
    return sum(int(prime.value) for prime in primes), after


def _differentiated(tokens: Sequence[Token]) -> tuple[list[tuple[str, int]], int]:
    """The names that diff moves, from its bracket on, and how long that is: (x, t, 2), (x(t), (t, 2)), (m*x', t)."""
    end = closing(tokens, 0)
    if not 0 < end < len(tokens):
        return [], 0
    parts = split_at_commas(tokens[1:end])
    times = _times([token.text for part in parts[1:] for token in part])
    if not times:
        return [], end + 1
    first = parts[0]
    alone = [token.text for token in first[1:]] in ([], ["(", "t", ")"])
    inner = [(first[0].text, 0)] if alone and first and first[0].kind == "name" else _motions(first)
    return [(name, order + times) for name, order in inner], end + 1


def _times(words: Sequence[str]) -> int:
    """The order of a derivative by t, t and by t, 2 and by (t, 2); 0 where it is another."""
    plain = [word for word in words if word not in ("(", ")", ",")]
    if len(plain) == 2 and plain[0] == "t" and plain[1].isdigit():
        return int(plain[1])
    return len(plain) if all(word == "t" for word in plain) else 0


def is_primed(line: Sequence[Token], place: int) -> bool:
    return place + 1 < len(line) and line[place + 1].kind == "prime"
