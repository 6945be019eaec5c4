"""An ensemble gives what its members give one by one."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.hard_cases import disk_start, particle_start
from benchmarks.problems import DISK, DISK_ENERGY, PARTICLE, PENDULUM
from inverse_service.errors import InputError
from inverse_service.simulation.choices import Grid, MethodChoice, Observation, Start
from inverse_service.simulation.ensembles import run_ensemble
from inverse_service.simulation.methods import run

SEEN = Observation(observables=(DISK_ENERGY,))


@pytest.mark.parametrize("count", [1, 7, 8, 9, 20])
def test_many_starts(count: int) -> None:
    starts = [disk_start(0.1 * k, 1.0 + 0.01 * k) for k in range(count)]
    grid, choice = Grid(0.05, 200, 50), MethodChoice("variational", 0.5)
    found = run_ensemble(DISK, choice, starts, [grid], [{"c": 0.5}], observation=SEEN)
    assert len(found) == count
    for start, one in zip(starts, found, strict=True):
        alone = run(DISK, choice, start, grid, {"c": 0.5}, SEEN)
        assert one.outcome.completed
        assert np.abs(one.positions - alone.positions).max() < 1e-12
        assert one.maxima["energy"] == pytest.approx(alone.maxima["energy"], rel=1e-13)
        assert np.all(one.times == alone.times)


def test_many_alphas_steps_and_constants() -> None:
    alphas = [0.0, 0.1, 0.2, 1 / 3, 0.5, 0.7, 1.0, 0.9, 0.5, 0.25]
    grids = [Grid(0.02 + 0.005 * k, 100) for k in range(10)]
    values = [{"c": 10.0**-k} for k in range(10)]
    found = run_ensemble(DISK, MethodChoice("variational"), [disk_start()], grids, values, alphas)
    for alpha, grid, given, one in zip(alphas, grids, values, found, strict=True):
        alone = run(DISK, MethodChoice("variational", alpha), disk_start(), grid, given)
        assert np.abs(one.positions - alone.positions).max() < 1e-12


@pytest.mark.parametrize("method", ["nonholonomic", "runge_kutta", "reference"])
def test_other_methods(method: str) -> None:
    starts = [particle_start(-0.5 + 0.1 * k) for k in range(10)]
    choice = MethodChoice(method, order=4)
    found = run_ensemble(PARTICLE, choice, starts, [Grid(0.05, 100)], [{"c": 1.0}])
    for start, one in zip(starts, found, strict=True):
        alone = run(PARTICLE, choice, start, Grid(0.05, 100), {"c": 1.0})
        assert np.abs(one.positions - alone.positions).max() < 1e-12


def test_members_end_by_themselves() -> None:
    """Refused, stopped on the way, and completed, side by side."""
    starts = [disk_start(), disk_start(0.3, 0.0), disk_start(0.3, 0.05), disk_start(1.0)]
    found = run_ensemble(DISK, MethodChoice("variational"), starts, [Grid(0.1, 2000)], [{"c": 1.0}])
    assert [one.outcome.kind for one in found] == ["completed", "off_domain", "guard", "completed"]
    swings = [Start((0.1 * k,), (0.0,)) for k in range(1, 9)]
    ks = [{"k": 10.0**k} for k in range(-3, 5)]
    stopped = run_ensemble(PENDULUM, MethodChoice("variational"), swings, [Grid(0.3, 100)], ks)
    for start, given, one in zip(swings, ks, stopped, strict=True):
        alone = run(PENDULUM, MethodChoice("variational"), start, Grid(0.3, 100), given)
        assert (one.outcome.kind, one.outcome.step) == (alone.outcome.kind, alone.outcome.step)
        assert len(one.positions) == len(alone.positions)
    assert {one.outcome.kind for one in stopped} == {"completed", "guard"}


def test_settings_that_do_not_fit_are_refused() -> None:
    grid = Grid(0.1, 10)
    with pytest.raises(InputError, match="1 or 3"):
        run_ensemble(DISK, MethodChoice("variational"), [disk_start()] * 3, [grid] * 2, [{"c": 1.0}])
    with pytest.raises(InputError, match="same steps"):
        run_ensemble(DISK, MethodChoice("variational"), [disk_start()], [grid, Grid(0.1, 11)], [{"c": 1.0}])
    with pytest.raises(InputError, match="alpha"):
        run_ensemble(DISK, MethodChoice("variational"), [disk_start()], [grid], [{"c": 1.0}], [0.5, 2.0])
