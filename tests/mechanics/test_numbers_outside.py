"""No denominator stays in a bracket, as books write products."""

from __future__ import annotations

import pytest

from inverse_service.expressions import printing
from inverse_service.mechanics import writing
from inverse_service.reading import names as nm, reader


@pytest.mark.parametrize(
    ("given", "written"),
    [
        ("(x^2/2 + y^2/3)*z", "(3*x^2 + 2*y^2)*z/6"),
        ("(4*x/3 + 2*y/3)*z", "2*(2*x + y)*z/3"),
        ("(x/2 + y/3)^2*z", "(x/2 + y/3)^2*z"),  # (3 x + 2 y)^2/36 is no shorter
        ("(x/2 + y/2)^2*z", "(x + y)^2*z/4"),
        ("(-x - y)*z", "-(x + y)*z"),
    ],
)
def test_a_denominator_is_outside_of_its_bracket(given: str, written: str) -> None:
    names = nm.Names(("x", "y", "z"), (), {})
    found = writing.numbers_outside(reader.read_formula(given, names))
    assert printing.to_text(found) == printing.to_text(reader.read_formula(written, names))
