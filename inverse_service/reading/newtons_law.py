"""Newton's law in words of school: m a = -k x - c v, in which a is x'' and v is x'.

It is read so in a text with no derivative, one name that can move, and a that occurs once, alone on
its side or behind a mass.
"""

import re
from collections.abc import Iterator
from typing import NamedTuple

from inverse_service.reading import names as nm, reader, time_derivatives
from inverse_service.reading.tokens import Line, Token, places, spelled, split_at, walk
from inverse_service.reading.typed_text import Change, Typed

_ACCELERATED = re.compile(r"(?:[mM][0-9]?)?\*?a")
_GLUED = re.compile(r"[a-zA-Z][xyzv]")  # kx, bv
_MOVING = ("x", "y", "z", "s")


class Read(NamedTuple):
    """The text with x'' for a and x' for v, and what each of them is read as."""

    typed: Typed
    meant: dict[str, str]


def with_derivatives(typed: Typed) -> Read | None:
    """What the law says; None for a text that says nothing of the kind."""
    text = typed.text
    if reader.is_latex(text) or "a" not in text or "'" in text:
        return None
    tokens = reader.tokens_if_any(text, nm.Names())
    names = [token for token in walk(tokens) if token.kind == "name"]
    moving = {one for token in names for one in _letters(token) if one in _MOVING}
    sides = [side for part in split_at(";,", tokens) for side in split_at("=", part)]
    accelerated = [side for side in sides if _ACCELERATED.fullmatch(spelled(side))]
    called = any(
        line[place + 1 : place + 2] and line[place + 1].is_bracket()
        for line, place, _ in places(tokens)
        if line[place].text in _MOVING
    )
    known = any(token.order or token.text in nm.DERIVATIVE_NAMES for token in names)
    if (
        known
        or called
        or len(moving) != 1
        or len(accelerated) != 1
        or len(sides) < 2
        or time_derivatives.moving_names(tokens, 1)
        or sum("a" in _letters(token) for token in names) != 1
        or any(spelled(side) == "v" for side in sides)
        or any(text[token.column - 1 :][: len(token.text)] != token.text for token in names)
    ):
        return None
    [name] = moving
    meant = {"a": f"{name}''", "v": f"{name}'"}
    changed = [*_changes(names, accelerated[0], meant)]
    used = {letter for token in names for letter in _letters(token)}
    told = {letter: new for letter, new in meant.items() if letter in used}
    return Read(typed.put(changed), told)


def _letters(token: Token) -> tuple[str, ...]:
    """The name, or the k and x of kx."""
    return (*token.text,) if _GLUED.fullmatch(token.text) or token.text == "ma" else (token.text,)


def _changes(names: Line, accelerated: Line, meant: dict[str, str]) -> Iterator[Change]:
    for token in names:
        letters = _letters(token)
        if "v" in letters or ("a" in letters and any(one is token for one in walk(accelerated))):
            start = token.column - 1
            new = " ".join(meant.get(letter, letter) for letter in letters)
            yield Change(start, start + len(token.text), new)
