"""Go."""

from __future__ import annotations

import re

from inverse_service.reading.scripts import nodes as nd
from inverse_service.reading.scripts.grammar import Grammar, Parser, Token

FORM = re.compile(r"\bfunc\b[^{}\n]*\bfloat64\b[^{}\n]*\{")
GRAMMAR = Grammar(
    r"//[^\n]*|/\*.*?\*/", frozenset(";"), frozenset(("=", ":=")), frozenset(),
    frozenset(("==",)), signs=r"<-|&\^|<<|>>", slices=False,
)  # fmt: skip
_REALS = frozenset(("float64", "float32"))
_WHOLES = frozenset(
    ("int", "int32", "int64", "uint", "int8", "int16", "uint8", "uint64", "byte", "rune")
)
_MATH = frozenset((
    "Sin", "Cos", "Tan", "Asin", "Acos", "Atan", "Sinh", "Cosh", "Tanh", "Exp", "Log", "Sqrt", "Abs",
    "Hypot", "Pow",
))  # fmt: skip


def read_go(text: str) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is no program of Go."""
    return _Parser(text, GRAMMAR).program()


class _Parser(Parser):
    def statement(self) -> list[nd.Node]:
        token = self.peek()
        if token.text == "{":
            return self.block_with_names()
        if token.kind != "name":
            return [self.set_or_called()]
        match token.text:
            case "package" | "import" | "type":
                self.to_the_end()
                return []
            case "func" if self.peek(1).text == "(" or self.peek(1).kind == "name":
                found = self.function()
                return [found if found.name else self.suffix(found)]  # func() { ... }()
            case "if" | "for" | "switch" | "select":
                return [self.of_condition(token)]
            case "return":
                self.next()
                ends = self.peek().kind == "line" or self.peek().text == "}"
                return [nd.Return(token.at, None if ends else self.list_of_values())]
            case "var" | "const":
                return self.declared(token.text)
            case "defer" | "go" | "goto" | "fallthrough" | "break" | "continue":
                raise nd.Trap(f"the statement {token.text}", token.at)
        return [self.set_or_called()]

    def to_the_end(self) -> None:
        """To the end of the line, over brackets."""
        depth = 0
        while self.peek().kind != "end" and (depth or self.peek().kind != "line"):
            token = self.next()
            depth += (token.text in ("(", "[", "{")) - (token.text in (")", "]", "}"))

    def of_condition(self, token: Token) -> nd.Node:
        """if a { b } else { c }, and for i := 0; i < n; i++ { ... }."""
        counter = self.peek(1).text if token.text == "for" else ""
        while self.peek().text != "{":
            if self.next().kind == "end":
                raise nd.NotRead("a block that is not closed", token.at)
        body = [*self.block()]
        if self.peek().text == "else":
            self.next()
            body += self.statement()
        return nd.Block(token.at, tuple(body), token.text == "for", counter)

    def list_of_values(self) -> nd.Node:
        items = [self.expression(0)]
        while self.peek().text == ",":
            self.next()
            items.append(self.expression(0))
        return items[0] if len(items) == 1 else nd.Items(items[0].at, tuple(items))

    def set_or_called(self) -> nd.Node:
        """x, v := y[0], y[1], and x += v."""
        start = self.place
        first = self.expression(13)
        if self.peek().text not in (",", "=", ":="):
            self.place = start
            return self.plain()
        targets = [first]
        while self.peek().text == ",":
            self.next()
            targets.append(self.expression(13))
        sign = self.next()
        if sign.text not in ("=", ":="):
            raise nd.NotRead("a statement that sets nothing", sign.at)
        return self.set(targets, self.list_of_values(), sign.text == ":=")

    def set(self, targets: list[nd.Node], value: nd.Node, declares: bool) -> nd.Node:
        values = value.items if isinstance(value, nd.Items) and len(targets) > 1 else (value,)
        if declares and len(values) == len(targets):
            for target, one in zip(targets, values, strict=True):
                if isinstance(target, nd.Name):
                    (self.wholes.add if self.is_whole(one) else self.wholes.discard)(target.text)
        at = targets[0].at
        target = targets[0] if len(targets) == 1 else nd.Items(at, tuple(targets))
        return nd.Assign(at, target, value, declares=declares)

    def declared(self, word: str) -> list[nd.Node]:
        """var x, v float64 = 1, 0; const g = 9.81; const ( ... ), of whose names each has a value."""
        self.next()
        if self.peek().text != "(":
            return self.declared_here()
        self.next()
        found: list[nd.Node] = []
        while True:
            self.skip_ends()
            if self.peek().text == ")":
                self.next()
                return found
            made = self.declared_here()
            if word == "const" and not made:
                raise nd.Trap("a constant without a value", self.peek().at)
            found += made

    def declared_here(self) -> list[nd.Node]:
        names = [self.next()]
        while self.peek().text == ",":
            self.next()
            names.append(self.next())
        kind = (
            self.type() if self.peek().text not in ("=", ")") and self.peek().kind != "line" else ""
        )
        if any(name.kind != "name" for name in names):
            raise nd.NotRead("a declaration", names[0].at)
        for name in names:
            (self.wholes.add if kind in _WHOLES else self.wholes.discard)(name.text)
        if self.peek().text != "=":
            return []
        self.next()
        targets: list[nd.Node] = [nd.Name(name.at, name.text) for name in names]
        return [self.set(targets, self.list_of_values(), not kind)]

    def type(self) -> str:
        """The words of a type: float64, []float64, [2]float64, map[string]float64."""
        found = ""
        while self.peek().text in ("*", "[") or self.peek().kind == "name":
            token = self.next()
            found += token.text
            if token.text == "[":
                while self.peek().text != "]":
                    if self.peek().kind == "end":
                        raise nd.NotRead("a type", token.at)
                    self.next()
                self.next()
            elif token.kind == "name" and not (token.text == "map" and self.peek().text == "["):
                break
        return found

    def function(self) -> nd.Function:
        """func f(t float64, y []float64) []float64 { ... }, of a name, a thing, or neither."""
        at = self.next().at
        name = ""
        if self.peek().text == "(" and self.is_receiver():
            self.next()
            self.owners.add(self.next().text)
            self.type()
            self.expect(")")
            if len(self.owners) > 1:
                raise nd.NotRead("parts of two things", at)
        if self.peek().kind == "name":
            name = self.next().text
        kept = {*self.wholes}
        parameters = self.arguments_with_types()
        results: tuple[str, ...] = ()
        if self.peek().text == "(":
            named = self.arguments_with_types()
            results = () if "unused_" in named else named
        elif self.peek().text != "{":
            self.type()
        body = self.block()
        self.wholes = kept
        return nd.Function(at, name, parameters, body, results)

    def is_receiver(self) -> bool:
        """Whether a name and its ( follow the first brackets, as in func (p *Body) f(...)."""
        ahead = 0
        while self.peek(ahead).text != ")" and self.peek(ahead).kind != "end":
            ahead += 1
        return self.peek(ahead + 1).kind == "name" and self.peek(ahead + 2).text == "("

    def arguments_with_types(self) -> tuple[str, ...]:
        """The names of (t float64, y, dy []float64), and as many of (float64, float64) without."""
        self.expect("(")
        words: list[str] = []
        kinds: list[str] = []
        self.skip_lines()
        while self.peek().text != ")":
            token = self.peek()
            if token.kind == "name":
                self.next()
                words.append(token.text)
                if self.peek().text == "func" or self.peek().text == ".":
                    raise nd.NotRead("an argument of this type", token.at)
                kinds.append("" if self.peek().text in (",", ")") else self.type())
            else:
                words.append("unused_")
                kinds.append(self.type() or "?")
            self.skip_lines()
            if self.peek().text == ",":
                self.next()
                self.skip_lines()
            elif self.peek().text != ")":
                raise nd.NotRead("arguments that are no names", self.peek().at)
        self.next()
        if words and not any(kinds):
            return ("unused_",) * len(words)
        kind = ""
        for word, own in zip(reversed(words), reversed(kinds), strict=True):
            kind = own or kind
            (self.wholes.add if kind in _WHOLES else self.wholes.discard)(word)
        return tuple(words)

    # -- formulas

    def strength(self, token: Token) -> int | None:
        return super().strength(token) if token.text in ("+", "-", "*", "/", "==") else None

    def is_whole(self, node: nd.Node) -> bool:
        match node:
            case nd.Call(function=nd.Name(text=name)):
                return name in _WHOLES or name == "len"
        return super().is_whole(node)

    def prefix(self) -> nd.Node:
        token = self.peek()
        if token.text == "func":
            return self.function()
        if token.text == "[":
            return self.literal(token.at)
        if token.text == "make" and self.peek(1).text == "(":
            self.place += 2
            self.type()
            self.expect(",")
            size = self.expression(0)
            while self.next().text != ")":
                if self.peek().kind == "end":
                    raise nd.NotRead("a ( that is not closed", token.at)
            return nd.Call(token.at, nd.Name(token.at, "zeros"), (size,))
        if token.text in ("*", "&", "{", "/", "<-"):
            raise nd.NotRead("a pointer", token.at)
        return super().prefix()

    def literal(self, at: int) -> nd.Node:
        """[]float64{v, a}."""
        kind = self.type()
        if kind.lstrip("[") not in _REALS:
            raise nd.NotRead("a list of this type", at)
        self.expect("{")
        found: list[nd.Node] = []
        self.skip_lines()
        while self.peek().text != "}":
            found.append(self.expression(0))
            self.skip_lines()
            if self.peek().text == ",":
                self.next()
                self.skip_lines()
            elif self.peek().text != "}":
                raise nd.NotRead("a list with places", at)
        self.next()
        return nd.Items(at, tuple(found))

    def suffix(self, found: nd.Node) -> nd.Node:
        if isinstance(found, nd.Name) and found.text == "math" and self.peek().text == ".":
            self.next()
            name = self.next().text
            plain = "pi" if name == "Pi" else name.lower() if name in _MATH else f"math.{name}"
            found = nd.Name(found.at, plain)
        while (
            self.peek().text == "." and self.peek(1).kind == "name" and isinstance(found, nd.Name)
        ):
            self.next()
            name = self.next().text
            if self.peek().text == "(":
                return super().suffix(nd.Member(found.at, found, name))
            found = self.member(found.at, found, name)
        if self.peek().text == "{" and isinstance(found, nd.Name) and found.text[:1].isupper():
            raise nd.NotRead("a structure", found.at)
        return super().suffix(found)
