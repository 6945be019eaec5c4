"""The derivatives of special functions among the kernels by the independent ones.

The kernel of a special function is a function y(u), or y(n, u) of an order n, whose law gives its
m-th derivative by u, y, …, y^(m-1): m = 1 for erf, 2 for a Bessel function. The gamma function has
no law, and all its derivatives are independent. See `functions.py`.
"""

from collections.abc import Iterable
from functools import lru_cache

from inverse_service.expressions import calculus, collecting, functions, tree as ex

_U, _ORDER = ex.Symbol("u"), ex.Symbol("n")


def is_special(node: ex.Expression) -> bool:
    """Whether the node is the kernel of a special function, or a derivative of it."""
    return isinstance(node, ex.Arbitrary) and node.name in functions.SPECIAL


def _order_of(node: ex.Arbitrary) -> int:
    """The number of derivatives by the argument; those by the order do not occur."""
    return node.orders[-1]


def by_independent(node: ex.Arbitrary) -> ex.Expression | None:
    """A derivative of a special function by the independent derivatives; None if it is one of
    these, and of other functions.
    """
    row = functions.FUNCTION.get(node.name)
    if row is None or row.law is None or _order_of(node) < row.jets:
        return None
    table: dict[ex.Expression, ex.Expression] = {_U: node.arguments[-1]}
    if row.ordered:
        table[_ORDER] = node.arguments[0]
    lower = (
        functions.special_kernel(node.name, *node.arguments, derivative=k) for k in range(row.jets)
    )
    table |= dict(zip(map(_letter, range(row.jets)), lower, strict=True))
    return ex.substitute(_by_letters(node.name, _order_of(node)), table)


def _letter(k: int) -> ex.Expression:
    return ex.Symbol(f"y{k}")


@lru_cache(maxsize=512)
def _by_letters(name: str, order: int) -> ex.Expression:
    """The derivative of this order as a tree in u, n, y0, y1, …."""
    row = functions.FUNCTION[name]
    assert row.law is not None
    letters = [_letter(k) for k in range(row.jets)]
    law = row.law(_U, *((_ORDER,) * row.ordered), *letters)
    if order == row.jets:
        return law
    below = _by_letters(name, order - 1)
    moved = calculus.differentiate(below, _U)
    for letter, rate in zip(letters, (*letters[1:], law), strict=True):
        moved = moved + calculus.differentiate(below, letter) * rate
    return collecting.collect(moved)


def with_laws(kernels: Iterable[ex.Expression]) -> tuple[ex.Expression, ...]:
    """The trees, and those of the laws of the special functions in them."""
    trees = tuple(kernels)
    laws: dict[ex.Expression, None] = {}
    for node in ex.distinct_nodes(trees):
        if isinstance(node, ex.Arbitrary) and is_special(node):
            row = functions.FUNCTION[node.name]
            law = by_independent(
                functions.special_kernel(node.name, *node.arguments, derivative=row.jets)
            )
            if law is not None:
                laws[law] = None
    return trees + tuple(law for law in laws if law not in trees)
