r"""Derivatives written as fractions: \frac{dx}{dt}, \frac{\partial V}{\partial x}, \frac{d}{dt}\left( … \right)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from fractions import Fraction

from inverse_service.expressions.latex_scanner import Raw
from inverse_service.expressions.latex_words import LatexWords, open_brackets, role_before, time_argument
from inverse_service.expressions.names import Names
from inverse_service.expressions.tokens import LETTER_COMMANDS, LIMITS, Token, at_most, refusal


class LatexDerivatives(LatexWords, ABC):
    """What is translated so far, and how derivatives are; everything else is the business of the translator."""

    __slots__ = ("_depth", "_tokens")

    def __init__(self, raw: list[Raw], names: Names) -> None:
        super().__init__(raw, names)
        self._depth = 0
        self._tokens: list[Token] = []

    @abstractmethod
    def _one(self) -> None:
        """Translate what comes next."""

    def _emit(self, text: str, raw: Raw, space: bool | None = None) -> None:
        self._tokens.append(Token("operator", text, raw.column, raw.space_before if space is None else space))

    def _emit_name(self, name: str, raw: Raw, order: int = 0) -> None:
        at_most(len(name), LIMITS.name_characters, "a name has too many characters", raw.column)
        self._tokens.append(Token("name", name, raw.column, raw.space_before))
        if order:
            self._tokens.append(Token("prime", "'" * order, raw.column, False, Fraction(order)))

    def _enter(self, raw: Raw) -> None:
        self._depth += 1
        at_most(self._depth, LIMITS.depth, "the formula is nested too deeply", raw.column)

    def _time_derivative(self, raw: Raw) -> bool:
        """\\frac{dx}{dt} as x', \\frac{\\partial A}{\\partial x} as diff(A, x), A declared; else nothing is taken."""
        start, partial = self._place, self._raw[self._place + 1].is_command("partial")
        name, order, dots = self._derivative_part()
        variables = self._variables_part() if name else []
        declared = self._names.role(self._names.spelling(name)) in ("function", "parameter")
        if 0 < order == len(variables) and declared and not (partial and "t" in variables):
            if self._ahead.is_character("(") or self._ahead.is_command("left"):
                instead = f"write {name}'({variables[0]}), or \\cdot before a factor"
                raise refusal("a bracket follows a derivative", self._ahead.column, instead)
            self._emit_call(raw, name, *variables)
        elif 0 < order == len(variables) and {*variables} == {"t"} and not partial:
            self._emit_name(name, raw, order + dots)
        elif 0 < order == len(variables) and "t" not in variables and (partial or not self._names.role("d")):
            what, instead = f"a derivative of {name} by {variables[0]} occurs", f"write {name}'({variables[0]})"
            raise refusal(what, raw.column, instead, declare="functions")
        else:
            self._place = start
            return False
        return True

    def _emit_call(self, raw: Raw, *names: str) -> None:
        """diff(A, x) for \\frac{\\partial A}{\\partial x}, A a declared function."""
        self._emit_name("diff", raw)
        for separator, name in zip("(" + "," * len(names), names, strict=False):
            self._emit(separator, raw, space=False)
            self._emit_name(name, raw)
        self._emit(")", raw)

    def _derivative_operator(self, raw: Raw) -> bool:
        """\\frac{d}{dt} and \\frac{d^{2}}{dx dy} before an operand: taken as diff(u, t); else nothing is taken."""
        start, partial = self._place, self._raw[self._place + 1].is_command("partial")
        order = self._operator_part()
        variables = self._variables_part() if order else []
        if order < 1 or len(variables) != order or self._ahead.kind == "end":
            self._place = start
            return False
        operand = self._place
        self._emit_name("diff", raw)
        self._emit("(", raw, space=False)
        self._operand()
        if partial and "t" in variables and not any(map(self._time_argument_at, range(operand, self._place))):
            instead = "write \\frac{d}{dt}\\left( and \\right) for the derivative along the motion"
            raise refusal("a partial derivative by the time occurs", raw.column, instead)
        self._end_derivative(raw, variables)
        return True

    def _derivative_of_call(self, raw: Raw) -> bool:
        r"""\frac{dV(x)}{dx} as diff(V(x), x); else nothing is taken."""
        start, length = self._place, len(self._tokens)
        self._emit_name("diff", raw)
        self._emit("(", raw, space=False)
        if self._take().is_character("{") and not self._names.role("d") and self._differential():
            order, name = self._small_power(), len(self._tokens)
            is_name = self._ahead.kind == "letter" or self._ahead.is_command(*LETTER_COMMANDS)
            self._piece() if is_name else None
            arguments = self._named_arguments(self._place) if self._is_call(self._place, name) else []
            if arguments and self._application() and self._take().is_character("}"):
                variables = self._variables_part()
                if len(variables) == order and {*variables} <= {*arguments} - {"t"}:
                    self._end_derivative(raw, variables)
                    return True
        self._place = start
        del self._tokens[length:]
        return False

    def _end_derivative(self, raw: Raw, variables: list[str]) -> None:
        for variable in variables:
            self._emit(",", raw)
            self._emit_name(variable, raw)
        self._emit(")", raw)

    def _is_call(self, place: int, start: int = 0) -> bool:
        """Whether names alone stand in the brackets at a place, after a name of a function or of nothing yet."""
        last = len(self._tokens) - 1
        while last > start and self._tokens[last].kind == "prime":
            last -= 1
        if last < start or self._tokens[last].kind != "name" or not all(self._named_arguments(place) or [""]):
            return False
        return role_before(self._tokens, self._names) in ("function", None)

    def _refuse_differentials(self, raw: Raw) -> None:
        """InputError for \\frac{dV(x)}{dx}, whose d would be a factor of both; d is one where it is declared."""
        start, depth = self._place, 1
        partial = self._raw[start + 1].is_command("partial")
        differential = not partial and self._take().is_character("{") and self._differential()
        if differential and not self._names.role("d") and not self._ahead.is_character("}"):
            while depth and self._ahead.kind != "end":
                piece = self._take()
                depth += piece.is_character("{") - piece.is_character("}")
            if variables := self._variables_part():
                instead = f"write \\frac{{d}}{{d{variables[0]}}}\\left( and \\right)"
                raise refusal(f"a derivative by {variables[0]} occurs", raw.column, instead)
        self._place = start

    def _time_argument_at(self, place: int) -> int:
        return time_argument(self._raw[place : place + 7])

    def _operand(self) -> None:
        """A bracket, or one piece with its arguments, or one piece that nothing follows."""
        start = len(self._tokens)
        self._enter(self._ahead)
        self._piece()
        bracket = self._tokens[start:] and self._tokens[start].is_operator("(")
        arguments = not bracket and self._application()
        self._depth -= 1
        if self._ahead.is_character("^") or not (bracket or self._ends_a_term() or (arguments and self._multiplies())):
            instead = "write \\left( and \\right) around what is differentiated"
            raise refusal("where the derivative ends is not clear", self._ahead.column, instead)

    def _application(self) -> bool:
        """The (t) of a coordinate is left out, the arguments of a declared function are translated."""
        if pieces := self._time_argument_at(self._place):
            self._place += pieces
            return True
        group = self._ahead.is_character("{") and self._raw[self._place + 1].is_command("left")
        opens = group or self._ahead.is_character("(") or self._ahead.is_command("left")
        if opens and (role_before(self._tokens, self._names) == "function" or self._is_call(self._place)):
            self._piece()
            return True
        return False

    def _piece(self) -> None:
        """What comes next, up to its last bracket."""
        balance, started = 0, False
        while (balance > 0 or not started) and self._ahead.kind != "end":
            place, started = len(self._tokens), True
            self._one()
            balance += open_brackets(self._tokens[place:])

    def _multiplies(self) -> bool:
        """Whether a sign of a product follows, or a further derivative: sin x after d/dt x(t) may belong to it."""
        bracket = self._ahead.is_command("left") and self._raw[self._place + 1].is_character("(")
        place = self._place + 2 * bracket
        fraction = [raw.text for raw in self._raw[place : place + 3]]
        derivative = fraction[:2] == ["frac", "{"] and fraction[2:] in (["d"], ["partial"], ["mathrm"])
        return derivative or self._ahead.is_command("cdot", "times", "ast", "div") or self._ahead.is_character("*", "/")

    def _ends_a_term(self) -> bool:
        ahead = self._ahead
        return ahead.kind == "end" or ahead.is_character(*"+-=,;)]}.") or ahead.is_command("\\", "right")
