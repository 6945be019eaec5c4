"""Parse the tokens of a formula: precedence, products without a sign, functions, derivatives.

    formula    = term {("+" | "-") term} term       = signs factor {("*" signs | "/" signs |
    nothing) factor} factor     = base ["^" signs factor]                      right associative,
    tighter than a sign base       = number | "(" formula ")" | "|" formula "|" | name | name primes
    | function function   = name ["^" base] ( "(" formula {"," formula} ")" | [number] factor )
               | "piecewise" "(" piece {"," piece} ")",  piece = "(" formula "," condition ")"
    condition  = both {"|" both},  both = one {"&" one} one        = "~" one | "true" | "("
    condition ")" | formula ("<" | ">") formula {("<" | ">") formula}

If "nothing" may mean something other than a product (a/b c, x(y + 1), sin x y, x^2y), the parser
raises an error that shows both ways to write the formula. `limits.depth` bounds the recursion.
"""

import itertools
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from inverse_service import errors
from inverse_service.expressions import tree as ex
from inverse_service.expressions.pieces import either, piecewise, step
from inverse_service.expressions.refusals import (
    LIMITS,
    at_most,
    fault,
    shorten,
)
from inverse_service.reading import names as nm, operations as op, prose, tokens as tk
from inverse_service.reading.exponents import ExponentParser, is_length, starts_factor
from inverse_service.reading.tokens import Line, Token, Tokens, at, note

_LARGEST_FACTORIAL = 20
_RADII = ("r", "rho")
_NUMBER = re.compile(r"_?\d+$")  # of r_1
_RADIUS = ex.Symbol("r")  # in r/r^3, often a vector and its length
_OPERAND, _PIECE = "a number, a name or '('", "a piece such as (x^2, x > 0)"
_KINETIC = re.compile(
    r"p\w*\^\(?2\)?/2(?!\d)"
)  # of p^2/2m and p_phi^2/2ml^2, which are divided by m
_SQUARE = re.compile(r"1|.+\^\(?2\)?")  # under a root, of which nothing would be left
_OF_ANGLES = frozenset(("sin", "cos", "tan", "cot"))
_OF_HALF_ANGLES = frozenset(("tan", "cot"))
_PHASES = re.compile(r"(?:phi|varphi|psi|delta|alpha|theta)(?:_?\d)?")  # of cos(w t + phi)
_AT_ZERO = re.compile(r"([A-Za-z]+?)_?0")  # theta_0
_FREQUENCY = re.compile(r"(?:w|omega|Omega)(?:_?[0-9a-z])?")
_PERIODS = re.compile(r"(?:T|tau)(?:_?\d)?")  # of cos(t/T)
_LOGARITHMS = frozenset(("log", "ln"))
_HYPERBOLIC = frozenset(("sinh", "cosh", "tanh"))
_INVERTED = _HYPERBOLIC | {"sin", "cos", "tan"}
# sin x^2 is sin(x^2), and its other meaning is noted.
_RAISED_APART = _OF_ANGLES | _LOGARITHMS | _HYPERBOLIC


class FormulaParser(ExponentParser):
    """Parse one formula from a stream of tokens."""

    __slots__ = ("_bars", "_depth", "_end")

    def __init__(self, tokens: Tokens, end_column: int, names: nm.Names) -> None:
        self._end = Token("end", "", end_column)
        super().__init__(tokens, self._end)
        self._names = names
        self._bars = False
        self._depth = 0

    def formula(self) -> ex.Expression:
        """The whole stream as one formula; InputError if any tokens remain."""
        column = self.ahead.column
        result, rest = self._expression(), self.ahead
        if rest.kind == "end":
            return op.check_depth(result, column)
        raise tk.unexpected(rest, tk.END)

    @contextmanager
    def _nested(self) -> Iterator[None]:
        """Enter a nested level, which begins ahead; LimitError past `limits.depth`."""
        self._depth += 1
        at_most(self._depth, LIMITS.depth, "the formula is nested too deeply", self.ahead.column)
        yield
        self._depth -= 1

    @contextmanager
    def _inside(self, bracket: Token) -> Iterator[None]:
        """Parse the entire content of a bracket."""
        if bracket.order:
            raise _prime(bracket)
        outer = self._tokens, self.position, self._bars, self._depth
        self._tokens, self.position, self._bars = (
            [*bracket.inside, Token("end", ")", bracket.end)],
            0,
            False,
        )
        try:
            yield
            if self.ahead.kind != "end":
                raise tk.unexpected(self.ahead, "the closing bracket")
        finally:
            self._tokens, self.position, self._bars, self._depth = outer

    def _expression(self) -> ex.Expression:
        column = self.ahead.column
        with self._nested():
            terms = [self._term()]
            while self.ahead.is_operator("+", "-"):
                terms.append(self._term())
        return op.sum_of(terms, column)

    def _term(self) -> ex.Expression:
        column = self.ahead.column
        signs, start = self._signs(), self.position
        factors, slash = [*signs, self._factor()], start
        operation = "*"
        while (sign := self._operation(operation, start, slash)) is not None:
            below, slash, place = slash, self.position, self.ahead.column
            factors += self._signs() if sign else []
            factor = self._factor()
            if (operation, sign) == ("/", "") and self._tokens[below - 1].is_operator("/"):
                self._note_call_after_quotient(start, below, slash)
            operation = sign
            factors.append(op.reciprocal(factor, place) if sign == "/" else factor)
        if self._tokens[slash - 1].is_operator("/"):
            self._note_sum_after_quotient(start, slash)
        parts = [part for factor in factors for part in ex.factors_of(factor)]
        alone = self._names.coordinates == ("r",) and _RADIUS in parts
        if alone and any(isinstance(part, ex.Power) and part.base == _RADIUS for part in parts):
            note("r", "one number; write the components of a vector, as in x'' = -x/r^3")
        return op.product(factors, column)

    def _signs(self) -> list[ex.Expression]:
        negative = False
        while token := self.take_operator("+", "-"):
            negative ^= token.text == "-"
        return [ex.MINUS_ONE] if negative else []

    def _operation(self, previous: str | None, start: int, slash: int) -> str | None:
        """'*', '/', '' for an implicit product, or None at the end of the term; '/' before the m of
        p^2/2m.

        The term begins at `start`, and `slash` is the place before its last factor, which follows
        the operation `previous`.
        """
        if token := self.take_operator("*", "/"):
            return token.text
        if not self._continues(self.ahead):
            return None
        self._check_adjacent()
        divides = self._tokens[slash - 1].is_operator("/")  # not before the m of k/2m x
        if previous == "/" and not divides and self.ahead.space_before:
            return ""
        if previous == "/" and not self._ends_quotient(start, slash):
            if _KINETIC.match(self.source(start)) and not self.ahead.space_before:
                return "/"
            if self._divides_too(start, slash):
                return "/"
            raise self._unclear_quotient(start, slash)
        return ""

    def _divides_too(self, start: int, slash: int) -> bool:
        """Whether the m of x'^2/2m and k/2m x is below the /, too, which is noted; the w of
        m/2w^2 and the x of k/2x may be behind it.
        """
        ahead, below, after = self.ahead, self.part(slash), self.look(1)
        above = [*tk.walk(self.part(start, slash - 1))]
        letters = [token for token in above if token.kind == "name"]
        letter = ahead.kind == "name" and not (ahead.space_before or ahead.order)
        constant = self._names.role(self._names.spelling(ahead.text)) == "parameter"
        constant = constant and not nm.looks_like_a_coordinate(ahead.text)
        moves = any(map(self._moves, letters))
        lump = len(below) == 1 and below[0].kind == "name" and self._is_lump(below[0])
        raised = after.is_operator("^") and (moves or lump) and self.look(2).kind == "number"
        power = f"^{self.look(2).text}" * raised  # x/2a^2
        after = self.look(3) if raised else after
        ends = after.space_before or not starts_factor(after)
        ends |= after.is_bracket() and any(map(self._moves, after.inside))  # g/2l(x - a)
        single = len(below) == 1 and not after.is_operator("^")
        if (radius := self._radius_below(below, letters)) is not None:
            if self._tokens[slash - 1].is_operator("/"):  # else it is noted before its constants
                place = self.position
                over, under = self.source(start, slash - 1), self.source(slash)
                rest = "*".join(token.text for token in self.part(place, place + radius + 1))
                power = f"{rest}^{self.look(radius + 2).text}"
                note(
                    f"{over}/{under}{power.replace('*', '')}",
                    f"{over}/({under}*{power})",
                    f"({over}/{under})*{power}",
                )
            return True
        plain = single and below[0].kind == "number"
        plain |= single and lump  # k x/mL, b/ml^2 x'
        if not (letters and letter and constant and ends and plain):
            return False
        if self._names.energy and not (moves or lump or after.kind == "end"):
            return False  # L = m/2a x^2, not (m/2a) x^2
        over, under = self.source(start, slash - 1), self.source(slash)
        factor = f"{ahead.text}{power}"
        note(f"{over}/{under}{factor}", f"{over}/({under}*{factor})", f"({over}/{under})*{factor}")
        return True

    def _radius_below(self, below: Line, above: Line) -> int | None:
        """How many tokens ahead the r^2 of k/mr^2, l^2/2mr^2, or L^2/m^2r^3 is: a power of a radius,
        glued to constants below a / that has constants above it; else None.
        """
        ahead = 0
        while self._is_constant(self.look(ahead)) and not self.look(ahead).space_before:
            ahead += 1
        radius, caret, power = (self.look(ahead + place) for place in range(3))
        glued = not any(token.space_before for token in (radius, caret, *below))
        constants = [token for token in (*below, *above) if token.kind == "name"]
        found = (
            radius.text in _RADII
            and self._moves(radius)
            and not radius.order
            and caret.is_operator("^")
            and power.text.isdigit()
            and glued
            and (ahead > 0 or any(token.kind == "name" for token in below))
            and bool(above)
            and all(map(self._is_constant, constants))
        )
        return ahead if found else None

    def _is_lump(self, below: Token) -> bool:
        """Whether this is the m of k x/mL."""
        return "".join((below.text, self.ahead.text)) in map("".join, self._names.splits.values())

    def _continues(self, token: Token) -> bool:
        """Whether another factor begins; inside | … | a bar ends the term."""
        return starts_factor(token) or (token.is_operator("|") and not self._bars)

    def _ends_quotient(self, start: int, slash: int) -> bool:
        """Whether a/b ends before the next factor: yes in 3/2 y^3, 1/(2 m) p, g/l sin x, no in k/m
        x, 1/2x.

        A single number in the denominator ends it if the numerator has only numbers or a coordinate
        follows. A bracket or a function call in the denominator ends it too, as does a following
        function.
        """
        ahead = self.ahead
        name = self._names.spelling(ahead.text) if ahead.kind == "name" else ""
        role = self._names.role(name)
        if self._names.energy and self._is_half(start, slash, role):
            over, under = self.source(start, slash - 1), self.source(slash)
            if ahead.is_bracket() and not tk.moves(ahead.inside) and under != "2":
                inside = self._source_of_factor()
                note(
                    f"{over}/{under}{inside}",
                    f"({over}/{under})*{inside}",
                    f"{over}/({under}*{inside})",
                )
            elif role == "parameter" and not ahead.space_before:
                note(
                    f"{over}/{under}{ahead.text}",
                    f"({over}/{under})*{ahead.text}",
                    f"{over}/({under}*{ahead.text})",
                )
            return True
        over, under = self.source(start, slash - 1), self.source(slash)
        half = over.isdigit() and under.isdigit() and role == "parameter" and not ahead.order
        if not ahead.space_before:
            after = self.look(1)
            if self._is_coefficient(over, under):
                return True
            if half and after.space_before and starts_factor(after):  # 1/2k x
                note(
                    f"{over}/{under}{ahead.text}",
                    f"({over}/{under})*{ahead.text}",
                    f"{over}/({under}*{ahead.text})",
                )
                return True
            return self._is_stiffness(start, slash)
        if half:
            note(
                f"{over}/{under} {ahead.text}",
                f"({over}/{under})*{ahead.text}",
                f"{over}/({under}*{ahead.text})",
            )
        if (name in nm.FUNCTIONS or name in nm.DERIVATIVE_NAMES) and role is None:
            return True
        below, above = self.part(slash), self.part(start, slash - 1)
        if below[-1].is_bracket() and below[0].kind in ("name", "operator", "bracket"):
            return name != "" or ahead.is_bracket()
        moves = role == "coordinate" or name == "t"
        if moves and self._is_apart(start, slash):
            return True
        if self._is_exponential() and self._is_joined(start, slash):
            return True  # noted where its exponent is known
        numbers = all(
            token.kind in ("number", "bracket") or token.is_operator("*", "^")
            for token in tk.walk(above)
        )
        number = len(below) == 1 and below[0].kind == "number"
        if number and (numbers or moves or ahead.is_bracket() or ahead.is_operator("|")):
            return True
        kinetic = _KINETIC.match(self.source(start))  # p^2/2 m
        sums = any(part.is_operator("+", "-") for part in ahead.inside[1:])
        return (sums or (role == "parameter" and not kinetic)) and self._is_apart(start, slash)

    def _is_stiffness(self, start: int, slash: int) -> bool:
        """Whether this is the k/m of k/m(x - x0), or a 1/2: a constant over one before a sum that moves."""
        below, above, ahead = self.part(slash), self.part(start, slash - 1), self.ahead
        sums = any(part.is_operator("+", "-") for part in ahead.inside[1:])
        constants = len(below) == 1 and all(
            one.kind == "number" or one.is_operator("/", "*") or self._is_constant(one)
            for one in (*above, *below)
        )
        if not (ahead.is_bracket() and sums and constants and any(map(self._moves, ahead.inside))):
            return False
        after = self._source_of_factor()
        if self._tokens[slash - 1].is_operator("/"):
            over, under = self.source(start, slash - 1), self.source(slash)
            note(f"{over}/{under}{after}", f"({over}/{under})*{after}", f"{over}/({under}*{after})")
        return True

    def _is_coefficient(self, over: str, under: str) -> bool:
        """Whether 1/2 and 3/4 are the coefficients of 1/2x^2, 3/4kx, and 1/2sin x, which is noted:
        fractions of numbers before a function or what moves. 1/2x and powers of a distance, 1/2r^2
        and 1/2mr^2, are divided by as often.
        """
        fraction = over.isdigit() and under.isdigit() and math.gcd(int(over), int(under)) == 1
        if not fraction or under == "1":
            return False
        if self._is_function(self.ahead):
            return True  # noted where its argument is known
        count = 0
        while self._is_constant(self.look(count)) and not self.look(count).space_before:
            count += 1
        last = self.look(count)
        if not self._moves(last) or last.space_before or _NUMBER.sub("", last.text) in _RADII:
            return False
        end = self.position + count + 1
        raised = self._tokens[end].is_operator("^")
        if not (raised or count or last.order):
            return False
        end += 2 * raised
        rest = [tk.source([token]) for token in self.part(self.position, end)]
        glued = "".join(rest)
        factors = "*".join([*rest[:count], "".join(rest[count:])])
        if not last.order:  # nobody means 1/(2 x')
            note(
                f"{over}/{under}{glued}",
                f"({over}/{under})*{factors}",
                f"{over}/({under}*{factors})",
            )
        return True

    def _note_call_after_quotient(self, start: int, below: int, call: int) -> None:
        """Note the other interpretation of g/l sin x and 1/2sin x, which are (g/l) sin x and
        (1/2) sin x.
        """
        called, under = self._tokens[call], self.part(below, call)
        single = [one.kind for one in under]
        clear = single == ["number"] and called.space_before
        power = called.text == "e" and self._tokens[call + 1].is_operator("^")
        if (self._is_function(called) or power) and single in (["name"], ["number"]) and not clear:
            over, divisor = self.source(start, below - 1), self.source(below, call)
            rest = self.source(call)
            note(
                f"{over}/{divisor}{' ' * called.space_before}{rest}",
                f"({over}/{divisor})*{rest}",
                f"{over}/({divisor}*{rest})",
            )

    def _note_sum_after_quotient(self, start: int, slash: int) -> None:
        """Note the other interpretation of 1/x+1, which is (1/x) + 1; InputError for 1/1+x^2, in
        which the 1 would be written for nothing. Values that programs put in leave z^2/1+x.
        """
        over, below, after = self.part(start, slash - 1), self.part(slash), self.look(1)
        typed = [*over, *below, self.ahead, after][1:]
        glued = not any(token.space_before for token in (self._tokens[slash - 1], *typed))
        if not (glued and over and self.ahead.is_operator("+", "-") and starts_factor(after)):
            return
        written, under = self.source(start, slash - 1), self.source(slash)
        sign, column = self.ahead.text, self.ahead.column
        one = len(over) == 1 and [token.text for token in below] == ["1"]
        moves = self._moves(below[0]) and not below[0].order
        plain = len(below) == 1 or (len(below) == 3 and below[1].is_operator("^"))
        ends = self.look(2).kind == "end" or self.look(2).is_operator("+", "-", ",", ";")
        constant = after.kind == "number" or self._is_constant(after)
        if one:
            place = self.position
            with suppress(errors.InputError):
                self.take()
                self._term()
            rest, span = self.source(place + 1), (over[0].column, self.ahead.column)
            words = {"over": written, "sum": f"1{sign}{rest}", "rest": f"{sign}{rest}"}
            raise fault("quotient or sum", column, span, **words)
        if moves and plain and ends and constant:
            texts = f"{written}/{under}", f"{sign}{after.text}"
            meant = f"{texts[0]} {sign} {after.text}"
            note("".join(texts), meant, f"{written}/({under}{texts[1]})")

    def _source_of_factor(self) -> str:
        """The factor ahead, with the arguments and the power of it."""
        called = self.ahead.kind == "name" and self.look(1).is_bracket()
        count = 1 + (called and not self.look(1).space_before)
        count += 2 * self.look(count).is_operator("^")
        return nm.plainly(self.source(self.position, self.position + count))

    def _is_exponential(self) -> bool:
        """Whether e^(...) is ahead, with Euler's number."""
        return (
            self.ahead.text == "e"
            and (self._names.role("e") is None or self._is_raised_euler(1))
            and self.look(1).is_operator("^")
        )

    def _is_apart(self, start: int, slash: int) -> bool:
        """Whether blanks join k/m, not m x, in k/m x'; the other interpretation is noted."""
        if not self._is_joined(start, slash):
            return False
        over, under = self.source(start, slash - 1), self.source(slash)
        after = self._source_of_factor()
        note(f"{over}/{under} {after}", f"({over}/{under})*{after}", f"{over}/({under}*{after})")
        return True

    def _is_joined(self, start: int, slash: int) -> bool:
        """Whether the term up to here is k/m without blanks."""
        sign, below = self._tokens[slash - 1], self.part(slash)
        glued = (
            not sign.space_before
            and not below[0].space_before
            and below[0].kind in ("name", "number")
        )
        return glued and not any(token.space_before for token in below)

    def _is_half(self, start: int, slash: int, role: nm.Role | None) -> bool:
        """Whether this is 1/2m, m/2x'^2, m/2 l^2, or k/4(x^2 + y^2)^2 in a Lagrangian; 1/2r^2 may
        be 1/(2 r^2).
        """
        ahead = self.ahead
        over, under = self.source(start, slash - 1), self.source(slash)
        bracket = ahead.is_bracket() and tk.moves(ahead.inside)
        moves = role == "coordinate" and ahead.order > 0
        factor = role == "parameter" or ahead.is_bracket()
        apart = ahead.kind == "name" and ahead.space_before
        sums = any(part.is_operator("+", "-") for part in ahead.inside[1:])
        if ahead.is_bracket() and sums and under.isdigit():
            return True
        if role == "parameter" and over.isdigit() and under.isdigit():
            return True  # 1/4b x^4
        return under == "2" and (bracket or moves or apart or (over == "1" and factor))

    def _check_adjacent(self) -> None:
        ahead, column = self.ahead, self.ahead.column
        closes = self.look(1) == self._end
        if ahead.is_bracket() and closes and [each.kind for each in ahead.inside] == ["number"]:
            raise fault("equation number", column, shown=f"({shorten(ahead.inside[0].text)})")
        if ahead.kind == "number":
            raise fault("number after a factor", column)
        if self._time_in_brackets():
            raise fault("time in brackets", column)
        last, before = self.look(-1), self.look(-2)
        if before.is_operator("-"):
            before = self.look(-3)
        if not before.is_operator("^") or ahead.space_before:
            return
        if last.kind == "number" and self._multiplies(ahead):
            self._note_factor_after_power()
        elif last.kind == "number":
            raise fault(
                "end of a numeric exponent", column, (last.column, column), number=last.text
            )
        if last.kind == ahead.kind == "name" and not last.order and not self._is_function(ahead):
            raise self._unclear_exponent(last)

    def _unclear_quotient(self, start: int, slash: int) -> errors.InputError:
        """The error for a/b c, with both interpretations if the following factors can be parsed."""
        place, column = self.position, self.ahead.column
        rest, over, under = (
            self._source_of_factors(),
            self.source(start, slash - 1),
            self.source(slash, place),
        )
        span, rest = (
            (self._tokens[start].column, self.ahead.column),
            None if "|" in over + under else rest,
        )
        return fault("end of a quotient", column, span, over=over, under=under, rest=rest)

    def _factor(self) -> ex.Expression:
        base = self._base()
        ahead = self.ahead
        if ahead.kind == "prime":
            raise _prime(ahead)
        if not self.take_operator("^"):
            return base
        bracket, divides = self.look(-2), self.look(-3).is_operator("/")
        is_sum = any(token.is_operator("+", "-", "^") for token in bracket.inside)
        place = self.position
        exponent, slash = self._exponent(), self.ahead
        if base == op.EXPONENTIAL:
            exponent = self._divided(self._with_time(exponent, place), place)
        self._note_sum(place)
        self._note_tower(base, bracket, place)
        number, below = self.look(-1), self.look(1)
        unclear = number.text == "1" or (number.text == "3" and is_sum and below.text == "2")
        minus, three = self.part(place)[0].is_operator("-"), number.text == "3"
        halves = three and slash.is_operator("/") and below.text == "2"
        typed = self._tokens[place].column == ahead.column + 1  # ** is a program's
        if halves and typed and (minus or divides) and is_length(bracket):
            exponent = self._halved(exponent, place)
        elif unclear and slash.is_operator("/") and below.kind == "number":
            span = (number.column, self.look(2).column)
            raise fault("root or quotient", slash.column, span, over=number.text, under=below.text)
        elif halves and minus:
            note("^-3/2", "^(-3)/2", "^(-3/2)")
        if exponent == ex.ONE and isinstance(base, ex.Velocity | ex.Acceleration):
            raise fault("raised 1", ahead.column)
        found = op.raised(base, exponent, ahead.column)
        moves = isinstance(base, ex.Symbol) and base.name in self._names.coordinates
        if moves or isinstance(base, ex.Velocity | ex.Acceleration):
            self._skip_time_argument()  # x^2(t) is the square of x(t)
        return found

    def _exponent(self) -> ex.Expression:
        column = self.ahead.column
        with self._nested():
            factors = [*self._signs(), self._factor()]
        return op.product(factors, column)

    def _base(self) -> ex.Expression:
        token = self.take()
        if (
            token.kind == "number"
            and token.value in range(_LARGEST_FACTORIAL + 1)
            and self.take_operator("!")
        ):
            return ex.number(math.factorial(int(token.value)))
        if token.kind == "number":
            return ex.number(token.value)
        if token.kind == "name":
            return self._name(token)
        if token.is_operator("|"):
            inner = self._barred()
            if not self.take_operator("|"):
                end = self.ahead
                raise tk.never_closed(token) if end == self._end else tk.unexpected(end, "'|'")
            return nm.call("abs", [inner], token.column)
        if not token.is_bracket():
            raise tk.unexpected(token, _OPERAND)
        return self._listed(token, 1)[0]

    def _listed(self, bracket: Token, most: int = LIMITS.tokens) -> list[ex.Expression]:
        """At most so many formulas in a bracket, separated by commas."""
        with self._inside(bracket):
            found = [self._expression()]
            while len(found) < most and self.take_operator(","):
                found.append(self._expression())
        return found

    def _barred(self) -> ex.Expression:
        """A formula that ends at a |."""
        outer, self._bars = self._bars, True
        found = self._expression()
        self._bars = outer
        return found

    def _piecewise(self, token: Token) -> ex.Expression:
        """The pieces in brackets, each (formula, condition)."""
        pieces: list[tuple[ex.Expression, ex.Expression]] = []
        with self._inside(self._bracket(_PIECE)):
            while not pieces or self.take_operator(","):
                with self._nested(), self._inside(self._bracket(_PIECE)):
                    value, comma = self._expression(), self.take()
                    if not comma.is_operator(","):
                        raise tk.unexpected(comma, "a comma, and the condition of the piece,")
                    pieces.append((value, self._condition()))
        return piecewise(pieces, token.column)

    def _bracket(self, wanted: str) -> Token:
        found = self.take()
        if not found.is_bracket():
            raise tk.unexpected(found, wanted)
        return found

    def _condition(self, signs: str = "|&") -> ex.Expression:
        """Conditions joined by | and &; & binds tighter."""
        if not signs:
            return self._one_condition()
        with self._nested():
            found = self._condition(signs[1:])
            while sign := self.take_operator(signs[0]):
                other = self._condition(signs[1:])
                found = either(found, other) if sign.text == "|" else found * other
        return found

    def _one_condition(self) -> ex.Expression:
        if self.take_operator("true"):
            return ex.ONE
        if self.take_operator("~"):
            with self._nested():
                return 1 - self._one_condition()
        ahead = self.ahead
        if ahead.is_bracket() and any(
            token.is_operator("<", ">", "~", "&", "true") for token in tk.walk([ahead])
        ):
            with self._inside(self.take()):
                return self._condition()
        return self._inequality()

    def _inequality(self) -> ex.Expression:
        """u > w, or a chain 0 < x < 1."""
        left, found = self._barred(), []
        while token := self.take_operator("<", ">"):
            right = self._barred()
            found.append(step(left - right if token.text == ">" else right - left, token.column))
            left = right
        if not found:
            raise tk.unexpected(self.ahead, "an inequality such as x > 0, or true,")
        return ex.multiply(*found)

    def _elementary(self, token: Token) -> ex.Expression:
        if token.text in nm.PIECEWISE:
            return self._piecewise(token)
        token = self._inverted(token)
        exponent = self._function_power(token)
        if (opening := self.ahead).is_bracket():
            result = nm.call(token.text, self._listed(self.take()), token.column)
            if isinstance(result, ex.Ordered) and any(
                ex.holds(result.order, ex.Symbol(name)) for name in self._names.coordinates
            ):
                raise fault("order that moves", token.column, name=token.text)
            if self.ahead.text == "t" and token.text in _OF_ANGLES and tk.is_frequency(opening):
                inside = tk.source([opening])
                inner = inside if len(opening.inside) > 1 else inside[1:-1]
                span = (token.column, self.look(1).column)
                raise fault(
                    "time after an angle",
                    opening.column,
                    span,
                    name=token.text,
                    inner=inner,
                    inside=inside,
                )
        else:
            result = nm.call(token.text, [self._bare_argument(token)], token.column)
        return op.raised(result, exponent, token.column) if exponent else result

    def _inverted(self, token: Token) -> Token:
        """The asin of sin^-1 x, the name with its -1; its other meaning is noted."""
        if not self.ahead.is_operator("^") or token.text not in _INVERTED:
            return token
        power, count = self.part(self.position + 1, self.position + 3), 2
        while at(power, 0).is_bracket():
            power, count = [*power[0].inside], 1
        if tk.spelled(power) != "-1":
            return token
        for _ in range(1 + count):
            self.take()
        note(f"{token.text}^-1", f"a{token.text}", f"1/{token.text}")
        return Token("name", f"a{token.text}", token.column, token.space_before)

    def _function_power(self, token: Token) -> ex.Expression | None:
        """The 2 of sin^2 x; sin^-1 is refused because it may be asin or 1/sin."""
        if not (caret := self.take_operator("^")):
            return None
        power, depth = self.part(self.position, self.position + 2), 0
        while at(power, 0).is_bracket():
            power, depth = [*power[0].inside], depth + 1
        is_one = at(power, 1).value == 1
        inverted = token.text in _INVERTED and not is_one  # sin^-2 x
        if inverted and at(power, 0).is_operator("-"):
            return self._exponent()
        if at(power, 0).is_operator("-") and (depth < 2 or is_one):
            raise self._unclear_inverse(token, caret, is_one and len(power) == 2, 1 if depth else 2)
        return self._base()

    def _unclear_inverse(
        self, token: Token, caret: Token, is_one: bool, length: int
    ) -> errors.InputError:
        """The error for sin^-1, a power of `length` tokens, with both interpretations if the
        argument can be parsed.
        """
        name = token.text
        for _ in range(length):
            self.take()
        place = self.position
        with suppress(errors.InputError):
            self._factor()
        argument = self.source(place)
        known = argument and is_one and f"a{name}" in nm.FUNCTIONS
        called = (argument if argument.startswith("(") else f"({argument})") if known else None
        return fault(
            "inverse function",
            caret.column,
            (token.column, self.ahead.column),
            name=name,
            called=called,
        )

    def _bare_argument(self, token: Token) -> ex.Expression:
        """The argument of sin x, sin 2x, sin x^2; InputError if more factors could belong to it."""
        ahead, second = self.ahead, self.look(1)
        if ahead.is_operator("-") and ahead.space_before and not second.space_before:
            self.take()  # exp -x
            with self._nested():
                return op.product([ex.MINUS_ONE, self._bare_argument(token)], ahead.column)
        barred = ahead.is_operator("|") and not self._bars
        if ahead.kind not in ("number", "name") and not barred:
            raise tk.unexpected(ahead, f"the argument of {token.text} in brackets")
        start = self.position
        with self._nested():
            argument = self._factor()
            raised_apart = _RAISED_APART | {"exp"}
            if self._tokens[start + 1].is_operator("^") and token.text in raised_apart:
                inner = nm.plainly(self.source(start))
                note(
                    f"{token.text} {inner}",
                    f"{token.text}({inner})",
                    nm.power_of_call(token.text, inner),
                )
            following = self.ahead
            whole = self._bare_product(start, token.text in _HYPERBOLIC)
            if whole and not (ahead.kind == "number" and token.text in ("sqrt", "cbrt")):
                argument = op.product(
                    [argument, *(self._factor() for _ in range(whole))], ahead.column
                )
                if self.look(-1).text == "t" and not self.ahead.is_operator("/", "(", "^"):
                    self._note_time(token, start)
                    self._note_phase(token, start)
                    return argument  # cos w t x is cos(w t) x
            elif ahead.kind == "number" and starts_factor(following) and not self._bare_ends():
                if token.text in ("sqrt", "cbrt"):
                    raise self._unclear_end(token, start)
                glued = self._is_constant(following) and self.look(1).space_before
                apart = following.space_before or following.text in ("pi", "Pi")
                apart = apart or (glued and token.text in _HYPERBOLIC)  # sinh 2a x
                count = self._spaced_factors(token, start) if apart else 1
                argument = op.product(
                    [argument, *(self._factor() for _ in range(count))], ahead.column
                )
        if (
            self._halves_angle(token, start)
            or self._is_in_periods(token, start)
            or self._is_in_lengths(token, start)
        ):
            divisor = op.reciprocal(self._factor(), self.ahead.column)
            argument = op.product([argument, divisor], ahead.column)
        if token.text in _OF_ANGLES and (travelling := self._travelling_wave(token, start)):
            return op.sum_of([argument, travelling], ahead.column)
        self._note_phase(token, start)
        after, of_number = self.ahead, ahead.kind == "number" and self.position == start + 1
        if of_number and token.text in _OF_ANGLES and self._is_function(after):
            raise self._unclear_end(token, start)  # sin 2 cos x
        signs = ("/", "*") if of_number else ("/",)  # sin 2*x usually means sin(2*x)
        divides = after.text == "/" and self._is_function(self.look(1))  # sin x/cos x
        divides = divides or self._divides_apart(token, start)
        if (after.is_operator(*signs) and not divides) or (
            starts_factor(after)
            and not self._bare_ends()
            and not self._time_ends(token, start)
            and not self._power_begins(token, start)
        ):
            raise self._unclear_end(token, start)
        if token.text == "sqrt" and after.is_operator("+", "-"):
            if _SQUARE.fullmatch(self.source(start)):  # the line above the sum was lost
                raise self._unclear_end(token, start)
            self._note_sum_after_root(token, start)
        return argument

    def _halves_angle(self, token: Token, start: int) -> bool:
        """Whether tan x/2 is the tangent of half an angle, which is noted; its / is taken then.

        sin x/2 and cos x/2 are a force and a potential as often as functions of half an angle.
        """
        sign, two, angle = self.ahead, self.look(1), self._tokens[start]
        glued = not (sign.space_before or two.space_before)
        alone = self.position == start + 1 and self._moves(angle) and not angle.order
        after = self.look(2)
        ends = not (starts_factor(after) or after.is_operator("*", "/", "^"))
        first = self._tokens[start - 1].text == token.text  # tan^2 x/2 may be half of a square
        found = token.text in _OF_HALF_ANGLES and first
        found = found and sign.is_operator("/") and two.text == "2"
        if not (found and alone and glued and ends):
            return False
        name, inner = token.text, self.source(start)
        note(f"{name} {inner}/2", f"{name}({inner}/2)", f"{name}({inner})/2")
        self.take()
        return True

    def _is_in_periods(self, token: Token, start: int) -> bool:
        """Whether sin t/T is the sine of t/T, and cos 2 pi t/tau that of 2 pi t/tau, which is noted; its
        / is taken then. Nobody divides the sine of a time by a time.
        """
        sign, period, after = self.ahead, self.look(1), self.look(2)
        inside = self.part(start)
        plain = all(one.kind == "number" or one.text in ("pi", "Pi") for one in inside[:-1])
        timed = inside[-1].text == "t" and self._is_variable(inside[-1])
        glued = sign.is_operator("/") and not (sign.space_before or period.space_before)
        scale = _PERIODS.fullmatch(period.text) and self._is_constant(period) and not period.order
        ends = not (starts_factor(after) and not after.space_before) and not after.is_operator(
            "^", "/"
        )
        if not (plain and timed and glued and scale and ends):
            return False
        before = self._tokens[start - 1]
        if before.text not in (token.text, "-"):
            return False  # sin^2 t/T
        negative = "-" * before.is_operator("-")  # exp -t/tau
        name, inner, below = token.text, negative + self.source(start), period.text
        note(f"{name} {inner}/{below}", f"{name}({inner}/{below})", f"{name}({inner})/{below}")
        self.take()
        return True

    def _is_in_lengths(self, token: Token, start: int) -> bool:
        """Whether sin pi x/a is the sine of pi x/a, and cos 2 pi x/L that of 2 pi x/L, which is noted;
        its / is taken then. Angles in multiples of pi are pure numbers.
        """
        sign, length, after, inside = self.ahead, self.look(1), self.look(2), self.part(start)
        *factors, position = inside
        pure = any(map(self._is_pi, factors)) and self._moves(position) and not position.order
        glued = sign.is_operator("/") and not (sign.space_before or length.space_before)
        below = self._is_constant(length) and not length.order
        ends = not after.is_operator("^", "/") and (after.space_before or not starts_factor(after))
        if token.text not in _OF_ANGLES or not (pure and glued and below and ends):
            return False
        name, inner = token.text, self.source(start)
        rest = f"/{length.text}"
        note(f"{name} {inner}{rest}", f"{name}({inner}{rest})", f"{name}({inner}){rest}")
        self.take()
        return True

    def _note_sum_after_root(self, token: Token, start: int) -> None:
        """Note the other interpretation of sqrt x+1, which is sqrt(x) + 1."""
        sign, place = self.ahead, self.position + 1
        glued = itertools.takewhile(self._is_glued, self._tokens[place:-1])
        inner, rest = self.source(start), tk.source(glued)
        if sign.space_before or not rest:
            return
        first = self._tokens[start]
        root = "\u221a" if first.column == token.column + 1 else f"sqrt{' ' * first.space_before}"
        note(
            f"{root}{inner}{sign.text}{rest}",
            f"sqrt({inner}) {sign.text} {rest}",
            f"sqrt({inner}{sign.text}{rest})",
        )

    def _is_glued(self, token: Token) -> bool:
        """Whether a term goes on without a blank."""
        return not (token.space_before or token.is_operator("+", "-", ",", ";", "="))

    def _note_phase(self, token: Token, start: int) -> None:
        """Note the other interpretation of A cos w t + phi, which could be A cos(w t + phi), and of
        sin theta - theta0.
        """
        sign, phase, after, last = self.ahead, self.look(1), self.look(2), self.look(-1)
        if token.text not in _OF_ANGLES or not sign.is_operator("+", "-"):
            return
        alone = after.kind == "end" or after.is_operator("+", "-", ",", ";", "=")
        if phase.kind != "name" or phase.order or not (alone and self._is_constant(phase)):
            return
        timed = last.text == "t" and _PHASES.fullmatch(phase.text)
        at_zero = _AT_ZERO.fullmatch(phase.text)
        shifted = self.position == start + 1 and at_zero and at_zero[1] == last.text
        if timed or shifted:
            inner, rest = self.source(start), f"{sign.text} {phase.text}"
            name = token.text
            note(f"{name} {inner} {rest}", f"{name}({inner}) {rest}", f"{name}({inner} {rest})")

    def _travelling_wave(self, token: Token, start: int) -> ex.Expression | None:
        """The -w t of cos k x - w t and cos kz - w t, which nobody adds to cos(k x); it is taken, and
        noted.
        """
        sign, inside = self.ahead, self.part(start)
        *constants, position = inside
        run = not constants and len(nm.letters_of_run(position.text)) == 2
        run = run and self._is_constant(position)  # kz where z is no coordinate
        product = constants and self._moves(position)
        if not (sign.is_operator("+", "-") and (product or run)):
            return None
        count = 1
        while self._is_constant(self.look(count)):
            count += 1
        time, after = self.look(count), self.look(count + 1)
        timed = count > 1 and time.text == "t" and self._is_variable(time)
        ends = after.kind == "end" or after.is_operator("+", "-", ",", ";", "=")
        plain = all(one.kind == "number" or self._is_constant(one) for one in constants)
        plain = plain and any(_FREQUENCY.fullmatch(self.look(place).text) for place in range(count))
        if position.order or not (plain and timed and ends):
            return None
        inner, place = self.source(start), self.position
        found = self._term()
        rest = f"{sign.text} {self.source(place + 1)}"
        name = token.text
        note(f"{name} {inner} {rest}", f"{name}({inner} {rest})", f"{name}({inner}) {rest}")
        return found

    def _spaced_factors(self, token: Token, start: int) -> int:
        """The number of names that belong to cos 2 k x, which is cos(2 k x), as nobody writes the
        cosine of a number; the other interpretation is noted. InputError for ln 2 x and exp 2 x.
        """
        name, place = token.text, self.position
        count, ended = 0, False
        while not ended and (factor := self.look(count)).kind == "name":
            if factor.order or self._is_function(factor) or self.look(count + 1).is_operator("^"):
                break
            ended = self._moves(factor) or (factor.text == "t" and self._names.role("t") is None)
            count += 1
        if name not in _RAISED_APART - _LOGARITHMS or not count:
            raise self._unclear_end(token, start)
        inner, rest = self.source(start), self.source(place, place + count)
        product_of_rest = "*".join(tk.source([each]) for each in self.part(place, place + count))
        if self.ahead.space_before or count > 1:
            blank = " " * self.ahead.space_before
            note(
                f"{name} {inner}{blank}{rest}",
                f"{name}({inner}*{product_of_rest})",
                f"{name}({inner})*{product_of_rest}",
            )
        return count

    def _time_ends(self, token: Token, start: int) -> bool:
        """Whether sin t x is sin(t) x, where x moves; the other interpretation is noted."""
        after, alone = self.ahead, self.position == start + 1
        timed = self._tokens[start].text == "t" and self._names.role("t") is None
        if not (timed and alone and after.space_before and self._moves(after)):
            return False
        note(
            f"{token.text} t {after.text}",
            f"{token.text}(t)*{after.text}",
            f"{token.text}(t*{after.text})",
        )
        return True

    def _note_time(self, token: Token, start: int) -> None:
        """Note the other interpretation of cos w t x, which is cos(w t) x, where x moves."""
        after = self.ahead
        if after.kind == "name" and not after.order and self._moves(after):
            inner, rest = self.source(start), after.text
            name = token.text
            note(f"{name} {inner} {rest}", f"{name}({inner})*{rest}", f"{name}({inner} {rest})")

    def _power_begins(self, token: Token, start: int) -> bool:
        """Whether sin^2 x a^2 is sin^2(x) a^2, as the power of a name is a factor of its own; the
        other interpretation is noted.
        """
        angle, after, power = self._tokens[start], self.ahead, self.look(1)
        alone = self.position == start + 1 and self._moves(angle) and not angle.order
        raised_name = after.kind == "name" and not after.order and power.is_operator("^")
        raised_name = raised_name and (self._is_constant(after) or self._moves(after))
        if token.text not in _RAISED_APART - _LOGARITHMS or not (alone and raised_name):
            return False
        rest = f"{after.text}^{nm.plainly(self.source(self.position + 2, self.position + 3))}"
        note(
            f"{angle.text} {rest}",
            f"{token.text}({angle.text})*{rest}",
            f"({angle.text}*{rest})",
        )
        return True

    def _divides_apart(self, token: Token, start: int) -> bool:
        """Whether blanks show that g sin x / l divides sin(x), or its meaning does: nobody divides
        the angle of g sin theta/l by a length. The other interpretation is noted.
        """
        sign, below, angle = self.ahead, self.look(1), self._tokens[start]
        if not sign.is_operator("/") or token.text in ("sqrt", "cbrt"):
            return False
        apart = sign.space_before and below.space_before
        greek = _NUMBER.sub("", self._names.spelling(angle.text)) in nm.GREEK_NAMES
        alone = self.position == start + 1 and self._moves(angle) and not angle.order
        length = self._names.role_meant(below.text) == "parameter"
        by_length = greek and alone and length and token.text in _OF_ANGLES
        if not (apart or by_length):
            return False
        inner, rest, blank = self.source(start), tk.source([below]), " " * apart
        note(
            f"{token.text} {inner}{blank}/{blank}{rest}",
            f"{token.text}({inner})/{rest}",
            f"{token.text}({inner}/{rest})",
        )
        return True

    def _bare_product(self, start: int, latin: bool) -> int:
        """The number of names that clearly belong to a bare argument after its first factor: cos w
        t, sin 2kx.

        These are constants up to the time, or up to a coordinate if there are no spaces or the
        first factor is a Latin letter, or, with `latin`, any letter: cosh alpha x.
        """
        first = self._tokens[start]
        if (
            self.position != start + 1
            or first.order
            or (first.kind == "name" and not self._is_constant(first))
        ):
            return 0
        any_letter, glued = latin, True
        latin = first.kind == "name" and (latin or first.text not in nm.GREEK_NAMES)
        for place in itertools.count():
            token = self.look(place)
            plain = token.kind == "name" and token.text not in nm.FUNCTIONS and not token.order
            if not plain or self.look(place + 1).is_operator("^"):
                return 0
            glued = glued and not token.space_before
            role = self._names.role_meant(token.text)
            if token.text == "t":  # also that of x(t) = A cos w t
                return place + 1 if role or self._names.time else 0
            if role == "coordinate":
                below = self.look(place + 1)
                over = self._is_pi(first) and below.is_operator("/") and not below.space_before
                return place + 1 if glued or latin or over else 0  # sin pi x/a
            if not self._is_constant(token):
                return 0
            latin = latin and (any_letter or token.text not in nm.GREEK_NAMES)
        return 0

    def _is_pi(self, token: Token) -> bool:
        return token.text in ("pi", "Pi") and self._names.role(token.text) is None

    def _unclear_end(self, token: Token, start: int) -> errors.InputError:
        """The error for sin a b, sin a/b, and sqrt 1 - x/a, with both interpretations if they can
        be parsed.

        ln 2 x has only one.
        """
        end, name, column = self.position, token.text, self.ahead.column
        called = self._is_function(self.ahead)
        written = self.take_operator("/", "*", "+", "-")
        sign = written.text if written else "*"
        if (rest := self._source_of_factors(whole=sign in "+-")) is None:
            return fault("end of an argument", column, name=name)
        inner, first = self.source(start, end), self._tokens[start]
        both = called or first.kind != "number" or written or name in ("sqrt", "cbrt")
        meant = (f"({inner}){sign}{rest}", f"({inner}{sign}{rest})")[not both :]
        return fault(
            "end of an argument", column, (first.column, self.ahead.column), meant, name=name
        )

    def _source_of_factors(self, whole: bool = False) -> str | None:
        """Consume the factors, or the whole term, ahead and return their text; None if they cannot
        be parsed.
        """
        place = self.position
        try:
            if whole:
                self._term()
            while self._continues(self.ahead):
                self._factor()
        except errors.InputError:
            return None
        found = self.source(place)
        return found if found and "|" not in found else None

    def _bare_ends(self) -> bool:
        """Whether a bare argument ends here: before an operator, another function, or a velocity,
        also one in brackets.

        An angle named by a Greek letter also ends it before a sum: sin phi (a - b).
        """
        ahead = self.ahead
        if ahead.is_bracket():
            moves = any(each.order and self._moves(each) for each in tk.walk(ahead.inside))
            angle = self._names.spelling(self.look(-1).text)
            greek = (
                angle.rstrip("_0123456789") in nm.GREEK_NAMES
                and self._names.role(angle) == "coordinate"
            )
            sums = (
                greek
                and ahead.space_before
                and any(part.is_operator("+", "-") for part in ahead.inside[1:])
            )
            return moves or (sums and not self._group_has_time())
        if ahead.kind != "name":
            return ahead.kind != "number"
        return ahead.order > 0 if self._moves(ahead) else self._is_function(ahead)

    def _name(self, token: Token) -> ex.Expression:
        name = self._names.spelling(token.text)
        match self._names.role(name):
            case "coordinate":
                return self._coordinate(name, token)
            case "parameter" if name == "e" and self._is_raised_euler():
                return self._euler(token)
            case "parameter":
                return self._single(ex.Symbol(name), token)
            case "function":
                return self._arbitrary(name, token)
        if token.order and (name in nm.DERIVATIVE_NAMES or name in nm.FUNCTIONS):
            raise _prime(token)
        if name in nm.DERIVATIVE_NAMES:
            return self._derivative(token)
        if name in nm.FUNCTIONS:
            return self._elementary(token)
        return self._constant(name, token)

    def _constant(self, name: str, token: Token) -> ex.Expression:
        if name in ("pi", "Pi"):
            return self._single(ex.PI, token)
        if name in ("e", "E"):
            return self._euler(token)
        if name == "t" and self._names.time:
            return self._single(ex.TIME, token)
        if name == "t":
            raise fault("time", token.column)
        follows = "'" * (token.order > 0) + self.ahead.text
        raise nm.unknown_name(token.text, self._names, token.column, follows)

    def _single(self, node: ex.Expression, token: Token) -> ex.Expression:
        """A name without arguments; InputError if a bracket makes it look like a function."""
        ahead, name = self.ahead, token.text
        if token.order and not isinstance(node, ex.Velocity | ex.Acceleration):
            if node in self._names.definitions:
                return self._defined_motion(node, token)
            guessed = self._names.guesses and node != ex.PI
            if guessed and (nm.looks_like_a_coordinate(name) or name in nm.GREEK_NAMES):
                raise fault("prime of a guessed constant", token.column, name=name)
            raise fault(
                "prime of a constant",
                token.primed,
                (token.column, token.primed + token.order),
                name=name,
            )
        if ahead.is_bracket() and not ahead.space_before and self._are_its_names(node):
            self.take()
        elif ahead.is_bracket() and not ahead.space_before and self._is_factor(token):
            moves = any(map(self._moves, tk.walk(ahead.inside))) and not tk.moves(ahead.inside)
            if self._names.guesses and self._is_constant(token) and moves:
                inside = nm.plainly(tk.source([ahead]))
                note(f"{name}{inside}", f"{name}*{inside}", function=name)
        elif ahead.is_bracket() and not ahead.space_before:
            if len(tk.split_at(",", ahead.inside)) > 1:
                raise fault("arguments of a constant", token.column, name=name)
            key = (
                "constant before a bracket"
                if self._is_constant(token) and node != ex.PI
                else "name before a bracket"
            )
            raise fault(key, ahead.column, (ahead.column, ahead.column + 1), name=name)
        return node

    def _are_its_names(self, node: ex.Expression) -> bool:
        """Whether the bracket ahead lists every coordinate in the formula of a name: V(x, y) for V
        = x^2 y.
        """
        inside, formula = self.ahead.inside, self._names.definitions.get(node)
        listed = {
            self._names.spelling(token.text) for token in inside if not token.is_operator(",")
        }
        names = (
            {part.name for part in ex.walk(formula) if isinstance(part, ex.Symbol)}
            if formula
            else set()
        )
        moving = {"t", *self._names.coordinates}
        return formula is not None and names & moving <= listed <= moving

    def _defined_motion(self, node: ex.Expression, token: Token) -> ex.Expression:
        """z' for z = a*r^2, and 0 for r = a beside L, in which u, v, and w are displacements.

        InputError for U' or U'(x), usually a slope, and for a constant with a prime as a mark.
        """
        name = token.text
        self._skip_time_argument()
        found = op.carry_out(node, [op.Variable(ex.TIME, token.order, token.primed)], self._names)
        displaced = self._names.energy and name in ("u", "v", "w")
        moves = nm.looks_like_a_coordinate(name) or name in nm.GREEK_NAMES or displaced
        marked = found == ex.ZERO and not (self._names.energy and moves)
        if (name in nm.MAY_BE_FUNCTIONS and not displaced) or self._opens_arguments() or marked:
            raise fault("prime of a defined name", token.primed, name=name)
        return found

    def _is_factor(self, token: Token) -> bool:
        """Whether the bracket after a name is clearly a factor: mu(1 - x^2), R(cos phi),
        J(x')^2.
        """
        bracket = self.ahead
        inside, first = [*tk.walk(bracket.inside)], at(bracket.inside, 0)
        squared = len(bracket.inside) > 1 or self.look(1).is_operator(
            "^"
        )  # gamma(x') x' may be a function
        sums = (
            any(part.order > 1 - squared for part in bracket.inside) or first.text in nm.FUNCTIONS
        )
        sums = sums or any(part.is_operator("+", "-") for part in bracket.inside[1:])
        named = [part for part in bracket.inside if part.kind == "name"]
        scaled = any(map(self._is_constant, named)) and any(map(self._moves, named))
        sums = sums or (scaled and self.look(1).is_operator("^"))  # k(R phi)^2
        modulated = is_modulated(bracket)
        # epsilon(cos t - x') is a product, and k(x - y(t))
        moving = tk.moves(bracket.inside) or modulated
        timed = not moving and token.text != "t" and any(self._times(bracket.inside))
        if timed or any(part.is_operator(",") for part in inside):
            return False
        head = token.text.partition("_")[0]
        if prose.is_word(head) and not self._names.role(token.text):
            return False  # expand_derivatives(x'') is a call
        constant = all(map(self._is_constant, (part for part in inside if part.kind == "name")))
        weight = token.text in ("g", "G") and (constant or self.look(-2).text in ("m", "M"))
        return sums and (self._moves(token) or weight or token.text not in nm.MAY_BE_FUNCTIONS)

    def _times(self, line: Line) -> Iterator[Token]:
        """Each t in a formula but that of y(t), a function of the time."""
        for place, token in enumerate(line):
            known = self._names.functions.get(self._names.spelling(at(line, place - 1).text))
            if token.is_bracket() and not (known == ("t",) and tk.spelled(token.inside) == "t"):
                yield from self._times(token.inside)
            elif token.text == "t":
                yield token

    def _coordinate(self, name: str, token: Token) -> ex.Expression:
        if token.order > 2:
            raise fault("third derivative", token.column, instead=op.OF_SECOND_ORDER)
        self._skip_time_argument()
        ahead = self.ahead
        touches = self._opens_arguments() and not ahead.space_before
        if touches and [each.kind for each in ahead.inside] == ["number"]:
            raise fault(
                "initial value", token.column, name=name, value=shorten(ahead.inside[0].text)
            )
        if self._opens_arguments() and self._group_has_time() and not is_modulated(ahead):
            key = "delay after a space" if ahead.space_before else "delay"
            raise fault(key, ahead.column, (ahead.column, ahead.column + 1), name=name)
        return self._single(
            (ex.Symbol(name), ex.Velocity(name), ex.Acceleration(name))[token.order], token
        )

    def _opens_arguments(self) -> bool:
        return self.ahead.is_bracket() and not self.ahead.value

    def _skip_time_argument(self) -> None:
        if self._time_in_brackets() and self.take().order:
            raise _prime(self.look(-1))

    def _time_in_brackets(self) -> bool:
        return self._opens_arguments() and [token.text for token in self.ahead.inside] == ["t"]

    def _group_has_time(self) -> bool:
        """Whether the bracket ahead contains t and no coordinate: x(t - tau) is a delay, x' (t - y)
        a product.
        """
        bracket = self.ahead
        found = [
            (line, place) for line, place, _ in tk.places([bracket]) if line[place].text == "t"
        ]
        timed = any(
            len(line) > 1 and at(line, place - 1).text != "," for line, place in found
        )  # not diff(y, t), y(t)
        return timed and not any(map(self._moves, tk.walk([bracket])))

    def _arbitrary(self, name: str, token: Token) -> ex.Expression:
        declared = self._names.functions[name]
        if name == "gamma" and self._names.guesses:
            note("gamma", "any function", "gammafunction")
        orders = self._orders(token, name, len(declared))
        at_most(
            sum(orders),
            LIMITS.derivative_order,
            f"a derivative of {name} is too high",
            token.column,
        )
        column, exponent = self.ahead.column, None
        if self.take_operator("^"):
            exponent = self._exponent()
        found = self._called(name, declared, orders, token, exponent)
        return found if exponent is None else op.raised(found, exponent, column)

    def _called(
        self,
        name: str,
        declared: tuple[str, ...],
        orders: tuple[int, ...],
        token: Token,
        power: ex.Expression | None,
    ) -> ex.Expression:
        """A with the arguments that follow, or else with its declared arguments; A^2(x) is the
        square of A(x).
        """
        ahead = self.ahead
        if not self._opens_arguments():
            moving = [
                self._names.derivative(argument) for argument in declared
            ]  # A(x, x_dot) depends on x'
            pairs = zip(declared, moving, strict=True)
            return ex.Arbitrary(
                name, tuple(ex.Velocity(u[0]) if u else ex.Symbol(a) for a, u in pairs), orders
            )
        if power == ex.number(-1):
            raise fault("inverse of a declared function", ahead.column, name=name)
        if power is not None and ahead.space_before:
            raise fault(
                "bracket after a power", ahead.column, name=name, arguments=", ".join(declared)
            )
        arguments = self._listed(self.take())
        if len(arguments) != len(declared):
            words = {
                "name": name,
                "found": len(arguments),
                "count": len(declared),
                "arguments": ", ".join(declared),
            }
            raise fault("number of arguments", token.column, **words)
        return ex.Arbitrary(name, tuple(arguments), orders)

    def _orders(self, token: Token, name: str, count: int) -> tuple[int, ...]:
        """The orders of A'' (one argument) or A[1,0] (one number for each argument)."""
        primes, column = token.order, token.primed or self.ahead.column
        if primes and count != 1:
            raise fault("prime of several arguments", column, name=name, count=count)
        if not self.ahead.is_bracket("["):
            return (primes,) if count == 1 else (0,) * count
        with self._inside(self.take()):
            orders = [self._order()]
            while self.take_operator(","):
                orders.append(self._order())
        if primes or len(orders) != count:
            raise fault("number of orders", column, name=name, count=count)
        return tuple(orders)

    def _order(self) -> int:
        token = self.take()
        if token.kind != "number" or token.value.denominator != 1:
            raise tk.unexpected(token, "the order of a derivative, an integer,")
        at_most(token.value, LIMITS.derivative_order, "a derivative is too high", token.column)
        return int(token.value)

    def _derivative(self, token: Token) -> ex.Expression:
        """diff(u, x), diff(u, x, 2), diff(u, x, y), Derivative(u, (t, 2))."""
        variables: list[op.Variable] = []
        with self._inside(self._bracket(f"'(' after {token.text}")):
            expression = self._expression()
            while self.take_operator(","):
                variables.append(self._variable())
        if not variables:
            raise fault("derivative without a variable", token.column, name=token.text)
        if any(variable.node == ex.TIME for variable in variables) and isinstance(
            expression, ex.Arbitrary
        ):
            op.refuse_two_meanings(expression, token.column, self._names)
        return op.carry_out(expression, variables, self._names)

    def _variable(self, alone: bool = False) -> op.Variable:
        """x, or x, 2, possibly in separate brackets."""
        if self.ahead.is_bracket():
            with self._inside(self.take()):
                return self._variable(True)
        token = self.take()
        node, times = self._variable_node(token), 1
        if self.ahead.is_operator(",") and (alone or self.look(1).kind == "number"):
            self.take()
            times = self._order()
        return op.Variable(node, times, token.column)

    def _variable_node(self, token: Token) -> ex.Expression:
        wanted = "the variable of the derivative, a name,"
        if token.kind != "name":
            raise tk.unexpected(token, wanted)
        if self._names.role_meant(token.text) == "function":
            raise fault("derivative by a function", token.column)
        node = self._name(token)
        if not isinstance(node, ex.Symbol | ex.Velocity | ex.Acceleration) or node == ex.PI:
            raise tk.unexpected(token, wanted)
        return node


def is_modulated(bracket: Token) -> bool:
    """Whether this is the (1 + a cos w t) of k(1 + a cos w t), which is no argument."""
    numbers = any(
        [one.kind for one in term] == ["number"] for term in tk.split_at("+-", bracket.inside)
    )
    return numbers and any(part.text in nm.FUNCTIONS for part in tk.walk(bracket.inside))


def _prime(token: Token) -> errors.InputError:
    """The error for a prime token, or for the primes of a token."""
    return fault("prime", token.primed or token.column)


def parse_tokens(tokens: Tokens, end_column: int, names: nm.Names) -> ex.Expression:
    """The formula that the tokens form; errors about a missing end have the column `end_column`."""
    for line, place, _ in tk.places(tokens):  # before any name is looked up
        token, before, after = line[place], at(line, place - 1), at(line, place + 1)
        twice = token.is_operator(*"*/^") and before.is_operator(*"+-*/^")  # x +* 3
        sum_of = token.is_operator("+") or (
            token.is_operator("-") and after.space_before
        )  # x'^ + y'^2, not e^-x
        if twice or (
            sum_of and before.is_operator("^") and (after.kind != "number" or after.space_before)
        ):
            raise tk.unexpected(token, _OPERAND)
    try:
        return FormulaParser(tokens, end_column, names).formula()
    except (
        RecursionError
    ):  # only if the caller is itself deeply nested, since the depth limit leaves ample room
        raise fault("deep formula", 1) from None
