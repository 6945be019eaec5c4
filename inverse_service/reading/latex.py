r"""Convert LaTeX to the tokens of the plain-text grammar, each with its column in the original.

Commands, letters, and signs become tokens. Each pair of braces or brackets then becomes one token.
The line of tokens is read from left to right, each command together with its arguments.
"""

import re
from collections.abc import Collection, Container, Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import NamedTuple

from inverse_service.errors import InputError
from inverse_service.expressions import letters
from inverse_service.expressions.functions import FUNCTION
from inverse_service.expressions.refusals import LIMITS, at_most, fault, refusal, shorten
from inverse_service.reading import (
    components,
    differential_operators,
    indices,
    names as nm,
    prose,
    sums,
    tokens as plain,
)
from inverse_service.reading.cuts import Cut
from inverse_service.reading.tokens import (
    CASES,
    FACTOR,
    FRACTION,
    MATRIX,
    PARTIAL,
    TOTAL,
    Line,
    Token,
    Tokens,
    bracket,
)

_NO_LETTER = "(?![A-Za-z])"
_SPACE = nm.pattern("latex", "space", spaces="".join(letters.SPACES))
_COLUMNS = r"\*?\s*\}(?:\s*\{(?:[lcr| ]|@\{[^{}]*\})*\})?"
_MATRIX = re.compile(rf"\\(begin|end)\s*\{{\s*({'|'.join(components.MATRICES)}){_COLUMNS}")
_CASES = re.compile(rf"\\(begin|end)\s*\{{\s*(array|d?cases){_COLUMNS}")
_CONDITIONS, _CONNECTIVES = nm.meanings("cases"), nm.meanings("connectives")
_ROW_SPACE = r"(?:\s*\[\s*-?[0-9.]+\s*(?:pt|pc|em|ex|mm|cm|in|jot|\\jot)\s*\])?"
_COMMAND = re.compile(rf"\\(?:(operatorname\*|[A-Za-z]+)|(\\){_ROW_SPACE}|(.))", re.DOTALL)
_MARKED_LETTER = re.compile(
    f"[A-Za-z{''.join(letters.GREEK)}][{''.join((*letters.DOTS, *letters.SUBSCRIPTS))}]+"
)
# Upright fonts, in which several letters are one name; \\bar{x} is the name x_bar.
_FONTS = frozenset(("mathrm", "operatorname", "operatorname*", "mathit", "mbox")) | {
    "text",
    "qq",
    "textrm",
    "textnormal",
    "textit",
    "textup",
}
_ACCENTS = {"bar": "bar", "tilde": "tilde", "widetilde": "tilde"}
_SCRIPTS = frozenset(("mathcal", "mathscr", "mathfrak", "mathsf"))
_RUN, _DIGITS = re.compile("[A-Za-z0-9]+"), re.compile("[0-9]+")
# Upright letters of special functions, as they are printed: J of J_n(x), Gamma.
_UPRIGHT = {
    row.command[len("\\operatorname{") : -1].removeprefix("\\"): row
    for row in FUNCTION.values()
    if row.special and row.command
}
_WORDS = nm.FUNCTIONS | nm.DERIVATIVE_NAMES | nm.REFUSED.keys()
_FRACTIONS = ("frac", "tfrac", "dfrac", "cfrac", "flatfrac", "sfrac", "nicefrac")
# Commands of the packages physics, derivative, diffcoeff, commath, siunitx, and mathtools, by what
# they do.
_OF_PACKAGES = nm.meanings("packages")
_ARROWS = frozenset(("to", "rightarrow", "rightharpoonup", "vec"))
# Words that are commands without their backslash rather than products of letters.
_COMMANDS = frozenset(
    (
        "dot",
        "ddot",
        "cdot",
        "times",
        "left",
        "right",
        "partial",
        "mathrm",
        "text",
        "quad",
        "qquad",
        *_FRACTIONS[:3],
    )
) | {*components.BOLD} - {"bm"}
_SIGNS = nm.meanings("commands")
_PRODUCTS = {"cdot": plain.DOT, "times": plain.CROSS}
_PRODUCTS |= dict.fromkeys(("vdot", "dotproduct"), plain.DOT)
_PRODUCTS |= dict.fromkeys(("cross", "cp", "crossproduct"), plain.CROSS)
# Words that have their usual meaning in \text too.
_IN_TEXT = frozenset((*plain.JOINING, *plain.CONDITIONAL, "const", "constant"))
# Words that are not products of letters; they are refused unless they join two formulas.
_ENGLISH = {
    word for word, reason in nm.REFUSED_UNLESS_DECLARED.items() if reason.problem == "is a word"
}
_TENSORS = frozenset(("Gamma", "g", "R", "T", "F", "eta", "h", "delta", "epsilon", "varepsilon"))
_REASONS = nm.reasons("commands")
_POTENTIALS = frozenset("UVW")
_TRANSPOSED = ("top", "intercal", "transpose")
_DIFFERENCES = frozenset(("Delta", "delta"))  # \ddot{\Delta x}
_DELIMITER = re.compile(rf"\\(left|right){_NO_LETTER}\s*\\?([A-Za-z]+|.|\Z)", re.DOTALL)
_DELIMITERS = ("\\left", "\\right")  # names of commands have no backslash


def _cases(rows: Tokens, whole: Token) -> Tokens:
    """piecewise((a, x > 0), (b, true)) for the rows a & x > 0; b & otherwise."""
    comma = Token("operator", ",", whole.column, True)
    pieces: Tokens = []
    for row in plain.split_at(";", rows):
        if any(token.kind != "newline" for token in row):
            cells = plain.split_at("&", row)
            meant = [(_CONDITIONS.get(token.text), token) for token in _without_comma(cells[-1])]
            last = [
                replace(token, kind="operator", text=sign) if sign else token
                for sign, token in meant
                if sign != ""
            ]
            first = [*_without_comma(cells[0]), comma] if len(cells) > 1 else []
            pieces += [comma, replace(whole, text="(", value=Fraction(0), inside=(*first, *last))]
    name = Token("name", "piecewise", whole.column, True)
    return [
        name,
        replace(whole, text="(", space_before=True, value=Fraction(0), inside=tuple(pieces[1:])),
    ]


def _without_comma(cell: Tokens) -> Tokens:
    """The cell without the comma and the line ends after it."""
    while cell and (cell[-1].kind == "newline" or cell[-1].is_operator(",")):
        cell = cell[:-1]
    return cell


class _Opened(NamedTuple):
    """Where a frame or a pair of brackets begins, and how many comparisons and = come before it."""

    place: int
    compared: int
    equal: int


def _frames(line: Line) -> set[int]:
    r"""The places of the frames of a list of equations, \left\{ with its \right., and cases or an
    array without pieces.
    """
    opened, found = list[_Opened](), set[int]()
    compared = equal = 0
    for place, token in enumerate(line):
        compared += token.is_operator("<", ">")
        equal += token.is_operator("=")
        environment = token.is_operator("[", "]") and token.value == CASES
        if not (environment or token.text in _DELIMITERS):
            continue
        here = _Opened(place, compared, equal)
        if token.text in ("[", _DELIMITERS[0]):
            opened.append(here)
            continue
        first = opened.pop() if opened else here
        before = line[first.place]
        pieces = compared > first.compared and equal == first.equal
        braces = before.text in _DELIMITERS and before.inside[0].text in ("{", "lbrace")
        if not pieces if environment else braces and token.inside[0].text == ".":
            found |= {first.place, place}
    return found | {one.place for one in opened if line[one.place].is_operator("[")}


def _with_frames_apart(line: Line) -> Tokens:
    """The tokens without the frames of lists of equations and without the & that divide no cells,
    all of which are blanks, and with the brackets of the other delimiters.
    """
    frames = _frames(line)
    cells = any(
        token.is_operator("[", "]") and place not in frames for place, token in enumerate(line)
    )
    found, blank = list[Token](), False
    for place, token in enumerate(line):
        kept = [] if place in frames or (token.is_operator("&") and not cells) else [token]
        if kept and token.text in _DELIMITERS:
            kept = _delimiter(token)
        found += [replace(one, space_before=True) if blank else one for one in kept]
        blank = not kept
    return found


def _delimiter(command: Token) -> Tokens:
    r"""The bracket of a \left or \right that is no frame, nothing for one without a sign."""
    is_left, written = command.text == _DELIMITERS[0], command.inside[0].text
    sign = _SIGNS.get(written, written)
    plain = replace(command, kind="operator", inside=())
    if sign in (("(", "[") if is_left else (")", "]")):
        return [replace(plain, text="(" if is_left else ")", space_before=True)]
    if sign not in ("|", ".") and (sign or is_left):
        raise fault("delimiter", command.column, side=command.text[1:])
    return [replace(plain, text=sign)] * (sign == "|")


def _scanned(text: str, names: nm.Names, cuts: Sequence[Cut]) -> Tokens:
    """The tokens one by one, as they are typed."""

    def step(text: str, place: int, space: bool) -> tuple[Tokens, int]:
        """The tokens that begin at a place, none for a blank, and the place after them."""
        blank = _SPACE.match(text, place)
        if blank and blank["line"]:  # a wide gap is a line end
            return [Token("newline", "\n", place + 1, space)], blank.end()
        if blank and not blank["row"]:
            return [], blank.end()
        return _raw(text, place, space, names)

    return _with_frames_apart(plain.scan(text, 0, len(text), step, cuts))


def _raw(text: str, place: int, space: bool, names: nm.Names) -> tuple[Tokens, int]:
    """The tokens that begin here, including commands, and the place after them; a refused sign has
    the kind "fault".
    """
    sign, column = text[place], place + 1
    if sign == "\\":
        return _raw_command(text, place, space, names)
    if sign.isspace() and sign != "\n":
        return [], column
    if marked := _MARKED_LETTER.match(text, place):
        return plain.next_tokens(text[: marked.end()], place, space)[0], marked.end()
    if sign in letters.GREEK or sign == letters.SCRIPT_L:
        return [
            Token("name", _letter(letters.GREEK.get(sign, "ell"), names), column, space)
        ], column
    if sign.isascii() and sign.isalpha():
        word = _word(text, place, names)
        return [Token("name", _letter(word, names), column, space)], place + len(word)
    if sign == "$" or (sign == "." and not plain.NUMBER.match(text, place)):
        return [Token("fault", sign, column, space)], column
    if sign in "_&":
        return [Token("operator", sign, column, space)], column
    if sign in letters.SUBSCRIPTS and (index := letters.SUBSCRIPTS[sign].lstrip("_")):
        below = plain.number_token if index.isdigit() else partial(Token, "name")
        return [Token("operator", "_", column, space), below(index, column, False)], column
    if place and text[place - 1] in "_^" and (digits := _DIGITS.match(text, place)):
        return [plain.number_token(digits[0], column, space)], digits.end()
    try:
        found, place = plain.next_tokens(text, place, space)
    except InputError:
        return [Token("fault", sign, column, space)], column
    return [
        replace(token, text="(" if token.text == "[" else ")")
        if token.text in ("[", "]")
        else token
        for token in found
    ], place


def _letter(name: str, names: nm.Names) -> str:
    """The name of a Greek letter; \\varphi differs from \\phi if it is declared."""
    return name if names.role(name) else letters.LETTER_COMMANDS.get(name, name)


def _word(text: str, place: int, names: nm.Names) -> str:
    """A letter, or the whole word if it is declared or a function."""
    run = _RUN.match(text, place)
    word = run[0][: LIMITS.name_characters] if run else ""
    for size in range(len(word), 1, -1):
        part = word[:size]
        whole = size == len(word) and (part in _WORDS | _ENGLISH or prose.is_word(part))
        command = part in _COMMANDS or (
            size > 2 and part in letters.LETTER_COMMANDS
        )  # alpha for \alpha
        if whole or command or names.role(part) or names.derivative(part):
            return part
    return word[0]


def _raw_command(text: str, place: int, space: bool, names: nm.Names) -> tuple[Tokens, int]:
    """The token of the command that begins here, a letter or a sign if the command denotes one."""

    def operator(sign: str, value: Fraction = Fraction(0)) -> Token:
        return Token("operator", sign, place + 1, space, value)

    for environment, value in ((_MATRIX, MATRIX), (_CASES, CASES)):
        if mark := environment.match(text, place):
            return [operator("[" if mark[1] == "begin" else "]", value)], mark.end()
    if beside := _DELIMITER.match(text, place):
        sign = Token("operator", beside[2], beside.start(2) + 1)
        command = Token("command", f"\\{beside[1]}", place + 1, space, inside=(sign,))
        return [command], beside.end()
    found = _COMMAND.match(text, place)
    if found is None:
        raise fault("backslash", place + 1)
    name, end = found[found.lastindex or 0], found.end()
    if name in letters.LETTER_COMMANDS:
        return [Token("name", _letter(name, names), place + 1, space)], end
    if name == "prime":
        return [Token("prime", "'", place + 1, False, Fraction(1))], end
    if name in _SIGNS:
        return [operator(_SIGNS[name], _PRODUCTS.get(name, Fraction(0)))], end
    return [Token("command", name, place + 1, space)], end


@dataclass(frozen=True, slots=True)
class _Formula:
    r"""A whole formula: its text, its names, the letters in it that are not all in script, as the J
    of \mathcal{J} is, and the x of each \partial_x.
    """

    text: str
    names: nm.Names
    letters: Container[str] = frozenset()
    partial_by: Collection[str] = frozenset()

    @classmethod
    def of(cls, line: Line, text: str, names: nm.Names) -> "_Formula":
        found, partial_by = set[str](), set[str]()
        for inside, place, outer in plain.places(line):
            token, after = inside[place], plain.at(inside, place + 1)
            if token.kind == "name" and not _script_letter(outer, inside):
                found.add(token.text)
            elif token.is_operator(PARTIAL) and after.is_operator("_"):
                below = plain.at(inside, place + 2)
                by = plain.at(below.inside, 0) if below.is_bracket("{") else below
                is_letter = by.kind == "name" and by.text not in letters.LETTER_COMMANDS
                partial_by |= {by.text} if is_letter else set()
        return cls(text, names, found, partial_by)


def _script_letter(command: Token, line: Line) -> str:
    r"""The J of \mathcal{J}, whose braces hold this line; else nothing."""
    is_script = command.kind == "command" and command.text in _SCRIPTS
    letter = line[0].text if is_script and len(line) == 1 else ""
    plainly = len(letter) == 1 and letter.isascii() and letter.isalpha()
    return letter if plainly and letter != "O" else ""


class _Line(plain.TokenStream):
    """Parse a line of tokens from left to right.

    In `cells` of a matrix, & is a separator; in part of a name (`named`), digits count as letters.
    """

    def __init__(
        self, line: Line, formula: _Formula, cells: bool = False, named: bool = False
    ) -> None:
        super().__init__(line, plain.at(line, len(line)))
        self._formula = formula
        self._text, self._names = formula.text, formula.names
        self._cells = cells
        self._named = named
        self._depth = 0
        self._last = plain.at(line, 0)
        self._found: Tokens = []

    def read(self) -> Tokens:
        """The tokens of the whole line."""
        while self.ahead.kind != "end":
            self._one(self.take())
        return self._found

    def take(self) -> Token:
        self._last = super().take()
        return self._last

    def _inside(self, token: Token) -> Tokens:
        """The tokens inside a bracket."""
        cells = token.text == "[" or (self._cells and token.text == "{")
        return _Line(token.inside, self._formula, cells).read()

    def _one(self, token: Token) -> None:
        """Parse the piece that begins with this token."""
        if token.kind == "command":
            self._command(token)
        elif token.kind == "name" or (self._named and token.text.isdigit()):
            self._name(token)
        elif token.kind == "prime":
            plain.add_prime(self._found, token)
        elif token.kind == "fault":
            self._refuse(token)
        elif token.is_bracket("{"):
            self._found += self._braces(token)
        elif token.kind == "bracket" and token.value == CASES:
            self._found += _cases(self._inside(token), token)
        elif token.kind == "bracket":
            self._found.append(replace(token, value=Fraction(0), inside=tuple(self._inside(token))))
        elif token.is_operator("^"):
            self._power(token)
        elif token.is_operator("_"):
            raise fault("subscript of nothing", token.column)
        elif token.is_operator(PARTIAL, plain.NABLA) and self.ahead.is_operator("_"):
            self._partial(token)
        elif self._cells or not token.is_operator("&"):
            self._found.append(token)

    def _refuse(self, token: Token) -> None:
        """InputError for a sign that is not accepted."""
        if token.text == "$":
            raise fault("dollar", token.column)
        if token.text != ".":
            plain.next_tokens(self._text, token.column - 1, False)
        elif self._text[token.column :].strip():  # not the period of a sentence
            raise fault("dot without a number", token.column)

    def _name(self, token: Token) -> None:
        """A name with its subscript."""
        alone = not self._named or self.ahead.is_bracket("{")  # F_{left} is a name
        if alone and token.text in _COMMANDS and not self._names.role(token.text):
            raise fault("no backslash", token.column, token.span, name=token.text)
        if token.text in nm.FUNCTIONS and self.ahead.is_operator("_"):
            base = plain.spelled([self.look(1)]).strip("{}()")
            if f"{token.text}_{base}" not in nm.FUNCTIONS:
                raise fault("base of \\log", token.column)
            self.position += 2
            token = replace(token, text=f"{token.text}_{base}")
        self._emit(token, token.text, order=token.order)

    def _emit(self, token: Token, name: str, kind: plain.Kind = "name", order: int = 0) -> None:
        """Add the name that the token or its command denotes, with the subscript that follows."""
        if not name:
            raise fault("no name", token.column, shown=self._shown(token))
        name = self._with_subscript(name)
        at_most(len(name), LIMITS.name_characters, "a name has too many characters", token.column)
        primed = token.column * (order > 0)
        self._found.append(
            replace(token, kind=kind, text=name, value=Fraction(0), order=order, primed=primed)
        )

    def _shown(self, token: Token) -> str:
        """The command at a place."""
        return f"\\{token.text}" if token.kind == "command" else self._text[token.column - 1]

    def _with_subscript(self, name: str) -> str:
        if not self.ahead.is_operator("_"):
            return name
        underscore, piece = self.take(), self.take()
        role, defined = self._names.role(name), ""
        of_time = plain.spelled(piece.inside[1:]) in ("t", "tt")  # x_{,tt}
        if plain.at(piece.inside, 0).is_operator(",") and (
            of_time or role in ("function", "parameter") or name in nm.FUNCTION_LETTERS
        ):
            piece = replace(piece, inside=piece.inside[1:])  # V_{,x} is V_x
            defined = "," * (role == "parameter")  # of V = x^2 next to it
        subscript = self._joined([piece, self.take()] if piece.kind == "command" else [piece])
        if not subscript:
            key = (
                "comma in a subscript"
                if plain.at(piece.inside, 0).is_operator(",")
                else "subscript"
            )
            raise fault(key, underscore.column, name=name)
        glued = self._named and subscript.isdigit() and name[-1].isalpha()  # k_{B_1} is k_B1
        return f"{name}{subscript}" if glued else f"{name}_{defined}{subscript}"

    def _joined(self, line: Line) -> str:
        """The name that letters, digits, and names form, in braces or not; empty if the line
        contains anything else.
        """
        inside = line[0].inside if len(line) == 1 and line[0].is_bracket("{") else line
        parts = _Line(inside, self._formula, self._cells, named=True).read()
        whole = all(part.kind == "name" and not part.order for part in parts)
        return "".join(part.text for part in parts) if whole else ""

    def _braces(self, token: Token) -> Tokens:
        """{ … } as a bracket; { } is empty, a single name in braces is that name, {a \\over b} is
        \\frac{a}{b}.
        """
        first = plain.at(token.inside, 0)
        over = [
            place
            for place, part in enumerate(token.inside)
            if part.kind == "command" and part.text == "over"
        ]
        if over:
            above, below = token.inside[: over[0]], token.inside[over[0] + 1 :]
            parts = [self._inside(replace(token, inside=part)) for part in (above, below)]
            return [self._quotient(parts[0], parts[1], token)]
        called = first.is_bracket() and first.space_before and len(token.inside) == 1
        inner = self._inside(token)
        first = plain.at(inner, 0)
        after_function = bool(self._found) and self._found[-1].text in nm.FUNCTIONS
        if called:  # the arguments in A^{2}{\left(x \right)}
            return [replace(first, space_before=False)]
        alone = first.is_operator(",", "=", TOTAL) or first.is_fraction()  # 0{,}5, {\rm d}
        if len(inner) == 1 and (alone or (first.kind == "name" and not after_function)):
            return inner
        return [self._enclosed(inner, token)] if inner else []

    def _enclosed(
        self, inner: Tokens, opening: Token, value: Fraction = Fraction(0), space: bool = True
    ) -> Token:
        """A bracket that ends with the token taken last."""
        return replace(
            bracket(inner, opening, value, space), end=self._last.end or self._last.column
        )

    def _quotient(self, above: Tokens, below: Tokens, here: Token) -> Token:
        over, under = bracket(above, here, space=False), self._enclosed(below, here, space=False)
        return self._enclosed([over, Token("operator", "/", here.column), under], here, FRACTION)

    def _command(self, token: Token) -> None:
        name = token.text
        if name in _FRACTIONS:
            self._found.append(self._quotient(self._argument(token), self._argument(token), token))
        elif name == "sqrt":
            self._root(token)
        elif name in nm.FUNCTIONS and (
            not self._named or name in ("max", "min")
        ):  # g/l\sin x is g/l sin x
            self._name(replace(token, kind="name", space_before=True))
            self._power_in_square_brackets()
        elif name in ("dot", "ddot"):
            self._dot(token, 2 if name == "ddot" else 1)
        elif name in _OF_PACKAGES:
            self._of_package(_OF_PACKAGES[name], token)
        elif name == "rm":  # {\rm d} is \mathrm{d}
            rest, self.position = self.part(self.position, -1), len(self._tokens) - 1
            self._upright(token, rest)
        elif name in _FONTS:
            self._upright(token, [self.take()])
        elif name in _ACCENTS:
            self._emit(token, f"{self._joined([self.take()])}_{_ACCENTS[name]}")
        elif name in components.BOLD:
            self.take_operator("*")  # \vb*{x} is slanted
            self._vector(token)
        elif name in _SCRIPTS and (scripted := self._scripted(token)):
            self.take()
            self._emit(token, scripted)
        elif name in _CONNECTIVES and (self._cells or name == "forall"):
            self._emit(token, _CONNECTIVES[name])
        else:
            what, reason = f"the command \\{shorten(name)} is not accepted", _REASONS.get(name)
            if not reason and name in nm.REFUSED:
                raise nm.refused(what, nm.REFUSED[name], token.column)
            what = "this environment is not accepted" if name in ("begin", "end") else what
            raise refusal(
                what, token.column, reason.instead if reason else "write the formula without it"
            )

    def _vector(self, command: Token) -> None:
        r"""Add the vector of \mathbf{q}, and that of \mathbf{\dot q}, the rate of one."""
        argument = self.take()
        dotted = [part for part in argument.inside if part.text in ("dot", "ddot")]
        inner = self._inside(argument) if dotted else []
        if [(part.kind, part.order > 0) for part in inner] == [("name", True)]:
            self._emit(command, inner[0].text, "vector", inner[0].order)
        else:
            self._emit(command, self._joined([argument]), "vector")

    def _transposed(self) -> bool:
        r"""Whether a vector or a matrix is raised to \top, \mathsf{T}, or \intercal here, which is
        then taken.
        """
        raised, length = self.ahead, 1
        inside = raised.inside if raised.is_bracket("{") else (raised, self.look(1))
        last = plain.at(self._found, len(self._found) - 1)
        if not inside or inside[0].kind != "command" or last.kind not in ("vector", "name"):
            return False
        named = inside[0].text in _TRANSPOSED
        if not named and inside[0].text in _FONTS | _SCRIPTS:
            letter = plain.at(inside, 1)
            letter = letter.inside[0] if len(letter.inside) == 1 else letter
            named, length = letter.text == "T", 2
        if not named:
            return False
        self.position += 1 if raised.is_bracket("{") else length
        return True

    def _scripted(self, command: Token) -> str:
        r"""The J of \mathcal{J}, or "" if the letter also occurs in another font."""
        inside = self.ahead.inside if self.ahead.is_bracket("{") else ()
        letter = _script_letter(command, inside)
        return "" if letter in self._formula.letters else letter

    def _partial(self, token: Token) -> None:
        r"""\partial_x as \frac{\partial}{\partial x}."""
        by = self._with_subscript("")[1:]
        others = {*self._formula.partial_by} - {"t"}
        if len(by) > 1 == len({*by}) and (by[0] != "t" or others):
            raise fault("partial derivative", token.column)
        if {*by} == {"t"}:
            if others:  # a wave equation
                raise fault("partial derivative", token.column)
            times = len(by)
            if self.ahead.is_operator("^") and self.look(1).text.isdigit():
                self.take()
                times = int(self.take().text)
            rate = Token("operator", TOTAL, token.column, token.space_before)
            power = plain.nested(plain.tokens_in_place(f"^({times})", token)) * (times > 1)
            below = Token("name", "t", token.column)
            self._found.append(self._quotient([rate, *power], [rate, below, *power], token))
            return
        sign, variable = Token("operator", PARTIAL, token.column), Token("name", by, token.column)
        self._found.append(self._quotient([sign], [sign, variable], token))

    def _upright(self, command: Token, line: Line) -> None:
        r"""Add the name in \mathrm{…} or \text{…}, or the d of a derivative."""
        inside = line[0].inside if line and line[0].is_bracket("{") else line
        if [token.text for token in inside[:2]] == ["d", "^"] and len(inside) == 3:
            sign = Token("operator", TOTAL, command.column, command.space_before)
            self._found += [sign, *inside[1:]]  # \mathrm{d^2} x
            return
        letter = inside[1].text if len(inside) == 2 and inside[0].text == "d" else ""
        if letter == "t" or letter in letters.LETTER_COMMANDS:
            sign = Token("operator", TOTAL, command.column, command.space_before)
            self._found += [sign, replace(inside[1], space_before=False)]  # \mathrm{d\tau}
            return
        words = any(token.space_before for token in inside[1:])
        name = "" if words else self._joined(inside)
        known = self._names.role(name) or name in _WORDS | _IN_TEXT | letters.LETTER_COMMANDS.keys()
        known = known or self._named or (self._cells and name in _CONDITIONS)
        in_text = command.text.startswith(("text", "qq")) and not known
        if words or (in_text and len(name) > 1 and name.isalpha() and name.islower()):
            raise fault("words", command.column)
        if command.text == "operatorname" and self._letter_of_function(name, command):
            return
        if name == "d" and self._names.role("d") is None:
            self._found.append(Token("operator", TOTAL, command.column, command.space_before))
            return
        if name or not command.text.startswith(("text", "qq")):  # \textrm{ } before a sign
            self._emit(command, name)

    def _letter_of_function(self, name: str, command: Token) -> bool:
        r"""Whether \operatorname{J}_{n}(x) or the like is here, and then besselj(n, x) is added."""
        row = _UPRIGHT.get(name)
        below = self.ahead.is_operator("_")
        bracket_after = self.look(2 * below)
        good = row is not None and row.ordered == below and self._names.role(name) is None
        if row is None or not good or not bracket_after.is_bracket("("):
            return False
        order = self._argument(self.take()) if below else []
        opening = self.take()
        comma = [Token("operator", ",", opening.column)] if order else []
        inside = self._enclosed([*order, *comma, *self._inside(opening)], opening, space=False)
        self._found += [replace(command, kind="name", text=row.name, value=Fraction(0)), inside]
        return True

    def _argument(self, at: Token) -> Tokens:
        """One argument: a group, or one piece as in \\frac12."""
        token = self.take()
        while token.kind == "newline":
            token = self.take()
        if token.is_bracket("{"):
            inner = self._inside(token)
            whole = len(inner) == 1 and inner[0].is_bracket() and not inner[0].value
            return [*inner[0].inside] if whole else inner  # \frac{{a}}{{b}}
        if token.kind == "number" and token.text.isdigit():
            if rest := token.text[1:]:
                self.position -= 1
                self._tokens[self.position] = plain.number_token(rest, token.column + 1, False)
            self._last = plain.number_token(token.text[0], token.column, False)
            return [self._last]
        if token.kind == "name" and token.text not in _COMMANDS:
            return [token]
        if token.kind not in ("name", "command"):
            raise fault("no argument", at.column, shown=self._shown(at))
        outer, self._found, self._depth = self._found, [], self._depth + 1
        at_most(self._depth, LIMITS.depth, "the formula is nested too deeply", token.column)
        self._one(token)
        found, self._found, self._depth = self._found, outer, self._depth - 1
        return found

    def _root(self, token: Token) -> None:
        degree = self.take().inside if self._is_square(self.ahead) else None
        if degree is not None and not (len(degree) == 1 and degree[0].text.isdecimal()):
            raise fault("degree of a root", token.column)
        argument = self._enclosed(self._argument(token), token, space=False)
        if degree is None:
            self._found += [replace(token, kind="name"), argument]
        else:  # not the argument bracket of a name before it
            power = plain.nested(plain.tokens_in_place(f"^(1/{degree[0].text})", token))
            self._found.append(self._enclosed([argument, *power], token, FACTOR))

    def _of_package(self, what: str, token: Token) -> None:
        """A command of a package; see `packages` in `words.toml`."""
        braces = self.ahead.is_bracket("{") + (
            self.ahead.is_bracket("{") and self.look(1).is_bracket("{")
        )
        match what:
            case "over":
                self._overset(token)
            case "d/dt":
                sign = Token("operator", TOTAL, token.column, token.space_before)
                self._found.append(
                    self._quotient([sign], [sign, Token("name", "t", token.column)], token)
                )
            case "derivative" | "partial derivative":
                self._derivative(token, PARTIAL if what[0] == "p" else TOTAL)
            case "differential" if braces < 2 and not self._order_follows(1):
                self._differential(token)
            case "differential":
                self._derivative(token, TOTAL)
            case "quantity" if braces == 2:
                self._with_unit(token)
            case "quantity" if braces == 1:
                self._found.append(self._enclosed(self._argument(token), token, FACTOR))
            case "quantity":  # \qty(x + y) is (x + y)
                self.take_operator("*")
            case "number" | "number with unit":
                self._with_unit(token, what == "number with unit")
            case "degrees":
                degrees = [*self._argument(token), *plain.tokens_in_place("*pi/180", token)]
                self._found.append(self._enclosed(degrees, token))
            case "unit":
                self._note_unit(token, self.take())
            case "norm":
                bar = Token("operator", "|", token.column)
                self._found += [bar, *self._argument(token), bar]
            case _:  # a frame around a part, \boxed{...} or \underbrace{...}_{...}
                inner = self._argument(token)
                framed = len(inner) == 1 or any(part.is_operator("=", ",", ";") for part in inner)
                if inner:  # \\mathop{}
                    self._found += inner if framed else [self._enclosed(inner, token)]
                if self.ahead.is_operator("_", "^") and what == "frame with a remark":
                    self.take()
                    self.take()

    def _order_follows(self, braces: int) -> bool:
        """Whether [2] follows, and so many groups in braces after it at least."""
        groups = (self.look(1 + place).is_bracket("{") for place in range(braces + 1))
        return self._is_square(self.ahead) and all(groups)

    def _is_square(self, token: Token) -> bool:
        return token.is_bracket("(") and self._text[token.column - 1] == "["

    def _derivative(self, token: Token, sign: str) -> None:
        r"""\dv[2]{x}{t} as \frac{d^2 x}{d t^2}, \dv{t} as \frac{d}{d t}, and \pdv{V}{x}{y}."""
        self.take_operator("*")
        order = [*self.take().inside] if self._is_square(self.ahead) else []
        if any(part.is_operator("=") for part in order):  # \\odv[order={2}]{x}{t}
            order = [*(order[-1].inside or order[-1:])]
        bare = not self.ahead.is_bracket("{")
        groups = [self._argument(token)]
        if bare and not self.ahead.is_bracket("{"):  # \\dv[2]x t
            groups.append(self._argument(token))
        while self.ahead.is_bracket("{") and len(groups) < (3 if sign == PARTIAL else 2):
            groups.append(self._argument(token))
        operand, variables = (groups[0], groups[1:]) if len(groups) > 1 else ([], groups)
        variables = [part for group in variables for part in plain.split_at(",", group)]
        d = Token("operator", sign, token.column)
        power = (
            [Token("operator", "^", token.column), bracket(order, token, space=False)]
            if order
            else []
        )
        if len(variables) > 1 and not order:
            power = plain.nested(plain.tokens_in_place(f"^({len(variables)})", token))
        operand = operand if len(operand) < 2 else [bracket(operand, token)]
        below = [part for variable in variables for part in (d, *variable)]
        self._found.append(
            self._quotient([d, *power, *operand], [*below, *(power if order else [])], token)
        )

    def _differential(self, token: Token) -> None:
        r"""\dd{x}, \dd x, \dd[2]{x}, and \diff t as the upright d of a derivative."""
        self._found.append(Token("operator", TOTAL, token.column, token.space_before))
        if self._is_square(self.ahead):
            self._found += [Token("operator", "^", token.column), self.take()]
        if self.ahead.is_bracket("{"):
            self._found += self._argument(token)

    def _overset(self, token: Token) -> None:
        r"""\overset{\cdot\cdot}{x} and \overset{..}{x} as \ddot{x}, \overset{\to}{x} as \vec{x}."""
        marks = self.take().inside
        dots = all(mark.is_operator("*") or mark.text in (".", "bullet") for mark in marks)
        if marks and dots and len(marks) < 3:
            self._dot(replace(token, text="overset"), len(marks))
        elif len(marks) == 1 and marks[0].text in _ARROWS:
            self._emit(token, self._joined([self.take()]), "vector")
        else:
            raise fault("sign above a letter", token.column)

    def _with_unit(self, token: Token, unit: bool = True) -> None:
        r"""The number of \SI{9.81}{\metre\per\second\squared}; its unit is left out, which is
        noted.
        """
        if self._is_square(self.ahead):
            self.take()
        number = self._argument(token)
        self._found += number if len(number) == 1 else [self._enclosed(number, token)]
        if unit:
            self._note_unit(token, self.take())

    def _note_unit(self, token: Token, unit: Token) -> None:
        if unit.is_bracket("{") and unit.inside:
            plain.note(
                self._text[token.column - 1 : unit.end],
                f"without the unit {self._text[unit.column : unit.end - 1]}",
            )

    def _power_in_square_brackets(self) -> None:
        r"""The ^2 of \sin[2](x), which the package physics sets as \sin^2(x)."""
        if self._is_square(self.ahead) and self.look(1).is_bracket():
            power = self.take()
            self._found += [Token("operator", "^", power.column), replace(power, value=FACTOR)]

    def _dot(self, token: Token, order: int) -> None:
        """\\dot{x}, \\dot x, \\dot{r}_1, \\dot{r_1}, \\dot\\theta."""
        inner, shown = _with_differences(self._argument(token)), self._shown(token)
        name = plain.at(inner, 0)
        other = name.text in nm.FUNCTIONS and not self._names.role(name.text)
        if len(inner) != 1 or name.kind not in ("name", "vector") or name.order or other:
            span: tuple[int, int] | None = None
            meant: tuple[str, ...] = ()
            if [one.kind for one in inner[:2]] == ["name", "operator"] and len(inner) == 3:
                caret, end = inner[1], self._last.end or self._last.column
                if (
                    self._text[caret.column - 1] == "^"
                ):  # \dot{x^2} is a slip for \dot{x}^2, or the rate of x^2
                    span = (token.column, end + 1)
                    base = self._text[token.column - 1 : caret.column - 1]
                    meant = (f"{base}}}^{self._text[caret.column : end].removesuffix('}')}",)
            raise fault("dots without a name", token.column, span, meant, shown=shown)
        self._emit(token if name.kind == "name" else name, name.text, name.kind, order)

    def _power(self, caret: Token) -> None:
        r"""x^2, e^x, e^{u}, and the primes of x^{\prime}."""
        self._refuse_indices(caret)
        raised = self.ahead
        if raised.kind == "prime":
            return
        if self._transposed():
            self._found += [caret, replace(raised, kind="name", text="T", inside=())]
            return
        braces = raised.is_bracket("{")
        while braces and plain.at(raised.inside, 0).kind == "prime":
            plain.add_prime(self._found, raised.inside[0])
            raised = replace(raised, inside=raised.inside[1:])
            if not raised.inside:
                self.position += 1
                return
        short = raised.kind in ("name", "number") and self._text[raised.column - 1].isalnum()
        if braces or short:
            self._refuse_exponent(raised)
        self._found.append(caret)
        if braces or short:
            self.take()
            start = len(self._found)
            self._one(raised)
            self._found[start:] = [self._enclosed(self._found[start:], raised, space=False)]
        if self.ahead.is_operator("^"):
            raise fault("second power", self.ahead.column)

    def _refuse_exponent(self, raised: Token) -> None:
        """InputError for q^{1}, a component; x^23, which TeX sets as x^2 3; f^{(2)}, a derivative
        or component.
        """
        base, one, bracketed = plain.at(self._found, len(self._found) - 1), raised, False
        while len(one.inside) == 1:
            bracketed |= one.is_bracket()
            one = one.inside[0]
        goes_on = raised is one and self._text[one.column : one.column + 1] in (*".+-",)
        if one.text == "1" and not (bracketed or goes_on):
            raise fault("raised 1", one.column)
        if raised is one and one.kind == "number" and len(one.text) > 1:
            raise fault("power of several digits", raised.column)
        plain_part = bracketed and one.kind in ("number", "name") and not one.inside
        if (
            plain_part and base.kind != "number" and base.text not in ("e", "E")
        ):  # e^{(x)} is exp(x)
            raise fault("power in brackets", raised.column + 1, kind_of=one.kind)

    def _refuse_indices(self, caret: Token) -> None:
        r"""InputError for tensor indices, \Gamma^x_{xx} and g^{tt}, which are not powers."""
        base = self._found[-1].text if self._found else ""
        lowered = self.look(1).is_operator("_")
        both = [self.ahead, *self.part(self.position + 2, self.position + 2 + lowered)]
        indices = [token.text for token in plain.walk(both) if token.kind != "bracket"]
        moving = {*self._names.coordinates} or {"x", "y", "z", "r", "t", "theta", "phi"}
        if (
            base in _TENSORS
            and len(indices) > 1
            and {*indices} <= moving | {"t", "mu", "nu", "i", "j", "k"}
        ):
            raise fault("tensor", caret.column, name=base)


def _with_factors_apart(line: Iterable[Token]) -> Tokens:
    """The tokens with a space before each bracket around a sum: r(r - 2M) is a product, f(x - y)
    may not be one.
    """
    found: Tokens = []
    for token in line:
        sums = token.is_bracket() and any(part.is_operator("+", "-") for part in token.inside)
        before = plain.at(found, len(found) - 1)
        apart = (
            sums
            and before.kind in ("name", "number", "bracket")
            and before.text not in nm.FUNCTION_LETTERS
        )
        token = plain.within(token, _with_factors_apart)
        glued = before.text in _POTENTIALS and before.span[1] == token.column  # V\left(x - y\right)
        apart = (token.space_before and not glued) or apart
        found.append(token if token.space_before == apart else replace(token, space_before=apart))
    return found


def _with_indices_first(line: Line) -> Tokens:
    r"""q_1'' for q''_1, and \omega_0^2 for \omega^2_0, which TeX sets alike; \Gamma^x_{xx} is a
    tensor.
    """
    found: Tokens = []
    place = 0
    while place < len(line):
        token, index = line[place], plain.at(line, place + 1)
        raised = _raised(found) if token.is_operator("_") else len(found)
        base = plain.at(found, raised - 1)
        after_letter = base.kind in ("name", "command") or base.is_bracket("{")
        if raised < len(found) and after_letter and _is_index(index, found[raised:]):
            found[raised:raised] = [token, *_with_indices_first([index])]
            place += 2
            continue
        found.append(plain.within(token, _with_indices_first))
        place += 1
    return found


def _raised(found: Line) -> int:
    """Where the primes or the power begin with which the tokens end; else their end."""
    start = len(found)
    while start and found[start - 1].kind == "prime":
        start -= 1
    if start == len(found) > 1 and found[-2].is_operator("^"):
        return start - 2
    return start


def _is_index(index: Token, raised: Line) -> bool:
    """Whether an index belongs to the letter before the primes or the power: a number, or any
    index behind a power that is a number.
    """
    inside = index.inside if index.is_bracket("{") else (index,)
    plainly = bool(inside) and all(each.kind in ("name", "number") for each in inside)
    power = raised[-1].inside if raised[-1].inside else (raised[-1],)
    signed = power[1:] if power[0].is_operator("-") else power
    counted = raised[0].is_operator("^") and [each.kind for each in signed] == ["number"]
    single = raised[0].kind == "prime" or not raised[-1].is_bracket("(") or counted
    return plainly and (counted or (single and inside[0].kind == "number"))


def _without_breaks(line: Line, inside: bool = False) -> Tokens:
    r"""The tokens without the \\ of a formula that is broken at a sign inside
    \left( ... \right); lists of equations and matrices keep theirs.
    """
    listed = any(token.is_operator("=", "&") or token.kind == "newline" for token in line)
    found: Tokens = []
    for place, token in enumerate(line):
        signs = (plain.at(line, place - 1), plain.at(line, place + 1))
        at_a_sign = any(sign.is_operator(*"+-*/") for sign in signs)
        if inside and not listed and at_a_sign and token.is_operator(";"):
            continue
        whole = token.is_bracket() and token.value != plain.MATRIX
        found.append(plain.within(token, partial(_without_breaks, inside=whole)))
    return found


def _with_differences(line: Line, moving: Container[str] | None = None) -> Tokens:
    r"""Delta_x for each \Delta x and \delta x whose x is among those that move."""
    found: Tokens = []
    for token in line:
        last = plain.at(found, len(found) - 1)
        sign = last.kind == "name" and last.text in _DIFFERENCES and not last.order
        if (
            sign
            and token.kind == "name"
            and f"{last.text}_{token.text}" in (moving or {f"{last.text}_{token.text}"})
        ):
            found[-1] = replace(token, text=f"{last.text}_{token.text}", column=last.column)
        else:
            found.append(plain.within(token, lambda inside: _with_differences(inside, moving)))
    return found


def _moving_differences(line: Line) -> set[str]:
    r"""The Delta_x of \ddot{\Delta x} and of \frac{d^2 \Delta x}{dt^2}."""
    found = {
        token.text
        for token in plain.walk(line)
        if token.order and token.text.partition("_")[0] in _DIFFERENCES
    }
    for token in plain.walk(line):
        if token.is_fraction():
            d, *operand = token.inside[0].inside or (token,)
            operand = operand[2:] if plain.at(operand, 0).is_operator("^") else operand
            of_time = plain.spelled(token.inside[-1].inside) in ("dt", "dt^2", "dt^(2)", "d t")
            if len(operand) == 2 and (d.text == "d" or d.is_operator(TOTAL)) and of_time:
                found |= {one.text for one in _with_differences(operand) if "_" in one.text}
    return found


def nested_tokens(text: str, names: nm.Names, cuts: Sequence[Cut] = ()) -> Tokens:
    """The tokens as they are typed, with brackets around what they hold."""
    plain.check_length(text, cuts)
    return _without_breaks(plain.nested(_scanned(text, names, cuts), primes=False))


def _without_idle_braces(line: Line) -> Tokens:
    r"""\frac{d^2 x}{dt^2} for the \frac{{{d^2}x}}{{d{t^2}}} that converters write."""
    found: Tokens = []
    for place, token in enumerate(line):
        upper = plain.at(line, place - 1).text in _FRACTIONS or (
            plain.at(line, place - 2).text in _FRACTIONS
            and plain.at(line, place - 1).is_bracket("{")
        )
        token = plain.within(token, _without_idle_braces)
        if upper and token.is_bracket("{"):
            token = replace(token, inside=tuple(_flat(token.inside)))
        found.append(token)
    return found


def _flat(line: Line) -> Tokens:
    """The tokens without braces around d^2, t^2, and dx, but for those of powers, indices, and
    commands.
    """
    found: Tokens = []
    for place, token in enumerate(line):
        before, behind = plain.at(line, place - 1), plain.at(line, place - 2)
        held = before.is_operator("^", "_") or "command" in (before.kind, behind.kind)
        raised = len(token.inside) > 1 and plain.at(line, place + 1).is_operator("^", "_")
        factors = all(
            one.kind in ("name", "number") or one.is_operator("^") or one.is_bracket("{")
            for one in plain.walk(token.inside)
        )
        if token.is_bracket("{") and factors and not (held or raised or token.order):
            found += _flat(token.inside)
        else:
            found.append(token)
    return found


def tokenize(text: str, names: nm.Names | None = None, cuts: Sequence[Cut] = ()) -> Tokens:
    """The tokens of a LaTeX formula; without `names` every letter is a separate name."""
    names = names or nm.Names()
    line = sums.with_each_index(_without_idle_braces(nested_tokens(text, names, cuts)))
    shown = text[: max(line[-1].column, line[-1].end)] if line else ""
    letters = indices.raised_letters([line]) if names.raised is None else names.raised
    if letters:
        line = indices.with_underscores(line, letters)
    line = differential_operators.with_raised_orders(sums.with_terms(line))
    line = _with_indices_first(line)
    found = _Line(line, _Formula.of(line, shown, names)).read()
    if moving := _moving_differences(found):
        found = _with_differences(found, moving)
    found = _with_factors_apart(found)
    return plain.with_line_ends(found, latex=True)
