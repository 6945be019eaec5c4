"""L is written with a positive kinetic energy where there is one, however the equations are
given.
"""

from __future__ import annotations

import pytest
import sympy
from sympy.core.function import AppliedUndef

from inverse_service.sympy import solve

# Natural systems, T - V with a positive T, some multiplied by negative functions.
UPRIGHT = [
    "-2*x'' = 3*x",
    "-x'' - x^3 = 0",
    "-3*x'' = x; -2*y'' = y",
    "-(x'' + x*y^2) = 0; -(y'' + x^2*y) = 0",
    "-exp(t)*(x'' + x' + x) = 0",
    "-x''*(1 + x^2) = x*x'^2",
    "x'' = 1/((x - 1)*(x - 2))",
    "x'' = -2*x + y; y'' = x - 2*y",
    "-x'' + y' = 0; -y'' - x' = 0",
]


@pytest.mark.parametrize("equations", UPRIGHT)
def test_the_kinetic_energy_is_positive(equations: str) -> None:
    """All leading minors of the Hessian of L in the velocities are positive (Sylvester)."""
    hessian = sympy.Matrix(solve(equations, first_integrals=False).answers[0].multiplier)
    place = {
        part: sympy.Rational(3, 7) for part in (*hessian.atoms(AppliedUndef), *hessian.free_symbols)
    }
    minors = [hessian[:n, :n].subs(place).det() for n in range(1, hessian.rows + 1)]
    assert all(minor > 0 for minor in minors), hessian


def test_weber_s_kinetic_energy_is_positive_at_large_distances() -> None:
    """k r'^2/(2 r) beside c^2 (r'^2 + r^2 a'^2)/2: W. Weber, Elektrodynamische Massbestimmungen."""
    equations = "r'' = (2*k*c^2 + 2*c^2*r^3*a'^2 - k*r'^2)/(2*r*(c^2*r - k)); a'' = -2*a'*r'/r"
    hessian = sympy.Matrix(solve(equations, first_integrals=False).answers[0].multiplier)
    k, c = sympy.symbols("k c")
    far = {part: sympy.Integer(1000) for part in hessian.atoms(AppliedUndef)}
    minors = [hessian[:n, :n].subs(far).subs({k: 1, c: 1}).det() for n in (1, 2)]
    assert all(minor > 0 for minor in minors), hessian
