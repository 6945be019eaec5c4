"""LaTeX to the tokens of the plain-text grammar, each with its column in the original."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from fractions import Fraction

from inverse_service.errors import InputError
from inverse_service.expressions.latex_derivatives import LatexDerivatives
from inverse_service.expressions.latex_scanner import Raw, scan
from inverse_service.expressions.latex_words import FONTS, MARKED, open_brackets, role_before, time_argument
from inverse_service.expressions.names import Names
from inverse_service.expressions.tokenizer import NUMBER, number_token
from inverse_service.expressions.tokens import (
    FACTOR,
    LETTER_COMMANDS,
    LIMITS,
    Token,
    at_most,
    refusal,
    shorten,
)
from inverse_service.expressions.vocabulary import FUNCTIONS, REFUSED, refused

_FRACTIONS = ("frac", "tfrac", "dfrac", "cfrac")
_PRODUCTS = {"cdot": "*", "times": "*", "ast": "*", "div": "/", "lbrace": "(", "rbrace": ")", "{": "(", "}": ")"}
_OPENING, _CLOSING = "([", ")]"
_BARS = ("vert", "lvert", "rvert")
_REASONS = {
    "partial": "write diff(A(x, y), x) for a partial derivative",
    "int": "integrals are not carried out, write the integral itself",
    "sum": "sums are not carried out, write the terms",
    "circ": "write 30 \\pi/180 for 30 degrees",
    "infty": "write a finite number",
    "pm": "write one sign",
    "mp": "write one sign",
    "prod": "write the factors",
    "nabla": "write an equation for each component",
    "rm": "write \\mathrm{d}",
    "over": "write \\frac{a}{b}",
    **dict.fromkeys(("dv", "odv", "derivative"), "write \\frac{d^2 x}{dt^2}"),
    **dict.fromkeys(("approx", "equiv", "sim", "simeq", "propto", "cong", "coloneqq"), "write ="),
    **dict.fromkeys(("ne", "neq", "le", "leq", "ge", "geq", "lt", "gt"), "write an equation with ="),
    "dddot": "write equations of second order",
    "ddddot": "write equations of second order",
}


class LatexTranslator(LatexDerivatives):
    """Translates raw tokens one after the other; every method takes what it translates."""

    __slots__ = ()

    def all(self) -> list[Token]:
        """The tokens of the whole formula."""
        while self._ahead.kind != "end":
            self._one()
            at_most(len(self._tokens), LIMITS.tokens, "the formula has too many parts", self._ahead.column)
        return self._tokens

    def _begin_factor(self, raw: Raw) -> None:
        """The ( of a fraction or a root, which holds no argument of the name before it."""
        self._tokens.append(Token("operator", "(", raw.column, True, FACTOR))

    def _one(self) -> None:
        """Translate what comes next."""
        raw = self._ahead
        if raw.kind == "command":
            self._command(self._take())
        elif raw.kind == "condition":
            self._piece_of_cases(self._take())
        elif raw.kind == "letter":
            self._emit_name(self._with_subscript(self._word()), raw)
        elif raw.is_character(".") and self._tokens and self._raw[self._place + 1].kind == "end":
            self._take()
        elif raw.kind == "digit" or raw.is_character("."):
            self._number()
        else:
            self._character(self._take())

    def _piece_of_cases(self, raw: Raw) -> None:
        """piecewise((a, x > 0), (b, true)) for the rows of cases."""
        if raw.text == "piecewise":
            self._emit_name(raw.text, raw)
        words = {"piecewise": ["(", "("], ")": [")", ")"], ";": [")", ",", "("], "and": ["&"], "or": ["|"]}
        for word in words.get(raw.text, [raw.text]):
            self._emit(word, raw)

    def _character(self, raw: Raw) -> None:
        if raw.is_character("{"):
            self._group_or_time(raw)
        elif raw.is_character("^"):
            self._power(raw)
            if self._ahead.is_character("^") and self._tokens[-1].kind != "prime":
                raise refusal("a second power occurs", self._ahead.column, "write x^{a^b} or (x^a)^b")
        elif raw.text and raw.text in ("'", "''"):
            self._tokens.append(Token("prime", raw.text, raw.column, raw.space_before, Fraction(len(raw.text))))
        elif raw.is_character("("):
            self._emit("(", raw, space=raw.space_before or self._holds_a_sum())
        elif raw.text and raw.text in "+-*/)=,;|":
            self._emit(raw.text, raw)
        elif raw.is_character("[", "]"):
            self._emit("(" if raw.text == "[" else ")", raw)
        else:
            raise self._misplaced(raw)

    def _group_or_time(self, raw: Raw) -> None:
        pieces = time_argument([raw, *self._raw[self._place : self._place + 6]])
        role = role_before(self._tokens, self._names) if pieces else None
        if role == "parameter":
            raise refusal("a parameter depends on time", raw.column, "", declare="functions")
        if role == "coordinate":
            self._place += pieces - 1
        elif self._derivative_in_braces():
            return
        elif self._ahead.is_command("left") and role_before(self._tokens, self._names) in ("function", None):
            start = len(self._tokens)
            self._group(raw)  # the arguments in A^{2}{\left(x \right)}, in one pair of brackets
            inner = self._tokens[start + 1 : -1]
            if all(itertools.accumulate(open_brackets([token]) for token in inner[:-1])):
                self._tokens[start:] = inner
            self._tokens[start] = replace(self._tokens[start], space_before=False)
        else:
            self._group(raw)

    def _derivative_in_braces(self) -> bool:
        r"""{\frac{d}{dt}} x, as Maple prints it, without the outer braces; else nothing is taken."""
        start = self._place
        end = self._after_group(self._after_group(start + 1))
        if not self._ahead.is_command(*_FRACTIONS) or not self._raw[end].is_character("}"):
            return False
        closing, raw = self._raw.pop(end), self._take()
        if self._time_derivative(raw) or self._derivative_operator(raw):
            return True
        self._raw.insert(end, closing)
        self._place = start
        return False

    def _misplaced(self, raw: Raw) -> InputError:
        reasons = {
            "_": "a subscript belongs to a name, as in r_1",
            "}": "it closes nothing, leave it out",
        }
        what = "the formula ends" if raw.kind == "end" else f"'{raw.text}' is not expected"
        return refusal(what, raw.column, reasons.get(raw.text, "something is missing here"))

    def _number(self) -> None:
        start = self._ahead
        digits = "".join(piece.text for piece in self._run(start))
        match = NUMBER.match(digits)
        if match is None:
            raise refusal("a dot stands by itself", start.column, "a dot belongs to a number such as 0.5")
        self._place += match.end()
        self._tokens.append(number_token(match.group(), start.column, start.space_before))

    def _command(self, raw: Raw) -> None:
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
        elif name in FUNCTIONS:
            self._function(name, raw)
        elif name in FONTS:
            self._font(raw)
        elif name in ("left", "right"):
            self._delimiter(raw)
        elif name in _BARS:
            self._emit("|", raw)
        elif name in _PRODUCTS:
            self._emit(_PRODUCTS[name], raw)
        elif name == "\\":
            self._emit(";", raw)
        else:
            what, instead = f"the command \\{shorten(name)} is not accepted", MARKED.get(name) or _REASONS.get(name)
            if not instead and name in REFUSED:
                raise refused(what, REFUSED[name], raw.column)
            raise refusal(what, raw.column, instead or "write the formula without it")

    def _function(self, name: str, raw: Raw) -> None:
        if self._ahead.is_character("_"):
            raise refusal("a base of a logarithm occurs", raw.column, "write \\ln(x)/\\ln(b)")
        self._emit_name(name, raw)

    def _font(self, raw: Raw) -> None:
        start = self._place
        name = self._name_part()
        if any(piece.space_before for piece in self._raw[start + 1 : self._place]):
            raise refusal("words occur", raw.column, "write the equations alone, separated by ;")
        if name == "d" and self._names.role("d") is None:
            raise refusal("a differential occurs", raw.column, "write \\frac{dx}{dt} for a derivative")
        if not name:
            raise refusal(f"\\{raw.text} contains no name", raw.column, "write letters and digits in it")
        self._emit_name(self._with_subscript(name), raw)

    def _delimiter(self, raw: Raw) -> None:
        delimiter = self._take()
        text = _PRODUCTS.get(delimiter.text, delimiter.text)
        if text and text in (_OPENING if raw.text == "left" else _CLOSING):
            if delimiter.text in ("{", "lbrace") and not self._closes_later():
                return  # \left\{ before a list of equations; it is ended by \right.
            self._emit("(" if raw.text == "left" else ")", raw, space=True)
        elif delimiter.text in ("|", *_BARS):
            self._emit("|", raw)
        elif not (delimiter.is_character(".") and raw.text == "right"):
            raise refusal(f"this delimiter after \\{raw.text} is not accepted", raw.column, "write ( and )")

    def _holds_a_sum(self) -> bool:
        """Whether a + or - stands between the ( just read and its ): r(r - 2M) is a product, f(x) may be none."""
        depth = 1
        for raw in self._raw[self._place :]:
            depth += raw.is_character("(", "{", "[") - raw.is_character(")", "}", "]")
            if depth == 0 or depth > LIMITS.depth:
                return False
            if depth == 1 and raw.is_character("+", "-"):
                return True
        return False

    def _closes_later(self) -> bool:
        """Whether the \\left just read is ended by a real bracket and not by \\right."""
        depth = 1
        for place in range(self._place, len(self._raw) - 1):
            if self._raw[place].is_command("left"):
                depth += 1
            elif self._raw[place].is_command("right"):
                depth -= 1
                if depth == 0:
                    return not self._raw[place + 1].is_character(".")
        return True

    def _group(self, opening: Raw) -> None:
        """{ … } as a bracket; { } holds nothing, and a name alone in braces is that name."""
        start = len(self._tokens)
        self._enter(opening)
        while not self._ahead.is_character("}"):
            if self._ahead.kind == "end":
                raise refusal("the '{' is never closed", opening.column, "add the missing '}'")
            self._one()
        closing = self._take()
        self._depth -= 1
        inner = self._tokens[start:]
        after_function = start > 0 and self._tokens[start - 1].text in FUNCTIONS
        if len(inner) == 1 and inner[0].is_operator(","):
            return  # 0{,}5
        is_name = bool(inner) and inner[0].kind == "name" and all(token.kind == "prime" for token in inner[1:])
        if not inner or (is_name and not after_function):
            return
        self._tokens[start:] = [Token("operator", "(", opening.column, True), *inner]
        self._emit(")", closing)

    def _argument(self, command: Raw) -> None:
        """One argument in brackets: a group, or one piece as in \\frac12."""
        raw = self._ahead
        self._emit("(", raw)
        if raw.is_character("{"):
            self._group(self._take())
        elif raw.kind == "digit":
            self._take()
            self._tokens.append(number_token(raw.text, raw.column, False))
        elif raw.kind == "letter":
            self._emit_name(self._take().text, raw)
        elif raw.kind == "command" and raw.text not in ("right", "\\"):
            self._enter(raw)
            self._one()
            self._depth -= 1
        else:
            raise refusal(f"\\{command.text} has no argument", command.column, "write it in braces { }")
        self._emit(")", raw)

    def _fraction(self, raw: Raw) -> None:
        if self._time_derivative(raw) or self._derivative_operator(raw) or self._derivative_of_call(raw):
            return
        self._refuse_differentials(raw)
        self._begin_factor(raw)
        self._argument(raw)
        self._emit("/", raw)
        self._argument(raw)
        self._emit(")", raw)

    def _root(self, raw: Raw) -> None:
        if not self._ahead.is_character("["):
            self._emit_name("sqrt", raw)
            self._argument(raw)
            return
        self._take()
        digits = self._digits()
        if not digits or not self._take().is_character("]"):
            raise refusal("the degree of a root is not an integer", raw.column, "write \\sqrt[3]{x}")
        self._begin_factor(raw)
        self._argument(raw)
        for text in "^(":
            self._emit(text, raw)
        self._tokens.append(number_token("1", raw.column, False))
        self._emit("/", raw)
        self._tokens.append(number_token(digits, raw.column, False))
        for text in "))":
            self._emit(text, raw)

    def _dot(self, raw: Raw, order: int) -> None:
        """\\dot{x}, \\dot x, \\dot{r}_1, \\dot{r_1}, \\dot\\theta."""
        braces = self._take() if self._ahead.is_character("{") else None
        name = ""
        if self._ahead.kind == "letter":
            name = self._word() if braces else self._take().text
        elif self._ahead.kind == "command":
            command = self._take()
            name = self._name_part() if command.text in FONTS else self._plain_piece(command)
        if braces:
            name = self._with_subscript(name)
        if not name or (braces and not self._take().is_character("}")):
            raise refusal(f"\\{raw.text} belongs to a name", raw.column, f"write \\{raw.text}{{x}}")
        self._emit_name(self._with_subscript(name), raw, order)

    def _power(self, caret: Raw) -> None:
        raw = self._ahead
        if raw.is_command("prime"):
            self._primes()
        elif raw.is_character("{") and _is_prime(self._raw[self._place + 1]):
            self._take()
            self._primes()
            if self._ahead.is_character("}"):
                self._take()
            else:
                self._emit("^", caret)
                self._group(raw)
        elif raw.kind in ("digit", "letter"):
            self._short_power(caret)
        else:
            self._emit("^", caret)
            if raw.is_character("{"):
                self._refuse_raised_brackets(caret)
                self._refuse_index(self._raw[self._place + 1 : self._place + 3])
                self._emit("(", raw)
                self._group(self._take())
                self._emit(")", raw)

    def _short_power(self, caret: Raw) -> None:
        """x^2, e^x: one digit or one name; x^23 is x^2 3 in LaTeX and x^(23) to others: refused."""
        raw = self._ahead
        self._emit("^", caret)
        self._emit("(", raw)
        if raw.kind == "letter":
            self._emit_name(self._with_subscript(self._word()), raw)
        else:
            self._refuse_index([raw])
            digits = self._digits()
            if len(digits) > 1:
                raise refusal("a power of several digits has no braces", raw.column, "write x^{23} or x^{2} \\cdot 3")
            self._tokens.append(number_token(digits, raw.column, False))
        self._emit(")", raw)

    def _refuse_index(self, raised: list[Raw]) -> None:
        """InputError for q^1, which is a component and no power."""
        alone = len(raised) == 1 or raised[1].is_character("}")
        digits = self._run(raised[0]) if len(raised) == 1 else raised[:1]
        if alone and [piece.text for piece in digits] == ["1"] and self._tokens and self._tokens[-1].kind != "number":
            raise refusal("a raised 1 occurs", raised[0].column, "an index? write it below, as in q_1 and q_2")

    def _refuse_raised_brackets(self, caret: Raw) -> None:
        """InputError for f^{(2)} and x^{\\left(n\\right)}: a derivative or a component to most; e^{(x)} is exp(x)."""
        depth, inside = 0, ""
        for raw in self._raw[self._place :]:
            depth += raw.is_character("{") - raw.is_character("}")
            if depth == 0 or len(inside) > LIMITS.name_characters:
                break
            inside += "" if raw.is_command("left", "right") else raw.text
        raised = re.fullmatch(r"\{*[(\[]\{*(\w+)\}*[)\]]\}*", inside)
        base = self._tokens[-2] if len(self._tokens) > 1 else caret
        if raised and base.kind != "number" and base.text not in ("e", "E"):
            instead = "write x^{2} for a power, f''(x) for a derivative, q_1 for an index"
            kind = "number" if raised[1].isdigit() else "name"
            raise refusal(f"a raised {kind} in brackets occurs", self._raw[self._place + 1].column, instead)

    def _primes(self) -> None:
        while _is_prime(self._ahead):
            raw = self._take()
            order = 1 if raw.kind == "command" else len(raw.text)
            self._tokens.append(Token("prime", "'" * order, raw.column, False, Fraction(order)))


def _is_prime(raw: Raw) -> bool:
    return raw.is_command("prime") or raw.is_character("'", "''")


def tokenize(text: str, names: Names | None = None) -> list[Token]:
    """The tokens of a LaTeX formula; without `names` every letter is a name of its own."""
    return LatexTranslator(scan(text), names or Names()).all()
