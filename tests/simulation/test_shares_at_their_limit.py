"""What sticks is let go where it is pulled over a limit of friction, on either side."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from inverse_service.expressions import collecting, tree as ex
from inverse_service.reading import names as nm, reader
from inverse_service.simulation import switching


@pytest.mark.parametrize("limit", [1.0, -1.0])
@pytest.mark.parametrize(("grows", "holds"), [(3.0, False), (-3.0, True), (0.0, True)])
def test_a_share_at_its_limit_that_grows_does_not_hold(
    limit: float, grows: float, holds: bool
) -> None:
    u = ex.Velocity("x")
    answers = iter((np.array([limit]), np.array([limit * grows])))
    motion = SimpleNamespace(
        stuck=lambda _: [u], at=lambda *_: next(answers), rate=lambda tree: tree,
        scene=SimpleNamespace(grid=SimpleNamespace(step=0.1)),
        _is_determined=lambda *_: True, goes=lambda *_: True,
    )  # fmt: skip
    sides = {u: switching.STICKS}
    assert switching.Motion._goes_on(motion, sides, [u], ([0.0], [0.0], 0.0)) is holds  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "text",
    [
        "-sign(x')*(2 + sign(y'))",
        "x*sign(x') + y*sign(y') - x*y",
        "sign(x')*sign(y')*(3 + sign(x') + 5*sign(y'))",
        "sqrt(2 + sign(x') + sign(y')/2)",
    ],
)
def test_forces_of_what_sticks_are_means_and_half_differences_over_all_sides(text: str) -> None:
    """Of each function over its two sides, and over those of the other."""
    tree = reader.read_formula(text, nm.Names(("x", "y")))
    u, w = ex.Velocity("x"), ex.Velocity("y")
    (middle,), slopes = switching._corners([tree], {u: switching.STICKS, w: switching.STICKS})
    corners = {
        signs: switching.on_sides(tree, dict(zip((u, w), signs, strict=True)))
        for signs in product((1, -1), repeat=2)
    }
    assert len({*corners.values()}) > 1
    quarter = ex.HALF * ex.HALF
    wanted = [
        ex.add(*(quarter * one for one in corners.values())),
        *(ex.add(*(signs[k] * quarter * one for signs, one in corners.items())) for k in (0, 1)),
    ]
    for found, other in zip((middle, *slopes[u], *slopes[w]), wanted, strict=True):
        assert collecting.collect(found - other) == ex.ZERO
