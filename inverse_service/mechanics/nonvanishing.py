"""Whether a tree is the zero function, by its values at random points to 50 digits."""

from __future__ import annotations

import random
from collections.abc import Mapping

from mpmath import mp, mpf

from inverse_service.errors import InputError
from inverse_service.expressions.evaluation import NoRealValue, Real, evaluate
from inverse_service.expressions.tree import (
    PI,
    Acceleration,
    Arbitrary,
    Expression,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    walk,
)

_DIGITS = 50
_POINTS = 3
_ATTEMPTS = 60
_SEED = 20_040_229


def vanishes(tree: Expression) -> bool:
    """True where the tree is 0 at several random points, relative to the size of its terms.

    InputError where no point is found at which it has a real value.
    """
    source = random.Random(_SEED)
    values = []
    with mp.workdps(_DIGITS):
        for attempt in range(_ATTEMPTS):
            try:
                values.append(_is_small(tree, _point(tree, source, 1 + attempt % 5)))
            except NoRealValue:
                continue
            if not values[-1] or len(values) == _POINTS:
                return values[-1]
    raise InputError(
        "no point was found at which the coefficients of the accelerations are real: check roots and logarithms.",
        "/equations",
    )


def _point(tree: Expression, source: random.Random, width: int) -> dict[Expression, Real]:
    """Random values of all leaves; the first attempts are positive, later ones of both signs."""
    table: dict[Expression, Real] = {}
    for node in walk(tree):
        if isinstance(node, Symbol | Velocity | Acceleration | Arbitrary) and node not in table and node != PI:
            value = mpf(source.randrange(1, 10**18)) / 10**18
            low = 0 if width <= 2 else -width
            table[node] = low + (width - low) * value
    return table


def _is_small(tree: Expression, table: Mapping[Expression, Real]) -> bool:
    """Whether a factor is 0 to the working precision; a sum is measured against the sizes of its terms."""
    match tree:
        case Power(base, _):
            return _is_small(base, table)
        case Product(factors):
            return any(_is_small(factor, table) for factor in factors)
        case Sum(terms):
            values = [evaluate(term, table) for term in terms]
        case _:
            values = [evaluate(tree, table)]
    size = mp.fsum(map(abs, values)) if len(values) > 1 else 1
    return bool(abs(mp.fsum(values)) <= mpf(10) ** (10 - _DIGITS) * size)
