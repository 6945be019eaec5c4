"""Mathematica."""

from __future__ import annotations

from dataclasses import replace

from inverse_service.reading.scripts import nodes as nd
from inverse_service.reading.scripts.grammar import PREFIX, Grammar, Parser, Token

GRAMMAR = Grammar(
    r"\(\*.*?\*\)", frozenset(";"), frozenset(("=",)), frozenset((":=", "=")),
    frozenset(("==",)), by_blank=True, prime="derivative", prompt=r"^In\[\d+\]:=",
    own_powers=frozenset(("//", "/.", "//.")), sets_inside=True,
    signs=r"/@|&(?!&)|\#(?!\d)",
)  # fmt: skip


_SCOPES = ("With", "Module", "Block")


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

    def strength(self, token: Token) -> int | None:
        own = {"&": 3, "/@": 55}.get(token.text) if token.kind == "sign" else None
        return own or super().strength(token)

    def joined(self, left: nd.Node, token: Token, strength: int) -> nd.Node:
        if token.text == "&":  # D[L, #] &
            return nd.Function(token.at, "", ("#",), (nd.Return(token.at, left),))
        if token.text == "/@":
            mapped = nd.Name(token.at, "<mapped>")
            return nd.Call(token.at, mapped, (left, self.expression(strength)))
        names = {"/.": "<replaced>", "//.": "<repeated>"}
        at, text = token.at, token.text
        if text == "//":  # x // Simplify
            return nd.Call(at, self.expression(strength), (left,))
        if text in names:
            return nd.Call(at, nd.Name(at, names[text]), (left, self.expression(strength)))
        return super().joined(left, token, strength)

    def prefix(self) -> nd.Node:
        self.skip_lines()
        if self.peek().text == "#":
            return self.suffix(nd.Name(self.next().at, "#"))
        return super().prefix()

    def behind(self, found: nd.Node, token: Token) -> nd.Node | None:
        if token.text == "(":
            return None
        return (
            self.of_square(found, token.at) if token.text == "[" else super().behind(found, token)
        )

    def argument(self) -> nd.Node:
        """One argument, or a_?NumericQ without its test."""
        found = super().argument()
        if self.peek().text == "?":
            self.next()
            self.expression(PREFIX)
        return found

    def of_square(self, found: nd.Node, at: int) -> nd.Node:
        """f[x], list[[2]], or With[{a = 1}, ...]."""
        self.next()
        if isinstance(found, nd.Name) and found.text in _SCOPES and self.peek().text == "{":
            return self.scope(at)
        if self.peek().text == "[" and not self.peek().blank:
            self.next()
            places = self.arguments("]")
            self.expect("]")
            return nd.Index(at, found, places)
        return nd.Call(at, found, self.arguments("]"))

    def scope(self, at: int) -> nd.Node:
        """With[{a = 1}, body] as a call of a function without arguments, whose names are its own."""
        self.next()
        body: list[nd.Node] = []
        while self.peek().text != "}":
            self.skip_lines()
            target = self.expression(13)
            if self.peek().text in ("=", ":="):
                self.next()
                body.append(nd.Assign(at, target, self.expression(0), declares=True))
            self.skip_lines()
            if self.peek().text == ",":
                self.next()
            elif self.peek().text != "}":
                raise nd.NotRead("a list of names", self.peek().at)
        self.next()
        self.expect(",")
        body += self.program("]")
        self.expect("]")
        if body and not isinstance(body[-1], nd.Assign | nd.Function):
            body[-1] = nd.Return(at, body[-1])
        return nd.Call(at, nd.Function(at, "", (), tuple(body)), ())
