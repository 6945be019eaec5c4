"""Third-party integrators: heyoka (an extra) as an independent reference, SciPy's as peers in
comparisons.

F. Biscani, D. Izzo, Mon. Not. R. Astron. Soc. 504 (2021) 2614; P. Virtanen et al., Nature Methods
17 (2020) 261.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from inverse_service.errors import InputError
from inverse_service.expressions import arrays, functions, tree as ex
from inverse_service.integrators.method_table import SCIPY
from inverse_service.integrators.trajectory import Outcome, Trajectory
from inverse_service.kernels.codegen.symengine_trees import closure
from inverse_service.simulation.numeric_formulas import MOMENT, Formulas, table_of
from inverse_service.simulation.scene_data import Grid, MethodChoice, Observation, Problem, Start
from inverse_service.simulation.sentences import say

MOST_STEPS = 2_000_000
SMALL = 1e-3
SHORT = 1e-6
SHORT_PRODUCT = 8
LARGE = 8  # coordinates beyond which its code is written in loops, as its documentation advises
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
    known = table_of(problem.coordinates, positions, velocities, values, times[: len(shown)])
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
    return replace(problem, constraints=()).with_used_parameters().parameters


@lru_cache(maxsize=64)
def taylor_integrator(
    problem: Problem, tolerance: float = 1e-15, unit: float = 1.0, clock: float = 1.0
) -> Any:
    """heyoka's integrator for q' = v, v' = accelerations, with parameters that get their values
    later; made once.

    Its state is q/unit, v clock/unit, and its time t/clock.
    """
    heyoka = load_heyoka()
    names = [f"q{k}" for k in range(len(problem.coordinates))] + [
        f"v{k}" for k in range(len(problem.coordinates))
    ]
    variables = heyoka.make_vars(*names)
    size = len(problem.coordinates)
    moment = heyoka.time if clock == 1 else clock * heyoka.time
    table: dict[ex.Expression, Any] = {ex.PI: heyoka.expression(np.pi), ex.TIME: moment}
    parameters = used_parameters(problem)
    table |= {ex.Symbol(name): heyoka.par[k] for k, name in enumerate(parameters)}
    scaled = [unit * variable for variable in variables] if unit != 1 else variables
    table |= {ex.Symbol(name): scaled[k] for k, name in enumerate(problem.coordinates)}
    rates = scaled[size:] if clock == 1 else [rate / clock for rate in scaled[size:]]
    table |= {ex.Velocity(name): rates[k] for k, name in enumerate(problem.coordinates)}
    forces = [
        _translated(tree, table, heyoka) / unit * clock**2 for tree in problem.accelerations or ()
    ]
    system = [
        *zip(variables[:size], variables[size:], strict=True),
        *zip(variables[size:], forces, strict=True),
    ]
    pars = [0.0] * len(parameters)
    return heyoka.taylor_adaptive(
        system, [0.0] * 2 * size, tol=tolerance, pars=pars, compact_mode=size > LARGE
    )


def _translated(tree: ex.Expression, table: Mapping[ex.Expression, Any], heyoka: Any) -> Any:
    known = table.get(tree)
    if known is not None:
        return known
    match tree:
        case ex.Number(value):
            return heyoka.expression(value.numerator / value.denominator)
        case ex.Sum(terms):
            return heyoka.sum([_translated(term, table, heyoka) for term in terms])
        case ex.Product(factors):
            return heyoka.prod([_translated(factor, table, heyoka) for factor in factors])
        case ex.Power(base, ex.Number(value)) if (
            value.denominator == 1 and 2 < value <= LARGEST_PRODUCT
        ):
            return _product(_translated(base, table, heyoka), value.numerator, heyoka)
        case ex.Power(base, exponent):
            return _translated(base, table, heyoka) ** _translated(exponent, table, heyoka)
        case ex.Apply("cot", argument):  # 1/tan has no series where it is 0
            return _translated(ex.Apply("cos", argument) / ex.Apply("sin", argument), table, heyoka)
        case ex.Apply(function, argument):
            below, inner = functions.RECIPROCALS.get(function), _translated(argument, table, heyoka)
            return (
                1.0 / getattr(heyoka, below)(inner) if below else getattr(heyoka, function)(inner)
            )
        case _:
            raise InputError(
                "heyoka cannot take a formula with functions or names that have no value."
            )


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
    function = closure(tuple(names), tuple(f.accelerations))
    numbers = [values[name] for name in problem.parameters]
    size = f.size

    def rates(t: float, state: np.ndarray) -> np.ndarray:
        if stop is not None and stop():
            raise TimeoutError
        return np.concatenate([state[size:], function([*state, t, *numbers]).ravel()])

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
