"""Modelica: the declarations and equations of one model, with its loops of equations unrolled."""

from __future__ import annotations

import re
from fractions import Fraction

from inverse_service.reading.scripts import nodes as nd
from inverse_service.reading.scripts.grammar import Grammar, Parser, Token

FORM = re.compile(
    r"^[ \t]*(?:model|class)[ \t]+\w+(?=[\s\S]*^[ \t]*equation\b[\s\S]*\b(?:der|connect)[ \t]*\()",
    re.MULTILINE,
)
EQUATION = "<equation "  # what the names of equations begin with
_GRAMMAR = Grammar(
    r"//[^\n]*|/\*.*?\*/", frozenset(";"), frozenset((":=",)), frozenset(),
    frozenset("="), lines=False, signs=r"<>|:=|==",
)  # fmt: skip
_IN_FRONT = frozenset((
    "parameter", "constant", "final", "input", "output", "protected", "public", "inner", "outer",
))  # fmt: skip
_FIXED = frozenset(("parameter", "constant"))
_OF_LIBRARY = {"pi": nd.Name(0, "pi"), "g_n": nd.Constant(0, Fraction(980665, 100000))}
_MOST_TIMES = 32  # of a loop


def read_modelica(text: str) -> tuple[nd.Node, ...]:
    """What the variables of a model are, and its equations; NotRead where it has other parts."""
    return _Parser(text, _GRAMMAR).model()


class _Parser(Parser):
    def __init__(self, text: str, grammar: Grammar) -> None:
        super().__init__(text, grammar)
        self.whole_values: dict[str, int] = {}
        self.types = {"Real"}
        self.count = 0

    def model(self) -> tuple[nd.Node, ...]:
        if self.after_lines().text == "within":
            self.to_the_end()
            self.skip_lines()
        kind, name = self.next(), self.next()
        if kind.text not in ("model", "class"):
            raise nd.NotRead("another part than a model", kind.at)
        self.description()
        found: list[nd.Node] = [nd.Name(kind.at, "t")]
        while (token := self.after_lines()).text != "equation":
            if token.kind == "end" or token.text in ("end", "algorithm"):
                raise nd.NotRead("a model without equations", token.at)
            if token.text == "initial":
                self.next()
                self.initial()
            elif token.text in ("protected", "public") and self.peek(1).kind == "line":
                self.next()
            else:
                found += self.declared()
        self.next()
        found += self.equations()
        self.next()
        if self.after_lines().text != name.text:
            raise nd.NotRead("a model that ends as another one", self.peek().at)
        self.next()
        if self.peek().text == ";":
            self.next()
        if self.after_lines().kind != "end":
            raise nd.Trap("another model", self.peek().at)
        return tuple(found)

    def after_lines(self) -> Token:
        self.skip_lines()
        return self.peek()

    def description(self) -> None:
        """Over the text behind a name, and over annotation(...)."""
        while self.after_lines().kind == "text" or self.peek().text == "annotation":
            if self.next().text == "annotation":
                self.expect("(")
                self.to_the_bracket()

    def to_the_end(self) -> list[Token]:
        found = []
        while self.peek().text != ";":
            if self.peek().kind == "end":
                raise nd.NotRead("a statement that is not closed", self.peek().at)
            found.append(self.next())
        self.next()
        return found

    def ahead(self) -> list[Token]:
        """The tokens up to the end of a statement, which are not read."""
        start = self.place
        found = self.to_the_end()
        self.place = start
        return found

    def initial(self) -> None:
        """Over initial equation, which gives no equation of motion."""
        self.next()
        while self.peek().text != "equation" and self.peek().kind != "end":
            self.next()

    # -- declarations

    def declared(self) -> list[nd.Node]:
        """parameter Real k = 3 "stiffness", m; and SI.Length x[2](start = {1, 0});"""
        at = self.peek().at
        front = set()
        while self.after_lines().text in _IN_FRONT:
            front.add(self.next().text)
        kind = self.next()
        if kind.text == ".":  # .Modelica.Units.SI.Mass
            kind = self.next()
        if kind.text == "extends" and any(word.text == "Icons" for word in self.ahead()):
            self.to_the_end()
            return []
        if kind.text == "extends" or "input" in front:
            raise nd.Trap("a part that another model gives", kind.at)
        if kind.text in ("import", "annotation", "type"):
            words = self.to_the_end()
            if kind.text == "type":
                self.types.add(words[0].text)
            return self.imported(words) if kind.text == "import" else []
        if kind.kind != "name":
            raise nd.NotRead("a declaration", kind.at)
        words_of_type = [kind.text]
        while self.peek().text == ".":
            self.next()
            words_of_type.append(self.next().text)
        is_real = words_of_type[-1] in self.types or bool(
            {"SI", "SIunits", "NonSI"} & {*words_of_type}
        )
        fixed = bool(front & _FIXED)
        is_whole = words_of_type == ["Integer"] and fixed
        if not (is_real or is_whole):
            what = f"a part of the type {words_of_type[-1][:30]}"
            plain = words_of_type[-1] in ("Integer", "Boolean", "String")
            raise nd.NotRead(what, kind.at) if plain else nd.Trap(what, kind.at)
        size = self.size()
        found: list[nd.Node] = []
        while True:
            name = self.next()
            if name.kind != "name" or name.text in ("t", "time"):
                raise nd.NotRead("a declaration", name.at)
            own = self.size() or size
            if self.peek().text == "(":
                self.next()
                self.to_the_bracket()
            value = None
            if self.after_lines().text == "=":
                self.next()
                value = self.expression(13)
            found += self.variable(name, own, value, fixed)
            if is_whole and value is not None:
                self.whole_values[name.text] = self.number(value)
            self.description()
            end = self.next()
            if end.text == ";":
                return found
            if end.text != ",":
                raise nd.NotRead("a declaration", at)
            self.skip_lines()

    def imported(self, words: list[Token]) -> list[nd.Node]:
        """The value of a constant: import g = Modelica.Constants.g_n, and of all with .*"""
        texts = [word.text for word in words]
        if "Constants" not in texts:
            return []
        names = {texts[-1]: texts[0] if texts[1:2] == ["="] else texts[-1]}
        if texts[-1] == "*":
            names = {name: name for name in _OF_LIBRARY}
        at = words[0].at
        return [
            nd.Assign(at, nd.Name(at, name), nd.Call(at, nd.Name(at, nd.MORE), (_OF_LIBRARY[of],)))
            for of, name in names.items()
            if of in _OF_LIBRARY and name != "pi"
        ]

    def size(self) -> int:
        """The n of [n]; 0 for a number."""
        if self.peek().text != "[":
            return 0
        self.next()
        found = self.number(self.expression(13))
        self.expect("]")
        if not 0 < found <= _MOST_TIMES:
            raise nd.NotRead("an array of this size", self.peek().at)
        return found

    def variable(self, name: Token, size: int, value: nd.Node | None, fixed: bool) -> list[nd.Node]:
        at, target = name.at, nd.Name(name.at, name.text)
        if fixed:
            if value is None and size:
                raise nd.NotRead("an array without values", at)
            return [] if value is None else [nd.Assign(at, target, value)]

        def moving(word: str) -> nd.Node:
            return nd.Call(at, nd.Name(at, "dynamicsymbols"), (nd.Constant(at, word),))

        words = [f"{name.text}_{k + 1}" for k in range(size)]
        made = nd.Items(at, tuple(map(moving, words))) if size else moving(name.text)
        found: list[nd.Node] = [nd.Assign(at, target, made)]
        return found if value is None else [*found, self.equation(target, value)]

    def equation(self, left: nd.Node, right: nd.Node) -> nd.Node:
        self.count += 1
        name = nd.Name(left.at, f"{EQUATION}{self.count}>")
        return nd.Assign(left.at, name, nd.Binary(left.at, "==", left, right))

    # -- equations

    def equations(self) -> list[nd.Node]:
        """The equations up to `end`, which is not read."""
        found: list[nd.Node] = []
        while (token := self.after_lines()).text != "end":
            match token.text:
                case "for":
                    found += self.loop()
                case "if" | "when" | "algorithm" | "connect":
                    raise nd.Trap(f"the statement {token.text}", token.at)
                case "initial":
                    self.next()
                    self.initial()
                    self.next()
                case "annotation" | "assert":
                    self.to_the_end()
                case _:
                    if token.kind == "end":
                        raise nd.NotRead("a model that is not closed", token.at)
                    left = self.expression(13)
                    self.expect("=")
                    right = self.expression(0)
                    self.description()
                    self.expect(";")
                    found.append(self.equation(left, right))
        return found

    def loop(self) -> list[nd.Node]:
        """The equations of for i in 1:n loop ... end for; for each i."""
        at = self.next().at
        counter = self.next().text
        self.expect("in")
        first = self.number(self.expression(13))
        self.expect(":")
        last = self.number(self.expression(13))
        self.expect("loop")
        if last - first >= _MOST_TIMES or counter in self.whole_values or last < first:
            raise nd.NotRead("a loop of so many equations", at)
        start = self.place
        found: list[nd.Node] = []
        for number in range(first, last + 1):
            self.place, self.whole_values[counter] = start, number
            found += self.equations()
            self.next()
            if self.next().text != "for":
                raise nd.NotRead("a loop that is not closed", at)
        del self.whole_values[counter]
        self.expect(";")
        return found

    def number(self, node: nd.Node) -> int:
        match node:
            case nd.Constant(value=Fraction() as value) if value.denominator == 1:
                return int(value)
            case nd.Binary(sign="+" | "-" | "*" as sign, left=left, right=right):
                one, other = self.number(left), self.number(right)
                return one * other if sign == "*" else one + other * (1 if sign == "+" else -1)
        raise nd.NotRead("a number of entries that is not given", node.at)

    # -- formulas

    def strength(self, token: Token) -> int | None:
        return super().strength(token) if token.text in ("+", "-", "*", "/", "^") else None

    def prefix(self) -> nd.Node:
        token = self.after_lines()
        if token.text == "if":
            raise nd.Trap("a value under a condition", token.at)
        if token.kind == "name" and token.text in self.whole_values:
            self.next()
            return nd.Constant(token.at, Fraction(self.whole_values[token.text]), True)
        return super().prefix()

    def suffix(self, found: nd.Node) -> nd.Node:
        words = [found.text] if isinstance(found, nd.Name) else []
        while words and self.peek().text == ".":
            self.next()
            words.append(self.next().text)
        if words[:1] == ["Modelica"] and words[-1] in _OF_LIBRARY:
            return _OF_LIBRARY[words[-1]]
        if words[:2] == ["Modelica", "Math"] and len(words) == 3:
            found = nd.Name(found.at, words[2])
        elif len(words) > 1:
            raise nd.NotRead("a part of another model", found.at)
        if words == ["time"]:
            return nd.Name(found.at, "t")
        if words in (["noEvent"], ["smooth"]) and self.peek().text == "(":
            self.next()
            return self.arguments(")")[-1]
        return super().suffix(found)
