"""The ends of exponents in plain text, e^-k t, e^-2x, e^-a(x - b), e^-t/tau, (x^2 + y^2)^-3/2: what
belongs to them, and the other interpretation, which is noted or asked about.
"""

import itertools
import re

from inverse_service import errors
from inverse_service.expressions import tree as ex
from inverse_service.expressions.refusals import fault
from inverse_service.reading import names as nm, operations as op, tokens as tk
from inverse_service.reading.tokens import Token, Tokens, at, note

_MOST_SIGNS = 8  # before the number of e^-2
_VARIABLE = re.compile(r"-\w+(\^2)?")  # the exponent of e^-t and e^-x^2


class ExponentParser(tk.TokenStream):
    """What a parser of formulas knows of exponents; it has the names, and parses factors."""

    __slots__ = ("_names",)
    _names: nm.Names

    def _factor(self) -> ex.Expression:
        raise NotImplementedError

    def _unclear_exponent(self, first: Token) -> errors.InputError:
        """The error for e^-kt, whose exponent begins with `first`, with both interpretations."""
        glued = [tk.source([first])]
        for place in itertools.count():
            token = self.look(place)
            if token.kind != "name" or token.space_before or self._is_function(token):
                break
            glued.append(tk.source([token]))
        span = (first.column, token.column)
        return fault("end of an exponent", self.ahead.column, span, written="*".join(glued))

    def _multiplies(self, ahead: Token) -> bool:
        """Whether a coordinate or a function after a power of a name or bracket is a factor: yes
        in w^2x, no in e^2x, x^2n, k**2x.
        """
        distance = -2 - self.look(-2).is_operator("-")
        base, caret, number = (self.look(place) for place in (distance - 1, distance, -1))
        euler = base.text in ("e", "E") and self._names.role(base.text) is None
        return (
            (self._moves(ahead) or self._is_function(ahead))  # w^2sin x
            and base.kind != "number"
            and not euler
            and number.column == caret.column - distance - 1
        )

    def _note_factor_after_power(self) -> None:
        """Note the other interpretation of w^2x, which is w^2 x."""
        ahead, start = self.ahead, -2 - self.look(-2).is_operator("-")
        base, power = tk.source([self.look(start - 1)]), self.source(self.position + start + 1)
        called = self._is_function(ahead) or self.look(1).is_bracket()
        if ahead.order or called or self.look(start - 1).kind != "name":
            return  # nobody means w^(2 x'), w^(2 sin x), or (x + 1)^(2 y)
        rest = tk.source([ahead])
        note(f"{base}^{power}{rest}", f"{base}^{power}*{rest}", f"{base}^({power}{rest})")

    def _halved(self, exponent: ex.Expression, start: int) -> ex.Expression:
        """-3/2 for the exponent of x (x^2 + y^2)^-3/2, which is noted."""
        written = self.source(start)
        self.take()
        under = self.take()
        note(f"^{written}/{under.text}", f"^({written}/{under.text})", f"^({written})/{under.text}")
        return op.product([exponent, op.reciprocal(ex.number(2), under.column)], under.column)

    def _with_time(self, exponent: ex.Expression, start: int) -> ex.Expression:
        """-k t for the exponent of e^-k t, and -2*x for that of e^-2x; InputError for e^-a x with a
        constant a.

        The other interpretation is noted, as is that of e^-x t with a coordinate x.
        """
        *signs, last = self.part(start)
        number, glued = last.kind == "number", not self.ahead.space_before
        if number and glued and self._scales(self.ahead, self.look(1)):
            exponent = op.product([exponent, self._factor()], last.column)  # of e^-2k t
            last = self.look(-1)
        following = self.ahead
        plain = all(sign.is_operator("-", "+") for sign in signs) and last.kind in (
            "name",
            "number",
        )
        bracket = following.is_bracket() and not following.is_fraction()
        if plain and bracket and (signs or not following.space_before):
            return self._times_bracket(exponent, start)
        if not plain or following.kind != "name" or following.order or self._is_function(following):
            return exponent
        written, behind = self.source(start), tk.source([following])
        timed = last.text == "t" and self._names.time and self._names.role("t") is None
        if last.kind == "name" and (self._moves(last) or (timed and self._moves(following))):
            note(f"e^{written} {behind}", f"e^({written})*{behind}", f"e^({written}*{behind})")
            return exponent
        typed = self._tokens[start - 2].text == "e"
        glued = (number or (typed and self._is_constant(last))) and not following.space_before
        timed = following.text == "t" and self._is_variable(following)
        if timed or (glued and self._moves(following)):
            place = self.position
            factor, behind = self._factor(), self.source(place)
            after = self.ahead
            if after.kind in ("name", "bracket") and not after.space_before and not timed:
                meant = f"{last.text}*{behind}*{tk.source([after])}"  # of e^-2xy
                span = (last.column, max(after.span[1], after.end + 1))
                raise fault("end of an exponent", after.column, span, written=meant)
            product = f"{nm.plainly(written)}*{behind}"
            note(f"e^{written} {behind}", f"e^({product})", f"e^({written})*{behind}")
            return op.product([exponent, factor], following.column)
        if self._moves(following):
            meant = f"{last.text}*{behind}"
            span = (last.column, following.span[1])
            raise fault("end of an exponent", following.column, span, written=meant)
        return exponent

    def _times_bracket(self, exponent: ex.Expression, start: int) -> ex.Expression:
        """-a*(x - b) for the exponent of e^-a(x - b), -x for that of e^-x(x - 1) and of
        e^-a (x - b), and of Mathematica's E^-a(x - b); the other interpretation is noted.
        """
        last, bracket, typed = self.look(-1), self.ahead, self._tokens[start - 2].text
        written, behind = self.source(start), tk.source([bracket])
        texts = f"e^({written}*{behind})", f"e^({written})*{behind}"
        glued = last.span[1] == bracket.column and typed == "e"
        if glued and not self._is_variable(last):
            note(f"e^{written}{behind}", *texts)
            return op.product([exponent, self._factor()], bracket.column)
        note(f"e^{written} {behind}", *reversed(texts))
        return exponent

    def _divided(self, exponent: ex.Expression, start: int) -> ex.Expression:
        """-t/tau for the exponent of e^-t/tau, which is noted; InputError for e^-kt/m, e^-r/r, and
        e^-t/2. Blanks around the / end the exponent, as a bracket does.
        """
        sign, below = self.ahead, self.look(1)
        written, place = nm.plainly(self.source(start)), self.position
        glued = not (sign.space_before or below.space_before)
        typed = self._tokens[start - 2].text == "e"  # E^-x/2 has one meaning in Mathematica
        if not (sign.is_operator("/") and glued and typed and written.startswith("-")):
            return exponent
        variable = _VARIABLE.fullmatch(written)
        moves = variable is not None and self._is_variable(self._tokens[start + 1])
        scale = self._is_constant(below) and below.kind == "name"
        ends = not starts_factor(self.look(2)) or self.look(2).space_before
        self.take()
        divisor = self._factor()
        under = self.source(place + 1)
        of_square = variable is not None and variable[1] is not None and under == "2"
        if moves and ends and (scale or of_square):
            note(f"e^{written}/{under}", f"e^({written}/{under})", f"e^({written})/{under}")
            return op.product([exponent, op.reciprocal(divisor, sign.column)], sign.column)
        span = (self._tokens[start].column, self.ahead.column)
        raise fault("exponent or quotient", sign.column, span, written=written, under=under)

    def _is_variable(self, token: Token) -> bool:
        """Whether this is a coordinate or the time."""
        timed = token.text == "t" and self._names.time and self._names.role("t") is None
        return not token.order and (timed or self._moves(token))

    def _note_sum(self, start: int) -> None:
        """Note the other interpretation of x^n+1, which is x^n + 1."""
        sign, number, exponent = self.ahead, self.look(1), self.part(start)
        glued = not (sign.space_before or number.space_before)
        if (
            [token.kind for token in exponent] == ["name"]
            and sign.is_operator("+", "-")
            and number.kind == "number"
            and glued
        ):
            below = f"{exponent[0].text}{sign.text}{number.text}"
            apart = f"{exponent[0].text} {sign.text} {number.text}"
            note(f"^{below}", f"^{apart}", f"^({below})")

    def _note_tower(self, base: ex.Expression, below: Token, start: int) -> None:
        """Note the other interpretation of 3^2^x, which is 3^(2^x)."""
        signs = [token for token in self.part(start) if token.is_operator("^")]
        if len(signs) == 1 and self._tokens[start + 1] is signs[0] and base != op.EXPONENTIAL:
            first, second = (
                self.source(*ends) for ends in ((start, start + 1), (start + 2, self.position))
            )
            under = tk.source([below])
            texts = f"{under}^({first}^{second})", f"({under}^{first})^{second}"
            note(f"{under}^{first}^{second}", *texts)

    def _euler(self, token: Token) -> ex.Expression:
        """exp(1) if it is raised to a formula, and in e^-2t; e alone or e^2 may be a charge."""
        signs = [*itertools.takewhile(lambda one: one.is_operator("+", "-"), self._from(1))]
        number, *after = self._from(1 + len(signs))
        kinds = [
            each.kind
            for each in tk.walk([number])
            if not (each.is_bracket() or each.is_operator("+", "-"))
        ]
        decays = len(signs) == 1 and signs[0].is_operator("-") and token.text == "e"
        decays = decays and self._is_rate(*after[:2])
        plain = kinds == ["number"] and not decays
        if token.order or not self.ahead.is_operator("^") or plain:
            meant = self._euler_meant("".join(sign.text for sign in signs), number, *after[:1])
            raise fault("Euler's number", token.column, None, meant, name=token.text)
        return op.EXPONENTIAL

    def _from(self, distance: int) -> Tokens:
        """The next tokens, from one at a distance; some of them, perhaps all the end."""
        return [self.look(distance + place) for place in range(_MOST_SIGNS)]

    def _is_rate(self, first: Token, second: Token) -> bool:
        """Whether the 2 of e^-2 t, e^-2x, e^-2k t, or e^-2(x - 1) multiplies what follows."""
        timed = first.text == "t" and self._is_variable(first)
        moves = self._is_variable(first) or self._scales(first, second) or first.is_bracket()
        return timed or (moves and not first.space_before)

    def _scales(self, first: Token, second: Token) -> bool:
        """Whether a constant and what it multiplies are here: the time, or anything glued to it."""
        glued = second.text == "t" or first.span[1] == second.column
        moves = self._is_variable(second) or (second.is_bracket() and not second.is_fraction())
        return self._is_constant(first) and glued and moves

    def _is_raised_euler(self, ahead: int = 0) -> bool:
        """Whether the e here is Euler's number next to a charge e, as its power has letters."""
        power = self.look(ahead + 1 + self.look(ahead + 1).is_operator("+", "-"))
        letters = any(token.kind == "name" for token in tk.walk([power]))
        return self._names.euler and self.look(ahead).is_operator("^") and letters

    def _euler_meant(self, sign: str, number: Token, glued: Token) -> tuple[str, ...]:
        """exp(2*x) and exp(2)*x for e^2x."""
        power = self.ahead.is_operator("^") and number.kind == "number" and len(sign) < 2
        if not power or glued.kind != "name" or glued.space_before:
            return ()
        parts = (f"*{glued.text})", f")*{glued.text}")
        return tuple(f"exp({sign}{number.text}{part}" for part in parts)

    def _is_function(self, token: Token) -> bool:
        return token.text in nm.FUNCTIONS and self._names.role(token.text) is None

    def _moves(self, token: Token) -> bool:
        return self._names.role_meant(token.text) == "coordinate"

    def _is_constant(self, token: Token) -> bool:
        return self._names.role_meant(token.text) == "parameter" or token.text in ("pi", "Pi")


def is_length(bracket: Token) -> bool:
    """Whether this is the square of a length, x^2 + y^2."""
    terms = tk.split_at("+-", bracket.inside) if bracket.is_bracket() else []
    return len(terms) > 1 and all(
        at(term, len(term) - 2).is_operator("^")
        and tk.spelled(term[-1:]).strip("()") == "2"
        and not any(token.is_operator("/") for token in term)
        for term in terms
    )


def starts_factor(token: Token) -> bool:
    return token.kind in ("number", "name") or token.is_bracket()
