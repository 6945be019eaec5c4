"""Convert between SymPy expressions and our trees, node by node."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from typing import Any

import sympy
from sympy.core.function import AppliedUndef

from inverse_service import errors
from inverse_service.expressions import functions, tree as ex
from inverse_service.expressions.pieces import either, piecewise, step
from inverse_service.reading import parser
from inverse_service.reading.names import call

_REFUSED = ((sympy.Integral, "an integral occurs: evaluate it, or declare a function of your own"),)


def to_sympy(tree: ex.Expression, leaf: Callable[[ex.Expression], Any]) -> Any:
    """The tree as a SymPy expression; `leaf` gives the objects of names and of arbitrary functions."""
    match tree:
        case ex.Number(value):
            return sympy.Rational(value.numerator, value.denominator)
        case _ if tree == ex.PI:
            return sympy.pi
        case ex.Sum(terms):
            return sympy.Add(*(to_sympy(term, leaf) for term in terms))
        case ex.Product(factors):
            return sympy.Mul(*(to_sympy(factor, leaf) for factor in factors))
        case ex.Power(base, exponent):
            return sympy.Pow(to_sympy(base, leaf), to_sympy(exponent, leaf))
        case ex.Apply(function, argument):
            return getattr(sympy, function)(to_sympy(argument, leaf))
    return leaf(tree)


@dataclass(frozen=True)
class Leaves:
    """The trees of the SymPy objects in formulas, and the names of their arbitrary functions."""

    trees: Mapping[Any, ex.Expression]
    functions: Mapping[Any, str]


def from_sympy(expression: Any, leaves: Leaves) -> ex.Expression:
    """The expression as a tree; InputError for a part without an exact real meaning."""
    if expression in leaves.trees:
        return leaves.trees[expression]
    match expression:
        case sympy.Float():
            raise _refused("a Float occurs", "write the exact number, such as Rational(1, 3)")
        case sympy.Rational():
            return ex.Number(Fraction(int(expression.p), int(expression.q)))
        case sympy.Symbol():
            raise _refused(f"the symbol {expression} occurs with different assumptions", "use one symbol")
        case sympy.Add():
            return ex.add(*(from_sympy(term, leaves) for term in expression.args))
        case sympy.Mul():
            return ex.multiply(*(from_sympy(factor, leaves) for factor in expression.args))
        case sympy.Pow():
            return from_sympy(expression.base, leaves) ** from_sympy(expression.exp, leaves)
        case sympy.exp():
            return ex.Apply("exp", from_sympy(expression.args[0], leaves))
        case _ if expression == sympy.pi:
            return ex.PI
        case _ if expression == sympy.E:
            return ex.Apply("exp", ex.ONE)
        case sympy.Derivative() | sympy.Subs():
            return _derivative(expression, leaves)
        case AppliedUndef():
            return _arbitrary(expression, [0] * len(expression.args), expression.args, leaves)
        case sympy.Abs() | sympy.sign():
            return call(type(expression).__name__.lower(), [from_sympy(expression.args[0], leaves)], 1)
        case sympy.Piecewise():
            pieces = [(from_sympy(value, leaves), _condition(held, leaves)) for value, held in expression.args]
            return piecewise(pieces, 1)
        case sympy.Heaviside():
            return step(from_sympy(expression.args[0], leaves), 1)
        case sympy.Function():
            return _elementary(expression, leaves)
    if expression is sympy.I:
        raise _refused("complex numbers occur", "write the equations of the real and imaginary parts")
    if expression.is_finite is False or expression is sympy.nan:
        raise _refused(f"{expression} is not a number", "write a finite number")
    reason = next((text for kind, text in _REFUSED if isinstance(expression, kind)), "")
    raise errors.InputError(
        (reason or f"{type(expression).__name__} is not accepted: write elementary functions") + "."
    )


def _condition(held: Any, leaves: Leaves) -> ex.Expression:
    """1 where the condition of a piece holds, 0 elsewhere."""
    match held:
        case sympy.logic.boolalg.BooleanTrue():
            return ex.ONE
        case sympy.And():
            return ex.multiply(*(_condition(part, leaves) for part in held.args))
        case sympy.Or():
            return reduce(either, (_condition(part, leaves) for part in held.args))
        case sympy.Not():
            return 1 - _condition(held.args[0], leaves)
        case sympy.Gt() | sympy.Ge() | sympy.Lt() | sympy.Le():
            return step(from_sympy(held.gts - held.lts, leaves), 1)
    raise _refused(f"the condition {held} occurs", "write inequalities of polynomials, joined by &, | and ~")


def _refused(what: str, instead: str) -> errors.InputError:
    return errors.InputError(f"{what}: {instead}.", "/equations")


def _elementary(expression: Any, leaves: Leaves) -> ex.Expression:
    name = type(expression).__name__
    if name not in functions.FUNCTION or len(expression.args) != 1:
        raise _refused(f"the function {name} occurs", "write elementary functions, or a function of your own")
    return ex.Apply(name, from_sympy(expression.args[0], leaves))


def _derivative(expression: Any, leaves: Leaves) -> ex.Expression:
    """Derivative(A(x), x), and Subs of it at other arguments."""
    inner, replaced = expression, {}
    if isinstance(expression, sympy.Subs):
        inner, replaced = expression.expr, dict(zip(expression.variables, expression.point, strict=True))
    if not isinstance(inner, sympy.Derivative) or not isinstance(inner.expr, AppliedUndef):
        done = expression.doit()
        if done == expression:
            raise _refused("an unevaluated derivative occurs", "call doit()")
        return from_sympy(done, leaves)
    if inner.expr in leaves.trees:
        raise _refused("a third derivative occurs", parser.OF_SECOND_ORDER)
    orders = [0] * len(inner.expr.args)
    for variable, count in inner.variable_count:
        places = [place for place, argument in enumerate(inner.expr.args) if argument == variable]
        if len(places) != 1:
            raise _refused(f"a derivative by {variable} occurs", "differentiate by the arguments of the function")
        orders[places[0]] += int(count)
    return _arbitrary(inner.expr, orders, [argument.subs(replaced) for argument in inner.expr.args], leaves)


def _arbitrary(applied: Any, orders: list[int], arguments: Any, leaves: Leaves) -> ex.Expression:
    name = leaves.functions.get(applied.func)
    if name is None:
        raise _refused(f"the function {applied} occurs", "give the coordinates, and functions of them")
    return ex.Arbitrary(name, tuple(from_sympy(argument, leaves) for argument in arguments), tuple(orders))
