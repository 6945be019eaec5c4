r"""Derivatives written with d: dx/dt, d^2x/dt^2, \frac{d}{dt}(m x'), (d/dt)^2 x, dV(x)/dx; and (r^2 x')'.

A fraction of LaTeX comes as ((above)/(below)), its first bracket marked FRACTION, so that one reader knows them all.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service import errors
from inverse_service.expressions import refusals
from inverse_service.reading.names import Names
from inverse_service.reading.tokens import FRACTION, PARTIAL, TOTAL, Token, closing, unexpected

_ABOVE = re.compile(r"d([2-9]?)([A-Za-z]\w*)?")
_BELOW = re.compile(r"d([A-Za-z]\w*?)([2-9]?)")
_DIGITS = tuple("123456789")
_CLEAR = ("=", "+", "-", ",", ";", ")", "&", "<", ">")


@dataclass(frozen=True, slots=True)
class _Quotient:
    """d^k u/dx…: the tokens of u (none for an operator), the variables, one for each order, and the place after it."""

    operand: list[Token]
    variables: tuple[Token, ...]
    after: int
    partial: bool
    fraction: bool

    @property
    def order(self) -> int:
        return len(self.variables)


def with_derivatives(tokens: list[Token], names: Names, depth: int = 0) -> list[Token]:
    """The tokens with each derivative as primes on its name, or as diff( ); unclear ones stay, to be refused later."""
    marks = {token.text[:1] for token in tokens}
    primed = any(a.is_operator(")") and b.kind == "prime" for a, b in itertools.pairwise(tokens))
    if not primed and not marks & {"d", PARTIAL, TOTAL}:
        return tokens
    if depth > refusals.LIMITS.depth:
        refusals.at_most(depth, refusals.LIMITS.depth, "the formula is nested too deeply", tokens[0].column)
    found: list[Token] = []
    place = 0
    while place < len(tokens):
        after_slash = bool(found) and found[-1].is_operator("/") and not _is_fraction(tokens, place)
        read = None if after_slash else _derivative(tokens, place, names, depth)
        written, place = read if read else ([tokens[place]], place + 1)
        found += written
    return found


def second_derivatives(tokens: list[Token]) -> Iterator[tuple[str, str]]:
    """(y, x) for each d^2y/dx^2, d^2/dx^2 y and y''(x), whatever y and x are."""
    for place in range(len(tokens)):
        after = place + 1
        while after < len(tokens) and tokens[after].kind == "prime":
            after += 1
        order = sum(int(prime.value) for prime in tokens[place + 1 : after])
        called = [token.text for token in tokens[after : after + 3]][::2] in (["(", ")"], ["[", "]"])
        if tokens[place].kind == "name" and order == 2 and called and tokens[after + 1].kind == "name":
            yield tokens[place].text, tokens[after + 1].text
        found = _quotient(tokens, place, Names())
        if found is None or found.order != 2 or len({token.text for token in found.variables}) > 1:
            continue
        name = found.operand[0] if found.operand else tokens[found.after] if found.after < len(tokens) else None
        if name is not None and name.kind == "name":
            yield name.text, found.variables[0].text


def _derivative(tokens: list[Token], place: int, names: Names, depth: int) -> tuple[list[Token], int] | None:
    """What the derivative that begins here is in our grammar, and the place after it; None where there is none."""
    if tokens[place].is_operator("("):
        if power := _power_of_operator(tokens, place, names, depth):
            return power
        end = closing(tokens, place)
        after = end + 1
        while after < len(tokens) and tokens[after].kind == "prime":
            after += 1
        called = place > 0 and tokens[place - 1].kind in ("name", "prime") and not tokens[place].space_before
        if after > end + 1 and not called:
            order = sum(int(prime.value) for prime in tokens[end + 1 : after])
            inner = with_derivatives(tokens[place + 1 : end], names, depth + 1)
            return _carried_out(inner, [Token("name", "t", tokens[end].column)] * order, tokens[place]), after
    quotient = _quotient(tokens, place, names)
    if quotient is None:
        _refuse_fraction(tokens, place, names)
        return None
    following = tokens[quotient.after] if quotient.after < len(tokens) else None
    if following is not None and following.is_operator("^") and not quotient.fraction:
        return None  # dx/dt^2: of the quotient, or of t?
    if not quotient.operand:
        return _applied(tokens, quotient, place, names, depth)
    return _of_operand(tokens, quotient, place, names, depth)


def _of_operand(
    tokens: list[Token], quotient: _Quotient, place: int, names: Names, depth: int
) -> tuple[list[Token], int] | None:
    """dx/dt as x', dV/dx as diff(V, x)."""
    operand, variables, first = quotient.operand, quotient.variables, tokens[place]
    by = [names.spelling(variable.text) for variable in variables]
    if operand[0].is_operator("("):
        return _carried_out(with_derivatives(operand[1:-1], names, depth + 1), variables, first), quotient.after
    primes = [token for token in operand if token.kind == "prime"]
    called, name = operand[-1].is_operator(")"), operand[0]
    role = names.role(names.spelling(name.text))
    if called and [token.text for token in operand[1 + len(primes) :]] == ["(", "t", ")"] and role != "function":
        called, operand = False, operand[: 1 + len(primes)]
    in_time, declared = {*by} == {"t"}, role in ("function", "parameter")
    if quotient.partial and "t" in by and quotient.fraction:
        return None
    if called and not primes:
        arguments = {token.text for token in operand[2:-1] if not token.is_operator(",")}
        if quotient.fraction and not {variable.text for variable in variables} <= arguments - {"t"}:
            _refuse_fraction(tokens, place, names)
            return None
        return _carried_out(operand, variables, first), quotient.after
    if in_time and not declared:
        order = len(by) + sum(int(prime.value) for prime in primes)
        prime = Token("prime", "'" * order, first.column, False, Fraction(order))
        return [Token("name", name.text, first.column, first.space_before), prime], quotient.after
    if primes:
        return None
    follows = tokens[quotient.after : quotient.after + 1]
    if declared and quotient.fraction and follows and follows[0].is_operator("(") and follows[0].value != FRACTION:
        instead = f"write {name.text}'({variables[0].text}), or * before a factor"
        raise refusals.refusal("a bracket follows a derivative", follows[0].column, instead)
    if declared or (role is None and names.guesses and "t" not in by):
        return _carried_out(operand, variables, first), quotient.after
    if (role is None and {*by} <= {*names.coordinates}) or (quotient.fraction and not in_time):
        if not quotient.partial and names.role("d") is not None:
            return None
        raise _of_what(name, by, names.coordinates, (first, tokens[quotient.after - 1]), quotient.fraction)
    return None


def _of_what(
    name: Token, by: Sequence[str], coordinates: Sequence[str], ends: tuple[Token, Token], fraction: bool
) -> errors.InputError:
    """The refusal of dV/dx, from the first to the last token of it, where nothing says what V depends on."""
    slope = f"diff({name.text}({', '.join(coordinates)}), {', '.join(by)})"
    primed = f"{name.text}{len(by) * chr(39)}({by[0]}) or " if len(coordinates) == 1 and len(by) < 3 else ""
    span = None if fraction else (ends[0].column, ends[1].column + len(ends[1].text))
    what, column = f"a derivative of {name.text} by {by[0]} occurs", name.column
    if fraction:
        return refusals.refusal(what, ends[0].column, f"write {name.text}'({by[0]})", declare="functions")
    return refusals.refusal(what, column, f"write {primed}{slope}", (slope,), span)


def _applied(
    tokens: list[Token], quotient: _Quotient, place: int, names: Names, depth: int
) -> tuple[list[Token], int] | None:
    """d/dt ( u ) as diff(u, t); d/dt x' too where nothing follows that may be differentiated with it."""
    if quotient.after >= len(tokens):
        return None
    operand = _operand(tokens, quotient, names, depth)
    if operand is None:
        return None
    inner, after = operand
    in_time = "t" in [variable.text for variable in quotient.variables]
    texts = [token.text for token in tokens[quotient.after : after]]
    timed = any(texts[k : k + 3] == ["(", "t", ")"] for k in range(len(texts)))
    if quotient.partial and in_time and not timed:
        instead = "write d/dt( and ) for the derivative along the motion"
        raise refusals.refusal("a partial derivative by the time occurs", tokens[place].column, instead)
    return _carried_out(inner, quotient.variables, tokens[place]), after


def _operand(tokens: list[Token], quotient: _Quotient, names: Names, depth: int) -> tuple[list[Token], int] | None:
    """What an operator is applied to: a bracket, a derivative, or a name that nothing follows."""
    place = quotient.after
    first, variable = tokens[place], quotient.variables[0].text
    refusals.at_most(depth + 1, refusals.LIMITS.depth, "the formula is nested too deeply", first.column)
    if nested := _derivative(tokens, place, names, depth + 1):
        return nested
    bracket = first.is_operator("(") and first.value != FRACTION
    end = place
    if bracket:
        end = closing(tokens, place)
        if end == len(tokens):
            return None
    elif first.kind == "name":
        while end + 1 < len(tokens) and tokens[end + 1].kind == "prime":
            end += 1
    elif not quotient.fraction and first.kind != "number":
        return None
    arguments = 0 if bracket or first.kind != "name" else _arguments(tokens, end + 1, first, names)
    end += arguments
    following = tokens[end + 1] if end + 1 < len(tokens) else None
    ends = following is None or following.kind == "newline" or following.is_operator(*_CLEAR)
    multiplied = following is not None and (
        following.is_operator("*", "/") or (_is_fraction(tokens, end + 1) and _quotient(tokens, end + 1, names))
    )
    raised = following is not None and following.is_operator("^")
    if raised or not (bracket or (first.kind == "name" and (ends or (arguments and multiplied)))):
        what = f"where the derivative ends is not clear, d/d{variable} stands before a product"
        column = following.column if following is not None else first.column
        raise refusals.refusal(what, column, f"write what it differentiates in brackets, d/d{variable}(...)")
    inner = with_derivatives(tokens[place + bracket : end + 1 - bracket], names, depth + 1)
    return inner, end + 1


def _arguments(tokens: list[Token], place: int, name: Token, names: Names) -> int:
    """How many tokens the arguments of a function, or the (t) of a name, take here."""
    if place >= len(tokens) or not tokens[place].is_operator("(") or tokens[place].value == FRACTION:
        return 0
    end = closing(tokens, place)
    inside = tokens[place + 1 : end]
    timed = [token.text for token in inside] == ["t"]
    role = names.role(names.spelling(name.text))
    plain = all(token.kind == "name" or token.is_operator(",", "(", ")") for token in inside)
    called = role == "function" or (role is None and plain and not tokens[place].space_before)
    return end + 1 - place if timed or called else 0


def _is_fraction(tokens: Sequence[Token], place: int) -> bool:
    return place < len(tokens) and tokens[place].is_operator("(") and tokens[place].value == FRACTION


def _quotient(tokens: list[Token], place: int, names: Names) -> _Quotient | None:
    """The quotient of differentials that begins here."""
    if _is_fraction(tokens, place):
        slash = closing(tokens, place + 1) + 1
        end = closing(tokens, place)
        above = _above(tokens[place + 2 : slash - 1], 0, names, True)
        if above is None or above[3] != slash - place - 3:
            return None
        order, partial, operand, _ = above
        below = _below(tokens[slash + 2 : end - 1], 0, order, True)
        if below is None or below[1] != end - 1 - (slash + 2):
            return None
        return _Quotient(operand, below[0], end + 1, partial, True)
    above = _above(tokens, place, names, False)
    if above is None:
        return None
    order, partial, operand, slash = above
    if slash >= len(tokens) or not tokens[slash].is_operator("/"):
        return None
    below = _below(tokens, slash + 1, order, False)
    return None if below is None else _Quotient(operand, below[0], below[1], partial, False)


def _above(
    tokens: Sequence[Token], place: int, names: Names, fraction: bool
) -> tuple[int, bool, list[Token], int] | None:
    """The order, whether it is partial, the tokens of u, and the place after d^k u."""
    if place >= len(tokens):
        return None
    first = tokens[place]
    sign = first.is_operator(PARTIAL, TOTAL)
    known = names.role(first.text) is not None and not (fraction and first.text == "d")
    match = _ABOVE.fullmatch(first.text) if first.kind == "name" and not known else None
    if not sign and match is None:
        return None
    digit, word = (match[1], match[2]) if match else ("", None)
    order, after = (int(digit), place + 1) if digit else _power(tokens, place + 1)
    if word and not digit:
        order, after = 1, place + 1
    operand: list[Token] = []
    if word:
        operand = [Token("name", word, first.column, first.space_before)]
    elif after < len(tokens) and tokens[after].kind == "name":
        operand, after = [tokens[after]], after + 1
    elif after < len(tokens) and tokens[after].is_operator("("):
        end = closing(tokens, after)
        return (order, first.text == PARTIAL, list(tokens[after : end + 1]), end + 1) if end < len(tokens) else None
    while operand and after < len(tokens) and tokens[after].kind == "prime":
        operand, after = [*operand, tokens[after]], after + 1
    if operand and after < len(tokens) and tokens[after].is_operator("(") and tokens[after].value != FRACTION:
        end = closing(tokens, after)
        operand, after = [*operand, *tokens[after : end + 1]], end + 1
    return (order, first.text == PARTIAL, operand, after) if order else None


def _power(tokens: Sequence[Token], place: int) -> tuple[int, int]:
    """The k of ^k or ^(k) here, 1 where there is none, and the place after it."""
    texts = [token.text for token in tokens[place : place + 6]]
    for opened in range(3):
        raised = texts[1 + opened : 2 + opened]
        if texts[: 1 + opened] != ["^", *"(("[:opened]]:
            break
        if raised and raised[0] in _DIGITS and texts[2 + opened : 2 + 2 * opened] == [")"] * opened:
            return int(raised[0]), place + 2 + 2 * opened
    return 1, place


def _below(tokens: Sequence[Token], place: int, order: int, fraction: bool) -> tuple[tuple[Token, ...], int] | None:
    """The variables of dt^2, dt2, d t, dx dy, together of this order, and the place after them."""
    found: list[Token] = []
    while len(found) < order and place < len(tokens):
        first = tokens[place]
        if first.is_operator(PARTIAL, TOTAL) or first.text == "d":
            place, digit = place + 1, ""
            if place >= len(tokens) or tokens[place].kind != "name":
                return None
            name = tokens[place]
        elif first.kind == "name" and (match := _BELOW.fullmatch(first.text)):
            name, digit = Token("name", match[1], first.column), match[2]
        else:
            return None
        place += 1
        if [token.text for token in tokens[place : place + 3]] == ["(", "t", ")"] and fraction:
            place += 3
        times, after = _power(tokens, place)
        if digit and int(digit) != order and order > 1:
            return None
        if digit and order == 1:
            name = Token("name", name.text + digit, name.column)
        elif digit:
            times, after = int(digit), place
        if not fraction and order == 1:
            times, after = 1, place
        found += [name] * times
        place = after
    return (tuple(found), place) if len(found) == order else None


def _power_of_operator(tokens: list[Token], place: int, names: Names, depth: int) -> tuple[list[Token], int] | None:
    """(d/dt)^2 u as diff(u, t, t)."""
    end = closing(tokens, place)
    operator = _quotient(tokens, place + 1, names) if end < len(tokens) else None
    if operator is None or operator.operand or operator.after != end or names.role("d"):
        return None
    power, after = _power(tokens, end + 1)
    if after == end + 1:
        return None
    raised = _Quotient([], operator.variables * power, after, operator.partial, operator.fraction)
    return _applied(tokens, raised, place, names, depth)


def _refuse_fraction(tokens: list[Token], place: int, names: Names) -> None:
    r"""InputError for a fraction such as \frac{d V k}{dx}, whose d would be a factor of both."""
    if not _is_fraction(tokens, place) or names.role("d"):
        return
    slash = closing(tokens, place + 1) + 1
    above, below = tokens[place + 2 : slash - 1], tokens[slash + 2 : closing(tokens, place) - 1]
    differential = bool(above) and (above[0].text == "d" or above[0].is_operator(TOTAL)) and len(above) > 1
    variable = next((k for order in range(1, 4) if (k := _below(below, 0, order, True)) and k[1] == len(below)), None)
    if differential and variable:
        by, column = variable[0][0].text, tokens[place].column
        if any(token.is_operator("^") for token in above[2:]) and by == "t":
            instead = "write the power around the whole derivative, \\left(\\frac{dx}{dt}\\right)^2"
            raise refusals.refusal("what is raised in a derivative is not clear", above[1].column, instead)
        instead = f"write \\frac{{d}}{{d{by}}}\\left( and \\right)"
        raise refusals.refusal(f"a derivative by {by} occurs", column, instead)


def _carried_out(inner: Sequence[Token], variables: Sequence[Token], at: Token) -> list[Token]:
    """diff(u, x, …), all at the place of the derivative."""
    if not inner:
        raise unexpected(at, "what is differentiated")
    found = [Token("name", "diff", at.column, True), Token("operator", "(", at.column), *inner]
    for variable in variables:
        found += [Token("operator", ",", at.column), Token("name", variable.text, at.column)]
    return [*found, Token("operator", ")", at.column)]
