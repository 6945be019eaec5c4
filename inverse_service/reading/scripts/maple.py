"""Maple."""

from __future__ import annotations

from inverse_service.reading.scripts import nodes as nd
from inverse_service.reading.scripts.grammar import PREFIX, Grammar, Parser, Token

GRAMMAR = Grammar(
    r"#[^\n]*", frozenset(";:"), frozenset((":=",)), frozenset(), frozenset("="),
    lines=False, reserved=frozenset(("if", "then", "else", "elif", "fi", "for", "while", "do", "od", "proc",
    "return", "break")), prompt=r"^>",
    own_powers=frozenset("$"), arrows=frozenset(("->", "=>")),
)  # fmt: skip


def read_maple(text: str) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is no program of Maple."""
    return _Parser(text, GRAMMAR).program()


class _Parser(Parser):
    def strength(self, token: Token) -> int | None:
        return 1 if token.text == "union" else super().strength(token)

    def joined(self, left: nd.Node, token: Token, strength: int) -> nd.Node:
        if token.text == "union":  # of sets
            return nd.Items(token.at, (left, self.expression(strength)))
        if token.text != "@@":
            return super().joined(left, token, strength)
        arguments = (left, self.expression(strength))
        return nd.Call(token.at, nd.Name(token.at, "<iterated>"), arguments)

    def prefix(self) -> nd.Node:
        self.skip_lines()
        token = self.peek()
        if token.text == "<":
            self.next()
            return self.suffix(self.angle(token.at))
        if token.text != "'":
            return super().prefix()
        self.next()
        operand = self.expression(PREFIX)
        self.expect("'")
        return nd.Unary(token.at, "'", operand)

    def angle(self, at: int) -> nd.Node:
        """<a, b>, a vector."""
        found = [self.expression(13)]
        while self.peek().text in (",", "|"):
            self.next()
            found.append(self.expression(13))
        self.expect(">")
        return nd.Call(at, nd.Name(at, "Vector"), (nd.Items(at, tuple(found)),))
