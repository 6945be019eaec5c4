"""A ring that does not differentiate writes trees as one that does, and says so where it is asked to."""

from __future__ import annotations

import pytest
from flint import Ordering, fmpq_mpoly_ctx

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.exact_ring import factor_trees, quotient_tree
from inverse_service.algebra.rational_functions import Budget, divided_out
from inverse_service.expressions.tree import Symbol
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

NAMES = Names(("x", "y"), ("c",), {"A": ("x",)})
TEXTS = (
    "x*c + 2*y",
    "(x^2 - y^2)/(x + c*y)",
    "sin(x + y)*cos(x) + tan(y)",
    "sqrt(1 + A(x)^2)/A(x) + c/sqrt(1 + A(x)^2)",
    "exp(2*x + y)/exp(x) + log(x*y)",
)


@pytest.mark.parametrize("text", TEXTS)
def test_the_same_quotient_is_written_with_and_without_slopes(text: str) -> None:
    tree = parse(text, NAMES)
    written = [
        quotient_tree(ring, ring.value(tree))
        for slopes in (True, False)
        for ring in [exact_ring([tree], [Symbol("x"), Symbol("y")], 1, Budget(), slopes=slopes)]
    ]
    assert written[0] == written[1]


def test_a_ring_without_slopes_does_not_differentiate() -> None:
    ring = exact_ring([parse("x*y", NAMES)], [Symbol("x"), Symbol("y")], 0, Budget(), slopes=False)
    with pytest.raises(ValueError, match="without derivatives"):
        ring.partial(0)
    with pytest.raises(ValueError, match="without derivatives"):
        ring.along([None, None])


def test_taking_factors_out_of_zero_ends() -> None:
    context = fmpq_mpoly_ctx.get(("x", "y"), Ordering.lex)
    x, y = context.gens()
    assert divided_out(context.constant(0), x + y) == (0, 0)
    assert divided_out((x + y) ** 3 * x, x + y) == (x, 3)
    assert divided_out(x, context.constant(2)) == (x, 0)
    ring = exact_ring([parse("x*sqrt(1 + y^2)", NAMES)], [Symbol("x"), Symbol("y")], 0, Budget(), slopes=False)
    assert factor_trees(ring, ring.constant(0)) == []
