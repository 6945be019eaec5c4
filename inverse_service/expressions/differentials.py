"""Quotients of differentials in plain text: dx/dt, d^2x/dt^2, dx'/dt, d/dt(m x'), (d/dt)^2 x, dV/dx, dV(x)/dx."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.errors import InputError
from inverse_service.expressions.names import Names
from inverse_service.expressions.tokens import Token, closing, refusal

_ABOVE = re.compile(r"d([2-9]?)([A-Za-z]\w*)?")
_BELOW = re.compile(r"d([A-Za-z]\w*?)([2-9]?)")
PARTIAL = "\u2202"


@dataclass(frozen=True, slots=True)
class _Part:
    """d^k u: the order, u or nothing, and how many tokens it took."""

    order: int
    name: Token | None
    length: int


def with_differentials(tokens: list[Token], names: Names) -> list[Token]:
    """The tokens with each quotient as primes on its name, or as diff( ); unclear ones stay, and are refused later."""
    if not any(token.text[:1] in ("d", PARTIAL) for token in tokens):
        return tokens
    found: list[Token] = []
    place = 0
    while place < len(tokens):
        quotient = None if found and found[-1].is_operator("/") else _quotient(tokens, place, names)
        written, place = quotient if quotient else ([tokens[place]], place + 1)
        found += written
    return found


def _quotient(tokens: list[Token], place: int, names: Names) -> tuple[list[Token], int] | None:
    """What the quotient that begins here is in our grammar, and the place after it; None where there is none."""
    if tokens[place].text == "d" and names.role("d") is None and (ended := _of_bracket(tokens, place, names)):
        return ended
    if power := _power_of_operator(tokens, place, names):
        return power
    above = _above(tokens, place, names)
    slash = place + (above.length if above else 0)
    if above is None or slash >= len(tokens):
        return None
    primes = 0  # those of dx'/dt
    while above.name is not None and slash < len(tokens) and tokens[slash].kind == "prime":
        primes, slash = primes + int(tokens[slash].value), slash + 1
    called: list[Token] = []  # the (x) of dV(x)/dx
    if above.name is not None and slash < len(tokens) and tokens[slash].is_operator("("):
        end = closing(tokens, slash) + 1
        called, slash = tokens[slash:end], end
    if slash >= len(tokens) or not tokens[slash].is_operator("/"):
        return None
    below = _below(tokens, slash + 1, above.order)
    if below is None or below.name is None:
        return None
    after = slash + 1 + below.length
    following = tokens[after] if after < len(tokens) else None
    if following is not None and following.is_operator("^"):
        return None  # dx/dt^2: of the quotient, or of t?
    first = tokens[place]
    if above.name is None:
        return _operator(tokens, after, below.name, above.order, names)
    if primes and (called or below.name.text != "t"):
        return None
    if called:
        return _call([above.name, *called], below.name, above.order), after
    role, by = names.role(names.spelling(above.name.text)), names.spelling(below.name.text)
    if below.name.text == "t" and role not in ("function", "parameter"):
        order = above.order + primes
        prime = Token("prime", "'" * order, first.column, False, Fraction(order))
        return [Token("name", above.name.text, first.column, first.space_before), prime], after
    if role is None and by in names.coordinates and names.role(tokens[slash + 1].text) is None:
        raise _of_what(above, by, names.coordinates, (first, tokens[after - 1]))
    return (_call([above.name], below.name, above.order), after) if role in ("function", "parameter") else None


def _of_what(above: _Part, by: str, coordinates: Sequence[str], ends: tuple[Token, Token]) -> InputError:
    """The refusal of dV/dx, from the first to the last token of it, where nothing says what V depends on."""
    name = above.name or Token("name", "V", 1)
    slope = f"diff({name.text}({', '.join(coordinates)}), {', '.join([by] * above.order)})"
    primed = f"{name.text}{above.order * chr(39)}({by}) or " if len(coordinates) == 1 and above.order < 3 else ""
    span = (ends[0].column, ends[1].column + len(ends[1].text))
    return refusal(f"a derivative of {name.text} by {by} occurs", name.column, f"write {primed}{slope}", (slope,), span)


def _of_bracket(tokens: list[Token], place: int, names: Names) -> tuple[list[Token], int] | None:
    """d(m x')/dt as diff(m x', t)."""
    if not tokens[place + 1 : place + 2] or not tokens[place + 1].is_operator("("):
        return None
    end = closing(tokens, place + 1)
    below = _below(tokens, end + 2, 1) if tokens[end + 1 : end + 2] and tokens[end + 1].is_operator("/") else None
    following = tokens[end + 2 + below.length :][:1] if below else []
    if below is None or below.name is None or (following and following[0].is_operator("^")):
        return None
    return _call(with_differentials(tokens[place + 2 : end], names), below.name, 1), end + 2 + below.length


def _above(tokens: list[Token], place: int, names: Names) -> _Part | None:
    first = tokens[place]
    partial = first.is_operator(PARTIAL)
    match = _ABOVE.fullmatch(first.text) if first.kind == "name" and names.role(first.text) is None else None
    if not partial and match is None:
        return None
    digit, word = (match[1], match[2]) if match else ("", None)
    if word:
        return _Part(int(digit or 1), Token("name", word, first.column, first.space_before), 1)
    order, length = (int(digit), 1) if digit else _power(tokens, place + 1)
    following = tokens[place + length] if place + length < len(tokens) else None
    if following is not None and following.kind == "name":
        return _Part(order, following, length + 1)
    return _Part(order, None, length)


def _power(tokens: list[Token], place: int) -> tuple[int, int]:
    """The k of ^k or ^(k) here, 1 where there is none, and the tokens up to there with the d before it."""
    texts = [token.text for token in tokens[place : place + 4]]
    if texts[:1] == ["^"] and len(texts) > 1 and texts[1].isdigit():
        return int(texts[1]), 3
    if texts[:2] == ["^", "("] and len(texts) == 4 and texts[2].isdigit() and texts[3] == ")":
        return int(texts[2]), 5
    return 1, 1


def _below(tokens: list[Token], place: int, order: int) -> _Part | None:
    """dt, dt^2, dt2, d t of this order."""
    if place >= len(tokens):
        return None
    first = tokens[place]
    match = _BELOW.fullmatch(first.text) if first.kind == "name" else None
    split = first.is_operator(PARTIAL) or first.text == "d"
    if match is None and not split:
        return None
    name = tokens[place + 1] if split and place + 1 < len(tokens) else first
    if match is not None and not split:
        name = Token("name", match[1], first.column)
    length = 1 + split
    if match is not None and not split and match[2]:
        return _Part(order, name, length) if int(match[2]) == order else None
    if order == 1:
        return _Part(order, name, length) if name.kind == "name" else None
    times, taken = _power(tokens, place + length)
    return _Part(order, name, length + taken - 1) if times == order and name.kind == "name" else None


def _power_of_operator(tokens: list[Token], place: int, names: Names) -> tuple[list[Token], int] | None:
    """(d/dt)^2 u as diff(u, t, t)."""
    end = closing(tokens, place) if tokens[place].is_operator("(") else len(tokens)
    if [token.text for token in tokens[place + 1 : place + 3]] != ["d", "/"] or names.role("d"):
        return None
    below = _below(tokens, place + 3, 1)
    power = [token.text for token in tokens[end + 1 : end + 3]]
    if below is None or below.name is None or place + 3 + below.length != end or power not in (["^", "2"], ["^", "1"]):
        return None
    return _operator(tokens, end + 3, below.name, int(power[1]), names)


def _operator(
    tokens: list[Token], place: int, variable: Token, order: int, names: Names
) -> tuple[list[Token], int] | None:
    """d/dt ( u ) as diff(u, t); d/dt x' too where nothing follows that may be differentiated with it."""
    if place >= len(tokens):
        return None
    if tokens[place].is_operator("("):
        end = closing(tokens, place)
        inner = tokens[place + 1 : end]
        if end == len(tokens):
            return None
    else:
        end = place
        while end + 1 < len(tokens) and tokens[end + 1].kind == "prime":
            end += 1
        if [token.text for token in tokens[end + 1 : end + 4]] == ["(", "t", ")"]:
            end += 3
        inner = tokens[place : end + 1]
        following = tokens[end + 1 : end + 2]
        ends = not following or following[0].kind == "newline" or following[0].is_operator(*"=+-,;)")
        if inner[0].kind not in ("name", "number"):
            return None
        if inner[0].kind == "number" or not ends:
            what = f"d/d{variable.text} stands before a product"
            raise refusal(what, variable.column, f"write what it differentiates in brackets, d/d{variable.text}(...)")
    after = tokens[end + 1 : end + 2]
    if after and after[0].is_operator("^"):
        return None
    return _call(with_differentials(inner, names), variable, order), end + 1


def _call(inner: list[Token], variable: Token, order: int) -> list[Token]:
    at = variable.column
    found = [Token("name", "diff", at, True), Token("operator", "(", at), *inner]
    for _ in range(order):
        found += [Token("operator", ",", at), Token("name", variable.text, at)]
    return [*found, Token("operator", ")", at)]
