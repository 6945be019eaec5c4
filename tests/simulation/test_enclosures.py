"""Bounds of formulas hold all their values, and shrink with the bounds of their names."""

from __future__ import annotations

import numpy as np
import pytest

from inverse_service.expressions import arrays, functions, tree as ex
from inverse_service.reading import names, reader
from inverse_service.simulation import enclosures

FORMULAS = [
    "x^2 - y^3", "x*y - x/(1 + y^2)", "(x - y)^-3", "(x*y)^-2", "sqrt(x^2 + y^2)", "sqrt(abs(x))", "exp(x*y)",
    "log(1 + x^2)", "sin(5*x)*cos(3*y)", "tan(x/4)", "x^(4/3) + 1", "(4 + x)^(-1/2)",
    "(1 + y^2)^x", "(1 + x^2 + y^2)^(-3/2)", "sign(x - y)", "max(x, y)",
    *(f"{name}(x/{7 if name in ('asin', 'acos', 'atanh') else 2})" for name in functions.FUNCTION
      if name not in (functions.STEP, "acosh", *functions.SPECIAL)), "acosh(4 + x)",
]  # fmt: skip


@pytest.mark.parametrize("text", FORMULAS)
def test_no_value_is_outside_of_the_bounds(text: str) -> None:
    tree = reader.read_formula(text, names.Names(("x", "y")))
    random = np.random.default_rng(1)
    x, y = ex.Symbol("x"), ex.Symbol("y")
    for width in (4.0, 0.3, 0.01):
        centers = random.uniform(-2, 2, (2, 300))
        low, high = (
            centers - width * random.uniform(0, 0.5, (2, 300)),
            centers + width * random.uniform(0, 0.5, (2, 300)),
        )
        least, most = enclosures.bounds_of(tree, {x: (low[0], high[0]), y: (low[1], high[1])})
        for _ in range(20):
            point = random.uniform(low, high)
            values = arrays.array_value(tree, {x: point[0], y: point[1]})
            known = np.isfinite(values)
            room = 1e-12 * (1 + np.abs(values))
            assert (least <= values + room)[known].all()
            assert (values - room <= most)[known].all()
    finite = np.broadcast_to(np.isfinite(least) & np.isfinite(most), 300)
    assert finite.mean() > 0.4
    assert np.median((np.broadcast_to(most, 300) - np.where(finite, least, 0))[finite]) < 1
    at, _ = enclosures.bounds_of(tree, {x: (low[0], low[0]), y: (low[1], low[1])})
    value = arrays.array_value(tree, {x: low[0], y: low[1]})
    known = np.isfinite(value)
    assert np.broadcast_to(at, 300)[known] == pytest.approx(value[known], rel=1e-9)
