"""Slices of arrays, y(1:3) of MATLAB and Julia and y[0:3] of Python, entry by entry: tokens in,
tokens out.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from inverse_service.reading import tokens as tk
from inverse_service.reading.tokens import Line, Token, Tokens, at

_NORM = "norm"
_LIST = {",", ";"}
_MOST_ENTRIES = 20
_MOST_NAMES = 10  # of slices, each of which is put in


class Slice(NamedTuple):
    """The entries `first` to `last` of an array."""

    first: int
    last: int

    @property
    def size(self) -> int:
        return self.last - self.first + 1


def without_slices(tokens: Tokens) -> Tokens:
    """[y(4); y(5); -y(1)/r; -y(2)/r] for [y(4:5); -y(1:2)/r], with r = sqrt(y(1)^2 + y(2)^2) for
    r = norm(y(1:2)).
    """
    if not any(token.is_operator(":") for token in tk.walk(tokens)):
        return tokens
    tokens = _with_both_ends(tokens)
    from_zero = any(
        line[place].is_bracket("[") and at(line[place].inside, 0).text == "0"
        for line, place, _ in tk.places(tokens)
    )
    tokens = _with_named_slices(tokens)
    return _by_entries(_with_norms(tokens, from_zero), from_zero)


def _with_both_ends(tokens: Tokens) -> Tokens:
    """The tokens with y[0:2] and y[2:4] for Python's y[:2] and y[2:], the two halves of y."""
    halves = {
        number.text
        for token in tk.walk(tokens)
        if token.is_bracket("[") and len(token.inside) == 2 and ":" in _signs_of(token)
        for number in token.inside
        if number.kind == "number"
    }
    if len(halves) != 1 or not (half := halves.pop()).isdigit():
        return tokens

    def with_ends(line: Line) -> Tokens:
        found: Tokens = []
        for token in line:
            inside = token.inside
            if token.is_bracket("[") and len(inside) == 2 and ":" in _signs_of(token):
                is_first = inside[0].is_operator(":")
                text = "0" if is_first else str(2 * int(half))
                end = tk.number_token(text, token.column, token.space_before)
                token = replace(token, inside=(end, *inside) if is_first else (*inside, end))
            found.append(tk.within(token, with_ends))
        return found

    return with_ends(tokens)


def _slice_at(line: Line, place: int, from_zero: bool) -> Slice | None:
    """The slice in the bracket after the name here."""
    inside = at(line, place + 1).inside
    if line[place].kind != "name" or [token.kind for token in inside] != [
        "number",
        "operator",
        "number",
    ]:
        return None
    if not inside[1].is_operator(":") or not (inside[0].text + inside[2].text).isdigit():
        return None
    half_open = from_zero and line[place + 1].is_bracket("[")
    found = Slice(int(inside[0].text), int(inside[2].text) - half_open)
    return found if 0 < found.size <= _MOST_ENTRIES else None


def _with_named_slices(tokens: Tokens) -> Tokens:
    """The tokens with y(1:3) for the r of r = y(1:3), and (-mu*y(1:3)) for a = -mu*y(1:3)."""
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    for _ in range(_MOST_NAMES):
        place = next((k for k, (part, _) in enumerate(parts) if _names_slice(part)), None)
        if place is None:
            break
        part, _ = parts.pop(place)
        formula = part[2:] if len(part) == 4 else [tk.bracket(part[2:], part[2])]
        meant = {part[0].text: formula}
        parts = [(_put_in(line, meant), end) for line, end in parts]
    return [token for part, end in parts for token in [*part, *([end] if end else [])]]


def _names_slice(part: Tokens) -> bool:
    """Whether this is r = y(1:3) or a = -mu*y(1:3)/norm(y(1:3))^3, but no list."""
    named = at(part, 0).kind == "name" and at(part, 1).is_operator("=") and len(part) > 2
    listed = any(token.is_bracket("[") and _LIST & {*_signs_of(token)} for token in part[2:])
    listed |= any(token.is_operator("@") for token in part)
    return named and not listed and any(_are_slices(part[2:]))


def _signs_of(bracket: Token) -> list[str]:
    return [token.text for token in bracket.inside if token.kind == "operator"]


def _are_slices(line: Line) -> list[bool]:
    """One entry for each slice outside a norm."""
    found: list[bool] = []
    for place, token in enumerate(line):
        if token.is_operator(":"):
            found.append(True)
        elif token.inside and at(line, place - 1).text != _NORM:
            found += _are_slices(token.inside)
    return found


def _put_in(line: Line, meant: Mapping[str, Tokens]) -> Tokens:
    found: Tokens = []
    for place, token in enumerate(line):
        given = place == 0 and at(line, 1).is_operator("=")
        if token.kind == "name" and token.text in meant and not token.order and not given:
            found += [replace(one, column=token.column) for one in meant[token.text]]
        else:
            found.append(tk.within(token, lambda inside: _put_in(inside, meant)))
    return found


def _with_norms(line: Line, from_zero: bool) -> Tokens:
    """sqrt(y(1)^2 + y(2)^2) for norm(y(1:2)) and np.linalg.norm(y[0:2])."""
    found: Tokens = []
    for token in line:
        token = tk.within(token, lambda inside: _with_norms(inside, from_zero))
        head = at(found, len(found) - 1)
        part = _slice_at(token.inside, 0, from_zero) if len(token.inside) == 2 else None
        if head.text != _NORM or part is None:
            found.append(token)
            continue
        found.pop()
        while at(found, len(found) - 1).is_operator("."):
            del found[-2:]
        squares: Tokens = []
        for k in range(part.first, part.last + 1):
            sign = [Token("operator", "+", token.column, True)] if squares else []
            power = tk.tokens_in_place("^2", token)
            squares += [*sign, *_entry(token.inside, 0, k), *power]
        root = replace(head, text="sqrt")
        found += [root, replace(tk.bracket(squares, token, space=False), end=token.end)]
    return found


def _entry(line: Line, place: int, k: int) -> Tokens:
    """y(k) for the y(1:3) here."""
    name, bracket = line[place], line[place + 1]
    index = tk.number_token(str(k), bracket.column, bracket.space_before)
    return [name, replace(bracket, inside=(index,))]


def _by_entries(line: Line, from_zero: bool) -> Tokens:
    """The tokens with one component for each entry of the slices in a component of a list."""
    found: Tokens = []
    for token in line:
        if not token.is_bracket("["):
            found.append(tk.within(token, lambda inside: _by_entries(inside, from_zero)))
            continue
        inside: Tokens = []
        sign = Token("operator", ";", token.column)
        for part, end in tk.split(token.inside, lambda _, one: one.is_operator(";", ",")):
            sign = replace(end or sign, column=token.column)  # the last part has the sign before it
            sizes = _sizes(part, from_zero)
            rows = [part]
            if len({*sizes}) == 1 and sizes[0] > 1:
                rows = [_row(part, k, from_zero) for k in range(sizes[0])]
            for row in rows[:-1]:
                inside += [*row, sign]
            inside += [*rows[-1], *([end] if end else [])]
        found.append(replace(token, inside=tuple(inside)))
    return found


def _sizes(line: Line, from_zero: bool) -> list[int]:
    """How many entries each slice has."""
    found = []
    for nested, place, _ in tk.places(line):
        if (part := _slice_at(nested, place, from_zero)) is not None:
            found.append(part.size)
    return found


def _row(line: Line, k: int, from_zero: bool) -> Tokens:
    """The component with the entry k of each slice."""
    found: Tokens = []
    place = 0
    while place < len(line):
        part = _slice_at(line, place, from_zero)
        if part is None:
            found.append(tk.within(line[place], lambda inside: _row(inside, k, from_zero)))
            place += 1
        else:
            found += _entry(line, place, part.first + k)
            place += 2
    return found
