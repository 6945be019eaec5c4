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

from inverse_service.expressions.tree import HALF, PI, Apply, Expression, Number, Power, rebuild, square_root


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
        return _exp(node.exponent * Apply("log", node.base))
    if isinstance(node.base, Apply) and node.base.function == "exp":
        return _exp(node.exponent * node.base.argument)
    return node


def _exp(u: Expression) -> Expression:
    return Apply("exp", u)


def _sin(u: Expression) -> Expression:
    return Apply("sin", u)


def _cos(u: Expression) -> Expression:
    return Apply("cos", u)


def _cosh(u: Expression) -> Expression:
    return HALF * (_exp(u) + _exp(-u))


def _sinh(u: Expression) -> Expression:
    return HALF * (_exp(u) - _exp(-u))


def _asin(u: Expression) -> Expression:
    return Apply("atan", u / square_root(1 - u**2))


def _log_with_root(u: Expression, sign: int) -> Expression:
    return Apply("log", u + square_root(u**2 + sign))


_REWRITE: dict[str, Callable[[Expression], Expression]] = {
    "tan": lambda u: _sin(u) / _cos(u),
    "cot": lambda u: _cos(u) / _sin(u),
    "sec": lambda u: _cos(u) ** -1,
    "csc": lambda u: _sin(u) ** -1,
    "cosh": _cosh,
    "sinh": _sinh,
    "tanh": lambda u: _sinh(u) / _cosh(u),
    "coth": lambda u: _cosh(u) / _sinh(u),
    "sech": lambda u: _cosh(u) ** -1,
    "csch": lambda u: _sinh(u) ** -1,
    "asin": _asin,
    "Heaviside": lambda u: HALF * (1 + u / square_root(u**2)),
    "acos": lambda u: HALF * PI - _asin(u),
    "asinh": lambda u: _log_with_root(u, 1),
    "acosh": lambda u: _log_with_root(u, -1),
    "atanh": lambda u: HALF * Apply("log", (1 + u) / (1 - u)),
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
