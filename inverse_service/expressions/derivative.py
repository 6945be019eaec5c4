"""Derivatives of trees: partial ones and the one along time; the result is not simplified."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from fractions import Fraction
from functools import lru_cache

from inverse_service.errors import InputError
from inverse_service.expressions.functions import FUNCTION, Rule
from inverse_service.expressions.tree import (
    HALF,
    ONE,
    TIME,
    ZERO,
    Acceleration,
    Apply,
    Arbitrary,
    Expression,
    Integral,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    apply,
    multiply,
    rebuild,
    substitute,
    walk,
)

# For each arbitrary function the names of its arguments and its formula over them.
Definitions = Mapping[str, tuple[tuple[str, ...], Expression]]


def _rule(function: str) -> Rule:
    """The derivative of a function; InputError for a step, which has none where its pieces meet."""
    if function in FUNCTION:
        return FUNCTION[function].derivative
    instead = "piecewise formulas are accepted in the right sides of equations; write one piece here"
    raise InputError(f"a piecewise formula has no derivative where its pieces meet: {instead}.")


def differentiate(expression: Expression, variable: Expression) -> Expression:
    """The partial derivative with respect to a Symbol, a Velocity or an Acceleration.

    All other names are constants; an arbitrary function A(u) gives A'(u) times the derivative of u
    (chain rule, one term for each argument). ValueError for any other kind of variable.
    """
    if not isinstance(variable, Symbol | Velocity | Acceleration):
        raise ValueError("only a symbol, a velocity or an acceleration can be differentiated by")
    return _partial(expression, variable)


# One large tree is differentiated many times over, and its derivatives share most of their parts.
@lru_cache(maxsize=16384)
def _partial(expression: Expression, variable: Expression) -> Expression:
    if isinstance(expression, Symbol | Velocity | Acceleration):
        return ONE if expression == variable else ZERO
    return _derivative(expression, lambda part: _partial(part, variable))


def differentiate_in_time(expression: Expression, coordinates: Collection[str]) -> Expression:
    """d/dt along a motion: t -> 1, q -> q', q' -> q''; parameters are constants.

    ValueError where the expression holds an acceleration (third derivatives have no node).
    """
    if any(isinstance(node, Acceleration) for node in walk(expression)):
        raise ValueError("third derivatives are not accepted")

    def rate(leaf: Expression) -> Expression:
        match leaf:
            case Symbol(name) if name in coordinates:
                return Velocity(name)
            case Velocity(coordinate):
                return Acceleration(coordinate)
            case _:
                return ONE if leaf == TIME else ZERO

    def along(part: Expression) -> Expression:
        return rate(part) if isinstance(part, Symbol | Velocity) else _derivative(part, along)

    return along(expression)


def _derivative(expression: Expression, rate: Rule) -> Expression:
    """By the derivatives of the parts of a node."""
    match expression:
        case Number():
            return ZERO
        case Sum(terms):
            return add(*map(rate, terms))
        case Product(factors):
            return _of_product(factors, rate)
        case Power(base, exponent):
            return _of_power(base, exponent, rate)
        case Apply(function, argument):
            inner = rate(argument)
            return ZERO if inner == ZERO else _rule(function)(argument) * inner
        case Integral():
            return _of_integral(expression, rate)
        case Arbitrary():
            return _of_arbitrary(expression, rate)
    raise TypeError(f"{type(expression).__name__} has no derivative")


def _of_product(factors: tuple[Expression, ...], rate: Rule) -> Expression:
    terms = []
    for place, factor in enumerate(factors):
        inner = rate(factor)
        if inner != ZERO:
            terms.append(multiply(*factors[:place], inner, *factors[place + 1 :]))
    return add(*terms)


def _of_power(base: Expression, exponent: Expression, rate: Rule) -> Expression:
    """(u^w)' = w u^(w-1) u' + u^w log(u) w', each part only where it is not zero."""
    terms = []
    inner = rate(base)
    if inner != ZERO:
        terms.append(exponent * _lowered(base, exponent) * inner)
    outer = rate(exponent)
    if outer != ZERO:
        terms.append(Power(base, exponent) * apply("log", base) * outer)
    return add(*terms)


def _lowered(base: Expression, exponent: Expression) -> Expression:
    return base ** Fraction(-1, 2) if exponent == HALF else base ** (exponent - 1)


def _of_integral(integral: Integral, rate: Rule) -> Expression:
    """By its own derivatives; one that is left open is that of an arbitrary function of the same name."""
    terms = []
    for place, (slope, argument) in enumerate(zip(integral.slopes, integral.arguments, strict=True)):
        inner = rate(argument)
        if inner != ZERO:
            if slope is None:
                orders = tuple(int(k == place) for k in range(len(integral.arguments)))
                slope = Arbitrary(integral.name, integral.arguments, orders)
            terms.append(slope * inner)
    return add(*terms)


def _of_arbitrary(function: Arbitrary, rate: Rule) -> Expression:
    terms = []
    for place, argument in enumerate(function.arguments):
        inner = rate(argument)
        if inner != ZERO:
            orders = tuple(order + (place == k) for k, order in enumerate(function.orders))
            terms.append(Arbitrary(function.name, function.arguments, orders) * inner)
    return add(*terms)


def define_functions(tree: Expression, definitions: Definitions) -> Expression:
    """The tree with the formulas of its arbitrary functions put in, derivatives taken."""
    known: dict[Expression, Expression] = {}

    def define(part: Expression) -> Expression:
        if part not in known:
            inner = rebuild(part, define)
            if isinstance(inner, Arbitrary) and inner.name in definitions:
                inner = _put_in(inner, *definitions[inner.name])
            known[part] = inner
        return known[part]

    return define(tree) if definitions else tree


def _put_in(function: Arbitrary, arguments: tuple[str, ...], formula: Expression) -> Expression:
    for name, order in zip(arguments, function.orders, strict=True):
        for _ in range(order):
            formula = differentiate(formula, Symbol(name))
    return substitute(formula, dict(zip(map(Symbol, arguments), function.arguments, strict=True)))
