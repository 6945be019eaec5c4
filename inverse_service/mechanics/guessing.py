"""Which names in a text are parameters and arbitrary functions, where the writer did not say.

An unknown name followed by coordinates in brackets is a function of them; any other is a parameter,
unless it may be something else: kx, dx, sinx, or an r that no equation moves. Then the writer is
asked. What was guessed is shown to the writer.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from inverse_service.errors import InputError
from inverse_service.expressions.names import (
    ASK_FOR_THE_TIME,
    Names,
    looks_like_a_coordinate,
    readings,
)
from inverse_service.expressions.reader import read_tokens
from inverse_service.expressions.tokens import Token, refusal, shorten
from inverse_service.expressions.vocabulary import FUNCTIONS, REFUSED, REFUSED_UNLESS_DECLARED, RESERVED
from inverse_service.mechanics.coordinate_names import derived_stem

# Refused as functions or as numbers, so they would be a strange guess for a parameter too.
NEVER_GUESSED = (
    RESERVED | REFUSED.keys() | {"e", "E", "Pi"} | (REFUSED_UNLESS_DECLARED.keys() - {"I", "gamma", "Gamma", "zeta"})
)
FUNCTION_LETTERS = frozenset("fFhHUVW")


@dataclass(frozen=True, slots=True)
class Guess:
    """Names in the order in which they occur; `functions` with their arguments."""

    parameters: tuple[str, ...] = ()
    functions: dict[str, tuple[str, ...]] = field(default_factory=dict)


def guess_names(texts: Mapping[str, str], declared: Names) -> Guess:
    """What the texts, given by their pointers, use beyond what is declared and the coordinates.

    A text that cannot be read adds nothing: its fault is told where it is read. InputError, with what may
    have been meant, for a suspect name.
    """
    lines = {pointer: _tokens(text, declared) for pointer, text in texts.items()}
    coordinates = declared.coordinates
    found_functions: dict[str, tuple[str, ...]] = {}
    found_parameters: dict[str, tuple[str, Token]] = {}
    known = {*coordinates, *declared.declared(), *NEVER_GUESSED}
    for pointer, line in lines.items():
        for place, token in enumerate(line):
            names = {token.text, declared.spelling(token.text), derived_stem(token.text)}
            if token.kind != "name" or names & known:
                continue
            arguments = _arguments(line, place + 1, coordinates)
            if arguments and not _looks_like_a_function(token.text):
                found_functions.setdefault(token.text, arguments)
            elif not arguments and not _is_primed(line, place) and not _may_be_called(line, place):
                found_parameters.setdefault(token.text, (pointer, token))
    guessed = {name: at for name, at in found_parameters.items() if name not in found_functions}
    _ask_back(guessed, Names(coordinates, declared.parameters, {**declared.functions, **found_functions}))
    return Guess(tuple(guessed), found_functions)


def _ask_back(guessed: Mapping[str, tuple[str, Token]], names: Names) -> None:
    """InputError for the first name that may be no constant."""
    letters = tuple(name for name in guessed if len(name) == 1)
    together = Names(names.coordinates, (*names.parameters, *letters), names.functions)
    seen: dict[str, str] = {}
    for name, (pointer, token) in guessed.items():
        column, shown = token.column, f"the name '{shorten(name)}' is not declared; it stands"
        if meant := readings(name, together):
            instead = f'did you mean {" or ".join(meant)}? a constant of this name? add it to "parameters"'
            raise refusal(shown, column, instead, meant).at(pointer)
        if looks_like_a_coordinate(name):
            raise refusal(shown, column, ASK_FOR_THE_TIME, ("t",)).at(pointer)
        other = seen.setdefault(name.replace("_", ""), name)
        if other != name:
            raise refusal(shown, column, f"{other} stands too; write one of the two", (other,)).at(pointer)


def _tokens(text: str, declared: Names) -> list[Token]:
    try:
        return read_tokens(text, declared)
    except InputError:
        return []


def _looks_like_a_function(name: str) -> bool:
    """Whether the name may be sin or sqrt mistyped; then it is better refused than guessed."""
    return len(name) > 2 and bool(difflib.get_close_matches(name, FUNCTIONS, 1, 0.7))


def _is_primed(line: Sequence[Token], place: int) -> bool:
    return place + 1 < len(line) and line[place + 1].kind == "prime"


def _may_be_called(line: Sequence[Token], place: int) -> bool:
    """Whether f (x - y) stands there: a function rather than a factor, so the writer is asked."""
    after = line[place + 1 :][:1]
    return line[place].text in FUNCTION_LETTERS and bool(after) and after[0].is_operator("(")


def _arguments(line: Sequence[Token], place: int, coordinates: Sequence[str]) -> tuple[str, ...]:
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
