"""The constructors of `tree.py` with the checks that formulas of strangers need."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.tokens import LIMITS, at_most, limit_passed, refusal
from inverse_service.expressions.tree import (
    ONE,
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    add,
    children,
    multiply,
)

_BITS_PER_DIGIT = 3.3219280948873626
_EXPONENTIAL = Apply("exp", ONE)


def _bits(value: Fraction) -> int:
    """The binary logarithm of the larger of numerator and denominator, rounded down: 0 for 1 and -1."""
    return max(value.numerator.bit_length(), value.denominator.bit_length()) - 1


def _check_bits(total_bits: float, column: int) -> None:
    """LimitError where a number would surely have too many digits; called before it is computed."""
    if total_bits > LIMITS.digits * _BITS_PER_DIGIT:
        raise _too_long(column)


def _check_number(value: Fraction, column: int) -> None:
    """LimitError where a number has too many digits, so that what is accepted can be read back."""
    if max(abs(value.numerator), value.denominator) >= 10**LIMITS.digits:
        raise _too_long(column)


def _too_long(column: int) -> InputError:
    return limit_passed("a number that is computed here has too many digits", column, LIMITS.digits)


def product(factors: Sequence[Expression], column: int) -> Expression:
    """The product; LimitError where its coefficient would be too long."""
    _check_bits(sum(_bits(_coefficient(factor)) for factor in factors), column)
    result = multiply(*factors)
    _check_number(_coefficient(result), column)
    return result


def _coefficient(expression: Expression) -> Fraction:
    first = expression.factors[0] if isinstance(expression, Product) else expression
    return first.value if isinstance(first, Number) else Fraction(1)


def sum_of(terms: Sequence[Expression], column: int) -> Expression:
    """The sum; LimitError where its constant would be too long at any moment."""
    constant = Fraction(0)
    for term in terms:
        for part in term.terms if isinstance(term, Sum) else (term,):
            if isinstance(part, Number):
                constant += part.value
                _check_number(constant, column)
    return add(*terms)


def reciprocal(expression: Expression, column: int) -> Expression:
    """1/u; InputError where u is the number 0."""
    if expression == Number(Fraction(0)):
        raise refusal("a division by zero occurs", column, "divide by something that is not 0")
    return expression**-1


def raised(base: Expression, exponent: Expression, column: int) -> Expression:
    """base ^ exponent, e^u being exp(u); refused where it is too large or has no real value."""
    if base == _EXPONENTIAL:
        return Apply("exp", exponent)
    if isinstance(exponent, Number):
        _check_exponent(exponent.value, column)
        if isinstance(base, Number):
            _check_numbers(base.value, exponent.value, column)
    result = base**exponent
    _check_number(_coefficient(result), column)
    if isinstance(result, Power) and isinstance(result.exponent, Number):
        _check_exponent(result.exponent.value, column)
    return result


def _check_exponent(exponent: Fraction, column: int) -> None:
    if abs(exponent.numerator) > LIMITS.exponent or exponent.denominator > LIMITS.exponent:
        instead = f"the limit is {LIMITS.exponent:,}; declare a parameter and write it in its place"
        raise refusal("the exponent is too large", column, instead, kind=LimitError)


def _check_numbers(base: Fraction, exponent: Fraction, column: int) -> None:
    if base == 0 and exponent <= 0:
        raise refusal("0 to a power that is not positive has no value", column, "write another base or exponent")
    if base < 0 and exponent.denominator != 1:
        base, sign = -base, "-" if exponent.numerator % 2 else ""
        root = f"write {sign}{base if base.denominator == 1 else f'({base})'}^({exponent})"
        instead = root if exponent.denominator % 2 else "write another base or exponent"
        raise refusal("a negative number to this power is not real", column, instead)
    if abs(base) not in (0, 1):
        _check_bits(_bits(base) * float(abs(exponent)), column)


def check_depth(expression: Expression, column: int = 1) -> Expression:
    """The same tree; LimitError where it is deeper than `limits.depth`."""
    level, depth = [expression], 0
    while level:
        depth += 1
        at_most(depth, LIMITS.depth, "the formula is nested too deeply", column)
        level = [part for node in level for part in children(node)]
    return expression
