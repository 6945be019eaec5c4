"""Elementary functions written by few: exp, log, sin, cos, atan, rational powers.

Rules (real domain): tan u = sin u / cos u and its kin; cosh u = (e^u + e^-u)/2 and its kin;
asin u = atan(u / sqrt(1 - u^2)), acos u = pi/2 - asin u, asinh u = log(u + sqrt(u^2 + 1)),
acosh u = log(u + sqrt(u^2 - 1)), atanh u = log((1 + u)/(1 - u))/2; b^e = exp(e log b) for an
exponent that is no rational number; (e^u)^r = e^(r u). Each holds where the left side is real.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache

from inverse_service.expressions.tree import (
    HALF,
    ONE,
    PI,
    Apply,
    Expression,
    Number,
    Power,
    add,
    divide,
    multiply,
    negate,
    number,
    power,
    rebuild,
    square_root,
    subtract,
)


@lru_cache(maxsize=8192)
def to_kernels(expression: Expression) -> Expression:
    """The same function of the same variables, written with the six kernels only."""
    inner = rebuild(expression, to_kernels)
    if isinstance(inner, Apply) and inner.function in _REWRITE:
        return _REWRITE[inner.function](inner.argument)
    if isinstance(inner, Power):
        return _rational_power(inner)
    return inner


def _rational_power(node: Power) -> Expression:
    if not isinstance(node.exponent, Number):
        return _exp(multiply(node.exponent, Apply("log", node.base)))
    if isinstance(node.base, Apply) and node.base.function == "exp":
        return _exp(multiply(node.exponent, node.base.argument))
    return node


def _exp(u: Expression) -> Expression:
    return Apply("exp", u)


def _sin(u: Expression) -> Expression:
    return Apply("sin", u)


def _cos(u: Expression) -> Expression:
    return Apply("cos", u)


def _cosh(u: Expression) -> Expression:
    return multiply(HALF, add(_exp(u), _exp(negate(u))))


def _sinh(u: Expression) -> Expression:
    return multiply(HALF, subtract(_exp(u), _exp(negate(u))))


def _asin(u: Expression) -> Expression:
    return Apply("atan", divide(u, square_root(subtract(ONE, power(u, 2)))))


def _log_with_root(u: Expression, sign: int) -> Expression:
    return Apply("log", add(u, square_root(add(power(u, 2), number(sign)))))


_REWRITE: dict[str, Callable[[Expression], Expression]] = {
    "tan": lambda u: divide(_sin(u), _cos(u)),
    "cot": lambda u: divide(_cos(u), _sin(u)),
    "sec": lambda u: power(_cos(u), -1),
    "csc": lambda u: power(_sin(u), -1),
    "cosh": _cosh,
    "sinh": _sinh,
    "tanh": lambda u: divide(_sinh(u), _cosh(u)),
    "coth": lambda u: divide(_cosh(u), _sinh(u)),
    "sech": lambda u: power(_cosh(u), -1),
    "csch": lambda u: power(_sinh(u), -1),
    "asin": _asin,
    "Heaviside": lambda u: multiply(HALF, add(ONE, divide(u, square_root(power(u, 2))))),
    "acos": lambda u: subtract(multiply(HALF, PI), _asin(u)),
    "asinh": lambda u: _log_with_root(u, 1),
    "acosh": lambda u: _log_with_root(u, -1),
    "atanh": lambda u: multiply(HALF, Apply("log", divide(add(ONE, u), subtract(ONE, u)))),
}


def is_even_root(node: Expression) -> bool:
    """Whether the node is a power with an even denominator."""
    return isinstance(node, Power) and isinstance(node.exponent, Number) and node.exponent.value.denominator % 2 == 0


def is_root(node: Expression) -> bool:
    """Whether the node is a power with a fractional exponent."""
    return (
        isinstance(node, Power)
        and isinstance(node.exponent, Number)
        and node.exponent.value != Fraction(node.exponent.value.numerator)
    )
