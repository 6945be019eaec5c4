"""The grammars of MATLAB, Mathematica, Maple, Maxima, and languages like C: one parser by binding powers,
and a row of what differs for each language.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple

from inverse_service.expressions import letters
from inverse_service.reading.scripts import nodes as nd
from inverse_service.reading.scripts.nodes import names_of


@dataclass(frozen=True, slots=True)
class Grammar:
    """What differs between the languages. `ends` are the signs between statements; `assign` and
    `define` those of x := ... and of f(x) := ...; `by_blank` says that a blank multiplies.
    """

    name: str
    remarks: str
    ends: frozenset[str]
    assign: frozenset[str]
    define: frozenset[str]
    equals: frozenset[str]
    lines: bool = True  # a line ends a statement
    by_blank: bool = False
    call: str = "("
    prime: str = ""  # what ' means behind a name
    reserved: frozenset[str] = frozenset()  # of loops and conditions, which are not run
    prompt: str = ""
    by_number: bool = False  # 2x is 2*x, and 1/2x is 1/(2*x)
    signs: str = r"(?!)"  # its own signs
    words: str = r"(?!)"  # its own names, such as as.list
    slices: bool = False  # y(1:3) is a part of y
    pointers: bool = False  # p->k is a part of what p points to
    types_behind: bool = False  # x: number


_WHOLE = ("int", "long", "unsigned", "char", "short", "size_t")
_C_TYPES = [*_WHOLE, "double", "float", "const", "static", "inline", "void", "var", "let", "auto",
    "real", "bool", "final", "public", "private", "export", "default", "async", "number",
    "std::vector<double>", "return_type"]  # fmt: skip
MATLAB = Grammar(
    "MATLAB", r"(?:%|#)[^\n]*|\.\.\.[^\n]*\n", frozenset(";,"), frozenset("="), frozenset(),
    frozenset(("==",)), prime="transpose", prompt=r"^>>+", slices=True,
)  # fmt: skip
MATHEMATICA = Grammar(
    "Mathematica", r"\(\*.*?\*\)", frozenset(";"), frozenset(("=",)), frozenset((":=", "=")),
    frozenset(("==",)), by_blank=True, call="[", prime="derivative", prompt=r"^In\[\d+\]:=",
)  # fmt: skip
MAPLE = Grammar(
    "Maple", r"#[^\n]*", frozenset(";:"), frozenset((":=",)), frozenset(), frozenset("="),
    lines=False, reserved=frozenset(("if", "then", "else", "elif", "fi", "for", "while", "do", "od", "proc",
    "return", "break")), prompt=r"^>",
)  # fmt: skip
MAXIMA = Grammar(
    "Maxima", r"/\*.*?\*/", frozenset(";$"), frozenset((":",)), frozenset((":=",)),
    frozenset("="), lines=False, reserved=frozenset(("if", "then", "else", "elseif", "for", "while", "do",
    "unless", "thru", "return", "go")), prompt=r"^\(%i\d+\)",
)  # fmt: skip
JULIA = Grammar(
    "Julia", r"\#=.*?=\#|\#[^\n]*", frozenset(";"), frozenset("="), frozenset(("=",)), frozenset(("==",)),
    prime="transpose", by_number=True, prompt=r"^julia>", slices=True,
)  # fmt: skip
JAVASCRIPT = Grammar(
    "C", r"//[^\n]*|/\*.*?\*/|^[ \t]*#(?!\s*define)[^\n]*", frozenset(";"), frozenset("="), frozenset(),
    frozenset(("==",)), lines=False,
)  # fmt: skip
C = replace(JAVASCRIPT, pointers=True)
TYPESCRIPT = replace(JAVASCRIPT, types_behind=True)

_TOKEN = r"""(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![A-Za-z_]*\.\d)|\d+\.)
|(?P<name>(?:\\\[[A-Za-z]+\]|[^\W\d]|\$(?=\w)|%(?=\w)|`(?=\w))(?:\\\[[A-Za-z]+\]|[\w`]|::(?=\w))*)
|(?P<text>"[^"\n]*")
|(?P<sign>\\(?=\s*[\w(\[])|:=|==|\.[-+*/^]?=(?!=)|\.[-+]|\u221a|@\.|//\.|/\.|/;|//@|//|->|=>|&&|\|\||<=|>=|!=|~=|\+\+|--|\+=|-=|\*=|/=|\.\*|\./|\.\^|\.'
|\*\*|@@|[-+*/^=<>!&|.,;:$@~'()\[\]{}?\#%])
|(?P<line>\n)|(?P<blank>[ \t\r\f\u00a0]+|\\\n)"""


class Token(NamedTuple):
    kind: str
    text: str
    at: int
    blank: bool  # a blank stands before it


def tokens(text: str, grammar: Grammar) -> list[Token]:
    """The tokens; NotRead for a sign that no language has."""
    flags = re.VERBOSE | re.DOTALL
    pattern = re.compile(_TOKEN, flags)
    own = re.compile(f"(?P<sign>{grammar.signs})|(?P<name>{grammar.words})")
    remark = re.compile(grammar.remarks, re.DOTALL | re.MULTILINE)
    prompt = re.compile(grammar.prompt, re.MULTILINE) if grammar.prompt else None
    found: list[Token] = []
    place, blank = 0, False
    while place < len(text):
        starts = place == 0 or text[place - 1] == "\n"
        if prompt and starts and (match := prompt.match(text, place)):
            place = match.end()
            continue
        if match := remark.match(text, place):
            place, blank = match.end(), True
            continue
        if grammar.name == "MATLAB" and text[place] == "'" and _opens(found, blank):
            end = text.find("'", place + 1)
            if end < 0:
                raise nd.NotRead("a text without an end", place + 1)
            found.append(Token("text", text[place : end + 1], place + 1, blank))
            place, blank = end + 1, False
            continue
        if grammar.name == "C" and text[place] == "'":
            end = text.find("'", place + 1)
            place = (end if end > 0 else place) + 1
            continue
        match = own.match(text, place) or pattern.match(text, place)
        if match is None:
            if text[place] in letters.SUPERSCRIPTS:
                raise nd.NotRead("a raised digit", place + 1)
            if text[place] == "\u00f7" and grammar.name == "Julia":
                raise nd.Trap("a quotient that Julia rounds", place + 1)
            raise nd.NotRead(f"the sign {text[place]}", place + 1)
        kind = match.lastgroup or "sign"
        if kind == "blank":
            blank = True
        else:
            found.append(Token(kind, match[0], place + 1, blank))
            blank = False
        place = match.end()
    return found


def _opens(found: Sequence[Token], blank: bool) -> bool:
    """Whether a quote of MATLAB begins a text, and is no transpose."""
    last = found[-1] if found else None
    if last is None or blank or last.kind == "line":
        return True
    return last.kind == "sign" and last.text not in (")", "]", "'", "}")


# What ends a block, behind which no sign stands between statements.
_CLOSING = ("end", "endfunction", "endif", "endwhile", "endfor")

# How strongly the signs bind, and whether they bind to the right.
_POWERS = {
    "//": 1, "/.": 4, "//.": 4, "->": 6, ":>": 6, "=>": 6, "||": 8, "&&": 9, "==": 12, "=": 12, "~": 12,
    "<": 13, ">": 13, "<=": 13, ">=": 13, "!=": 13, "~=": 13, "+": 20, "-": 20, "*": 30, "/": 30,
    ".*": 30, "./": 30, "\\": 30, ".+": 20, ".-": 20, "%": 30,
    ".": 34, "$": 36, "^": 50, "**": 50, ".^": 50, "@": 60, "@@": 60,
}  # fmt: skip
_PREFIX = 40


class Parser:
    def __init__(self, text: str, grammar: Grammar) -> None:
        self.grammar = grammar
        found = tokens(text, grammar)
        self.tokens = _without_types(found) if grammar.types_behind else found
        self.place = 0
        self.deep = 0
        self.owners: set[str] = set()
        self.wholes: set[str] = set()  # what C declares as whole numbers
        self.rows = 0  # within [ ] of MATLAB
        self.in_functions = 0  # of C

    # -- tokens

    def peek(self, ahead: int = 0) -> Token:
        place = self.place + ahead
        if place < len(self.tokens):
            return self.tokens[place]
        return Token("end", "", self.tokens[-1].at if self.tokens else 1, True)

    def next(self) -> Token:
        found = self.peek()
        self.place += 1
        return found

    def skip_lines(self) -> None:
        while self.peek().kind == "line":
            self.place += 1

    def expect(self, text: str) -> Token:
        self.skip_lines()
        found = self.next()
        if found.text != text:
            raise nd.NotRead(f"{found.text[:20] or 'the end'} where {text} is expected", found.at)
        return found

    # -- statements

    def program(self, *ends: str) -> tuple[nd.Node, ...]:
        """Statements up to one of these words, which is not read."""
        found: list[nd.Node] = []
        while True:
            self.skip_ends()
            token = self.peek()
            if token.kind == "end" or token.text in ends:
                return tuple(found)
            found += self.one_statement(ends)

    def skip_ends(self) -> None:
        """Over the ends of lines and of statements."""
        while self.peek().kind == "line" or self.peek().text in self.grammar.ends:
            self.place += 1

    def one_statement(self, ends: Sequence[str] = ()) -> list[nd.Node]:
        """A statement, or what is known of one that is not read."""
        start, found = self.place, list[nd.Node]()
        try:
            found += self.statement()
            self.refuse_more(ends)
        except nd.Trap:
            raise
        except nd.NotRead as error:
            self.place = start
            found += self.left_out(error)
        return found

    def block(self) -> tuple[nd.Node, ...]:
        """{ ... }."""
        self.expect("{")
        body = self.program("}")
        self.expect("}")
        return body

    def to_the_bracket(self) -> None:
        """Behind the bracket that closes one which is read already."""
        depth = 1
        while depth:
            token = self.next()
            if token.kind == "end":
                raise nd.NotRead("a bracket that is not closed", token.at)
            if token.kind == "sign":
                depth += (token.text in ("(", "[", "{")) - (token.text in (")", "]", "}"))

    def refuse_more(self, ends: Sequence[str]) -> None:
        """NotRead where a statement goes on behind its end, so that it is another one."""
        token = self.peek()
        if token.kind in ("line", "end") or token.text in (*self.grammar.ends, *ends):
            return
        last = self.tokens[self.place - 1]
        if last.kind == "line" or last.text in ("}", *self.grammar.ends, *_CLOSING):
            return
        if self.grammar.name == "C" and token.text == "{":  # the body of a class
            return
        raise nd.NotRead(f"{token.text[:20]} behind the end of a statement", token.at)

    def left_out(self, error: nd.NotRead) -> list[nd.Node]:
        """A statement that is not read: the names that it sets are unknown."""
        depth, names = 0, list[nd.Node]()
        begin, sets = self.place, False
        while (token := self.peek()).kind != "end":
            ends = (token.kind == "line" and self.grammar.lines) or token.text in self.grammar.ends
            if ends and depth <= 0:
                break
            depth += (token.text in "([{") - (token.text in ")]}") if token.kind == "sign" else 0
            sets = sets or token.text in (*self.grammar.assign, *self.grammar.define, "function")
            if token.kind == "name" and not sets:
                names.append(nd.Name(token.at, token.text))
            self.place += 1
        if self.place == begin:
            self.place += 1
        unread = nd.Call(error.at, nd.Name(error.at, "<unread>"), ())
        return [nd.Assign(error.at, name, unread) for name in names] if sets else []

    def statement(self) -> list[nd.Node]:
        if self.grammar.name == "MATLAB" and (found := self.of_matlab()) is not None:
            return found
        if self.grammar.name == "C" and (found := self.of_c()) is not None:
            return found
        if self.grammar.name == "Julia" and (found := self.of_julia()) is not None:
            return found
        return [self.plain()]

    def plain(self) -> nd.Node:
        """x = value, f(x) := value, or an expression."""
        start = self.peek()
        target = self.expression(13)
        token = self.peek()
        at = start.at
        if token.text in self.grammar.define and _is_pattern(target, self.grammar):
            self.next()
            self.skip_lines()
            keeps = token.text == "=" and self.grammar.name == "Mathematica"
            return _defined(at, target, self.plain(), keeps)
        if token.text in self.grammar.assign:
            self.next()
            self.skip_lines()
            return nd.Assign(at, target, self.plain_value())
        if token.text == "/;":
            raise nd.Trap("a condition", token.at)
        if token.text == ".=":
            self.next()
            return nd.Assign(at, target, self.plain_value())
        if token.text in ("+=", "-=", "*=", "/=", ".+=", ".-=", ".*=", "./="):
            token = Token("sign", token.text.lstrip("."), token.at, token.blank)
            self.next()
            value = self.expression()
            cut = token.text == "/=" and self.is_whole(target) and self.is_whole(value)
            return nd.Assign(at, target, value, "//" if cut else token.text[0])
        if token.text in ("++", "--"):
            self.next()
            return nd.Assign(at, target, nd.Constant(at, Fraction(1), True), token.text[0])
        return self.rest(target, 0)

    def plain_value(self) -> nd.Node:
        """The right side of an assignment; a = b = 1 sets two names."""
        value = self.expression(0)
        if self.grammar.name == "C" and self.peek().text == "=":
            self.next()
            return self.plain_value()
        return value

    # -- expressions

    def expression(self, power: int = 0) -> nd.Node:
        self.deep += 1
        if self.deep > 80:
            raise nd.NotRead("brackets that are nested too deeply", self.peek().at)
        try:
            return self.rest(self.prefix(), power)
        finally:
            self.deep -= 1

    def rest(self, left: nd.Node, power: int) -> nd.Node:
        while True:
            token = self.peek()
            if self.by_blank(token):
                if power >= 30:
                    return left
                left = nd.Binary(token.at, "*", left, self.expression(30))
                continue
            if token.kind == "line" and self.rows and self.grammar.name not in ("MATLAB", "Julia"):
                self.place += 1
                continue
            if token.kind == "line" and not self.grammar.lines:
                self.place += 1
                continue
            strength = self.strength(token)
            if strength is None or strength <= power or self.splits(token):
                return left
            self.next()
            self.skip_after(token)
            left = self.joined(left, token, strength)

    def skip_after(self, token: Token) -> None:
        if self.grammar.name != "MATLAB":
            self.skip_lines()

    def strength(self, token: Token) -> int | None:
        if token.kind != "sign":
            return None
        text = token.text
        if text in self.grammar.assign and text not in self.grammar.equals:
            return None
        if text == "=" and "=" not in self.grammar.equals:
            return None
        if text == "$" and self.grammar.name != "Maple":
            return None
        if text == "%" and self.grammar.name != "C":
            return None
        if text in ("^", "&", "|") and self.grammar.name == "C":
            if self.in_functions:
                raise nd.Trap(f"the sign {text} between the digits of whole numbers", token.at)
            return None
        if text in ("//", "/.", "//.") and self.grammar.name != "Mathematica":
            return None
        if text in ("@",) and self.grammar.name == "MATLAB":
            return None
        if text == "\\" and self.grammar.name not in ("MATLAB", "Julia"):
            return None
        if text in ("@", "@@", ":") and self.grammar.name == "Julia":
            return None
        return _POWERS.get(text)

    def joined(self, left: nd.Node, token: Token, strength: int) -> nd.Node:
        text, at = token.text, token.at
        right_first = text in ("^", "**", ".^", "->", "=>", ":>")
        if self.grammar.name == "MATLAB":
            right_first = False
        if text == "=>" and self.grammar.name == "C":
            names, first = _with_patterns(left)
            if self.peek().text != "{":
                self.in_functions += 1
                try:
                    result = nd.Return(at, self.expression(strength - 1))
                finally:
                    self.in_functions -= 1
                return nd.Function(at, "", names, (*first, result))
            self.next()
            return nd.Function(at, "", names, (*first, *self.body_of_function()))
        if text == "//":  # x // Simplify
            right = self.expression(strength)
            return nd.Call(at, right, (left,))
        right = self.expression(strength - 1 if right_first else strength)
        if text == "@":
            return nd.Call(at, left, (right,))
        if text == "@@" and self.grammar.name == "Maple":
            return nd.Call(at, nd.Name(at, "<iterated>"), (left, right))
        if text in ("/.", "//."):
            name = "<replaced>" if text == "/." else "<repeated>"
            return nd.Call(at, nd.Name(at, name), (left, right))
        if (text == "->" and self.grammar.name in ("Maple", "C", "Julia")) or (
            text == "=>" and self.grammar.name != "Julia"
        ):
            names, first = _with_patterns(left)
            return nd.Function(at, "", names, (*first, nd.Return(at, right)))
        if text == "&&":
            return nd.Items(at, (left, right))
        sign = {"./": "/", ".^": "^", "**": "^", "=": "==", ".+": "+", ".-": "-"}.get(text, text)
        if text == "/" and self.is_whole(left) and self.is_whole(right):
            sign = "//"
        return nd.Binary(at, sign, left, right)

    def is_whole(self, node: nd.Node) -> bool:
        """Whether C computes this in whole numbers, so that it rounds their quotient."""
        match node:
            case nd.Constant(is_whole=is_whole):
                return is_whole
            case nd.Name(text=text):
                return text in self.wholes
            case nd.Unary(operand=operand):
                return self.is_whole(operand)
            case nd.Binary(sign="+" | "-" | "*" | "//", left=left, right=right):
                return self.is_whole(left) and self.is_whole(right)
        return False

    def by_blank(self, token: Token) -> bool:
        """Whether this begins another factor, as in m x'[t] and 2(x + y)."""
        if not self.grammar.by_blank:
            return False
        return token.kind in ("name", "number", "text") or token.text in ("(", "{")

    def splits(self, token: Token) -> bool:
        """Whether a sign begins another entry of [a -b] of MATLAB."""
        if self.grammar.name not in ("MATLAB", "Julia") or not self.rows or token.text not in "+-'":
            return False
        return token.blank and not self.peek(1).blank

    def prefix(self) -> nd.Node:
        if not self.grammar.lines or self.grammar.name == "Mathematica":
            self.skip_lines()
        token = self.next()
        at = token.at
        match token.kind, token.text:
            case "number", text:
                number = nd.Constant(
                    at, _number(text, at), "." not in text and "e" not in text.lower()
                )
                after = self.peek()
                factor = after.kind == "name" or after.text in ("(", "\u221a")
                if self.grammar.by_number and factor and not after.blank:
                    return nd.Binary(at, "*", number, self.expression(_PREFIX))
                return self.suffix(number)
            case _, "\u221a":
                return nd.Call(at, nd.Name(at, "sqrt"), (self.expression(_PREFIX + 15),))
            case _, "@.":
                return self.expression(0)
            case "text", text:
                return self.suffix(nd.Constant(at, text[1:-1]))
            case "name", "function" if self.grammar.name == "C" and self.peek().text == "(":
                self.place -= 1  # its word in place of its name
                return self.suffix(replace(self.function_of_c(at), name=""))
            case "name", "new" if self.grammar.name == "C" and self.peek().kind == "name":
                return self.suffix(self.made_in_c(at))
            case "name", text:
                if text in self.grammar.reserved:
                    raise nd.Trap("a loop, a condition, or a procedure", at)
                return self.suffix(nd.Name(at, _plain(text)))
            case _, "(" if self.is_cast():
                return self.cast(at)
            case _, "(":
                return self.suffix(self.bracket(at))
            case _, "[" | "{" as opening:
                return self.suffix(self.items(opening, at))
            case _, "<" if self.grammar.name == "Maple":
                return self.suffix(self.angle(at))
            case _, "-" | "!" | ".-":
                return nd.Unary(at, token.text.lstrip("."), self.expression(_PREFIX))
            case _, "+":
                return self.expression(_PREFIX)
            case _, "'" if self.grammar.name in ("Maxima", "Maple"):
                return self.quoted(at)
            case _, "@" if self.grammar.name == "MATLAB":
                return self.handle(at)
        raise nd.NotRead(f"{token.text[:20].strip() or 'the end'} where a formula is expected", at)

    def quoted(self, at: int) -> nd.Node:
        operand = self.expression(_PREFIX)
        if self.grammar.name == "Maple":
            self.expect("'")
        return nd.Unary(at, "'", operand)

    def bracket(self, at: int) -> nd.Node:
        self.rows, kept = 0, self.rows
        inside = self.arguments(")")
        self.rows = kept
        return inside[0] if len(inside) == 1 else nd.Items(at, inside)

    def arguments(self, closing: str) -> tuple[nd.Node, ...]:
        """Expressions up to a closing bracket, with commas between them."""
        found: list[nd.Node] = []
        self.skip_lines()
        if self.peek().text == closing:
            self.next()
            return ()
        while True:
            self.skip_lines()
            if self.peek().text == ":" and self.grammar.slices:
                at = self.next().at
                found.append(nd.Slice(at, None, None))
            else:
                found.append(self.argument())
            self.skip_lines()
            token = self.next()
            if token.text == closing:
                return tuple(found)
            if token.text not in (",", ";"):
                raise nd.NotRead(
                    f"{token.text[:20] or 'the end'} where {closing} is expected", token.at
                )

    def argument(self) -> nd.Node:
        """One argument; behind it a line may end."""
        if self.grammar.name == "Julia" and self.peek().kind == "name" and self.peek(1).text == "=":
            word = self.next()
            self.next()
            value = self.argument()
            return nd.Binary(word.at, "->", nd.Constant(word.at, word.text), value)
        found = self.expression(0)
        sets = self.peek().text in self.grammar.assign and self.grammar.name == "Maxima"
        if sets and isinstance(found, nd.Name):
            self.next()
            return nd.Assign(found.at, found, self.argument())
        while self.peek().kind == "line":
            self.place += 1
            token = self.peek()
            if self.strength(token) is not None or self.by_blank(token):
                found = self.rest(found, 0)
        if self.peek().text == ":" and self.grammar.slices:
            at = self.next().at
            return nd.Slice(at, found, self.expression(0))
        return found

    def items(self, opening: str, at: int) -> nd.Node:
        if self.grammar.name == "MATLAB" and opening == "[":
            return self.matrix(at)
        if self.grammar.name == "Julia" and opening == "[" and not self.lists(at):
            return self.matrix(at)
        return nd.Items(at, self.arguments("]" if opening == "[" else "}"))

    def lists(self, at: int) -> bool:
        """Whether [ ] of Julia holds a vector, [a, b], and no matrix, [a b; c d]."""
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

    def angle(self, at: int) -> nd.Node:
        """<a, b> of Maple."""
        found = [self.expression(13)]
        while self.peek().text in (",", "|"):
            self.next()
            found.append(self.expression(13))
        self.expect(">")
        return nd.Call(at, nd.Name(at, "Vector"), (nd.Items(at, tuple(found)),))

    def matrix(self, at: int) -> nd.Node:
        """[a b; c d]."""
        rows: list[nd.Node] = []
        row: list[nd.Node] = []
        kept, self.rows = self.rows, 1
        while True:
            token = self.peek()
            if token.text == "]" or token.text == ";" or token.kind == "line":
                self.next()
                if row:
                    rows.append(nd.Items(row[0].at, tuple(row)))
                row = []
                if token.text == "]":
                    self.rows = kept
                    return nd.Items(at, tuple(rows), True)
            elif token.text == ",":
                self.next()
            elif token.kind == "end":
                raise nd.NotRead("a [ that is not closed", at)
            else:
                row.append(self.expression(0))

    def handle(self, at: int) -> nd.Node:
        """@(x, y) x + y, or @f."""
        if self.peek().text != "(":
            return nd.Name(at, self.next().text)
        self.next()
        kept, self.rows = self.rows, 0
        names = _parameters(nd.Items(at, self.arguments(")")))
        body = self.expression(0)
        self.rows = kept
        return nd.Function(at, "", names, (nd.Return(at, body),))

    def suffix(self, found: nd.Node) -> nd.Node:
        """Calls, indices, members, and primes behind a name or a bracket."""
        while True:
            token = self.peek()
            at = token.at
            if self.rows and self.grammar.name in ("MATLAB", "Julia") and token.blank:
                return found
            if self.grammar.name == "Julia" and token.blank and token.text in ("(", "["):
                return found
            if self.grammar.name == "Julia" and token.text == "." and self.peek(1).text == "(":
                self.next()
                continue
            if self.grammar.name == "Julia" and token.text == "!" and not token.blank:
                self.next()  # f!
                continue
            if token.text == "(" and self.grammar.call == "(":
                if isinstance(found, nd.Constant):
                    return found
                self.next()
                kept, self.rows = self.rows, 0
                found = nd.Call(at, found, self.arguments(")"))
                self.rows = kept
            elif token.text == "[" and self.grammar.call == "[":
                found = self.of_square(found, at)
            elif token.text == "[" and self.grammar.name != "MATLAB":
                self.next()
                found = nd.Index(at, found, self.arguments("]"))
            elif token.text in ("'", ".'") and self.grammar.prime:
                self.next()
                order = found.order + 1 if isinstance(found, nd.Primed) else 1
                found = nd.Primed(
                    at, found.operand if isinstance(found, nd.Primed) else found, order
                )
            elif self.is_member(token):
                self.next()
                found = self.member(at, found, self.next().text)
            elif token.text == "." and self.grammar.name == "Julia" and self.peek(1).kind == "name":
                self.next()
                found = nd.Member(at, found, self.next().text)
            else:
                return found

    def is_member(self, token: Token) -> bool:
        """Whether .k or, behind a pointer, ->k follows."""
        if self.grammar.name != "C" or self.peek(1).kind != "name":
            return False
        points = self.grammar.pointers and token.text == "->" and not token.blank
        return token.text == "." or (points and not self.peek(1).blank)

    def member(self, at: int, base: nd.Node, name: str) -> nd.Node:
        """this.x and s.x are x, where only one thing has parts."""
        if isinstance(base, nd.Name) and base.text == "Math" and name[1:].islower():
            return nd.Member(at, base, name.lower())  # Math.Sin of C#
        if not isinstance(base, nd.Name) or base.text in ("Math", "console", "std"):
            return nd.Member(at, base, name)
        if self.peek().text == "(":
            return nd.Member(at, base, name)
        self.owners.add(base.text)
        if len(self.owners) > 1:
            raise nd.NotRead("parts of two things", at)
        return nd.Name(at, name)

    def of_square(self, found: nd.Node, at: int) -> nd.Node:
        """f[x], or list[[2]]."""
        self.next()
        if self.peek().text == "[" and not self.peek().blank:
            self.next()
            places = self.arguments("]")
            self.expect("]")
            return nd.Index(at, found, places)
        return nd.Call(at, found, self.arguments("]"))

    # -- statements of MATLAB

    def of_matlab(self) -> list[nd.Node] | None:
        token = self.peek()
        if token.kind != "name":
            return None
        match token.text:
            case "function":
                return [self.function_of_matlab()]
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
        return None

    def until_end(self) -> tuple[nd.Node, ...]:
        body = self.program("end", "endfunction", "endif", "endwhile", "endfor")
        self.next()
        return body

    def function_of_matlab(self) -> nd.Node:
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

    # -- statements of Julia

    def of_julia(self) -> list[nd.Node] | None:
        token = self.peek()
        if token.text == "@" and self.peek(1).kind == "name":  # @inbounds, @variables t
            kept = self.peek(1).text in ("inbounds", "views", "fastmath", "simd")
            self.next()
            self.next()
            if kept:
                return self.statement()
            raise nd.NotRead(f"@{self.tokens[self.place - 1].text}", token.at)
        if token.kind != "name":
            return None
        match token.text:
            case "function":
                return [self.function_of_julia()]
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
            case "using" | "import" | "export" | "module" | "else" | "elseif" | "end" | "struct":
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
        return self.several_of_julia()

    def several_of_julia(self) -> list[nd.Node] | None:
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

    def function_of_julia(self) -> nd.Node:
        at = self.next().at
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
                names.append(token.text)
            fresh = token.text == ","
        while self.peek().kind not in ("line", "end"):  # where T
            self.next()
        body = list(self.program("end"))
        self.next()
        if body and not isinstance(body[-1], nd.Return | nd.Assign | nd.Block | nd.Function):
            body[-1] = nd.Return(body[-1].at, body[-1])
        return nd.Function(at, name, tuple(names), tuple(body))

    # -- statements of C

    def of_c(self) -> list[nd.Node] | None:
        token = self.peek()
        if token.text == "#":
            return self.defined_in_c()
        if token.text == "{":
            return self.block_with_names()
        if token.kind != "name":
            return None
        match token.text:
            case "for" | "while" | "if" | "else" | "do" | "switch":
                return self.block_of_c(token)
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
        return self.declared_in_c()

    def block_with_names(self) -> list[nd.Node]:
        """{ ... }, behind which the names that it declares have other values."""
        body = self.block()
        declared = {
            name: one.at
            for one in body
            if isinstance(one, nd.Assign) and one.declares
            for name in names_of(one.target)
        }
        return [
            *body,
            *(
                nd.Assign(at, nd.Name(at, name), nd.Call(at, nd.Name(at, "<scope>"), ()))
                for name, at in declared.items()
            ),
        ]

    def defined_in_c(self) -> list[nd.Node]:
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

    def block_of_c(self, token: Token) -> list[nd.Node]:
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

    def declared_in_c(self) -> list[nd.Node] | None:
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
            return [self.function_of_c(at)]
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
        words = [self.peek(k).text for k in range(8)]
        kept = [word for word in words if word != "const"]
        is_one = (
            kept[:2] == ["*", "("] and kept[2] in ("double", "float") and kept[3:5] == ["*", ")"]
        )
        if is_one:
            while self.peek().text != ")":
                self.next()
            self.next()
            if self.next().kind != "name" or self.peek().text not in (";", ","):
                raise nd.NotRead("a number behind a pointer", self.peek().at)
        return is_one

    def is_cast(self) -> bool:
        """Whether (double) follows the bracket that opens it."""
        words = self.peek().text, self.peek(1).text
        return self.grammar.name == "C" and words[0] in _C_TYPES and words[1] == ")"

    def cast(self, at: int) -> nd.Node:
        """(double)n, a number that is not whole, and (int)x, which is cut."""
        kind = self.next().text
        self.next()
        value = self.expression(_PREFIX)
        if kind in ("double", "float"):
            return nd.Call(at, nd.Name(at, "double"), (value,))
        return value if self.is_whole(value) else nd.Call(at, nd.Name(at, "<whole>"), ())

    def made_in_c(self, at: int) -> nd.Node:
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

    def function_of_c(self, at: int) -> nd.Function:
        name = self.next().text
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


_MOST_EXPONENT = 150


def _number(text: str, at: int) -> Fraction:
    exponent = text.lower().partition("e")[2].lstrip("+-")
    if len(text) > 200 or (exponent and (len(exponent) > 3 or int(exponent) > _MOST_EXPONENT)):
        raise nd.NotRead("a number that is too large", at)
    return Fraction(text.rstrip("."))


def _plain(text: str) -> str:
    """theta for \\[Theta], and EulerEquations for VariationalMethods`EulerEquations."""
    text = re.sub(r"\\\[(?:Curly)?([A-Za-z]+?)\]", lambda match: _greek(match[1]), text)
    return text.rpartition("`")[2] if "`" in text else text.rpartition("::")[2] or text


def _greek(word: str) -> str:
    if word.startswith("Capital"):
        return word.removeprefix("Capital")
    return word.lower()


def _is_pattern(target: nd.Node, grammar: Grammar) -> bool:
    if not isinstance(target, nd.Call) or not isinstance(target.function, nd.Name):
        return False
    names = target.arguments
    if grammar.name == "Mathematica":
        return any(isinstance(one, nd.Name) and one.text.endswith("_") for one in names)
    return all(isinstance(one, nd.Name) for one in names)


def _parameters(node: nd.Node) -> tuple[str, ...]:
    items = node.items if isinstance(node, nd.Items) else (node,)
    if not all(isinstance(item, nd.Name) for item in items):
        raise nd.NotRead("arguments that are no names", node.at)
    return tuple(item.text.rstrip("_") for item in items if isinstance(item, nd.Name))


def _with_patterns(node: nd.Node) -> tuple[tuple[str, ...], list[nd.Node]]:
    """The names of (t, [x, v]) => ..., with what takes the second one apart."""
    items = node.items if isinstance(node, nd.Items) else (node,)
    if isinstance(node, nd.Items) and all(isinstance(item, nd.Items) for item in items):
        raise nd.NotRead("arguments that are no names", node.at)
    names: list[str] = []
    first: list[nd.Node] = []
    for item in items:
        if isinstance(item, nd.Items):
            names.append(f"state{len(names)}")
            target = nd.Name(item.at, names[-1])
            first.append(nd.Assign(item.at, item, target, declares=True))
        else:
            names += _parameters(item)
    return tuple(names), first


def letter(at: int, name: str) -> nd.Node:
    """The value of a name that is not given."""
    return nd.Call(at, nd.Name(at, "Symbol"), (nd.Constant(at, name),))


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


def _defined(at: int, target: nd.Node, value: nd.Node, keeps: bool) -> nd.Node:
    assert isinstance(target, nd.Call)
    assert isinstance(target.function, nd.Name)
    names = _parameters(nd.Items(at, target.arguments))
    result = (value if isinstance(value, nd.Assign) else nd.Return(at, value),)
    return nd.Function(at, target.function.text, names, result, keeps_values=keeps)


def program(text: str, grammar: Grammar) -> tuple[nd.Node, ...]:
    """The statements of a text; NotRead where it is none of this language."""
    parser = Parser(text, grammar)
    return parser.program()
