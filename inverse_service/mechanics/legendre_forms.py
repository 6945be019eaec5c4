"""Short forms of trees: collected, or as one factored quotient, whichever is smaller."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from inverse_service.errors import LimitError
from inverse_service.expressions.collecting import collect, expand
from inverse_service.expressions.collecting_trees import merge_powers, separate_tree
from inverse_service.expressions.tree import (
    Expression,
    Velocity,
    add,
    multiply,
    number,
    walk,
)
from inverse_service.mechanics.opaque_fractions import OpaqueRing, expanded_terms

_MOST_TERMS = 400


def size(tree: Expression) -> int:
    """The number of nodes."""
    return sum(1 for _ in walk(tree))


def velocities_in(tree: Expression, names: Collection[str]) -> set[str]:
    """The coordinates among `names` whose velocities occur."""
    return {node.coordinate for node in walk(tree) if isinstance(node, Velocity) and node.coordinate in names}


def separated(tree: Expression) -> Expression:
    """The tree expanded, exponentials as powers of atoms so that quotients of them cancel."""
    return add(*(multiply(number(value), separate_tree(monomial)) for monomial, value in expand(tree).terms))


def quotient(tree: Expression) -> Expression:
    """The tree as one factored quotient of polynomials in atoms; as it is where that is too large."""
    plain = separated(tree)
    if max(expanded_terms(plain)) > _MOST_TERMS:
        return tree
    try:
        ring = OpaqueRing([plain])
        return merge_powers(ring.tree(ring.fraction(plain)))
    except (ZeroDivisionError, LimitError):
        return tree


def shortest(forms: Sequence[Expression]) -> Expression:
    """The smallest of some equal trees; the first of those of the same size."""
    return min(forms, key=size)


def simplified(tree: Expression) -> Expression:
    """The shortest of: the tree as it is, collected, as one quotient."""
    collected = collect(tree)
    return shortest([collected, merge_powers(tree), quotient(collected)])
