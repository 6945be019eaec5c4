"""R, and the functions of rates that its package deSolve integrates."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from inverse_service.reading.scripts import nodes as nd
from inverse_service.reading.scripts.grammar import Grammar, Parser, Token, letter

FORM = re.compile(
    r"\bfunction[ \t]*\([^(){}]*\)(?=[\s\S]*\blist[ \t]*\()(?=[\s\S]*(?:<-|\bc[ \t]*\())"
    r"|<-[ \t]*function[ \t]*\("
    r"|\bfor[ \t]*\([ \t]*\w+[ \t]+in\b[^\n{]*\{(?=[\s\S]*\w\[[^\]\n]*\][ \t]*<-)"
)
GRAMMAR = Grammar(
    r"#[^\n]*", frozenset(";"), frozenset(("<-", "=")), frozenset(), frozenset(("==",)),
    reserved=frozenset(("repeat", "break", "next")), prompt=r"^>(?=[ \t])",
    signs=r"<<-|<-|%[^%\n]*%|\$", words=r"(?:[^\W\d]|\.(?=[^\W\d]))[\w.]*", slices=True,
)  # fmt: skip
# Calls that leave their argument as it is.
_SAME = frozenset(
    ("as.numeric", "as.vector", "as.double", "unname", "unlist", "invisible", "as.list")
)
# Where the state, the function, and the parameters are among the arguments of an integrator.
_ARGUMENTS = ("y", "times", "func", "parms")
_INTEGRATORS = frozenset((
    "ode", "lsoda", "lsode", "lsodes", "lsodar", "vode", "daspk", "radau", "rk", "rk4", "euler",
    "zvode", "bdf", "adams", "impAdams",
))  # fmt: skip


@dataclass(slots=True)
class Known:
    """What a first look at a program finds: the names in its vectors, and what each function is
    integrated with.
    """

    vectors: dict[str, tuple[str, ...]] = field(default_factory=dict)
    states: dict[str, tuple[str, ...]] = field(default_factory=dict)
    parameters: dict[str, tuple[str, ...]] = field(default_factory=dict)


def read_r(text: str) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is no program of R."""
    first = _Parser(text, Known())
    first.program()
    return _Parser(text, first.known).program()


class _Parser(Parser):
    def __init__(self, text: str, known: Known) -> None:
        super().__init__(text, GRAMMAR)
        self.known = known
        self.called = ""  # the name that a function is given
        self.state = self.parms = ""  # the arguments of the function that is read
        self.names: tuple[str, ...] = ()  # of the state

    def statement(self) -> list[nd.Node]:
        token = self.peek()
        if token.text == "{":
            return [*self.block()]
        match token.text:
            case "if" | "for" | "while":
                return [self.of_condition(token)]
            case "library" | "require" | "rm" | "source":
                self.to_the_end()
                return []
            case "return" if self.peek(1).text == "(":
                self.next()
                self.expect("(")
                self.skip_lines()
                value = None if self.peek().text == ")" else self.argument()
                self.to_the_bracket()  # further outputs, as in list(c(dx, dv), energy)
                return [nd.Return(token.at, value)]
        is_set = token.kind == "name" and self.peek(1).text in ("<-", "=")
        self.called = token.text if is_set else ""
        found = self.plain()
        self.called = ""
        names = _names_of(found.value) if isinstance(found, nd.Assign) else ()
        if names and isinstance(found, nd.Assign) and isinstance(found.target, nd.Name):
            self.known.vectors[found.target.text] = names
        return [found]

    def to_the_end(self) -> None:
        while self.peek().kind not in ("line", "end"):
            self.next()

    def of_condition(self, token: Token) -> nd.Node:
        """if (a) b else c, for (i in 1:n) b, and while (a) b."""
        self.next()
        self.expect("(")
        counter = self.peek().text if token.text == "for" else ""
        self.to_the_bracket()
        self.skip_lines()
        body = self.statement()
        start = self.place
        self.skip_lines()
        if token.text == "if" and self.peek().text == "else":
            self.next()
            self.skip_lines()
            body += self.statement()
        else:
            self.place = start
        return nd.Block(token.at, tuple(body), token.text != "if", counter)

    def plain_value(self) -> nd.Node:
        """The right side of an assignment; a <- b <- 1 sets two names."""
        value = self.expression(0)
        if self.peek().text in self.grammar.assign:
            raise nd.Trap("two names that are set at once", self.peek().at)
        return value

    def strength(self, token: Token) -> int | None:
        if token.text in ("->", "<<-"):
            raise nd.Trap(f"the sign {token.text}", token.at)
        return None if token.text in ("~", "@", "$", ".") else super().strength(token)

    def prefix(self) -> nd.Node:
        self.skip_lines()
        token = self.peek()
        if token.text == "function" and self.peek(1).text == "(":
            return self.function()
        if token.text in ("if", "repeat"):
            raise nd.Trap("a value under a condition", token.at)
        if token.text == "with" and self.peek(1).text == "(":
            raise nd.NotRead("names that with(...) gives", token.at)
        return super().prefix()

    def suffix(self, found: nd.Node) -> nd.Node:
        while True:
            token = self.peek()
            if token.text == "(" and isinstance(found, nd.Name):
                self.next()
                found = self.call(token.at, found)
            elif token.text == "[" and self.peek(1).text == "[":
                self.next()
                self.next()
                found = self.part(token.at, found, self.arguments("]"))
                self.expect("]")
            elif token.text == "[":
                self.next()
                found = self.part(token.at, found, self.arguments("]"))
            elif token.text == "$" and self.peek(1).kind == "name":
                self.next()
                name = self.next()
                found = self.part(token.at, found, (nd.Constant(token.at, name.text),))
            else:
                return found

    def part(self, at: int, base: nd.Node, places: tuple[nd.Node, ...]) -> nd.Node:
        """y[1], y["x"], and p$k: an entry of the state by its name, or a parameter."""
        match places:
            case (nd.Constant(value=str() as name),):
                pass
            case _:
                return nd.Index(at, base, places)
        if isinstance(base, nd.Name) and base.text == self.state:
            if name not in self.names:
                raise nd.NotRead("an entry whose place is not given", at)
            return nd.Index(
                at, base, (nd.Constant(at, Fraction(self.names.index(name) + 1), True),)
            )
        if isinstance(base, nd.Name) and base.text in (self.parms, *self.known.vectors):
            return letter(at, name)
        raise nd.NotRead("a part by its name", at)

    def call(self, at: int, function: nd.Name) -> nd.Node:
        """f(a, b = c); list(c(dx, dv), energy) of rates is its first part."""
        given: list[nd.Node] = []
        named: list[tuple[str, nd.Node]] = []
        self.skip_lines()
        while self.peek().text != ")":
            word = self.peek()
            if word.kind in ("name", "text") and self.peek(1).text == "=":
                self.place += 2
                self.skip_lines()
                named.append((word.text.strip("\"'"), self.argument()))
            else:
                given.append(self.argument())
            self.skip_lines()
            if self.peek().text not in (",", ")"):
                raise nd.NotRead("arguments without a comma", self.peek().at)
            if self.peek().text == ",":
                self.next()
                self.skip_lines()
        self.next()
        made = nd.Call(at, function, tuple(given), tuple(named))
        if function.text in _INTEGRATORS:
            self.note_integrated(made)
        if function.text in _SAME and len(given) == 1:
            return given[0]
        if function.text == "c" and not (given and named):
            return nd.Call(
                at, nd.Name(at, "concatenate"), (*given, *(one for _, one in named)), tuple(named)
            )
        if function.text == "list" and given:
            return given[0]
        if function.text in ("numeric", "rep", "double"):
            size = given[-1] if given else nd.Name(at, "<size>")
            if function.text == "rep" and given[0] != nd.Constant(given[0].at, Fraction(0), True):
                raise nd.NotRead("rep(...)", at)
            return nd.Call(at, nd.Name(at, "zeros"), (size,))
        return made

    def note_integrated(self, call: nd.Call) -> None:
        """ode(y = state, times, func = f, parms = p); R hands what has no name to the arguments
        that are left, in their order.
        """
        given = dict(call.keywords)
        left = (name for name in _ARGUMENTS if name not in given)
        given |= zip(left, call.arguments, strict=False)
        function = given.get("func")
        if isinstance(function, nd.Name):
            for name, held in (("y", self.known.states), ("parms", self.known.parameters)):
                node = given.get(name)
                names = _names_of(node) if node is not None else ()
                if isinstance(node, nd.Name):
                    names = self.known.vectors.get(node.text, ())
                held[function.text] = names

    def function(self) -> nd.Node:
        at, name = self.next().at, self.called
        self.expect("(")
        parameters: list[str] = []
        while (token := self.next()).text != ")":
            if token.kind == "name":
                parameters.append(token.text)
            elif token.text != "," and token.kind != "line":
                raise nd.NotRead("arguments with values", token.at)
        self.skip_lines()
        kept = self.state, self.parms, self.names
        self.state, self.parms = [*parameters[1:], "", ""][:2]
        self.names = self.known.states.get(name, ())
        body = [*self.body(name)]
        self.state, self.parms, self.names = kept
        return nd.Function(at, name, tuple(parameters), _with_result(body, at))

    def body(self, name: str) -> Sequence[nd.Node]:
        """The statements of a function, those in with(as.list(c(state, parms)), {...}) at its end
        behind the names that it gives.
        """
        if self.peek().text == "with":
            return self.within(name)
        if self.peek().text != "{":
            return self.statement()
        self.next()
        found: list[nd.Node] = []
        while True:
            self.skip_ends()
            if self.peek().text == "}":
                self.next()
                return found
            if self.peek().kind == "end":
                raise nd.NotRead("a { that is not closed", self.peek().at)
            if self.peek().text == "with" or (
                [self.peek(k).text for k in range(3)] == ["return", "(", "with"]
            ):
                if self.peek().text == "return":
                    self.place += 2
                found += self.within(name)
                while self.peek().text != "}":
                    if self.next().text not in (")", ";", "\n"):
                        raise nd.NotRead("what follows with(...)", self.peek().at)
            else:
                found += self.one_statement(("}",))

    def within(self, name: str) -> list[nd.Node]:
        at = self.next().at
        self.expect("(")
        given: list[str] = []
        depth = 0
        while depth or self.peek().text != ",":
            token = self.next()
            depth += (token.text == "(") - (token.text == ")")
            if token.kind == "end" or depth < 0:
                raise nd.NotRead("with(...) without names", at)
            if token.kind == "name" and token.text not in ("as.list", "c", "list", "data.frame"):
                given.append(token.text)
        self.next()
        self.skip_lines()
        body = [*self.block()] if self.peek().text == "{" else self.statement()
        self.skip_lines()
        self.expect(")")
        if not {*given} <= {self.state, self.parms}:
            raise nd.NotRead("names that with(...) gives", at)
        found: list[nd.Node] = []
        if self.parms in given:
            found += [
                nd.Assign(at, nd.Name(at, one), letter(at, one))
                for one in self.known.parameters.get(name, ())
            ]
        if self.state in given:
            names = self.names or _names_of_rates(body)
            state = nd.Name(at, "<state>")
            found.append(nd.Assign(at, state, nd.Name(at, self.state)))
            entries = [
                nd.Index(at, state, (nd.Constant(at, Fraction(k + 1), True),))
                for k in range(len(names))
            ]
            targets = nd.Items(at, tuple(nd.Name(at, one) for one in names))
            found.append(nd.Assign(at, targets, nd.Items(at, tuple(entries))))
        return [*found, *body]


def _names_of(node: nd.Node) -> tuple[str, ...]:
    """x, v of c(x = 1, v = 0) and of list(x = 1, v = 0)."""
    match node:
        case nd.Call(function=nd.Name(text="concatenate" | "list"), keywords=keywords):
            return tuple(name for name, _ in keywords)
    return ()


def _with_result(body: list[nd.Node], at: int) -> tuple[nd.Node, ...]:
    """The statements of a function, whose last one is its value."""
    match body:
        case [*_, nd.Return()]:
            return tuple(body)
        case [*most, nd.Assign(target=target) as last]:
            return (*most, last, nd.Return(last.at, target))
        case [*most, nd.Block() | nd.Stop() as last]:
            return (*most, last, nd.Stop(last.at, "a function that returns under a condition"))
        case [*most, last]:
            return (*most, nd.Return(last.at, last))
    return (nd.Stop(at, "a function without a value"),)


def _names_of_rates(body: Sequence[nd.Node]) -> tuple[str, ...]:
    """x, v of the list(c(dx, dv)) at the end, where no initial state gives the names."""
    match body:
        case [*_, nd.Return(value=nd.Call(arguments=rates))] | [*_, nd.Call(arguments=rates)]:
            words = [one.text for one in rates if isinstance(one, nd.Name)]
            if len(words) == len(rates) and all(re.fullmatch(r"d\w+", word) for word in words):
                return tuple(word[1:] for word in words)
    raise nd.NotRead("a state without names")
