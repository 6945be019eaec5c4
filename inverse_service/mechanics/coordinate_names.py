"""Which coordinates a document means where it does not list them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from inverse_service.errors import InputError
from inverse_service.expressions.names import DOTTED, Names, declared_name
from inverse_service.expressions.reader import read_tokens
from inverse_service.expressions.tokens import Token, joined, shorten
from inverse_service.expressions.vocabulary import DERIVATIVE_NAMES

_LONGEST_ARGUMENTS = 400


def inferred_coordinates(equations: Mapping[str, str] | Sequence[str] | str, declared: Names) -> tuple[str, ...]:
    """The keys, or the names with two time derivatives (x'', x_ddot, diff(x, t, 2), …), each once, in order.

    `declared` holds parameters and functions only, which are no coordinates.
    """
    if isinstance(equations, Mapping):
        return tuple(dict.fromkeys(_key_name(key, declared) for key in equations))
    texts = [equations] if isinstance(equations, str) else list(equations)
    found: dict[str, None] = {}
    for place, text in enumerate(texts):
        pointer = "/equations" if isinstance(equations, str) else f"/equations/{place}"
        if not isinstance(text, str):
            raise InputError("an equation is not a text: write it in quotation marks, as in \"x'' = -x\".", pointer)
        try:
            tokens = read_tokens(text, declared)
        except InputError as error:
            raise error.at(pointer) from None
        names = [name for name in accelerated_names(tokens) if declared.role(declared.spelling(name)) is None]
        found.update(dict.fromkeys(declared_name(name, pointer, "coordinate") for name in names))
    return tuple(found)


def key_coordinate(key: str, names: Names, pointer: str) -> str:
    """The coordinate that a key x, x'', x_ddot or \\ddot{x} of `equations` means; InputError if it is none."""
    name = names.spelling(_key_name(key, names))
    if name not in names.coordinates:
        raise InputError(
            f"there is an equation for '{shorten(key)}', which is not a coordinate: the coordinates are "
            f"{joined(names.coordinates)}.",
            pointer,
        )
    return name


def _key_name(key: str, names: Names) -> str:
    pointer = "/equations/" + key.replace("~", "~0").replace("/", "~1")
    if names.role(key):
        return key
    try:
        tokens = read_tokens(key[:200], names)
    except InputError:
        tokens = []
    accelerated = accelerated_names(tokens)
    if len(accelerated) == 1 and all(token.kind == "prime" for token in tokens[1:]):
        return accelerated[0]
    return declared_name(key, pointer, "coordinate")


def accelerated_names(tokens: Sequence[Token]) -> list[str]:
    """The names that stand with two time derivatives, in order of appearance."""
    found = []
    for place, token in enumerate(tokens):
        if token.kind != "name":
            continue
        if token.text in DERIVATIVE_NAMES:
            found += _differentiated(tokens[place + 1 :], 2)
        elif _primes(tokens[place + 1 : place + 4]) == 2:
            found.append(token.text)
        elif stem := _dotted_twice(token.text):
            found.append(stem)
    return found


def differentiated_names(tokens: Sequence[Token], order: int) -> list[str]:
    """The names of which a diff(…, t) makes a derivative of this order."""
    places = [place for place, token in enumerate(tokens) if token.kind == "name" and token.text in DERIVATIVE_NAMES]
    return [name for place in places for name in _differentiated(tokens[place + 1 :], order)]


def _dotted_twice(word: str) -> str:
    """The x of x_ddot, xddot, x_dot_dot; empty for other words."""
    endings = (ending for ending, order in DOTTED if order == 2 and word.endswith(ending))
    return next((word.removesuffix(ending) for ending in endings), "").rstrip("_")


def _primes(tokens: Sequence[Token]) -> int:
    order = 0
    for token in tokens:
        if token.kind != "prime":
            break
        order += int(token.value)
    return order


def _differentiated(tokens: Sequence[Token], order: int) -> list[str]:
    """The x of (x, t, t), (x, t, 2), (x, (t, 2)), (x(t), t, 2) for order 2, and of (x', t), (m*x', t)."""
    parts = _arguments(tokens[:_LONGEST_ARGUMENTS])
    times = _times([token.text for part in parts[1:] for token in part])
    if not 0 < times <= order:
        return []
    first, missing = parts[0], order - times
    if not missing:
        alone = [token.text for token in first[1:]] in ([], ["(", "t", ")"])
        return [first[0].text] if alone and first and first[0].kind == "name" else []
    return [
        token.text
        for place, token in enumerate(first)
        if token.kind == "name" and _primes(first[place + 1 : place + 4]) == missing
    ]


def _arguments(tokens: Sequence[Token]) -> list[list[Token]]:
    """The arguments in the bracket that comes first; none where it is not closed."""
    parts: list[list[Token]] = [[]]
    depth = 0
    for place, token in enumerate(tokens):
        depth += token.is_operator("(") - token.is_operator(")")
        if depth == 0:
            return parts if place else []
        if depth == 1 and token.is_operator(","):
            parts.append([])
        elif place:
            parts[-1].append(token)
    return []


def _times(words: Sequence[str]) -> int:
    """The order of a derivative by t, t and by t, 2 and by (t, 2); 0 where it is another."""
    plain = [word for word in words if word not in ("(", ")", ",")]
    if len(plain) == 2 and plain[0] == "t" and plain[1].isdigit():
        return int(plain[1])
    return len(plain) if all(word == "t" for word in plain) else 0
