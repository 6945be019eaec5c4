"""C, and JavaScript, TypeScript, Java, and other languages whose statements are like those of C."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from inverse_service.reading.scripts import nodes as nd
from inverse_service.reading.scripts.grammar import (
    PREFIX,
    Grammar,
    Parser,
    Token,
    arguments_of,
    letter,
)

_WHOLE = ("int", "long", "unsigned", "char", "short", "size_t")
_C_TYPES = [*_WHOLE, "double", "float", "const", "static", "inline", "void", "var", "let", "auto",
    "real", "bool", "final", "public", "private", "export", "default", "async", "number",
    "std::vector<double>", "return_type"]  # fmt: skip
GRAMMAR = Grammar(
    r"//[^\n]*|/\*.*?\*/|^[ \t]*#(?!\s*define)[^\n]*", frozenset(";"), frozenset("="), frozenset(),
    frozenset(("==",)), lines=False,
    quote="left out", own_powers=frozenset("%"), arrows=frozenset(("->", "=>")),
)  # fmt: skip


def read_c(text: str) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is no program of C."""
    return _OfC(text, GRAMMAR).program()


def read_javascript(text: str) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is no program of JavaScript."""
    return _Parser(text, GRAMMAR).program()


def read_typescript(text: str) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is no program of TypeScript."""
    parser = _Parser(text, GRAMMAR)
    parser.tokens = _without_types(parser.tokens)
    return parser.program()


class _Parser(Parser):
    has_pointers = False  # p->k is a part of what p points to

    def __init__(self, text: str, grammar: Grammar) -> None:
        super().__init__(text, grammar)
        self.in_functions = 0

    def statement(self) -> list[nd.Node]:
        token = self.peek()
        if token.text == "#":
            return self.defined_by_a_macro()
        if token.text == "{":
            return self.block_with_names()
        if token.kind != "name":
            return [self.plain()]
        match token.text:
            case "for" | "while" | "if" | "else" | "do" | "switch":
                return self.of_condition(token)
            case "return":
                self.next()
                value = None if self.peek().text in (";", "}") else self.expression(0)
                return [nd.Return(token.at, value)]
            case "using" | "typedef" | "import" | "struct" | "class" | "namespace" | "template":
                while self.peek().kind != "end" and self.peek().text not in (";", "{"):
                    self.next()
                if self.peek().text != "{":
                    return []
                self.next()
                body = self.program("}")  # of a class, whose names its functions see
                self.next()
                return [*body]
        found = self.declared()
        return [self.plain()] if found is None else found

    def defined_by_a_macro(self) -> list[nd.Node]:
        """#define g 9.81."""
        at = self.next().at
        self.next()
        name = self.next()
        if self.peek().kind == "line":
            return []
        value = self.prefix()
        if self.peek().kind not in ("line", "end"):
            value = nd.Call(at, nd.Name(at, "<define>"), ())
            while self.peek().kind not in ("line", "end"):
                self.next()
        return [nd.Assign(at, nd.Name(name.at, name.text), value)]

    def of_condition(self, token: Token) -> list[nd.Node]:
        self.next()
        head = [self.peek(k).text for k in range(1, 6)] if token.text == "for" else []
        counter = head[head.index("=") - 1] if "=" in head else ""
        if self.peek().text == "(":
            depth = 0
            while self.peek().kind != "end":
                text = self.next().text
                depth += (text == "(") - (text == ")")
                if not depth:
                    break
        self.skip_lines()
        body = tuple(self.statement())
        return [nd.Block(token.at, body, token.text in ("for", "while", "do"), counter)]

    def declared(self) -> list[nd.Node] | None:
        """double x = 1, y; and double f(double x) { ... }."""
        start, at = self.place, self.peek().at
        typed = False
        while self.peek().kind == "name" and (
            self.peek().text in _C_TYPES
            or self.peek(1).kind == "name"
            or (
                self.peek(1).text in "*&"
                and self.peek(2).kind == "name"
                and self.peek().text in _C_TYPES
            )
        ):
            is_function = self.peek().text == "function"
            self.next()
            typed = True
            if is_function:
                break
            while self.peek().text in ("*", "&"):
                self.next()
            while self.peek().text == "[" and self.peek(1).text == "]":  # double[] of Java
                self.place += 2
            self.skip_lines()
        if self.peek().kind == "name" and self.peek(1).text == "(" and self.is_defined():
            return [self.function(at)]
        if not typed:
            self.place = start
            return None
        found: list[nd.Node] = []
        types = {token.text for token in self.tokens[start : self.place]}
        while True:
            if self.peek().text in ("[", "{"):
                found += self.taken_apart(at)
                self.skip_lines()
                if self.peek().text != ",":
                    return found
                self.next()
                continue
            name = self.next()
            if name.kind != "name":
                raise nd.NotRead("a declaration", name.at)
            target: nd.Node = nd.Name(name.at, name.text)
            while self.peek().text == "[":
                self.next()
                self.arguments("]")
            if self.peek().text == "=":
                self.next()
                if self.peek().text == "[" and (made := self.closure(name)) is not None:
                    return [made]
                if self.is_pointed_at():
                    found.append(nd.Assign(at, target, letter(at, name.text), declares=True))
                    value = None
                else:
                    value = self.expression(0)
                if value is None:
                    self.skip_lines()
                    if self.peek().text != ",":
                        return found
                    self.next()
                    continue
                if types & {*_WHOLE} and "double" not in types:
                    self.wholes.add(name.text)
                    if not self.is_whole(value):
                        value = nd.Call(at, nd.Name(at, "<whole>"), ())
                found.append(nd.Assign(at, target, value, declares=True))
            self.skip_lines()
            if self.peek().text != ",":
                return found
            self.next()
            self.skip_lines()

    def closure(self, name: Token) -> nd.Node | None:
        """f of auto f = [&](double x) { ... }, whose names are those around it."""
        start, k = self.place, 1
        while self.peek(k).text not in ("]", "") and self.peek(k).kind != "line":
            k += 1
        if self.peek(k + 1).text != "(":
            return None
        captures = [self.peek(ahead).text for ahead in range(1, k)]
        self.place += k
        if not self.is_defined():
            self.place = start
            return None
        return replace(self.function(name.at, name.text), keeps_values="&" not in captures)

    def taken_apart(self, at: int) -> list[nd.Node]:
        """const [x, v] = y, and const {k, m} = parameters, whose parts have the names of letters."""
        opening = self.next().text
        names: list[nd.Node] = []
        while self.peek().text not in ("]", "}"):
            name = self.next()
            if name.kind != "name":
                raise nd.NotRead("a declaration", name.at)
            names.append(nd.Name(name.at, name.text))
            if self.peek().text == ",":
                self.next()
        self.next()
        self.expect("=")
        value = self.expression(0)
        if opening == "[":
            return [nd.Assign(at, nd.Items(at, tuple(names)), value, declares=True)]
        if not isinstance(value, nd.Name):
            raise nd.NotRead("parts of a thing", at)
        return [
            nd.Assign(at, one, letter(at, one.text), declares=True)
            for one in names
            if isinstance(one, nd.Name)
        ]

    def is_pointed_at(self) -> bool:
        """Whether *(double *)params follows, a number that is not given."""
        count = self.pointer_cast(1) if self.peek().text == "*" else 0
        if count:
            self.place += 1 + count
            if self.next().kind != "name" or self.peek().text not in (";", ","):
                raise nd.NotRead("a number behind a pointer", self.peek().at)
        return count > 0

    def pointer_cast(self, start: int = 0) -> int:
        """How many signs (double *) has, or static_cast<double *>, which change no value; 0 for
        anything else.
        """
        words = [self.peek(k).text for k in range(start, start + 7)]
        kept = [word for word in words if word != "const"]
        named = kept[0] in ("static_cast", "reinterpret_cast")
        opening, number, *closing = kept[named : named + 4]
        brackets = ["<", "*", ">"] if named else ["(", "*", ")"]
        if [opening, *closing] != brackets or number not in ("double", "float"):
            return 0
        return words.index(brackets[-1]) + 1

    def cast(self, at: int) -> nd.Node:
        """(double)n, a number that is not whole, and (int)x, which is cut."""
        kind = self.next().text
        self.next()
        value = self.expression(PREFIX)
        if kind in ("double", "float"):
            return nd.Call(at, nd.Name(at, "double"), (value,))
        return value if self.is_whole(value) else nd.Call(at, nd.Name(at, "<whole>"), ())

    def made(self, at: int) -> nd.Node:
        """new double[] {a, b}, new double[2], and new Array(2)."""
        kind = self.next().text
        if self.peek().text == "[" and kind in ("double", "float"):
            self.next()
            sizes = self.arguments("]")
            if self.peek().text == "{":
                self.next()
                return nd.Items(at, self.arguments("}"))
            if len(sizes) == 1:
                return nd.Call(at, nd.Name(at, "zeros"), sizes)
        if self.peek().text == "(" and kind in ("Array", "Float64Array"):
            self.next()
            given = self.arguments(")")
            if len(given) == 1 and isinstance(given[0], nd.Items):
                return given[0]
            if len(given) == 1:
                return nd.Call(at, nd.Name(at, "zeros"), given)
        raise nd.NotRead(f"new {kind}", at)

    def is_defined(self) -> bool:
        """Whether { follows the brackets behind a name, or behind operator()."""
        depth, ahead = 0, 1
        if self.peek().text == "operator" and self.peek(2).text == ")":
            ahead = 3
        while self.peek(ahead).kind != "end":
            text = self.peek(ahead).text
            depth += (text == "(") - (text == ")")
            ahead += 1
            if not depth:
                break
        while self.peek(ahead).kind == "line" or self.peek(ahead).text in ("const", "noexcept"):
            ahead += 1
        return self.peek(ahead).text == "{"

    def function(self, at: int, called: str = "") -> nd.Function:
        name = called if called else self.next().text
        self.place += bool(called)  # over the ] of a function without a name
        if name == "operator" and self.peek(1).text == ")":
            self.place += 2
        self.expect("(")
        names: list[str] = []
        first: list[nd.Node] = []
        depth, word = 1, ""
        while depth:
            token = self.next()
            if token.kind == "end":
                raise nd.NotRead("a ( that is not closed", at)
            if token.text == "[" and depth == 1 and not word:  # f(t, [x, v])
                pattern = nd.Items(token.at, self.arguments("]"))
                word = f"state{len(names)}"
                first.append(nd.Assign(token.at, pattern, nd.Name(token.at, word), declares=True))
                continue
            if token.text in ("=", "{"):
                raise nd.NotRead("arguments with values", token.at)
            depth += (token.text in "([<") - (token.text in ")]>")
            if token.kind == "name" and depth == 1:
                if word in _WHOLE:
                    self.wholes.add(token.text)
                word = token.text
            if (token.text == "," and depth == 1) or not depth:
                names += [word] if word and word not in _C_TYPES else ["unused_"] if word else []
                word = ""
        self.skip_lines()
        while self.peek().text in ("const", "noexcept"):
            self.next()
        self.skip_lines()
        self.expect("{")
        return nd.Function(at, name, tuple(names), (*first, *self.body_of_function()))

    def body_of_function(self) -> tuple[nd.Node, ...]:
        self.in_functions += 1
        body = self.program("}")
        self.in_functions -= 1
        self.next()
        return body

    def refuse_more(self, ends: Sequence[str]) -> None:
        if self.peek().text != "{":  # of the body of a class
            super().refuse_more(ends)

    def plain_value(self) -> nd.Node:
        """The right side of an assignment; a = b = 1 sets two names."""
        value = super().plain_value()
        if self.peek().text == "=":
            self.next()
            return self.plain_value()
        return value

    def strength(self, token: Token) -> int | None:
        if token.kind != "sign" or token.text not in ("^", "&", "|"):
            return super().strength(token)
        if self.in_functions:
            raise nd.Trap(f"the sign {token.text} between the digits of whole numbers", token.at)
        return None

    def joined(self, left: nd.Node, token: Token, strength: int) -> nd.Node:
        if token.text != "=>":
            return super().joined(left, token, strength)
        at = token.at
        names, first = arguments_of(left)
        if self.peek().text != "{":
            self.in_functions += 1
            try:
                result = nd.Return(at, self.expression(strength - 1))
            finally:
                self.in_functions -= 1
            return nd.Function(at, "", names, (*first, result))
        self.next()
        return nd.Function(at, "", names, (*first, *self.body_of_function()))

    def prefix(self) -> nd.Node:
        self.skip_lines()
        token, after = self.peek(), self.peek(1)
        if token.kind == "name" and token.text == "function" and after.text == "(":
            return self.suffix(replace(self.function(token.at), name=""))
        if token.kind == "name" and token.text == "new" and after.kind == "name":
            self.next()
            return self.suffix(self.made(token.at))
        if self.is_cast():
            self.next()
            return self.cast(token.at)
        if count := self.pointer_cast():
            self.place += count
            return self.prefix()
        return super().prefix()

    def is_cast(self) -> bool:
        """Whether (double) follows."""
        words = [self.peek(k).text for k in range(3)]
        return words[0] == "(" and words[1] in _C_TYPES and words[2] == ")"

    def behind(self, found: nd.Node, token: Token) -> nd.Node | None:
        if not self.is_member(token):
            return super().behind(found, token)
        self.next()
        return self.member(token.at, found, self.next().text)

    def is_member(self, token: Token) -> bool:
        """Whether .k or, behind a pointer, ->k follows."""
        if self.peek(1).kind != "name":
            return False
        points = self.has_pointers and token.text == "->" and not token.blank
        return token.text == "." or (points and not self.peek(1).blank)


class _OfC(_Parser):
    has_pointers = True


# The types of TypeScript, and the sign of a function's type
_TYPES_BEHIND = frozenset((
    "number", "string", "boolean", "any", "void", "unknown", "Float64Array", "Float32Array", "Array",
    "ReadonlyArray", "readonly", "null", "undefined",
))  # fmt: skip


def _without_types(found: list[Token]) -> list[Token]:
    """The tokens of JavaScript in a program of TypeScript."""
    known = {
        found[k + 1].text
        for k in range(len(found) - 1)
        if found[k].text in ("type", "interface") and found[k + 1].kind == "name"
    } | _TYPES_BEHIND
    kept: list[Token] = []
    place = 0
    while place < len(found):
        token = found[place]
        last = kept[-1] if kept else None
        starts = last is None or last.kind == "line" or last.text in (";", "}", "export")
        after = found[place + 1].text if place + 1 < len(found) else ""
        if starts and token.text in ("type", "interface") and after in known:
            place = _end_of_type(found, place)
        elif token.text == "as":
            place = _behind_type(found, place + 1, {*known, "const"})
        elif token.text == ":" and last is not None and (last.kind == "name" or last.text in ")?]"):
            place = _behind_type(found, place + 1, known)
            if last.text == "?":
                kept.pop()
        else:
            kept.append(token)
            place += 1
    return kept


def _end_of_type(found: Sequence[Token], place: int) -> int:
    """Behind type X = ...; and interface X { ... }."""
    depth = 0
    while place < len(found):
        token = found[place]
        depth += (token.text in ("(", "[", "{")) - (token.text in (")", "]", "}"))
        place += 1
        if not depth and (token.kind == "line" or token.text in (";", "}")):
            break
    return place


def _behind_type(found: Sequence[Token], place: int, known: Collection[str]) -> int:
    """Behind number, number[], [number, number], and Array<number>; NotRead for another type."""
    token = found[place] if place < len(found) else Token("end", "", 1, False)
    if token.text == "readonly":
        return _behind_type(found, place + 1, known)
    if token.text == "[":
        while found[place].text != "]":
            place = _behind_type(found, place + 1, known)
            if place >= len(found) or found[place].text not in (",", "]"):
                raise nd.NotRead("a type", token.at)
    elif token.text not in known:
        raise nd.NotRead("a type", token.at)
    place += 1
    texts = [one.text for one in found[place : place + 2]]
    if texts[:1] == ["<"]:
        place = _behind_type(found, place + 1, known)
        if place >= len(found) or found[place].text != ">":
            raise nd.NotRead("a type", token.at)
        place += 1
    while [one.text for one in found[place : place + 2]] == ["[", "]"]:
        place += 2
    return place
