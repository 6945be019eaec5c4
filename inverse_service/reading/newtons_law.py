"""Newton's law in words of school: m a = -k x - c v, in which a is x'' and v is x'.

It is read so in a text with no derivative, one name that can move, and a that occurs once, alone on
its side or behind a mass. The a may be v dv/dx; in Cartesian coordinates there may be a_x and a_y,
or ax and ay.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from inverse_service.reading import names as nm, reader, signs, time_derivatives
from inverse_service.reading.rules.sequences import either, find, maybe, one, part, sign, then
from inverse_service.reading.tokens import Line, Token, places, spelled, split_at, walk
from inverse_service.reading.typed_text import Change, Typed

_ACCELERATED = re.compile(r"(?:[mM][0-9]?)?\*?a")
_COMPONENT_ALONE = re.compile(r"(?:[mM][0-9]?\*?)?a_?(?P<name>[xyz])")
_COMPONENT = re.compile(r"(?P<rate>[av])_?(?P<name>[xyz])")
_NUMBERED_ALONE = re.compile(r"(?:[mM]_?[0-9]?\*?)?a(?P<name>_?[1-9])")
_NUMBERED = re.compile(r"(?P<rate>[av])(?P<name>_?[1-9])")
_NUMBERED_PLACE = re.compile(r"[xys](?P<name>_?[1-9])")
_MARKS = {"a": "''", "v": "'"}
_GLUED = re.compile(r"[a-zA-Z][xyzv]")  # kx, bv
_MOVING = ("x", "y", "z", "s")
_PLACE = part("place", sign(lambda text: text[:1] == "d" and text[1:] in (*_MOVING, "r")))
_SLOPE = then("dv", "/", _PLACE)
_ALONG = then(
    part("speed", one("v", "mv")),
    maybe("*"),
    either(_SLOPE, then("(", _SLOPE, ")"), then("\\frac", "{", "dv", "}", "{", _PLACE, "}")),
)


class Read(NamedTuple):
    """The text with x'' for a and x' for v, and what each of them is read as."""

    typed: Typed
    meant: dict[str, str]


def with_derivatives(typed: Typed) -> Read | None:
    """What the law says; None for a text that says nothing of the kind."""
    found = _along_its_path(typed)
    if found is not None or (plain := _plain(typed)) is None:
        return found
    return _by_components(plain) or _by_numbers(plain) or _by_names(plain)


def _along_its_path(typed: Typed) -> Read | None:
    """The law with v dv/dx for x'', in a text with no other derivative."""
    [*found] = find(_ALONG, typed.text)
    if len(found) != 1:
        return None
    [rate] = found
    others = [
        each for each in signs.of(typed.text) if not rate.span.start <= each.start < rate.span.stop
    ]
    name = str(rate["place"]).removeprefix("d")
    derived = {f"d{letter}" for letter in (*_MOVING, "r", "v")} - {f"d{name}"}
    if any(each.text in derived or set(each.text) & {*"'\u2032"} for each in others):
        return None
    mass = "m " if rate["speed"] == "mv" else ""
    changed = [Change(rate.span.start, rate.span.stop, f"{mass}{name}''")]
    for each in others:
        if each.text == "v" or (_GLUED.fullmatch(each.text) and each.text[1] == "v"):
            changed.append(Change(each.start, each.stop, f"{each.text[:-1]} {name}'".strip()))
    return Read(typed.put(changed), {"v dv/d" + name: f"{name}''", "v": f"{name}'"})


@dataclass(frozen=True, slots=True)
class _Plain:
    """A text that has no derivative: its tokens, its names, and the sides of its equations."""

    typed: Typed
    tokens: Line
    names: Line
    sides: Sequence[Line]


def _plain(typed: Typed) -> _Plain | None:
    """The text, if it may say the law by a; None if it has derivatives."""
    text = typed.text
    if reader.is_latex(text) or "a" not in text or "'" in text:
        return None
    tokens = reader.tokens_if_any(text, nm.Names())
    names = [token for token in walk(tokens) if token.kind == "name"]
    if (
        any(token.order or token.text in nm.DERIVATIVE_NAMES for token in names)
        or any(text[token.column - 1 :][: len(token.text)] != token.text for token in names)
        or time_derivatives.moving_names(tokens, 1)
    ):
        return None
    sides = [side for part in split_at(";,", tokens) for side in split_at("=", part)]
    return _Plain(typed, tokens, names, sides)


def _by_components(plain: _Plain) -> Read | None:
    """The law with a_x for x''; ax alone may be a x."""
    alone = [found for side in plain.sides if (found := _COMPONENT_ALONE.fullmatch(spelled(side)))]
    each = [(token, found) for token in plain.names if (found := _COMPONENT.fullmatch(token.text))]
    accelerated = [found["name"] for _, found in each if found["rate"] == "a"]
    moving = {token.text for token in plain.names}.intersection("xyz")
    moving |= {found["name"] for _, found in each}
    if (
        not alone
        or len(plain.sides) != 2 * len(alone)
        or (len(alone) == 1 and "_" not in alone[0].group())
        or sorted(accelerated) != sorted({found["name"] for found in alone})
        or not moving.issubset(accelerated)
    ):
        return None
    return _with_rates(plain, each, dict(zip(moving, moving, strict=True)))


def _by_numbers(plain: _Plain) -> Read | None:
    """The law with a1 for x1'' and v1 for x1', an equation for each of x1, x2, ..."""
    alone = [found for side in plain.sides if (found := _NUMBERED_ALONE.fullmatch(spelled(side)))]
    each = [(token, found) for token in plain.names if (found := _NUMBERED.fullmatch(token.text))]
    accelerated = [found["name"] for _, found in each if found["rate"] == "a"]
    moving = {
        found["name"]: token.text
        for token in plain.names
        if (found := _NUMBERED_PLACE.fullmatch(token.text))
    }
    if (
        not alone
        or len(plain.sides) != 2 * len(alone)
        or sorted(accelerated) != sorted({found["name"] for found in alone})
        or {*moving} != {*accelerated}
        or not {found["name"] for _, found in each} <= {*moving}
    ):
        return None
    return _with_rates(plain, each, moving)


def _with_rates(
    plain: _Plain, each: Sequence[tuple[Token, re.Match[str]]], moving: Mapping[str, str]
) -> Read:
    """The law with a rate of what moves for each of these names."""
    meant, changed = dict[str, str](), list[Change]()
    for token, found in each:
        meant[token.text] = f"{moving[found['name']]}{_MARKS[found['rate']]}"
        start = token.column - 1
        changed.append(Change(start, start + len(token.text), meant[token.text]))
    return Read(plain.typed.put(changed), meant)


def _by_names(plain: _Plain) -> Read | None:
    """The law with a for x''."""
    names, sides = plain.names, plain.sides
    moving = {one for token in names for one in _letters(token) if one in _MOVING}
    accelerated = [side for side in sides if _ACCELERATED.fullmatch(spelled(side))]
    called = any(
        line[place + 1 : place + 2] and line[place + 1].is_bracket()
        for line, place, _ in places(plain.tokens)
        if line[place].text in _MOVING
    )
    if (
        called
        or len(moving) != 1
        or len(accelerated) != 1
        or len(sides) < 2
        or sum("a" in _letters(token) for token in names) != 1
        or any(spelled(side) == "v" for side in sides)
    ):
        return None
    [name] = moving
    meant = {"a": f"{name}''", "v": f"{name}'"}
    changed = [*_changes(names, accelerated[0], meant)]
    used = {letter for token in names for letter in _letters(token)}
    told = {letter: new for letter, new in meant.items() if letter in used}
    return Read(plain.typed.put(changed), told)


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
