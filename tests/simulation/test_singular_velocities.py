"""Lagrangians whose d2L/dv2 vanishes at some velocity, without a change of sign: there the
acceleration has no bound, and no method goes on, whatever form its equations have.
"""

import pytest

from inverse_service.service.scenes.simulating import simulate


@pytest.mark.parametrize(
    ("lagrangian", "velocities"),
    [
        ("x'^4/4 - x^2/2", {"x": 0.5}),
        ("x'^4/4 + y'^2/2 - x^2/2 - y^2/2", {"x": 0.5, "y": 0}),
    ],
)
def test_a_variational_method_ends_where_the_accelerations_do(
    lagrangian: str, velocities: dict[str, float]
) -> None:
    scene = {
        "system": {"coordinates": [*velocities], "lagrangian": lagrangian},
        "initial": {"positions": dict.fromkeys(velocities, 1), "velocities": velocities},
        "methods": ["variational", "adaptive"],
        "step": 0.02,
        "steps": 250,
    }
    variational, adaptive = simulate(scene)["methods"]
    assert adaptive["outcome"] == "singular"
    assert variational["outcome"] in ("singular", "no_convergence")
    assert variational["final"]["t"] == pytest.approx(adaptive["final"]["t"], abs=0.04)


@pytest.mark.parametrize(
    "lagrangian", ["x'^2/2 + x'^4/4 - x^2/2", "-sqrt(4 - x'^2) - x^2/2", "exp(x') - x^2/2"]
)
def test_one_that_is_regular_at_every_velocity_goes_on(lagrangian: str) -> None:
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": lagrangian},
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "methods": ["variational"],
        "step": 0.02,
        "steps": 250,
    }
    assert simulate(scene)["methods"][0]["outcome"] == "completed"
