"""What sticks is let go where it is pulled over a limit of friction, on either side."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from inverse_service.expressions import tree as ex
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
