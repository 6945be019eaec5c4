"""Mathematica."""

from __future__ import annotations

from dataclasses import replace

from inverse_service.reading.scripts import nodes as nd
from inverse_service.reading.scripts.grammar import Grammar, Parser, Token

GRAMMAR = Grammar(
    r"\(\*.*?\*\)", frozenset(";"), frozenset(("=",)), frozenset((":=", "=")),
    frozenset(("==",)), by_blank=True, prime="derivative", prompt=r"^In\[\d+\]:=",
    own_powers=frozenset(("//", "/.", "//.")),
)  # fmt: skip


def read_mathematica(text: str) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is no program of Mathematica."""
    return _Parser(text, GRAMMAR).program()


class _Parser(Parser):
    def is_pattern(self, target: nd.Node) -> bool:
        if not isinstance(target, nd.Call) or not isinstance(target.function, nd.Name):
            return False
        return any(isinstance(one, nd.Name) and one.text.endswith("_") for one in target.arguments)

    def defined(self, at: int, target: nd.Node, value: nd.Node, sign: str) -> nd.Function:
        """f[x_] := value, or f[x_] = value, which has the values that names have now."""
        return replace(super().defined(at, target, value, sign), keeps_values=sign == "=")

    def joined(self, left: nd.Node, token: Token, strength: int) -> nd.Node:
        names = {"/.": "<replaced>", "//.": "<repeated>"}
        at, text = token.at, token.text
        if text == "//":  # x // Simplify
            return nd.Call(at, self.expression(strength), (left,))
        if text in names:
            return nd.Call(at, nd.Name(at, names[text]), (left, self.expression(strength)))
        return super().joined(left, token, strength)

    def prefix(self) -> nd.Node:
        self.skip_lines()
        return super().prefix()

    def behind(self, found: nd.Node, token: Token) -> nd.Node | None:
        if token.text == "(":
            return None
        return (
            self.of_square(found, token.at) if token.text == "[" else super().behind(found, token)
        )

    def of_square(self, found: nd.Node, at: int) -> nd.Node:
        """f[x], or list[[2]]."""
        self.next()
        if self.peek().text == "[" and not self.peek().blank:
            self.next()
            places = self.arguments("]")
            self.expect("]")
            return nd.Index(at, found, places)
        return nd.Call(at, found, self.arguments("]"))
