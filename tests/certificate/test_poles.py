"""A formula undefined at single points keeps a claim valid; a formula undefined on an open set does
not.
"""

from __future__ import annotations

import random
from typing import Any

import pytest

from inverse_service import solve
from inverse_service.certificate import judging
from inverse_service.service.documents.checking import check_plain
from tests.certificate.test_known_attacks import of_lagrangian, result_of


class Zeros(random.Random):
    """A generator whose every third number is 0."""

    count = 0

    def randrange(self, start: int, stop: int | None = None, step: int = 1) -> int:
        self.count += 1
        found = super().randrange(start, stop, step)
        return 0 if stop == 9999 and self.count % 3 == 0 else found


@pytest.fixture(autouse=True)
def many_zeros(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judging.random, "Random", Zeros)


@pytest.mark.slow
@pytest.mark.parametrize(
    "document",
    [
        {"equations": "x'' = x'^2/(2*x) + sin(x)"},  # L = x'^2/(2 x) + V has a pole at x = 0
        {"equations": "x'' = -sin(x)/m", "parameters": ["m"]},
        {"equations": "r'' = r*a'^2 - exp(r); a'' = -2*r'*a'/r"},
    ],
)
def test_a_pole_at_a_point_that_was_drawn_refutes_nothing(document: dict[str, Any]) -> None:
    found = solve(document).to_dict()
    assert found["verdict"] == "variational"
    assert check_plain(found)["verdict"] == "valid"


def test_a_lagrangian_without_a_value_on_half_of_the_line_is_still_refuted() -> None:
    certificate = of_lagrangian("0", "0", "x'^2/2 + y'^2/2 + sqrt(x) - sqrt(x)", near={"x": "1"})
    assert check_plain(result_of(certificate))["verdict"] != "valid"
