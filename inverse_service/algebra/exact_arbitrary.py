"""Arbitrary functions: each partial derivative of each one is a generator of its own."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from inverse_service.algebra.exact_ring import ExactRing
from inverse_service.algebra.rational_functions import Quotient
from inverse_service.expressions.tree import Arbitrary, Expression, Integral

Family = tuple[str, tuple[Expression, ...]]


def adjoin_arbitrary(ring: ExactRing, nodes: Sequence[Arbitrary], further: int) -> None:
    """Generators for the functions in `nodes` and their derivatives of `further` more orders.

    Derivatives of the highest order have none in their turn and are marked undefined.
    """
    families: dict[Family, int] = {}
    for node in nodes:
        if isinstance(node, Integral):
            index = ring.new_generator(node)
            ring.atoms[node] = ring.generator(index)
            ring.undefined.add(index)
            continue
        family = (node.name, node.arguments)
        families[family] = max(families.get(family, 0), sum(node.orders))
    for (name, arguments), order in families.items():
        _adjoin_family(ring, name, arguments, order + further)


def _adjoin_family(ring: ExactRing, name: str, arguments: tuple[Expression, ...], highest: int) -> None:
    values = [ring.value(argument) for argument in arguments]
    indices: dict[tuple[int, ...], int] = {}
    # From the highest order down, so that lower derivatives are the greater generators.
    for orders in sorted(_orders(len(arguments), highest), key=lambda k: (-sum(k), k)):
        node = Arbitrary(name, arguments, orders)
        indices[orders] = ring.new_generator(node)
        ring.atoms[node] = ring.generator(indices[orders])
        if sum(orders) == highest:
            ring.undefined.add(indices[orders])
            continue
        slopes = [(_next(ring, indices, orders, place), value) for place, value in enumerate(values)]
        ring.set_slopes(indices[orders], slopes)


def _orders(length: int, highest: int) -> list[tuple[int, ...]]:
    return [k for k in itertools.product(range(highest + 1), repeat=length) if sum(k) <= highest]


def _next(ring: ExactRing, indices: dict[tuple[int, ...], int], orders: tuple[int, ...], place: int) -> Quotient:
    raised = tuple(order + (position == place) for position, order in enumerate(orders))
    return ring.generator(indices[raised])
