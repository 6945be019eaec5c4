"""SciPy's integrators as peers in comparisons: DOP853, Radau and LSODA with the right-hand side as symengine closures.

P. Virtanen et al., Nature Methods 17 (2020) 261.
"""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from inverse_service.codegen.algebra import closure
from inverse_service.errors import InputError
from inverse_service.integrators.trajectory import Outcome, Trajectory
from inverse_service.simulation.choices import SCIPY, Grid, MethodChoice, Start
from inverse_service.simulation.formulas import MOMENT, Formulas
from inverse_service.simulation.problem import Problem


def run_scipy(
    problem: Problem, choice: MethodChoice, start: Start, grid: Grid, values: Mapping[str, float]
) -> Trajectory:
    """The motion at the recorded steps; the tolerance is relative, and absolute times the size of the start."""
    try:
        from scipy.integrate import solve_ivp
    except ImportError as error:
        raise InputError("SciPy is not installed here.") from error
    f = Formulas(problem)
    names = [str(name) for letter in "qv" for name in f.symbols(letter)] + [str(MOMENT), *f.parameters]
    function = closure(names, f.accelerations)
    numbers = [values[name] for name in problem.parameters]
    size = f.size

    def rates(t: float, state: np.ndarray) -> np.ndarray:
        return np.concatenate([state[size:], function([*state, t, *numbers]).ravel()])

    begin = np.array([*start.positions, *(start.velocities or ())], dtype=float)
    steps = np.unique([*range(0, grid.steps + 1, grid.record_every), grid.steps])
    times = grid.begin + grid.step * steps
    first = time.perf_counter()
    found = solve_ivp(
        rates, (times[0], times[-1]), begin, SCIPY[choice.method], times, rtol=max(choice.tolerance, 3e-14),
        atol=choice.tolerance * float(np.abs(begin).max() or 1.0),
    )  # fmt: skip
    passed = time.perf_counter() - first
    kind = "completed" if found.success and len(found.t) == len(times) else "not_finite"
    outcome = Outcome(kind, int(steps[len(found.t) - 1]), float(found.t[-1]), None if found.success else found.message)
    table = found.y.T
    return Trajectory(
        found.t, table[:, :size], None, table[:, size:], outcome, int(found.nfev), int(found.njev), 0.0, passed
    )
