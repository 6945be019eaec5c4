"""What every run needs: the choice checked, numbers of the parameters, the compiled step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from inverse_service.codegen.compiled import Compiled, compiled
from inverse_service.errors import InputError
from inverse_service.integrators.compositions import ORDERS, composition
from inverse_service.simulation.choices import OWN_STEPS, SCIPY, Grid, MethodChoice, Observation
from inverse_service.simulation.formulas import MOMENT, Formulas
from inverse_service.simulation.problem import Problem
from inverse_service.simulation.schemes import alpha_of, parts_of, program_of
from inverse_service.simulation.starting import Initial

METHODS = ("variational", "nonholonomic", "modified", "runge_kutta", "reference", "adaptive", "stiff", "heyoka", *SCIPY)


def check(problem: Problem, choice: MethodChoice, grids: Sequence[Grid]) -> None:
    """InputError with one sentence for a choice that makes no sense."""
    if choice.method not in METHODS:
        raise InputError(f"There is no method of this name; there are {', '.join(METHODS)}.")
    if not 0.0 <= choice.alpha <= 1.0:
        raise InputError("alpha must be from 0 to 1.")
    if choice.form not in ("hamiltonian", "raw", "verlet"):
        raise InputError("The form of the variational method is hamiltonian, raw or verlet.")
    if choice.method in ("variational", "nonholonomic", "modified"):
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


def weights_of(choice: MethodChoice) -> tuple[float, ...]:
    return composition(choice.order) if choice.method in ("variational", "nonholonomic", "modified") else (1.0,)


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
