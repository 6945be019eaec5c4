"""Maple."""

from __future__ import annotations

import re

from inverse_service.reading.scripts import nodes as nd
from inverse_service.reading.scripts.grammar import PREFIX, Grammar, Parser, Token

GRAMMAR = Grammar(
    r"#[^\n]*", frozenset(";:"), frozenset((":=",)), frozenset(), frozenset("="),
    lines=False, reserved=frozenset(("if", "then", "else", "elif", "fi", "for", "while", "do", "od", "proc",
    "return", "break")), prompt=r"^>", signs=r"\$",
    own_powers=frozenset("$"), arrows=frozenset(("->", "=>")),
)  # fmt: skip


_RANGE = re.compile(r"\(?(\d{1,3})(?:\.+(\d{1,3}))?")  # 3, and (1..3
_MOST_GLUED = 32


def read_maple(text: str) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is no program of Maple."""
    return _Parser(_without_output(text), GRAMMAR).program()


def _without_output(text: str) -> str:
    """The text with blanks for what is printed between the statements behind prompts, "> ode := ...;"."""
    lines = text.splitlines(keepends=True)
    if not lines or not lines[0].lstrip().startswith("> "):
        return text
    found: list[str] = []
    goes_on = False
    for line in lines:
        typed = line.lstrip().startswith(">") or goes_on
        found.append(line if typed else " " * len(line.rstrip("\r\n")) + "\n")
        goes_on = typed and not line.partition("#")[0].rstrip().endswith((";", ":"))
    return "".join(found)


class _Parser(Parser):
    def plain_value(self) -> nd.Node:
        """The right side of an assignment; a := x, y is a sequence."""
        found = [super().plain_value()]
        while self.peek().text == ",":
            self.next()
            found.append(super().plain_value())
        return found[0] if len(found) == 1 else nd.Items(found[0].at, tuple(found))

    def strength(self, token: Token) -> int | None:
        return 1 if token.text == "union" else super().strength(token)

    def joined(self, left: nd.Node, token: Token, strength: int) -> nd.Node:
        if token.text == "union":  # of sets
            return nd.Items(token.at, (left, self.expression(strength)))
        if token.text == "||":  # EQ||1, and EQ||(1..2)
            return self.glued(left, token.at)
        if token.text != "@@":
            return super().joined(left, token, strength)
        arguments = (left, self.expression(strength))
        return nd.Call(token.at, nd.Name(token.at, "<iterated>"), arguments)

    def glued(self, left: nd.Node, at: int) -> nd.Node:
        """EQ1 for EQ||1, and EQ1, EQ2 for EQ||(1..2)."""
        numbers = [self.next()]
        if numbers[0].text == "(":
            while self.peek().text != ")" and self.peek().kind != "end":
                numbers.append(self.next())
            self.expect(")")
        found = _RANGE.fullmatch("".join(token.text for token in numbers))
        if not isinstance(left, nd.Name) or found is None:
            raise nd.NotRead("names that are put together", at)
        ends = int(found[1]), int(found[2] or found[1])
        if not 0 <= ends[1] - ends[0] < _MOST_GLUED:
            raise nd.NotRead("names that are put together", at)
        names = [nd.Name(at, f"{left.text}{k}") for k in range(ends[0], ends[1] + 1)]
        return names[0] if numbers[0].text != "(" else nd.Items(at, tuple(names))

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
