"""Solving F(v) = p for one velocity.

Where v occurs in F once, from the outside to the inside; else F may be a short polynomial in z, a power of v or exp(v).
With z^d = y the equation is c_2 y^2 + c_1 y + c_0 = 0, or a cubic; its depressed form y^3 + a y = b is
solved by y = 2 sqrt(a/3) sinh(asinh(3 sqrt(3/a) b/(2 a))/3) for a > 0 and, on the branch through
y = 0, by y = 2 sqrt(-a/3) sin(asin(3 sqrt(-3/a) b/(2 a))/3) for a < 0 (Viete; Holmes, Math. Gazette
86 (2002) 473).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.expressions.collecting import expand
from inverse_service.expressions.collecting_trees import Monomial, Term, monomial_tree, terms_tree
from inverse_service.expressions.tree import (
    HALF,
    PI,
    ZERO,
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Velocity,
    add,
    apply,
    multiply,
    number,
    square_root,
    walk,
)
from inverse_service.mechanics.legendre.short_forms import simplified, velocities_in

Rule = Callable[[Expression], Expression]


@dataclass(frozen=True, slots=True)
class Root:
    """A solution v, right where every tree of `conditions` (in q, v, p) is positive."""

    value: Expression
    conditions: tuple[Expression, ...] = ()


def occurrences(tree: Expression, leaf: Velocity) -> int:
    return sum(1 for node in walk(tree) if node == leaf)


def isolate(tree: Expression, leaf: Velocity, target: Expression) -> Iterator[Root]:
    """All solutions of tree = target for the leaf; none where it does not occur exactly once."""
    if occurrences(tree, leaf) == 1:
        yield from _inverted(tree, leaf, Root(target))


def _inverted(tree: Expression, leaf: Velocity, known: Root) -> Iterator[Root]:
    if tree == leaf:
        yield known
        return
    for inner, root in peeled(tree, leaf, known):
        yield from _inverted(inner, leaf, root)


def peeled(tree: Expression, leaf: Velocity, known: Root) -> Iterator[tuple[Expression, Root]]:
    """The part that holds the leaf, with what it must be equal to."""
    target = known.value
    match tree:
        case Sum(terms):
            holder = next(term for term in terms if occurrences(term, leaf))
            rest = add(*(term for term in terms if term is not holder))
            yield holder, Root(target - rest, known.conditions)
        case Product(factors):
            holder = next(factor for factor in factors if occurrences(factor, leaf))
            rest = multiply(*(factor for factor in factors if factor is not holder))
            yield holder, Root(target / rest, known.conditions)
        case Power(base, exponent) if occurrences(base, leaf):
            for root in roots_of_power(base, exponent, target):
                yield base, Root(root.value, (*known.conditions, *root.conditions))
        case Power(base, exponent):
            yield exponent, Root(apply("log", target) / apply("log", base), known.conditions)
        case Apply(function, argument):
            for root in _roots_of_function(function, argument, target):
                yield argument, Root(root.value, (*known.conditions, *root.conditions))


def roots_of_power(base: Expression, exponent: Expression, target: Expression) -> Iterator[Root]:
    """base with base^exponent = target; for odd exponents a form that is right for both signs."""
    if not isinstance(exponent, Number) or exponent.value.denominator != 1:
        yield Root(target**exponent**-1)
        return
    whole = int(exponent.value)
    if whole in (1, -1):
        yield Root(target**whole)
    elif whole % 2:
        yield Root(target * (target**2) ** Fraction(1 - whole, 2 * whole))
    else:
        root = target ** Fraction(1, whole)
        yield Root(root, (base,))
        yield Root(-root, (-base,))


_INVERSES: dict[str, str] = {
    "exp": "log", "log": "exp", "tan": "atan", "sinh": "asinh", "tanh": "atanh", "asin": "sin", "acos": "cos",
    "atan": "tan", "asinh": "sinh", "acosh": "cosh", "atanh": "tanh",
}  # fmt: skip


def _roots_of_function(function: str, argument: Expression, target: Expression) -> Iterator[Root]:
    """argument with function(argument) = target, on the branches next to zero."""
    inverse = _INVERSES.get(function)
    if inverse:
        yield Root(apply(inverse, target), _branch_conditions(function, argument))
    elif function == "sin":
        yield Root(apply("asin", target), _branch_conditions("tan", argument))
    elif function in ("cos", "cosh"):
        root = apply("a" + function, target)
        yield Root(root, (argument,))
        yield Root(-root, (-argument,))


def _branch_conditions(function: str, argument: Expression) -> tuple[Expression, ...]:
    """tan and sin are undone by atan and asin only for |argument| < pi/2."""
    quarter_turn = HALF * PI
    return (quarter_turn - argument, quarter_turn + argument) if function == "tan" else ()


_NAME = "the cubic's unknown"


@dataclass(frozen=True, slots=True)
class Laurent:
    """sum of coefficients[e] generator^e; the generator is the velocity, exp of a multiple of it, or such
    as log v with the velocity in it once."""

    generator: Expression
    coefficients: Mapping[Fraction, Expression]


def polynomial_roots(tree: Expression, leaf: Velocity, target: Expression) -> Iterator[Root]:
    """The solutions of tree = target for the leaf, where the tree is such a polynomial."""
    laurent = laurent_polynomial(tree, leaf)
    if laurent is None:
        return
    table = dict(laurent.coefficients)
    table[Fraction(0)] = table.get(Fraction(0), ZERO) - target
    table = {exponent: value for exponent, value in table.items() if value != ZERO}
    lowest = min(table)
    step = _common_step([exponent - lowest for exponent in table])
    if not step or max(table) - lowest > 3 * step:
        return
    unknown = laurent.generator**step
    c = [table.get(lowest + k * step, ZERO) for k in range(int((max(table) - lowest) / step) + 1)]
    if len(c) == 2:
        yield from _unwound(unknown, leaf, Root(-c[0] / c[1]))
    elif len(c) == 3:
        for root in _quadratic(c[2], c[1], c[0], unknown):
            yield from _unwound(unknown, leaf, root)
    elif len(c) == 4:
        for root in _cubic(c, unknown):
            yield from _unwound(unknown, leaf, root)


def _common_step(exponents: Sequence[Fraction]) -> Fraction:
    """The largest number of which all are multiples."""
    below = math.lcm(*(e.denominator for e in exponents))
    return Fraction(math.gcd(*(int(e * below) for e in exponents)), below)


def laurent_polynomial(tree: Expression, leaf: Velocity) -> Laurent | None:
    """The tree in powers of one generator; None where the leaf occurs in another way."""
    generators: set[Expression] = set()
    table: dict[Fraction, list[Term]] = {}
    for monomial, value in expand(tree):
        moving = [(base, e) for base, e in monomial if velocities_in(base, [leaf.coordinate])]
        rest = tuple(pair for pair in monomial if pair not in moving)
        if len(moving) > 1 or (moving and not _is_generator(moving[0][0], leaf)):
            return None
        generators.update(base for base, _ in moving)
        table.setdefault(moving[0][1] if moving else Fraction(0), []).append((rest, value))
    if len(generators) != 1:
        return None
    coefficients = {e: terms_tree(terms) for e, terms in table.items()}
    return Laurent(generators.pop(), coefficients)


def _is_generator(base: Expression, leaf: Velocity) -> bool:
    match base:
        case Apply("exp", argument):
            terms = expand(argument)
            return len(terms) == 1 and monomial_tree(terms[0][0]) == argument and _is_linear(terms[0][0], leaf)
        case Apply("log" | "atan" | "asinh" | "atanh"):
            return occurrences(base, leaf) == 1
        case _:
            return base == leaf


def _is_linear(monomial: Monomial, leaf: Velocity) -> bool:
    rest = tuple(pair for pair in monomial if pair != (leaf, Fraction(1)))
    return len(rest) < len(monomial) and not velocities_in(monomial_tree(rest), [leaf.coordinate])


def _unwound(tree: Expression, leaf: Velocity, known: Root) -> Iterator[Root]:
    for root in isolate(tree, leaf, known.value):
        yield Root(root.value, (*known.conditions, *root.conditions))


def _quadratic(a: Expression, b: Expression, c: Expression, y: Expression) -> Iterator[Root]:
    """Both roots of a y^2 + b y + c; `y` as a tree in v says which one it is."""
    discriminant = simplified(b**2 - 4 * a * c)
    slope = 2 * a * y + b
    for sign in (1, -1):
        over = -b + sign * square_root(discriminant)
        yield Root(over / (2 * a), (sign * slope,))


def _cubic(c: list[Expression], y: Expression) -> Iterator[Root]:
    """The roots of c_3 y^3 + c_2 y^2 + c_1 y + c_0: with y = z - h those of z^3 + 3 k z = b."""
    h, slope, start = (simplified(c[j] / (d * c[3])) for j, d in ((2, 3), (1, 1), (0, 1)))
    k = simplified(Fraction(1, 3) * slope - h**2)
    b = simplified(h * (slope - 2 * h**2) - start)
    z, unknown = y + h, Velocity(_NAME)
    if k == ZERO:
        for root in isolate(Power(unknown, number(3)), unknown, b):
            yield Root(root.value - h)
        return
    yield Root(_tripled(k, b, "asinh", "sinh") - h, (k,))
    size = simplified(-k)
    outside = z**2 - size
    yield Root(_tripled(size, -b, "asin", "sin") - h, (size, -outside))
    ratio = b / (2 * size ** Fraction(3, 2))
    for inverse, function, side in (("acosh", "cosh", 1), ("acos", "cos", -1)):
        for sign in map(number, (1, -1)):
            value = sign * _tripled(size, sign * b, inverse, function)
            alone = side * (sign * ratio - 1)
            yield Root(value - h, (size, outside, sign * z, alone))


def _tripled(k: Expression, b: Expression, inverse: str, function: str) -> Expression:
    """2 sqrt(k) sinh(asinh(b/(2 k^(3/2)))/3), for other functions likewise: z^3 + 3 k z = b by the triple angle."""
    angle = apply(inverse, simplified(b / (2 * k ** Fraction(3, 2))))
    third = apply(function, Fraction(1, 3) * angle)
    return 2 * square_root(simplified(k)) * third
