"""The elementary functions, derivatives of trees (partial and in time, not simplified), and their values at a point.

Values are real numbers of any precision.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache, reduce
from operator import mul
from typing import Any

from mpmath import mp, mpf

from inverse_service import errors
from inverse_service.expressions import tree as ex
from inverse_service.expressions.refusals import fault

# Arbitrary function to (names of its arguments, formula in these names).
Definitions = Mapping[str, tuple[tuple[str, ...], ex.Expression]]
Rule = Callable[[ex.Expression], ex.Expression]
_NOT_ZERO = (bool, "a number other than 0")
Real = Any  # mpmath has no types
# The function that is 1 where its argument is positive and 0 where it is negative.
STEP = "Heaviside"
_IN_MPMATH = {"log": "ln"}


@dataclass(frozen=True, slots=True)
class Function:
    """One function f of one real argument u.

    `derivative` maps u to the tree f'(u). `parity` is 1 if f(-u) = f(u), -1 if f(-u) = -f(u), else 0. `reciprocal`
    names g with f = 1/g, `undoes` names g with f(g(u)) = u wherever g is real, and `root` is g, a, b with f(g(u)) =
    sqrt(a + b u^2) there. `holds` says whether f has a real value at a number, and `wanted` describes these numbers.
    `command` is the LaTeX command, `shown` the printed name.
    """

    name: str
    derivative: Rule
    parity: int = 0
    reciprocal: str = ""
    holds: Callable[[Fraction], bool] | None = None
    wanted: str = ""
    command: str = ""
    shown: str = ""
    undoes: str = ""
    root: tuple[str, int, int] | None = None


def _inverse_root(u: ex.Expression) -> ex.Expression:
    return u ** Fraction(-1, 2)


def _other(function: str) -> Rule:
    return lambda u: ex.Apply(function, u)


def _negative_product(first: str, second: str) -> Rule:
    return lambda u: -1 * ex.Apply(first, u) * ex.Apply(second, u)


_ROWS = (
    Function("exp", _other("exp"), command="\\exp"),
    Function("log", lambda u: u**-1, 0, "", lambda u: u > 0, "a positive number", "\\ln", "ln"),
    Function("sin", _other("cos"), -1, command="\\sin", undoes="asin", root=("acos", 1, -1)),
    Function("cos", lambda u: -ex.Apply("sin", u), 1, command="\\cos", undoes="acos", root=("asin", 1, -1)),
    Function("tan", lambda u: 1 + ex.Apply("tan", u)**2, -1, command="\\tan", undoes="atan"),
    Function("cot", lambda u: -(1 + ex.Apply("cot", u)**2), -1, "tan", *_NOT_ZERO, "\\cot"),
    Function("sec", lambda u: ex.Apply("sec", u) * ex.Apply("tan", u), 1, "cos", command="\\sec"),
    Function("csc", _negative_product("csc", "cot"), -1, "sin", *_NOT_ZERO, "\\csc"),
    Function("sinh", _other("cosh"), -1, command="\\sinh", undoes="asinh", root=("acosh", -1, 1)),
    Function("cosh", _other("sinh"), 1, command="\\cosh", undoes="acosh", root=("asinh", 1, 1)),
    Function("tanh", lambda u: 1 - ex.Apply("tanh", u)**2, -1, command="\\tanh", undoes="atanh"),
    Function("coth", lambda u: 1 - ex.Apply("coth", u)**2, -1, "tanh", *_NOT_ZERO, "\\coth"),
    Function("sech", _negative_product("sech", "tanh"), 1, "cosh"),
    Function("csch", _negative_product("csch", "coth"), -1, "sinh", *_NOT_ZERO),
    Function("asin", lambda u: _inverse_root(1 - u**2), -1, "", lambda u: abs(u) <= 1,
             "a number between -1 and 1", "\\arcsin", "arcsin"),
    Function("acos", lambda u: -_inverse_root(1 - u**2), 0, "", lambda u: abs(u) <= 1,
             "a number between -1 and 1", "\\arccos", "arccos"),
    Function("atan", lambda u: (1 + u**2)**-1, -1, command="\\arctan", shown="arctan"),
    Function("asinh", lambda u: _inverse_root(1 + u**2), -1, undoes="sinh"),
    # Two roots, because sqrt(u^2 - 1) would also be real for u < -1, where acosh is not.
    Function("acosh", lambda u: _inverse_root(u - 1) * _inverse_root(u + 1), 0, "",
             lambda u: u >= 1, "a number not less than 1"),
    Function("atanh", lambda u: (1 - u**2)**-1, -1, "", lambda u: abs(u) < 1,
             "a number between -1 and 1", undoes="tanh"),
)  # fmt: skip
FUNCTION: dict[str, Function] = {row.name: row for row in _ROWS}
RECIPROCALS: dict[str, str] = {row.name: row.reciprocal for row in _ROWS if row.reciprocal}


def _rule(function: str) -> Rule:
    """The derivative of a function; InputError for a step, which is not differentiable where its pieces meet."""
    if function in FUNCTION:
        return FUNCTION[function].derivative
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


def along(tree: ex.Expression, rates: Iterable[tuple[ex.Expression, ex.Expression]]) -> ex.Expression:
    """The derivative in time, (leaf, its rate) for each name other than t that changes."""
    return ex.add(differentiate(tree, ex.TIME), *(differentiate(tree, leaf) * rate for leaf, rate in rates))


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
            slopes = [(place, slope) for place, factor in enumerate(factors) if (slope := rate(factor)) != ex.ZERO]
            return ex.add(*(ex.multiply(*factors[:k], slope, *factors[k + 1 :]) for k, slope in slopes))
        case ex.Power(base, exponent):
            return _of_power(base, exponent, rate)
        case ex.Apply(function, argument):
            inner = rate(argument)
            return ex.ZERO if inner == ex.ZERO else _rule(function)(argument) * inner
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
    """The chain rule; the partial derivatives are arbitrary functions, or the slopes of an integral."""
    slopes = function.slopes if isinstance(function, ex.Integral) else (None,) * len(function.arguments)
    terms = []
    for place, (slope, argument) in enumerate(zip(slopes, function.arguments, strict=True)):
        inner = rate(argument)
        if inner != ex.ZERO:
            orders = tuple(order + (place == k) for k, order in enumerate(function.orders))
            terms.append((slope or ex.Arbitrary(function.name, function.arguments, orders)) * inner)
    return ex.add(*terms)


def define_functions(tree: ex.Expression, definitions: Definitions) -> ex.Expression:
    """The tree with formulas in place of its arbitrary functions, and their derivatives evaluated."""
    known: dict[ex.Expression, ex.Expression] = {}

    def define(part: ex.Expression) -> ex.Expression:
        if part not in known:
            inner = ex.rebuild(part, define)
            if isinstance(inner, ex.Arbitrary) and inner.name in definitions:
                inner = _put_in(inner, *definitions[inner.name])
            known[part] = inner
        return known[part]

    return define(tree) if definitions else tree


def _put_in(function: ex.Arbitrary, arguments: tuple[str, ...], formula: ex.Expression) -> ex.Expression:
    for name, order in zip(arguments, function.orders, strict=True):
        for _ in range(order):
            formula = differentiate(formula, ex.Symbol(name))
    return ex.substitute(formula, dict(zip(map(ex.Symbol, arguments), function.arguments, strict=True)))


class NoRealValue(errors.InverseServiceError):
    """The tree has no finite real value at the point; it may have one at another point."""

    code = "no-real-value"


def evaluate(expression: ex.Expression, table: Mapping[ex.Expression, Real]) -> Real:
    """The value in mpmath's working precision.

    `table` maps Symbol, Velocity, Acceleration, and complete Arbitrary nodes (with arguments and orders) to values.
    NoRealValue if a node is missing or has no finite real value.
    """
    return evaluate_once(expression, dict(table))


def evaluate_once(expression: ex.Expression, table: dict[ex.Expression, Real]) -> Real:
    """Like `evaluate`, but store every value in the table, so that trees with common parts share work."""
    known = table.get(expression)
    if known is not None:
        return known
    try:
        value = _value(expression, table)
    except (ZeroDivisionError, ValueError, OverflowError) as error:
        raise NoRealValue(f"a formula has no real value at a point: {error}") from error
    if not isinstance(value, mpf) or not mp.isfinite(value):
        raise NoRealValue("a formula has no finite real value at a point")
    table[expression] = value
    return value


def _value(expression: ex.Expression, table: dict[ex.Expression, Real]) -> Real:
    match expression:
        case ex.Number(value):
            return mpf(value.numerator) if value.denominator == 1 else mpf(value.numerator) / value.denominator
        case ex.Sum(terms):
            values = [evaluate_once(term, table) for term in terms]
            return values[0] + values[1] if len(values) == 2 else mp.fsum(values)  # twice as fast as fsum
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
        case ex.Apply(function, argument):
            operation: Callable[[Real], Real] = getattr(mp, _IN_MPMATH.get(function, function))
            return operation(evaluate_once(argument, table))
        case ex.Arbitrary(name, _, _):
            raise NoRealValue(f"no value is given for the function {name}")
        case _ if expression == ex.PI:
            return +mp.pi
        case _:
            raise NoRealValue(f"no value is given for {expression}")
