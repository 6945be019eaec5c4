"""The grammar of formulas over tokens: precedence, products without sign, functions, derivatives.

    formula    = term {("+" | "-") term}
    term       = signs factor {("*" signs | "/" signs | nothing) factor}
    factor     = base ["^" signs factor]                      right associative, tighter than a sign
    base       = number | "(" formula ")" | "|" formula "|" | name | name primes | function
    function   = name ["^" base] ( "(" formula {"," formula} ")" | [number] factor )
               | "piecewise" "(" piece {"," piece} ")",  piece = "(" formula "," condition ")"
    condition  = both {"|" both},  both = one {"&" one}
    one        = "~" one | "true" | "(" condition ")" | formula ("<" | ">") formula {("<" | ">") formula}

Where a reader could take "nothing" for something else than a product (a/b c, x(y + 1), sin x y,
x^2y) the formula is refused with both ways to write it. Recursion is at_most by `limits.depth`.
"""

from __future__ import annotations

import itertools
from contextlib import suppress

from inverse_service.errors import InputError
from inverse_service.expressions.checked import product, raised, reciprocal, sum_of
from inverse_service.expressions.names import Names
from inverse_service.expressions.operands import OperandParser
from inverse_service.expressions.pieces import either, piecewise, step
from inverse_service.expressions.tokens import END, LIMITS, Token, TokenStream, refusal, shorten, unexpected
from inverse_service.expressions.tree import (
    MINUS_ONE,
    ONE,
    Acceleration,
    Expression,
    Symbol,
    Velocity,
    multiply,
    number,
)
from inverse_service.expressions.vocabulary import FUNCTIONS, PIECEWISE, call

_OPERAND = "a number, a name or '('"


class FormulaParser(OperandParser):
    """Reads one formula from a stream of tokens."""

    __slots__ = ()

    def formula(self) -> Expression:
        """The whole stream as one formula; InputError where anything is left over."""
        result = self._expression()
        rest = self._stream.ahead
        if rest.kind == "end":
            return result
        if rest.is_operator("=", ";"):
            raise refusal("an equation occurs where a formula is expected", rest.column, "write one side only")
        if rest.is_operator("[", "]"):
            raise refusal("square brackets are not accepted here", rest.column, "write ( and )")
        if rest.is_operator("<", ">"):
            raise refusal("a comparison occurs", rest.column, "write an equation with one =")
        if rest.is_operator(","):
            raise refusal("a comma occurs outside a function", rest.column, "write a decimal point, or * for a product")
        raise unexpected(rest, END)

    def _expression(self) -> Expression:
        column = self._stream.ahead.column
        with self._stream.nested():
            terms = [self._term()]
            while self._stream.ahead.is_operator("+", "-"):
                terms.append(self._term())
        return sum_of(terms, column)

    def _term(self) -> Expression:
        column = self._stream.ahead.column
        factors = [*self._signs(), self._factor()]
        operation: str | None = "*"
        while (operation := self._operation(operation)) is not None:
            factors += self._signs() if operation else []
            place = self._stream.ahead.column
            factor = self._factor()
            factors.append(reciprocal(factor, place) if operation == "/" else factor)
        return product(factors, column)

    def _signs(self) -> list[Expression]:
        negative = False
        while token := self._stream.take_operator("+", "-"):
            negative ^= token.text == "-"
        return [MINUS_ONE] if negative else []

    def _operation(self, previous: str | None) -> str | None:
        """'*', '/', '' for a product without sign, None where the term ends."""
        token = self._stream.take_operator("*", "/")
        if token:
            return token.text
        if not self._continues(self._stream.ahead):
            return None
        self._check_adjacent(after_division=previous == "/")
        return ""

    def _continues(self, token: Token) -> bool:
        """Whether a further factor begins; inside | … a bar ends it."""
        return _starts_factor(token) or (token.is_operator("|") and not self._bars)

    def _check_adjacent(self, after_division: bool) -> None:
        ahead, column = self._stream.ahead, self._stream.ahead.column
        if ahead.is_operator("(") and self._stream.look(3).kind == "end" and self._stream.look(1).kind == "number":
            shown = f"({shorten(self._stream.look(1).text)})"
            raise refusal(f"{shown} could be an equation number", column, "leave it out, or write * before a factor")
        if ahead.kind == "number":
            raise refusal("a number follows a factor", column, "write * before a factor or ^ before a power")
        if self._time_in_brackets():
            raise refusal("(t) could be an argument or a factor", column, "write *t for a product")
        if after_division:
            raise self._unclear_quotient(column)
        last, before = self._stream.look(-1), self._stream.look(-2)
        if before.is_operator("-"):
            before = self._stream.look(-3)
        if last.kind == "number" and before.is_operator("^") and not ahead.space_before:
            raise refusal("where the power ends is not clear", column, "write x^2*y or x^(2*y)")

    def _unclear_quotient(self, column: int) -> InputError:
        """The refusal of a/b c, with both readings where what follows can be read."""
        stream, place = self._stream, self._stream.position
        said = ("what is divided is not clear", column, "write (a/b)*c or a/(b*c)")
        start, bar = self._quotient_before()
        rest = self._source_of_factors(place)
        over, under = stream.source(start, bar), stream.source(bar + 1, place)
        if rest is None or "|" in over + under:
            return refusal(*said)
        span = (stream.look(start - stream.position).column, stream.ahead.column)
        return refusal(*said, (f"({over}/{under})*{rest}", f"{over}/({under}*{rest})"), span)

    def _quotient_before(self) -> tuple[int, int]:
        """The positions at which the term begins and its last / stands."""
        distance = depth = slash = 0
        while (before := self._stream.look(distance - 1)).kind != "end":
            depth += before.is_operator(")") - before.is_operator("(")
            if depth < 0 or (depth == 0 and before.is_operator("+", "-", ",", "=")):
                break
            distance -= 1
            slash = slash or distance * (depth == 0 and before.is_operator("/"))
        return self._stream.position + distance, self._stream.position + slash

    def _factor(self) -> Expression:
        base = self._base()
        ahead = self._stream.ahead
        if ahead.kind == "prime":
            instead = "only a coordinate or a declared function takes a prime; write diff(u, x) for other derivatives"
            raise refusal("a prime occurs", ahead.column, instead)
        if not self._stream.take_operator("^"):
            return base
        exponent, slash = self._exponent(), self._stream.ahead
        if self._stream.look(-1).text == "1" and slash.is_operator("/") and self._stream.look(1).kind == "number":
            raise refusal("where the power ends is not clear", slash.column, "write x^(1/2) for a root, or x/2")
        found = raised(base, exponent, ahead.column)
        if isinstance(base, Velocity | Acceleration) or base in [Symbol(name) for name in self._names.coordinates]:
            self._skip_time_argument()  # x^2(t) is the square of x(t)
        return found

    def _exponent(self) -> Expression:
        column = self._stream.ahead.column
        with self._stream.nested():
            factors = [*self._signs(), self._factor()]
        return product(factors, column)

    def _base(self) -> Expression:
        token = self._stream.take()
        if token.kind == "number":
            return number(token.value)
        if token.kind == "name":
            return self._name(token)
        if token.is_operator("|"):
            return call("abs", self._until(token, "|", 1), token.column)
        if token.is_operator("\u2202"):
            raise refusal("a partial derivative occurs", token.column, "write diff(A(x, y), x), A declared")
        if not token.is_operator("("):
            raise unexpected(token, _OPERAND)
        return self._until(token, ")", 1)[0]

    def _arguments(self) -> list[Expression]:
        return self._until(self._stream.take(), ")", LIMITS.tokens)

    def _until(self, opening: Token, closing: str, most: int) -> list[Expression]:
        """At most so many formulas, separated by commas, and what closes them."""
        bars, self._bars = self._bars, int(closing == "|")
        found = [self._expression()]
        while len(found) < most and self._stream.take_operator(","):
            found.append(self._expression())
        self._stream.close(opening, closing)
        self._bars = bars
        return found

    def _piecewise(self, token: Token) -> Expression:
        """The pieces in brackets, each (formula, condition)."""
        pieces: list[tuple[Expression, Expression]] = []
        opening = self._opening()
        while not pieces or self._stream.take_operator(","):
            bracket = self._opening()
            with self._stream.nested():
                value = self._within(0)
                comma = self._stream.take()
                if not comma.is_operator(","):
                    raise unexpected(comma, "a comma, and the condition of the piece,")
                pieces.append((value, self._condition()))
            self._stream.close(bracket)
        self._stream.close(opening)
        return piecewise(pieces, token.column)

    def _opening(self) -> Token:
        opening = self._stream.take()
        if not opening.is_operator("("):
            raise unexpected(opening, "a piece such as (x^2, x > 0)")
        return opening

    def _within(self, bars: int) -> Expression:
        """A formula; with `bars` a | ends it."""
        outer, self._bars = self._bars, bars
        found = self._expression()
        self._bars = outer
        return found

    def _condition(self) -> Expression:
        with self._stream.nested():
            found = self._both()
            while self._stream.take_operator("|"):
                found = either(found, self._both())
        return found

    def _both(self) -> Expression:
        found = self._one_condition()
        while self._stream.take_operator("&"):
            found = found * self._one_condition()
        return found

    def _one_condition(self) -> Expression:
        if self._stream.take_operator("true"):
            return ONE
        if self._stream.take_operator("~"):
            with self._stream.nested():
                return 1 - self._one_condition()
        if self._stream.ahead.is_operator("(") and self._compares():
            opening = self._stream.take()
            found = self._condition()
            self._stream.close(opening)
            return found
        return self._inequality()

    def _compares(self) -> bool:
        """Whether a condition, and no formula, stands in the bracket ahead."""
        return any(token.is_operator("<", ">", "~", "&", "true") for token in self._stream.group())

    def _inequality(self) -> Expression:
        """u > w, or a chain 0 < x < 1."""
        left, found = self._within(1), []
        while token := self._stream.take_operator("<", ">"):
            right = self._within(1)
            found.append(step(left - right if token.text == ">" else right - left, token.column))
            left = right
        if not found:
            raise unexpected(self._stream.ahead, "an inequality such as x > 0, or true,")
        return multiply(*found)

    def _elementary(self, token: Token) -> Expression:
        if token.text in PIECEWISE:
            return self._piecewise(token)
        exponent = self._function_power(token)
        if self._stream.ahead.is_operator("("):
            result = call(token.text, self._arguments(), token.column)
        else:
            result = call(token.text, [self._bare_argument(token)], token.column)
        return raised(result, exponent, token.column) if exponent else result

    def _function_power(self, token: Token) -> Expression | None:
        """The 2 of sin^2 x; sin^-1 is refused, it is asin to some and 1/sin to others."""
        if not (caret := self._stream.take_operator("^")):
            return None
        sign = next(k for k in itertools.count() if not self._stream.look(k).is_operator("("))
        if self._stream.look(sign).is_operator("-") and (sign < 2 or self._stream.look(sign + 1).value == 1):
            raise self._unclear_inverse(token, caret, sign)
        return self._base()

    def _unclear_inverse(self, token: Token, caret: Token, sign: int) -> InputError:
        """The refusal of sin^-1, with both readings where its argument can be read."""
        stream, name = self._stream, token.text
        said = (f"{name}^(-1) has two meanings", caret.column, f"write 1/{name}(x) or the inverse function")
        is_one = stream.look(sign + 1).value == 1
        stream.position += sign + 2
        while stream.take_operator(")") and sign:
            sign -= 1
        place = stream.position
        with suppress(InputError):
            self._factor()
        argument = stream.source(place, stream.position)
        if not argument or sign or not is_one or f"a{name}" not in FUNCTIONS:
            return refusal(*said)
        called = argument if argument.startswith("(") else f"({argument})"
        return refusal(*said, (f"a{name}{called}", f"{name}{called}^(-1)"), (token.column, stream.ahead.column))

    def _bare_argument(self, token: Token) -> Expression:
        """The argument of sin x, sin 2x, sin x^2; refused where it could go on."""
        ahead = self._stream.ahead
        barred = ahead.is_operator("|") and not self._bars
        if ahead.kind not in ("number", "name") and not barred:
            raise unexpected(ahead, f"the argument of {token.text} in brackets")
        start = self._stream.position
        with self._stream.nested():
            argument = self._factor()
            following = self._stream.ahead
            if ahead.kind == "number" and _starts_factor(following) and not self._bare_ends():
                if following.space_before or token.text in ("sqrt", "cbrt"):
                    raise self._unclear_end(token, start)
                argument = product([argument, self._factor()], ahead.column)
        after, of_number = self._stream.ahead, ahead.kind == "number" and self._stream.position == start + 1
        signs = ("/", "*") if of_number else ("/",)  # sin 2*x is sin(2*x) to most
        if after.is_operator(*signs) or (_starts_factor(after) and not self._bare_ends()):
            raise self._unclear_end(token, start)
        return argument

    def _unclear_end(self, token: Token, start: int) -> InputError:
        """The refusal of sin a b and sin a/b, with both readings where what follows can be read; sin 2 x has one."""
        stream, end, name = self._stream, self._stream.position, token.text
        said = (f"where the argument of {name} ends is not clear", stream.ahead.column, f"write {name}( and )")
        written = stream.take_operator("/", "*")
        sign, place = written.text if written else "*", stream.position
        if (rest := self._source_of_factors(place)) is None:
            return refusal(*said)
        inner, first = stream.source(start, end), stream.look(start - stream.position)
        separate = (f"({inner}){sign}{rest}",) * (
            first.kind != "number" or written is not None or name in ("sqrt", "cbrt")
        )
        span = (first.column, stream.ahead.column)
        return refusal(*said, (*separate, f"({inner}{sign}{rest})"), span)

    def _source_of_factors(self, place: int) -> str | None:
        """What can be read as factors from this position on, which is passed; None where it cannot be read."""
        try:
            while self._continues(self._stream.ahead):
                self._factor()
        except InputError:
            return None
        found = self._stream.source(place, self._stream.position)
        return found if found and "|" not in found else None

    def _bare_ends(self) -> bool:
        """Whether a bare argument ends here: before an operator, another function or a velocity."""
        ahead = self._stream.ahead
        if ahead.kind != "name":
            return not ahead.is_operator("(") and ahead.kind != "number"
        name = self._names.spelling(ahead.text)
        if self._names.role(name) == "coordinate":
            return self._stream.look(1).kind == "prime"
        undeclared = self._names.role(name) is None
        return undeclared and (name in FUNCTIONS or self._names.derivative(name) is not None)


def _starts_factor(token: Token) -> bool:
    return token.kind in ("number", "name") or token.is_operator("(")


def parse_tokens(tokens: list[Token], end_column: int, names: Names) -> Expression:
    """The formula that the tokens spell; `end_column` is named where something is missing at the end."""
    try:
        return FormulaParser(TokenStream(tokens, end_column), names).formula()
    except RecursionError:  # the depth limit leaves ample room unless the caller is itself very deep
        raise refusal("the formula is nested too deeply", 1, "write less") from None
