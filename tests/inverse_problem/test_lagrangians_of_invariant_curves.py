"""A Lagrangian that is proposed from an invariant curve has the given equation, in numbers:
L_vt + v L_vx + f L_vv = L_x where L_vv is not 0.
"""

from __future__ import annotations

import pytest
from mpmath import mp, mpf

from inverse_service.decision import deciding
from inverse_service.expressions import calculus, tree as ex
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.search import invariant_curves, material as mt
from inverse_service.statements.questions import TIMED

X, V = ex.Symbol("x"), ex.Velocity("x")
FORCES = [
    "-3*x*x' - x^3", "3*x*x' - x^3", "-x*x' - x^3/9", "x*x' + x", "-x*x' - 2*x", "x' + (x' - x)^3",
    "2*x' + (x' - 2*x)^3", "-x' + (x' + x)^4", "x*x' + 2*x",
]  # fmt: skip


@pytest.mark.parametrize("force", FORCES)
def test_what_a_curve_gives_has_the_equation(force: str) -> None:
    system = read_system(["x"], {"x": force})
    material = mt.gather_material(deciding.analyze(system), TIMED)
    assert invariant_curves.applies(material)
    found = invariant_curves.propose(material, 1)
    assert found
    slope = calculus.differentiate(found[0], V)
    parts = [
        calculus.differentiate(slope, ex.TIME),
        V * calculus.differentiate(slope, X),
        system.accelerations[0] * calculus.differentiate(slope, V),
        ex.negate(calculus.differentiate(found[0], X)),
    ]
    with mp.workdps(30):
        for x, v in (("0.37", "2.9"), ("0.52", "3.7")):
            point = {X: mpf(x), V: mpf(v), ex.TIME: mpf("0.4")}
            values = [calculus.evaluate(part, point) for part in parts]
            assert abs(sum(values)) < mpf(10) ** -20 * (1 + max(map(abs, values)))
            assert calculus.evaluate(calculus.differentiate(slope, V), point) != 0
