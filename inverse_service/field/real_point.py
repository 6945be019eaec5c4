"""Find a real point at which f is defined; it selects the branch of the roots on which a verdict is valid.

The module also computes where formulas are defined and remain on one branch of their roots, logarithms, and inverse
functions.
"""

import math
import random
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise

import mpmath

from inverse_service import errors
from inverse_service.expressions import evaluation, tree as ex
from inverse_service.field import tower
from inverse_service.field.modular import Variable

_DIGITS = 40
_TRIES_PER_SCALE = 60
_SCALES = ("1.7", "0.9", "0.4", "0.1", "5", "0.01", "30")
_LARGEST = 10_000
_STARTS, _NODES = 4, (0, 1, -1, 2, -2, 3)  # for walks along the axes
_FINEST = 720  # of parts of pi
_TINY = mpmath.mpf(10) ** -12
_HUGE = mpmath.mpf(10) ** 2000  # the checker's balls distinguish numbers up to 2^8192 = 10^2466

RealTable = dict[ex.Expression, mpmath.mpf]


def find_real_point(
    expressions: Sequence[ex.Expression],
    variables: Sequence[Variable],
    seed: int,
    positive: Sequence[ex.Expression] = (),
    margins: Sequence[Fraction] = (Fraction(1, 4), Fraction(0)),
) -> RealTable | None:
    """A random real point at which all expressions have values and `positive` exceed the first margin with such a
    point, or None."""
    functions = (node for node in ex.distinct_nodes((*expressions, *positive)) if isinstance(node, ex.Arbitrary))
    names = list(dict.fromkeys([*variables, *functions]))
    generator = random.Random(f"real {seed}")
    with mpmath.workdps(_DIGITS):
        for margin in margins if positive else margins[-1:]:
            inside = [tree - margin for tree in positive]
            for scale in map(mpmath.mpf, [*_SCALES, *_sizes(positive)]):
                for attempt in range(_TRIES_PER_SCALE):
                    table: RealTable = {name: _draw(generator, scale, attempt % 2 == 0) for name in names}
                    table[tower.RADIAN] = mpmath.mpf(1)
                    if are_positive(inside, table) and is_defined(expressions, table, _HUGE):
                        return table
        for _ in range(_STARTS if positive else 0):
            table = {tower.RADIAN: mpmath.mpf(1)}
            table.update({name: _draw(generator, mpmath.mpf(2), False) for name in names})
            for name in [*variables, *reversed(variables)]:
                _move_along(name, positive, table)
            if are_positive(positive, table) and is_defined(expressions, table):
                return _off_axes(table, positive, expressions)
    return None


def first_real_point(
    expressions: Sequence[ex.Expression], variables: Sequence[Variable], choices: Iterable[Sequence[ex.Expression]]
) -> RealTable | None:
    """A point as of `find_real_point` for the first of some choices of positive trees for which one is found."""
    points = (find_real_point(expressions, variables, 1, positive) for positive in choices)
    return next((point for point in points if point is not None), None)


def _off_axes(table: RealTable, positive: Sequence[ex.Expression], expressions: Sequence[ex.Expression]) -> RealTable:
    """The point with a small number in place of each 0."""
    for name in [name for name, value in table.items() if not value]:
        for k in range(1, 4 * _DIGITS):
            moved = table | {name: mpmath.mpf(10) ** -k}
            if are_positive(positive, moved) and is_defined(expressions, moved):
                table = moved
                break
    return table


def _move_along(name: Variable, positive: Sequence[ex.Expression], table: RealTable) -> None:
    """Move the point along the axis of a name so that most trees are positive and the smallest is as large as possible.

    Only trees that are polynomials of degree at most 4 along the axis are used; this finds small sets between zeros.
    """
    places, trees = [mpmath.mpf(0)], [tree for tree in positive if name in ex.walk(tree)]
    for tree in trees:
        try:
            values = [evaluation.evaluate(tree, table | {name: node}) for node in map(mpmath.mpf, _NODES)]
            found = mpmath.lu_solve(mpmath.matrix([[mpmath.mpf(x) ** k for k in range(5)] for x in _NODES[:5]]),
                                    mpmath.matrix(values[:5]))  # fmt: skip
            least = mpmath.mpf(10) ** (8 - _DIGITS) * max(map(abs, values))
            shape = [a if abs(a) > least else mpmath.mpf(0) for a in found]
            while shape and not shape[-1]:
                shape.pop()
            if abs(mpmath.polyval(shape[::-1] or [0], _NODES[5]) - values[5]) > least * 10**6 or len(shape) < 2:
                continue
            slope = [k * a for k, a in enumerate(shape)][1:]
            for coefficients in (shape, slope):
                if len(coefficients) > 1:
                    roots = mpmath.polyroots(coefficients[::-1], maxsteps=200, extraprec=200)
                    places += [mpmath.re(z) for z in roots if abs(mpmath.im(z)) <= abs(z) * least + least]
        except (evaluation.NoRealValue, mpmath.libmp.NoConvergence, ZeroDivisionError):
            continue
    places = sorted({*places})
    between = [(a + b) / 2 for a, b in pairwise(places)]
    choices = [*places, *between, places[0] - 1 - abs(places[0]), places[-1] + 1 + abs(places[-1]), table[name]]
    table[name] = max(choices, key=lambda x: _fit(trees, table | {name: x}))


def _fit(trees: Sequence[ex.Expression], table: RealTable) -> tuple[int, mpmath.mpf]:
    try:
        values = [evaluation.evaluate(tree, table) for tree in trees]
    except evaluation.NoRealValue:
        return -1, mpmath.mpf(0)
    return sum(value > 0 for value in values), min(values, default=mpmath.mpf(0))


def _sizes(trees: Iterable[ex.Expression]) -> list[int]:
    """Sizes of points beyond the numbers in the trees: abs(x + 40) has a side beyond -40."""
    numbers = {abs(node.value) for tree in trees for node in ex.walk(tree) if isinstance(node, ex.Number)}
    return [3 * math.ceil(value) for value in sorted(numbers) if 10 < value < _LARGEST]


def table_at(near: Mapping[str, str]) -> RealTable:
    """The point given by texts of the values of x, x', t, a, ..."""
    values = {name: mpmath.mpf(text) for name, text in near.items()}
    named: RealTable = {ex.Velocity(n[:-1]) if n.endswith("'") else ex.Symbol(n): x for n, x in values.items()}
    return {tower.RADIAN: mpmath.mpf(1)} | named


def _draw(generator: random.Random, scale: mpmath.mpf, positive: bool) -> mpmath.mpf:
    magnitude = scale * generator.randrange(1_000, 10_000) / 10_000
    return magnitude if positive or generator.random() < 0.5 else -magnitude


def is_defined(expressions: Sequence[ex.Expression], table: RealTable, most: mpmath.mpf = mpmath.inf) -> bool:
    """Whether all expressions have finite values below `most` at the point."""
    known = dict(table)
    try:
        return all(abs(evaluation.evaluate_once(expression, known)) < most for expression in expressions)
    except evaluation.NoRealValue:
        return False


def are_positive(trees: Sequence[ex.Expression], table: RealTable) -> bool:
    """Whether all trees are positive at the point by more than rounding errors."""
    try:
        return all(real_sign(tree, table) > 0 for tree in trees)
    except (evaluation.NoRealValue, errors.IrreducibleAtoms):
        return False


def real_sign(expression: ex.Expression, table: RealTable) -> int:
    """The sign of a nonzero value of any size: a sum is compared with its largest term."""
    match expression:
        case ex.Number(value) if value:
            return 1 if value > 0 else -1
        case ex.Product(factors):
            return math.prod(real_sign(factor, table) for factor in factors)
        case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1:
            sign = real_sign(base, table)
            return sign if exponent.numerator % 2 else sign * sign
    known = table.get(expression)
    with mpmath.workdps(_DIGITS):
        value = evaluation.evaluate(expression, table) if known is None else known
        size = (
            max(abs(evaluation.evaluate(term, table)) for term in expression.terms)
            if isinstance(expression, ex.Sum)
            else 1
        )
    if _may_be_tiny(expression):
        return 1
    if abs(value) < _TINY * size:
        raise errors.IrreducibleAtoms("the sign of an expression under a root could not be determined at a real point")
    return 1 if value > 0 else -1


def _may_be_tiny(expression: ex.Expression) -> bool:
    """Whether it is positive even if its value is tiny."""
    return isinstance(expression, ex.Power) or (
        isinstance(expression, ex.Apply) and expression.function in ("exp", "cosh")
    )


def turns(
    table: RealTable | None, atom: ex.Expression, known: tower.Combination, constants: Sequence[ex.Expression]
) -> tower.Combination | None:
    """The undetermined part of an arctangent relation: atom - sum a_j u_j as a combination of pi and constant
    arctangents.

    None if it is not such a combination. IrreducibleAtoms if there is no real point. This is a guess from 30 digits: no
    consequence of it is shown before the checker, which proves such relations itself, agrees.
    """
    if table is None:
        raise errors.IrreducibleAtoms("an arctangent depends on other angles and no real point of f was found")
    with mpmath.workdps(_DIGITS):
        total = evaluation.evaluate(atom, table)
        for u, a in known:
            total -= evaluation.evaluate(u, table) * a.numerator / a.denominator
        if abs(total) < _TINY:
            return ()
        part = Fraction(int(mpmath.nint(total / mpmath.pi * 10**20)), 10**20).limit_denominator(_FINEST)
        if abs(total / mpmath.pi * part.denominator - part.numerator) < _TINY:
            return ((ex.PI, part),)
        values = [total, *(evaluation.evaluate(u, table) for u in constants), +mpmath.pi]
        found = mpmath.pslq(values, tol=mpmath.mpf(10) ** -30, maxcoeff=1000, maxsteps=10_000) if constants else None
    if not found or not found[0]:
        return None
    return tuple((u, Fraction(-a, found[0])) for u, a in zip((*constants, ex.PI), found[1:], strict=True) if a)


def requirements(formulas: Iterable[ex.Expression], table: RealTable) -> list[ex.Expression]:
    """The trees that must be positive for the multivalued functions in the formulas to remain on their branches.

    These are bases of roots and symbolic powers, arguments of logarithms, distances of the arguments of inverse
    functions from the ends of their domains, and denominators inside any of these.
    """
    formulas = tuple(formulas)
    found = dict.fromkeys(own_requirements(formulas))
    for node in ex.distinct_nodes(formulas):
        for tree in poles(_branch_arguments(node)):
            found[tree if real_sign(tree, table) > 0 else -tree] = None
    return [tree for tree in found if varies(tree)]


def own_requirements(formulas: Iterable[ex.Expression]) -> list[ex.Expression]:
    """The trees, such as radicands, that are positive wherever the formulas have a real value."""
    found = dict.fromkeys(tree for node in ex.distinct_nodes(formulas) for tree in _own_requirements(node))
    return [tree for tree in found if varies(tree)]


def varies(tree: ex.Expression) -> bool:
    return any(isinstance(node, ex.Symbol | ex.Velocity | ex.Arbitrary) and node != ex.PI for node in ex.walk(tree))


def _own_requirements(node: ex.Expression) -> list[ex.Expression]:
    match node:
        case ex.Power(base, ex.Number(exponent)) if exponent.denominator > 1:
            return [base]
        case ex.Power(base, exponent) if not isinstance(exponent, ex.Number):
            return [base]
        case ex.Apply("log", u):
            return [u]
        case ex.Apply("asin" | "acos" | "atanh", u):
            return [1 - u, 1 + u]
        case ex.Apply("acosh", u):
            return [u - 1]
        case _:
            return []


def _branch_arguments(node: ex.Expression) -> tuple[ex.Expression, ...]:
    match node:
        case ex.Apply("log" | "asin" | "acos" | "atan" | "asinh" | "acosh" | "atanh", u):
            return (u,)
        case ex.Integral():
            return (*node.arguments, *(slope for slope in node.slopes if slope is not None))
        case ex.Arbitrary(_, arguments, _):
            return arguments
        case ex.Power(base, exponent) if not isinstance(exponent, ex.Number) or exponent.value.denominator > 1:
            return (base, exponent)
        case _:
            return ()


def poles(formulas: Iterable[ex.Expression]) -> list[ex.Expression]:
    """The trees that must not vanish in the formulas."""
    found = dict.fromkeys(tree for node in ex.distinct_nodes(formulas) for tree in _own_poles(node))
    return [tree for tree in found if varies(tree)]


def _own_poles(node: ex.Expression) -> list[ex.Expression]:
    match node:
        case ex.Power(base, ex.Number(exponent)) if exponent < 0:
            return [base]
        case ex.Apply("tan" | "sec", u):
            return [ex.Apply("cos", u)]
        case ex.Apply("cot" | "csc", u):
            return [ex.Apply("sin", u)]
        case ex.Apply("coth" | "csch", u):
            return [u]
        case _:
            return []
