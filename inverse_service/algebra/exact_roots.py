"""Roots, and the inverse functions whose derivatives hold them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from inverse_service.algebra.exact_ring import ExactRing
from inverse_service.algebra.exact_trees import polynomial_tree
from inverse_service.algebra.rational_functions import Quotient
from inverse_service.expressions.tree import Apply, Expression, Number, Power, add, multiply, number, power

# The derivative of each inverse function is sign / (constant + quadratic u^2)^exponent.
INVERSE: dict[str, tuple[int, int, int, Fraction]] = {
    "asin": (1, 1, -1, Fraction(1, 2)),
    "acos": (-1, 1, -1, Fraction(1, 2)),
    "atan": (1, 1, 1, Fraction(1)),
    "asinh": (1, 1, 1, Fraction(1, 2)),
    "acosh": (1, -1, 1, Fraction(1, 2)),
    "atanh": (1, 1, -1, Fraction(1)),
}


def adjoin_roots(ring: ExactRing, powers: Sequence[Power]) -> None:
    """Generators for rational powers; powers of one base share the root of the common denominator."""
    degrees: dict[Expression, int] = {}
    for node in powers:
        assert isinstance(node.exponent, Number)
        degrees[node.base] = math.lcm(degrees.get(node.base, 1), node.exponent.value.denominator)
    for base, degree in degrees.items():
        root = root_generator(ring, ring.value(base), base, degree)
        for node in powers:
            if node.base == base and isinstance(node.exponent, Number):
                ring.atoms[node] = root ** int(node.exponent.value * degree)


def root_generator(ring: ExactRing, radicand: Quotient, tree: Expression, degree: int) -> Quotient:
    """An element r with r^degree = radicand; the same radicand gives the same generator.

    For the radicand a/b the generator is b (a/b)^(1/degree), a root of the polynomial a b^(degree-1).
    """
    if radicand.is_zero:
        return radicand
    below = Quotient(ring.field, ring.field.expand(radicand.exponents), ())
    polynomial = (Quotient(ring.field, radicand.numerator, ()) * below ** (degree - 1)).numerator
    for relation in ring.field.relations.values():
        if relation.degree % degree == 0 and relation.right == polynomial and _is_root(ring, relation.generator):
            return ring.generator(relation.generator) ** (relation.degree // degree) / below
    root = power(tree, Fraction(1, degree))
    index = ring.new_generator(multiply(polynomial_tree(ring, below.numerator), root))
    ring.field.relate(index, degree, polynomial)
    whole = Quotient(ring.field, polynomial, ())
    ring.set_slopes(index, [(ring.generator(index) / whole.scaled(degree), whole)])
    return ring.generator(index) / below


def _is_root(ring: ExactRing, index: int) -> bool:
    """Whether the generator is a root, not a sine; sqrt(1 - cos^2) is sin up to a sign only."""
    return not isinstance(ring.trees[index], Apply)


def adjoin_inverse(ring: ExactRing, node: Apply) -> None:
    """A generator for asin, acos, atan, asinh, acosh or atanh of an argument."""
    sign, constant, quadratic, exponent = INVERSE[node.function]
    argument = ring.value(node.argument)
    below = ring.constant(constant) + (argument * argument).scaled(quadratic)
    if exponent.denominator == 2:
        square = power(node.argument, 2)
        tree = add(number(constant), multiply(number(quadratic), square))
        below = root_generator(ring, below, tree, 2)
    index = ring.new_generator(node)
    ring.set_slopes(index, [(below.inverse().scaled(sign), argument)])
    ring.atoms[node] = ring.generator(index)
