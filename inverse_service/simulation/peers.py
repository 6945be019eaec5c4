"""Third-party integrators: heyoka (an extra) as an independent reference, SciPy's as peers in
comparisons.

F. Biscani, D. Izzo, Mon. Not. R. Astron. Soc. 504 (2021) 2614; P. Virtanen et al., Nature Methods
17 (2020) 261.
"""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from inverse_service.errors import InputError
from inverse_service.expressions import arrays
from inverse_service.integrators.method_table import SCIPY
from inverse_service.integrators.trajectory import Outcome, Trajectory
from inverse_service.kernels.codegen import graph as graphs
from inverse_service.kernels.codegen.symengine_trees import closure
from inverse_service.simulation.numeric_formulas import MOMENT, Formulas, arrays_by_name
from inverse_service.simulation.scene_data import Grid, MethodChoice, Observation, Problem, Start
from inverse_service.simulation.scene_graph import graph_of
from inverse_service.simulation.sentences import say

MOST_STEPS = 2_000_000
SMALL = 1e-3
SHORT = 1e-6
SHORT_PRODUCT = 8
# Nodes beyond which its code is written in loops: 180 take 0.4 s to compile in place of 2.4 s, and
# a step a fifth longer.
LARGE = 120
LARGEST_PRODUCT = 4096  # powers up to it are products
_ONE_AT_A_TIME = threading.Lock()


def load_heyoka() -> Any:
    """The module; InputError where it is not installed."""
    try:
        import heyoka
    except ImportError as error:
        raise InputError(
            "The method heyoka needs the extra `heyoka`: pip install inverse-service[heyoka]."
        ) from error
    return heyoka


def run_heyoka(
    problem: Problem, start: Start, grid: Grid, values: Mapping[str, float], observation: Observation,
    tolerance: float = 1e-15, stop: Callable[[], bool] | None = None,
) -> Trajectory:  # fmt: skip
    """The motion at the recorded steps of the grid, to round-off, in at most MOST_STEPS internal
    steps.
    """
    steps, times = grid.recorded, grid.times
    state = np.array([*start.positions, *start.velocities], dtype=float)
    with _ONE_AT_A_TIME:
        begin = time.perf_counter()
        # Its tolerance is absolute below 1: small motions are scaled by a power of 2. Time is
        # scaled too if steps are far from 1, because their series of high order would overflow or
        # underflow.
        step = float(np.abs(np.diff(times)).max())
        clock = 1.0 if SHORT < step < 1 / SHORT else _power_of_2(step)
        scale = np.repeat([1.0, 1 / clock], len(state) // 2)
        size = float(np.abs(state / scale).max(initial=0.0))
        unit = _power_of_2(size) if 0 < size < SMALL else 1.0
        integrator = taylor_integrator(problem, tolerance, unit, clock)
        integrator.state[:] = state / scale / unit
        integrator.pars[:] = [float(values[name]) for name in used_parameters(problem)]
        integrator.time = times[0] / clock
        compiled = time.perf_counter()
        # No longer than the grid: a far step has no term of a force that is narrow and still ahead.
        limits: dict[str, Any] = {"max_steps": MOST_STEPS, "max_delta_t": abs(grid.step) / clock}
        if stop is not None:
            limits["callback"] = lambda _: not stop()
        ended, *_, table = integrator.propagate_grid(times / clock, **limits)
        code, rows = str(ended), np.asarray(table) * unit * scale
        seconds = compiled - begin, time.perf_counter() - compiled
    good = int(np.isfinite(rows).all(axis=1).sum()) if rows.size else 0
    shown, place = rows[:good] if good else state[None], max(good - 1, 0)
    at = int(steps[place]), float(times[place])
    outcome = Outcome("completed", *at)
    if "cb_stop" in code:
        outcome = Outcome("cancelled", *at)
    elif "step_limit" in code:
        outcome = Outcome(
            "unresolved",
            *at,
            f"heyoka, after {MOST_STEPS} internal steps",
            None,
            say("shorter_time"),
        )
    elif "time_limit" not in code or good < len(steps):
        outcome = Outcome("not_finite", *at, "the Taylor series", None, say("regular_form"))
    positions, velocities = np.split(shown, 2, axis=1)
    known = arrays_by_name(problem.coordinates, positions, velocities, values, times[: len(shown)])
    series = (
        {item.name: arrays.array_value(item.expression, known) for item in observation}
        if good
        else {}
    )
    maxima = {name: float(np.abs(column).max()) for name, column in series.items()}
    return Trajectory(
        times[: len(shown)], positions, None, velocities, outcome, 0, 0, *seconds, series, maxima
    )


def _power_of_2(size: float) -> float:
    """The greatest one up to the size, whose square is a number too."""
    return float(2.0 ** np.clip(np.floor(np.log2(size)), -500, 500))


def used_parameters(problem: Problem) -> tuple[str, ...]:
    """The names that occur in the accelerations: heyoka accepts no others."""
    scene = graph_of(problem)
    keys = (scene.graph.keys[k] for k in scene.graph.below(scene.eliminated))
    places = {key[1] for key in keys if key[0] == graphs.LEAF}
    first = 3 + 2 * scene.size
    return tuple(name for k, name in enumerate(problem.parameters) if first + k in places)


@lru_cache(maxsize=64)
def taylor_integrator(
    problem: Problem, tolerance: float = 1e-15, unit: float = 1.0, clock: float = 1.0
) -> Any:
    """heyoka's integrator for q' = v, v' = accelerations, with parameters that get their values
    later; made once.

    Its state is q/unit, v clock/unit, and its time t/clock.
    """
    heyoka, scene = load_heyoka(), graph_of(problem)
    size = scene.size
    variables = heyoka.make_vars(*(f"{letter}{k}" for letter in "qv" for k in range(size)))
    scaled = [unit * variable for variable in variables] if unit != 1 else variables
    rates = scaled[size:] if clock == 1 else [rate / clock for rate in scaled[size:]]
    inputs: dict[int, Any] = {0: heyoka.time if clock == 1 else clock * heyoka.time}
    inputs |= dict(enumerate((*scaled[:size], *rates), 1))
    parameters = used_parameters(problem)
    for k, name in enumerate(parameters):
        inputs[3 + 2 * size + problem.parameters.index(name)] = heyoka.par[k]
    found = _translated(scene.graph, scene.eliminated, inputs, heyoka)
    system = [
        *zip(variables[:size], variables[size:], strict=True),
        *zip(variables[size:], (force / unit * clock**2 for force in found), strict=True),
    ]
    pars = [0.0] * len(parameters)
    is_long = len(scene.graph.below(scene.eliminated)) > LARGE
    return heyoka.taylor_adaptive(
        system, [0.0] * 2 * size, tol=tolerance, pars=pars, compact_mode=is_long
    )


def _translated(
    graph: graphs.Graph, nodes: Sequence[int], inputs: Mapping[int, Any], heyoka: Any
) -> list[Any]:
    """The nodes as heyoka's expressions, with those of the leaves by their places."""
    found = dict[int, Any]()
    for k in graph.below(nodes):
        operation, first, second = graph.keys[k]
        if operation == graphs.CONSTANT:
            found[k] = heyoka.expression(first)
        elif operation == graphs.LEAF:
            found[k] = inputs[first]
        elif operation == graphs.SUM:
            found[k] = found[first] + found[second]
        elif operation == graphs.PRODUCT:
            found[k] = found[first] * found[second]
        elif operation == graphs.NEGATIVE:
            found[k] = -found[first]
        elif operation == graphs.RECIPROCAL:
            found[k] = 1.0 / found[first]
        elif operation == graphs.ROOT:
            found[k] = found[first] ** 0.5
        elif operation == graphs.POWER:
            value = graph.number(second)
            is_product = value is not None and value == int(value) and 2 < value <= LARGEST_PRODUCT
            found[k] = (
                _product(found[first], int(value or 0), heyoka)
                if is_product
                else found[first] ** found[second]
            )
        elif hasattr(heyoka, second):
            found[k] = getattr(heyoka, second)(found[first])
        else:
            raise InputError(
                "heyoka cannot take a formula with functions or names that have no value."
            )
    return [found[node] for node in nodes]


def _product(base: Any, count: int, heyoka: Any) -> Any:
    """base^count by squares: the series of heyoka's power divides by its base, which may be 0, from
    the third on.
    """
    if count <= SHORT_PRODUCT:
        return heyoka.prod([base] * count)
    half = _product(base, count // 2, heyoka)
    return heyoka.prod([half, half, base] if count % 2 else [half, half])


def run_scipy(
    problem: Problem, choice: MethodChoice, start: Start, grid: Grid, values: Mapping[str, float],
    stop: Callable[[], bool] | None = None,
) -> Trajectory:  # fmt: skip
    """The motion at the recorded steps; the tolerance is relative, and absolute times the size of
    the start.
    """
    try:
        from scipy.integrate import solve_ivp
    except ImportError as error:
        raise InputError("SciPy is not installed here.") from error
    f = Formulas(problem)
    names = [str(name) for letter in "qv" for name in f.symbols(letter)] + [
        str(MOMENT),
        *f.parameters,
    ]
    numbers, size = [values[name] for name in problem.parameters], f.size
    if problem.accelerations is None:
        matrix, right = f.linear_motion
        parts = closure(tuple(names), (*matrix.ravel(), *right))
    else:
        right, parts = f.accelerations, closure(tuple(names), tuple(f.accelerations))

    def rates(t: float, state: np.ndarray) -> np.ndarray:
        if stop is not None and stop():
            raise TimeoutError
        found = parts([*state, t, *numbers]).ravel()
        if problem.accelerations is None:
            count = len(right)
            found = np.linalg.solve(found[:-count].reshape(count, count), found[-count:])[:size]
        return np.concatenate([state[size:], found])

    begin = np.array([*start.positions, *start.velocities], dtype=float)
    steps, times = grid.recorded, grid.times
    first = time.perf_counter()
    try:
        found = solve_ivp(
            rates, (times[0], times[-1]), begin, SCIPY[choice.method], times, rtol=max(choice.tolerance, 3e-14),
            atol=choice.tolerance * float(np.abs(begin).max() or 1.0),
        )  # fmt: skip
    except TimeoutError:
        ended = Outcome("cancelled", 0, float(times[0]))
        return Trajectory.of_start(float(times[0]), begin[:size], begin[size:], ended)
    passed = time.perf_counter() - first
    kind = "completed" if found.success and len(found.t) == len(times) else "not_finite"
    outcome = Outcome(
        kind,
        int(steps[len(found.t) - 1]),
        float(found.t[-1]),
        None if found.success else found.message,
    )
    table = found.y.T
    spent = int(found.nfev), int(found.njev), 0.0, passed
    return Trajectory(found.t, table[:, :size], None, table[:, size:], outcome, *spent)
