r"""LaTeX to the tokens of the plain-text grammar, each with its column in the original."""

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction

from inverse_service.expressions import letters
from inverse_service.expressions.refusals import LIMITS, at_most, refusal, shorten
from inverse_service.reading import components, names as nm, tokens as plain
from inverse_service.reading.tokens import FACTOR, FRACTION, PARTIAL, TOTAL, Token, Tokens, bracket

_NO_LETTER = "(?![A-Za-z])"
# Spacing, which becomes blanks before anything else is read; a wide gap is a line end. A \\\\ is none.
_ENVIRONMENTS = "alignat|aligned|align|equation|flalign|gathered|gather|multline|split|eqnarray|subequations"
_SPACE = re.compile(
    rf"(?P<row>\\\\)|(?P<line>\\(?:q?quad|hfill?){_NO_LETTER}|\\hspace\*?\s*\{{[^{{}}]*\}})"
    rf"|[{''.join(letters.SPACES)}~]|\\[,;:! \n]"
    rf"|\\(?:displaystyle|textstyle|limits|nonumber|notag|(?:big|Big|bigg|Bigg)[lr]?){_NO_LETTER}"
    rf"|\\(?:enspace|enskip|(?:neg)?(?:thin|med|thick)space|noindent|strut|mathstrut){_NO_LETTER}"
    r"|\\(?:label|tag\*?|l?eqno|vspace\*?)\s*(?:\{[^{}]*\}|\([^()]*\))"
    r"|\\(?:stackrel|overset)\s*\{[^{}]*\}(?=\s*\{\s*=)"
    rf"|\\(?:begin|end)\s*\{{\s*(?:{_ENVIRONMENTS})\*?\s*\}}(?:\s*\{{[lcr| ]*\}})?"
)
_MATRIX = re.compile(
    rf"\\(begin|end)\s*\{{\s*(?:({'|'.join(components.MATRICES)})|array|d?cases)\*?\s*\}}"
    r"(?:\s*\{(?:[lcr| ]|@\{[^{}]*\})*\})?"
)
# In the second column of cases.
_CONDITIONS = {
    **dict.fromkeys(("if", "for", "when", "where")),
    **{
        word: Token("operator", sign, 0)
        for word, sign in (("otherwise", "true"), ("else", "true"), ("and", "&"), ("or", "|"))
    },
}
_CONNECTIVES = {"land": "and", "wedge": "and", "lor": "or", "vee": "or", "forall": "for"}
_ROW_SPACE = r"(?:\s*\[\s*-?[0-9.]+\s*(?:pt|pc|em|ex|mm|cm|in|jot|\\jot)\s*\])?"
_COMMAND = re.compile(rf"\\(?:(operatorname\*|[A-Za-z]+)|(\\){_ROW_SPACE}|(.))", re.DOTALL)
_MARKED_LETTER = re.compile(f"[A-Za-z{''.join(letters.GREEK)}][{''.join((*letters.DOTS, *letters.SUBSCRIPTS))}]+")
_INNER = r"(?:[^{}]|\{(?:[^{}]|\{[^{}]*\})*\})*"  # of braces, with two levels of others in them
_FONT = r"\\(?:mathrm|operatorname\*?|textrm|textnormal|text|mbox|mathit|rm)" + _NO_LETTER
# \bar{x} is the name x_bar
_ACCENTS = {"bar": "bar", "tilde": "tilde", "widetilde": "tilde"}
_ACCENT = rf"\\(?P<accent>{'|'.join(_ACCENTS)}){_NO_LETTER}"
_UPRIGHT = rf"(?:{_FONT}|{_ACCENT.replace('?P<accent>', '?:')})"
_ROMAN = re.compile(rf"\{{\s*\\rm{_NO_LETTER}")
_RUN = re.compile("[A-Za-z0-9]+")
_SCRIPTED = re.compile(r"\\(?:mathcal|mathscr|mathfrak|mathsf)\s*\{\s*([A-NP-Za-z])\s*\}")
_ANY_COMMAND = re.compile(r"\\[A-Za-z]+")
_INDEX = r"(?:\{[^{}]*\}|\\[A-Za-z]+|.)"
_INTO, _OUT = rf"(?:\s|\{{|\\left{_NO_LETTER})*", rf"(?:\s|\}}|\\right{_NO_LETTER})*"
_RAISED_BRACKETS = re.compile(rf"\{{{_INTO}[(\[]{_INTO}\\?(\w+){_OUT}[)\]]{_OUT}\}}")
_PART_OF_NAME = re.compile(
    rf"(?P<none>(?P<opens>{_FONT}|\{{)|\}}|\s)"
    rf"|{_ACCENT}\s*(?P<under>\{{[^{{}}]*\}}|\\[A-Za-z]+|.)|\\(?P<command>[A-Za-z]+)|.",
    re.DOTALL,
)
_WORDS = nm.FUNCTIONS | nm.DERIVATIVE_NAMES | nm.REFUSED.keys()
_FRACTIONS = ("frac", "tfrac", "dfrac", "cfrac")
# Words that are no product of letters: their backslash was left out.
_COMMANDS = frozenset(
    ("dot", "ddot", "cdot", "times", "left", "right", "partial", "mathrm", "text", "quad", "qquad", *_FRACTIONS[:3])
) | {*components.BOLD} - {"bm"}
_SIGNS = {
    "div": "/",
    "\\": ";",
    **dict.fromkeys(("equiv", "triangleq", "coloneqq"), "="),
    **dict.fromkeys(("cdot", "times", "ast"), "*"),
    **dict.fromkeys(("lbrace", "{"), "("),
    **dict.fromkeys(("rbrace", "}"), ")"),
    **dict.fromkeys(("vert", "lvert", "rvert", "|", "Vert", "lVert", "rVert"), "|"),
    **dict.fromkeys(("le", "leq", "leqslant", "lt", "ll"), "<"),
    **dict.fromkeys(("ge", "geq", "geqslant", "gt", "gg"), ">"),
    **dict.fromkeys(("ne", "neq"), "\u2260"),
}
_PRODUCTS = {"cdot": plain.DOT, "times": plain.CROSS}
_OPENING, _CLOSING = "([", ")]"
# Words in \text that are read, as everywhere.
_IN_TEXT = frozenset(("where", "with", "given", "and", "for", "if", "when", "const", "constant"))
# Words that are no product of letters; where they join nothing they are refused.
_ENGLISH = {word for word, reason in nm.REFUSED_UNLESS_DECLARED.items() if reason.problem == "is a word"}
_TENSORS = frozenset(("Gamma", "g", "R", "T", "F", "eta", "h", "delta", "epsilon", "varepsilon"))
_REASONS = nm.reasons("commands")
_MISPLACED = {"_": "a subscript belongs to a name, as in r_1", "}": "it closes nothing, leave it out"}


def _after_blanks(pattern: str) -> re.Pattern[str]:
    return re.compile(rf"\s*{pattern}", re.DOTALL)


_OPEN, _CLOSE, _BELOW, _RAISED = map(_after_blanks, (r"(\{)", r"(\})", "(_)", rf"([{''.join(letters.SUPERSCRIPTS)}^])"))
_PIECE = _after_blanks(rf"((?:{_UPRIGHT}\s*)?(?:\{{{_INNER}\}}|\\[A-Za-z]+|[0-9]+|.))")
_PRIME = _after_blanks(rf"([{''.join(letters.PRIMES)}]|\\prime{_NO_LETTER})")
_OVER, _LEFT = _after_blanks(rf"\\over{_NO_LETTER}"), _after_blanks(rf"\\left{_NO_LETTER}")
_DELIMITER = _after_blanks(r"(?:\\([A-Za-z]+|.)|(.))")
_DEGREE = _after_blanks(r"\[\s*(?:([0-9]+)\s*\])?")
_INDICES = _after_blanks(rf"{_INDEX}(?:\s*_\s*{_INDEX})*")
_RAISED_ONE = _after_blanks(r"(?:\{\s*(?=1\s*\})|(?=1(?![\w.+-])))")


def _cases(inner: Tokens, here: Token, end: Token) -> Tokens:
    """piecewise((a, x > 0), (b, true)) for the rows a & x > 0; b & otherwise; rows that are equations as they are."""
    compares = any(token.is_operator("<", ">") for token in plain.walk(inner))
    if not compares or any(token.is_operator("=") for token in inner):
        return [token for token in inner if not token.is_operator("&")]
    begins, separates = (Token("operator", sign, here.column, True) for sign in "(,")
    ends = Token("operator", ")", end.column)
    found: Tokens = []
    for row in plain.split_at(";", inner):
        if any(token.kind != "newline" for token in row):
            cells = plain.split_at("&", row)
            last = [_CONDITIONS.get(token.text, token) for token in _without_comma(cells[-1])]
            first = [*_without_comma(cells[0]), separates] if len(cells) > 1 else []
            found += [separates, begins, *first, *filter(None, last), ends]
    return [Token("name", "piecewise", here.column, True), begins, *found[1:], ends]


def _without_comma(cell: Tokens) -> Tokens:
    """The cell without the comma and the line ends after it."""
    while cell and (cell[-1].kind == "newline" or cell[-1].is_operator(",")):
        cell = cell[:-1]
    return cell


def _blank(space: re.Match[str]) -> str:
    return space[0] if space["row"] else ("\n" if space["line"] else "").ljust(len(space[0]))


class _Translator:
    """Translates a formula from left to right. A method for a part begins at its place and ends after it."""

    def __init__(self, text: str, names: nm.Names) -> None:
        self._place = 0
        self._names = names
        self._text = _SPACE.sub(_blank, text)
        self._tokens: Tokens = []
        self._spaced = False
        self._seen = self._depth = 0
        self._lefts: list[tuple[str, Tokens, int]] = []  # each \left: its sign, and the place of the bracket
        # The matrices and cases that are not ended yet: where they begin, and the name of a matrix.
        self._matrices: list[tuple[Token, Tokens, int, str | None]] = []

    def all(self) -> Tokens:
        """The tokens of the whole formula."""
        while self._ahead().kind != "end":
            self._one()
            at_most(len(self._tokens), LIMITS.tokens, "the formula has too many parts", self._place + 1)
        for here, line, start, matrix in self._matrices:
            if matrix:
                raise refusal("a matrix is never ended", here.column, "add the missing \\end")
            line[start:] = [token for token in line[start:] if not token.is_operator("&")]
        return self._tokens

    def _take(self, pattern: re.Pattern[str]) -> re.Match[str] | None:
        """Pass over what the pattern matches here."""
        match = pattern.match(self._text, self._place)
        self._place = match.end() if match else self._place
        return match

    def _ahead(self) -> Token:
        """Pass over spacing. The character ahead; a line end is a token of its own outside braces."""
        start, text = self._place, self._text
        spaced = self._spaced and start == self._seen
        while self._place < len(text):
            here = text[self._place]
            if not here.isspace() and (here != "&" or self._matrices):
                break
            if here == "\n" and not self._depth:
                self._tokens.append(Token("newline", here, self._place + 1))
            self._place += 1
        self._seen, self._spaced = self._place, spaced or self._place > start
        kind: plain.Kind = "operator" if self._place < len(text) else "end"
        return Token(kind, text[self._place : self._place + 1], self._place + 1, self._spaced)

    @contextmanager
    def _nested(self, column: int) -> Iterator[None]:
        self._depth += 1
        at_most(self._depth, LIMITS.depth, "the formula is nested too deeply", column)
        yield
        self._depth -= 1

    def _one(self) -> None:
        """Translate the next piece."""
        here, text = self._ahead(), self._text
        character = here.text
        if character == "\\":
            self._command(here)
        elif marked := _MARKED_LETTER.match(text, self._place):
            self._tokens += plain.next_tokens(text[: marked.end()], self._place, here.space_before)[0]
            self._place = marked.end()
        elif character in letters.GREEK or character == letters.SCRIPT_L:
            self._place += 1
            self._letter(letters.GREEK.get(character, "ell"), here)
        elif character.isascii() and character.isalpha():
            self._emit_name(self._with_subscript(self._word()), here)
        elif number := self._take(plain.NUMBER):
            self._tokens.append(plain.number_token(number[0], here.column, here.space_before))
        elif character == ".":
            self._place += 1
            if not self._tokens or self._ahead().kind != "end":
                instead = "a dot belongs to a number such as 0.5"
                raise refusal("a dot without a number occurs", here.column, instead)
        elif character in "{^":
            self._place += 1
            (self._power if character == "^" else self._braces)(here)
        else:
            self._sign(here)

    def _sign(self, here: Token) -> None:
        if here.text == "$":
            raise refusal("the character '$' is not accepted", here.column, "write $ only around the whole formula")
        if here.text in _MISPLACED:
            raise refusal(f"'{here.text}' is not expected", here.column, _MISPLACED[here.text])
        if here.text == "&":
            self._place += 1
            self._emit("&", here)
            return
        found, self._place = plain.next_tokens(self._text, self._place, here.space_before)
        for token in found:
            if token.is_operator(PARTIAL, TOTAL):
                raise refusal(f"'{token.text}' is not expected", token.column, "something is missing here")
            brackets = {"[": "(", "]": ")"}
            self._tokens.append(replace(token, text=brackets.get(token.text, token.text)))

    def _braces(self, here: Token) -> None:
        """{ … } as a bracket; { } is empty, and a single name in braces is that name."""
        if _ROMAN.match(self._text, here.column - 1):  # {\rm d} is \mathrm{d}
            self._place -= 1
            self._font(here)
            return
        called = _LEFT.match(self._text, self._place)
        inner = self._group(here)
        first = plain.at(inner, 0)
        after_function = bool(self._tokens) and self._tokens[-1].text in nm.FUNCTIONS
        if len(inner) == 1 and called and first.is_bracket():  # the arguments in A^{2}{\left(x \right)}
            self._tokens.append(replace(first, space_before=False))
        elif len(inner) == 1 and (
            first.is_operator(",", "=")  # 0{,}5
            or first.is_fraction()
            or (first.kind == "name" and not after_function)
        ):
            self._tokens.append(first)
        elif inner:
            self._tokens.append(self._enclosed(inner, here, space=not called))

    def _enclosed(self, inner: Tokens, opening: Token, value: Fraction = Fraction(0), space: bool = True) -> Token:
        """A bracket that ends here."""
        return replace(bracket(inner, opening, value, space), end=self._place)

    def _group(self, opening: Token) -> Tokens:
        """The tokens of { … }; {a \\over b} is \\frac{a}{b}."""
        outer, self._tokens = self._tokens, []
        above: Tokens | None = None
        with self._nested(opening.column):
            while (closing := self._ahead()).text != "}":
                if closing.kind == "end":
                    raise plain.never_closed(opening)
                if above is None and self._take(_OVER):
                    above, self._tokens = self._tokens, []
                else:
                    self._one()
        self._place += 1
        inner, self._tokens = plain.nested(self._tokens), outer
        return inner if above is None else [self._quotient(plain.nested(above), inner, opening)]

    def _quotient(self, above: Tokens, below: Tokens, here: Token) -> Token:
        over, under = bracket(above, here, space=False), self._enclosed(below, here, space=False)
        return self._enclosed([over, Token("operator", "/", here.column), under], here, FRACTION)

    def _command(self, here: Token) -> None:
        if environment := self._take(_MATRIX):
            self._environment(environment, here)
            return
        command = self._take(_COMMAND)
        if command is None:
            raise refusal("a backslash without a command occurs", here.column, "write a command such as \\dot{x}")
        name = command[command.lastindex or 0]
        if name in letters.LETTER_COMMANDS:
            self._letter(name, here)
        elif name in _FRACTIONS:
            self._tokens.append(self._quotient(self._argument(here), self._argument(here), here))
        elif name == "sqrt":
            self._root(here)
        elif name in ("dot", "ddot"):
            self._dot(here)
        elif name in nm.FUNCTIONS:
            if self._take(_BELOW):
                raise refusal("a base of a logarithm occurs", here.column, "write \\ln(x)/\\ln(b)")
            self._tokens.append(Token("name", name, here.column, True))  # g/l\sin x is g/l sin x
        elif re.fullmatch(_UPRIGHT, command[0]) and name != "rm":
            self._place = command.start()
            self._font(here)
        elif name in ("left", "right"):
            self._delimiter(name, here)
        elif name in _SIGNS:
            self._emit(_SIGNS[name], here)
            self._tokens[-1] = replace(self._tokens[-1], value=_PRODUCTS.get(name, Fraction(0)))
        elif name in components.BOLD:
            self._emit_name(self._with_subscript(self._name_part()), here, kind="vector")
        elif name == "partial":
            self._partial(here)
        elif (letter := self._scripted(command)) is not None:
            self._place = letter.end()
            self._emit_name(self._with_subscript(letter[1]), here)
        elif name in _CONNECTIVES and (self._matrices or name == "forall"):
            self._emit_name(_CONNECTIVES[name], here)
        else:
            what, reason = f"the command \\{shorten(name)} is not accepted", _REASONS.get(name)
            if not reason and name in nm.REFUSED:
                raise nm.refused(what, nm.REFUSED[name], here.column)
            what = "this environment is not accepted" if name in ("begin", "end") else what
            raise refusal(what, here.column, reason.instead if reason else "write the formula without it")

    def _environment(self, mark: re.Match[str], here: Token) -> None:
        """The beginning or the end of a matrix, which becomes a square bracket, or of cases."""
        if mark[1] == "begin":
            self._matrices.append((here, self._tokens, len(self._tokens), mark[2]))
        elif self._matrices and self._matrices[-1][1] is self._tokens:
            begins, line, start, _ = self._matrices.pop()
            if not mark[2]:
                line[start:] = _cases(line[start:], begins, here)
        if mark[2]:
            self._emit("[" if mark[1] == "begin" else "]", here)

    def _letter(self, name: str, here: Token) -> None:
        declared = self._names.role(name) is not None  # then \varphi is not \phi
        self._emit_name(self._with_subscript(name if declared else letters.LETTER_COMMANDS[name]), here)

    def _partial(self, here: Token) -> None:
        r"""\partial, and \partial_x as \frac{\partial}{\partial x}."""
        by = self._with_subscript("")[1:]
        if not by:
            self._emit(PARTIAL, here)
            return
        if {*by} == {"t"}:
            raise refusal("a partial derivative occurs", here.column, "write diff(A(x, y), x), A declared")
        sign = Token("operator", PARTIAL, here.column)
        variable = Token("name", by, here.column)
        self._tokens.append(self._quotient([sign], [sign, variable], here))

    def _scripted(self, command: re.Match[str]) -> re.Match[str] | None:
        r"""The J of \mathcal{J}, or None where the letter occurs in another font too."""
        found = _SCRIPTED.match(self._text, command.start())
        rest = _SCRIPTED.sub(" ", self._text)
        return None if found is None or found[1] in _ANY_COMMAND.sub(" ", rest) else found

    def _font(self, here: Token) -> None:
        start = self._place
        name = self._name_part()
        inside = re.sub(rf"^\{{?\s*{_UPRIGHT}\s*\{{?|\}}", "", self._text[start : self._place])
        words = re.search(r"\S\s", inside.strip()) or (
            self._text.startswith("\\text", start)
            and len(name) > 1
            and re.fullmatch("[a-z]+", name)
            and not (self._names.role(name) or name in _WORDS | _IN_TEXT or name in letters.LETTER_COMMANDS)
            and not (self._matrices and name in _CONDITIONS)
        )
        if words:
            raise refusal("words occur", here.column, "write the equations alone, separated by ;")
        if not inside.strip() and self._matrices:
            return
        if name == "d" and self._names.role("d") is None:
            self._emit(TOTAL, here)
            return
        self._emit_name(name and self._with_subscript(name), here)

    def _delimiter(self, side: str, here: Token) -> None:
        match = self._take(_DELIMITER)
        name = match[match.lastindex or 0] if match else ""
        text = _SIGNS.get(name, name)
        if side == "left":
            self._lefts.append((name, self._tokens, len(self._tokens)))
        opening, line, start = self._lefts.pop() if side == "right" and self._lefts else ("", self._tokens, 0)
        if text and text in (_OPENING if side == "left" else _CLOSING):
            self._emit("(" if side == "left" else ")", here, space=True)
        elif text == "|":
            self._emit("|", here)
        elif text != "." and (text or side == "left"):
            raise refusal(f"this delimiter after \\{side} is not accepted", here.column, "write ( and )")
        elif opening in ("{", "lbrace") and line is self._tokens:
            del line[start]  # \left\{ before a list of equations that \right. ends

    def _argument(self, at: Token) -> Tokens:
        """One argument: a group, or one piece as in \\frac12."""
        outer, self._tokens = self._tokens, []
        with self._nested(self._place + 1):
            here = self._ahead()
            self._place += 1
            if here.text == "{":
                doubled = _OPEN.match(self._text, self._place)
                inner = self._group(here)
                whole = doubled and len(inner) == 1 and inner[0].is_bracket() and not inner[0].value
                self._tokens = [*inner[0].inside] if whole else inner  # \frac{{a}}{{b}}
            elif here.text.isascii() and here.text.isdigit():
                self._tokens.append(plain.number_token(here.text, here.column, False))
            elif here.text.isascii() and here.text.isalpha():
                self._emit_name(here.text, here)
            elif (here.text == "\\" and not self._text.startswith(("\\\\", "\\right"), self._place - 1)) or (
                here.text in letters.GREEK
            ):
                self._place -= 1
                self._one()
            else:
                raise refusal(f"{self._shown(at)} has no argument", at.column, "write it in braces { }")
        found, self._tokens = plain.nested(self._tokens), outer
        return found

    def _root(self, here: Token) -> None:
        degree = self._take(_DEGREE)
        if degree and not degree[1]:
            raise refusal("the degree of a root is not an integer", here.column, "write \\sqrt[3]{x}")
        argument = self._enclosed(self._argument(here), here, space=False)
        if degree is None:
            self._emit_name("sqrt", here)
            self._tokens.append(argument)
        else:  # no argument bracket of a name before it
            power = plain.nested(plain.written(f"^(1/{degree[1]})", here))
            self._tokens.append(self._enclosed([argument, *power], here, FACTOR))

    def _dot(self, here: Token) -> None:
        """\\dot{x}, \\dot x, \\dot{r}_1, \\dot{r_1}, \\dot\\theta."""
        braces, shown = self._take(_OPEN), self._shown(here)
        with self._nested(here.column):
            inside = self._ahead()
        bold = re.match(rf"\\(?:{'|'.join(components.BOLD)}){_NO_LETTER}", self._text[self._place :])
        self._place += bold.end() if bold else 0
        if inside.text.isascii() and inside.text.isalpha():
            word = self._word() if braces else inside.text
            self._place += not braces
        else:
            word = "" if inside.text.isdigit() else self._name_part()
        name = self._with_subscript(word) if braces else word
        if not name or (braces and not self._take(_CLOSE)):
            raise refusal(f"{shown} belongs to a name", here.column, f"write {shown}{{x}}")
        order = 2 if "dd" in shown else 1
        self._emit_name(self._with_subscript(name), inside if bold else here, order, "vector" if bold else "name")

    def _power(self, caret: Token) -> None:
        r"""x^2, e^x, e^{u}, and the primes of x^{\prime}."""
        self._refuse_indices(caret)
        with self._nested(caret.column):
            here = self._ahead()
        braces, short = here.text == "{", here.text.isascii() and here.text.isalnum()
        self._place += braces
        if _PRIME.match(self._text, self._place):
            self._primes()
            if not braces or self._take(_CLOSE):
                return
        elif braces or short:
            self._refuse_exponent(here)
        self._emit("^", caret)
        start = len(self._tokens)
        if braces:
            self._braces(here)
        elif here.text.isalpha() and short:
            self._emit_name(self._with_subscript(self._word()), here)
        elif short:
            self._place += 1
            self._tokens.append(plain.number_token(here.text, here.column, False))
        if braces or short:
            self._tokens[start:] = [self._enclosed(self._tokens[start:], here, space=False)]
        if second := self._take(_RAISED):
            raise refusal("a second power occurs", second.start(1) + 1, "write x^{a^b} or (x^a)^b")

    def _refuse_exponent(self, here: Token) -> None:
        """InputError for q^{1}, a component; x^23, which is x^2 3; f^{(2)}, usually a derivative or a component."""
        place, base = here.column - 1, plain.at(self._tokens, len(self._tokens) - 1)
        if one := _RAISED_ONE.match(self._text, place):
            raise refusal("a raised 1 occurs", one.end() + 1, "an index? write it below, as in q_1 and q_2")
        if re.match("[0-9]{2}", self._text[place:]):
            raise refusal("a power of several digits has no braces", here.column, "write x^{23} or x^{2} \\cdot 3")
        raised = _RAISED_BRACKETS.match(self._text, place)
        if raised and base.kind != "number" and base.text not in ("e", "E"):  # e^{(x)} is exp(x)
            instead = "write x^{2} for a power, f''(x) for a derivative, q_1 for an index"
            kind = "number" if raised[1].isdigit() else "name"
            raise refusal(f"a raised {kind} in brackets occurs", here.column + 1, instead)

    def _refuse_indices(self, caret: Token) -> None:
        r"""InputError for the indices of tensors, \Gamma^x_{xx} and g^{tt}, which are not powers."""
        base = self._tokens[-1].text if self._tokens else ""
        run = _INDICES.match(self._text, self._place)
        indices = [each.lstrip("\\") for each in re.findall(r"\\[A-Za-z]+|[^\s{}_]", run[0] if run else "")]
        moving = {*self._names.coordinates} or {"x", "y", "z", "r", "t", "theta", "phi"}
        if base in _TENSORS and len(indices) > 1 and {*indices} <= moving | {"t", "mu", "nu", "i", "j", "k"}:
            what = f"raised and lowered indices of {base} occur"
            raise refusal(what, caret.column, "write each component as a formula, or as a name such as G_1")

    def _primes(self) -> None:
        while prime := self._take(_PRIME):
            sign = "'" if prime[1][0] == "\\" else prime[1]
            self._tokens.append(Token("prime", sign, prime.start(1) + 1, False, Fraction(letters.PRIMES[sign])))

    def _shown(self, at: Token) -> str:
        """The command at a place."""
        command = _COMMAND.match(self._text, at.column - 1)
        return command[0] if command else at.text

    def _emit(self, text: str, at: Token, space: bool | None = None) -> None:
        self._tokens.append(Token("operator", text, at.column, at.space_before if space is None else space))

    def _emit_name(self, name: str, at: Token, order: int = 0, kind: plain.Kind = "name") -> None:
        at_most(len(name), LIMITS.name_characters, "a name has too many characters", at.column)
        if not name:
            raise refusal(f"{self._shown(at)} contains no name", at.column, "write letters and digits in it")
        primed = at.column if order else 0
        self._tokens.append(Token(kind, name, at.column, at.space_before, order=order, primed=primed))

    def _word(self) -> str:
        """Take a letter, or the whole word if it is declared or a function."""
        run = _RUN.match(self._text, self._place)
        word = run[0][: LIMITS.name_characters] if run else ""
        for size in range(len(word), 1, -1):
            part = word[:size]
            known = (part in _WORDS | _ENGLISH and size == len(word)) or (
                size > 2 and part in letters.LETTER_COMMANDS
            )  # alpha for \alpha
            if known or self._names.role(part) or self._names.derivative(part):
                self._place += size
                return letters.LETTER_COMMANDS.get(part, part) if self._names.role(part) is None else part
            if part in _COMMANDS:
                span = (self._place + 1, self._place + 1 + size)
                raise refusal(f"{part} has no backslash", span[0], f"write \\{part}", (f"\\{part}",), span)
        self._place += 1
        return word[0]

    def _with_subscript(self, name: str) -> str:
        underscore = self._take(_BELOW)
        if underscore is None:
            return name
        comma = self._text[self._place :].lstrip()[1:].lstrip().startswith(",")
        subscript = self._name_part()
        if not subscript:
            derivative = f"write diff({name}(x), x) for a derivative"
            instead = derivative if comma else "write letters and digits, as in r_{1}"
            raise refusal("a subscript is not a word", underscore.start(1) + 1, instead)
        return f"{name}_{subscript}"

    def _name_part(self) -> str:
        """The letters, digits and Greek names of the next group or piece; '' if it contains anything else."""
        piece = self._take(_PIECE)
        return self._decoded(piece[1], piece.start(1)) if piece else ""

    def _decoded(self, text: str, start: int) -> str:
        name, is_below = "", False
        for part in _PART_OF_NAME.finditer(text):
            command = letters.GREEK.get(part[0], "ell" if part[0] == letters.SCRIPT_L else part["command"] or "")
            if part[0] == "_" and name and not is_below:  # V_{x_{max}} is V_x_max, k_{B_1} is k_B1
                is_below = True
                continue
            if part["accent"]:
                under = self._decoded(part["under"], start + part.start("under"))
                each = under and f"{under}_{_ACCENTS[part['accent']]}"
            elif command in _REASONS:
                raise refusal(f"\\{command} occurs", start + part.start() + 1, _REASONS[command].instead)
            elif command:
                each = command if self._names.role(command) else letters.LETTER_COMMANDS.get(command, "")
            else:
                each = part[0] if part[0].isascii() and part[0].isalnum() else ""
            if (part["opens"] and name and not is_below) or not (each or part["none"]):  # x_{mathrm{max}} is no name
                return ""
            if each:
                name += f"_{each}" if is_below and not (each.isdigit() and name[-1].isalpha()) else each
                is_below = False
        return "" if is_below else name


def _with_factors_apart(line: Iterable[Token]) -> Tokens:
    """The tokens with a space before each bracket with a sum: r(r - 2M) is a product, f(x - y) may not be one."""
    found: Tokens = []
    for token in line:
        sums = token.is_bracket() and any(part.is_operator("+", "-") for part in token.inside)
        before = plain.at(found, len(found) - 1)
        apart = sums and before.kind in ("name", "number", "bracket") and before.text not in nm.FUNCTION_LETTERS
        inside = tuple(_with_factors_apart(token.inside))
        found.append(replace(token, space_before=token.space_before or apart, inside=inside))
    return found


def tokenize(text: str, names: nm.Names | None = None) -> Tokens:
    """The tokens of a LaTeX formula; without `names` every letter is a separate name."""
    plain.check_length(text)
    found = _with_factors_apart(plain.nested(_Translator(text, names or nm.Names()).all()))
    return components.by_components(plain.with_line_ends(found, latex=True))
