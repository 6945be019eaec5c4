"""The table of elementary functions agrees with the functions that mpmath evaluates."""

from __future__ import annotations

from fractions import Fraction

import pytest
from mpmath import mp, mpf

from inverse_service.expressions.calculus import FUNCTION, RECIPROCALS, Function, evaluate
from inverse_service.expressions.tree import Apply, Symbol

U = Symbol("u")


@pytest.mark.parametrize("row", FUNCTION.values(), ids=list(FUNCTION))
def test_a_row_says_what_holds_of_its_function(row: Function) -> None:
    point = mpf(5) / 3 if row.name == "acosh" else mpf(3) / 7
    with mp.workdps(60):
        value = evaluate(Apply(row.name, U), {U: point})
        slope = mp.diff(lambda u: evaluate(Apply(row.name, U), {U: u}), point)
        assert abs(evaluate(row.derivative(U), {U: point}) - slope) < mpf(10) ** -25
        if row.parity:
            assert abs(evaluate(Apply(row.name, U), {U: -point}) - row.parity * value) < mpf(10) ** -50
        if row.reciprocal:
            assert abs(value * evaluate(Apply(row.reciprocal, U), {U: point}) - 1) < mpf(10) ** -50
        if row.undoes and row.name != "cosh":
            assert abs(evaluate(Apply(row.name, Apply(row.undoes, U)), {U: mpf(3) / 7}) - mpf(3) / 7) < mpf(10) ** -50
        if row.root:
            inner, a, b = row.root
            u = mpf(5) / 3 if inner == "acosh" else mpf(3) / 7
            assert abs(evaluate(Apply(row.name, Apply(inner, U)), {U: u}) - mp.sqrt(a + b * u**2)) < mpf(10) ** -50
    if row.holds is not None:
        assert row.holds(Fraction(3, 7)) or row.name == "acosh"
        assert not all(row.holds(Fraction(k)) for k in (-2, 0))
        assert row.wanted
    assert RECIPROCALS.get(row.name, "") == row.reciprocal
