"""Which names in a text are coordinates, parameters and arbitrary functions, where the writer did not say.

A name with two primes is a coordinate (with one, where a Lagrangian is given); an unknown name
followed by coordinates in brackets is a function of them; any other unknown name is a parameter.
What was guessed is shown to the writer.
"""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from inverse_service.errors import InputError
from inverse_service.expressions.names import Names
from inverse_service.expressions.reader import read_tokens
from inverse_service.expressions.tokens import Token
from inverse_service.expressions.vocabulary import FUNCTIONS, REFUSED, RESERVED
from inverse_service.mechanics.coordinate_names import differentiated_names

# Refused as functions, so they would be a strange guess for a parameter too.
NEVER_GUESSED = RESERVED | REFUSED.keys() | {"e", "E"}
FUNCTION_LETTERS = frozenset("fFhHUVW")
ENDINGS = (("_ddot", 2), ("_dot", 1), ("ddot", 2), ("dot", 1))


@dataclass(frozen=True, slots=True)
class Guess:
    """Names in the order in which they occur; `functions` with their arguments."""

    coordinates: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    functions: dict[str, tuple[str, ...]] = field(default_factory=dict)


def guess_names(
    texts: Iterable[str], coordinates: Sequence[str], parameters: Sequence[str], functions: Iterable[str], order: int
) -> Guess:
    """What the texts use beyond what is declared; `order` is that of the derivative which makes a coordinate.

    A text that cannot be read adds nothing: its fault is told where it is read.
    """
    tokens = [_tokens(text, coordinates, parameters) for text in texts]
    declared = {*parameters, *functions}
    if not coordinates:
        derived = dict.fromkeys(name for line in tokens for name in _derived(line, order))
        coordinates = tuple(name for name in derived if name not in declared)
    known = {*coordinates, *declared, *NEVER_GUESSED}
    found_functions: dict[str, tuple[str, ...]] = {}
    found_parameters: dict[str, None] = {}
    for line in tokens:
        for place, token in enumerate(line):
            if token.kind != "name" or token.text in known or _stem(token.text, coordinates):
                continue
            arguments = _arguments(line, place + 1, coordinates)
            if arguments and not _looks_like_a_function(token.text):
                found_functions.setdefault(token.text, arguments)
            elif not arguments and not _is_primed(line, place) and not _may_be_called(line, place):
                found_parameters[token.text] = None
    guessed = tuple(name for name in found_parameters if name not in found_functions)
    return Guess(tuple(coordinates), guessed, found_functions)


def _tokens(text: str, coordinates: Sequence[str], parameters: Sequence[str]) -> list[Token]:
    try:
        return read_tokens(text, Names(tuple(coordinates), tuple(parameters)))
    except InputError:
        return []


def _derived(line: list[Token], order: int) -> list[str]:
    """The names that stand with a derivative of this order."""
    found = []
    for place, token in enumerate(line):
        if token.kind != "name" or token.text in NEVER_GUESSED:
            continue
        primes = list(itertools.takewhile(lambda following: following.kind == "prime", line[place + 1 :]))
        after = [following.text for following in line[place + 1 + len(primes) :][:3]]
        if sum(prime.value for prime in primes) >= order and (after[:1] != ["("] or after == ["(", "t", ")"]):
            found.append(token.text)
        found += [token.text.removesuffix(end) for end, k in ENDINGS if k >= order and _has_stem(token.text, end)][:1]
    return [*found, *differentiated_names(line, order)]


def _has_stem(name: str, ending: str) -> bool:
    return name.endswith(ending) and len(name) > len(ending)


def _stem(name: str, coordinates: Sequence[str]) -> bool:
    return any(_has_stem(name, end) and name.removesuffix(end) in coordinates for end, _ in ENDINGS)


def _looks_like_a_function(name: str) -> bool:
    """Whether the name may be sin or sqrt mistyped; then it is better refused than guessed."""
    return len(name) > 2 and bool(difflib.get_close_matches(name, FUNCTIONS, 1, 0.7))


def _is_primed(line: list[Token], place: int) -> bool:
    return place + 1 < len(line) and line[place + 1].kind == "prime"


def _may_be_called(line: list[Token], place: int) -> bool:
    """Whether f (x - y) stands there: a function rather than a factor, so the writer is asked."""
    after = line[place + 1 :][:1]
    return line[place].text in FUNCTION_LETTERS and bool(after) and after[0].is_operator("(")


def _arguments(line: list[Token], place: int, coordinates: Sequence[str]) -> tuple[str, ...]:
    """The coordinates in brackets after a name and its primes; nothing where something else stands there."""
    while place < len(line) and line[place].kind == "prime":
        place += 1
    if place >= len(line) or not line[place].is_operator("("):
        return ()
    found: list[str] = []
    for token in line[place + 1 :]:
        if token.is_operator(")"):
            return tuple(found) if len(set(found)) == len(found) else ()
        if token.kind == "name" and token.text in coordinates:
            found.append(token.text)
        elif not token.is_operator(","):
            return ()
    return ()
