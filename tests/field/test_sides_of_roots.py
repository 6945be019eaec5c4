"""On each side of the zeros of a formula a root or inverse function of it is another formula."""

from __future__ import annotations

from contextlib import suppress

import mpmath
import pytest

from inverse_service.expressions import calculus, tree as ex
from inverse_service.field import real_branch, sign_cases
from inverse_service.reading import names as nm, reader

PLACES = [k / 10 + 0.037 for k in range(-45, 45)]


@pytest.mark.parametrize(
    ("text", "least"),
    [
        ("sqrt(x^2)", 90), ("sqrt((x^3 - x)^2)", 90), ("sqrt(x^3*(x + 1)^2)", 45),
        ("asin(sin(x))", 60), ("acos(cos(x))", 60), ("atan(tan(x))", 60), ("Heaviside(x - 1)", 90),
        ("(8*x^3)^(1/3)", 45), ("(-8*x^3)^(1/3)", 45), ("(-8*(x - 1)^3)^(2/3)", 45),
    ],
)  # fmt: skip
def test_a_case_has_the_value_of_the_formula(text: str, least: int) -> None:
    """Where all trees of a case are positive, and in one case only."""
    given = reader.read_formula(text, nm.Names(("x",), (), {}))
    cases, met = list(sign_cases.sign_cases([given])), 0
    for place in PLACES:
        point = real_branch.table_at({"x": str(place)})
        on = [case for case in cases if real_branch.are_positive(case.positive, point)]
        assert len(on) <= 1
        with suppress(calculus.NoRealValue):
            value = calculus.evaluate(given, point)
            for case in on:
                assert mpmath.almosteq(calculus.evaluate(case.formulas[0], point), value, 1e-12)
            met += len(on)
    assert met >= least


@pytest.mark.parametrize("text", ["(x - 7)^2*(10^(-6) - (x - 9)^2)", "10^(-8) - (x^2 - 2)^2"])
def test_a_point_is_found_on_a_small_interval_beside_double_zeros(text: str) -> None:
    tree = reader.read_formula(text, nm.Names(("x",), (), {}))
    point = real_branch.find_real_point([tree], [ex.Symbol("x")], 1, [tree])
    assert point is not None
    assert calculus.evaluate(tree, point) > 0
