"""The names in a formula: coordinates and their derivatives, parameters, declared functions, diff(…)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from inverse_service.errors import InputError
from inverse_service.expressions.checked import check_depth, raised
from inverse_service.expressions.derivative import differentiate, differentiate_in_time
from inverse_service.expressions.names import Names, unknown_name
from inverse_service.expressions.tokens import (
    FACTOR,
    LIMITS,
    Token,
    TokenStream,
    at_most,
    refusal,
    shorten,
    unexpected,
)
from inverse_service.expressions.tree import (
    ONE,
    PI,
    TIME,
    Acceleration,
    Apply,
    Arbitrary,
    Expression,
    Symbol,
    Velocity,
    node_count,
    number,
    substitute,
)
from inverse_service.expressions.vocabulary import DERIVATIVE_NAMES, FUNCTIONS


@dataclass(frozen=True, slots=True)
class Variable:
    """What is differentiated by, how many times, and where that stands."""

    node: Expression
    times: int
    column: int


def carry_out(expression: Expression, variables: Sequence[Variable], names: Names) -> Expression:
    """The derivative; by t it is the one along the motion (x -> x' -> x''), else a partial one."""
    order = sum(variable.times for variable in variables)
    at_most(order, LIMITS.derivative_order, "a derivative is too high", variables[0].column)
    expression = _defined(expression, variables, names)
    for variable in variables:
        for _ in range(variable.times):
            expression = _once(expression, variable, names)
    return expression


def _defined(expression: Expression, variables: Sequence[Variable], names: Names) -> Expression:
    """What is differentiated with the formulas of its names; InputError for the derivative of a constant."""
    for variable in variables:
        if isinstance(variable.node, Symbol) and variable.node in names.definitions:
            what = f"a derivative by {variable.node.name} occurs, which stands for a formula"
            raise refusal(what, variable.column, "differentiate by a coordinate")
    others = {*names.definitions, *(variable.node for variable in variables)}
    if isinstance(expression, Symbol) and expression.name in names.parameters and expression not in others:
        what = f"a derivative of the constant {expression.name} occurs"
        raise refusal(what, variables[0].column, "leave it out", declare="functions")
    return substitute(expression, dict(names.definitions)) if names.definitions else expression


def _once(expression: Expression, variable: Variable, names: Names) -> Expression:
    nodes = node_count(expression)
    at_most(nodes, LIMITS.derivative_nodes, "the formula to differentiate is too large", variable.column)
    if variable.node != TIME:
        result = differentiate(expression, variable.node)
    else:
        result = _along_motion(expression, variable, names)
    return check_depth(result, variable.column)


def _refuse_two_meanings(function: Arbitrary, column: int) -> None:
    """InputError for the derivative of V(t, x) by t: the partial one to some, that along the motion to others."""
    if TIME not in function.arguments or len(function.arguments) == 1:
        return
    orders = ",".join(str(int(argument == TIME)) for argument in function.arguments)
    arguments = ", ".join(node.name for node in function.arguments if isinstance(node, Symbol))
    partial = f"{function.name}[{orders}]({arguments})"
    what = f"a derivative of {function.name} by t could be the partial one or the one along the motion; it occurs"
    raise refusal(what, column, f"write {partial} for the partial one, and with the other terms for the other")


def _along_motion(expression: Expression, variable: Variable, names: Names) -> Expression:
    try:
        return differentiate_in_time(expression, names.coordinates)
    except ValueError:
        raise _third(variable.column) from None


OF_SECOND_ORDER = "write equations of second order. Those of a Lagrangian L(t, q, q') have no higher derivatives"


def _third(column: int) -> InputError:
    return refusal("a third derivative occurs", column, OF_SECOND_ORDER)


class OperandParser(ABC):
    """Reads what begins with a name; sums and products are the business of `grammar.py`."""

    __slots__ = ("_bars", "_names", "_stream")

    def __init__(self, stream: TokenStream, names: Names) -> None:
        self._stream = stream
        self._names = names
        self._bars = 0

    @abstractmethod
    def _expression(self) -> Expression:
        """A formula up to the closing bracket or the end."""

    @abstractmethod
    def _exponent(self) -> Expression:
        """What stands after a ^."""

    @abstractmethod
    def _arguments(self) -> list[Expression]:
        """Formulas in brackets, separated by commas."""

    @abstractmethod
    def _elementary(self, token: Token) -> Expression:
        """An elementary function with its argument; its name is taken already."""

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
        if name in ("pi", "Pi"):
            return self._single(PI, token)
        if name in ("e", "E"):
            return self._euler(token)
        if name == "t" and self._names.time:
            return self._single(TIME, token)
        if name == "t":
            raise refusal("the time t is not accepted here; it occurs", token.column, "leave it out")
        dotted = self._names.derivative(name)
        if dotted:
            return self._coordinate(*dotted, token)
        raise unknown_name(token.text, self._names, token.column, self._stream.ahead.text)

    def _euler(self, token: Token) -> Expression:
        """exp(1) where it is raised to a formula; a charge e, or its square, is no number."""
        if not self._stream.ahead.is_operator("^") or self._number_alone():
            name = token.text
            instead = f"write exp(1), exp(2), or declare {name} where it is a name of yours"
            raise refusal(f"{name} is Euler's number only in a power such as {name}^x", token.column, instead)
        return Apply("exp", ONE)

    def _number_alone(self) -> bool:
        """Whether the exponent after the ^ ahead is one number, with signs or brackets about it."""
        distance, depth, numbers = 1, 0, 0
        while True:
            token = self._stream.look(distance)
            depth += token.is_operator("(") - token.is_operator(")")
            numbers += token.kind == "number"
            if token.kind != "number" and not token.is_operator("(", ")", "-", "+"):
                return False
            if depth == 0 and not token.is_operator("-", "+"):
                return numbers == 1
            distance += 1

    def _single(self, node: Expression, token: Token) -> Expression:
        """A name that stands alone; InputError where a bracket makes it look like a function."""
        ahead = self._stream.ahead
        if ahead.is_operator("(") and not ahead.space_before:
            self._stream.must_close()
            name = token.text
            what = f"{name}( could be a product or a function"
            span = (ahead.column, ahead.column + 1)
            raise refusal(what, ahead.column, f"write {name}*( for a product", ("*(",), span)
        if ahead.kind == "prime":
            instead = f"write diff({token.text}, t)" if node in self._names.definitions else "leave it out"
            raise refusal(f"{token.text} has no derivative in time; a prime occurs", ahead.column, instead)
        return node

    def _coordinate(self, name: str, order: int, token: Token) -> Expression:
        order += self._primes()
        if order > 2:
            raise _third(token.column)
        self._skip_time_argument()
        ahead = self._stream.ahead
        touches = self._opens_arguments() and not ahead.space_before
        if touches and self._stream.look(1).kind == "number" and self._stream.look(2).is_operator(")"):
            value = f"{name}({shorten(self._stream.look(1).text)})"
            instead = f"leave initial conditions out, they change no answer; write {name}* for a product"
            raise refusal(f"{value} occurs", token.column, instead)
        if self._opens_arguments() and self._group_has_time():
            gap, of_time = (" ", " of time") if ahead.space_before else ("", "")
            instead = f"write {name}*( for a product; delays are not accepted"
            raise refusal(f"{name}{gap}( could be a product or a function{of_time}", ahead.column, instead)
        node = (Symbol(name), Velocity(name), Acceleration(name))[order]
        return node if ahead.kind == "prime" else self._single(node, token)

    def _primes(self) -> int:
        order = 0
        while self._stream.ahead.kind == "prime":
            order += int(self._stream.take().value)
        return order

    def _opens_arguments(self) -> bool:
        return self._stream.ahead.is_operator("(") and self._stream.ahead.value != FACTOR

    def _skip_time_argument(self) -> None:
        if self._time_in_brackets():
            self._stream.position += 3

    def _time_in_brackets(self) -> bool:
        look = self._stream.look
        return self._opens_arguments() and look(1).text == "t" and look(2).is_operator(")")

    def _group_has_time(self) -> bool:
        open_groups = 0
        for distance, token in enumerate(self._stream.group()):
            open_groups += token.is_operator("(") - token.is_operator(")")
            if token.kind == "name" and token.text == "t" and not self._only_names_time(distance, open_groups):
                return True
        return False

    def _only_names_time(self, distance: int, open_groups: int) -> bool:
        """Whether the t is that of diff(y, t), or of y(t) inside the bracket."""
        before, after = self._stream.look(distance - 1), self._stream.look(distance + 1)
        return before.is_operator(",") or (open_groups > 1 and before.is_operator("(") and after.is_operator(")"))

    def _arbitrary(self, name: str, token: Token) -> Expression:
        declared = self._names.functions[name]
        orders = self._orders(name, len(declared))
        at_most(sum(orders), LIMITS.derivative_order, f"a derivative of {name} is too high", token.column)
        column, exponent = self._stream.ahead.column, None
        if self._stream.take_operator("^"):
            exponent = self._exponent()
        found = self._called(name, declared, orders, token, exponent)
        return found if exponent is None else raised(found, exponent, column)

    def _called(
        self, name: str, declared: tuple[str, ...], orders: tuple[int, ...], token: Token, power: Expression | None
    ) -> Expression:
        """A with the arguments that follow, or with those it is declared with; A^2(x) is the square of A(x)."""
        ahead = self._stream.ahead
        if not self._opens_arguments():
            return Arbitrary(name, tuple(Symbol(argument) for argument in declared), orders)
        if power == number(-1):
            raise refusal(f"{name}^(-1)( has two meanings", ahead.column, f"write 1/{name}( or another function")
        if power is not None and ahead.space_before:
            what = f"a bracket after a power of {name} could be a factor or its arguments"
            raise refusal(what, ahead.column, f"write {name}({', '.join(declared)})^2*( or ({name}( ))^2")
        arguments = self._arguments()
        if len(arguments) != len(declared):
            instead = f"write {len(declared)}, as in {name}({', '.join(declared)})"
            raise refusal(f"{name} has {len(arguments)} arguments", token.column, instead)
        return Arbitrary(name, tuple(arguments), orders)

    def _orders(self, name: str, count: int) -> tuple[int, ...]:
        """The orders of A'' (one argument) or A[1,0] (one number for each argument)."""
        column = self._stream.ahead.column
        primes = self._primes()
        if primes and count != 1:
            raise refusal(f"{name} has {count} arguments and a prime occurs", column, f"write diff({name}, x)")
        opening = self._stream.take_operator("[")
        if not opening:
            return (primes,) if count == 1 else (0,) * count
        orders = [self._order()]
        while self._stream.take_operator(","):
            orders.append(self._order())
        self._stream.close(opening, "]")
        if primes or len(orders) != count:
            instead = f"write {count} in the brackets and no prime"
            raise refusal(f"the number of orders of {name} is wrong", column, instead)
        return tuple(orders)

    def _order(self) -> int:
        token = self._stream.take()
        if token.kind != "number" or token.value.denominator != 1:
            raise unexpected(token, "the order of a derivative, an integer,")
        at_most(token.value, LIMITS.derivative_order, "a derivative is too high", token.column)
        return int(token.value)

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
        if any(variable.node == TIME for variable in variables) and isinstance(expression, Arbitrary):
            _refuse_two_meanings(expression, token.column)
        return carry_out(expression, variables, self._names)

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
                raise refusal("a derivative by a function occurs", token.column, "differentiate by a coordinate")
        dotted = self._names.derivative(name)
        if dotted:
            return self._coordinate(*dotted, token)
        raise unknown_name(token.text, self._names, token.column)
