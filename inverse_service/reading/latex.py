r"""LaTeX to the tokens of the plain-text grammar, each with its column in the original."""

import itertools
import re
from dataclasses import replace
from fractions import Fraction

from inverse_service.errors import InputError
from inverse_service.expressions.letters import DOTS, GREEK, LETTER_COMMANDS, SCRIPT_L, SPACES, SUBSCRIPTS
from inverse_service.expressions.refusals import LIMITS, at_most, refusal, shorten
from inverse_service.reading import components, names as nm, tokens as plain
from inverse_service.reading.tokens import FACTOR, FRACTION, PARTIAL, TOTAL, Token, Tokens, TokenStream

_ROW_SPACE = re.compile(r"\s*\[\s*-?[0-9.]+\s*(pt|pc|em|ex|mm|cm|in|jot|\\jot)\s*\]")
_MARKS = re.compile(r"\\(?:nonumber|notag)(?![A-Za-z])|\\(?:label|tag\*?)\s*\{[^{}]*\}")
_COMMAND = re.compile(r"\\(operatorname\*|[A-Za-z]+|.)", re.DOTALL)
_ENVIRONMENT = re.compile(r"\{\s*([a-z]+)\*?\s*\}(\s*\{[lcr| ]*\})?")
_ENVIRONMENTS = frozenset(
    ("align", "aligned", "alignat", "array", "cases", "dcases", "equation", "gather", "gathered", "split", "eqnarray")
)
_MARKED_LETTER = re.compile(f"[A-Za-z{''.join(GREEK)}][{''.join((*DOTS, *SUBSCRIPTS))}]+")
_SPACING = frozenset([",", ";", ":", "!", " ", "displaystyle", "textstyle", "limits", "\n"])
_SIZES = frozenset(size + side for size in ("big", "Big", "bigg", "Bigg") for side in ("", "l", "r"))
_WRAPPERS = (("$$", "$$"), ("$", "$"), (r"\[", r"\]"), (r"\(", r"\)"))


_BEGIN, _END, _CELL = "begin matrix", "end matrix", "&"


def scan(text: str) -> TokenStream:
    """The pieces of LaTeX: commands without backslash, letters, digits, and the signs of plain text."""
    plain.check_length(text)
    start, stop = _inside_wrappers(text)
    cases = _conditions(text)

    def step(text: str, place: int, space: bool) -> tuple[Tokens, int]:
        if place in cases:
            return cases[place]
        if text[place] == "&" and matrices:
            return [Token("command", _CELL, place + 1)], place + 1
        found, after = _pieces(text, place, space)
        if found and found[0].is_command(_BEGIN):
            matrices.append(place)
        elif found and found[0].is_command(_END) and matrices:
            matrices.pop()
        return found, after

    matrices: list[int] = []
    pieces = plain.with_line_ends(plain.scan(text, start, stop, step), latex=True)
    return TokenStream(pieces, stop + 1)


def _inside_wrappers(text: str) -> tuple[int, int]:
    """(start, stop) of the formula inside $ $ or \\[ \\]."""
    start, stop = 0, len(text)
    for opening, closing in _WRAPPERS:
        inner = text[start:stop]
        lead, tail = len(inner) - len(inner.lstrip()), len(inner) - len(inner.rstrip())
        inner = inner.strip()
        if inner.startswith(opening) and inner.endswith(closing) and len(inner) >= len(opening + closing):
            return start + lead + len(opening), stop - tail - len(closing)
    return start, stop


def _pieces(text: str, place: int, space: bool) -> tuple[Tokens, int]:
    """The pieces that begin at `place`, none for spacing, and the place after them."""
    character, column = text[place], place + 1
    if character == "\\":
        return _command(text, place, space)
    if character in SPACES or character in "~&":
        return [], place + 1
    if marked := _MARKED_LETTER.match(text, place):
        return plain.next_tokens(text[: marked.end()], place, space)
    if character in GREEK or character == SCRIPT_L:
        return [Token("command", GREEK.get(character, "ell"), column, space)], place + 1
    if character.isascii() and character.isalnum():
        return [Token("letter" if character.isalpha() else "digit", character, column, space)], place + 1
    if character in "._":
        return [Token("operator", character, column, space)], place + 1
    if character == "$":
        raise refusal("the character '$' is not accepted", column, "write $ only around the whole formula")
    return plain.next_tokens(text, place, space)


def _command(text: str, place: int, space: bool) -> tuple[Tokens, int]:
    if mark := _MARKS.match(text, place):
        return [], mark.end()
    match = _COMMAND.match(text, place)
    if match is None:
        raise refusal("a backslash without a command occurs", place + 1, "write a command such as \\dot{x}")
    name, end = match.group(1), match.end()
    if name in _SPACING or name in _SIZES:
        return [], end
    if name in ("quad", "qquad"):
        return [Token("newline", name, place + 1, space)], end
    if name == "equiv":
        return [Token("operator", "=", place + 1, space)], end
    if name in ("begin", "end"):
        kind, end = _environment(text, place, end)
        return [Token("command", f"{name} matrix", place + 1, space)] * (kind in components.MATRICES), end
    if name == "\\" and (height := _ROW_SPACE.match(text, end)):
        end = height.end()
    return [Token("command", name, place + 1, space)], end


def _environment(text: str, place: int, end: int) -> tuple[str, int]:
    match = _ENVIRONMENT.match(text, end)
    if match is None or match.group(1) not in (*_ENVIRONMENTS, *components.MATRICES):
        raise refusal("this environment is not accepted", place + 1, "write aligned or cases, or the equations alone")
    return match.group(1), match.end()


# \begin{cases} -x & x > 0 \\ x & \text{otherwise} \end{cases} is one formula if it contains no equation.
_COLUMNS = r"(?:\s*\{[lcr@{}| ]*\})?"
_CASES = re.compile(rf"\\begin\s*\{{(d?cases|array)\}}{_COLUMNS}((?:(?!\\begin).)*?)\\end\s*\{{\1\}}", re.DOTALL)
_EQUATION = re.compile(r"(?<![<>!=])=(?!=)")
_WORD_IN_CASES = r"\\(?:text|textrm|mathrm|mbox)\s*\{\s*"
_CONDITIONS = {
    "piecewise": r"\\begin\s*\{\w+\}" + _COLUMNS,
    ")": r"[,.;]?\s*(?:\\\\\s*)?\\end\s*\{\w+\}",
    ";": r"[,.;]?\s*\\\\(?:\s*\[[^]]*\])?",
    ",": r",?\s*&",
    "": _WORD_IN_CASES + r"(?:if|for|when|where)?\s*\}",
    "true": _WORD_IN_CASES + r"(?:otherwise|else)\s*\}",
    "and": rf"\\(?:land|wedge)(?![a-z])|{_WORD_IN_CASES}and\s*\}}",
    "or": rf"\\(?:lor|vee)(?![a-z])|{_WORD_IN_CASES}or\s*\}}",
    "<": r"<=?|\\(?:leqslant|leq|le|lt)(?![a-z])|\u2264",
    ">": r">=?|\\(?:geqslant|geq|ge|gt)(?![a-z])|\u2265",
}
_CONDITION = re.compile("|".join(f"({pattern})" for pattern in _CONDITIONS.values()))


_ROWS = {"piecewise": ("piecewise", "(", "("), ")": "))", ";": "),(", "and": "&", "or": "|", "": ""}


def _conditions(text: str) -> dict[int, tuple[Tokens, int]]:
    """By place: piecewise((a, x > 0), (b, true)) for the rows of cases, and the places after its parts."""
    found: dict[int, tuple[Tokens, int]] = {}
    for cases in _CASES.finditer(text):
        marks = [(mark, [*_CONDITIONS][(mark.lastindex or 1) - 1])
                 for mark in _CONDITION.finditer(text, cases.start(), cases.end())]  # fmt: skip
        compares = {"<", ">"} & {word for _, word in marks}
        for mark, word in marks if compares and not _EQUATION.search(cases[2]) else ():
            written = [Token("name" if part == word == "piecewise" else "operator", part, mark.start() + 1, True)
                       for part in _ROWS.get(word, (word,))]  # fmt: skip
            found[mark.start()] = written, mark.end()
    return found


FONTS = ("mathrm", "operatorname", "operatorname*", "text", "mathit")
_COMPONENTS = "a vector is not accepted, write an equation for each component"
_OTHER_LETTER = "letters in this font are separate names, write another name such as B_1"
# A bold r is not the r of the next line, nor is a script L the l.
VECTORS = dict.fromkeys((*components.BOLD, "bf"), _COMPONENTS)
OTHER_LETTERS = dict.fromkeys(
    ("mathcal", "mathscr", "mathfrak", "mathbb", "mathsf", "mathtt", "hat", "widehat", "overline"), _OTHER_LETTER
)
ACCENTS = {"bar": "bar", "tilde": "tilde", "widetilde": "tilde"}  # \bar{x} is the name x_bar
MARKED = VECTORS | OTHER_LETTERS
_WORDS = nm.FUNCTIONS | nm.DERIVATIVE_NAMES | nm.REFUSED.keys()

# Words that are no product of letters: their backslash was left out.
_COMMANDS = frozenset(
    (
        "dot",
        "ddot",
        "frac",
        "tfrac",
        "dfrac",
        "cdot",
        "times",
        "left",
        "right",
        "partial",
        "mathrm",
        "text",
        "quad",
        "qquad",
    )
) | {*components.BOLD} - {"bm"}
_FRACTIONS = ("frac", "tfrac", "dfrac", "cfrac")
_SIGNS = {
    "div": "/",
    "\\": ";",
    **dict.fromkeys(("cdot", "times", "ast"), "*"),
    _BEGIN: "[",
    _END: "]",
    _CELL: "&",
    **dict.fromkeys(("lbrace", "{"), "("),
    **dict.fromkeys(("rbrace", "}"), ")"),
    **dict.fromkeys(("vert", "lvert", "rvert"), "|"),
    **dict.fromkeys(("le", "leq", "leqslant", "lt", "ll"), "<"),
    **dict.fromkeys(("ge", "geq", "geqslant", "gt", "gg"), ">"),
    **dict.fromkeys(("ne", "neq"), "\u2260"),
}
_PRODUCTS = {"cdot": plain.DOT, "times": plain.CROSS}
_OPENING, _CLOSING = "([", ")]"
_TENSORS = frozenset(("Gamma", "g", "R", "T", "F", "eta", "h", "delta", "epsilon", "varepsilon"))
_REASONS = {
    "int": "integrals are not evaluated, write the evaluated integral",
    "sum": "sums are not expanded, write the terms",
    "circ": "write 30 \\pi/180 for 30 degrees",
    "infty": "write a finite number",
    "pm": "write one sign",
    "mp": "write one sign",
    "prod": "write the factors",
    "nabla": "write an equation for each component",
    "rm": "write \\mathrm{d}",
    "over": "write \\frac{a}{b}",
    **dict.fromkeys(("dv", "odv", "derivative"), "write \\frac{d^2 x}{dt^2}"),
    **dict.fromkeys(("approx", "sim", "simeq", "propto", "cong", "coloneqq"), "write ="),
    "dddot": "write equations of second order",
    "ddddot": "write equations of second order",
}


class LatexTranslator:
    """Translates raw tokens one by one; every method takes the tokens that it translates."""

    __slots__ = ("_names", "_raw", "_tokens")

    def __init__(self, raw: TokenStream, names: nm.Names) -> None:
        self._raw = raw
        self._names = names
        self._tokens: Tokens = []

    def all(self) -> Tokens:
        """The tokens of the whole formula."""
        while self._raw.ahead.kind != "end":
            self._one()
            at_most(len(self._tokens), LIMITS.tokens, "the formula has too many parts", self._raw.ahead.column)
        return self._tokens

    def _one(self) -> None:
        """Translate the next piece."""
        raw = self._raw.ahead
        if raw.kind == "command":
            self._command(self._raw.take())
        elif raw.kind == "letter":
            self._emit_name(self._with_subscript(self._word()), raw)
        elif raw.is_operator(".") and self._tokens and self._raw.look(1).kind == "end":
            self._raw.take()
        elif raw.kind == "digit" or raw.is_operator("."):
            self._number()
        elif raw.kind != "operator":
            self._tokens.append(self._raw.take())
        else:
            self._character(self._raw.take())

    def _character(self, raw: Token) -> None:
        if raw.is_operator("{"):
            self._group_or_arguments(raw)
        elif raw.is_operator("^"):
            self._power(raw)
            if self._raw.ahead.is_operator("^") and self._tokens[-1].kind != "prime":
                raise refusal("a second power occurs", self._raw.ahead.column, "write x^{a^b} or (x^a)^b")
        elif raw.is_operator("("):
            called = bool(self._tokens) and self._tokens[-1].text in nm.FUNCTION_LETTERS
            self._emit("(", raw, space=raw.space_before or (not called and self._holds_a_sum()))
        elif raw.is_operator(*"+-*/)=,;|&!", *plain.COMPARED, "true"):
            self._tokens.append(raw)
        elif raw.is_operator("[", "]"):
            self._emit("(" if raw.text == "[" else ")", raw)
        else:
            raise self._misplaced(raw)

    def _group_or_arguments(self, raw: Token) -> None:
        if self._raw.ahead.is_command("rm"):  # {\rm d} is \mathrm{d}
            self._raw.position -= 1
            self._font(raw)
            return
        start = len(self._tokens)
        called = self._raw.ahead.is_command("left")
        self._group(raw)
        if called:  # the arguments in A^{2}{\left(x \right)}, in one pair of brackets
            inner = self._tokens[start + 1 : -1]
            if plain.closing(inner, 0) >= len(inner) - 1:
                self._tokens[start:] = inner
            self._tokens[start] = replace(self._tokens[start], space_before=False)

    def _misplaced(self, raw: Token) -> InputError:
        reasons = {
            "_": "a subscript belongs to a name, as in r_1",
            "}": "it closes nothing, leave it out",
        }
        what = "the formula ends" if raw.kind == "end" else f"'{raw.text}' is not expected"
        return refusal(what, raw.column, reasons.get(raw.text, "something is missing here"))

    def _number(self) -> None:
        start = self._raw.ahead
        digits = "".join(piece.text for piece in self._run(start))
        match = plain.NUMBER.match(digits)
        if match is None:
            raise refusal("a dot without a number occurs", start.column, "a dot belongs to a number such as 0.5")
        self._raw.position += match.end()
        self._tokens.append(plain.number_token(match.group(), start.column, start.space_before))

    def _command(self, raw: Token) -> None:
        name = raw.text
        if name in LETTER_COMMANDS:
            declared = self._names.role(name) is not None  # then \varphi is not \phi
            self._emit_name(self._with_subscript(name if declared else LETTER_COMMANDS[name]), raw)
        elif name in _FRACTIONS:
            self._fraction(raw)
        elif name == "sqrt":
            self._root(raw)
        elif name in ("dot", "ddot"):
            self._dot(raw, 1 if name == "dot" else 2)
        elif name in nm.FUNCTIONS:
            self._function(name, raw)
        elif name in FONTS:
            self._font(raw)
        elif name in ACCENTS:
            if not (accented := self._plain_piece(raw)):
                raise refusal(f"\\{name} belongs to a name", raw.column, f"write \\{name}{{x}}")
            self._emit_name(self._with_subscript(accented), raw)
        elif name in ("left", "right"):
            self._delimiter(raw)
        elif name in _SIGNS:
            self._emit(_SIGNS[name], raw)
            self._tokens[-1] = replace(self._tokens[-1], value=_PRODUCTS.get(name, Fraction(0)))
        elif name in components.BOLD:
            self._emit_name(self._with_subscript(self._name_part()), raw, kind="vector")
        elif name == "partial":
            self._partial(raw)
        else:
            what, instead = f"the command \\{shorten(name)} is not accepted", MARKED.get(name) or _REASONS.get(name)
            if not instead and name in nm.REFUSED:
                raise nm.refused(what, nm.REFUSED[name], raw.column)
            raise refusal(what, raw.column, instead or "write the formula without it")

    def _partial(self, raw: Token) -> None:
        r"""\partial, and \partial_x as \frac{\partial}{\partial x}."""
        by = self._with_subscript("")[1:]
        if not by:
            self._emit(PARTIAL, raw)
            return
        if {*by} == {"t"}:
            raise refusal("a partial derivative occurs", raw.column, "write diff(A(x, y), x), A declared")
        self._tokens.append(Token("operator", "(", raw.column, True, FRACTION))
        self._tokens += plain.written(f"({PARTIAL})/({PARTIAL} {by}))", raw)

    def _function(self, name: str, raw: Token) -> None:
        if self._raw.ahead.is_operator("_"):
            raise refusal("a base of a logarithm occurs", raw.column, "write \\ln(x)/\\ln(b)")
        self._tokens.append(Token("name", name, raw.column, True))  # g/l\sin x is g/l sin x

    def _font(self, raw: Token) -> None:
        start = self._raw.position
        name = self._name_part()
        first = 2 + self._raw.look(start + 1 - self._raw.position).is_command("rm")
        inside = (self._raw.look(back) for back in range(start + first - self._raw.position, 0))
        if any(piece.space_before and not piece.is_operator("}") for piece in inside):
            raise refusal("words occur", raw.column, "write the equations alone, separated by ;")
        if name == "d" and self._names.role("d") is None:
            self._emit(TOTAL, raw)
            return
        self._emit_name(name and self._with_subscript(name), raw)

    def _delimiter(self, raw: Token) -> None:
        delimiter = self._raw.take()
        text = _SIGNS.get(delimiter.text, delimiter.text)
        if text and text in (_OPENING if raw.text == "left" else _CLOSING):
            if delimiter.text in ("{", "lbrace") and not self._closes_later():
                return  # \left\{ before a list of equations; it is ended by \right.
            self._emit("(" if raw.text == "left" else ")", raw, space=True)
        elif text == "|":
            self._emit("|", raw)
        elif not (delimiter.is_operator(".") and raw.text == "right"):
            raise refusal(f"this delimiter after \\{raw.text} is not accepted", raw.column, "write ( and )")

    def _holds_a_sum(self) -> bool:
        """Whether a + or - is between the ( just read and its ): r(r - 2M) is a product, f(x) may not be one."""
        return any(raw.is_operator("+", "-") for _, raw in plain.outside(self._raw.inside()))

    def _closes_later(self) -> bool:
        """Whether the \\left just read is ended by a real bracket and not by \\right."""
        depth = 1
        for raw, following in itertools.pairwise(self._raw.rest()):
            depth += raw.is_command("left") - raw.is_command("right")
            if depth == 0:
                return not following.is_operator(".")
        return True

    def _group(self, opening: Token, brackets: bool = True) -> None:
        """{ … } as a bracket; { } is empty, and a single name in braces is that name."""
        start = len(self._tokens)
        over: Token | None = None
        with self._raw.nested(opening):
            while not self._raw.ahead.is_operator("}"):
                if self._raw.ahead.kind == "end":
                    raise plain.never_closed(opening)
                if self._raw.ahead.is_command("over") and over is None:  # {a \over b} is \frac{a}{b}
                    over = self._raw.take()
                    above = self._tokens[start:]
                    self._tokens[start:] = [Token("operator", "(", opening.column, True, FRACTION)]
                    self._tokens += [Token("operator", "(", opening.column), *above]
                    self._tokens += [Token("operator", text, over.column) for text in ")/("]
                else:
                    self._one()
        closing = self._raw.take()
        if over is not None:
            self._tokens += [Token("operator", ")", closing.column)] * 2
        inner = self._tokens[start:]
        after_function = start > 0 and self._tokens[start - 1].text in nm.FUNCTIONS
        if len(inner) == 1 and inner[0].is_operator(","):
            return  # 0{,}5
        is_name = bool(inner) and inner[0].kind == "name" and all(token.kind == "prime" for token in inner[1:])
        is_fraction = (
            bool(inner)
            and inner[0].is_operator("(")
            and inner[0].value == FRACTION
            and plain.closing(inner, 0) == len(inner) - 1
        )
        if not brackets or not inner or is_fraction or (is_name and not after_function):
            return
        self._tokens[start:] = [Token("operator", "(", opening.column, True), *inner]
        self._emit(")", closing)

    def _argument(self, command: Token) -> None:
        """One argument in brackets: a group, or one piece as in \\frac12."""
        raw = self._raw.ahead
        self._emit("(", raw)
        if raw.is_operator("{"):
            start, doubled = len(self._tokens), self._raw.look(1).is_operator("{")
            self._group(self._raw.take(), False)
            inner = self._tokens[start:]
            if doubled and inner and not inner[0].value and plain.closing(inner, 0) == len(inner) - 1 > 0:
                self._tokens[start:] = inner[1:-1]  # \frac{{a}}{{b}}
        elif raw.kind == "digit":
            self._raw.take()
            self._tokens.append(plain.number_token(raw.text, raw.column, False))
        elif raw.kind == "letter":
            self._emit_name(self._raw.take().text, raw)
        elif raw.kind == "command" and raw.text not in ("right", "\\"):
            with self._raw.nested():
                self._one()
        else:
            raise refusal(f"\\{command.text} has no argument", command.column, "write it in braces { }")
        self._emit(")", raw)

    def _fraction(self, raw: Token) -> None:
        self._tokens.append(Token("operator", "(", raw.column, True, FRACTION))
        self._argument(raw)
        self._emit("/", raw)
        self._argument(raw)
        self._emit(")", raw)

    def _root(self, raw: Token) -> None:
        if not self._raw.ahead.is_operator("["):
            self._emit_name("sqrt", raw)
            self._argument(raw)
            return
        self._raw.take()
        digits = self._digits()
        if not digits or not self._raw.take().is_operator("]"):
            raise refusal("the degree of a root is not an integer", raw.column, "write \\sqrt[3]{x}")
        self._tokens.append(Token("operator", "(", raw.column, True, FACTOR))  # no argument bracket of a name before it
        self._argument(raw)
        self._tokens += plain.written(f"^(1/{digits}))", raw)

    def _dot(self, raw: Token, order: int) -> None:
        """\\dot{x}, \\dot x, \\dot{r}_1, \\dot{r_1}, \\dot\\theta."""
        braces = self._raw.take() if self._raw.ahead.is_operator("{") else None
        name, first = "", raw
        kind: plain.Kind = "name"
        if self._raw.ahead.kind == "letter":
            name = self._word() if braces else self._raw.take().text
        elif self._raw.ahead.kind == "command":
            command = self._raw.take()
            if command.is_command(*components.BOLD):
                kind, first = "vector", command
            name = self._name_part() if command.text in (*FONTS, *components.BOLD) else self._plain_piece(command)
        if braces:
            name = self._with_subscript(name)
        if not name or (braces and not self._raw.take().is_operator("}")):
            raise refusal(f"\\{raw.text} belongs to a name", raw.column, f"write \\{raw.text}{{x}}")
        self._emit_name(self._with_subscript(name), first, order, kind)

    def _power(self, caret: Token) -> None:
        raw = self._raw.ahead
        self._refuse_indices(caret)
        if raw.is_command("prime"):
            self._primes()
        elif raw.is_operator("{") and _is_prime(self._raw.look(1)):
            self._raw.take()
            self._primes()
            if self._raw.ahead.is_operator("}"):
                self._raw.take()
            else:
                self._emit("^", caret)
                self._group(raw)
        elif raw.kind in ("digit", "letter"):
            self._short_power(caret)
        else:
            self._emit("^", caret)
            if raw.is_operator("{"):
                self._refuse_raised_brackets(caret)
                self._refuse_index(self._raw.rest(3)[1:])
                self._emit("(", raw)
                self._group(self._raw.take())
                self._emit(")", raw)

    def _refuse_indices(self, caret: Token) -> None:
        r"""InputError for the indices of tensors, \Gamma^x_{xx} and g^{tt}, which are not powers."""
        run: list[str] = []
        depth = 0
        for raw, following in itertools.pairwise(self._raw.rest()):
            depth += raw.is_operator("{") - raw.is_operator("}")
            run.append(raw.text if raw.kind in ("letter", "command") else "" if raw.is_operator("{", "}", "_") else "?")
            if depth == 0 and not following.is_operator("_") and not raw.is_operator("_"):
                break
        letters = "".join(run)
        base = self._tokens[-1].text if self._tokens else ""
        moving = {*self._names.coordinates} or {"x", "y", "z", "r", "t", "theta", "phi"}
        indices = [text for text in run if text]
        tensor = base in _TENSORS and all(text in moving | {"t", "mu", "nu", "i", "j", "k"} for text in indices)
        if tensor and len(indices) > 1 and "?" not in letters:
            what = f"raised and lowered indices of {base} occur"
            raise refusal(what, caret.column, "write each component as a formula, or as a name such as G_1")

    def _short_power(self, caret: Token) -> None:
        """x^2, e^x: one digit or one name; x^23 is refused, because LaTeX reads x^2 3 and others read x^(23)."""
        raw = self._raw.ahead
        self._emit("^", caret)
        self._emit("(", raw)
        if raw.kind == "letter":
            self._emit_name(self._with_subscript(self._word()), raw)
        else:
            self._refuse_index([raw])
            digits = self._digits()
            if len(digits) > 1:
                raise refusal("a power of several digits has no braces", raw.column, "write x^{23} or x^{2} \\cdot 3")
            self._tokens.append(plain.number_token(digits, raw.column, False))
        self._emit(")", raw)

    def _refuse_index(self, raised: Tokens) -> None:
        """InputError for q^1, which is a component rather than a power."""
        alone = len(raised) == 1 or raised[1].is_operator("}")
        digits = self._run(raised[0]) if len(raised) == 1 else raised[:1]
        if alone and [piece.text for piece in digits] == ["1"] and self._tokens and self._tokens[-1].kind != "number":
            raise refusal("a raised 1 occurs", raised[0].column, "an index? write it below, as in q_1 and q_2")

    def _refuse_raised_brackets(self, caret: Token) -> None:
        """InputError for f^{(2)} and x^{\\left(n\\right)}, usually a derivative or a component; e^{(x)} is exp(x)."""
        pieces = self._raw.group()[: LIMITS.name_characters]
        inside = "".join(raw.text for raw in pieces if not raw.is_command("left", "right"))
        raised = re.fullmatch(r"\{*[(\[]\{*(\w+)\}*[)\]]\}*", inside)
        base = self._tokens[-2] if len(self._tokens) > 1 else caret
        if raised and base.kind != "number" and base.text not in ("e", "E"):
            instead = "write x^{2} for a power, f''(x) for a derivative, q_1 for an index"
            kind = "number" if raised[1].isdigit() else "name"
            raise refusal(f"a raised {kind} in brackets occurs", self._raw.look(1).column, instead)

    def _primes(self) -> None:
        while _is_prime(self._raw.ahead):
            raw = self._raw.take()
            self._tokens.append(raw if raw.kind == "prime" else Token("prime", "'", raw.column, False, Fraction(1)))

    def _emit(self, text: str, raw: Token, space: bool | None = None) -> None:
        self._tokens.append(Token("operator", text, raw.column, raw.space_before if space is None else space))

    def _emit_name(self, name: str, raw: Token, order: int = 0, kind: plain.Kind = "name") -> None:
        at_most(len(name), LIMITS.name_characters, "a name has too many characters", raw.column)
        if not name:
            raise refusal(f"\\{raw.text} contains no name", raw.column, "write letters and digits in it")
        self._tokens.append(Token(kind, name, raw.column, raw.space_before))
        if order:
            self._tokens.append(Token("prime", "'" * order, raw.column, False, Fraction(order)))

    def _run(self, start: Token) -> Tokens:
        """Pieces of one character that touch each other: a word or a number."""
        pieces = [start]
        for raw in self._raw.rest(LIMITS.digits * 4)[1:]:
            plain = raw.kind in ("letter", "digit") or raw.is_operator(".", "-", "+")
            if not plain or raw.space_before or raw.column != pieces[-1].column + 1:
                break
            pieces.append(raw)
        return pieces

    def _word(self) -> str:
        """Take a letter, or the whole word if it is declared or a function."""
        pieces = self._run(self._raw.ahead)[: LIMITS.name_characters]
        length = next((k for k, piece in enumerate(pieces) if piece.kind == "operator"), len(pieces))
        word = "".join(piece.text for piece in pieces[:length])
        for size in range(length, 1, -1):
            part = word[:size]
            known = (part in _WORDS and size == length) or (size > 2 and part in LETTER_COMMANDS)  # alpha for \alpha
            if known or self._names.role(part) or self._names.derivative(part):
                self._raw.position += size
                return LETTER_COMMANDS.get(part, part) if self._names.role(part) is None else part
            if part in _COMMANDS:
                span = (pieces[0].column, pieces[0].column + size)
                raise refusal(f"{part} has no backslash", span[0], f"write \\{part}", (f"\\{part}",), span)
        self._raw.position += 1
        return word[0]

    def _with_subscript(self, name: str) -> str:
        if not self._raw.ahead.is_operator("_"):
            return name
        underscore = self._raw.take()
        comma = self._raw.look(1).is_operator(",")
        subscript = self._name_part()
        if not subscript:
            derivative = f"write diff({name}(x), x) for a derivative"
            instead = derivative if comma else "write letters and digits, as in r_{1}"
            raise refusal("a subscript is not a word", underscore.column, instead)
        return f"{name}_{subscript}"

    def _name_part(self) -> str:
        """The letters, digits and Greek names of the next group or piece; '' if it contains anything else."""
        if not self._raw.ahead.is_operator("{"):
            raw = self._raw.ahead
            if raw.kind == "digit":
                return self._digits()
            is_font = self._raw.take().is_command(*FONTS) and self._raw.ahead.is_operator("{")
            return self._name_part() if is_font else self._plain_piece(raw)
        self._raw.take()
        parts: list[str] = []
        self._raw.position += self._raw.ahead.is_command("rm")
        while not self._raw.ahead.is_operator("}"):
            doubled = self._raw.ahead.is_operator("{")  # r_{{1}}
            raw = self._raw.ahead if doubled else self._raw.take()
            within = not parts and (doubled or raw.is_command(*FONTS))
            part = self._name_part() if within else self._plain_piece(raw)
            if not part:
                return ""
            parts.append(part)
        self._raw.take()
        return "".join(parts)

    def _digits(self) -> str:
        digits = ""
        while self._raw.ahead.kind == "digit" and (not digits or not self._raw.ahead.space_before):
            digits += self._raw.take().text
        return digits

    def _plain_piece(self, raw: Token) -> str:
        if raw.is_command(*MARKED):
            raise refusal(f"\\{raw.text} occurs", raw.column, MARKED[raw.text])
        if raw.is_command(*ACCENTS):
            name = self._name_part()
            return name and f"{name}_{ACCENTS[raw.text]}"
        if raw.kind == "command":
            return raw.text if self._names.role(raw.text) else LETTER_COMMANDS.get(raw.text, "")
        return raw.text if raw.kind in ("letter", "digit") else ""


def _is_prime(raw: Token) -> bool:
    return raw.is_command("prime") or raw.kind == "prime"


def tokenize(text: str, names: nm.Names | None = None) -> Tokens:
    """The tokens of a LaTeX formula; without `names` every letter is a separate name."""
    return components.by_components(LatexTranslator(scan(text), names or nm.Names()).all())
