"""An ensemble gives the same results as its members one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from benchmarks.hard_cases import disk_start, particle_start
from benchmarks.problems import DISK, PARTICLE, PENDULUM
from inverse_service.errors import InputError
from inverse_service.service.scenes.simulating import simulate
from inverse_service.simulation.execution import Run, run, run_ensemble
from inverse_service.simulation.scene_data import Grid, MethodChoice, Problem, Start


def together(
    what: Problem, choice: MethodChoice, starts: list[Start], grid: Grid, values: dict[str, object]
) -> Run:
    positions, velocities = (
        np.array([getattr(start, name) for start in starts]) for name in ("positions", "velocities")
    )
    return run_ensemble(what, choice, positions, velocities, grid, values)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 7, 8, 9, 20])
def test_many_starts(count: int) -> None:
    starts = [disk_start(0.1 * k, 1.0 + 0.01 * k) for k in range(count)]
    grid, choice = Grid(0.05, 210, 50), MethodChoice("variational", 0.5)
    found = together(DISK, choice, starts, grid, {"c": 0.5})
    assert found.completed.all()
    assert len(found.positions) == count
    for start, positions, momenta in zip(starts, found.positions, found.rates, strict=True):
        alone = run(DISK, choice, start, grid, {"c": 0.5})
        assert np.abs(positions - alone.positions).max() < 1e-12
        assert alone.momenta is not None
        assert np.abs(momenta - alone.momenta).max() < 1e-12
        assert np.all(found.grid.times == alone.times)


@pytest.mark.slow
def test_many_steps_and_constants() -> None:
    steps, constants = np.linspace(0.02, 0.065, 10), 10.0 ** -np.arange(10)
    start = disk_start()
    grid, choice = Grid(0.02, 100), MethodChoice("variational", 0.3)
    positions, velocities = (
        np.tile(getattr(start, name), (10, 1)) for name in ("positions", "velocities")
    )
    found = run_ensemble(DISK, choice, positions, velocities, grid, {"c": constants}, steps=steps)
    for step, constant, one in zip(steps, constants, found.positions, strict=True):
        alone = run(DISK, choice, start, Grid(float(step), 100), {"c": float(constant)})
        assert np.abs(one - alone.positions).max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", ["nonholonomic", "runge_kutta", "reference", "adaptive", "stiff"]
)
def test_other_methods(method: str) -> None:
    starts = [particle_start(-0.5 + 0.1 * k) for k in range(10)]
    choice = MethodChoice(method, order=4, tolerance=1e-9)
    found = together(PARTICLE, choice, starts, Grid(0.05, 100), {"c": 1.0})
    for start, one in zip(starts, found.positions, strict=True):
        alone = run(PARTICLE, choice, start, Grid(0.05, 100), {"c": 1.0})
        assert alone.outcome.completed
        assert np.abs(one - alone.positions).max() < 1e-12


def test_members_end_by_themselves() -> None:
    """Rejected, stopped, and completed members in one ensemble."""
    starts = [disk_start(), disk_start(0.3, 0.0), disk_start(0.3, 0.05), disk_start(1.0)]
    found = together(DISK, MethodChoice("variational"), starts, Grid(0.1, 2000), {"c": 1.0})
    assert [found.outcome(k).kind for k in range(4)] == [
        "completed",
        "off_domain",
        "guard",
        "completed",
    ]
    swings = [Start((0.1 * k,), (0.0,)) for k in range(1, 9)]
    ks = 10.0 ** np.arange(-3, 5)
    stopped = together(PENDULUM, MethodChoice("variational"), swings, Grid(0.3, 100), {"k": ks})
    for place, (start, k) in enumerate(zip(swings, ks, strict=True)):
        alone = run(PENDULUM, MethodChoice("variational"), start, Grid(0.3, 100), {"k": float(k)})
        outcome = stopped.outcome(place)
        if alone.outcome.step:
            assert (outcome.kind, outcome.step) == (alone.outcome.kind, alone.outcome.step)
        assert np.isfinite(stopped.positions[place, :, 0]).sum() >= len(alone.positions)
    assert {stopped.outcome(k).kind for k in range(8)} >= {"completed", "guard"}


def test_methods_without_kernels_are_refused() -> None:
    start = disk_start()
    positions, velocities = np.array([start.positions]), np.array([start.velocities])
    with pytest.raises(InputError, match="step with kernels"):
        run_ensemble(DISK, MethodChoice("heyoka"), positions, velocities, Grid(0.1, 10), {"c": 1.0})


@pytest.mark.slow
def test_starts_with_momenta_of_their_own_are_those_of_single_runs() -> None:
    """L~ of the disk is 0/0 where sin(phi) = 0: all starts are computed at once, and equal those of
    single runs.
    """
    angles = ["0", "pi/2", "0.3", "1"]
    scene: dict[str, Any] = {
        "system": {"catalogue": "vertically-rolling-disk"}, "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"},
        "initial": {"positions": {"phi": 0, "theta": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "theta": 0.5}},
        "step": 0.05, "steps": 20, "methods": ["variational"],
    }  # fmt: skip
    (many,) = simulate(scene | {"ensemble": {"initial": {"positions": {"phi": angles}}}})["methods"]
    for k, angle in enumerate(angles):
        scene["initial"] = {
            **scene["initial"],
            "positions": {"phi": angle, "theta": 0, "x": 0, "y": 0},
        }
        (one,) = simulate(scene)["methods"]
        for name, value in one["final"]["positions"].items():
            assert many["members_columns"][f"{name}_end"][k] == pytest.approx(value, abs=1e-13)
