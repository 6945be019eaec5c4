"""The flow of H is the motion on the whole domain of H, for momenta of any sign."""

from __future__ import annotations

import random
from typing import Any

import pytest
import sympy

from inverse_service.decision.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_document

# (equation, the domain of its H)
ONE_SIGN = (
    ("x'' = sqrt(x')", ["p_x > 0"]),
    ("x'' = -x/sqrt(x')", ["p_x > 0"]),
    ("x'' = -x'^2", []),
    ("x'' = -x", []),
    ("x'' = -x'^3", None),
    ("x'' = -3*x'^(1/3)", None),
)


def answers(equation: str) -> list[dict[str, Any]]:
    result = solve_document({"equations": equation}, SolveOptions(time_limit=30))
    return [
        part
        for part in (result, *result["branches"])
        if part["hamiltonian"] and not part["hamiltonian"]["implicit"]
    ]


def read(text: str) -> Any:
    return sympy.sympify(
        text.replace("x'", "v").replace("^", "**"), locals={"v": sympy.Symbol("v", real=True)}
    )


@pytest.mark.slow
@pytest.mark.parametrize(("equation", "domain"), ONE_SIGN)
def test_the_flow_of_h_is_the_motion_all_over_its_domain(
    equation: str, domain: list[str] | None
) -> None:
    """Momenta of both signs are drawn independently of velocities."""
    x, p, v = (sympy.Symbol(name, real=True) for name in ("x", "p_x", "v"))
    found = answers(equation)
    assert found
    assert domain is None or all(part["hamiltonian"]["domain"] == domain for part in found)
    generator, seen = random.Random(7), 0
    for part in found:
        energy = read(part["hamiltonian"]["text"]).subs(
            {sympy.Symbol("x"): x, sympy.Symbol("p_x"): p}
        )
        conditions = [read(text).subs({sympy.Symbol("x"): x, sympy.Symbol("p_x"): p})
                      for text in part["hamiltonian"]["domain"]]  # fmt: skip
        force = read(equation.split("=")[1]).subs(sympy.Symbol("x"), x)
        rate = sympy.diff(energy, p)
        second = sympy.diff(rate, x) * rate - sympy.diff(rate, p) * sympy.diff(energy, x)
        for _ in range(40):
            place = {x: generator.uniform(-2, 2), p: generator.uniform(-2, 2)}
            moving = place | {v: rate.subs(place).evalf()}
            if not moving[v].is_real or not all(
                bool(condition.subs(moving)) for condition in conditions
            ):
                continue
            have, want = second.subs(place).evalf(), force.subs(moving).evalf()
            if have.is_real and want.is_real:
                seen += 1
                assert abs(have - want) < 1e-8 * (1 + abs(want)), (place, part["hamiltonian"])
    assert seen > 10


def test_each_branch_of_a_drag_has_momenta_of_its_sign() -> None:
    found = [part["hamiltonian"]["domain"] for part in answers("x'' = -abs(x')*x'")]
    assert {tuple(domain) for domain in found} == {("p_x > 0",), ("p_x < 0",)}


def test_a_momentum_is_the_slope_of_a_lagrangian_with_a_modulus() -> None:
    lagrangian = "m*x'^2/2 + a*abs(x')"
    momentum = solve_document({"lagrangian": lagrangian}, SolveOptions())["hamiltonian"]["momenta"][
        "p_x"
    ]
    v = sympy.Symbol("v", real=True)
    difference = read(momentum) - sympy.diff(read(lagrangian), v)
    for rate in (-0.7, 0.7):
        assert abs(difference.subs(v, rate).evalf(subs={"a": 1.3, "m": 0.9})) < 1e-12
