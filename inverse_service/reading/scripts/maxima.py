"""Maxima."""

from __future__ import annotations

from inverse_service.reading.scripts import nodes as nd
from inverse_service.reading.scripts.grammar import PREFIX, Grammar, Parser

GRAMMAR = Grammar(
    r"/\*.*?\*/", frozenset(";$"), frozenset((":",)), frozenset((":=",)),
    frozenset("="), lines=False, reserved=frozenset(("if", "then", "else", "elseif", "for", "while", "do",
    "unless", "thru", "return", "go")), prompt=r"^\(%i\d+\)",
    sets_inside=True,
)  # fmt: skip


def read_maxima(text: str) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is no program of Maxima."""
    return _Parser(text, GRAMMAR).program()


class _Parser(Parser):
    def prefix(self) -> nd.Node:
        self.skip_lines()
        if self.peek().text != "'":
            return super().prefix()
        at = self.next().at
        return nd.Unary(at, "'", self.expression(PREFIX))
