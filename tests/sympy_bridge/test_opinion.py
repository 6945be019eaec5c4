"""What SymPy thinks of a Lagrangian: right, wrong as soon as one part is, and else unsure."""

from __future__ import annotations

from itertools import permutations
from typing import Any

import pytest
import sympy

from inverse_service.sympy.shown import Verification, aligned, is_zero

X = sympy.Symbol("x", real=True)


class Unsure:
    """An expression of which SymPy cannot say whether it is zero."""

    def equals(self, _: int) -> None:
        return None


ZERO, WRONG, UNSURE = sympy.sin(X) ** 2 + sympy.cos(X) ** 2 - 1, X - 1, Unsure()


@pytest.mark.parametrize(
    ("parts", "holds"),
    [
        ((ZERO, ZERO, sympy.S.Zero), True),
        ((ZERO, ZERO, WRONG), False),
        ((ZERO, UNSURE, WRONG), False),
        ((ZERO, ZERO, UNSURE), None),
        ((UNSURE, UNSURE, ZERO), None),
    ],
)
def test_one_wrong_part_is_wrong_and_one_unsure_part_is_unsure(
    parts: tuple[Any, ...], holds: bool | None
) -> None:
    for *equations, energy in permutations(parts):
        assert Verification(tuple(equations), energy).holds is holds
    assert Verification(parts).holds is holds


def test_a_part_is_zero_or_not_or_unknown() -> None:
    assert [is_zero(each) for each in (0, ZERO, WRONG, UNSURE)] == [True, True, False, None]


def test_aligned_rows_have_one_sign_each() -> None:
    rows = aligned([("E_{1}", sympy.Eq(X, 1)), ("E_{2}", X)]).split(r"\\")
    assert [row.count("&") for row in rows] == [1, 1]
