"""Complex numbers whose real and imaginary parts are trees, and analytic functions of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce

from inverse_service.expressions.tree import (
    HALF,
    ZERO,
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    divide,
    multiply,
    negate,
    number,
    power,
    subtract,
)

_LARGEST_POWER = 6


class NotAnalytic(ArithmeticError):
    """A function without formulas for its real and imaginary part here."""


@dataclass(frozen=True, slots=True)
class ComplexTree:
    """real + i imaginary."""

    real: Expression
    imaginary: Expression = ZERO

    def __add__(self, other: ComplexTree) -> ComplexTree:
        return ComplexTree(add(self.real, other.real), add(self.imaginary, other.imaginary))

    def __mul__(self, other: ComplexTree) -> ComplexTree:
        return ComplexTree(
            subtract(multiply(self.real, other.real), multiply(self.imaginary, other.imaginary)),
            add(multiply(self.real, other.imaginary), multiply(self.imaginary, other.real)),
        )

    def inverse(self) -> ComplexTree:
        if self.imaginary == ZERO:
            return ComplexTree(power(self.real, -1))
        below = squared_modulus(self)
        return ComplexTree(divide(self.real, below), divide(negate(self.imaginary), below))


def squared_modulus(value: ComplexTree) -> Expression:
    return add(power(value.real, 2), power(value.imaginary, 2))


def logarithm(value: ComplexTree) -> ComplexTree:
    """log|z| + i atan(Im z/Re z), a branch of log z where Re z > 0 and up to a constant elsewhere."""
    if value.imaginary == ZERO:
        return ComplexTree(Apply("log", value.real))
    modulus = multiply(HALF, Apply("log", squared_modulus(value)))
    return ComplexTree(modulus, Apply("atan", divide(value.imaginary, value.real)))


def continued(tree: Expression, table: Mapping[Expression, ComplexTree]) -> ComplexTree:
    """The tree with complex values for some of its names; NotAnalytic for functions not known here."""
    if tree in table:
        return table[tree]
    match tree:
        case Number() | Symbol() | Velocity():
            return ComplexTree(tree)
        case Sum(terms):
            return reduce(ComplexTree.__add__, (continued(term, table) for term in terms))
        case Product(factors):
            return reduce(ComplexTree.__mul__, (continued(factor, table) for factor in factors))
        case Power(base, Number(exponent)):
            return _power(continued(base, table), exponent)
        case Apply(function, argument):
            return _applied(function, continued(argument, table))
    raise NotAnalytic


def _power(base: ComplexTree, exponent: Fraction) -> ComplexTree:
    """z^e, by products for small whole e, else |z|^e e^(i e arg z)."""
    if base.imaginary == ZERO:
        return ComplexTree(power(base.real, exponent))
    if exponent.denominator == 1 and abs(exponent) <= _LARGEST_POWER:
        whole = reduce(ComplexTree.__mul__, [base] * abs(int(exponent)))
        return whole if exponent > 0 else whole.inverse()
    angle = multiply(number(exponent), logarithm(base).imaginary)
    modulus = ComplexTree(power(squared_modulus(base), exponent / 2))
    return modulus * ComplexTree(Apply("cos", angle), Apply("sin", angle))


def _applied(function: str, z: ComplexTree) -> ComplexTree:
    """exp, log and the circular and hyperbolic sine and cosine."""
    if z.imaginary == ZERO:
        return ComplexTree(Apply(function, z.real))
    if function == "log":
        return logarithm(z)
    if function == "exp":
        turned = ComplexTree(Apply("cos", z.imaginary), Apply("sin", z.imaginary))
        return ComplexTree(Apply("exp", z.real)) * turned
    if function in ("sin", "cos"):
        sine, cosine = (Apply(name, z.real) for name in ("sin", "cos"))
        odd, even = (Apply(name, z.imaginary) for name in ("sinh", "cosh"))
        if function == "sin":
            return ComplexTree(multiply(sine, even), multiply(cosine, odd))
        return ComplexTree(multiply(cosine, even), negate(multiply(sine, odd)))
    if function in ("sinh", "cosh"):
        odd, even = (Apply(name, z.real) for name in ("sinh", "cosh"))
        sine, cosine = (Apply(name, z.imaginary) for name in ("sin", "cos"))
        pair = (odd, even) if function == "sinh" else (even, odd)
        return ComplexTree(multiply(pair[0], cosine), multiply(pair[1], sine))
    raise NotAnalytic
