"""The grammar of formulas over tokens: precedence, products without sign, functions, derivatives.

    formula    = term {("+" | "-") term}
    term       = signs factor {("*" signs | "/" signs | nothing) factor}
    factor     = base ["^" signs factor]                      right associative, tighter than a sign
    base       = number | "(" formula ")" | name | name primes | function
    function   = name ["^" base] ( "(" formula {"," formula} ")" | [number] factor )

Where a reader could take "nothing" for something else than a product (a/b c, x(y + 1), sin x y,
x^2y) the formula is refused with both ways to write it. Recursion is bounded by `limits.depth`.
"""

from __future__ import annotations

from inverse_service.errors import InputError
from inverse_service.expressions.checked import product, raised, reciprocal, sum_of
from inverse_service.expressions.derivative_calls import Variable, carry_out
from inverse_service.expressions.names import Names, unknown_name
from inverse_service.expressions.tokens import Token, TokenStream, refusal, unexpected
from inverse_service.expressions.tree import (
    MINUS_ONE,
    ONE,
    PI,
    TIME,
    Acceleration,
    Apply,
    Arbitrary,
    Expression,
    Symbol,
    Velocity,
    number,
)
from inverse_service.expressions.vocabulary import DERIVATIVE_NAMES, FUNCTIONS, call

_OPERAND = "a number, a name or '('"


class FormulaParser:
    """Reads one formula from a stream of tokens."""

    __slots__ = ("_limits", "_names", "_stream")

    def __init__(self, stream: TokenStream, names: Names) -> None:
        self._stream = stream
        self._names = names
        self._limits = stream.limits

    def formula(self) -> Expression:
        """The whole stream as one formula; InputError where anything is left over."""
        result = self._expression()
        rest = self._stream.ahead
        if rest.kind == "end":
            return result
        if rest.is_operator("=", ";"):
            raise refusal("an equation stands where a formula is expected", rest.column, "write one side only")
        if rest.is_operator("[", "]"):
            raise refusal("square brackets are not accepted here", rest.column, "write ( and )")
        if rest.is_operator(","):
            raise refusal("a comma stands outside a function", rest.column, "write a decimal point, or a product with *")
        raise unexpected(rest, "an operator or the end")

    def _expression(self) -> Expression:
        column = self._stream.ahead.column
        with self._stream.nested():
            terms = [self._term()]
            while self._stream.ahead.is_operator("+", "-"):
                terms.append(self._term())
        return sum_of(terms, column, self._limits)

    def _term(self) -> Expression:
        column = self._stream.ahead.column
        factors = [*self._signs(), self._factor()]
        operation: str | None = "*"
        while (operation := self._operation(operation)) is not None:
            factors += self._signs() if operation else []
            place = self._stream.ahead.column
            factor = self._factor()
            factors.append(reciprocal(factor, place) if operation == "/" else factor)
        return product(factors, column, self._limits)

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
        if not _starts_factor(self._stream.ahead):
            return None
        self._check_adjacent(after_division=previous == "/")
        return ""

    def _check_adjacent(self, after_division: bool) -> None:
        ahead, column = self._stream.ahead, self._stream.ahead.column
        if ahead.kind == "number":
            raise refusal("a number follows a factor", column, "write * before a factor or ^ before a power")
        if after_division:
            raise refusal("what is divided is not clear", column, "write (a/b)*c or a/(b*c)")
        last, before = self._stream.look(-1), self._stream.look(-2)
        raised_number = before.is_operator("^") or before.is_operator("-") and self._stream.look(-3).is_operator("^")
        if last.kind == "number" and raised_number and not ahead.space_before:
            raise refusal("where the power ends is not clear", column, "write x^2*y or x^(2*y)")

    def _factor(self) -> Expression:
        base = self._base()
        ahead = self._stream.ahead
        if ahead.kind == "prime":
            instead = "only a coordinate or a declared function takes a prime; write diff(u, x) for other derivatives"
            raise refusal("a prime stands", ahead.column, instead)
        if not self._stream.take_operator("^"):
            return base
        return raised(base, self._exponent(), ahead.column, self._limits)

    def _exponent(self) -> Expression:
        column = self._stream.ahead.column
        with self._stream.nested():
            factors = [*self._signs(), self._factor()]
        return product(factors, column, self._limits)

    def _base(self) -> Expression:
        token = self._stream.take()
        if token.kind == "number":
            return number(token.value)
        if token.kind == "name":
            return self._name(token)
        if not token.is_operator("("):
            raise unexpected(token, _OPERAND)
        inner = self._expression()
        self._stream.close(token)
        return inner

    def _name(self, token: Token) -> Expression:
        name = self._names.spelling(token.text)
        match self._names.role(name):
            case "coordinate":
                return self._coordinate(name, 0, token)
            case "parameter":
                return self._single(Symbol(name), token)
            case "function":
                return self._arbitrary(name, token)
        if name in DERIVATIVE_NAMES:
            return self._derivative(token)
        if name in FUNCTIONS:
            return self._elementary(token)
        return self._constant(name, token)

    def _constant(self, name: str, token: Token) -> Expression:
        if name == "pi":
            return self._single(PI, token)
        if name in ("e", "E"):
            return self._single(Apply("exp", ONE), token)
        if name == "t" and self._names.time:
            return self._single(TIME, token)
        if name == "t":
            raise refusal("the time t is not accepted here; it stands", token.column, "leave it out")
        dotted = self._names.derivative(name)
        if dotted:
            return self._coordinate(*dotted, token)
        raise unknown_name(token.text, self._names, token.column, self._stream.ahead.text)

    def _single(self, node: Expression, token: Token) -> Expression:
        """A name that stands alone; InputError where a bracket makes it look like a function."""
        ahead = self._stream.ahead
        if ahead.is_operator("(") and not ahead.space_before:
            name = token.text
            raise refusal(f"{name}( could be a product or a function", ahead.column, f"write {name}*( for a product")
        if ahead.kind == "prime":
            raise refusal(f"{token.text} has no derivative in time; a prime stands", ahead.column, "leave it out")
        return node

    def _coordinate(self, name: str, order: int, token: Token) -> Expression:
        order += self._primes()
        if order > 2:
            raise refusal("a third derivative stands", token.column, "write equations of second order")
        self._skip_time_argument()
        ahead = self._stream.ahead
        if ahead.is_operator("(") and ahead.space_before and self._group_has_time():
            raise refusal(f"{name} ( could be a product or a function of time", ahead.column, f"write {name}*(")
        node = (Symbol(name), Velocity(name), Acceleration(name))[order]
        return node if ahead.kind == "prime" else self._single(node, token)

    def _primes(self) -> int:
        order = 0
        while self._stream.ahead.kind == "prime":
            order += int(self._stream.take().value)
        return order

    def _skip_time_argument(self) -> None:
        look = self._stream.look
        if look(0).is_operator("(") and look(1).text == "t" and look(2).is_operator(")"):
            self._stream.position += 3

    def _group_has_time(self) -> bool:
        distance, open_groups = 0, 0
        while self._stream.look(distance).kind != "end":
            token = self._stream.look(distance)
            open_groups += token.is_operator("(") - token.is_operator(")")
            if token.kind == "name" and token.text == "t":
                return True
            if open_groups == 0:
                return False
            distance += 1
        return False

    def _arbitrary(self, name: str, token: Token) -> Expression:
        declared = self._names.functions[name]
        orders = self._orders(name, len(declared))
        if sum(orders) > self._limits.derivative_order:
            raise refusal(f"a derivative of {name} is too high", token.column, f"use at most {self._limits.derivative_order}")
        if not self._stream.ahead.is_operator("("):
            return Arbitrary(name, tuple(Symbol(argument) for argument in declared), orders)
        arguments = self._arguments()
        if len(arguments) != len(declared):
            wanted = f"{name}({', '.join(declared)})"
            raise refusal(f"{name} has {len(arguments)} arguments", token.column, f"write {len(declared)}, as in {wanted}")
        return Arbitrary(name, tuple(arguments), orders)

    def _orders(self, name: str, count: int) -> tuple[int, ...]:
        """The orders of A'' (one argument) or A[1,0] (one number for each argument)."""
        column = self._stream.ahead.column
        primes = self._primes()
        if primes and count != 1:
            raise refusal(f"{name} has {count} arguments and a prime stands", column, f"write diff({name}, x)")
        opening = self._stream.take_operator("[")
        if not opening:
            return (primes,) if count == 1 else (0,) * count
        orders = [self._order()]
        while self._stream.take_operator(","):
            orders.append(self._order())
        self._stream.close(opening, "]")
        if primes or len(orders) != count:
            raise refusal(f"the orders of {name} do not fit", column, f"write {count} numbers in the brackets, no prime")
        return tuple(orders)

    def _order(self) -> int:
        token = self._stream.take()
        if token.kind != "number" or token.value.denominator != 1:
            raise unexpected(token, "the order of a derivative, a whole number,")
        if token.value > self._limits.derivative_order:
            raise refusal("a derivative is too high", token.column, f"use at most {self._limits.derivative_order}")
        return int(token.value)

    def _arguments(self) -> list[Expression]:
        opening = self._stream.take()
        arguments = [self._expression()]
        while self._stream.take_operator(","):
            arguments.append(self._expression())
        self._stream.close(opening)
        return arguments

    def _elementary(self, token: Token) -> Expression:
        exponent = self._function_power(token)
        if self._stream.ahead.is_operator("("):
            result = call(token.text, self._arguments(), token.column)
        else:
            result = call(token.text, [self._bare_argument(token)], token.column)
        return raised(result, exponent, token.column, self._limits) if exponent else result

    def _function_power(self, token: Token) -> Expression | None:
        """The 2 of sin^2 x; sin^-1 is refused, it is asin to some and 1/sin to others."""
        if not (caret := self._stream.take_operator("^")):
            return None
        if self._stream.ahead.is_operator("-") or self._stream.look(1).is_operator("-"):
            name = token.text
            raise refusal(f"{name}^(-1) has two meanings", caret.column, f"write 1/{name}(x) or the inverse function")
        return self._base()

    def _bare_argument(self, token: Token) -> Expression:
        """The argument of sin x, sin 2x, sin x^2; refused where it could go on."""
        ahead = self._stream.ahead
        if ahead.kind not in ("number", "name"):
            raise unexpected(ahead, f"the argument of {token.text} in brackets")
        with self._stream.nested():
            argument = self._factor()
            if ahead.kind == "number" and not self._bare_ends():
                argument = product([argument, self._factor()], ahead.column, self._limits)
        after = self._stream.ahead
        if after.is_operator("/") or _starts_factor(after) and not self._bare_ends():
            name = token.text
            raise refusal(f"where the argument of {name} ends is not clear", after.column, f"write {name}( and )")
        return argument

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

    def _derivative(self, token: Token) -> Expression:
        """diff(u, x), diff(u, x, 2), diff(u, x, y), Derivative(u, (t, 2))."""
        opening = self._stream.take()
        if not opening.is_operator("("):
            raise unexpected(opening, f"'(' after {token.text}")
        expression = self._expression()
        variables: list[Variable] = []
        while self._stream.take_operator(","):
            variables.append(self._variable())
        self._stream.close(opening)
        if not variables:
            raise refusal(f"{token.text} has no variable", token.column, f"write {token.text}(x, t)")
        return carry_out(expression, variables, self._names, self._limits)

    def _variable(self) -> Variable:
        opening = self._stream.take_operator("(")
        token = self._stream.take()
        node = self._variable_node(token)
        times = 1
        if self._stream.ahead.is_operator(",") and (opening or self._stream.look(1).kind == "number"):
            self._stream.take()
            times = self._order()
        if opening:
            self._stream.close(opening)
        return Variable(node, times, token.column)

    def _variable_node(self, token: Token) -> Expression:
        if token.kind != "name":
            raise unexpected(token, "the variable of the derivative, a name,")
        if token.text == "t":
            return TIME
        name = self._names.spelling(token.text)
        match self._names.role(name):
            case "coordinate":
                return self._coordinate(name, 0, token)
            case "parameter":
                return Symbol(name)
            case "function":
                raise refusal("a derivative by a function stands", token.column, "differentiate by a coordinate")
        dotted = self._names.derivative(name)
        if dotted:
            return self._coordinate(*dotted, token)
        raise unknown_name(token.text, self._names, token.column)


def _starts_factor(token: Token) -> bool:
    return token.kind in ("number", "name") or token.is_operator("(")


def parse_tokens(tokens: list[Token], end_column: int, names: Names) -> Expression:
    """The formula that the tokens spell; `end_column` is named where something is missing at the end."""
    try:
        return FormulaParser(TokenStream(tokens, end_column), names).formula()
    except RecursionError:  # the depth limit leaves ample room unless the caller is itself very deep
        raise InputError("the formula is nested too deeply at column 1: write less.", column=1) from None
