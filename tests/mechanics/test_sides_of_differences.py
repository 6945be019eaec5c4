"""x - y and y - x in one formula are written alike, as the equations have them."""

from __future__ import annotations

import pytest

from inverse_service.expressions import printing
from inverse_service.mechanics import writing
from inverse_service.reading import names as nm, reader

NAMES = nm.Names(("x", "y"), ("k",), {})


@pytest.mark.parametrize(
    ("given", "written"),
    [
        ("x'*y'/(x - y) + 1/(y - x)", "x'*y'/(x - y) - 1/(x - y)"),
        ("x'*y'/(x - y) - k/(y - x)", "x'*y'/(x - y) + k/(x - y)"),
        ("x'*y' + 1/(y - x)", "x'*y' + 1/(y - x)"),
        ("(x - y)*x' + k/(y - x)^3", "(x - y)*x' - k/(x - y)^3"),
        ("x'*y' + k*(y - x) + 1/(x - y)", "x'*y' + k*(y - x) + 1/(x - y)"),
    ],
)
def test_a_formula_with_both_sides_of_a_difference_has_the_one_of_the_equations(
    given: str, written: str
) -> None:
    tree, model, wanted = (
        reader.read_formula(text, NAMES) for text in (given, "k/(x - y)^2", written)
    )
    found = writing.with_sums_as_in(tree, (model,))
    assert printing.to_text(found) == printing.to_text(wanted)
