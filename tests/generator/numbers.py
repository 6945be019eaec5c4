"""Evaluate a SymPy expression directly, without code generation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mpmath
import sympy


def value(expression: sympy.Expr, point: Mapping[sympy.Expr, Any]) -> Any:
    """The number of an expression in mpmath's working precision, real or complex."""
    if expression in point:
        return point[expression]
    if expression == sympy.pi:
        return +mpmath.pi
    if expression == sympy.E:
        return +mpmath.e
    if expression.is_Rational:
        return mpmath.mpf(expression.p) / expression.q
    parts = [value(part, point) for part in expression.args]
    if expression.is_Add:
        return mpmath.fsum(parts)
    if expression.is_Mul:
        return mpmath.fprod(parts)
    if expression.is_Pow:
        return mpmath.power(*parts)
    if isinstance(expression, sympy.Heaviside):
        return (1 + mpmath.sign(parts[0])) / 2
    return getattr(mpmath, expression.func.__name__)(*parts)
