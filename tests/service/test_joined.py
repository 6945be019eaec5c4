"""One formula for two cases: on each side it is L of the case, up to a constant."""

from __future__ import annotations

import json

import mpmath
import pytest

from inverse_service.expressions import calculus, tree as ex
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import joined
from inverse_service.service.documents.checking import check_document

NAMES = nm.Names(("x", "y"), ("k",))


def branch(domain: str, text: str) -> dict[str, object]:
    return {"domain": [domain], "lagrangian": {"text": text, "domain": []}}


def value(text: str, x: str, y: str) -> mpmath.mpf:
    at: dict[ex.Expression, mpmath.mpf] = {
        ex.Symbol("x"): mpmath.mpf(x), ex.Symbol("y"): mpmath.mpf(y), ex.Symbol("k"): mpmath.mpf(3),
        ex.Velocity("x"): mpmath.mpf("0.7"), ex.Velocity("y"): mpmath.mpf("-1.1"),
    }  # fmt: skip
    return calculus.evaluate(reader.read_formula(text, NAMES), at)


@pytest.mark.parametrize(
    ("boundary", "below", "above", "joins"),
    [
        ("0", "x'^2/2 + x^2/2", "x'^2/2 - x^2/2", "x = 0"),
        ("0", "x'^2/2 + x", "x'^2/2 - x", ""),
        ("1", "x'^2/2 + x*(x - 2)/2", "x'^2/2 + x*(2 - x)/2", "x = 1"),
        ("0", "x'^2/2 + y'^2/2 + k*x^3*y", "x'^2/2 + y'^2/2 - x^2*sin(y)", "x = 0"),
        ("1/2", "x'^2/2 - x", "x'^2/2 - x", "x = 1/2"),
    ],
)
def test_the_formula_is_l_of_each_case_up_to_a_constant(
    boundary: str, below: str, above: str, joins: str
) -> None:
    found = joined.joined_of(
        [branch(f"x < {boundary}", below), branch(f"x > {boundary}", above)], NAMES
    )
    assert found is not None
    assert found.where == joins
    for text, places in ((below, ("-1.3", "-0.4")), (above, ("1.2", "2.9"))):
        gaps = [
            value(found.lagrangian, x, y) - value(text, x, y) for x in places for y in ("0.3", "2")
        ]
        assert max(gaps) - min(gaps) < 1e-12


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (branch("x > 0", "x'^2/2 - log(x)"), branch("x < 0", "x'^2/2 - log(-x)")),
        (branch("x > 0", "x'^2/2 - 1/(x + 1)"), branch("x < 0", "x'^2/2")),
        (branch("x > 0", "x'^2/2 - y"), branch("x < 0", "x'^2/2 + y")),  # they do not meet
        (branch("x' > 0", "exp(2*x)*x'^2/2"), branch("x' < 0", "exp(-2*x)*x'^2/2")),
        (branch("x > y", "x'^2/2"), branch("x < y", "x'^2/2 + x - y")),
        (branch("x > 0", "x'^2/2"), branch("x < 1", "x'^2/2")),
        (branch("x > 0", "x'^2/2"), {"domain": ["x < 0"], "lagrangian": None}),
    ],
)
def test_what_does_not_hold_on_both_sides_has_no_formula(
    first: dict[str, object], second: dict[str, object]
) -> None:
    assert joined.joined_of([first, second], NAMES) is None
    assert joined.joined_of([first], NAMES) is None


def test_the_checker_confirms_the_formula_of_a_bent_spring() -> None:
    names = nm.Names(("x",))
    both = [branch("x > 0", "x'^2/2 - x^2/2"), branch("x < 0", "x'^2/2 + x^2/2")]
    found = joined.joined_of(both, names)
    assert found is not None
    system = {"coordinates": ["x"], "equations": {"x": "-abs(x)"}}
    asked = json.dumps({"system": system, "lagrangian": found.lagrangian})
    assert check_document(asked)["verdict"] == "valid"
