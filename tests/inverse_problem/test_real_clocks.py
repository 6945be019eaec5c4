"""A factor of time has real values where the motion is: sqrt(-x), not sqrt(x), where x < 0."""

from __future__ import annotations

from fractions import Fraction

import pytest
from mpmath import mpf

from inverse_service.expressions import calculus, printing, tree as ex
from inverse_service.mechanics.second_order_system import Branch, SecondOrderSystem, system_of
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.solving import clock

NAMES = Names(("x", "y"), (), {})


def system(side: str) -> SecondOrderSystem:
    """x'' = sqrt(side) y' + x'^2, y'' = x."""
    forces = [read_formula(text, NAMES) for text in (f"sqrt({side})*y' + x'^2", "x")]
    return system_of(("x", "y"), forces, (), ())


@pytest.mark.parametrize(
    ("side", "given", "real"),
    [
        ("x", "x", "sqrt(x)"),
        ("-x", "x", "sqrt(-x)"),
        ("x - 1", "1 - x", "sqrt(x - 1)"),
        ("1 - x", "1 - x", "sqrt(1 - x)"),
    ],
)
def test_the_root_of_a_factor_is_that_of_what_is_positive(side: str, given: str, real: str) -> None:
    factor = read_formula(given, NAMES) ** Fraction(1, 2)
    found = clock.with_real_clock(system(side), factor)
    assert found.system is not None
    assert printing.to_text(found.factor) == real


@pytest.mark.parametrize("factor", ["x^2 + 1", "exp(y)", "2", "1/(x^2 + 1)"])
def test_with_another_clock_the_accelerations_are_those_of_the_chain_rule(factor: str) -> None:
    """q' = N dq/dtau, so that q'' = N^2 d^2q/dtau^2 + N (dN/dq dq/dtau) dq/dtau."""
    given = system_of(
        ("x", "y"), [read_formula(text, NAMES) for text in ("-x*y'^2 + y", "x'*y' - y^3")], (), ()
    )
    n = read_formula(factor, NAMES)
    changed = clock.with_clock(given, n)
    assert changed is not None
    point: dict[ex.Expression, mpf] = {
        ex.Symbol("x"): mpf("0.37"), ex.Symbol("y"): mpf("1.83"),
        ex.Velocity("x"): mpf("-0.71"), ex.Velocity("y"): mpf("0.59"),
    }  # fmt: skip
    size = calculus.evaluate(n, point)
    rate = sum(
        calculus.evaluate(calculus.differentiate(n, ex.Symbol(name)), point)
        * point[ex.Velocity(name)]
        for name in ("x", "y")
    )
    fast = {
        leaf: number * (size if isinstance(leaf, ex.Velocity) else 1)
        for leaf, number in point.items()
    }
    for name, old, new in zip(("x", "y"), given.accelerations, changed.accelerations, strict=True):
        found = calculus.evaluate(new, point)
        again = size**2 * found + size * rate * point[ex.Velocity(name)]
        wanted = calculus.evaluate(old, fast)
        assert abs(again - wanted) < 1e-12 * abs(wanted)


def test_a_branch_of_a_clock_says_where_it_is_real() -> None:
    found = clock.with_clock(system("x"), read_formula("sqrt(y)", NAMES))
    assert found is not None
    assert isinstance(found.branch, Branch)
    said = {printing.to_text(one) for one in found.branch.positive}
    assert "y" in said
