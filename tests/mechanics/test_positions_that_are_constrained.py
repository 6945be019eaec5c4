"""A constraint on positions that is no sum of squares, and no coordinate of which is alone."""

from __future__ import annotations

import pytest

import inverse_service


@pytest.mark.parametrize("constraint", ["x^4+y^2=1", "sin(x)^2+y^4=2", "(x*y)^2+(x+y)^4=1"])
def test_a_constraint_on_positions_is_refused_in_one_sentence(constraint: str) -> None:
    document = {"lagrangian": "(x'^2+y'^2)/2", "constraints": [constraint]}
    with pytest.raises(inverse_service.InputError, match=r"eliminate a coordinate"):
        inverse_service.solve(document)
