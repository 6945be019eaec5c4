"""The Lagrangian of a system of two equations has them, in numbers: the Euler-Lagrange expressions
along the accelerations are 0, and the Hessian is regular. Integrals with one name are one function.
"""

from __future__ import annotations

from itertools import product

import pytest
from mpmath import mp, mpf

from inverse_service.decision import deciding
from inverse_service.expressions import calculus, tree as ex
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.search import ladder
from inverse_service.statements.questions import PLAIN

# Phipps 1990: two charges on a line with masses 2 and 3, L = x'^2 + 3 y'^2/2 - sqrt(1 - (x' - y')^2)/(x - y).
RATE = "(1 - (x' - y')^2)"
BELOW = f"((x - y)*(6*(x - y)*{RATE}^(3/2) + 5))"
FORCES = [
    (f"3*{RATE}/{BELOW}", f"-2*{RATE}/{BELOW}"),
    ("sin(x)*x'^4", "y*y'^4"),
    ("-sin(40*x)*y - sin(x)", "cos(40*x)/40"),
    ("-2*x*y", "-x^2 + y'^2*0"),
    ("-x*x'^2/(1 + x^2)", "-y'^2"),
    ("-2*y'", "2*x' - y"),
    ("x*y'^2 - 1/x^2", "-2*x'*y'/x"),
    ("exp(y)", "exp(y)*x"),
]
POINT = {
    ex.Symbol("x"): mpf("0.37"),
    ex.Symbol("y"): mpf("0.83"),
    ex.Velocity("x"): mpf("0.71"),
    ex.Velocity("y"): mpf("0.59"),
    ex.TIME: mpf("0.4"),
}


def found_for(system: SecondOrderSystem) -> ex.Expression:
    outcome = ladder.search(deciding.analyze(system), PLAIN, 1, lambda _: None)
    assert outcome.found is not None
    return outcome.found.lagrangians[0]


@pytest.mark.parametrize("forces", FORCES, ids=" ".join)
def test_what_is_found_has_the_equations(forces: tuple[str, str]) -> None:
    system = read_system(["x", "y"], dict(zip("xy", forces, strict=True)))
    tree = found_for(system)
    names = system.coordinates
    momenta = [calculus.differentiate(tree, ex.Velocity(name)) for name in names]
    table = dict(zip(map(ex.Acceleration, names), system.accelerations, strict=True))
    with mp.workdps(30):
        for name, momentum in zip(names, momenta, strict=True):
            rate = ex.substitute(calculus.differentiate_in_time(momentum, names), table)
            force = calculus.evaluate(calculus.differentiate(tree, ex.Symbol(name)), POINT)
            change = calculus.evaluate(rate, POINT)
            assert abs(change - force) < mpf(10) ** -20 * (1 + abs(force))
        entries = [
            calculus.evaluate(calculus.differentiate(p, ex.Velocity(name)), POINT)
            for p, name in product(momenta, names)
        ]
        assert entries[0] * entries[3] != entries[1] * entries[2]


def test_the_integrals_of_two_blocks_have_two_names() -> None:
    forces = {"x": "exp(sin(x))*x'^2", "y": "exp(sin(y))*y'^2"}
    tree = found_for(read_system(["x", "y"], forces))
    integrals = {node for node in ex.walk(tree) if isinstance(node, ex.Integral)}
    assert len({node.name for node in integrals}) == len(integrals) == 2
