"""Initial states of the methods: from velocities or momenta, at a point or on the discrete constraint."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import symengine
from numpy.typing import NDArray

from inverse_service.errors import InputError
from inverse_service.integrators.method_table import POINT_METHODS
from inverse_service.integrators.trajectory import Outcome
from inverse_service.kernels.codegen.symengine_trees import ZERO, Formula, real_value
from inverse_service.simulation.callables import MOMENT, Formulas
from inverse_service.simulation.scene_data import Grid, MethodChoice, Start
from inverse_service.simulation.schemes import parts_of
from inverse_service.simulation.watches import GUARD_REMEDY

LIMIT = 1.0
_SAMPLES, _NEAR = 256, 20.0

Numbers = dict[str, float]
OFF_CONSTRAINTS = 1e-9
# Distances at which a power of the distance is read off, their ratio in decades, and what counts as a power below 1: in
# doubles a smooth force shows 1, a jump 0, and round-off two powers that differ.
NEARER, NEARER_BY = (1e-4, 1e-7, 1e-10), 3
FLAT, STRAIGHT, SAME_POWER = 0.02, 0.97, 0.02
LATER = 1e-3
BY_SLOPES = ("stiff",)
BEGIN_ELSEWHERE = "begin elsewhere, or at another start_time"


@dataclass(frozen=True, slots=True)
class Initial:
    """Values of state variables and first guesses of the unknowns' rates.

    `missing` is the outcome where a momentum has no value, so that the run cannot begin.
    """

    state: Numbers
    rates: Numbers = field(default_factory=dict)
    missing: Outcome | None = None


def initial(f: Formulas, choice: MethodChoice, start: Start, step: float, parameters: Mapping[str, float]) -> Initial:
    """State of the kernel at its first time, which stands among the parameters (0 where it does not)."""
    parameters = {str(MOMENT): 0.0, **parameters}
    _require(start, f.size)
    q = _named("q", start.positions)
    if choice.method in POINT_METHODS:
        if start.velocities is None:
            raise InputError("Runge-Kutta methods start from velocities: give velocities instead of momenta.")
        state = {**q, **_named("v", start.velocities)}
        return Initial(state, missing=no_one_motion(f, choice, {**parameters, **state}))
    discrete = start.convention == "discrete_constraint"
    if start.momenta is not None and choice.method != "modified" and not discrete:
        guess = _named("d", start.velocities) if start.velocities is not None else None
        rates = guess or _rates_from_momenta(f, q, start.momenta, parameters, choice)
        return Initial({**q, **_named("p", start.momenta)}, rates)
    if start.velocities is None:
        raise InputError("This method and this start need velocities: give velocities instead of momenta.")
    if discrete and choice.order > 2:
        raise InputError("A composition starts from momenta: the discrete constraint is that of the plain step.")
    if discrete:
        return _on_discrete_constraint(f, choice, start, step, parameters)
    return _at_point(f, choice, q, list(start.velocities), parameters)


def _require(start: Start, size: int) -> None:
    given = [start.positions, start.velocities, start.momenta]
    if any(values is not None and len(values) != size for values in given):
        raise InputError(f"Initial data need {size} numbers each, one for every coordinate.")
    if start.velocities is None and start.momenta is None:
        raise InputError("Initial data need velocities or momenta.")
    if not all(math.isfinite(x) for values in given if values is not None for x in values):
        raise InputError("Initial data must be finite numbers.")


def _named(letter: str, values: Sequence[float]) -> Numbers:
    return {f"{letter}{k}": float(value) for k, value in enumerate(values)}


def _rates_from_momenta(
    f: Formulas, q: Numbers, momenta: Sequence[float], parameters: Mapping[str, float], choice: MethodChoice
) -> Numbers:
    """H_p where H is known, else 0."""
    if choice.method != "variational" or f.problem.free_hamiltonian is None:
        return {}
    table = {**parameters, **q, **_named("p", momenta)}
    rates = [real_value(f.hamiltonian.diff(p), table) for p in f.symbols("p")]
    return {f"d{k}": rate for k, rate in enumerate(rates) if math.isfinite(rate)}


def _at_point(
    f: Formulas, choice: MethodChoice, q: Numbers, velocities: list[float], parameters: Mapping[str, float]
) -> Initial:
    table = {**parameters, **q, **_named("v", velocities)}
    return _checked(f, choice, q, _momenta(f, choice, table), velocities, table)


def _momenta(f: Formulas, choice: MethodChoice, table: Mapping[str, float]) -> list[float]:
    """dL/dv; of L~ with the constraints put in where they hold, so that common factors A_alpha cancel."""
    velocities = f.symbols("v")
    if choice.method == "nonholonomic":
        return f.evaluator("momenta of L", lambda: [f.lagrangian.diff(v) for v in velocities])(table)
    if not f.forms or not _holds(f, table):
        return f.evaluator("momenta of L~", lambda: [f.free_lagrangian.diff(v) for v in velocities])(table)
    given = {velocities[k]: value for k, value in f.dependent.items()}
    key = "momenta of L~ on the constraints"
    return f.evaluator(key, lambda: [f.free_lagrangian.diff(v).subs(given) for v in velocities])(table)


def _holds(f: Formulas, table: Mapping[str, float]) -> bool:
    """Whether velocities are those that the constraints give, to round-off."""
    size = max((abs(table[f"v{k}"]) for k in range(f.size)), default=0.0)
    values = f.evaluator(
        "constraints", lambda: [_along(row, f.symbols("v")) + c for row, c in zip(f.forms, f.drifts, strict=True)]
    )(table)
    return all(abs(value) <= OFF_CONSTRAINTS * size for value in values)


def _along(row: Sequence[Formula], velocities: Sequence[Formula]) -> Formula:
    return sum((a * v for a, v in zip(row, velocities, strict=True)), ZERO)


def _checked(
    f: Formulas, choice: MethodChoice, q: Numbers, momenta: Sequence[float], velocities: Sequence[float],
    table: Mapping[str, float],
) -> Initial:  # fmt: skip
    kept = [k for k in range(f.size) if choice.method != "modified" or k not in f.dependent]
    whole = f.lagrangian if choice.method == "nonholonomic" else f.free_lagrangian
    undefined = undefined_force(f, f.forces, table)
    if undefined is None and f.depends_on_time:  # elsewhere L~ may be 0/0 at the start
        undefined = undefined_force(f, [whole.diff(place) for place in f.symbols("q")], table)
    state = {**q, **{f"p{k}": momenta[k] for k in kept}}
    rates = {f"d{k}": velocity for k, velocity in enumerate(velocities)}
    if all(math.isfinite(momenta[k]) for k in kept):
        return Initial(state, rates, undefined)
    quantity, value = vanishing(f, table)
    remedy = "start where it is not 0, from momenta, or with another associated system or method"
    return Initial(state, rates, Outcome("off_domain", 0, table[str(MOMENT)], quantity, value, remedy))


def undefined_force(f: Formulas, forces: Sequence[Formula], table: Mapping[str, float]) -> Outcome | None:
    """The outcome where a force has no value at the start, through which no step would notice it, or none passes."""
    for name, formula in zip(f.problem.coordinates, forces, strict=False):
        if not math.isfinite(real_value(formula, table)) or _divides_by_zero(formula, table):
            begin = table[str(MOMENT)]
            quantity = f"the force on {name} at the start, t = {begin:.12g}, which has no value"
            return Outcome("off_domain", 0, begin, quantity, None, BEGIN_ELSEWHERE)
    return None


def _divides_by_zero(formula: Formula, table: Mapping[str, float]) -> bool:
    """Whether it divides by what is 0 there, or takes its logarithm: atan(v/x) has a number in doubles at x = 0."""
    powers = formula.atoms(symengine.Pow)
    divided = [power.args[0] for power in powers if power.args[1].is_Number and power.args[1].is_negative]
    divided += [logarithm.args[0] for logarithm in formula.atoms(symengine.log)]
    return any(real_value(base, table) == 0 for base in divided)


def no_one_motion(f: Formulas, choice: MethodChoice, table: Mapping[str, float]) -> Outcome | None:
    """The outcome where an acceleration has no value at the start, or is no Lipschitz function there.

    x'' = sqrt(x) has the motions x = 0 and x = (t - s)^4/144 for t > s, one for each s, from x = x' = 0. Where the
    motion leaves such a place at once it is the only one, but a method that solves by slopes may take another.
    """
    undefined = undefined_force(f, f.accelerations, table)
    if undefined is not None or not f.walls_of(f.problem.accelerations or ()):
        return undefined
    steep = _steep(f, table)
    if any(steep) and choice.method not in BY_SLOPES:
        steep &= _steep(f, _a_little_later(f, table))
    for name, is_steep in zip(f.problem.coordinates, steep, strict=True):
        if is_steep:
            quantity = f"the force on {name}: its slope is infinite at the start, where more than one motion may begin"
            return Outcome("singular", 0, table[str(MOMENT)], quantity, None, "begin beside it")
    return None


def _a_little_later(f: Formulas, table: Mapping[str, float]) -> Numbers:
    """q + v s + f s^2/2 and v + f s."""
    moved = dict(table)
    for k, force in enumerate(f.evaluator("accelerations", lambda: f.accelerations)(table)):
        moved[f"q{k}"] += LATER * (table[f"v{k}"] + LATER * force / 2)
        moved[f"v{k}"] += LATER * force
    return moved


def _steep(f: Formulas, table: Mapping[str, float]) -> NDArray[np.bool_]:
    """Of each force, whether it changes as a power below 1 of the distance: along q_k, v_k or oblique to them all."""
    names = [f"{letter}{k}" for letter in "qv" for k in range(f.size)]
    forces = f.evaluator("accelerations", lambda: f.accelerations)
    oblique = np.random.default_rng(0).normal(size=(4, len(names)))
    steep = np.zeros(f.size, dtype=bool)
    for way in (*np.eye(len(names)), *-np.eye(len(names)), *oblique):
        places = [dict(zip(names, size * way, strict=True)) for size in (0.0, *NEARER)]
        values = np.array([forces({**table} | {x: table[x] + place[x] for x in names}) for place in places])
        with np.errstate(all="ignore"):
            first, last = -np.diff(np.log10(np.abs(values[1:] - values[0])), axis=0) / NEARER_BY
        steep |= (last > FLAT) & (last < STRAIGHT) & (np.abs(first - last) < SAME_POWER)
    return steep


def vanishing(f: Formulas, table: Mapping[str, float]) -> tuple[str, float]:
    """The factor of a denominator that is nearest to 0, by name, and its value."""
    values = [(item.text, real_value(item.formula, table)) for item in f.denominators]
    values = [(text, value) for text, value in values if math.isfinite(value)]
    return min(values, key=lambda item: abs(item[1])) if values else ("dL/dv", math.nan)


def _on_discrete_constraint(
    f: Formulas, choice: MethodChoice, start: Start, step: float, parameters: Mapping[str, float]
) -> Initial:
    """p_0 = -D1 L_d(q_0, q_1) with q_1 = q_0 + h v and v on the discrete constraint."""
    parts = [float(part.subs({"a": choice.alpha})) for part in parts_of(choice)]
    q = [float(x) for x in start.positions]
    v = _discrete_velocities(f, q, list(start.velocities or ()), parts, step, parameters)
    total = [0.0] * f.size
    table: Numbers = {}
    for part in parts:
        place = _named("q", [x + part * step * y for x, y in zip(q, v, strict=True)])
        table = {**parameters, **place, **_named("v", v)}
        for k, (impulse, force) in enumerate(_discrete_slopes(f, choice, table, len(parts) == 1)):
            total[k] += (impulse - (1 - part) * step * force) / len(parts)
    return _checked(f, choice, _named("q", q), total, v, table)


def _discrete_velocities(
    f: Formulas, q: list[float], v: list[float], parts: Sequence[float], step: float, parameters: Mapping[str, float]
) -> list[float]:
    """Dependent velocities from the mean discrete constraint; a few sweeps where they enter it themselves."""
    for _ in range(50):
        old = list(v)
        for k, formula in f.dependent.items():
            values = []
            for part in parts:
                place = _named("q", [x + part * step * y for x, y in zip(q, v, strict=True)])
                values.append(real_value(formula, {**parameters, **place, **_named("v", v)}))
            v[k] = sum(values) / len(values)
        if all(abs(a - b) <= 1e-15 * abs(a) for a, b in zip(v, old, strict=True)):
            break
    return v


def _discrete_slopes(
    f: Formulas, choice: MethodChoice, table: Mapping[str, float], on_constraint: bool
) -> list[tuple[float, float]]:
    """(L_v, L_q) for each coordinate at a discrete point; factors cancelled where the point is on the constraint."""
    lagrangian = f.lagrangian if choice.method == "nonholonomic" else f.free_lagrangian
    velocities = f.symbols("v")
    given = {velocities[k]: value for k, value in f.dependent.items()}
    if choice.method == "nonholonomic" or not on_constraint:
        given = {}
    slopes = []
    for q, v in zip(f.symbols("q"), velocities, strict=True):
        impulse, force = (lagrangian.diff(name).subs(given) for name in (v, q))
        slopes.append((real_value(impulse, table), real_value(force, table)))
    pushes = [real_value(force, table) for force in f.forces] or [0.0] * f.size
    return [(impulse, force + push) for (impulse, force), push in zip(slopes, pushes, strict=True)]


def refusal(
    f: Formulas, choice: MethodChoice, begin: Initial, grid: Grid, parameters: Mapping[str, float]
) -> Outcome | None:
    """A "guard" outcome at step 0 where h max|G'| reaches 1 on the way, else None. `parameters` by kernel name."""
    if not choice.guard or choice.method != "variational" or f.problem.free_hamiltonian is None or not grid.steps:
        return None
    if f.depends_on_time:  # what it is on the way is not known beforehand
        return None
    place = f.moving_alone
    if place is None or f"d{place}" not in begin.rates:
        return None
    name = f.problem.coordinates[place]
    first, rate = begin.state[f"q{place}"], begin.rates[f"d{place}"]
    whole = rate * grid.step * grid.steps
    near = np.sign(whole) * min(abs(whole), _NEAR)
    way = np.concatenate([np.linspace(first, first + reach, _SAMPLES) for reach in (near, whole)])
    with np.errstate(all="ignore"):
        slopes = np.abs(f.slope_on_way({**parameters, **begin.state}, way))
    worst = float(slopes[np.isfinite(slopes)].max(initial=0.0))
    if abs(grid.step) * worst < LIMIT:
        return None
    remedy = f"{GUARD_REMEDY}; |step| must be well below {1.0 / worst:.3g}"
    return Outcome("guard", 0, grid.begin, f"h*max|d2H/d{name} dp_{name}|", abs(grid.step) * worst, remedy)
