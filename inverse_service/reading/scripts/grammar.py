"""A parser of statements and formulas by binding powers, and the row of what differs between languages
in signs alone. A language is a file with its row and, where its statements have a form of their own, a
parser that extends this one.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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

    remarks: str
    ends: frozenset[str]
    assign: frozenset[str]
    define: frozenset[str]
    equals: frozenset[str]
    lines: bool = True  # a line ends a statement
    by_blank: bool = False
    prime: str = ""  # what ' means behind a name
    quote: str = ""  # 'x' is "text" where x' is a transpose, or "left out"
    reserved: frozenset[str] = frozenset()  # of loops and conditions, which are not run
    prompt: str = ""
    by_number: bool = False  # 2x is 2*x, and 1/2x is 1/(2*x)
    signs: str = r"(?!)"  # its own signs
    words: str = r"(?!)"  # its own names, such as as.list
    slices: bool = False  # y(1:3) is a part of y
    matrices: bool = False  # [a -b; c d], whose entries blanks divide
    own_powers: frozenset[str] = frozenset()  # signs between formulas that few languages have
    arrows: frozenset[str] = frozenset(("=>",))  # of functions without a name
    sets_inside: bool = False  # f(a : 1) sets a
    traps: Mapping[str, str] = field(default_factory=dict)  # why a sign is not read


_TOKEN = r"""(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![A-Za-z_]*\.\d)|\d+\.)
|(?P<name>\u221e|(?:\\\[[A-Za-z]+\]|[^\W\d]|\$(?=\w)|%(?=\w)|`(?=\w))(?:\\\[[A-Za-z]+\]|[\w`\u0307\u0308]|::(?=\w))*)
|(?P<text>"[^"\n]*")
|(?P<sign>\\(?=\s*[\w(\[])|:=|:>|==|\.[-+*/^]?=(?!=)|\.[-+]|\u221a|@\.|//\.|/\.|/;|//@|//|->|=>|&&|\|\||<=|>=|!=|~=|\+\+|--|\+=|-=|\*=|/=|\.\*|\./|\.\^|\.'
|\*\*|@@|[-+*/^=<>!&|.,;:$@~'()\[\]{}?\#%])
|(?P<line>\n)|(?P<blank>[ \t\r\f\u00a0]+|\\\n)"""


_QUOTES = "'\u2018\u2019"  # also as word processors write them


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
        if grammar.quote == "text" and text[place] in _QUOTES and _opens(found, blank):
            ends = (text.find(sign, place + 1) for sign in _QUOTES)
            end = min((one for one in ends if one > 0), default=-1)
            if end < 0:
                raise nd.NotRead("a text without an end", place + 1)
            found.append(Token("text", text[place : end + 1], place + 1, blank))
            place, blank = end + 1, False
            continue
        if grammar.quote == "left out" and text[place] == "'":
            end = text.find("'", place + 1)
            place = (end if end > 0 else place) + 1
            continue
        match = own.match(text, place) or pattern.match(text, place)
        if match is None:
            if text[place] in letters.SUPERSCRIPTS:
                raise nd.NotRead("a raised digit", place + 1)
            if text[place] in grammar.traps:
                raise nd.Trap(grammar.traps[text[place]], place + 1)
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
    """Whether a quote begins a text, and is no transpose."""
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
# Signs that stand between formulas in few languages
_OF_FEW = frozenset(("$", "%", "//", "/.", "//.", "\\"))
PREFIX = 40


class Parser:
    def __init__(self, text: str, grammar: Grammar) -> None:
        self.grammar = grammar
        self.tokens = tokens(text, grammar)
        self.place = 0
        self.deep = 0
        self.owners: set[str] = set()  # of which parts are named
        self.wholes: set[str] = set()  # what is declared as a whole number
        self.rows = 0  # within the [ ] of a matrix

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
        names: list[Token] = []
        while self._is_set_to_a_name(2 * len(names)):
            names.append(self.peek(2 * len(names)))
        self.place += 2 * len(names)
        last = self.plain()
        if names and isinstance(last, nd.Assign):  # a = b = 2
            return [last, *(nd.Assign(a.at, nd.Name(a.at, a.text), last.target) for a in names)]
        return [last]

    def _is_set_to_a_name(self, ahead: int) -> bool:
        """Whether name = name = begins here."""
        kinds = [self.peek(ahead + k).kind for k in (0, 2)]
        signs = [self.peek(ahead + k).text for k in (1, 3)]
        return kinds == ["name", "name"] and all(sign in self.grammar.assign for sign in signs)

    def plain(self) -> nd.Node:
        """x = value, f(x) := value, or an expression."""
        start = self.peek()
        target = self.expression(13)
        token = self.peek()
        at = start.at
        if token.text in self.grammar.define and self.is_pattern(target):
            self.next()
            self.skip_lines()
            return self.defined(at, target, self.plain(), token.text)
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
        """The right side of an assignment."""
        return self.expression(0)

    def is_pattern(self, target: nd.Node) -> bool:
        """Whether this is the f(x, y) of f(x, y) := ..."""
        if not isinstance(target, nd.Call) or not isinstance(target.function, nd.Name):
            return False
        return all(isinstance(one, nd.Name) for one in target.arguments)

    def defined(self, at: int, target: nd.Node, value: nd.Node, sign: str) -> nd.Function:
        """f(x) := value, or f(x) = value."""
        assert isinstance(target, nd.Call)
        assert isinstance(target.function, nd.Name)
        names = names_of_arguments(nd.Items(at, target.arguments))
        result = (value if isinstance(value, nd.Assign) else nd.Return(at, value),)
        return nd.Function(at, target.function.text, names, result)

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
            if token.kind == "line" and self.rows and not self.grammar.matrices:
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

    def skip_after(self, _: Token) -> None:
        """Over the ends of lines behind a sign."""
        self.skip_lines()

    def strength(self, token: Token) -> int | None:
        """How strongly a sign between two formulas binds; None for others."""
        if token.kind != "sign":
            return None
        text = token.text
        if text in self.grammar.assign and text not in self.grammar.equals:
            return None
        if text == "=" and "=" not in self.grammar.equals:
            return None
        if text in _OF_FEW and text not in self.grammar.own_powers:
            return None
        return _POWERS.get(text)

    def binds_right(self, sign: str) -> bool:
        """Whether a^b^c is a^(b^c)."""
        return sign in ("^", "**", ".^", "->", "=>", ":>")

    def joined(self, left: nd.Node, token: Token, strength: int) -> nd.Node:
        text, at = token.text, token.at
        right = self.expression(strength - 1 if self.binds_right(text) else strength)
        if text == "@":
            return nd.Call(at, left, (right,))
        if text in self.grammar.arrows:
            names, first = arguments_of(left)
            return nd.Function(at, "", names, (*first, nd.Return(at, right)))
        if text == "&&":
            return nd.Items(at, (left, right))
        sign = {"./": "/", ".^": "^", "**": "^", "=": "==", ".+": "+", ".-": "-"}.get(text, text)
        if text == "/" and self.is_whole(left) and self.is_whole(right):
            sign = "//"
        return nd.Binary(at, sign, left, right)

    def is_whole(self, node: nd.Node) -> bool:
        """Whether a language with whole numbers computes this in them, so that it rounds their
        quotient."""
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
        """Whether a sign begins another entry of [a -b]."""
        if not self.grammar.matrices or not self.rows or token.text not in "+-'":
            return False
        return token.blank and not self.peek(1).blank

    def prefix(self) -> nd.Node:
        if not self.grammar.lines:
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
                    return nd.Binary(at, "*", number, self.expression(PREFIX))
                return self.suffix(number)
            case _, "\u221a":
                return nd.Call(at, nd.Name(at, "sqrt"), (self.expression(PREFIX + 15),))
            case _, "@.":
                return self.expression(0)
            case "text", text:
                return self.suffix(nd.Constant(at, text[1:-1]))
            case "name", text:
                if text in self.grammar.reserved:
                    raise nd.Trap("a loop, a condition, or a procedure", at)
                return self.suffix(nd.Name(at, _plain(text)))
            case _, "(":
                return self.suffix(self.bracket(at))
            case _, "[" | "{" as opening:
                return self.suffix(self.items(opening, at))
            case _, "-" | "!" | ".-":
                return nd.Unary(at, token.text.lstrip("."), self.expression(PREFIX))
            case _, "+":
                return self.expression(PREFIX)
        raise nd.NotRead(f"{token.text[:20].strip() or 'the end'} where a formula is expected", at)

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
        found = self.expression(0)
        sets = self.peek().text in self.grammar.assign and self.grammar.sets_inside
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
        if self.grammar.matrices and opening == "[" and not self.lists():
            return self.matrix(at)
        return nd.Items(at, self.arguments("]" if opening == "[" else "}"))

    def lists(self) -> bool:
        """Whether the [ that is open has no rows."""
        return False

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

    def suffix(self, found: nd.Node) -> nd.Node:
        """Calls, indices, members, and primes behind a name or a bracket."""
        while True:
            token = self.peek()
            if self.rows and self.grammar.matrices and token.blank:
                return found
            further = self.behind(found, token)
            if further is None:
                return found
            found = further

    def behind(self, found: nd.Node, token: Token) -> nd.Node | None:
        """What one call, index, or prime behind this comes to; None if nothing belongs to it."""
        at = token.at
        if token.text == "(" and not isinstance(found, nd.Constant):
            self.next()
            kept, self.rows = self.rows, 0
            called = nd.Call(at, found, self.arguments(")"))
            self.rows = kept
            return called
        if token.text == "[":
            self.next()
            return nd.Index(at, found, self.arguments("]"))
        if token.text in ("'", ".'") and self.grammar.prime:
            self.next()
            if isinstance(found, nd.Primed):
                return nd.Primed(at, found.operand, found.order + 1)
            return nd.Primed(at, found, 1)
        return None

    def member(self, at: int, base: nd.Node, name: str) -> nd.Node:
        """this.x and s.x are x, where only one thing has parts."""
        owner = base.text if isinstance(base, nd.Name) else ""
        if owner in ("Math", "Mathf") and name[1:].islower():
            return nd.Member(at, base, name.lower())  # Math.Sin of C#
        if owner == "Time" and name.lower() in ("deltatime", "fixeddeltatime"):
            return nd.Name(at, "dt")  # of Unity
        if not isinstance(base, nd.Name) or base.text in ("Math", "console", "std"):
            return nd.Member(at, base, name)
        if self.peek().text == "(":
            return nd.Member(at, base, name)
        self.owners.add(base.text)
        if len(self.owners) > 1:
            raise nd.NotRead("parts of two things", at)
        return nd.Name(at, name)


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


def names_of_arguments(node: nd.Node) -> tuple[str, ...]:
    """The names of x and of (x, y); NotRead for other arguments."""
    items = node.items if isinstance(node, nd.Items) else (node,)
    if not all(isinstance(item, nd.Name) for item in items):
        raise nd.NotRead("arguments that are no names", node.at)
    return tuple(item.text.rstrip("_") for item in items if isinstance(item, nd.Name))


class Arguments(NamedTuple):
    """The names of arguments, and the statements that take those with parts apart."""

    names: tuple[str, ...]
    first: tuple[nd.Node, ...]


def arguments_of(node: nd.Node) -> Arguments:
    """Those of (t, [x, v]) => ..."""
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
            names += names_of_arguments(item)
    return Arguments(tuple(names), tuple(first))


def letter(at: int, name: str) -> nd.Node:
    """The value of a name that is not given."""
    return nd.Call(at, nd.Name(at, "Symbol"), (nd.Constant(at, name),))
