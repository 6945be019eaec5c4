"""Expressions of SymPy and our trees, converted node by node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import reduce
from typing import Any

import sympy
from sympy.core.function import AppliedUndef

from inverse_service.errors import InputError
from inverse_service.expressions.pieces import either, piecewise, step
from inverse_service.expressions.reader import read_formula
from inverse_service.expressions.tree import (
    ELEMENTARY,
    ONE,
    PI,
    TIME,
    Acceleration,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    multiply,
    square_root,
)
from inverse_service.sympy.names import Table

_REFUSED = ((sympy.Integral, "an integral occurs: carry it out, or declare a function of your own"),)


def to_sympy(tree: Expression, table: Table) -> Any:
    """The tree as a SymPy expression over the objects of the table."""
    match tree:
        case Number(value):
            return sympy.Rational(value.numerator, value.denominator)
        case _ if tree == PI:
            return sympy.pi
        case _ if tree == TIME and "t" not in table.coordinates and "t" not in table.parameters:
            return table.time
        case Symbol(name):
            return table.symbol(name)
        case Velocity(name):
            return table.velocity(name)
        case Acceleration(name):
            return table.acceleration(name)
        case Sum(terms):
            return sympy.Add(*(to_sympy(term, table) for term in terms))
        case Product(factors):
            return sympy.Mul(*(to_sympy(factor, table) for factor in factors))
        case Power(base, exponent):
            return sympy.Pow(to_sympy(base, table), to_sympy(exponent, table))
        case Apply(function, argument):
            return getattr(sympy, function)(to_sympy(argument, table))
        case Arbitrary():
            return _applied(tree, table)


def _applied(tree: Arbitrary, table: Table) -> Any:
    """A(u), its derivatives taken at dummies and then put at the arguments."""
    function = table.functions.get(tree.name, sympy.Function(tree.name))
    arguments = [to_sympy(argument, table) for argument in tree.arguments]
    if not any(tree.orders):
        return function(*arguments)
    plain = all(argument.is_Symbol or isinstance(argument, AppliedUndef) for argument in arguments)
    if plain and len(set(arguments)) == len(arguments):
        pairs = [(u, k) for u, k in zip(arguments, tree.orders, strict=True) if k]
        return sympy.Derivative(function(*arguments), *pairs)
    dummies = [sympy.Dummy(f"xi_{place}") for place in range(len(arguments))]
    pairs = [(u, k) for u, k in zip(dummies, tree.orders, strict=True) if k]
    return sympy.Subs(sympy.Derivative(function(*dummies), *pairs), dummies, arguments)


@dataclass(frozen=True)
class Leaves:
    """The trees of the objects that formulas are made of, and the names of their arbitrary functions."""

    trees: Mapping[Any, Expression]
    functions: Mapping[Any, str]


def from_sympy(expression: Any, leaves: Leaves) -> Expression:
    """The expression as a tree; InputError for what has no exact real meaning here."""
    if expression in leaves.trees:
        return leaves.trees[expression]
    match expression:
        case sympy.Float():
            raise _refused("a Float occurs", "write the exact number, such as Rational(1, 3)")
        case sympy.Rational():
            return Number(Fraction(int(expression.p), int(expression.q)))
        case sympy.Symbol():
            raise _refused(f"the symbol {expression} occurs twice with other assumptions", "use one symbol")
        case sympy.Add():
            return add(*(from_sympy(term, leaves) for term in expression.args))
        case sympy.Mul():
            return multiply(*(from_sympy(factor, leaves) for factor in expression.args))
        case sympy.Pow():
            return from_sympy(expression.base, leaves) ** from_sympy(expression.exp, leaves)
        case sympy.exp():
            return Apply("exp", from_sympy(expression.args[0], leaves))
        case _ if expression == sympy.pi:
            return PI
        case _ if expression == sympy.E:
            return Apply("exp", ONE)
        case sympy.Derivative() | sympy.Subs():
            return _derivative(expression, leaves)
        case AppliedUndef():
            return _arbitrary(expression, [0] * len(expression.args), expression.args, leaves)
        case sympy.Abs() | sympy.sign():
            return _with_branches(expression, leaves)
        case sympy.Piecewise():
            pieces = [(from_sympy(value, leaves), _condition(held, leaves)) for value, held in expression.args]
            return piecewise(pieces, 1)
        case sympy.Heaviside():
            return step(from_sympy(expression.args[0], leaves), 1)
        case sympy.Function():
            return _elementary(expression, leaves)
    if expression is sympy.I:
        raise _refused("complex numbers occur", "write the equations of real and imaginary part")
    if expression.is_finite is False or expression is sympy.nan:
        raise _refused(f"{expression} is not a number", "write a finite number")
    reason = next((text for kind, text in _REFUSED if isinstance(expression, kind)), "")
    raise InputError((reason or f"{type(expression).__name__} is not accepted: write elementary functions") + ".")


def _condition(held: Any, leaves: Leaves) -> Expression:
    """1 where the condition of a piece holds, 0 elsewhere."""
    match held:
        case sympy.logic.boolalg.BooleanTrue():
            return ONE
        case sympy.And():
            return multiply(*(_condition(part, leaves) for part in held.args))
        case sympy.Or():
            return reduce(either, (_condition(part, leaves) for part in held.args))
        case sympy.Not():
            return 1 - _condition(held.args[0], leaves)
        case sympy.Gt() | sympy.Ge() | sympy.Lt() | sympy.Le():
            return step(from_sympy(held.gts - held.lts, leaves), 1)
    raise _refused(f"the condition {held} occurs", "write inequalities of polynomials, joined by &, | and ~")


def _refused(what: str, instead: str) -> InputError:
    return InputError(f"{what}: {instead}.", "/equations")


def _elementary(expression: Any, leaves: Leaves) -> Expression:
    name = type(expression).__name__
    if name not in ELEMENTARY or len(expression.args) != 1:
        raise _refused(f"the function {name} occurs", "write elementary functions, or a function of your own")
    return Apply(name, from_sympy(expression.args[0], leaves))


def _with_branches(expression: Any, leaves: Leaves) -> Expression:
    """|u| is the root of u^2, sign(u) is u/|u|: the solver takes them apart by branches."""
    argument = from_sympy(expression.args[0], leaves)
    magnitude = square_root(argument**2)
    return magnitude if isinstance(expression, sympy.Abs) else argument / magnitude


def _derivative(expression: Any, leaves: Leaves) -> Expression:
    """Derivative(A(x), x), and Subs of it at other arguments."""
    inner, replaced = expression, {}
    if isinstance(expression, sympy.Subs):
        inner, replaced = expression.expr, dict(zip(expression.variables, expression.point, strict=True))
    if not isinstance(inner, sympy.Derivative) or not isinstance(inner.expr, AppliedUndef):
        done = expression.doit()
        if done == expression:
            raise _refused("a derivative that is not carried out occurs", "call doit()")
        return from_sympy(done, leaves)
    if inner.expr in leaves.trees:
        raise _refused("a third derivative occurs", "write equations of second order")
    orders = [0] * len(inner.expr.args)
    for variable, count in inner.variable_count:
        places = [place for place, argument in enumerate(inner.expr.args) if argument == variable]
        if len(places) != 1:
            raise _refused(f"a derivative by {variable} occurs", "differentiate by the arguments of the function")
        orders[places[0]] += int(count)
    return _arbitrary(inner.expr, orders, [argument.subs(replaced) for argument in inner.expr.args], leaves)


def _arbitrary(applied: Any, orders: list[int], arguments: Any, leaves: Leaves) -> Expression:
    name = leaves.functions.get(applied.func)
    if name is None:
        raise _refused(f"the function {applied} occurs", "give the coordinates, and functions of them")
    return Arbitrary(name, tuple(from_sympy(argument, leaves) for argument in arguments), tuple(orders))


_RELATIONS = ((" >= ", sympy.Ge), (" <= ", sympy.Le), (" != ", sympy.Ne), (" > ", sympy.Gt), (" < ", sympy.Lt))


def expression(text: str, table: Table) -> Any:
    """A formula of a result."""
    return to_sympy(read_formula(text, table.of_formulas()), table)


def with_integrals(table: Table, integrals: Mapping[str, Any]) -> Table:
    """The table with a function F(x) for each integral of an answer; SymPy differentiates it to what is known."""
    arguments = {name: tuple(part["arguments"]) for name, part in integrals.items()}
    functions = {name: _integral(name, part, arguments[name], table) for name, part in integrals.items()}
    return replace(table, functions={**table.functions, **functions}, arguments={**table.arguments, **arguments})


def _integral(name: str, part: Mapping[str, Any], arguments: tuple[str, ...], table: Table) -> Any:
    """The class of a function that is known by its derivatives."""

    def fdiff(self: Any, argindex: int = 1) -> Any:
        slope = part["derivatives"].get(arguments[argindex - 1])
        if slope is None:
            return sympy.Function.fdiff(self, argindex)
        formal = [table.symbol(argument) for argument in arguments]
        return expression(slope, table).subs(dict(zip(formal, self.args, strict=True)), simultaneous=True)

    return type(name, (sympy.Function,), {"fdiff": fdiff, "nargs": len(arguments)})


def relation(text: str, table: Table) -> Any:
    """A condition such as x' != 0; the whole text as a symbol where it is a sentence."""
    for sign, kind in _RELATIONS:
        left, found, right = text.partition(sign)
        if found:
            return kind(expression(left, table), expression(right, table))
    return sympy.Symbol(text)
