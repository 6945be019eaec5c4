"""Functions under roots that depend on each other are written in each other, as in tables of identities."""

from __future__ import annotations

import pytest

from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field
from inverse_service.reading import names as nm, reader

NAMES = nm.Names(("x", "y"), ("a",))
LETTERS = [*map(ex.Symbol, "xya")]
# Left and right side, and what the right side is not. Logarithms, exponentials, and angles by their
# addition theorems; multiple angles by de Moivre.
IDENTITIES = [
    ("log(6*x)", "log(x) + log(2) + log(3)", "log(x) + log(2) + log(5)"),
    ("log(12*x/5)", "log(x) + 2*log(2) + log(3) - log(5)", "log(x) + log(2) + log(3) - log(5)"),
    ("log(x*y)", "log(x) + log(y)", "log(x) - log(y)"),
    ("exp(x + y)", "exp(x)*exp(y)", "exp(x)*exp(2*y)"),
    ("exp(2*x + 1)", "exp(x)^2*exp(1)", "exp(x)^3*exp(1)"),
    ("exp(2*x - 3*y)", "exp(x)^2/exp(y)^3", "exp(x)^3/exp(y)^2"),
    ("exp(a*x + y)", "exp(y)*exp(a*x)", "exp(y)/exp(a*x)"),
    ("sin(2*x)", "2*sin(x)*cos(x)", "sin(x)*cos(x)"),
    ("cos(2*x)", "1 - 2*sin(x)^2", "1 - sin(x)^2"),
    ("cos(3*x)", "4*cos(x)^3 - 3*cos(x)", "4*cos(x)^3 - 2*cos(x)"),
    ("sin(3*x)", "3*sin(x) - 4*sin(x)^3", "3*sin(x) + 4*sin(x)^3"),
    ("sin(-2*x)", "-2*sin(x)*cos(x)", "2*sin(x)*cos(x)"),
    ("cos(x + y)", "cos(x)*cos(y) - sin(x)*sin(y)", "cos(x)*cos(y) + sin(x)*sin(y)"),
    ("sin(x - y)", "sin(x)*cos(y) - cos(x)*sin(y)", "cos(x)*sin(y) - sin(x)*cos(y)"),
    ("sin(2*x + y)", "sin(2*x)*cos(y) + cos(2*x)*sin(y)", "sin(x)*cos(y) + cos(x)*sin(y)"),
    ("sin(x + 1)", "sin(x)*cos(1) + cos(x)*sin(1)", "sin(x)*cos(1) - cos(x)*sin(1)"),
    ("tan(x)*cos(x)", "sin(x)", "cos(x)"),
]  # fmt: skip
# A root of a square of letters and numbers is their absolute value.
ROOTS = [
    ("sqrt(x^2 + 2*x*sqrt(2) + 2)", "abs(x + sqrt(2))", "abs(x - sqrt(2))"),
    ("sqrt(x^2*y^2)", "abs(x*y)", "abs(x + y)"),
    ("sqrt(log(6*x)^2)", "sqrt((log(x) + log(6))^2)", "sqrt((log(x) - log(6))^2)"),
]


def is_zero(text: str) -> bool:
    tree = reader.read_formula(text, NAMES)
    ring = exact_field.exact_ring([tree], LETTERS, 1, exact_field.Budget.long())
    return ring.value(tree).is_zero


@pytest.mark.parametrize(("left", "right", "other"), IDENTITIES)
@pytest.mark.parametrize("root", ["sqrt(7 + a*({}))", "(5 + ({})^3)^(1/3)"])
def test_an_identity_holds_under_a_root(left: str, right: str, other: str, root: str) -> None:
    assert is_zero(f"{root.format(left)} - {root.format(right)}")
    assert not is_zero(f"{root.format(left)} - {root.format(other)}")


@pytest.mark.parametrize(("left", "right", "other"), ROOTS)
def test_a_root_of_a_square_is_an_absolute_value(left: str, right: str, other: str) -> None:
    assert is_zero(f"{left} - {right}")
    assert not is_zero(f"{left} - {other}")


@pytest.mark.parametrize(
    "text", ["sqrt(2 + atan(1/x)) - sqrt(2 + pi/2 - atan(x))", "sqrt(x^2) - x", "sqrt(x*y) - sqrt(x)*sqrt(y)"]
)  # fmt: skip
def test_what_holds_on_one_side_only_is_no_identity(text: str) -> None:
    assert not is_zero(text)
