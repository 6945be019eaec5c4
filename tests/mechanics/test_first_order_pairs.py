"""First-order pairs are joined to x'' = f without constants above and below a fraction line, and
with every pole.
"""

from __future__ import annotations

import pytest
from mpmath import mpf

from inverse_service.expressions import calculus, printing, tree as ex
from inverse_service.mechanics.second_order_system import read_system


@pytest.mark.parametrize(
    ("equations", "name", "acceleration"),
    [
        ("x' = p/m; p' = -m*w^2*x", "x", "-w^2*x"),
        ("x' = p/m; p' = -k*x - c*p/m", "x", "(-k*x - c*x')/m"),
        ("theta' = p/(m*l^2); p' = -m*g*l*sin(theta)", "theta", "-g*sin(theta)/l"),
        ("x' = v/m; v' = -m*g*sin(x) + c*(v/m)^2", "x", "-g*sin(x) + c*x'^2/m"),
        ("x' = y/(a*x); y' = a*x^2", "x", "-x'^2/x + x^2/x"),  # undefined at x = 0, as it was
        ("y' = v; v' = (1 - y^2)*v - y", "y", "(1 - y^2)*y' - y"),
    ],
)
def test_pairs_are_joined_in_the_words_of_their_writer(
    equations: str, name: str, acceleration: str
) -> None:
    system = read_system(None, equations, "guess")
    assert system.coordinates == (name,)
    assert printing.to_text(system.accelerations[0]) == acceleration


def test_the_joined_equation_has_the_values_of_the_pair() -> None:
    """x' = x p, p' = x - p^2/2 gives x'' = x' p + x p' at x = 2, p = 3."""
    system = read_system(None, "x' = x*p; p' = -p^2/2 + x", "guess")
    x, p = mpf(2), mpf(3)
    point: dict[ex.Expression, mpf] = {ex.Symbol("x"): x, ex.Velocity("x"): x * p}
    assert (
        abs(calculus.evaluate(system.accelerations[0], point) - (x * p * p + x * (x - p**2 / 2)))
        < mpf(10) ** -12
    )
