"""Julia."""

from __future__ import annotations

from inverse_service.reading.scripts import modeling_toolkit as mtk, nodes as nd
from inverse_service.reading.scripts.grammar import Grammar, Parser, Token

GRAMMAR = Grammar(
    r"\#=.*?=\#|\#[^\n]*", frozenset(";"), frozenset("="), frozenset(("=",)), frozenset(("==",)),
    prime="transpose", by_number=True, prompt=r"^julia>", slices=True,
    matrices=True, own_powers=frozenset("\\"), arrows=frozenset(("->",)),
    traps={"\u00f7": "a quotient that Julia rounds"},
)  # fmt: skip


def read_julia(text: str) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is no program of Julia."""
    parser = _Parser(text, GRAMMAR)
    body = parser.program()
    if parser.failed is not None:
        raise parser.failed
    return body


class _Parser(Parser):
    def __init__(self, text: str, grammar: Grammar) -> None:
        super().__init__(text, grammar)
        self.text = text
        # By the head of a component, the lines of which are no system of their own.
        self.failed: nd.NotRead | None = None

    def statement(self) -> list[nd.Node]:
        token = self.peek()
        if token.text == "@" and self.peek(1).kind == "name":  # @inbounds, @variables t
            kept = self.peek(1).text in ("inbounds", "views", "fastmath", "simd")
            self.next()
            self.next()
            word = self.tokens[self.place - 1].text
            if kept or word in mtk.NAMED:
                return self.statement()
            if word in ("unpack", "unpack_", "extract"):
                return self.unpacked(token.at)
            if word in mtk.DECLARE:
                return mtk.declared(self.to_the_end())
            raise nd.NotRead(f"@{self.tokens[self.place - 1].text}", token.at)
        if token.text == "(" and self.peek(1).text == ";":
            self.next()
            self.next()
            return self.unpacked(token.at)
        if token.kind != "name":
            return [self.plain()]
        match token.text:
            case "function":
                return [self.function()]
            case "for" | "while" | "if" | "let" | "begin" | "try":
                self.next()
                counter = self.peek().text if token.text == "for" else ""
                while self.peek().kind not in ("line", "end") and self.peek().text != ";":
                    self.next()
                body = self.program("end")
                self.next()
                if token.text == "begin":
                    return [*body]
                return [nd.Block(token.at, body, token.text in ("for", "while"), counter)]
            case "using" | "import":
                line = self.text[token.at - 1 :].partition("\n")[0]
                while self.peek().kind not in ("line", "end"):
                    self.next()
                return mtk.imported(line, token.at)
            case "export" | "module" | "else" | "elseif" | "end" | "struct":
                while self.peek().kind not in ("line", "end"):
                    self.next()
                return []
            case "const" | "local" | "global":
                self.next()
                start = self.place
                while self.peek().kind == "name" and self.peek(1).text == ",":  # global x, v
                    self.place += 2
                if self.peek().kind == "name" and self.peek(1).kind in ("line", "end"):
                    self.next()
                    return []
                self.place = start
                return self.statement()
            case "return":
                self.next()
                if self.peek().kind in ("line", "end"):
                    return [nd.Return(token.at, None)]
                value = self.expression(0)
                if self.peek().text == ",":
                    items = [value]
                    while self.peek().text == ",":
                        self.next()
                        items.append(self.expression(0))
                    value = nd.Items(token.at, tuple(items))
                nothing = isinstance(value, nd.Name) and value.text == "nothing"
                return [nd.Return(token.at, None if nothing else value)]
        assigned = self.assigned()
        return [assigned] if assigned is not None else self.several() or [self.plain()]

    def to_the_end(self) -> list[Token]:
        """The tokens of a declaration up to the end of its line, or of begin ... end; a line goes on
        behind a comma.
        """
        found: list[Token] = []
        depth, block = 0, self.peek().text == "begin"
        while (token := self.peek()).kind != "end":
            goes_on = block or depth or not found or found[-1].text == ","
            if token.kind == "line" and not goes_on:
                break
            depth += (token.text in ("(", "[", "{")) - (token.text in (")", "]", "}"))
            self.next()
            if block and token.text == "end" and not depth:
                break
            if token.kind != "line":
                found.append(token)
        return found

    def unpacked(self, at: int) -> list[nd.Node]:
        """m, l of @unpack m, l = p, and of (; m, l) = p."""
        names: list[Token] = []
        while self.peek().kind == "name" or self.peek().text == ",":
            if (token := self.next()).kind == "name":
                names.append(token)
        if self.peek().text == ")":
            self.next()
        self.expect("=")
        owner = self.expression(0)
        return [
            nd.Assign(one.at, nd.Name(one.at, one.text), nd.Member(at, owner, one.text))
            for one in names
        ]

    def several(self) -> list[nd.Node] | None:
        """x, v = u, and the last value of a function."""
        start = self.place
        names: list[nd.Node] = []
        while self.peek().kind == "name" and self.peek(1).text == ",":
            name = self.next()
            names.append(nd.Name(name.at, name.text))
            self.next()
        if not names or self.peek().kind != "name" or self.peek(1).text not in ("=", ".="):
            self.place = start
            return None
        last = self.next()
        names.append(nd.Name(last.at, last.text))
        self.next()
        value = self.expression(0)
        items = [value]
        while self.peek().text == ",":
            self.next()
            items.append(self.expression(0))
        whole = items[0] if len(items) == 1 else nd.Items(value.at, tuple(items))
        return [nd.Assign(last.at, nd.Items(last.at, tuple(names)), whole)]

    def function(self) -> nd.Node:
        at = self.next().at
        try:
            name, names = self._head(at)
        except nd.NotRead as error:
            if mtk.declares(self.text):
                self.failed = error
            raise
        while self.peek().kind not in ("line", "end"):  # where T
            self.next()
        return self.function_of(at, name, names)

    def assigned(self) -> nd.Node | None:
        """f(u, p, t) = begin ... end."""
        start, at = self.place, self.peek().at
        ahead = 1 + (self.peek(1).text == "!")
        if self.peek(ahead).text == "(":
            depth = 0
            while self.peek(ahead).kind not in ("line", "end"):
                depth += (self.peek(ahead).text == "(") - (self.peek(ahead).text == ")")
                ahead += 1
                if not depth:
                    break
            if [self.peek(ahead + k).text for k in (0, 1)] == ["=", "begin"]:
                name, names = self._head(at)
                self.next()
                self.next()
                return self.function_of(at, name, names)
        self.place = start
        return None

    def _head(self, at: int) -> tuple[str, list[str]]:
        """The name and the arguments of a function."""
        name = self.next().text
        if self.peek().text == "!":
            self.next()
        self.expect("(")
        names: list[str] = []
        depth, fresh = 1, True
        while depth:
            token = self.next()
            if token.kind == "end":
                raise nd.NotRead("a ( that is not closed", at)
            depth += (token.text in ("(", "{", "[")) - (token.text in (")", "}", "]"))
            if depth > 1 or token.text == ";":
                raise nd.NotRead("arguments that are no names", token.at)
            if token.kind == "name" and fresh:
                names.append(token.text if token.text.strip("_") else f"unused_{len(names)}")
            fresh = token.text == ","
        return name, names

    def function_of(self, at: int, name: str, names: list[str]) -> nd.Node:
        body = list(self.program("end"))
        self.next()
        if body and not isinstance(body[-1], nd.Return | nd.Assign | nd.Block | nd.Function):
            nothing = isinstance(body[-1], nd.Name) and body[-1].text == "nothing"
            body[-1] = nd.Return(body[-1].at, None if nothing else body[-1])
        return nd.Function(at, name, tuple(names), tuple(body))

    def strength(self, token: Token) -> int | None:
        return None if token.text in ("@", "@@") else super().strength(token)

    def prefix(self) -> nd.Node:
        if self.peek().text == ":" and self.peek(1).kind == "name":  # :sys, a name of Julia's
            at = self.next().at
            return nd.Constant(at, self.next().text)
        return super().prefix()

    def argument(self) -> nd.Node:
        """One argument, or a word with its value."""
        if self.peek().kind == "name" and self.peek(1).text == "=":
            word = self.next()
            self.next()
            value = self.argument()
            return nd.Binary(word.at, "->", nd.Constant(word.at, word.text), value)
        return super().argument()

    def lists(self) -> bool:
        """Whether the [ ] holds a vector, [a, b], and no matrix, [a b; c d]."""
        depth, ahead = 1, 0
        while (token := self.peek(ahead)).kind != "end":
            depth += (token.text in ("[", "(", "{")) - (token.text in ("]", ")", "}"))
            if depth == 0:
                break
            if depth == 1 and token.text == ",":
                return True
            if depth == 1 and token.text == ";":
                return False
            ahead += 1
        blanks = [self.peek(k).blank for k in range(1, ahead) if self.peek(k).kind != "sign"]
        return not any(blanks)

    def behind(self, found: nd.Node, token: Token) -> nd.Node | None:
        if token.blank and token.text in ("(", "["):
            return None
        dotted = token.text == "." and self.peek(1).text == "("
        if dotted or (token.text == "!" and not token.blank):  # f.(x) and f!
            self.next()
            return found
        if token.text == "." and self.peek(1).kind == "name":
            self.next()
            return nd.Member(token.at, found, self.next().text)
        return super().behind(found, token)
