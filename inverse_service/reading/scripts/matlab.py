"""MATLAB and Octave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from inverse_service.reading.scripts import matlab_texts, nodes as nd
from inverse_service.reading.scripts.grammar import Grammar, Parser, Token, names_of_arguments

GRAMMAR = Grammar(
    r"(?:%|#)[^\n]*|\.\.\.[^\n]*\n", frozenset(";,"), frozenset("="), frozenset(),
    frozenset(("==",)), prime="transpose", prompt=r"^>>+", slices=True,
    quote="text", matrices=True, own_powers=frozenset("\\"),
)  # fmt: skip
_OF_TEXTS = replace(GRAMMAR, assign=frozenset(), equals=frozenset(("=", "==")))


def read_matlab(text: str) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is no program of MATLAB."""
    body = tuple(map(_without_inline, _Parser(text, GRAMMAR).program()))
    if not any(_is_dsolve(node) for one in body for node in nd.walk(one)):
        return body
    texts = {
        one.target.text: one.value
        for one in body
        if isinstance(one, nd.Assign) and isinstance(one.target, nd.Name) and _is_text(one.value)
    }
    return tuple(each for one in body for each in _without_texts(one, texts))


def _without_inline(one: nd.Node) -> nd.Node:
    """f = @(t, y) [...] for f = inline('[...]', 't', 'y')."""
    match one:
        case nd.Assign(
            value=nd.Call(function=nd.Name(text="inline"), arguments=[first, *others])
        ) if others and all(map(_is_text, (first, *others))):
            names = tuple(str(name.value) for name in others if isinstance(name, nd.Constant))
            body = (nd.Return(one.at, _of_text(first)[0]),)
            return replace(one, value=nd.Function(one.at, "", names, body))
    return one


def _is_text(node: nd.Node) -> bool:
    return isinstance(node, nd.Constant) and isinstance(node.value, str)


def _is_dsolve(node: nd.Node) -> bool:
    function = node.function if isinstance(node, nd.Call) else None
    return isinstance(function, nd.Name) and function.text == "dsolve"


def _without_texts(one: nd.Node, texts: dict[str, nd.Node]) -> Sequence[nd.Node]:
    """The statement with equations for the texts of its dsolve, behind the functions in them."""
    call = next((node for node in nd.walk(one) if _is_dsolve(node)), None)
    if not isinstance(call, nd.Call) or not call.arguments:
        return [one]
    given = [
        texts.get(node.text, node) if isinstance(node, nd.Name) else node for node in call.arguments
    ]
    parts = [_of_text(node) for node in given if _is_text(node)]
    found = matlab_texts.equations_of(given, parts) if parts else None
    if found is None:
        return [one]
    at = one.at
    functions = [
        nd.Assign(
            at, nd.Name(at, name), nd.Call(at, nd.Name(at, "Function"), (nd.Constant(at, name),))
        )
        for name in found.functions
    ]
    whole = nd.Items(at, found.equations)
    return [*functions, replace(call, arguments=(whole,))]


def _of_text(node: nd.Node) -> tuple[nd.Node, ...]:
    """The parts between the commas of a text; NotRead where it is no formula."""
    assert isinstance(node, nd.Constant)
    parser = _Parser(str(node.value), _OF_TEXTS)
    found = [parser.expression(0)]
    while parser.peek().text in (",", ";"):
        parser.next()
        found.append(parser.expression(0))
    if parser.peek().kind != "end":
        raise nd.NotRead("a text that is no equation", node.at)
    return tuple(found)


class _Parser(Parser):
    def statement(self) -> list[nd.Node]:
        token = self.peek()
        if token.kind != "name":
            return [self.plain()]
        match token.text:
            case "function":
                return [self.function()]
            case "for" | "while" | "if" | "switch" | "parfor":
                self.next()
                counter = self.peek().text if token.text == "for" else ""
                while self.peek().kind not in ("line", "end") and self.peek().text not in ";,":
                    self.next()
                body = self.until_end()
                return [nd.Block(token.at, body, token.text in ("for", "while"), counter)]
            case "syms" | "sym" if self.peek(1).kind == "name":
                return self.symbols()
            case (
                "close"
                | "clear"
                | "clc"
                | "clearvars"
                | "hold"
                | "format"
                | "figure"
                | "global"
                | "grid"
                | "axis"
                | "pkg"
                | "end"
                | "else"
                | "elseif"
            ):
                while self.peek().kind not in ("line", "end") and self.peek().text != ";":
                    self.next()
                return []
        return [self.plain()]

    def until_end(self) -> tuple[nd.Node, ...]:
        body = self.program("end", "endfunction", "endif", "endwhile", "endfor")
        self.next()
        return body

    def function(self) -> nd.Node:
        at = self.next().at
        head: list[Token] = []
        while self.peek().kind not in ("line", "end"):
            head.append(self.next())
        words = [token.text for token in head]
        equal = words.index("=") if "=" in words else -1
        results = tuple(t.text for t in head[: max(equal, 0)] if t.kind == "name")
        call = [token for token in head[equal + 1 :] if token.kind == "name" or token.text == "~"]
        names = tuple("unused_" if token.text == "~" else token.text for token in call[1:])
        body = self.program("end", "endfunction", "function")
        if self.peek().text != "function":
            self.next()
        return nd.Function(at, call[0].text if call else "", names, body, results)

    def symbols(self) -> list[nd.Node]:
        """syms x(t) m k."""
        at = self.next().at
        found: list[nd.Node] = []
        while self.peek().kind == "name" or self.peek().text == ",":
            name = self.next()
            if name.text in ("real", "positive", "clear", "integer", "rational", ","):
                continue
            if self.peek().text == "(" and not self.peek().blank:
                self.next()
                self.arguments(")")
                made = nd.Call(at, nd.Name(at, "Function"), (nd.Constant(at, name.text),))
            else:
                made = nd.Call(at, nd.Name(at, "Symbol"), (nd.Constant(at, name.text),))
            found.append(nd.Assign(at, nd.Name(at, name.text), made))
        return found

    def skip_after(self, _: Token) -> None:
        """Nothing: a line ends a formula behind a sign, too."""

    def strength(self, token: Token) -> int | None:
        return None if token.text == "@" else super().strength(token)

    def binds_right(self, _: str) -> bool:
        return False

    def prefix(self) -> nd.Node:
        if self.peek().text == "@":
            return self.handle(self.next().at)
        return super().prefix()

    def behind(self, found: nd.Node, token: Token) -> nd.Node | None:
        if token.text == "." and not token.blank and self.peek(1).kind == "name":  # p.mu
            self.next()
            return nd.Member(token.at, found, self.next().text)
        return None if token.text == "[" else super().behind(found, token)

    def handle(self, at: int) -> nd.Node:
        """@(x, y) x + y, or @f."""
        if self.peek().text != "(":
            return nd.Name(at, self.next().text)
        self.next()
        kept, self.rows = self.rows, 0
        names = names_of_arguments(nd.Items(at, self.arguments(")")))
        body = self.expression(0)
        self.rows = kept
        return nd.Function(at, "", names, (nd.Return(at, body),))
