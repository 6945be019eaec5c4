"""The good long-time behavior of the nonholonomic method depends on reversibility: measured on two
oscillators.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from benchmarks.hard_cases import contact_start
from benchmarks.problems import CONTACT, CONTACT_ENERGY, CONTACT_REVERSIBLE
from inverse_service.expressions import arrays
from inverse_service.integrators.trajectory import Array
from inverse_service.simulation.execution import run
from inverse_service.simulation.numeric_formulas import arrays_by_name
from inverse_service.simulation.scene_data import Grid, MethodChoice, Problem

K = {"k": 0.3}
# The reflections of space that keep x' + y z' = 0.
REFLECTIONS = [
    signs for signs in itertools.product((1, -1), repeat=3) if signs[0] == signs[1] * signs[2]
]


def reversors(problem: Problem) -> list[tuple[int, int, int]]:
    """The reflections S for which (q, v) -> (S q, -S v) reverses time: a(S q, -S v) = S a(q, v)."""
    assert problem.accelerations is not None
    random = np.random.default_rng(3)
    q, v = random.normal(size=(2, 20, 3))
    v[:, 0] = -q[:, 1] * v[:, 2]

    def accelerations(positions: Array, velocities: Array) -> Array:
        table = arrays_by_name(problem.coordinates, positions, velocities, K)
        return np.stack(
            [arrays.array_value(tree, table) for tree in problem.accelerations or ()], axis=1
        )

    return [
        s for s in REFLECTIONS if np.allclose(accelerations(q * s, -v * s), accelerations(q, v) * s)
    ]


def drift(problem: Problem, method: MethodChoice, step: float, length: float) -> float:
    """The slope of E/E_0 times the length of the run, by least squares over the whole run."""
    count = round(length / step)
    observation = (CONTACT_ENERGY,)
    found = run(problem, method, contact_start(), Grid(step, count, count // 500), K, observation)
    assert found.outcome.completed
    energy = found.series["energy"][1:]
    return float(np.polyfit(np.linspace(0, 1, len(energy)), energy / energy[0], 1)[0])


def test_velocities_turned_round_are_a_reversor_of_one_and_no_reflection_is_of_the_other() -> None:
    assert len(REFLECTIONS) == 4
    assert reversors(CONTACT_REVERSIBLE) == [(1, 1, 1), (1, -1, -1)]
    assert reversors(CONTACT) == []


@pytest.mark.slow
@pytest.mark.parametrize("problem", [CONTACT, CONTACT_REVERSIBLE])
def test_the_true_motion_keeps_the_energy(problem: Problem) -> None:
    assert abs(drift(problem, MethodChoice("reference"), 0.1, 1000)) < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.1, 0.05])
def test_the_energy_drifts_only_where_the_motion_is_not_reversible(step: float) -> None:
    method = MethodChoice("nonholonomic", 0.5)
    assert abs(drift(CONTACT_REVERSIBLE, method, step, 5000)) < 2e-5
    assert drift(CONTACT, method, step, 5000) > 2e-3


def test_the_drift_grows_with_time_and_with_the_square_of_the_step() -> None:
    method = MethodChoice("nonholonomic", 0.5)
    short, long = (drift(CONTACT, method, 0.1, length) for length in (2500, 5000))
    assert long / short == pytest.approx(2, rel=0.05)
    assert long / drift(CONTACT, method, 0.05, 5000) == pytest.approx(4, rel=0.05)
    assert abs(drift(CONTACT, MethodChoice("nonholonomic", 0.5, order=4), 0.1, 5000)) < 1e-2 * long
