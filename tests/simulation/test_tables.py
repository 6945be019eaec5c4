"""The numbers for the disk with L~2 at h = 0.2 over T = 100, and exact radius ratios."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.hard_cases import particle_start
from benchmarks.problems import DISK, DISK_CONSTRAINTS, DISK_ENERGY, KNIFE, PARTICLE
from inverse_service.simulation.circles import circle_drift
from inverse_service.simulation.execution import run
from inverse_service.simulation.scene_data import Grid, MethodChoice, Start

# method, alpha, radial distance / R, R_last / R_first - 1, energy, discrete constraint; None for
# round-off.
TABLE = [
    ("variational", 0.0, 1.8e-1, -9e-5, 4.2e-2, 1.2e-2),
    ("variational", 0.5, 3.4e-3, 3e-7, 1.8e-3, 5e-4),
    ("variational", 1.0, 9.8e-2, 6e-4, 3.6e-2, 1e-2),
    ("nonholonomic", 0.0, 0.97, -0.998, 0.60, None),
    ("nonholonomic", 0.5, 3.3e-3, None, None, None),
    ("nonholonomic", 1.0, 797.0, 530.0, 3.8e5, None),
]
START = Start(
    (0.3, 0.0, 0.0, 0.0),
    (1.0, 0.5, 0.5 * math.cos(0.3), 0.5 * math.sin(0.3)),
    convention="discrete_constraint",
)
OBSERVED = (DISK_ENERGY, *DISK_CONSTRAINTS)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "alpha", "radial", "growth", "energy", "constraint"), TABLE)
def test_disk_table(
    method: str,
    alpha: float,
    radial: float,
    growth: float | None,
    energy: float | None,
    constraint: float | None,
) -> None:
    found = run(DISK, MethodChoice(method, alpha), START, Grid(0.2, 500), {"c": 1.0}, OBSERVED)
    assert found.outcome.completed
    path = found.positions[:, 2:]
    distances = np.linalg.norm(path - np.array([-0.5 * math.sin(0.3), 0.5 * math.cos(0.3)]), axis=1)
    assert np.abs(distances / 0.5 - 1).max() == pytest.approx(radial, rel=0.05)
    circles = circle_drift(path)
    assert circles is not None
    ratio = circles.last.radius / circles.first.radius - 1
    assert ratio == pytest.approx(growth, rel=0.05) if growth else abs(ratio) < 1.5e-12
    drift = np.abs(found.series["energy"] / found.series["energy"][0] - 1).max()
    assert drift == pytest.approx(energy, rel=0.05) if energy else drift < 2e-12
    worst = max(found.maxima["constraint 0"], found.maxima["constraint 1"])
    # Round-off; the coordinates of the outward spiral grow to 800 R.
    assert (
        worst == pytest.approx(constraint, rel=0.05)
        if constraint
        else worst < (1e-13 if alpha == 1 else 1e-14)
    )


@pytest.mark.parametrize(
    ("alpha", "ratio"),
    [(0.0, 0.996669443519), (1 / 3, 0.998888991766), (0.5, 1.0), (1.0, 1.003341686156)],
)
def test_disk_radius_ratio_is_exact(alpha: float, ratio: float) -> None:
    """Chord lengths shrink or grow by (1/2 + cos((1 - alpha) D))/(1/2 + cos(alpha D)) each step, D
    = h phi'.
    """
    found = run(DISK, MethodChoice("nonholonomic", alpha), START, Grid(0.1, 40), {"c": 1.0})
    rolled = np.diff(found.positions[:, 1])
    expected = (0.5 + math.cos((1 - alpha) * 0.1)) / (0.5 + math.cos(alpha * 0.1))
    assert np.abs(rolled[1:] / rolled[:-1] - expected).max() < 1e-11
    assert abs(expected - ratio) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0.0, 0.2, 1 / 3, 0.5, 1.0])
def test_knife_edge_radius_ratio_is_exact(alpha: float) -> None:
    start = Start((0.3, 0.0, 0.0), (1.0, 0.5 * math.cos(0.3), 0.5 * math.sin(0.3)))
    found = run(KNIFE, MethodChoice("nonholonomic", alpha), start, Grid(0.1, 40), {"c": 1.0})
    chords = np.linalg.norm(np.diff(found.positions[:, 1:], axis=0), axis=1)
    expected = math.cos((1 - alpha) * 0.1) / math.cos(alpha * 0.1)
    assert np.abs(chords[1:] / chords[:-1] - expected).max() < 1e-11


def test_explicit_formula_of_the_class() -> None:
    """Delta r2 of the disk by the closed recursion with A(r_k), A(r-bar_(k-1)), A(r-bar_k)."""
    alpha, h = 0.3, 0.2
    found = run(DISK, MethodChoice("nonholonomic", alpha), START, Grid(h, 200), {"c": 1.0})
    phi, rolled = found.positions[:, 0], np.diff(found.positions[:, 1])
    middle = phi[:-1] + alpha * np.diff(phi)

    def inertia(a: float, b: float) -> float:
        return 0.5 + math.cos(a) * math.cos(b) + math.sin(a) * math.sin(b)

    expected = [rolled[0]]
    for k in range(1, len(rolled)):
        expected.append(expected[-1] * inertia(phi[k], middle[k - 1]) / inertia(phi[k], middle[k]))
    assert np.abs(rolled / np.array(expected) - 1).max() < 1e-11


@pytest.mark.parametrize(("constant", "misfit"), [(1.0, 2.1e-1), (1e-2, 2.1e-3), (1e-8, 2.1e-9)])
def test_free_constants_set_the_accuracy(constant: float, misfit: float) -> None:
    """The variational error in r1 is proportional to C, with one kernel for all values."""
    found = run(DISK, MethodChoice("variational", 0.0), START, Grid(0.05, 2000), {"c": constant})
    assert np.abs(found.positions[:, 0] - 0.3 - found.times).max() == pytest.approx(
        misfit, rel=0.05
    )


@pytest.mark.slow
def test_starting_from_momenta_makes_one_half_the_best() -> None:
    start, grid = particle_start(0.3), Grid(0.1, 100)
    truth = run(PARTICLE, MethodChoice("reference"), start, grid, {"c": 1.0}).positions[:, 2]

    def error(alpha: float, method: str) -> float:
        found = run(PARTICLE, MethodChoice(method, alpha), start, grid, {"c": 1.0})
        return float(np.abs(found.positions[:, 2] - truth).max())

    for method in ("variational", "nonholonomic"):
        errors = {
            alpha: error(alpha, method) for alpha in (0.0, 1 / 5, 1 / 3, 1 / 2, 2 / 3, 4 / 5, 1.0)
        }
        assert min(errors, key=lambda alpha: errors[alpha]) == 0.5
