"""A Lagrangian of one's own with a term that is zero: everywhere, or on a part of the line only."""

from __future__ import annotations

import json
import random

import pytest

from inverse_service.service.documents.checking import check_document
from tests.doors.formulas import Point

# Zero wherever they are defined, and zero on a part of where they are.
TRUE = (
    "asin(u)+acos(u)-pi/2", "sin(asin(u))-u", "cos(acos(u))-u", "tan(atan(u))-u", "cos(asin(u))-sqrt(1-u^2)",
    "sin(acos(u))-sqrt(1-u^2)", "sqrt(u)^2-u", "exp(log(u))-u", "log(exp(u))-u", "abs(u)^2-u^2", "sqrt(u^2)-abs(u)",
    "sin(atan(u))-u/sqrt(1+u^2)", "asinh(u)-log(u+sqrt(u^2+1))", "sinh(asinh(u))-u", "cosh(acosh(u))-u",
    "atanh(u)-log((1+u)/(1-u))/2", "asin(u)+asin(-u)", "atan(-u)+atan(u)", "abs(-u)-abs(u)", "sqrt(u^4)-u^2",
)  # fmt: skip
FALSE = (
    "atan(u)+atan(1/u)-pi/2", "sqrt(u^2)-u", "abs(u)-u", "asin(sin(u))-u", "acos(cos(u))-u", "atan(tan(u))-u",
    "acos(1-2*u^2)-2*asin(u)", "atan(2*u/(1-u^2))-2*atan(u)", "asin(2*u*sqrt(1-u^2))-2*asin(u)", "acos(-u)-acos(u)",
    "sqrt(u^2-2*u+1)-u+1", "acos(1/sqrt(1+u^2))-atan(u)", "sign(u)-1", "abs(u^2-1)-u^2+1", "sqrt((u^2-4)^2)-u^2+4",
    "sqrt(1-sin(u)^2)-cos(u)", "atan(sin(u)/(1+cos(u)))-u/2", "acos(sin(u))-pi/2+u", "abs(u-3)-u+3",
    "abs(u)*u-u^2",
)  # fmt: skip
ARGUMENTS = ("x", "2*x", "x-1/2")


def numbers(formula: str) -> list[tuple[Point, float]]:
    """The formula at points of the line where it is defined, none of them next to a border."""
    draw, found = random.Random(3), []
    for _ in range(200):
        point = Point({"x": draw.choice((1, 4, 12)) * draw.uniform(-1, 1)})
        try:
            found.append((point, abs(float(point.jet(formula).value))))
        except (ValueError, ArithmeticError):
            continue
    return found


@pytest.mark.nightly
@pytest.mark.parametrize("u", ARGUMENTS)
@pytest.mark.parametrize("formula", [*TRUE, *FALSE])
def test_it_is_valid_where_the_term_is_zero_and_nowhere_else(formula: str, u: str) -> None:
    term = formula.replace("u", f"({u})")
    document = {"system": {"equations": {"x": "-x"}}, "lagrangian": f"x'^2/2 - x^2/2 + x^3*({term})"}
    found, values = check_document(json.dumps(document)), numbers(term)
    assert values
    print(f"{term}: {found['verdict']}")
    if formula in TRUE:
        assert found["verdict"] in ("valid", "incomplete")
    else:
        assert found["verdict"] != "valid" or all(value < 1e-9 for _, value in values)
    for cell in found["cells"]:
        inside = [value for point, value in values if all(map(point.holds, cell["domain"]))]
        assert cell["verdict"] != "valid" or all(value < 1e-9 for value in inside), cell
