"""Where formulas are defined, and stay on one branch of their roots, logarithms and inverse functions."""

from __future__ import annotations

from collections.abc import Iterable

from inverse_service.algebra.real_point import RealTable, real_sign
from inverse_service.expressions.tree import (
    PI,
    Apply,
    Arbitrary,
    Expression,
    Integral,
    Number,
    Power,
    Symbol,
    Velocity,
    add,
    apply,
    distinct_nodes,
    negate,
    number,
    subtract,
    walk,
)


def requirements(formulas: Iterable[Expression], table: RealTable) -> list[Expression]:
    """What has to be positive for the functions with several branches in the formulas to stay on theirs.

    Bases of roots and of symbolic powers, arguments of logarithms, distances of those of inverse functions from the
    ends of their domains, and what is divided by inside any of these.
    """
    formulas = tuple(formulas)
    found = dict.fromkeys(own_requirements(formulas))
    for node in distinct_nodes(formulas):
        for pole in distinct_nodes(_branch_arguments(node)):
            for tree in _poles(pole):
                found[tree if real_sign(tree, table) > 0 else negate(tree)] = None
    return [tree for tree in found if varies(tree)]


def own_requirements(formulas: Iterable[Expression]) -> list[Expression]:
    """What is positive wherever the formulas have a real value: radicands and the like."""
    found = dict.fromkeys(tree for node in distinct_nodes(formulas) for tree in _own_requirements(node))
    return [tree for tree in found if varies(tree)]


def varies(tree: Expression) -> bool:
    return any(isinstance(node, Symbol | Velocity | Arbitrary) and node != PI for node in walk(tree))


def _own_requirements(node: Expression) -> list[Expression]:
    match node:
        case Power(base, Number(exponent)) if exponent.denominator > 1:
            return [base]
        case Power(base, exponent) if not isinstance(exponent, Number):
            return [base]
        case Apply("log", u):
            return [u]
        case Apply("asin" | "acos" | "atanh", u):
            return [add(number(1), negate(u)), add(number(1), u)]
        case Apply("acosh", u):
            return [subtract(u, number(1))]
        case _:
            return []


def _branch_arguments(node: Expression) -> tuple[Expression, ...]:
    match node:
        case Apply("log" | "asin" | "acos" | "atan" | "asinh" | "acosh" | "atanh", u):
            return (u,)
        case Integral():
            return (*node.arguments, *(slope for slope in node.slopes if slope is not None))
        case Arbitrary(_, arguments, _):
            return arguments
        case Power(base, exponent) if not isinstance(exponent, Number) or exponent.value.denominator > 1:
            return (base, exponent)
        case _:
            return ()


def _poles(node: Expression) -> list[Expression]:
    """What must not vanish."""
    match node:
        case Power(base, Number(exponent)) if exponent < 0:
            return [base]
        case Apply("tan" | "sec", u):
            return [apply("cos", u)]
        case Apply("cot" | "csc", u):
            return [apply("sin", u)]
        case Apply("coth" | "csch", u):
            return [u]
        case _:
            return []
