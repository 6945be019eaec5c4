"""Arrays of the unknowns of a program, y(1) and y[0], and equations for their rates."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from inverse_service.reading import tokens as tk
from inverse_service.reading.tokens import Line, Token, Tokens, at

# dydt, dy, ydot, and y_dot, the array of rates of the array y.
RATES = re.compile(r"d([A-Za-z]\w*?)(?:_?d(?P<by>[a-z]))?|([A-Za-z]\w*?)_?dot")
PARAMETERS = ("p", "par", "pars", "params", "args")
ARRAYS = ("array", "SVector", "zeros", "ones")


def statements(tokens: Tokens) -> list[Tokens]:
    return [part for part in tk.split_at(";,", tokens) if part]


def joined(statements: Sequence[Tokens]) -> Tokens:
    found: Tokens = []
    for statement in statements:
        if found:
            last = found[-1]
            end = last.end + 1 if last.kind == "bracket" else last.span[1]
            found.append(Token("operator", ";", end))
        found += statement
    return found


def rate(name: Token, text: str, order: int = 0) -> Tokens:
    """text' = at the place of a token, or text'' = for the rate of text'."""
    primed = Token(
        "name", text, name.column, name.space_before, order=order + 1, primed=name.column
    )
    return [primed, Token("operator", "=", name.column, True)]


@dataclass(frozen=True, slots=True)
class Array:
    """The name of an array of unknowns and its first index, 0 or 1."""

    name: str
    first: int

    @classmethod
    def of(cls, name: str, tokens: Line) -> "Array":
        """The array of this name in the tokens: y[0] occurs only where indices begin at 0."""
        indices = {index for other, index, _ in entries(tokens) if other == name}
        return cls(name, 0 if 0 in indices else 1)

    def entry(self, place: int) -> str:
        return f"{self.name}_{place - self.first + 1}"

    def with_names(self, line: Line) -> Tokens:
        """The tokens with the name y_1 for the entry y(1) or y[1]."""
        found: Tokens = []
        for place, token in enumerate(line):
            if (
                found
                and (index := index_of(line, place - 1)) is not None
                and line[place - 1].text == self.name
            ):
                found[-1] = replace(
                    line[place - 1], text=self.entry(index), order=token.order, primed=token.primed
                )
            else:
                found.append(tk.within(token, self.with_names))
        return found


def index_of(line: Line, place: int) -> int | None:
    """The k of the y(k), y[k], or y(k, 1) here; else None."""
    name, bracket = at(line, place), at(line, place + 1)
    if name.kind != "name" or name.order or bracket.kind != "bracket":
        return None
    inside = [part for part in tk.split_at(",", bracket.inside) if part]
    if not inside:
        return None
    column = [tk.spelled(part) for part in inside[1:]] in ([], ["1"])
    plain = column and len(inside[0]) == 1 and inside[0][0].kind == "number"
    return int(inside[0][0].text) if plain and inside[0][0].text.isdigit() else None


def entries(tokens: Line) -> Iterator[tuple[str, int, Token]]:
    """(y, k, token) for every y(k) and y[k]."""
    for line, place, _ in tk.places(tokens):
        if (index := index_of(line, place)) is not None:
            yield line[place].text, index, line[place]


def components(bracket: Token) -> list[Tokens]:
    """The entries of [a; b], [a, b], and [a b;...]; none where they are not clear."""
    signs = {token.text for token in bracket.inside if token.is_operator(";", ",")}
    return [part for part in tk.split_at(";,", bracket.inside) if part] if len(signs) == 1 else []


def rates_of(array: Array, components: list[Tokens]) -> Tokens:
    """y_1' = first; y_2' = second; ..."""
    return joined(
        [
            [*rate(part[0], array.entry(place)), *array.with_names(part)]
            for place, part in enumerate(components, array.first)
        ]
    )
