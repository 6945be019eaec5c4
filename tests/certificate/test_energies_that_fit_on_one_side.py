"""An H of roots and inverse functions that agrees with L on one side alone is refused."""

from __future__ import annotations

import pytest

from inverse_service.certificate import checker

# H by the cubic p = v + v^3/3 has asinh in it, so no identity of algebra settles it.
CERTIFICATE = {
    "format": "inverse-service/certificate/2",
    "system": {
        "coordinates": ["x"],
        "equations": {"x": "-sin(x)/(1 + x'^2)"},
        "parameters": [],
        "functions": {},
    },
    "question": "autonomous",
    "claim": "variational",
    "kind": "lagrangian",
    "near": {"x": "0.32062", "t": "0.89284", "x'": "0.51816"},
    "lagrangian": "x'^2/2 + x'^4/12 + cos(x)",
}
ENERGY = "p_x*sinh(asinh(3*p_x/2)/3) + 4*sinh(asinh(3*p_x/2)/3)^4/3 - cos(x)"
SHOWN = {"text": ENERGY, "momenta": {"p_x": "x' + x'^3/3"}, "implicit": False, "domain": []}


def test_the_energy_itself_is_confirmed() -> None:
    assert checker.judge_hamiltonian(CERTIFICATE, SHOWN, 20.0).verdict == "valid"


@pytest.mark.parametrize("far", ["sqrt((x + 40)^2) - x - 40", "sqrt((x - 700)^2) + x - 700"])
def test_a_term_that_is_zero_on_the_side_of_the_given_point_is_found(far: str) -> None:
    shown = {**SHOWN, "text": f"{ENERGY} + {far}"}
    assert checker.judge_hamiltonian(CERTIFICATE, shown, 20.0).verdict == "invalid"
