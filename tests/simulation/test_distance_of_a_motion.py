"""An L has a motion only if it has the acceleration of each of its coordinates."""

from __future__ import annotations

import numpy as np
import pytest

from inverse_service.expressions import tree as ex
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.simulation import accelerations

COORDINATES = ("x", "y", "z")
NAMES = Names(COORDINATES, (), {})
LAGRANGIAN = "(x'^2 + 2*y'^2 + 3*z'^2)/2 - x^2*y - z^2/2 + z*x'"
# x'' = -2 x y - z', 2 y'' = -x^2, 3 z'' = -z + x'.
MOTION = ("-2*x*y - z'", "-x^2/2", "(x' - z)/3")


@pytest.mark.parametrize("wrong", [None, 0, 1, 2])
def test_one_wrong_acceleration_is_as_wrong_as_all(wrong: int | None) -> None:
    given = [read_formula(text, NAMES) for text in MOTION]
    if wrong is not None:
        given[wrong] = given[wrong] + ex.HALF
    random = np.random.default_rng(3)
    leaves = [leaf(name) for name in COORDINATES for leaf in (ex.Symbol, ex.Velocity)]
    table = {leaf: random.normal(0, 1, 9) for leaf in leaves}
    found = accelerations.distance_of_motion(
        read_formula(LAGRANGIAN, NAMES), COORDINATES, tuple(given), table
    )
    assert found.shape == (9,)
    assert (found < 1e-12).all() if wrong is None else (found > 0.05).all()
