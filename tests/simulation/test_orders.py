"""Measured orders of convergence on nonlinear problems, above the round-off floor."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
import pytest

from benchmarks.hard_cases import contact_start, disk_start, particle_start
from benchmarks.problems import CONTACT, DISK, PARTICLE, PENDULUM, ROBOT
from inverse_service.integrators.method_table import RUNGE_KUTTA
from inverse_service.simulation.execution import run
from inverse_service.simulation.scene_data import Grid, MethodChoice, Problem, Start

ROBOT_START = Start((0.3, 0.5, 0.0, 0.0), (1.0, 0.3, 0.3 * math.cos(0.3), 0.3 * math.sin(0.3)))
PROBLEMS: dict[str, tuple[Problem, Start, dict[str, float]]] = {
    "disk": (DISK, disk_start(), {"c": 1.0}),
    "particle": (PARTICLE, particle_start(), {"c": 1.0}),
    "pendulum": (PENDULUM, Start((1.5,), (0.3,)), {"k": 1.0}),
    "robot": (ROBOT, ROBOT_START, {"k": 2.0}),
    "contact": (CONTACT, contact_start(), {"k": 0.3}),
}
# order: (span, steps of the coarsest run, allowed difference); long spans keep high orders above
# round-off.
COARSE = defaultdict(
    lambda: (4, 20, 0.1),
    {1: (4, 100, 0.1), 2: (4, 48, 0.1), 5: (4, 20, 0.15), 6: (4, 12, 0.1), 8: (40, 80, 0.5)},
)
IMPLICIT = [
    *(("variational", problem) for problem in ("disk", "particle", "pendulum")),
    *(("nonholonomic", problem) for problem in ("robot", "contact")),
    *(("modified", problem) for problem in ("disk", "particle")),
]


def measured_order(problem: str, choice: MethodChoice, order: int) -> float:
    """log2 of the ratio of the greatest errors at four times for h and h/2, the finest pair above
    round-off.
    """
    span, steps, _ = COARSE[order]
    what, start, values = PROBLEMS[problem]
    reference = run(
        what, MethodChoice("reference"), start, Grid(0.01, 100 * span, 25 * span), values
    )
    assert reference.outcome.completed
    errors: list[float] = []
    for count in (steps * 2**k for k in range(5)):
        found = run(what, choice, start, Grid(span / count, count, count // 4), values)
        assert found.outcome.completed, found.outcome
        error = float(np.abs(found.positions - reference.positions).max())
        if error < 2e-13:
            break
        errors.append(error)
    assert len(errors) > 1, "all at the round-off floor"
    return math.log2(errors[-2] / errors[-1])


@pytest.mark.slow
@pytest.mark.parametrize(("method", "problem"), IMPLICIT)
@pytest.mark.parametrize("order", [2, 4, 6, 8])
def test_one_half_and_its_compositions(method: str, problem: str, order: int) -> None:
    choice = MethodChoice(method, 0.5, order=order)
    assert measured_order(problem, choice, order) == pytest.approx(order, abs=COARSE[order][2])


@pytest.mark.slow
@pytest.mark.parametrize(("method", "problem"), IMPLICIT)
@pytest.mark.parametrize("alpha", [0.0, 0.3, 1.0])
def test_other_alphas_have_order_one(method: str, problem: str, alpha: float) -> None:
    assert measured_order(problem, MethodChoice(method, alpha), 1) == pytest.approx(1, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "problem"), [("nonholonomic", "robot"), ("nonholonomic", "contact")]
)
@pytest.mark.parametrize("alpha", [0.0, 0.3, 1.0])
def test_symmetrised_has_order_two(method: str, problem: str, alpha: float) -> None:
    choice = MethodChoice(method, alpha, symmetrised=True)
    assert measured_order(problem, choice, 2) == pytest.approx(2, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("form", ["hamiltonian", "raw"])
@pytest.mark.parametrize("alpha", [0.0, 0.3])
def test_symmetrised_variational_has_order_two(form: str, alpha: float) -> None:
    choice = MethodChoice("variational", alpha, symmetrised=True, form=form)
    assert measured_order("pendulum", choice, 2) == pytest.approx(2, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("problem", ["disk", "robot", "contact", "pendulum"])
@pytest.mark.parametrize("order", RUNGE_KUTTA)
def test_runge_kutta(problem: str, order: int) -> None:
    found = measured_order(problem, MethodChoice("runge_kutta", order=order), order)
    # On the pendulum's closed curve the leading term of DOP853 nearly cancels, so its measured
    # order is higher.
    assert order - COARSE[order][2] < found < order + (2 if order == 8 else COARSE[order][2])
