"""Fortran, in free and in fixed form, with its whole numbers: those that are declared, and names
from i to n without a declaration.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from inverse_service.reading.scripts import nodes as nd
from inverse_service.reading.scripts.grammar import Grammar, Parser, Token

FORM = re.compile(
    r"(?im)^[ \t]*(?:[a-z][\w()*= ]*[ \t])?(?:subroutine[ \t]+\w+|end(?:[ \t]+function\b|function[ \t]+\w)"
    r"|function[ \t]+\w+[ \t]*\([^()]*\)[ \t]*result\b)"
)
_FREE = Grammar(
    r"![^\n]*|&[ \t]*(?:![^\n]*)?\n(?:[ \t]*(?:![^\n]*)?\n)*[ \t]*&?", frozenset(";"),
    frozenset("="), frozenset(), frozenset(("==",)), signs=r"==|/=|//|\*\*", slices=True,
)  # fmt: skip
# A remark has its mark in the first column, and a line goes on with a mark in the sixth.
_FIXED = Grammar(
    r"^[c*d!][^\n]*|![^\n]*|\n(?:[c*!][^\n]*\n)* {5}[^ 0\n]", frozenset(";"),
    frozenset("="), frozenset(), frozenset(("==",)), signs=r"==|/=|//|\*\*", slices=True,
)  # fmt: skip
_IN_COLUMNS = re.compile(r"\A(?:[c*d!][^\n]*|[ \d]{5}[^\n]*|\t[^\n]*|[ \t]*)\Z")
_DOUBLE = re.compile(r"(?<![\w.])(\d+\.?\d*|\.\d+)d([-+]?\d)")
_KIND = re.compile(r"(?<![\w.])((?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)(_[a-z]\w*|_\d+)")
_TEXTS = re.compile(r"'[^'\n]*'|\"[^\"\n]*\"")
_TYPES = frozenset(
    ("real", "integer", "double", "logical", "character", "complex", "type", "class")
)
# The names of functions for numbers of double precision
_OF_DOUBLE = {f"d{name}": name for name in (
    "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "abs",
)} | {"dble": "real", "float": "real", "norm2": "norm", "dot_product": "dot"}  # fmt: skip
_IN_FRONT = frozenset(("pure", "elemental", "recursive", "impure"))
# Statements that set nothing that counts.
_LEFT_OUT = frozenset((
    "use", "implicit", "save", "external", "intrinsic", "intent", "dimension", "common", "optional",
    "print", "write", "open", "close", "format", "continue", "module", "program", "contains",
    "private", "public", "include", "namelist", "target", "allocatable", "import", "procedure",
    "interface", "stop", "allocate", "deallocate",
))  # fmt: skip
# Statements that move to another place, or give two names to one value.
_JUMPS = frozenset((
    "goto", "go", "equivalence", "entry", "where", "forall", "data", "read", "assign", "pointer",
))  # fmt: skip


def read_fortran(text: str) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is no program of Fortran."""
    plain = _TEXTS.sub(lambda found: '"' + " " * (len(found[0]) - 2) + '"', text.lower())
    lines = plain.splitlines()
    fixed = any(line[:5] == "     " for line in lines) and all(map(_IN_COLUMNS.match, lines))
    plain = plain.replace("::", " :").replace("(/", "[ ").replace("/)", " ]")
    plain = _DOUBLE.sub(r"\1e\2", plain)
    plain = _KIND.sub(lambda found: found[1] + " " * len(found[2]), plain)
    if len(plain) != len(text):
        raise nd.NotRead("signs that Fortran does not have")
    parser = _Parser(plain, _FIXED if fixed else _FREE)
    spelled = _spellings(parser.tokens, text)
    return tuple(_as_written(one, spelled) for one in parser.program())


def _spellings(tokens: Sequence[Token], text: str) -> dict[str, str]:
    """EPS for eps, as its first place spells it; functions of the language, and the time, aside."""
    found: dict[str, str] = {}
    for token, after in itertools.zip_longest(tokens, tokens[1:]):
        is_called = after is not None and after.text == "(" and token.text not in found
        if token.kind == "name" and token.text not in ("t", "time", "tau") and not is_called:
            found.setdefault(token.text, text[token.at - 1 :][: len(token.text)])
    return found


def _as_written(node: Any, spelled: Mapping[str, str]) -> Any:
    """The statements with the names as they are written."""
    if isinstance(node, tuple):
        return tuple(_as_written(one, spelled) for one in node)
    if isinstance(node, str):
        return spelled.get(node, node)
    if not isinstance(node, nd.Node) or isinstance(node, nd.Constant | nd.Stop):
        return node
    names = [name for name in node.__dataclass_fields__ if name != "sign"]
    return replace(node, **{name: _as_written(getattr(node, name), spelled) for name in names})


class _Parser(Parser):
    def __init__(self, text: str, grammar: Grammar) -> None:
        super().__init__(text, grammar)
        self.reals: set[str] = set()
        self.wholes_by_name = True  # i to n without a declaration

    # -- statements

    def statement(self) -> list[nd.Node]:
        token = self.peek()
        if token.kind == "number" and self.peek(1).kind == "name":  # a label
            self.next()
            token = self.peek()
        if token.kind != "name" or self.peek(1).text == "=":
            return [self.assigned()]
        words = [token.text]
        while self.peek(len(words)).kind == "name":
            words.append(self.peek(len(words)).text)
        if "function" in words or words[-2:-1] == ["subroutine"] or self.is_function_of_kind():
            return [self.function()]
        match token.text:
            case "if" if self.peek(1).text == "(":
                return [self.of_condition(token.at)]
            case "do":
                return [self.loop(token.at)]
            case "select":
                self.line()
                return [nd.Block(token.at, self.body("endselect", "select"), False)]
            case "associate":
                raise nd.Trap("names for other names", token.at)
            case "return":
                self.line()
                return [nd.Return(token.at, None)]
            case "call":
                return self.called()
            case "parameter" if self.peek(1).text == "(":
                return self.parameters()
            case "implicit":
                return self.implicit()
            case word if word in _JUMPS:
                raise nd.Trap(f"the statement {word}", token.at)
            case word if word in _TYPES:
                return self.declared()
            case word if word in _LEFT_OUT:
                if word in ("use", "include"):
                    self.wholes_by_name = False
                self.line()
                return []
            case word if word.startswith("end"):
                self.line()
                return []
        return [self.assigned()]

    def line(self) -> list[Token]:
        """The tokens up to the end of the line."""
        found = []
        while self.peek().kind not in ("line", "end") and self.peek().text != ";":
            found.append(self.next())
        return found

    def assigned(self) -> nd.Node:
        """x = value; a whole number is cut where its value is none."""
        start = self.peek()
        target = self.suffix(nd.Name(start.at, self.next().text))
        if self.peek().text != "=":
            raise nd.NotRead("a statement that sets nothing", start.at)
        self.next()
        value = self.expression(0)
        return nd.Assign(start.at, target, self.cut(target, value))

    def cut(self, target: nd.Node, value: nd.Node) -> nd.Node:
        whole = self.is_whole(target) and not self.is_whole(value)
        return nd.Call(value.at, nd.Name(value.at, "<whole>"), ()) if whole else value

    def body(self, *ends: str) -> tuple[nd.Node, ...]:
        """Statements up to `end do`, `enddo`, or a plain end."""
        found: list[nd.Node] = []
        while True:
            self.skip_ends()
            token, after = self.peek(), self.peek(1)
            if token.kind == "end":
                raise nd.NotRead("a block that is not closed", token.at)
            alone = after.kind in ("line", "end") or after.text == ";"
            if token.text == "end" and (alone or after.text in ends):
                self.line()
                return tuple(found)
            if token.text in ends and token.text.startswith("end"):
                self.line()
                return tuple(found)
            if token.text in ("else", "elseif", "case", "contains"):
                self.line()
                continue
            found += self.one_statement()

    def of_condition(self, at: int) -> nd.Node:
        self.next()
        self.expect("(")
        self.to_the_bracket()
        if self.peek().text == "then":
            self.line()
            return nd.Block(at, self.body("endif", "if"), False)
        return nd.Block(at, tuple(self.statement()), False)

    def loop(self, at: int) -> nd.Node:
        self.next()
        head = self.line()
        if head and head[0].kind == "number":
            raise nd.Trap("a loop up to a label", at)
        counter = head[0].text if head and head[0].kind == "name" else ""
        return nd.Block(at, self.body("enddo", "do"), True, counter)

    def called(self) -> list[nd.Node]:
        """call f(y, a): what it does to its arguments is not known."""
        at = self.peek().at
        names = {token.text for token in self.line() if token.kind == "name"}
        unread = nd.Call(at, nd.Name(at, "<call>"), ())
        return [nd.Assign(at, nd.Name(at, name), unread) for name in sorted(names)]

    def implicit(self) -> list[nd.Node]:
        words = "".join(token.text for token in self.line())
        self.wholes_by_name = self.wholes_by_name and not re.search(
            r"none|^implicit(?:real|double).*\(a-z\)", words
        )
        return []

    def parameters(self) -> list[nd.Node]:
        """parameter (g = 9.81d0, l = 1)."""
        self.next()
        self.next()
        found: list[nd.Node] = []
        while True:
            found.append(self.assigned())
            if self.next().text != ",":
                return found

    # -- declarations

    def is_function_of_kind(self) -> bool:
        """Whether this is real(8) function f(x)."""
        ahead = 0
        words = []
        while (token := self.peek(ahead)).kind not in ("line", "end") and ahead < 12:
            words.append(token.text)
            ahead += 1
        return words[0] in (*_TYPES, *_IN_FRONT) and any(
            word in ("function", "subroutine") for word in words
        )

    def function(self) -> nd.Node:
        at = self.peek().at
        front: list[str] = []
        while (word := self.next().text) not in ("function", "subroutine"):
            front.append(word)
        name = self.next().text
        names: list[str] = []
        if self.peek().text == "(":
            self.next()
            while (token := self.next()).text != ")":
                if token.kind == "name":
                    names.append(token.text)
                elif token.text not in (",", "*"):
                    raise nd.NotRead("arguments that are no names", token.at)
        results = (name,) if word == "function" else ()
        tail = self.line()
        if len(tail) == 4 and tail[0].text == "result":
            results = (tail[2].text,)
        kept = self.wholes, self.reals, self.wholes_by_name
        self.wholes, self.reals = {*self.wholes}, {*self.reals}
        if front and results:
            (self.wholes if front[0] == "integer" else self.reals).add(results[0])
        body = self.body(f"end{word}", word)
        self.wholes, self.reals, self.wholes_by_name = kept
        return nd.Function(at, name, tuple(names), body, results)

    def declared(self) -> list[nd.Node]:
        """real(8), parameter :: k = 4, x(3), of which the type and the values are kept."""
        start = self.place
        tokens = self.line()
        end, self.place = self.place, start
        if tokens[0].text in ("complex", "type", "class"):
            raise nd.NotRead("numbers of another kind", tokens[0].at)
        known = self.wholes if tokens[0].text == "integer" else self.reals
        depth, marks = 0, list[int]()
        for k, token in enumerate(tokens):
            depth += (token.text in ("(", "[")) - (token.text in (")", "]"))
            if token.text == ":" and not depth:
                marks.append(k)
        if marks:
            self.place = start + marks[0] + 1
        else:
            self.next()
            if tokens[0].text == "double" and self.peek().text == "precision":
                self.next()
            elif self.peek().text == "*":  # real*8
                self.place += 2
            elif self.peek().text == "(":  # real(8)
                self.next()
                self.to_the_bracket()
        found: list[nd.Node] = []
        while self.place < end:
            name = self.next()
            if name.kind != "name":
                raise nd.NotRead("a declaration", name.at)
            known.add(name.text)
            if self.peek().text == "(":
                self.next()
                self.to_the_bracket()
            if self.peek().text == "=":
                self.next()
                target = nd.Name(name.at, name.text)
                found.append(
                    nd.Assign(name.at, target, self.cut(target, self.expression(0)), declares=True)
                )
            if self.place < end and self.next().text != ",":
                raise nd.NotRead("a declaration", name.at)
        return found

    # -- formulas

    def is_whole(self, node: nd.Node) -> bool:
        """Whether this is computed in whole numbers."""
        match node:
            case nd.Name(text=name) | nd.Call(function=nd.Name(text=name)) if (
                name not in self.reals
            ):
                by_name = (
                    self.wholes_by_name and isinstance(node, nd.Name) and "i" <= name[:1] <= "n"
                )
                return name in self.wholes or by_name
            case nd.Binary(sign="^", left=left, right=right):
                return self.is_whole(left) and self.is_whole(right)
        return super().is_whole(node)

    def joined(self, left: nd.Node, token: Token, strength: int) -> nd.Node:
        found = super().joined(left, token, strength)
        match found:
            case nd.Binary(sign="^", left=base, right=power) if self.is_whole(base):
                if self.is_whole(power) and not isinstance(power, nd.Constant):
                    raise nd.Trap("a power of whole numbers, which Fortran rounds", token.at)
        return found

    def suffix(self, found: nd.Node) -> nd.Node:
        if (
            isinstance(found, nd.Name)
            and self.peek().text == "("
            and found.text not in self.reals | self.wholes
        ):
            found = nd.Name(found.at, _OF_DOUBLE.get(found.text, found.text))
        return super().suffix(found)

    def strength(self, token: Token) -> int | None:
        return super().strength(token) if token.text in ("+", "-", "*", "/", "**", "==") else None

    def prefix(self) -> nd.Node:
        token = self.peek()
        if token.kind == "text" or token.text in (".", "!"):
            raise nd.NotRead("a text or a condition", token.at)
        return super().prefix()
