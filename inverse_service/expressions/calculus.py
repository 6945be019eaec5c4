"""Derivatives of trees (partial and in time, not simplified), and their values at a point.

Values are real numbers of any precision.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from fractions import Fraction
from functools import lru_cache, reduce
from operator import mul
from typing import Any

from mpmath import mp, mpf

from inverse_service import errors
from inverse_service.expressions import functions, tree as ex
from inverse_service.expressions.functions import FUNCTION, STEP, Rule
from inverse_service.expressions.refusals import fault

# Arbitrary function to (names of its arguments, formula in these names).
Definitions = Mapping[str, tuple[tuple[str, ...], ex.Expression]]
Real = Any  # mpmath has no types
# Of an argument of a function: exp of a larger one takes as many digits of log 2 as it has.
_MOST_BITS = 4_096


def _slope(node: ex.Apply) -> ex.Expression:
    """The derivative of a function by its argument; InputError for a step, which is not
    differentiable where its pieces meet.
    """
    if node.function in FUNCTION:
        return functions.slope_of(node)
    raise fault("derivative of pieces", "")


def differentiate(expression: ex.Expression, variable: ex.Expression) -> ex.Expression:
    """The partial derivative with respect to a Symbol, a Velocity or an Acceleration.

    All other names are constants; an arbitrary function A(u) gives A'(u) times the derivative of u
    (chain rule, one term for each argument). ValueError for any other kind of variable.
    """
    if not isinstance(variable, ex.Symbol | ex.Velocity | ex.Acceleration):
        raise ValueError("only a symbol, a velocity or an acceleration can be differentiated by")
    return _partial(expression, variable)


# A large tree is differentiated many times, and its derivatives share most of their parts.
@lru_cache(maxsize=16384)
def _partial(expression: ex.Expression, variable: ex.Expression) -> ex.Expression:
    if isinstance(expression, ex.Symbol | ex.Velocity | ex.Acceleration):
        return ex.ONE if expression == variable else ex.ZERO
    return _derivative(expression, lambda part: _partial(part, variable))


def time_derivative(
    tree: ex.Expression, rates: Iterable[tuple[ex.Expression, ex.Expression]]
) -> ex.Expression:
    """The derivative in time, (leaf, its rate) for each name other than t that changes."""
    return ex.add(
        differentiate(tree, ex.TIME), *(differentiate(tree, leaf) * rate for leaf, rate in rates)
    )


def differentiate_in_time(expression: ex.Expression, coordinates: Collection[str]) -> ex.Expression:
    """d/dt along a motion: t -> 1, q -> q', q' -> q''; parameters are constants.

    ValueError if the expression contains an acceleration (there is no node for third derivatives).
    """
    if ex.has(expression, ex.Acceleration):
        raise ValueError("third derivatives are not accepted")

    def rate(leaf: ex.Expression) -> ex.Expression:
        match leaf:
            case ex.Symbol(name) if name in coordinates:
                return ex.Velocity(name)
            case ex.Velocity(coordinate):
                return ex.Acceleration(coordinate)
            case _:
                return ex.ONE if leaf == ex.TIME else ex.ZERO

    def along(part: ex.Expression) -> ex.Expression:
        return rate(part) if isinstance(part, ex.Symbol | ex.Velocity) else _derivative(part, along)

    return along(expression)


def _derivative(expression: ex.Expression, rate: Rule) -> ex.Expression:
    """The derivative of a node from the derivatives of its parts, which `rate` returns."""
    match expression:
        case ex.Number():
            return ex.ZERO
        case ex.Sum(terms):
            return ex.add(*map(rate, terms))
        case ex.Product(factors):
            slopes = [
                (place, slope)
                for place, factor in enumerate(factors)
                if (slope := rate(factor)) != ex.ZERO
            ]
            return ex.add(
                *(ex.multiply(*factors[:k], slope, *factors[k + 1 :]) for k, slope in slopes)
            )
        case ex.Power(base, exponent):
            return _of_power(base, exponent, rate)
        case ex.Apply():
            inner = rate(expression.argument)
            return ex.ZERO if inner == ex.ZERO else _slope(expression) * inner
        case ex.Arbitrary():
            return _of_function(expression, rate)
    raise TypeError(f"{type(expression).__name__} has no derivative")


def _of_power(base: ex.Expression, exponent: ex.Expression, rate: Rule) -> ex.Expression:
    """(u^w)' = w u^(w-1) u' + u^w log(u) w', without the parts that are zero."""
    terms = []
    inner = rate(base)
    if inner != ex.ZERO:
        lowered = base ** Fraction(-1, 2) if exponent == ex.HALF else base ** (exponent - 1)
        terms.append(exponent * lowered * inner)
    outer = rate(exponent)
    if outer != ex.ZERO:
        terms.append(ex.Power(base, exponent) * ex.Apply("log", base) * outer)
    return ex.add(*terms)


def _of_function(function: ex.Arbitrary, rate: Rule) -> ex.Expression:
    """The chain rule; the partial derivatives are arbitrary functions, or the slopes of an
    integral.
    """
    slopes = (
        function.derivatives
        if isinstance(function, ex.Integral)
        else (None,) * len(function.arguments)
    )
    terms = []
    for place, (slope, argument) in enumerate(zip(slopes, function.arguments, strict=True)):
        inner = rate(argument)
        if inner != ex.ZERO:
            orders = tuple(order + (place == k) for k, order in enumerate(function.orders))
            terms.append((slope or ex.Arbitrary(function.name, function.arguments, orders)) * inner)
    return ex.add(*terms)


def define_functions(tree: ex.Expression, definitions: Definitions) -> ex.Expression:
    """The tree with formulas in place of its arbitrary functions, and their derivatives
    evaluated.
    """
    known: dict[ex.Expression, ex.Expression] = {}

    def define(part: ex.Expression) -> ex.Expression:
        if part not in known:
            inner = ex.rebuild(part, define)
            if isinstance(inner, ex.Arbitrary) and inner.name in definitions:
                inner = _put_in(inner, *definitions[inner.name])
            known[part] = inner
        return known[part]

    return define(tree) if definitions else tree


def _put_in(
    function: ex.Arbitrary, arguments: tuple[str, ...], formula: ex.Expression
) -> ex.Expression:
    for name, order in zip(arguments, function.orders, strict=True):
        for _ in range(order):
            formula = differentiate(formula, ex.Symbol(name))
    return ex.substitute(
        formula, dict(zip(map(ex.Symbol, arguments), function.arguments, strict=True))
    )


@lru_cache(maxsize=1024)
def special_function(kernel: ex.Arbitrary) -> ex.Expression:
    """What the kernel of a special function stands for: J_n(u) for y, and J_n'(u) for y'."""
    *orders, argument = kernel.arguments
    name, u = kernel.name, ex.Symbol("u")
    ordered = FUNCTION[name].ordered  # of order 0 if the kernel has none: polygamma
    tree: ex.Expression = (
        ex.Ordered(name, u, *orders or [ex.ZERO]) if ordered else ex.Apply(name, u)
    )
    for _ in range(kernel.orders[-1]):
        tree = differentiate(tree, u)
    return ex.substitute(tree, {u: argument})


class NoRealValue(errors.InverseServiceError):
    """The tree has no finite real value at the point; it may have one at another point."""

    code = "no-real-value"


def evaluate(expression: ex.Expression, table: Mapping[ex.Expression, Real]) -> Real:
    """The value in mpmath's working precision.

    `table` maps Symbol, Velocity, Acceleration, and complete Arbitrary nodes (with arguments and
    orders) to values. NoRealValue if a node is missing or has no finite real value.
    """
    return evaluate_once(expression, dict(table))


def evaluate_once(expression: ex.Expression, table: dict[ex.Expression, Real]) -> Real:
    """Like `evaluate`, but store every value in the table, so that trees with common parts share
    work.
    """
    known = table.get(expression)
    if known is not None:
        return known
    try:
        value = _value(expression, table)
    except (ZeroDivisionError, ValueError, OverflowError) as error:
        raise NoRealValue(f"a formula has no real value at a point: {error}") from error
    # mpmath writes 0 as 0 * 2^0, and infinity and nan as 0 * 2^k with k != 0.
    if not isinstance(value, mpf) or (value.exp and not value.man):
        raise NoRealValue("a formula has no finite real value at a point")
    table[expression] = value
    return value


def _value(expression: ex.Expression, table: dict[ex.Expression, Real]) -> Real:
    match expression:
        case ex.Number(value):
            return (
                mpf(value.numerator)
                if value.denominator == 1
                else mpf(value.numerator) / value.denominator
            )
        case ex.Sum(terms):
            values = [evaluate_once(term, table) for term in terms]
            return (
                values[0] + values[1] if len(values) == 2 else mp.fsum(values)
            )  # twice as fast as fsum
        case ex.Product(factors):
            return reduce(mul, [evaluate_once(factor, table) for factor in factors])
        case ex.Power(base, ex.Number(value)) if value.denominator == 1:
            return evaluate_once(base, table) ** value.numerator
        case ex.Power(base, exponent):
            return mp.power(evaluate_once(base, table), evaluate_once(exponent, table))
        case ex.Apply(function, argument) if function == STEP:
            value = evaluate_once(argument, table)
            if value == 0:
                raise NoRealValue("a step has no value on its boundary")
            return mpf(value > 0)
        case ex.Apply(function):
            operation: Callable[..., Real] = getattr(mp, FUNCTION[function].mpmath or function)
            inner = functions.arguments_of(expression)[::-1]  # the order first
            values = [evaluate_once(argument, table) for argument in inner]
            if any(value and mp.mag(value) > _MOST_BITS for value in values):
                raise NoRealValue("a function has a number with too many digits as its argument")
            return operation(*values)
        case ex.Arbitrary(name) if name in functions.SPECIAL:
            return evaluate_once(special_function(expression), table)
        case ex.Arbitrary(name, _, _):
            raise NoRealValue(f"no value is given for the function {name}")
        case _ if expression == ex.PI:
            return +mp.pi
        case _:
            raise NoRealValue(f"no value is given for {expression}")
