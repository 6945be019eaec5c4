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

from inverse_service.expressions import collecting, collecting_trees
from inverse_service.expressions import tree as ex
from inverse_service.mechanics.legendre import short_forms

Rule = Callable[[ex.Expression], ex.Expression]


@dataclass(frozen=True, slots=True)
class Root:
    """A solution v, right where every tree of `conditions` (in q, v, p) is positive."""

    value: ex.Expression
    conditions: tuple[ex.Expression, ...] = ()


def occurrences(tree: ex.Expression, leaf: ex.Velocity) -> int:
    return sum(1 for node in ex.walk(tree) if node == leaf)


def isolate(tree: ex.Expression, leaf: ex.Velocity, target: ex.Expression) -> Iterator[Root]:
    """All solutions of tree = target for the leaf; none where it does not occur exactly once."""
    if occurrences(tree, leaf) == 1:
        yield from _inverted(tree, leaf, Root(target))


def _inverted(tree: ex.Expression, leaf: ex.Velocity, known: Root) -> Iterator[Root]:
    if tree == leaf:
        yield known
        return
    for inner, root in peeled(tree, leaf, known):
        yield from _inverted(inner, leaf, root)


def peeled(tree: ex.Expression, leaf: ex.Velocity, known: Root) -> Iterator[tuple[ex.Expression, Root]]:
    """The part that holds the leaf, with what it must be equal to."""
    target = known.value
    match tree:
        case ex.Sum(terms):
            holder = next(term for term in terms if occurrences(term, leaf))
            rest = ex.add(*(term for term in terms if term is not holder))
            yield holder, Root(target - rest, known.conditions)
        case ex.Product(factors):
            holder = next(factor for factor in factors if occurrences(factor, leaf))
            rest = ex.multiply(*(factor for factor in factors if factor is not holder))
            yield holder, Root(target / rest, known.conditions)
        case ex.Power(base, exponent) if occurrences(base, leaf):
            for root in roots_of_power(base, exponent, target):
                yield base, Root(root.value, (*known.conditions, *root.conditions))
        case ex.Power(base, exponent):
            yield exponent, Root(ex.apply("log", target) / ex.apply("log", base), known.conditions)
        case ex.Apply(function, argument):
            for root in _roots_of_function(function, argument, target):
                yield argument, Root(root.value, (*known.conditions, *root.conditions))


def roots_of_power(base: ex.Expression, exponent: ex.Expression, target: ex.Expression) -> Iterator[Root]:
    """base with base^exponent = target; for odd exponents a form that is right for both signs."""
    if not isinstance(exponent, ex.Number) or exponent.value.denominator != 1:
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


def _roots_of_function(function: str, argument: ex.Expression, target: ex.Expression) -> Iterator[Root]:
    """argument with function(argument) = target, on the branches next to zero."""
    inverse = _INVERSES.get(function)
    if inverse:
        yield Root(ex.apply(inverse, target), _branch_conditions(function, argument))
    elif function == "sin":
        yield Root(ex.apply("asin", target), _branch_conditions("tan", argument))
    elif function in ("cos", "cosh"):
        root = ex.apply("a" + function, target)
        yield Root(root, (argument,))
        yield Root(-root, (-argument,))


def _branch_conditions(function: str, argument: ex.Expression) -> tuple[ex.Expression, ...]:
    """tan and sin are undone by atan and asin only for |argument| < pi/2."""
    quarter_turn = ex.HALF * ex.PI
    return (quarter_turn - argument, quarter_turn + argument) if function == "tan" else ()


_NAME = "the cubic's unknown"


@dataclass(frozen=True, slots=True)
class Laurent:
    """sum of coefficients[e] generator^e; the generator is the velocity, exp of a multiple of it, or such
    as log v with the velocity in it once."""

    generator: ex.Expression
    coefficients: Mapping[Fraction, ex.Expression]


def polynomial_roots(tree: ex.Expression, leaf: ex.Velocity, target: ex.Expression) -> Iterator[Root]:
    """The solutions of tree = target for the leaf, where the tree is such a polynomial."""
    laurent = laurent_polynomial(tree, leaf)
    if laurent is None:
        return
    table = dict(laurent.coefficients)
    table[Fraction(0)] = table.get(Fraction(0), ex.ZERO) - target
    table = {exponent: value for exponent, value in table.items() if value != ex.ZERO}
    lowest = min(table)
    step = _common_step([exponent - lowest for exponent in table])
    if not step or max(table) - lowest > 3 * step:
        return
    unknown = laurent.generator**step
    c = [table.get(lowest + k * step, ex.ZERO) for k in range(int((max(table) - lowest) / step) + 1)]
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


def laurent_polynomial(tree: ex.Expression, leaf: ex.Velocity) -> Laurent | None:
    """The tree in powers of one generator; None where the leaf occurs in another way."""
    generators: set[ex.Expression] = set()
    table: dict[Fraction, list[collecting_trees.Term]] = {}
    for monomial, value in collecting.expand(tree):
        moving = [(base, e) for base, e in monomial if short_forms.velocities_in(base, [leaf.coordinate])]
        rest = tuple(pair for pair in monomial if pair not in moving)
        if len(moving) > 1 or (moving and not _is_generator(moving[0][0], leaf)):
            return None
        generators.update(base for base, _ in moving)
        table.setdefault(moving[0][1] if moving else Fraction(0), []).append((rest, value))
    if len(generators) != 1:
        return None
    coefficients = {e: collecting_trees.terms_tree(terms) for e, terms in table.items()}
    return Laurent(generators.pop(), coefficients)


def _is_generator(base: ex.Expression, leaf: ex.Velocity) -> bool:
    match base:
        case ex.Apply("exp", argument):
            terms = collecting.expand(argument)
            return (
                len(terms) == 1
                and collecting_trees.monomial_tree(terms[0][0]) == argument
                and _is_linear(terms[0][0], leaf)
            )
        case ex.Apply("log" | "atan" | "asinh" | "atanh"):
            return occurrences(base, leaf) == 1
        case _:
            return base == leaf


def _is_linear(monomial: collecting_trees.Monomial, leaf: ex.Velocity) -> bool:
    rest = tuple(pair for pair in monomial if pair != (leaf, Fraction(1)))
    return len(rest) < len(monomial) and not short_forms.velocities_in(
        collecting_trees.monomial_tree(rest), [leaf.coordinate]
    )


def _unwound(tree: ex.Expression, leaf: ex.Velocity, known: Root) -> Iterator[Root]:
    for root in isolate(tree, leaf, known.value):
        yield Root(root.value, (*known.conditions, *root.conditions))


def _quadratic(a: ex.Expression, b: ex.Expression, c: ex.Expression, y: ex.Expression) -> Iterator[Root]:
    """Both roots of a y^2 + b y + c; `y` as a tree in v says which one it is."""
    discriminant = short_forms.simplified(b**2 - 4 * a * c)
    slope = 2 * a * y + b
    for sign in (1, -1):
        over = -b + sign * ex.square_root(discriminant)
        yield Root(over / (2 * a), (sign * slope,))


def _cubic(c: list[ex.Expression], y: ex.Expression) -> Iterator[Root]:
    """The roots of c_3 y^3 + c_2 y^2 + c_1 y + c_0: with y = z - h those of z^3 + 3 k z = b."""
    h, slope, start = (short_forms.simplified(c[j] / (d * c[3])) for j, d in ((2, 3), (1, 1), (0, 1)))
    k = short_forms.simplified(Fraction(1, 3) * slope - h**2)
    b = short_forms.simplified(h * (slope - 2 * h**2) - start)
    z, unknown = y + h, ex.Velocity(_NAME)
    if k == ex.ZERO:
        for root in isolate(ex.Power(unknown, ex.number(3)), unknown, b):
            yield Root(root.value - h)
        return
    yield Root(_tripled(k, b, "asinh", "sinh") - h, (k,))
    size = short_forms.simplified(-k)
    outside = z**2 - size
    yield Root(_tripled(size, -b, "asin", "sin") - h, (size, -outside))
    ratio = b / (2 * size ** Fraction(3, 2))
    for inverse, function, side in (("acosh", "cosh", 1), ("acos", "cos", -1)):
        for sign in map(ex.number, (1, -1)):
            value = sign * _tripled(size, sign * b, inverse, function)
            alone = side * (sign * ratio - 1)
            yield Root(value - h, (size, outside, sign * z, alone))


def _tripled(k: ex.Expression, b: ex.Expression, inverse: str, function: str) -> ex.Expression:
    """2 sqrt(k) sinh(asinh(b/(2 k^(3/2)))/3), for other functions likewise: z^3 + 3 k z = b by the triple angle."""
    angle = ex.apply(inverse, short_forms.simplified(b / (2 * k ** Fraction(3, 2))))
    third = ex.apply(function, Fraction(1, 3) * angle)
    return 2 * ex.square_root(short_forms.simplified(k)) * third
