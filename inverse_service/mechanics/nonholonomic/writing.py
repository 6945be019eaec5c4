"""Functions of (t, q, u) written for people: one term for each product of velocities, tan for sin/cos."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache

from flint import fmpq

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.exact_ring import ExactRing, quotient_tree
from inverse_service.algebra.rational_functions import Budget, Quotient, TooLarge
from inverse_service.expressions.tree import (
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Symbol,
    Velocity,
    add,
    multiply,
    rebuild,
    walk,
)

_TIDIED_TERMS = 2_000
_QUOTIENTS = {("sin", "cos"): "tan", ("cos", "sin"): "cot", ("sinh", "cosh"): "tanh", ("cosh", "sinh"): "coth"}


def readable(ring: ExactRing, element: Quotient) -> Expression:
    """The element as one quotient, or as a sum over the products of velocities, whichever is shorter."""
    whole = with_tangents(quotient_tree(ring, element))
    parts = velocity_parts(ring, element)
    if len(parts) < 2:
        return whole
    apart = add(*(with_tangents(quotient_tree(ring, part)) for part in parts))
    return min([apart, whole], key=lambda tree: sum(1 for _ in walk(tree)))


def velocity_parts(ring: ExactRing, element: Quotient) -> list[Quotient]:
    """The parts with the same powers of all velocities in the numerator, the highest powers first."""
    places = [index for index, tree in ring.trees.items() if isinstance(tree, Velocity)]
    tables: dict[tuple[int, ...], dict[tuple[int, ...], fmpq]] = {}
    for exponents, coefficient in element.numerator.terms():
        key = tuple(int(exponents[place]) for place in places)
        tables.setdefault(key, {})[tuple(int(e) for e in exponents)] = coefficient
    owner = element.field
    ordered = sorted(tables, key=lambda key: (-sum(key), key))
    return [owner.quotient(owner.context.from_dict(tables[key]), element.exponents) for key in ordered]


def with_tangents(tree: Expression) -> Expression:
    """The tree with sin(u)^k cos(u)^-k written as tan(u)^k, and so on, inside products."""
    inner = rebuild(tree, with_tangents)
    return _joined(inner) if isinstance(inner, Product) else inner


def _joined(product: Product) -> Expression:
    table: dict[Expression, Fraction] = {}
    rest: list[Expression] = []
    for factor in product.factors:
        base, exponent = _power_of(factor)
        if isinstance(base, Apply) and any(base.function in pair for pair in _QUOTIENTS) and exponent is not None:
            table[base] = table.get(base, Fraction(0)) + exponent
        else:
            rest.append(factor)
    for (above, below), name in _QUOTIENTS.items():
        for base in [base for base in table if isinstance(base, Apply) and base.function == above]:
            other = Apply(below, base.argument)
            if other in table and table[base] == -table[other] and table[base] > 0:
                rest.append(Apply(name, base.argument) ** table.pop(base))
                del table[other]
    rest += [base**exponent for base, exponent in table.items() if exponent]
    return multiply(*sorted(rest, key=_place))


def _power_of(factor: Expression) -> tuple[Expression, Fraction | None]:
    match factor:
        case Power(base, Number(value)) if value.denominator == 1:
            return base, value
        case Power():
            return factor, None
        case _:
            return factor, Fraction(1)


def _place(factor: Expression) -> int:
    """Numbers and symbols, then functions, then velocities."""
    base, _ = _power_of(factor)
    return 2 if isinstance(base, Velocity) else 1 if isinstance(base, Apply) else 0


@lru_cache(maxsize=1024)
def tidied(tree: Expression) -> Expression:
    """The tree as one exact quotient, roots and trigonometric functions reduced; as it is where that is too large."""
    variables = list(dict.fromkeys(node for node in walk(tree) if isinstance(node, Symbol | Velocity)))
    try:
        ring = exact_ring([tree], variables, 0, Budget(_TIDIED_TERMS), spare=True, slopes=False)
        return readable(ring, ring.value(tree))
    except (TooLarge, ZeroDivisionError):
        return tree
