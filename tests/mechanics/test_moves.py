"""The moves that shorten formulas keep what they say, can be switched off, and are counted."""

from __future__ import annotations

import pytest

import inverse_service
from inverse_service.expressions import collecting, tree as ex
from inverse_service.mechanics import legendre, moves, square_forms
from inverse_service.mechanics.moves import Form, Holds, Move
from inverse_service.search import tidy

X, Y = ex.Symbol("x"), ex.Symbol("y")


def double(subject: str, tree: ex.Expression) -> ex.Expression:
    return tree + tree


def fail(subject: str, tree: ex.Expression) -> ex.Expression:
    raise ZeroDivisionError


DOUBLE = Move("double", Holds.FACTOR, double)


@pytest.mark.parametrize(
    "table",
    [tidy.GAUGES, tidy.FORMS, tidy.STYLE, legendre.ENERGY],
    ids=["gauges", "forms", "style", "energy"],
)
def test_names_in_a_table_are_different(table: tuple[Move[object] | Form[object], ...]) -> None:
    assert len({move.name for move in table}) == len(table) > 3


def test_moves_are_made_in_their_order_and_one_that_fails_is_left_out() -> None:
    square = Move("square", Holds.FACTOR, lambda subject, tree: tree**2)
    broken = Move("broken", Holds.FACTOR, fail)
    written = moves.write([DOUBLE, broken, square], "", X, (ZeroDivisionError,))
    assert written == (X + X) ** 2
    with pytest.raises(ZeroDivisionError):
        moves.write([broken], "", X)


def test_a_move_that_is_switched_off_changes_nothing() -> None:
    with moves.without("double"):
        assert moves.write([DOUBLE], "", X) == X
    assert moves.write([DOUBLE], "", X) == X + X


def test_the_first_of_the_cheapest_forms_is_kept_and_counted() -> None:
    one = Form("one", Holds.FACTOR, lambda subject, tree: (X,))
    other = Form("other", Holds.FACTOR, lambda subject, tree: (Y,))
    longer = Form("longer", Holds.FACTOR, lambda subject, tree: (X * Y * tree**2,))
    with moves.counted() as counts:
        assert moves.cheapest([longer, one, other], "", X + Y) == X
        assert moves.cheapest([longer, one, other], "", X + Y, admit=lambda form: form != X) == Y
        assert moves.cheapest([longer], "", X + Y) == X + Y
    assert counts == {one: 1, other: 1}


def test_a_lagrangian_without_the_move_for_its_form_is_longer() -> None:
    """A spring of natural length l: one move completes the square, which changes the constant in
    the potential.
    """
    document = {"equations": {"x": "-k*(x - l)"}, "parameters": ["k", "l"]}
    tidy._shortest.cache_clear()
    with moves.without("springs: (u - l)^2"):
        assert inverse_service.solve(document)["lagrangian"]["text"] == "x'^2/2 - k*x^2/2 + k*l*x"
    tidy._shortest.cache_clear()
    assert inverse_service.solve(document)["lagrangian"]["text"] == "x'^2/2 - k*(x - l)^2/2"


def test_orders_of_letters_that_only_change_signs_are_not_tried() -> None:
    """The square of a distance in space has one form, whatever order its letters are taken in."""
    letters = tuple(map(ex.Symbol, ("x_1", "y_1", "z_1", "x_2", "y_2", "z_2")))
    pairs = zip(letters[:3], letters[3:], strict=True)
    distance = ex.add(*((one - other) ** 2 for one, other in pairs))
    expanded = collecting.terms_tree(collecting.expand(distance))
    forms = square_forms.sums_of_squares(expanded, letters)
    assert distance in forms
    assert len(forms) <= 3
