"""A formula in pieces has the value of the first piece whose condition holds."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import product

import pytest

from inverse_service.errors import InputError
from inverse_service.expressions import calculus, tree as ex
from inverse_service.reading import names as nm, reader

Condition = Callable[[float, float], bool]
PLACES = (-1.7, -0.6, 0.3, 0.8, 1.5)  # on no boundary
CONDITIONS: dict[str, Condition] = {
    "(x > 0) | (y > 0)": lambda x, y: x > 0 or y > 0,
    "(x > 0) | (y > 0) | (x > y)": lambda x, y: x > 0 or y > 0 or x > y,
    "(x > 0) & (y < 1)": lambda x, y: x > 0 and y < 1,
    "~((x > 0) | (y > 1))": lambda x, y: not (x > 0 or y > 1),
    "(x > 0) & (y > 0) | (x < 1)": lambda x, y: (x > 0 and y > 0) or x < 1,
    "0 < x < 1": lambda x, y: 0 < x < 1,
    "1 > x > y > -1": lambda x, y: 1 > x > y > -1,
    "x^2 < y < x + 1": lambda x, y: x**2 < y < x + 1,
}


@cache
def formula(text: str) -> ex.Expression:
    return reader.read_formula(text, nm.Names(("x", "y")))


def value(text: str, x: float, y: float) -> float:
    tree = formula(text)
    table = {ex.Symbol("x"): calculus.mpf(x), ex.Symbol("y"): calculus.mpf(y)}
    return float(calculus.evaluate(tree, table))


@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_piece_holds_exactly_where_its_condition_does(condition: str) -> None:
    for x, y in product(PLACES, PLACES):
        if x != y:
            wanted = 2 + x if CONDITIONS[condition](x, y) else 5 * y
            assert value(f"piecewise((2 + x, {condition}), (5*y, true))", x, y) == pytest.approx(
                wanted
            )


def test_of_two_pieces_that_hold_the_first_counts() -> None:
    text = "piecewise((1, x > 0), (2, (x > -1) | (y > 0)), (3, y > -1), (4, true))"
    for x, y in product(PLACES, PLACES):
        wanted = 1 if x > 0 else 2 if x > -1 or y > 0 else 3 if y > -1 else 4
        assert value(text, x, y) == wanted


@pytest.mark.parametrize(
    "pieces", ["(1, x > 0)", "(1, x > 0), (2, y > 0)", "(1, x > 0), (2, (x < 0) & (y > 0))"]
)
def test_pieces_that_leave_a_gap_are_refused(pieces: str) -> None:
    """There the formula would be 0, which nobody wrote."""
    with pytest.raises(InputError):
        formula(f"piecewise({pieces})")


def test_pieces_without_a_gap_need_no_last_one() -> None:
    assert value("piecewise((1, x > 0), (2, x < 0))", 0.5, 1) == 1
    assert value("piecewise((1, x > 0), (2, x < 0))", -0.5, 1) == 2
