r"""Sums of LaTeX and of plain text with numbers as bounds, term by term: tokens in, tokens out.

\sum_{i=1}^{3} m_i \dot x_i^2 is (m_1 \dot x_1^2 + m_2 \dot x_2^2 + m_3 \dot x_3^2). A term ends
before a sign of addition, a relation, or a separator; x_{i+1} is x_2 for i = 1. In plain text it is
sum_{i=1}^{3} or \u03a3_{i=1}^3.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import NamedTuple

from inverse_service.expressions.refusals import at_most, most_tokens
from inverse_service.reading import tokens as tk
from inverse_service.reading.tokens import Line, Token, Tokens, at

_MOST_TERMS, _MOST_SUMS = 64, 20
_INDICES = ("i", "j")
_FREE = ("i", "j", "k", "n")
_POWERS = ("n", "m", "p")  # of a_n x^n; q^i is usually a component
_WORDS = ("sum", "Sigma")  # of LaTeX, perhaps without a backslash
_NAMES = ("sum_", "Sigma_")  # in plain text
_ENDS = ("+", "-", "=", "<", ">", ";", ",", "&", "\u2260")


class _Header(NamedTuple):
    """The bounds of a sum, and the place after them."""

    name: str
    first: int
    last: int
    after: int


def with_terms(line: Line) -> Tokens:
    """The tokens with each sum as a bracket around its terms; a sum without numbers as bounds, and
    one next to an index for which a number is meant, too, is left, to be refused where it is.
    """
    sums = sum(token.text in (*_WORDS, *_NAMES) for token in tk.walk(line))
    if not 0 < sums <= _MOST_SUMS:
        return [*line]
    found = _written_out(line)
    return [*line] if _has_free_index(found) else found


def with_each_index(line: Line) -> Tokens:
    r"""\ddot x_1 = -x_1; \ddot x_2 = -x_2 for \ddot x_i = -x_i with x_1 and x_2 in another statement,
    or with i = 1, 2 behind it.
    """
    free = {name for name, _ in _indexed(line) if name in _FREE}
    if len(free) != 1 or any(token.text in (*_WORDS, *_NAMES) for token in tk.walk(line)):
        return [*line]
    [index] = free
    parts = tk.split(line, lambda _, token: token.is_operator(";", ",") or token.kind == "newline")
    listed, places = _listed(parts, index)
    of_index = [any(name == index for name, _ in _indexed(part)) for part, _ in parts]
    moves = [_accelerates(part) for part, _ in parts]
    heads = {head for name, head in _indexed(line) if name == index}
    numbers = listed or sorted(
        {int(name) for name, head in _indexed(line) if name.isdigit() and head in heads}
    )
    if not 2 <= len(numbers) <= _MOST_TERMS or numbers != [*range(1, len(numbers) + 1)]:
        return [*line]
    if not any(of_index) or any(
        free and not moved for free, moved in zip(of_index, moves, strict=True)
    ):
        return [*line]
    found: Tokens = []
    for place, (part, _) in enumerate(parts):
        copies = [_with_value(part, index, k) for k in numbers] if of_index[place] else [part]
        for copy in copies if place not in places else []:
            if found and copy:
                found.append(Token("operator", ";", copy[0].column))
            found += copy
    tk.note(index, ", ".join(map(str, numbers)))
    return found


def _indexed(line: Line) -> Iterator[tuple[str, str]]:
    """The index and the name of each x_i and x_1, in LaTeX and in plain text."""
    for inside, place, _ in tk.places(line):
        token, before = inside[place], at(inside, place - 1)
        if token.is_operator("_"):
            below = at(inside, place + 1)
            below = below.inside[0] if len(below.inside) == 1 else below
            yield below.text, tk.spelled([before]).strip("{}'")
        elif token.kind == "name" and "_" in token.text:
            head, _, index = token.text.partition("_")
            yield index, head


def _listed(
    parts: Sequence[tuple[Tokens, Token | None]], index: str
) -> tuple[list[int], frozenset[int]]:
    """The 1, 2 of i = 1, 2, and the places of these parts."""
    for place, (part, _) in enumerate(parts):
        if tk.spelled(part[:2]) != f"{index}=" or len(part) != 3:
            continue
        rest = [one for one, _ in parts[place + 1 :]]
        numbers = [part[2], *(one[0] for one in takewhile(lambda one: len(one) == 1, rest))]
        if all(one.kind == "number" and one.text.isdigit() for one in numbers):
            return [int(one.text) for one in numbers], frozenset(range(place, place + len(numbers)))
    return [], frozenset()


def _accelerates(part: Line) -> bool:
    return any(
        token.order == 2 or token.text == "ddot" or tk.spelled([token]).startswith("{d^2")
        for token in tk.walk(part)
    )


def _has_free_index(line: Line) -> bool:
    r"""Whether \ddot x_i is here, an equation for each i."""
    if any(
        token.text.endswith(tuple(f"_{index}" for index in _INDICES)) for token in tk.walk(line)
    ):
        return True
    return any(
        line[place].is_operator("_")
        and any(
            token.kind == "name" and token.text in _INDICES
            for token in tk.walk(line[place + 1 : place + 2])
        )
        for line, place, _ in tk.places(line)
    )


def _written_out(line: Line) -> Tokens:
    found: Tokens = []
    place = 0
    while place < len(line):
        token = line[place]
        header = _header(line, place)
        if header is None:
            found.append(tk.within(token, _written_out))
            place += 1
            continue
        stop = header.after
        while stop < len(line) and not (
            line[stop].is_operator(*_ENDS) or line[stop].kind == "newline"
        ):
            stop += 1
        term = _written_out(line[header.after : stop])
        if not term or (header.name not in _POWERS and _is_raised(term, header.name)):
            return [*line]
        found.append(_added(term, header, token))
        place = stop
    return found


def _added(term: Tokens, header: _Header, at_sum: Token) -> Token:
    """The bracket around the terms of a sum."""
    count = header.last - header.first + 1
    size = count * sum(1 for _ in tk.walk(term))
    at_most(size, most_tokens(), "the formula has too many parts", at_sum.column)
    inside: Tokens = []
    for k in range(header.first, header.last + 1):
        inside += [Token("operator", "+", at_sum.column, True)] * bool(inside)
        inside += _with_value(term, header.name, k)
    return replace(tk.bracket(inside, at_sum), end=max(one.span[1] - 1 for one in term))


def _header(line: Line, place: int) -> _Header | None:
    """The bounds of the sum that begins here, in either order; None without numbers."""
    if line[place].kind == "name" and line[place].text in _NAMES:
        if not at(line, place + 2).is_operator("^"):
            return None
        given, above, length = at(line, place + 1).inside, at(line, place + 3), 4
    elif line[place].kind in ("command", "name") and line[place].text in _WORDS:
        marks = {at(line, place + k).text: at(line, place + k + 1) for k in (1, 3)}
        if {*marks} != {"_", "^"}:
            return None
        given, above, length = marks["_"].inside, marks["^"], 5
    else:
        return None
    above = above.inside[0] if len(above.inside) == 1 else above
    kinds = [token.kind for token in given]
    if kinds != ["name", "operator", "number"] or not given[1].is_operator("="):
        return None
    bounds = given[2].text, above.text
    if above.kind != "number" or not all(map(str.isdigit, bounds)):
        return None
    first, last = map(int, bounds)
    if not 0 <= last - first < _MOST_TERMS:
        return None
    return _Header(given[0].text, first, last, place + length)


def _is_raised(term: Line, index: str) -> bool:
    r"""Whether the index is above a letter, as in \dot q^i: of a component, or a power."""
    return any(
        line[place].is_operator("^")
        and tk.spelled(line[place + 1 : place + 2]).strip("{}()") == index
        for line, place, _ in tk.places(term)
    )


def _with_value(line: Line, index: str, value: int, below: bool = False) -> Tokens:
    """The tokens with a number for an index, `below` in a subscript; x^n is x for n = 1."""
    found: Tokens = []
    for place, token in enumerate(line):
        before = at(line, place - 1)
        under, above = before.is_operator("_"), before.is_operator("^")
        if token.kind == "name" and token.text.endswith(f"_{index}"):  # of plain text
            token = replace(token, text=f"{token.text.removesuffix(index)}{value}")
        elif token.is_bracket("{") and (
            named := before.kind == "name" and before.text.endswith("_")
        ):
            inside = _with_value(token.inside, index, value, named)
            if (k := _number(inside)) is not None:
                found[-1] = replace(
                    before, text=f"{before.text}{k}", order=token.order, primed=token.primed
                )
                continue
        elif token.kind == "name" and token.text == index and not token.order:
            token = tk.number_token(str(value), token.column, token.space_before)
            if not (below or under or above):
                token = tk.bracket([token], token, tk.FACTOR)
        elif token.inside:
            deeper = below or under
            inside = _with_value(token.inside, index, value, deeper)
            if (under or above) and token.is_bracket("{") and (k := _number(inside)) is not None:
                inside = [tk.number_token(str(k), inside[0].column, inside[0].space_before)]
            token = replace(token, inside=tuple(inside))
        raised = token.inside if len(token.inside) == 1 else (token,)
        if (
            above
            and raised[0].text == "1"
            and tk.spelled([before, *raised]) != tk.spelled(line[place - 1 : place + 1])
        ):
            found.pop()
            continue
        found.append(token)
    return found


def _number(line: Line) -> int | None:
    """The 2 of 1 + 1 and the 3 of 4 - 1; None for other tokens and for a number below 0."""
    total, sign = 0, 1
    for place, token in enumerate(line):
        one = token.inside[0] if len(token.inside) == 1 else token
        if place % 2 and token.is_operator("+", "-"):
            sign = 1 if token.text == "+" else -1
        elif not place % 2 and one.kind == "number" and one.text.isdigit():
            total += sign * int(one.text)
        else:
            return None
    return total if len(line) % 2 and total >= 0 else None
