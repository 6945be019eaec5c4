"""The time to an error of 1e-9: our methods beside SciPy's DOP853 and LSODA and heyoka, same problem, one run."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.handwritten import START as HENON_HEILES_START
from benchmarks.hard_cases import contact_start, disk_start, particle_start
from benchmarks.problems import CONTACT, DISK, HENON_HEILES, PARTICLE
from inverse_service.simulation.execution import run
from inverse_service.simulation.peers import taylor_integrator, used_parameters
from inverse_service.simulation.scene_data import Grid, MethodChoice, Observation, Problem, Start

SPAN, TARGET, ROUNDS = 100.0, 1e-9, 5
SHORT = 5e-3  # seconds
BARE = Observation(velocities=False, momenta=False)
Array = NDArray[np.float64]
Attempt = Callable[[], tuple[float, Array | None]]  # (seconds, positions at the end)


@dataclass(frozen=True, slots=True)
class PeerRow:
    """The cheapest setting of a method whose error at T = 100 is at most 1e-9; `seconds` best and median."""

    problem: str
    method: str
    setting: str
    error: float | None
    seconds: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class _Setting:
    label: str
    attempt: Attempt


_PROBLEMS: dict[str, tuple[Problem, Start, dict[str, float]]] = {
    "disk": (DISK, disk_start(), {"c": 1.0}),
    "particle": (PARTICLE, particle_start(), {"c": 1.0}),
    "Henon and Heiles": (HENON_HEILES, HENON_HEILES_START, {}),
    "contact oscillator": (CONTACT, contact_start(), {"k": 0.3}),
}


def peer_rows(report: Callable[[str], None], rounds: int = ROUNDS) -> list[PeerRow]:
    rows = []
    for name, (problem, start, values) in _PROBLEMS.items():
        report(f"peers, {name}")
        truth = run(problem, MethodChoice("reference"), start, Grid(0.02, 5000, 5000), values).positions[-1]
        chosen = {method: _cheapest(settings, truth) for method, settings in _methods(problem, start, values).items()}
        times: dict[str, list[float]] = {method: [] for method in chosen}
        for _ in range(rounds):
            for method, found in chosen.items():
                if found:
                    times[method].append(_warm(found[0].attempt))
        for method, found in chosen.items():
            seconds = (min(times[method]), statistics.median(times[method])) if found else None
            rows.append(PeerRow(name, method, found[0].label if found else "-", found[1] if found else None, seconds))
    return rows


def _warm(attempt: Attempt) -> float:
    """The best of several in a row, where one is short: the caches hold its code then, as in a long computation."""
    first = attempt()[0]
    return min([first, *(attempt()[0] for _ in range(20))]) if first < SHORT else first


def _cheapest(settings: Iterator[_Setting], truth: Array) -> tuple[_Setting, float] | None:
    """The first setting, from coarse to fine, that reaches the target."""
    size = max(1.0, float(np.abs(truth).max()))
    for setting in settings:
        _, end = setting.attempt()
        if end is not None and (error := float(np.abs(end - truth).max()) / size) <= TARGET:
            return setting, error
    return None


def _methods(problem: Problem, start: Start, values: dict[str, float]) -> dict[str, Iterator[_Setting]]:
    found: dict[str, Iterator[_Setting]] = {}
    if problem.free_hamiltonian is not None:
        for constant in (1.0, 1e-8) if values else (1.0,):
            given = dict.fromkeys(values, constant)
            for order in (2, 8):
                choice = MethodChoice("variational", 0.5, order=order)
                found[f"variational, order {order}, C = {constant:g}"] = _ours(problem, choice, start, given)
    for order in (2, 8):
        if problem.constraints:
            choice = MethodChoice("nonholonomic", 0.5, order=order)
            found[f"nonholonomic, order {order}"] = _ours(problem, choice, start, values)
        else:
            choice = MethodChoice("variational", 0.0, True, order, "verlet")
            found[f"Stormer and Verlet, order {order}"] = _ours(problem, choice, start, values)
    found["our Runge-Kutta 8, fixed step"] = _ours(problem, MethodChoice("runge_kutta", order=8), start, values)
    found["our adaptive DOP853"] = _own_steps(problem, start, values)
    found["our Gauss-Legendre 12"] = _ours(problem, MethodChoice("reference"), start, values)
    for method in ("DOP853", "LSODA"):
        found[f"SciPy {method}"] = _scipy(problem, start, values, method)
    found["heyoka"] = _heyoka(problem, start, values)
    return found


def _own_steps(problem: Problem, start: Start, values: dict[str, float]) -> Iterator[_Setting]:
    for power in range(5, 15):
        choice = MethodChoice("adaptive", tolerance=10.0**-power)

        def attempt(choice: MethodChoice = choice) -> tuple[float, Array | None]:
            found = run(problem, choice, start, Grid(SPAN, 1), values, Observation(momenta=False, velocities=False))
            return found.run_seconds, found.positions[-1] if found.outcome.completed else None

        yield _Setting(f"tol = 1e-{power}", attempt)


def _ours(problem: Problem, choice: MethodChoice, start: Start, values: dict[str, float]) -> Iterator[_Setting]:
    for power in range(40):
        steps = round(50 * 2 ** (power / 2))

        def attempt(steps: int = steps) -> tuple[float, Array | None]:
            done = run(problem, choice, start, Grid(SPAN / steps, steps, steps), values, BARE)
            return done.run_seconds, done.positions[-1] if done.outcome.completed else None

        yield _Setting(f"h = {SPAN / steps:.3g}", attempt)


def _scipy(problem: Problem, start: Start, values: dict[str, float], method: str) -> Iterator[_Setting]:
    from scipy.integrate import solve_ivp

    size, rates = len(problem.coordinates), _rates(problem, values)
    begin = [*start.positions, *(start.velocities or ())]
    for power in range(12, 28):
        tolerance = 10 ** (-power / 2)

        def attempt(tolerance: float = tolerance) -> tuple[float, Array | None]:
            first = time.perf_counter()
            done = solve_ivp(rates, (0, SPAN), begin, method=method, rtol=tolerance, atol=tolerance)
            return time.perf_counter() - first, done.y[:size, -1] if done.success else None

        yield _Setting(f"rtol = {tolerance:.1g}", attempt)


def _rates(problem: Problem, values: dict[str, float]) -> Callable[[float, Sequence[float]], list[float]]:
    """The right-hand side as plain Python, compiled once by SymPy's lambdify, as a user would have it."""
    import sympy

    from inverse_service.kernels.codegen.symengine_trees import symbol
    from inverse_service.simulation.numeric_formulas import Formulas

    f = Formulas(problem)
    given = {symbol(f"c{k}"): values[name] for k, name in enumerate(problem.parameters)}
    names = [sympy.sympify(name) for letter in "qv" for name in f.symbols(letter)]
    forces = [sympy.sympify(force.subs(given)) for force in f.accelerations]
    function = sympy.lambdify([names], [*names[f.size :], *forces], "math")
    return lambda t, y: function(y)


def _heyoka(problem: Problem, start: Start, values: dict[str, float]) -> Iterator[_Setting]:
    size, begin = len(problem.coordinates), [*start.positions, *(start.velocities or ())]
    for power in range(6, 16):
        integrator = taylor_integrator(problem, 10.0**-power)
        integrator.pars[:] = [values[name] for name in used_parameters(problem)]

        def attempt(integrator: object = integrator) -> tuple[float, Array | None]:
            integrator.time = 0.0  # type: ignore[attr-defined]
            integrator.state[:] = begin  # type: ignore[attr-defined]
            first = time.perf_counter()
            integrator.propagate_until(SPAN)  # type: ignore[attr-defined]
            return time.perf_counter() - first, np.array(integrator.state[:size])  # type: ignore[attr-defined]

        yield _Setting(f"tol = 1e-{power}", attempt)
