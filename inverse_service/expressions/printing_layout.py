"""What the three printers share: every term as a sign, a numerator and a denominator."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache

from inverse_service.expressions import tree as ex

_EXPONENTIAL = ex.Apply("exp", ex.ONE)


# From which denominator on a decimal number can be much shorter than a fraction, and how many digits that is.
_LEAST_DECIMAL, _MUCH = 1000, 2


@dataclass(frozen=True, slots=True)
class Ratio:
    """±(over · numerators) / (under · denominators); no factor is a Product or a power below zero.

    Equal factors are gathered: x x^2 is x^3. `over` and `under` are positive, `over` 0 for the number 0.
    """

    negative: bool
    over: int
    under: int
    numerators: tuple[ex.Expression, ...]
    denominators: tuple[ex.Expression, ...]

    @property
    def numbers(self) -> tuple[str, str]:
        """over and under in digits; (398600.4418, 1) where a fraction is much shorter as a decimal number."""
        plain = str(self.over), str(self.under)
        if self.under < _LEAST_DECIMAL:
            return plain
        tens, rest = 0, self.under
        while rest % 2 == 0 or rest % 5 == 0:
            rest //= 10 if rest % 10 == 0 else 5 if rest % 5 == 0 else 2
            tens += 1
        digits = str(self.over * 10**tens // self.under).rjust(tens + 1, "0") if rest == 1 else ""
        decimal = f"{digits[:-tens]}.{digits[-tens:]}"
        return (decimal, "1") if digits and len(decimal) + _MUCH < sum(map(len, plain)) else plain


@dataclass(slots=True)
class _Parts:
    coefficient: Fraction = Fraction(1)
    numerators: list[ex.Expression] = field(default_factory=list)
    denominators: list[ex.Expression] = field(default_factory=list)


@lru_cache(maxsize=4096)  # what is printed is often a part of what was printed before
def ratio(expression: ex.Expression) -> Ratio:
    """The expression, one term of a sum, as a fraction."""
    parts = _Parts()
    _collect(expression, False, parts)
    coefficient = abs(parts.coefficient)
    return Ratio(
        parts.coefficient < 0,
        coefficient.numerator,
        coefficient.denominator,
        _gather(parts.numerators),
        _gather(parts.denominators),
    )


def _collect(expression: ex.Expression, inverse: bool, parts: _Parts) -> None:
    match expression:
        case ex.Number(value) if value or not inverse:
            parts.coefficient *= 1 / value if inverse else value
        case ex.Product(factors):
            for factor in factors:
                _collect(factor, inverse, parts)
        case ex.Power(base, ex.Number(exponent)) if exponent < 0:
            _collect(base**-exponent, not inverse, parts)
        case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1 and (plain := _as_written(base)) != base:
            _collect(plain**exponent, inverse, parts)
        case _:
            (parts.denominators if inverse else parts.numerators).append(expression)


@lru_cache(maxsize=512)  # without it the work doubles with every level of nested powers
def _as_written(base: ex.Expression) -> ex.Expression:
    """The base of a whole power as the reader has it: 1/u as u^-1, and x x as x^2."""
    if not isinstance(base, ex.Product | ex.Power):
        return base
    parts = ratio(base)
    if parts.negative or parts.over != 1 or len(parts.numerators) > 1:
        return base
    if not parts.numerators:
        return ex.multiply(ex.number(parts.under), *parts.denominators) ** -1
    alone = parts.under == 1 and not parts.denominators
    return parts.numerators[0] if alone else base


def _gather(factors: Iterable[ex.Expression]) -> tuple[ex.Expression, ...]:
    """Equal bases with whole positive exponents put together at the place of the first."""
    table: dict[ex.Expression, int] = {}
    for factor in factors:
        base, count = _base(factor)
        table[base] = table.get(base, 0) + count
    return tuple(_factor(base, count) for base, count in table.items())


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
    return ex.Apply("exp", ex.number(count)) if base == _EXPONENTIAL else ex.Power(base, ex.number(count))


def signed_terms(expression: ex.Expression, within: bool = False) -> list[Ratio]:
    """The terms of a sum, or the one term, in their order; 1 - x^2 begins with its number.

    `within` brackets, roots, functions and fractions a term that is not negative comes first: 4 k m - c^2.
    """
    terms = [ratio(term) for term in (expression.terms if isinstance(expression, ex.Sum) else (expression,))]
    if terms[0].negative:
        chosen = [term for term in terms if not term.negative and (within or not term.numerators + term.denominators)]
        terms.sort(key=lambda term: term not in chosen[:1])
    return terms


def signed(expression: ex.Expression, write: Callable[[Ratio], str], within: bool = False) -> str:
    """The terms as they are written, with a sign before each but a first one that is not negative."""
    pieces: list[str] = []
    for term in signed_terms(expression, within):
        sign = " - " if term.negative else " + "
        pieces += [sign if pieces else sign.strip(" +"), write(term)]
    return "".join(pieces)


def has_plain_arguments(function: ex.Arbitrary) -> bool:
    """Whether the arguments are names, all different: then diff(B(x, y), x) is clear.

    Not with t or pi among them: diff(u, t) is the derivative along the motion, and pi is a number.
    """
    arguments = function.arguments
    plain = all(isinstance(u, ex.Symbol) and u not in (ex.TIME, ex.PI) for u in arguments)
    return plain and len(set(arguments)) == len(arguments)


def variables(function: ex.Arbitrary) -> list[ex.Expression]:
    """What is differentiated by, each as often as its order."""
    pairs = zip(function.arguments, function.orders, strict=True)
    return [argument for argument, order in pairs for _ in range(order)]
