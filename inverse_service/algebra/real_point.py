"""One real point at which f is defined: it says on which branch of its roots a verdict holds.

Where formulas are defined, and stay on one branch of their roots, logarithms and inverse functions.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

import mpmath

from inverse_service.algebra.point import Variable
from inverse_service.algebra.rules import RADIAN, Combination
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.evaluation import NoRealValue, evaluate, evaluate_once
from inverse_service.expressions.tree import (
    PI,
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
    apply,
    distinct_nodes,
    walk,
)

_DIGITS = 40
_TRIES_PER_SCALE = 60
_SCALES = ("1.7", "0.9", "0.4", "0.1", "5", "0.01", "30")
_LARGEST = 10_000
_FINEST = 720  # of parts of pi
_TINY = mpmath.mpf(10) ** -12

RealTable = dict[Expression, mpmath.mpf]


def find_real_point(
    expressions: Sequence[Expression],
    variables: Sequence[Variable],
    seed: int,
    positive: Sequence[Expression] = (),
    margins: Sequence[Fraction] = (Fraction(1, 4), Fraction(0)),
) -> RealTable | None:
    """A random real point at which all expressions have values and `positive` exceed the first margin with such a
    point, or None."""
    functions = (node for node in distinct_nodes((*expressions, *positive)) if isinstance(node, Arbitrary))
    names = list(dict.fromkeys([*variables, *functions]))
    generator = random.Random(f"real {seed}")
    with mpmath.workdps(_DIGITS):
        for margin in margins if positive else margins[-1:]:
            inside = [tree - margin for tree in positive]
            for scale in map(mpmath.mpf, [*_SCALES, *_sizes(positive)]):
                for attempt in range(_TRIES_PER_SCALE):
                    table: RealTable = {name: _draw(generator, scale, attempt % 2 == 0) for name in names}
                    table[RADIAN] = mpmath.mpf(1)
                    if are_positive(inside, table) and is_defined(expressions, table):
                        return table
    return None


def _sizes(trees: Iterable[Expression]) -> list[int]:
    """Sizes of points beyond the numbers in the trees: abs(x + 40) has a side beyond -40."""
    numbers = {abs(node.value) for tree in trees for node in walk(tree) if isinstance(node, Number)}
    return [3 * math.ceil(value) for value in sorted(numbers) if 10 < value < _LARGEST]


def table_at(near: Mapping[str, str]) -> RealTable:
    """The point that is named by the texts of its values: x, x', t, a, ..."""
    values = {name: mpmath.mpf(text) for name, text in near.items()}
    named: RealTable = {Velocity(n[:-1]) if n.endswith("'") else Symbol(n): x for n, x in values.items()}
    return {RADIAN: mpmath.mpf(1)} | named


def _draw(generator: random.Random, scale: mpmath.mpf, positive: bool) -> mpmath.mpf:
    magnitude = scale * generator.randrange(1_000, 10_000) / 10_000
    return magnitude if positive or generator.random() < 0.5 else -magnitude


def is_defined(expressions: Sequence[Expression], table: RealTable) -> bool:
    """Whether all have finite values at the point."""
    known = dict(table)
    try:
        return all(mpmath.isfinite(evaluate_once(expression, known)) for expression in expressions)
    except NoRealValue:
        return False


def are_positive(trees: Sequence[Expression], table: RealTable) -> bool:
    """Whether all are, by more than rounding."""
    try:
        return all(real_sign(tree, table) > 0 for tree in trees)
    except (NoRealValue, IrreducibleAtoms):
        return False


def real_sign(expression: Expression, table: RealTable) -> int:
    """The sign of a value that is not zero, whatever its size: a sum is compared with its largest term."""
    match expression:
        case Number(value) if value:
            return 1 if value > 0 else -1
        case Product(factors):
            return math.prod(real_sign(factor, table) for factor in factors)
        case Power(base, Number(exponent)) if exponent.denominator == 1:
            return real_sign(base, table) if exponent.numerator % 2 else 1
    known = table.get(expression)
    with mpmath.workdps(_DIGITS):
        value = evaluate(expression, table) if known is None else known
        size = max(abs(evaluate(term, table)) for term in expression.terms) if isinstance(expression, Sum) else 1
    if _may_be_tiny(expression):
        return 1
    if abs(value) < _TINY * size:
        raise IrreducibleAtoms("the sign of an expression under a root could not be determined at a real point")
    return 1 if value > 0 else -1


def _may_be_tiny(expression: Expression) -> bool:
    """Whether it is positive however small its value is."""
    return isinstance(expression, Power) or (isinstance(expression, Apply) and expression.function in ("exp", "cosh"))


def turns(
    table: RealTable | None, atom: Expression, known: Combination, constants: Sequence[Expression]
) -> Combination | None:
    """What an arctangent relation leaves open: atom - sum a_j u_j as a combination of pi and constant arctangents.

    None where it is none. IrreducibleAtoms where there is no real point. It is a guess of the solver, from 30 digits:
    nothing that follows from it is shown before the checker, which proves such relations itself, agrees.
    """
    if table is None:
        raise IrreducibleAtoms("an arctangent depends on other angles and no real point of f was found")
    with mpmath.workdps(_DIGITS):
        total = evaluate(atom, table)
        for u, a in known:
            total -= evaluate(u, table) * a.numerator / a.denominator
        if abs(total) < _TINY:
            return ()
        part = Fraction(int(mpmath.nint(total / mpmath.pi * 10**20)), 10**20).limit_denominator(_FINEST)
        if abs(total / mpmath.pi * part.denominator - part.numerator) < _TINY:
            return ((PI, part),)
        values = [total, *(evaluate(u, table) for u in constants), +mpmath.pi]
        found = mpmath.pslq(values, tol=mpmath.mpf(10) ** -30, maxcoeff=1000, maxsteps=10_000) if constants else None
    if not found or not found[0]:
        return None
    return tuple((u, Fraction(-a, found[0])) for u, a in zip((*constants, PI), found[1:], strict=True) if a)


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
                found[tree if real_sign(tree, table) > 0 else -tree] = None
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
            return [1 - u, 1 + u]
        case Apply("acosh", u):
            return [u - 1]
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
