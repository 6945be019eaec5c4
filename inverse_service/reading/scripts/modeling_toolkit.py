"""The declarations of ModelingToolkit, @variables t x(t) = 1 and @parameters m k, a language of its own
within Julia.
"""

from __future__ import annotations

import re

from inverse_service.reading.scripts import nodes as nd
from inverse_service.reading.scripts.grammar import Token

DECLARE = ("variables", "parameters", "constants", "independent_variables")
NAMED = ("named", "mtkbuild", "mtkcompile")
# using ModelingToolkit: t_nounits as t, D_nounits as D
_OPERATOR = re.compile(r"\bD(?:_nounits)?\b(?:[ \t]+as[ \t]+(\w+))?")
_TIME = re.compile(r"\bt_nounits[ \t]+as[ \t]+(\w+)")
_SIZES = re.compile(r"1:(\d{1,2})(?:,1:(\d{1,2}))?")  # K[1:2, 1:2]
_MOST_ENTRIES = 36


def declares(text: str) -> bool:
    """Whether a program declares names of this language."""
    return any(f"@{word}" in text for word in DECLARE)


def imported(line: str, at: int) -> list[nd.Node]:
    """D = Differential(t) for the operator that a line of imports names."""
    found = _OPERATOR.search(line)
    if found is None or "D_nounits" not in line:
        return []
    timed = _TIME.search(line)
    time = nd.Name(at, timed[1] if timed else "t")
    made = nd.Call(at, nd.Name(at, "Differential"), (time,))
    return [nd.Assign(at, nd.Name(at, found[1] or "D_nounits"), made)]


def declared(line: list[Token]) -> list[nd.Node]:
    """The names of a declaration whose tokens are these; values and texts beside them are left out.

    A name with a bracket, x(t), moves; x(t)[1:2] has two entries; a name alone is a letter.
    """
    found: list[nd.Node] = []
    place = 0
    while place < len(line):
        token = line[place]
        place += 1
        if token.kind != "name" or token.text in ("begin", "end"):
            continue
        moves = place < len(line) and line[place].text == "(" and not line[place].blank
        if moves:
            stop = _behind(line, place)
            if any(one.text in (",", ".") for one in line[place:stop]):  # u(t, x), u(..)
                raise nd.Trap("a function of several variables", token.at)
            place = stop
        count = columns = 0
        if place < len(line) and line[place].text == "[" and not line[place].blank:
            stop = _behind(line, place)
            sizes = _SIZES.fullmatch("".join(one.text for one in line[place + 1 : stop - 1]))
            if sizes is None or (moves and sizes[2]):
                raise nd.Trap("an array of names", token.at)
            count, place, columns = int(sizes[1]), stop, int(sizes[2] or 0)
            if not moves and place < len(line) and line[place].text == "(":  # x[1:2](t)
                moves, place = True, _behind(line, place)
        if not count * max(columns, 1) <= _MOST_ENTRIES:
            raise nd.Trap("an array of names", token.at)
        found.append(_made(token, moves, count, columns))
        if place < len(line) and line[place].text in ("=", "~"):
            place = _behind_value(line, place + 1)
        if place < len(line) and line[place].text == ",":
            place += 1
        if place < len(line) and line[place].text == "[":  # [description = "..."]
            place = _behind(line, place)
    return found


def _made(token: Token, moves: bool, count: int, columns: int) -> nd.Node:
    at, kind = token.at, "dynamicsymbols" if moves else "Symbol"

    def one(word: str) -> nd.Node:
        return nd.Call(at, nd.Name(at, kind), (nd.Constant(at, word),))

    if not count:
        return nd.Assign(at, nd.Name(at, token.text), one(token.text))
    words = [f"{token.text}_{k + 1}" for k in range(count)]
    made = nd.Items(at, tuple(map(one, words)))
    if columns:
        rows = [[one(f"{word}_{k + 1}") for k in range(columns)] for word in words]
        made = nd.Items(at, tuple(nd.Items(at, tuple(row)) for row in rows), True)
    return nd.Assign(at, nd.Name(at, token.text), nd.Call(at, nd.Name(at, nd.MORE), (made,)))


def _behind(line: list[Token], place: int) -> int:
    """The place behind the bracket that opens at one."""
    depth = 0
    for k in range(place, len(line)):
        depth += (line[k].text in ("(", "[", "{")) - (line[k].text in (")", "]", "}"))
        if not depth:
            return k + 1
    raise nd.NotRead("a bracket that is not closed", line[place].at)


def _behind_value(line: list[Token], place: int) -> int:
    """The place behind a value, whose signs have no blank on one side alone: x(t) = 1 y(t) = -2."""
    while place < len(line):
        token = line[place]
        if token.text in ("(", "[", "{"):
            place = _behind(line, place)
        else:
            place += 1
        if place >= len(line) or line[place].text in (",", "="):
            return place
        after = line[place]
        ends = token.kind in ("name", "number") or token.text in (")", "]", "(", "[")
        begins = after.kind in ("name", "number") and after.blank
        if ends and begins:
            return place
    return place
