"""Functions written for people: one term for each product of velocities, tan for sin/cos, sums put together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from functools import lru_cache
from itertools import permutations

from inverse_service import bounds
from inverse_service.expressions.collecting import expand
from inverse_service.expressions.collecting_trees import terms_tree
from inverse_service.expressions.inequalities import is_positive_polynomial
from inverse_service.expressions.tree import (
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    multiply,
    node_count,
    rebuild,
    walk,
)
from inverse_service.field.exact_field import Budget, ExactRing, Quotient, TooLarge, exact_ring, quotient_tree

_MOST_PRODUCTS = 64
_QUOTIENTS = {("sin", "cos"): "tan", ("cos", "sin"): "cot", ("sinh", "cosh"): "tanh", ("cosh", "sinh"): "coth"}


def readable(ring: ExactRing, element: Quotient) -> Expression:
    """The element as one quotient, or as a sum over the products of velocities, whichever is shorter."""
    whole = _in_order(joined(quotient_tree(ring, element)))
    parts = velocity_parts(ring, element)
    if len(parts) < 2:
        return whole
    apart = add(*(_in_order(joined(quotient_tree(ring, part))) for part in parts))
    return min([apart, whole], key=node_count)


def velocity_parts(ring: ExactRing, element: Quotient) -> list[Quotient]:
    """The parts with the same powers of all velocities in the numerator, the highest powers first."""
    places = [index for index, tree in ring.trees.items() if isinstance(tree, Velocity)]
    parts = element.parts(places)
    return [parts[powers] for powers in sorted(parts, key=lambda powers: (-sum(powers), powers))]


def joined(tree: Expression) -> Expression:
    """The tree with sin(u)^k cos(u)^-k as tan(u)^k, and u^k w^k as (u w)^k where the product of the sums is shorter.

    Roots are put together where both radicands are positive on the whole line: the domain stays what it is.
    """
    inner = rebuild(tree, joined)
    if not isinstance(inner, Product):
        return inner
    table: dict[Expression, Fraction] = {}
    for base, exponent in map(_power_of, inner.factors):
        table[base] = table.get(base, Fraction(0)) + exponent
    while found := next(_replacements(table), None):
        left, right, both = found
        table = {both if base == left else base: value for base, value in table.items() if base != right}
    return multiply(*(base**exponent for base, exponent in table.items()))


def _replacements(table: Mapping[Expression, Fraction]) -> Iterator[tuple[Expression, Expression, Expression]]:
    for (k, one), (j, other) in permutations(enumerate(table), 2):
        # The product of two sums is the same in both orders.
        both = _both(table, one, other) if k < j or not isinstance(one, Sum) else None
        if both is not None:
            yield one, other, both


def _both(table: Mapping[Expression, Fraction], one: Expression, other: Expression) -> Expression | None:
    """What stands for both bases with the exponent of the first; None where nothing shorter does."""
    match one, other:
        case [Apply(above, argument), Apply(below, same)] if argument == same and (above, below) in _QUOTIENTS:
            fits = table[one] == -table[other] and table[one] > 0
            found: Expression = Apply(_QUOTIENTS[above, below], argument)
        case [Sum(left), Sum(right)] if table[one] == table[other] and len(left) * len(right) <= _MOST_PRODUCTS:
            found = terms_tree(sorted(expand(one * other), key=lambda term: -sum(exponent for _, exponent in term[0])))
            is_shorter = isinstance(found, Sum) and len(found.terms) < len(left) + len(right) - 1
            fits = is_shorter and (table[one].denominator == 1 or all(map(is_positive_polynomial, (one, other))))
        case _:
            return None
    return found if fits and found not in table else None


def _in_order(tree: Expression) -> Expression:
    """Numbers and symbols of each product first, then functions, then velocities."""
    inner = rebuild(tree, _in_order)
    return multiply(*sorted(inner.factors, key=_place)) if isinstance(inner, Product) else inner


def _power_of(factor: Expression) -> tuple[Expression, Fraction]:
    match factor:
        case Power(base, Number(value)) if value.denominator == 1 or isinstance(base, Sum):
            return base, value
        case _:
            return factor, Fraction(1)


def _place(factor: Expression) -> int:
    base, _ = _power_of(factor)
    return 2 if isinstance(base, Velocity) else 1 if isinstance(base, Apply) else 0


@lru_cache(maxsize=1024)
def tidied(tree: Expression) -> Expression:
    """The tree as one exact quotient, roots and trigonometric functions reduced; as it is where that is too large."""
    variables = list(dict.fromkeys(node for node in walk(tree) if isinstance(node, Symbol | Velocity)))
    try:
        ring = exact_ring([tree], variables, 0, Budget(bounds.TERMS), spare=True, slopes=False)
        return readable(ring, ring.value(tree))
    except (TooLarge, ZeroDivisionError):
        return tree
