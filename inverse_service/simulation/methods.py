"""What every run needs: the choice checked, numbers of the parameters, the compiled step.

Runs of a problem by a method: the one door to the integrators.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from inverse_service.errors import InputError
from inverse_service.integrators.method_table import GEOMETRIC, METHODS, OWN_STEPS, SCIPY
from inverse_service.integrators.tableaux import ORDERS
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.kernels.codegen.compiled import Compiled, compiled
from inverse_service.kernels.codegen.symengine_trees import free_names, real_value
from inverse_service.simulation.callables import MOMENT, Formulas, formulas_of
from inverse_service.simulation.execution import Ended, execute, failed_start, memory_of, trajectory_of, weights_of
from inverse_service.simulation.peers import run_heyoka, run_scipy
from inverse_service.simulation.scene_data import Grid, MethodChoice, Observable, Observation, Problem, Start, Stop
from inverse_service.simulation.schemes import alpha_of, parts_of, program_of
from inverse_service.simulation.starting import Initial, initial, refusal
from inverse_service.simulation.watches import RESOLVE, SMALLER_STEP, has_unique_roots

__all__ = ["Grid", "MethodChoice", "Observable", "Observation", "Problem", "Start", "run"]


def check(problem: Problem, choice: MethodChoice, grids: Sequence[Grid]) -> None:
    """InputError with one sentence for a choice that makes no sense."""
    if choice.method not in METHODS:
        raise InputError(f"There is no method of this name; there are {', '.join(METHODS)}.")
    if not 0.0 <= choice.alpha <= 1.0:
        raise InputError("alpha must be from 0 to 1.")
    if choice.form not in ("hamiltonian", "raw", "verlet"):
        raise InputError("The form of the variational method is hamiltonian, raw or verlet.")
    if choice.method in GEOMETRIC:
        _check_order(choice)
    if choice.symmetrised and choice.alpha != 0.5 and choice.form != "verlet" and problem.depends_on_time:
        raise InputError("Symmetrised steps are for systems without t: take alpha = 1/2, which has order 2 too.")
    for grid in grids:
        if not (abs(grid.step) > 0 and grid.step - grid.step == 0 and grid.steps >= 0 and grid.record_every >= 1):
            raise InputError("A grid needs a finite step other than 0, 0 or more steps, record_every of 1 or more.")


def _check_order(choice: MethodChoice) -> None:
    if choice.order not in ORDERS:
        raise InputError(f"Compositions have order 2, 4, 6 or 8, not {choice.order}.")
    if choice.order > 2 and choice.alpha != 0.5 and not choice.symmetrised:
        raise InputError("A composition needs a symmetric step: alpha = 1/2, or symmetrised.")


def parameter_values(problem: Problem, values: Mapping[str, float]) -> dict[str, float]:
    """The numbers of all parameters, by kernel name; InputError where one is missing or not finite."""
    found = {}
    for place, name in enumerate(problem.parameters):
        if name not in values:
            raise InputError(f"The parameter {name} needs a value.")
        number = float(values[name])
        if number - number != 0:
            raise InputError(f"The parameter {name} must be a finite number.")
        found[f"c{place}"] = number
    return found


def lane_of(
    choice: MethodChoice, begin: Initial, grid: Grid, parameters: Mapping[str, float]
) -> tuple[dict[str, float], dict[str, float]]:
    """(state and rates, arguments) of one trajectory."""
    rates = {f"{name}_rate": value for name, value in begin.rates.items()}
    setting = choice.tolerance if choice.method in OWN_STEPS else choice.alpha
    return {**begin.state, **rates, str(MOMENT): grid.begin}, {"h": grid.step, "a": setting, **parameters}


def kernel_of(formulas: Formulas, choice: MethodChoice, observation: Observation, lanes: int = 1) -> Compiled:
    """The compiled step of the method, made only once for all values of h, alpha, parameters and weights."""
    order = choice.order if choice.method == "runge_kutta" else 0
    identity = (
        formulas.problem, choice.method, choice.form, order, [str(part) for part in parts_of(choice)],
        str(alpha_of(choice)), choice.guard, observation,
    )  # fmt: skip
    return compiled(identity, lambda: program_of(formulas, choice, observation), lanes)


MONOTONE = "The step is far beyond what the guard allows, but its equation is monotone: the root found is the only one."
NO_GUARD = "The guard was off: that each step took the root that belongs to small steps was not checked."
FEW, MANY, HALF = 4, 4096, 0.5


def run(
    problem: Problem,
    choice: MethodChoice,
    start: Start,
    grid: Grid,
    values: Mapping[str, float],
    observation: Observation | None = None,
    stop: Stop | None = None,
    begun: bool = False,
) -> Trajectory:
    """One trajectory; `values` gives every parameter (free constants too) a number. With `begun` it is a further part
    of one, whose first steps are not looked at.

    Where the method cannot go on, the outcome says so and the rows up to there are kept. InputError for a choice
    that the problem does not allow. `stop` is asked about ten times a second; True ends the run as "cancelled".
    """
    check(problem, choice, [grid])
    observation = observation or Observation()
    if choice.method == "heyoka":
        return run_heyoka(problem, start, grid, values, observation, choice.tolerance, stop)
    if choice.method in SCIPY:
        return run_scipy(problem, choice, start, grid, values)
    formulas = formulas_of(problem)
    parameters = parameter_values(problem, values)
    begin = initial(formulas, choice, start, grid.step, parameters | {str(MOMENT): grid.begin})
    refused = begin.missing or refusal(formulas, choice, begin, grid, parameters)
    if refused:
        return failed_start(start, refused, grid.begin)
    if choice.guard and not begun and choice.method not in OWN_STEPS and grid.steps >= FEW:
        unresolved = _first_steps(formulas, choice, begin, grid, parameters)
        if unresolved is not None:
            return failed_start(start, unresolved, grid.begin)
    found = _run(formulas, choice, begin, grid, parameters, observation, stop)
    if found.outcome.kind == "guard" and _is_monotone(formulas, choice, grid, parameters):
        found = _run(formulas, replace(choice, guard=False), begin, grid, parameters, observation, stop)
        return replace(found, outcome=replace(found.outcome, note=MONOTONE))
    return found if choice.guard else replace(found, outcome=replace(found.outcome, note=NO_GUARD))


def _run(
    formulas: Formulas, choice: MethodChoice, begin: Initial, grid: Grid, parameters: Mapping[str, float],
    observation: Observation, stop: Stop | None,
) -> Trajectory:  # fmt: skip
    kernel = kernel_of(formulas, choice, observation)
    memory = memory_of(kernel.card, *lane_of(choice, begin, grid, parameters))
    done = execute(kernel, memory, weights_of(choice), grid, stop)
    return trajectory_of(Ended(formulas, choice, kernel, done, begin, grid), observation)


def _first_steps(
    formulas: Formulas, choice: MethodChoice, begin: Initial, grid: Grid, parameters: Mapping[str, float]
) -> Outcome | None:
    """The outcome where FEW steps lead elsewhere than MANY over the same time, or pass a wall: what is watched later
    sees only what steps have met. None where both agree, or where the long steps fail, which the run will say itself;
    where only the short ones meet a wall, the long ones jump over it."""
    bare = Observation(momenta=False, velocities=False)
    ends: list[Array] = []
    for count in (FEW, MANY):
        short = replace(grid, step=FEW * grid.step / count, steps=count, record_every=count // FEW)
        found = _run(formulas, choice, begin, short, parameters, bare, None)
        if not found.outcome.completed:
            jumped = bool(ends) and found.outcome.kind == "singular"
            return replace(found.outcome, step=0, time=grid.begin) if jumped else None
        passed = _wall_passed(formulas, found.positions, parameters)
        if passed is not None:
            return Outcome("singular", 0, grid.begin, *passed, SMALLER_STEP)
        ends.append(found.positions[-1] - found.positions[0])
    apart, moved = (float(np.linalg.norm(difference)) for difference in (ends[0] - ends[1], ends[1]))
    if not apart > HALF * moved:
        return None
    return Outcome(
        "unresolved", 0, grid.begin, f"the first {FEW} steps compared with {MANY} shorter ones", apart, RESOLVE
    )


def _wall_passed(formulas: Formulas, positions: Array, parameters: Mapping[str, float]) -> tuple[str, float] | None:
    """(text, value at the start) of a wall of the positions that has another sign at the first points after it."""
    known = {*(f"q{k}" for k in range(formulas.size)), *parameters}
    problem = formulas.problem
    for wall in formulas.walls_of([problem.free_hamiltonian, problem.lagrangian, *(problem.accelerations or ())]):
        if free_names(wall.formula) <= known:
            tables = ({**parameters, **{f"q{k}": float(x) for k, x in enumerate(row)}} for row in positions)
            values = [real_value(wall.formula, table) for table in tables]
            if any(value * values[0] < 0 for value in values):
                return wall.text, values[0]
    return None


def _is_monotone(formulas: Formulas, choice: MethodChoice, grid: Grid, parameters: Mapping[str, float]) -> bool:
    """Whether each substep has one root only, whatever the guard says."""
    if formulas.depends_on_time:
        return False
    program = program_of(formulas, choice, Observation(momenta=False, velocities=False))
    known = {"a": choice.alpha, **parameters}
    substeps = {weight * grid.step for weight in weights_of(choice)}
    return all(has_unique_roots(program, known | {"h": step}) for step in substeps)
