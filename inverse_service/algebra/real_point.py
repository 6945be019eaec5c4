"""One real point at which f is defined: it says on which branch of its roots a verdict holds."""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction

import mpmath

from inverse_service.algebra.point import Variable
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import (
    PI,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    walk,
)

_DIGITS = 40
_TRIES_PER_SCALE = 60
_SCALES = ("1.7", "0.9", "0.4", "0.1", "5", "0.01", "30")
_TINY = mpmath.mpf(10) ** -12
_FUNCTIONS = {
    "exp": mpmath.exp, "log": mpmath.log, "sin": mpmath.sin, "cos": mpmath.cos, "atan": mpmath.atan, "tan": mpmath.tan,
}  # fmt: skip

RealTable = dict[Expression, mpmath.mpf]


class NotReal(ArithmeticError):
    """The expression has no finite real value at the point."""


def real_value(expression: Expression, table: RealTable) -> mpmath.mpf:
    """The value of a tree in kernels; variables and arbitrary functions are looked up."""
    match expression:
        case Number(value):
            return mpmath.mpf(value.numerator) / value.denominator
        case Symbol() | Velocity() | Arbitrary():
            return mpmath.pi() if expression == PI else table[expression]
        case Sum(terms):
            return mpmath.fsum(real_value(term, table) for term in terms)
        case Product(factors):
            return mpmath.fprod(real_value(factor, table) for factor in factors)
        case Power(base, Number(exponent)):
            return _real_power(real_value(base, table), exponent)
        case Apply(function, argument):
            return _real_function(function, real_value(argument, table))
    raise TypeError(f"{type(expression).__name__} is not a kernel")


def _real_power(base: mpmath.mpf, exponent: Fraction) -> mpmath.mpf:
    if exponent < 0 and abs(base) < _TINY:
        raise NotReal("division by zero")
    if exponent.denominator == 1:
        return base ** int(exponent)
    if base < 0:
        raise NotReal("root of a negative number")
    return base ** (mpmath.mpf(exponent.numerator) / exponent.denominator)


def _real_function(function: str, argument: mpmath.mpf) -> mpmath.mpf:
    if function == "log" and argument <= _TINY:
        raise NotReal("logarithm of a number that is not positive")
    if function == "exp" and abs(argument) > 200:
        raise NotReal("exponential out of range")
    return _FUNCTIONS[function](argument)


def find_real_point(expressions: Sequence[Expression], variables: Sequence[Variable], seed: int) -> RealTable | None:
    """A random real point at which all expressions have values, or None after some hundred tries."""
    names = [*variables, *{node for e in expressions for node in walk(e) if isinstance(node, Arbitrary)}]
    names = list(dict.fromkeys(names))
    generator = random.Random(f"real {seed}")
    with mpmath.workdps(_DIGITS):
        for scale in _SCALES:
            for attempt in range(_TRIES_PER_SCALE):
                table = {name: _draw(generator, mpmath.mpf(scale), attempt % 2 == 0) for name in names}
                if _is_defined(expressions, table):
                    return table
    return None


def _draw(generator: random.Random, scale: mpmath.mpf, positive: bool) -> mpmath.mpf:
    magnitude = mpmath.mpf(generator.randrange(1_000, 10_000)) / 10_000 * scale
    return magnitude if positive or generator.random() < 0.5 else -magnitude


def _is_defined(expressions: Sequence[Expression], table: RealTable) -> bool:
    try:
        return all(mpmath.isfinite(real_value(expression, table)) for expression in expressions)
    except (NotReal, ZeroDivisionError, OverflowError):
        return False


def real_sign(expression: Expression, table: RealTable) -> int:
    """The sign of a value that is not zero."""
    with mpmath.workdps(_DIGITS):
        value = real_value(expression, table)
        if abs(value) < _TINY:
            raise IrreducibleAtoms("the sign of an expression under a root could not be told at a real point")
        return 1 if value > 0 else -1


def turns(table: RealTable | None, atom: Expression, linear: Sequence[tuple[Expression, Fraction]]) -> Fraction:
    """(atom - sum a_j u_j)/pi at the real point: what an arctangent relation leaves open."""
    if table is None:
        raise IrreducibleAtoms("an arctangent depends on other angles and no real point of f was found")
    with mpmath.workdps(_DIGITS):
        total = real_value(atom, table)
        for u, a in linear:
            total -= real_value(u, table) * a.numerator / a.denominator
        steps = total / mpmath.pi * 12
        nearest = int(mpmath.nint(steps))
        if abs(steps - nearest) > _TINY:
            raise IrreducibleAtoms("an arctangent relation holds only up to a constant that is no multiple of pi/12")
    return Fraction(nearest, 12)
