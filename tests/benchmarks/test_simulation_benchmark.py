"""The routes that are compared compute the same thing, and the pages say what was measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import simulation
from benchmarks.hard_cases import judge as judge_case
from benchmarks.hard_cases import near_singular, starts
from benchmarks.simulation_cases import CASES, SpeedCase, lane, program
from benchmarks.simulation_peers import peer_rows
from benchmarks.simulation_routes import lambdify_and_fsolve, ours, python_text, with_numba
from benchmarks.simulation_speed import effect_rows, ensemble_rows, latency_rows, long_rows
from inverse_service.simulation.methods import run
from inverse_service.simulation.scene_data import Grid


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.label)
def test_python_text_of_the_numba_route_is_the_same_step(case: SpeedCase) -> None:
    """Run without numba, as plain Python, beside our kernel."""
    made = program(case)
    text = python_text(made).replace("import numba", "").replace("@numba.njit(fastmath=False)", "")
    space: dict[str, object] = {}
    exec(compile(text, "route", "exec"), space)
    state, arguments = lane(case)
    values = [state.get(name, 0.0) for name in (*made.state, *(f"{u}_rate" for u in made.unknowns))]
    end = space["run"](50, *values, *(arguments[name] for name in made.arguments))  # type: ignore[operator]
    found = run(case.problem, case.choice, case.start, Grid(0.01, 50), {"c": 1e-2})
    size = len(case.problem.coordinates)
    assert np.abs(np.array(end[:size]) - found.positions[-1]).max() < 1e-12


def test_hard_case_page_tells_right_from_wrong() -> None:
    judged = [judge_case(next(iter(near_singular()))), judge_case(next(iter(starts())))]
    page = simulation.hard_cases_page(judged)
    assert "2 of 2 cases" in page
    assert "WRONG" not in page
    assert "determinant" in page


@pytest.mark.slow
def test_every_part_runs(tmp_path: Path) -> None:
    def quiet(line: str) -> None:
        return None

    assert ours(CASES[0])(100) > 0
    assert with_numba(CASES[0], tmp_path)(100) > 0
    assert lambdify_and_fsolve(CASES[0])(5) > 0
    assert {"read", "Legendre", "compile"} <= set(latency_rows(quiet, 1)[0].stages)
    assert all(row.core[0] > 0 for row in ensemble_rows(quiet, 1, 9, 10))
    assert len(effect_rows(quiet, 1, 100)) == 6
    rows = long_rows(quiet, 20_000)
    assert all(row.worst[0] < 1e-3 for row in rows)
    peers = peer_rows(quiet, 1)
    assert {row.method for row in peers} >= {"heyoka", "SciPy DOP853", "nonholonomic, order 8"}
    assert all(row.error is None or row.error <= 1e-9 for row in peers)
