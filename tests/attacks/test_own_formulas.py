"""A user's Lagrangian with a term that is zero everywhere, or only on a part of the line."""

from __future__ import annotations

import json
import random
import re
from contextlib import suppress

import mpmath
import pytest

from inverse_service.service.documents.checking import check_document
from tests.doors import rows
from tests.doors.formulas import Point
from tests.doors.judge import DIGITS


def numbers(formula: str) -> list[tuple[Point, float]]:
    """Values of the formula at points of the line where it is defined, away from borders."""
    draw, found = random.Random(3), []
    for _ in range(200):
        point = Point({"x": draw.choice((1, 4, 12)) * draw.uniform(-1, 1)})
        with suppress(ValueError, ArithmeticError), mpmath.workdps(DIGITS):
            found.append((point, abs(float(point.jet(formula).value))))
    return found


@pytest.mark.nightly
@pytest.mark.parametrize("u", ["x", "2*x", "x-1/2"])
@pytest.mark.parametrize("row", rows.rows("own"), ids=lambda row: row["id"])
def test_it_is_valid_where_the_term_is_zero_and_nowhere_else(row: rows.Row, u: str) -> None:
    term = re.sub(r"\bu\b", f"({u})", row["term"])
    document = {
        "system": {"equations": {"x": "-x"}},
        "lagrangian": f"x'^2/2 - x^2/2 + x^3*({term})",
    }
    found, values = check_document(json.dumps(document)), numbers(term)
    assert values
    print(f"{term}: {found['verdict']}")
    if row["zero"] == "everywhere":
        assert found["verdict"] in ("valid", "incomplete")
    else:
        assert found["verdict"] != "valid" or all(value < 1e-9 for _, value in values)
    for cell in found["cells"]:
        inside = [value for point, value in values if all(map(point.holds, cell["domain"]))]
        assert cell["verdict"] != "valid" or all(value < 1e-9 for value in inside), cell
