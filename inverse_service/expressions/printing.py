"""Print trees as canonical plain text, LaTeX, and presentation MathML, which browsers display
without a script.

Parsing the text gives the same value, and printing that value gives the same text. This is also
true of the LaTeX, except for partial derivatives. The text uses a small part of the grammar of
`reader.py`:

    formula   = ["-"] term {(" + " | " - ") term}
    term      = factors ["/" (factor | "(" factors ")")]
    factors   = factor {"*" factor}
    factor    = atom ["^" exponent]
    exponent  = integer | name | "(" formula ")"
    atom      = integer | name | name "'" | name "''" | function | "(" formula ")"
    function  = name {"'"} "(" formula {", " formula} ")"
              | "diff(" name "(" name {", " name} "), " name {", " name} ")"
              | name "[" integer {"," integer} "](" formula {", " formula} ")"

`sqrt`, `abs` for sqrt(u^2), and `sign` are the only functions besides those of `functions.py` and
the declared ones; integers have no sign; rational numbers are quotients, or the decimal numbers
that were typed. A'(u) is the derivative of a declared function of one argument; for several
arguments, diff(B(x, y), x) if they are different names, else B[1,0](u, w) with the order of the
derivative by each argument.
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from decimal import Context, Decimal, Inexact
from fractions import Fraction
from functools import lru_cache
from html import escape
from typing import Literal

from inverse_service.expressions import functions, letters, tree as ex, typed_scale

_EXPONENTIAL = ex.Apply("exp", ex.ONE)
# The denominator from which a decimal number can be much shorter than a fraction, and how many
# digits shorter.
_LEAST_DECIMAL, _MUCH, _EXACT = 1000, 2, Context(prec=1000, traps=[Inexact])
# The same where decimal numbers were typed, from which others follow: 3.924 is 9.81/2.5. There a
# decimal number may be so many characters longer than the digits of the fraction.
_LEAST_NEAR_DECIMALS, _LONGER = 11, 2
# A typed decimal number is recognized over these divisors and times these factors.
_DIVISORS, _FACTORS, _SHORT = (1, 2, 3, 4, 6), (2, 3, 4), 6
_DECIMALS: ContextVar[frozenset[Fraction]] = ContextVar("decimals", default=frozenset())
_IN_ORDER: ContextVar[bool] = ContextVar("terms in the order of the tree", default=False)
_Factors = tuple[ex.Expression, ...]
_Side = tuple[str, _Factors]  # the number and the factors above or below a fraction line
# LaTeX.
_WITHOUT_COMMAND = (
    "omicron",
    "Alpha",
    "Beta",
    "Epsilon",
    "Zeta",
    "Eta",
    "Iota",
    "Kappa",
    "Mu",
    "Nu",
    "Omicron",
)
_NO_COMMAND = frozenset((*_WITHOUT_COMMAND, "Rho", "Tau", "Chi"))
# MathML.
_NAMESPACE = "http://www.w3.org/1998/Math/MathML"
_TIMES, _DOT = "<mo>&#x2062;</mo>", "<mo>&#x22C5;</mo>"
# The pages' font already raises and shrinks the prime; in a superscript it would be too small.
PRIME = '<mo lspace="0" rspace="0">&#x2032;</mo>'
_APPLY = "<mo>&#x2061;</mo>"
_DOTS = ("", "&#x02D9;", "&#x00A8;")
_PARTS = re.compile(r"([A-Za-z]+)(.*)")
_LETTER_AND_NUMBER = re.compile(r"([A-Za-z]+?)_?([0-9]+)")
_SHOWN = {name: character for character, name in reversed(letters.GREEK.items())} | {
    "ell": letters.SCRIPT_L
}


@dataclass(frozen=True, slots=True)
class Ratio:
    """±(over · numerators) / (under · denominators); no factor is a Product or has a negative
    exponent.

    Equal factors are combined: x x^2 is x^3. `over` and `under` are positive; `over` is 0 for the
    number 0.
    """

    negative: bool
    over: int
    under: int
    numerators: _Factors
    denominators: _Factors

    def numbers(self, decimals: frozenset[Fraction] = frozenset()) -> tuple[str, str]:
        """`over` and `under` in digits; (398600.4418, 1) if the fraction is much shorter as a
        decimal number.

        A number of `decimals` is written as a decimal number, and so are its small multiples and
        what is shorter so; half of it is (9.81, 2).
        """
        plain = str(self.over), str(self.under)
        value = Fraction(self.over, self.under)
        if value.denominator > 1:
            for divisor in _DIVISORS if decimals else ():
                typed = value * divisor  # 0.5 is 1/2, not the third of a typed 1.5
                if typed in decimals and typed.numerator == value.numerator:
                    with suppress(Inexact):
                        if divisor > 3 and len(digits := decimal_digits(value)) <= _SHORT:
                            return digits, "1"  # 0.0025 for 0.01/4
                    return decimal_digits(typed), str(divisor)
            if any(value / factor in decimals for factor in _FACTORS):
                return decimal_digits(value), "1"
            if value.denominator > _FACTORS[-1] and _is_quotient(value, decimals):
                with suppress(Inexact):
                    return decimal_digits(value), "1"
            if value.numerator > 1 and (below := _below(value, decimals)):
                return decimal_digits(value * below), decimal_digits(below)
            if any(_is_multiple(value, one) for one in decimals):
                digits = decimal_digits(value)
                if len(digits) < len("/".join(plain)):
                    return digits, "1"
        if self.under < (_LEAST_NEAR_DECIMALS if decimals else _LEAST_DECIMAL):
            return plain
        try:
            digits = decimal_digits(value)
        except Inexact:
            return plain
        most = sum(map(len, plain)) + (_LONGER if decimals else -_MUCH - 1)
        return (digits, "1") if len(digits) <= most else plain


def _is_quotient(value: Fraction, typed: frozenset[Fraction]) -> bool:
    """Whether a number is the product or the quotient of two typed ones, or the half of one: 16.35
    is 9.81/0.6 next to 0.3.
    """
    products = ((one, value * one * k) for one in typed for k in _FACTORS)
    return any(value * one in typed or value / one in typed for one in typed) or any(
        found in typed and found != one for one, found in products
    )


def _below(value: Fraction, typed: frozenset[Fraction]) -> Fraction | None:
    """The 1.3 of 9.81/1.3, and the 2.6 of 1/2.6, half of 1/1.3, which are no decimal numbers."""
    of_typed = (one * k for one in typed for k in (1, *_FACTORS) if one.denominator > 1)
    return min((one for one in of_typed if value * one in {1, *typed}), default=None)


def _is_multiple(value: Fraction, typed: Fraction) -> bool:
    """Whether a number is an integer times a typed one, as 16.35 is 3.27*5; 1/2 is no 5*0.1."""
    return typed.numerator > 1 and (value / typed).denominator == 1


def decimal_digits(value: Fraction) -> str:
    """The number as an exact decimal number; Inexact if it is none."""
    return f"{_EXACT.divide(Decimal(value.numerator), Decimal(value.denominator)):f}"


@lru_cache(maxsize=4096)  # printed expressions often occur in expressions that were printed before
def ratio(expression: ex.Expression) -> Ratio:
    """The expression, one term of a sum, as a fraction."""
    parts = [*_factors(expression)]
    coefficient = math.prod(
        (factor for factor, _ in parts if isinstance(factor, Fraction)), start=Fraction(1)
    )
    above, below = (
        _gather(
            factor
            for factor, inverse in parts
            if not isinstance(factor, Fraction) and inverse is side
        )
        for side in (False, True)
    )
    size = abs(coefficient)
    return Ratio(coefficient < 0, size.numerator, size.denominator, *_with_signs(above, below))


def _with_signs(above: _Factors, below: _Factors) -> tuple[_Factors, _Factors]:
    """sign(u) for u/sqrt(u^2)."""
    kept: list[ex.Expression] = []
    for factor in below:
        match factor:
            case ex.Power(ex.Power(base, ex.TWO), ex.HALF) if base in above:
                above = tuple(ex.Apply("sign", base) if other == base else other for other in above)
            case _:
                kept.append(factor)
    return above, tuple(kept)


def _factors(
    expression: ex.Expression, inverse: bool = False
) -> Iterator[tuple[ex.Expression | Fraction, bool]]:
    """The numbers and the other factors, each with whether it is below the fraction line."""
    match expression:
        case ex.Number(value) if value or not inverse:
            yield (1 / value if inverse else value), False
        case ex.Product(factors):
            for factor in factors:
                yield from _factors(factor, inverse)
        case ex.Power(base, ex.Number(exponent)) if exponent < 0:
            yield from _factors(base**-exponent, not inverse)
        case ex.Power(base, ex.Number(exponent)) if (
            exponent.denominator == 1 and (plain := _as_written(base)) != base
        ):
            yield from _factors(plain**exponent, inverse)
        case _:
            yield expression, inverse


@lru_cache(maxsize=512)  # without the cache, each level of nested powers doubles the work
def _as_written(base: ex.Expression) -> ex.Expression:
    """The base of an integer power in the form that the parser builds: 1/u as u^-1, and x x as
    x^2.
    """
    if not isinstance(base, ex.Product | ex.Power):
        return base
    parts = ratio(base)
    if parts.negative or parts.over != 1 or len(parts.numerators) > 1:
        return base
    if not parts.numerators:
        return ex.multiply(ex.number(parts.under), *parts.denominators) ** -1
    alone = parts.under == 1 and not parts.denominators
    return parts.numerators[0] if alone else base


def _gather(factors: Iterable[ex.Expression]) -> _Factors:
    """The factors with equal bases combined, for positive integer exponents, at the place of the
    first.
    """
    table: dict[
        ex.Expression, tuple[int, ex.Expression | None]
    ] = {}  # the count, and the factor if it is unchanged
    for factor in factors:
        base, count = _base(factor)
        stays = (
            factor if base is (factor.base if isinstance(factor, ex.Power) else factor) else None
        )
        table[base] = (table[base][0] + count, None) if base in table else (count, stays)
    return tuple(stays or _factor(base, count) for base, (count, stays) in table.items())


def _base(factor: ex.Expression) -> tuple[ex.Expression, int]:
    match factor:
        case ex.Power(base, exponent) if base == _EXPONENTIAL:
            return _base(ex.Apply("exp", exponent))
        case ex.Apply("exp", ex.Number(value)) if value > 0 and value.denominator == 1:
            return _EXPONENTIAL, int(value)
        case ex.Power(base, ex.Number(value)) if value > 0 and value.denominator == 1:
            inner, count = _base(base)
            return inner, count * int(value)
        case _:
            return factor, 1


def _factor(base: ex.Expression, count: int) -> ex.Expression:
    if count == 1:
        return base
    return (
        ex.Apply("exp", ex.number(count))
        if base == _EXPONENTIAL
        else ex.Power(base, ex.number(count))
    )


# Where a formula stands: by itself, or inside brackets, roots, functions, and fractions.
Place = Literal["alone", "within"]


def signed_terms(expression: ex.Expression, place: Place = "alone") -> list[Ratio]:
    """The terms of a sum, or the one term, in their order; 1 - x^2 begins with its number.

    Within another formula, a nonnegative term comes first: 4 k m - c^2.
    """
    terms = [ratio(term) for term in ex.summands(expression)]
    if terms[0].negative:
        chosen = [
            term
            for term in terms
            if not term.negative and (place == "within" or not term.numerators + term.denominators)
        ]
        terms.sort(key=lambda term: term not in chosen[:1])
    return terms


def has_plain_arguments(function: ex.Arbitrary) -> bool:
    """Whether the arguments are distinct names, so that diff(B(x, y), x) is unambiguous.

    False if t or pi is among them: diff(u, t) is the derivative along the motion, and pi is a
    number.
    """
    arguments = function.arguments
    plain = all(isinstance(u, ex.Symbol) and u not in (ex.TIME, ex.PI) for u in arguments)
    return plain and len(set(arguments)) == len(arguments)


def variables(function: ex.Arbitrary) -> list[ex.Expression]:
    """The variables of differentiation, each repeated according to its order."""
    pairs = zip(function.arguments, function.orders, strict=True)
    return [argument for argument, order in pairs for _ in range(order)]


class _Notation:
    """The output of a notation for each kind of node; the traversal of the tree is common to all
    notations.

    Each method prints one kind of node and prints its parts in the same notation. The methods here
    produce plain text.
    """

    plus, minus = " + ", " - "
    # The signs before and after a formula.
    parentheses, radical = ("(", ")"), ("sqrt(", ")")
    bars = ("abs(", ")")  # of sqrt(u^2)

    def __init__(self, decimals: frozenset[Fraction] = frozenset(), in_order: bool = False) -> None:
        self.decimals, self.in_order = decimals, in_order

    def joined(self, pieces: Sequence[str]) -> str:
        """The terms of a sum with their signs."""
        return "".join(pieces)

    def term(self, term: Ratio) -> str:
        number, divisor = term.numbers(self.decimals)
        if divisor == "1" and not term.denominators:
            return self.product(number, term.numerators)
        return self.quotient((number, term.numerators), (divisor, term.denominators))

    def inside(self, tree: ex.Expression) -> str:
        """The formula within another one."""
        return _written(self, tree, "within")

    def alone(self, coefficient: str, factors: Sequence[ex.Expression]) -> str:
        """Numerator or denominator: a single sum needs no brackets there."""
        if coefficient == "1" and len(factors) == 1:
            return self.inside(factors[0])
        return self.product(coefficient, factors)

    def factor(self, factor: ex.Expression) -> str:
        match factor:
            case ex.Power(base, exponent) if exponent != ex.HALF:
                return self.power(base, exponent)
        return self.atom(factor)

    def atom(self, tree: ex.Expression) -> str:
        match tree:
            case ex.Number(value) if value >= 0 and value.denominator == 1:
                return self.number(str(value))
            case ex.Symbol(name):
                return self.name(name, 0)
            case ex.Velocity(name):
                return self.name(name, 1)
            case ex.Acceleration(name):
                return self.name(name, 2)
            case ex.Ordered(function, argument, order):
                return self.call_of_order(function, order, argument)
            case ex.Apply(function, argument):
                return self.call(function, argument)
            case ex.Power(base, exponent) if exponent == ex.HALF:
                return self.root(base)
            case ex.Arbitrary():
                return self.arbitrary(tree)
        return self.brackets(tree)

    def number(self, digits: str) -> str:
        return digits

    def name(self, name: str, order: int) -> str:
        return name + "'" * order

    def brackets(self, tree: ex.Expression) -> str:
        return self.inside(tree).join(self.parentheses)

    def product(self, coefficient: str, factors: Sequence[ex.Expression]) -> str:
        pieces = [self.number(coefficient)] if coefficient != "1" or not factors else []
        for before, factor in zip((ex.ONE, *factors), factors, strict=False):
            piece = _written_factor(self, factor)
            pieces += [self.times(before, piece, factor), piece] if pieces else [piece]
        return "".join(pieces)

    def times(self, before: ex.Expression, piece: str, factor: ex.Expression) -> str:
        """The sign between a factor and the next, whose output is the piece."""
        return "*"

    def quotient(self, over: _Side, under: _Side) -> str:
        below = self.product(*under)
        alone = len(under[1]) + (under[0] != "1") == 1
        return f"{self.product(*over)}/{below if alone else f'({below})'}"

    def power(self, base: ex.Expression, exponent: ex.Expression) -> str:
        plain = isinstance(exponent, ex.Symbol | ex.Number)
        return f"{self.atom(base)}^{self.atom(exponent) if plain else self.brackets(exponent)}"

    def root(self, base: ex.Expression) -> str:
        match base:
            case ex.Power(inner, exponent) if exponent == ex.TWO:
                return self.inside(inner).join(self.bars)
        return self.inside(base).join(self.radical)

    def call(self, function: str, argument: ex.Expression) -> str:
        return f"{function}{self.brackets(argument)}"

    def call_of_order(self, function: str, order: ex.Expression, argument: ex.Expression) -> str:
        inside = ", ".join(self.inside(part) for part in (order, argument))
        return f"{function}({inside})"

    def arguments(self, function: ex.Arbitrary) -> str:
        return ", ".join(self.inside(argument) for argument in function.arguments)

    def arbitrary(self, function: ex.Arbitrary) -> str:
        name, orders, arguments = function.name, function.orders, self.arguments(function)
        if len(orders) == 1:
            return f"{name}{chr(39) * orders[0]}({arguments})"
        if any(orders) and has_plain_arguments(function):
            return f"diff({name}({arguments}), {', '.join(map(to_text, variables(function)))})"
        return f"{name}{f'[{chr(44).join(map(str, orders))}]' * any(orders)}({arguments})"


# The same expressions are printed in several places and share many parts.
@lru_cache(maxsize=4096)
def _written(notation: _Notation, tree: ex.Expression, place: Place) -> str:
    """The terms, each with a sign except for a nonnegative first term."""
    pieces: list[str] = []
    terms = map(ratio, ex.summands(tree)) if notation.in_order else signed_terms(tree, place)
    for term in terms:
        sign = notation.minus if term.negative else notation.plus
        pieces += [sign if pieces else sign.strip() * term.negative, notation.term(term)]
    return notation.joined(pieces)


@lru_cache(maxsize=4096)
def _written_factor(notation: _Notation, factor: ex.Expression) -> str:
    return notation.factor(factor)


@contextmanager
def with_decimals(typed: frozenset[Fraction]) -> Iterator[None]:
    """Print these numbers as decimal numbers, as their writer did: 9.81 instead of 981/100."""
    mark = _DECIMALS.set(typed)
    try:
        yield
    finally:
        _DECIMALS.reset(mark)


def keeps_order() -> bool:
    """Whether the terms of a sum stay in their order."""
    return _IN_ORDER.get()


@contextmanager
def in_given_order(chosen: bool = True) -> Iterator[None]:
    """Read and print the terms of each sum in their order: -9.8 x + 0.001, not 0.001 - 9.8 x.

    A sum that is read for anything else has its number last.
    """
    mark = _IN_ORDER.set(chosen)
    try:
        yield
    finally:
        _IN_ORDER.reset(mark)


def prints_decimals() -> bool:
    """Whether decimal numbers were typed, so that 19.62 is printed and not 981/50."""
    return bool(_DECIMALS.get())


@lru_cache(maxsize=32)  # one object for each, because its output is stored by it
def _notation(
    notation: Callable[[frozenset[Fraction], bool], _Notation],
    decimals: frozenset[Fraction],
    in_order: bool,
) -> _Notation:
    return notation(decimals, in_order)


def _in(notation: Callable[[frozenset[Fraction], bool], _Notation]) -> _Notation:
    return _notation(notation, _DECIMALS.get(), _IN_ORDER.get())


def _shown(expression: ex.Expression) -> ex.Expression:
    """The formula with its sums in the scale of the typed decimal numbers; as it is, where it is
    shown as it was typed.
    """
    typed = _DECIMALS.get()
    return (
        typed_scale.in_typed_scale(expression, typed) if typed and not keeps_order() else expression
    )


def to_text(expression: ex.Expression) -> str:
    """The canonical text: deterministic, with only the brackets that parsing requires."""
    return _written(_in(_Notation), _shown(expression), "alone")


class _Latex(_Notation):
    parentheses, radical, bars = ("\\left(", "\\right)"), ("\\sqrt{", "}"), ("\\left|", "\\right|")

    def quotient(self, over: _Side, under: _Side) -> str:
        return f"\\frac{{{self.alone(*over)}}}{{{self.alone(*under)}}}"

    def times(self, before: ex.Expression, piece: str, factor: ex.Expression) -> str:
        """A space; a dot before a digit and in x (t + 1), which could mean x at another time."""
        moves = isinstance(before, ex.Symbol | ex.Velocity | ex.Acceleration)
        called = moves and piece.startswith("\\left(") and ex.TIME in ex.walk(factor)
        return " \\cdot " if called or piece[0].isdigit() else " "

    def power(self, base: ex.Expression, exponent: ex.Expression) -> str:
        raised = f"^{{{self.inside(exponent)}}}"
        match base, exponent:
            case ex.Ordered(), _:
                return self.brackets(base) + raised
            case ex.Apply(function, argument), ex.Number(value) if function != "exp" and value > 0:
                return f"{_command(function)}{raised}{self.brackets(argument)}"
            case ex.Apply("exp", argument), _ if not isinstance(argument, ex.Number):
                return self.brackets(base) + raised
        return self.atom(base) + raised

    def name(self, name: str, order: int) -> str:
        return name_latex(name, ("", "dot", "ddot")[order])

    def call(self, function: str, argument: ex.Expression) -> str:
        if function == "exp" and not isinstance(argument, ex.Number):
            return f"e^{{{self.inside(argument)}}}"
        return f"{_command(function)}{self.brackets(argument)}"

    def call_of_order(self, function: str, order: ex.Expression, argument: ex.Expression) -> str:
        return f"{_command(function)}_{{{self.inside(order)}}}{self.brackets(argument)}"

    def arbitrary(self, function: ex.Arbitrary) -> str:
        known = function.integrand if isinstance(function, ex.Integral) else None
        if known and not ex.has(known[1], ex.Apply):
            slope, variable = known
            inside = self.brackets(slope) if isinstance(slope, ex.Sum) else to_latex(slope)
            return f"\\left(\\int {inside} \\, d{to_latex(variable)}\\right)"
        name, orders = name_latex(function.name), function.orders
        if len(orders) == 1 and orders[0] <= 3:
            name += "'" * orders[0]
        elif len(orders) > 1 and any(orders) and has_plain_arguments(function):
            name = _partial(name, function)
        elif any(orders):
            name += f"^{{({','.join(map(str, orders))})}}"
        return f"{name}\\left({self.arguments(function)}\\right)"


def to_latex(expression: ex.Expression) -> str:
    """The formula in LaTeX, without delimiters."""
    return _written(_in(_Latex), _shown(expression), "alone")


def _command(function: str) -> str:
    row = functions.FUNCTION.get(function)
    return (row.command if row else "") or f"\\operatorname{{{function}}}"


def name_latex(name: str, accent: str = "") -> str:
    r"""r1 as r_{1}, phi as \phi, x_left as x_{\mathrm{left}}; `accent` is placed over the body."""
    body, words = body_and_subscript(name)
    body = f"\\{accent}{{{_word(body)}}}" if accent else _word(body)
    subscript = ",".join(map(_word, words))
    return f"{body}_{{{subscript}}}" if subscript else body


def _word(word: str) -> str:
    if displayed_name(word) != word and word not in _NO_COMMAND:
        return f"\\{word}"
    if is_letter_with_number(word):
        return name_latex(word)
    return word if len(word) == 1 or word.isdigit() else f"\\mathrm{{{word}}}"


def _partial(name: str, function: ex.Arbitrary) -> str:
    counts = Counter(to_latex(variable) for variable in variables(function))
    total = sum(counts.values())
    order = f"^{{{total}}}" if total > 1 else ""
    below = " ".join(f"\\partial {u}" + (f"^{{{k}}}" if k > 1 else "") for u, k in counts.items())
    return f"\\frac{{\\partial{order} {name}}}{{{below}}}"


class _Mathml(_Notation):
    plus, minus = "<mo>+</mo>", "<mo>&#x2212;</mo>"
    parentheses, radical = ("<mrow><mo>(</mo>", "<mo>)</mo></mrow>"), ("<msqrt>", "</msqrt>")
    bars = "<mrow><mo>|</mo>", "<mo>|</mo></mrow>"

    def joined(self, pieces: Sequence[str]) -> str:
        return f"<mrow>{''.join(pieces)}</mrow>"

    def quotient(self, over: _Side, under: _Side) -> str:
        return f"<mfrac>{self.alone(*over)}{self.alone(*under)}</mfrac>"

    def alone(self, coefficient: str, factors: Sequence[ex.Expression]) -> str:
        single = coefficient == "1" and len(factors) == 1
        return (
            super().alone(coefficient, factors)
            if single
            else f"<mrow>{self.product(coefficient, factors)}</mrow>"
        )

    def times(self, before: ex.Expression, piece: str, factor: ex.Expression) -> str:
        return _DOT if piece.startswith(("<mn>", "<msup><mn>")) else _TIMES

    def power(self, base: ex.Expression, exponent: ex.Expression) -> str:
        return _raised(
            self.brackets(base) if ex.is_exponential(base) else self.atom(base),
            self.exponent(exponent),
        )

    def exponent(self, tree: ex.Expression) -> str:
        """t/10 on one line, because a fraction in an exponent is too small to read."""
        term, *further = signed_terms(tree, "within")
        simple = all(
            isinstance(part, ex.Symbol | ex.Velocity)
            for part in (*term.numerators, *term.denominators)
        )
        number, divisor = term.numbers(self.decimals)
        if further or not simple or (divisor != "1") + len(term.denominators) != 1:
            return self.inside(tree)
        over, under = (
            self.product(number, term.numerators),
            self.product(divisor, term.denominators),
        )
        return f'<mrow>{self.minus * term.negative}{over}<mo lspace="0" rspace="0">/</mo>{under}</mrow>'

    def number(self, digits: str) -> str:
        return f"<mn>{digits}</mn>"

    def name(self, name: str, order: int) -> str:
        letter, below = body_and_subscript(name)
        body = _identifier(letter)
        if order:
            body = f'<mover accent="true">{body}<mo>{_DOTS[order]}</mo></mover>'
        names = {word: self.name(word, 0) for word in below if is_letter_with_number(word)}
        words = [
            self.number(word) if word.isdigit() else names.get(word) or _identifier(word)
            for word in below
        ]
        return f"<msub>{body}<mrow>{'<mo>,</mo>'.join(words)}</mrow></msub>" if words else body

    def call(self, function: str, argument: ex.Expression) -> str:
        if function == "exp":
            return f"<msup><mi>e</mi>{self.exponent(argument)}</msup>"
        row = functions.FUNCTION.get(function)
        name = escape((row.shown if row else "") or function)
        return f"<mrow><mi>{name}</mi>{_APPLY}{self.brackets(argument)}</mrow>"

    def call_of_order(self, function: str, order: ex.Expression, argument: ex.Expression) -> str:
        name = f"<msub><mi>{functions.FUNCTION[function].shown}</mi>{self.exponent(order)}</msub>"
        return f"<mrow>{name}{_APPLY}{self.brackets(argument)}</mrow>"

    def arbitrary(self, function: ex.Arbitrary) -> str:
        """The function with primes, or, for several arguments, with the orders (1,0) as a
        superscript.
        """
        name, orders = self.name(function.name, 0), function.orders
        if any(orders):
            above = f"<mo>({','.join(map(str, orders))})</mo>"
            one = len(orders) == 1
            name = (
                f"<mrow>{name}{PRIME * orders[0]}</mrow>" if one else f"<msup>{name}{above}</msup>"
            )
        arguments = "<mo>,</mo>".join(self.inside(argument) for argument in function.arguments)
        return f"<mrow>{name}{_APPLY}<mo>(</mo>{arguments}<mo>)</mo></mrow>"


def to_mathml(expression: ex.Expression) -> str:
    """A complete <math> element; all text in it is escaped."""
    written = _written(_in(_Mathml), _shown(expression), "alone")
    return f'<math xmlns="{_NAMESPACE}">{written}</math>'


def _identifier(word: str) -> str:
    return f"<mi>{escape(displayed_name(word))}</mi>"


def _raised(base: str, exponent: str) -> str:
    """A power, with the exponent above an index and not raised by dots over the base."""
    low = base.replace("<mover ", '<mpadded height="1.2ex"><mover ', 1).replace(
        "</mover>", "</mover></mpadded>", 1
    )
    if base.startswith("<msub>"):
        return f"<msubsup>{low.removeprefix('<msub>').removesuffix('</msub>')}{exponent}</msubsup>"
    return f"<msup>{low if base.startswith('<mover ') else base}{exponent}</msup>"


def body_and_subscript(name: str) -> tuple[str, list[str]]:
    """The body of a name and the words of its subscript, each a name or a number.

    p_q_1 and p_q1 are momenta, whose subscript is one name with a numeric subscript.
    """
    match = _PARTS.fullmatch(name)
    body, rest = match.groups() if match else (name, "")
    is_momentum = body == "p" and is_letter_with_number(rest[1:])
    return body, [rest[1:]] if is_momentum else [word for word in rest.split("_") if word]


def is_letter_with_number(word: str) -> bool:
    """Whether this is one letter with a numeric subscript, such as x1, theta1, theta_1."""
    found = _LETTER_AND_NUMBER.fullmatch(word)
    return found is not None and (len(found[1]) == 1 or found[1] in _SHOWN)


def displayed_name(name: str) -> str:
    """The displayed form of a name: a Greek letter as its character, any other name unchanged."""
    return _SHOWN.get(name, name)


def natural(text: str) -> str:
    """A key that sorts texts by the numbers in them: m1, m2, m10."""
    return re.sub(r"\d+", lambda found: found[0].zfill(4), text)
