"""Trajectories of a problem by a method: `run`, one, and `run_ensemble`, many in parallel SIMD lanes on all cores, are
the only entry points to the integrators.

    check, `initial`      the choice, and the state to begin with: from velocities or momenta, at a point or on the
                          discrete constraint
    kernel_of, execute    the compiled step, run piece by piece: bounded memory, and a way to stop
    trajectory_of         the result of the kernel, with a typed outcome: the vanishing formula in the user's names

Zeros of the denominators of L~ just ahead of where a run stopped are its cause where the formulas have a pole there.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
import symengine
from numpy.typing import NDArray

from inverse_service import settings
from inverse_service.errors import InputError
from inverse_service.integrators import method_table
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.kernels.codegen import program as programs
from inverse_service.kernels.codegen.compiled import Card, Compiled, compiled
from inverse_service.kernels.codegen.kernel import CONTROL, MOST_TRIES
from inverse_service.kernels.codegen.symengine_trees import ZERO, Formula, closure, real_value
from inverse_service.kernels.machine_code.loading import processor_features
from inverse_service.simulation import peers, schemes
from inverse_service.simulation.numeric_formulas import MOMENT, Formulas, formulas_of
from inverse_service.simulation.scene_data import Grid, MethodChoice, Observable, Observation, Problem, Start, Stop

__all__ = ["Grid", "MethodChoice", "Observable", "Observation", "Problem", "Start", "run"]
NO_GUARD = "The guard was off, so it was not checked that each step took the root that belongs to small steps."
_FIRST_PIECE = 4096
FEW, MANY, BEGINNING = 16, 1.3, 4  # points of a grid; steps for each of them; steps that grow to a usual length
_FIRST_OWN = 8  # of a method that takes any number of steps between two points
_SECONDS_PER_PIECE = 0.1
_REMEDY = "take a smaller step"
_UNDEFINED = "begin elsewhere, stop before, or leave the quantity out of observe"
_NO_VALUE = "take a smaller step; where a formula has no value, stop before"
_ENDS = "stop before"
_FASTER = "take a smaller step or a larger tolerance; where something decays fast, `stiff`"
_KINDS = {"bound": "guard", "map": "off_domain", "domain": "off_domain"}
# Newton that fails after the determinant has sunk below this part of its first value fails because of that.
NEARLY_SINGULAR = 0.25
# At this distance a pole affects the guard or Newton's method; the path to it is nearly straight.
STEPS_AHEAD, BISECTIONS, LARGE = 20, 30, 1e4
Numbers = dict[str, float]
OFF_CONSTRAINTS = 1e-9
# Distances at which a power of the distance is read off, their ratio in decades, and what counts as a power below 1: in
# doubles a smooth force shows 1, a jump 0, and round-off two powers that differ.
NEARER, NEARER_BY = (1e-4, 1e-7, 1e-10), 3
FLAT, STRAIGHT, SAME_POWER = 0.02, 0.97, 0.02
LATER = 1e-3
BY_SLOPES = ("stiff",)
BEGIN_ELSEWHERE = "begin elsewhere, or at another start_time"
WORTH_THREADS = 2_000  # steps of groups that take as long as starting a thread
STEPS_AT_ONCE = 100_000  # steps of groups between two checks for a request to stop
ALL_METHODS = "Ensembles are run by methods that step with kernels: variational, nonholonomic, runge-kutta, and so on."


def check(problem: Problem, choice: MethodChoice) -> None:
    """Raise InputError for a choice that the problem does not allow."""
    if choice.method in method_table.GEOMETRIC and choice.order > 2 and choice.alpha != 0.5 and not choice.symmetrised:
        raise InputError("A composition needs a symmetric step: alpha = 1/2, or symmetrised.")
    if choice.symmetrised and choice.alpha != 0.5 and choice.form != "verlet" and problem.depends_on_time:
        raise InputError("Symmetrised steps require a system without t: take alpha = 1/2, which also has order 2.")


def numbers_of(choice: MethodChoice, begin: Initial, grid: Grid, parameters: Mapping[str, float]) -> dict[str, float]:
    """State, rates and arguments of one trajectory by the names of the kernel."""
    rates = {f"{name}_rate": value for name, value in begin.rates.items()}
    return {**begin.state, **rates, str(MOMENT): grid.begin, "h": grid.step, "a": _setting(choice), **parameters}


def _setting(choice: MethodChoice) -> float:
    return choice.tolerance if choice.method in method_table.OWN_STEPS else choice.alpha


def kernel_of(formulas: Formulas, choice: MethodChoice, observation: Observation, lanes: int = 1) -> Compiled:
    """The compiled step of the method, made only once for all values of h, alpha, parameters and weights."""
    order = choice.order if choice.method in ("runge_kutta", "adaptive") else 0
    identity = (
        formulas.problem, choice.method, choice.form, order, tuple(map(str, schemes.parts_of(choice))),
        str(schemes.alpha_of(choice)), choice.guard, observation,
    )  # fmt: skip
    return compiled(identity, lambda: schemes.program_of(formulas, choice, observation), lanes)


def run(
    problem: Problem,
    choice: MethodChoice,
    start: Start,
    grid: Grid,
    values: Mapping[str, float],
    observation: Observation = (),
    stop: Stop | None = None,
) -> Trajectory:
    """One trajectory; `values` gives every parameter (free constants too) a number.

    If the method cannot continue, the outcome says so and the rows up to there are kept. InputError for a choice
    that the problem does not allow. `stop` is asked about ten times a second; True ends the run as "cancelled".
    """
    check(problem, choice)
    if choice.method == "heyoka":
        return peers.run_heyoka(problem, start, grid, values, observation, choice.tolerance, stop)
    if choice.method in method_table.SCIPY:
        return peers.run_scipy(problem, choice, start, grid, values, stop)
    ready = prepared(problem, choice, start, grid, values, observation)
    if isinstance(ready, Trajectory):
        return ready
    found = trajectory_of(Ended(ready.formulas, choice, ready.kernel, ready.go(grid, stop), ready.begin, grid))
    return found if choice.guard else replace(found, outcome=replace(found.outcome, note=NO_GUARD))


@dataclass(frozen=True, slots=True)
class Prepared:
    """A run of a kernel that has everything but the number of its steps."""

    formulas: Formulas
    choice: MethodChoice
    kernel: Compiled
    begin: Initial
    parameters: Mapping[str, float]

    def go(self, grid: Grid, stop: Stop | None = None) -> Run:
        """All steps of the grid, from the start."""
        memory = memory_of(self.kernel.card, numbers_of(self.choice, self.begin, grid, self.parameters))
        return execute(self.kernel, memory.ravel(), weights_of(self.choice), grid, stop)


def prepared(
    problem: Problem, choice: MethodChoice, start: Start, grid: Grid, values: Mapping[str, float],
    observation: Observation,
) -> Prepared | Trajectory:  # fmt: skip
    """The run made ready, or the start alone where it cannot begin."""
    formulas = formulas_of(problem)
    parameters = {f"c{place}": float(values[name]) for place, name in enumerate(problem.parameters)}
    begin = initial(formulas, choice, start, grid.step, parameters | {str(MOMENT): grid.begin})
    if begin.missing:
        return Trajectory.of_start(grid.begin, start.positions, None, begin.missing)
    found = Prepared(formulas, choice, kernel_of(formulas, choice, observation), begin, parameters)
    if choice.method != "adaptive" or formulas.depends_on_velocities or not _takes_many(found, grid):
        return found
    highest = replace(choice, order=method_table.PAIRS[-1])
    return replace(found, choice=highest, kernel=kernel_of(formulas, highest, observation))


def _takes_many(ready: Prepared, grid: Grid) -> bool:
    """Whether a method that chooses its steps tries more than MANY of them from one point of the grid to the next; the
    first ones show it, where they are a small part of all."""
    steps = min(_FIRST_OWN, grid.steps // FEW)
    return not steps or ready.go(replace(grid, steps=steps)).iterations > BEGINNING + MANY * steps


@dataclass(frozen=True, slots=True)
class Run:
    """The result of a kernel: `rows` (recorded, columns), `memory` (places,) after the last good step."""

    rows: Array
    steps_at: NDArray[np.int64]
    memory: Array
    iterations: int
    seconds: float
    cancelled: bool
    done: int


def memory_of(card: Card, numbers: Mapping[str, float | Array], count: int = 1) -> Array:
    """(groups, places, lanes): the numbers of `count` runs, each one or (count,), where the kernel looks for them.

    Unused lanes repeat the last run. A run with a number that is not finite does not start.
    """
    layout, lanes = card.layout, card.lanes
    rows = np.minimum(np.arange(-(-count // lanes) * lanes), count - 1)
    memory = np.zeros((len(rows) // lanes, layout.size, lanes))
    for place, name in enumerate((*layout.persistent, *layout.arguments)):
        if name in numbers:
            memory[:, place] = np.broadcast_to(numbers[name], count)[rows].reshape(-1, lanes)
    memory[:, layout.place(programs.STOPPED_AT)] = -1.0
    lost = ~np.isfinite(memory).all(axis=1)
    for name, value in programs.NOT_STARTED.items():
        memory[:, layout.place(name)][lost] = value
    return memory


def execute(
    kernel: Compiled, memory: Array, weights: Sequence[float], grid: Grid, stop: Callable[[], bool] | None = None
) -> Run:
    """All steps of the grid; `memory` is changed."""
    columns = len(kernel.card.layout.columns)
    every = max(1, min(grid.record_every, grid.steps or 1))
    substeps = np.array(weights, dtype=np.float64)
    pieces: list[Array] = []
    steps_at: list[int] = []
    done = iterations = 0
    seconds, cancelled = 0.0, False
    least = _FIRST_OWN if programs.TRIAL in kernel.card.layout.persistent else _FIRST_PIECE
    piece = least
    until = every
    while done < grid.steps and not cancelled:
        todo, until = _portion(piece, grid.steps - done, until)
        last = done + todo == grid.steps
        control = np.array([todo, len(substeps), every, until, 0, 0, 0], dtype=np.int64)
        record = np.empty((todo // every + 2, columns))
        addresses = [array.ctypes.data for array in (memory, substeps, control, record)]
        begin = time.perf_counter()
        kernel.machine.call(*addresses)
        passed = time.perf_counter() - begin
        state = dict(zip(CONTROL, (int(x) for x in control), strict=True))
        pieces.append(record[: state["rows"]].copy() if state["rows"] < len(record) else record)
        steps_at += [done + until + k * every for k in range(state["rows"])]
        until, done, iterations = state["until_record"], done + state["done"], iterations + state["iterations"]
        seconds += passed
        if state["done"] < todo or last:
            break
        piece = max(least, min(4 * piece, int(piece * _SECONDS_PER_PIECE / max(passed, 1e-6))))
        cancelled = bool(stop and stop())
    rows = np.concatenate(pieces) if pieces else np.empty((0, columns))
    return Run(rows, np.array(steps_at, dtype=np.int64), memory, iterations, seconds, cancelled, done)


def _portion(piece: int, left: int, until: int) -> tuple[int, int]:
    """(steps to do now, steps to the next record): the last step is always recorded."""
    if left == 1:
        return 1, 1
    return min(piece, left - 1), until


def stopped(card: Card, memory: Array, unknown_names: Mapping[str, str], grid: Grid) -> Outcome | None:
    """The meaning of the status in the memory (places,); None if the run reached the end."""
    layout = card.layout
    code = int(memory[layout.place(programs.STATUS)])
    if code == 0:
        return None
    step = int(memory[layout.place(programs.STOPPED_AT)])
    value = float(memory[layout.place(programs.STOPPED_VALUE)])

    def ends(kind: str, quantity: str, value: float, remedy: str) -> Outcome:
        return Outcome(kind, step, grid.begin + step * grid.step, quantity, value, remedy)

    if code >= programs.UNOBSERVABLE:
        quantity = f"{card.observed[code - programs.UNOBSERVABLE]}, which has no finite value"
        return ends("off_domain", quantity, value, _UNDEFINED)
    if code >= programs.WATCHED:
        kind, quantity, remedy = card.watches[code - programs.WATCHED]
        value = abs(value) if kind == "bound" else value
        return ends(_KINDS.get(kind, "singular"), quantity, value, remedy)
    if code >= programs.GUARDED:
        quantity = f"1 - det/det(h -> 0): {_determinant(card, code - programs.GUARDED, unknown_names)}"
        return ends("guard", quantity, value, _REMEDY)
    if code >= programs.SINGULAR:
        return ends("singular", _determinant(card, code - programs.SINGULAR, unknown_names), value, _REMEDY)
    if code >= programs.NO_CONVERGENCE:
        place = code - programs.NO_CONVERGENCE
        quantity = _determinant(card, place, unknown_names)
        if place < len(card.solves):
            first, last = (float(memory[layout.place(f"{which}_{place}")]) for which in ("first", "last"))
            if abs(last) < NEARLY_SINGULAR * abs(first):
                return ends("singular", quantity, last, _REMEDY)
        remedy = _NO_VALUE if math.isnan(value) else _REMEDY
        return ends("no_convergence", quantity, value if place < len(card.solves) else math.nan, remedy)
    if code == programs.NO_START:
        step = 0
        return ends("off_domain", "the state at the start, which has no finite value", value, _UNDEFINED)
    if code == programs.TOO_MANY:
        quantity = f"the step chosen by the method: {MOST_TRIES} such steps do not reach the next point"
        return ends("unresolved", quantity, value, _FASTER)
    if code == programs.TOO_SHORT:
        return ends("singular", "a step within the tolerance", value, _ENDS)
    assert code == programs.NOT_FINITE
    return ends("not_finite", "a coordinate or momentum", math.nan, _REMEDY)


def _determinant(card: Card, place: int, unknown_names: Mapping[str, str]) -> str:
    if place >= len(card.solves):
        return "the stage equations, whose iteration does not converge"
    names = ", ".join(unknown_names.get(name, name) for name in card.solves[place])
    return f"determinant of the discrete equations for {names}"


@dataclass(frozen=True)
class Ended:
    """A run of a kernel from `begin` to the point that it reached."""

    f: Formulas
    choice: MethodChoice
    kernel: Compiled
    run: Run
    begin: Initial
    grid: Grid

    @property
    def card(self) -> Card:
        return self.kernel.card

    @cached_property
    def halt(self) -> Outcome | None:
        """The reason for stopping; None if the run reached the end."""
        return stopped(self.card, self.run.memory, unknown_names(self.f), self.grid)

    @property
    def done(self) -> int:
        """The number of steps made."""
        return self.run.done if self.halt is None else self.halt.step or 0

    @cached_property
    def last(self) -> dict[str, float]:
        """State variables and rates after the last good step."""
        return {name: float(self.run.memory[place]) for place, name in enumerate(self.card.layout.persistent)}

    @cached_property
    def parameters(self) -> dict[str, float]:
        """The arguments of the kernel but h."""
        layout = self.card.layout
        return {name: float(self.run.memory[layout.argument_place(name)]) for name in layout.arguments if name != "h"}


def trajectory_of(ended: Ended) -> Trajectory:
    """The run as a trajectory."""
    card, run, begin, grid = ended.card, ended.run, ended.begin, ended.grid
    kept = run.steps_at <= ended.done
    columns = {name: run.rows[kept, place] for place, name in enumerate(card.layout.columns)}
    size = ended.f.size
    letter = "v" if ended.choice.method in method_table.POINT_METHODS else "p"
    carried = _with_start(columns, begin, [f"{letter}{k}" for k in range(size)])
    taken = int(run.memory[card.layout.place("clock")]) if ended.halt is None else ended.done
    return Trajectory(
        times=grid.begin + np.concatenate([[0.0], run.steps_at[kept] * grid.step]),
        positions=_with_start(columns, begin, [f"q{k}" for k in range(size)]),
        momenta=carried if letter == "p" and not np.isnan(carried).any() else None,
        velocities=carried if letter == "v" else None,
        outcome=_outcome(ended),
        force_evaluations=_evaluations(ended.choice, card, taken, run.iterations),
        newton_iterations=0 if ended.choice.method in method_table.OWN_STEPS else run.iterations,
        compile_seconds=sum(ended.kernel.seconds.values()),
        run_seconds=run.seconds,
        series={name: _headed(columns[f"observed_{k}"]) for k, name in enumerate(card.observed)},
        maxima={name: float(run.memory[card.layout.place(f"maximum_{k}")]) for k, name in enumerate(card.observed)},
    )


def weights_of(choice: MethodChoice) -> tuple[float, ...]:
    return method_table.composition(choice.order) if choice.method in method_table.GEOMETRIC else (1.0,)


def _evaluations(choice: MethodChoice, card: Card, taken: int, iterations: int) -> int:
    """Of forces: in every trial step where the method chooses its own, else in every substep and iteration."""
    if choice.method in method_table.OWN_STEPS:
        return card.forces * iterations
    return card.forces * taken * len(weights_of(choice)) + iterations * (6 if choice.method == "reference" else 1)


def _with_start(columns: dict[str, Array], begin: Initial, names: list[str]) -> Array:
    """Recorded values after the start; constant values are repeated, and missing ones are NaN."""
    rows = len(next(iter(columns.values()))) if columns else 0
    table = np.empty((rows + 1, len(names)))
    for k, name in enumerate(names):
        table[0, k] = begin.state.get(name, math.nan)
        table[1:, k] = columns.get(name, table[0, k])
    return table


def _headed(values: Array) -> Array:
    """Repeat the first value in front, because no step leads to the start."""
    return np.concatenate([values[:1] if len(values) else [math.nan], values])


def unknown_names(f: Formulas) -> dict[str, str]:
    """The unknowns of the kernels in the user's names."""
    letters = {"d": "the step of {}", "e": "the change of p_{}", "g": "the change of p_{}"}
    names = {
        f"{letter}{k}": text.format(name)
        for letter, text in letters.items()
        for k, name in enumerate(f.problem.coordinates)
    }
    return names | {f"m{k}": f"multiplier {k + 1}" for k in range(len(f.problem.constraints))}


def _outcome(ended: Ended) -> Outcome:
    f, choice, halt, grid = ended.f, ended.choice, ended.halt, ended.grid
    if halt is None:
        kind = "cancelled" if ended.run.cancelled and ended.run.done < grid.steps else "completed"
        return Outcome(kind, ended.run.done, grid.begin + ended.run.done * grid.step)
    if choice.method == "modified" and halt.kind == "singular" and len(schemes.parts_of(choice)) == 1:
        # It has its own singular set: it is smooth through the zeros of A_alpha, even if other factors vanish nearby.
        return replace(halt, remedy=_remedy(f, choice))
    if halt.kind in ("no_convergence", "not_finite", "singular") and (cause := _vanished(ended)):
        return replace(halt, kind="singular", quantity=cause[0], value=cause[1], remedy=_remedy(f, choice))
    if cause := _pole(ended):
        return replace(halt, kind="singular", quantity=cause[0], value=cause[1], remedy=schemes.where_it_ends(f))
    if halt.kind == "guard" and halt.value:
        # The determinant differs from its limit by h^2 at alpha = 1/2, other guards are proportional to h.
        excess = math.sqrt(halt.value) if (halt.quantity or "").startswith("1 - det") else abs(halt.value)
        passes = f"|step| below {abs(grid.step) / excess:.3g} passes here; guard = false continues unchecked"
        return replace(halt, remedy=f"{halt.remedy}; {passes}")
    return halt


def _way(ended: Ended) -> Callable[[float], dict[str, float]]:
    """The straight path from the last good point: (q, v, p) this many steps after it."""
    last, start, step = ended.last, ended.begin.state, ended.grid.step
    passed = last[programs.CLOCK] * step
    means = [(last[f"q{k}"] - start[f"q{k}"]) / passed if passed else 0.0 for k in range(ended.f.size)]
    # A rate of 0 is that of the step that failed; the mean one says where the way led.
    rates = [last.get(f"d{k}_rate", 0.0) or mean for k, mean in enumerate(means)]
    table = {**start, **last, **ended.parameters, **{f"v{k}": rate for k, rate in enumerate(rates)}}
    return lambda part: table | {f"q{k}": last[f"q{k}"] + part * step * rate for k, rate in enumerate(rates)}


def _pole(ended: Ended) -> tuple[str, float] | None:
    """(text, value now) of the first denominator of L~ that passes 0 just ahead, where dH~/dq has a pole: guard and
    Newton fail because of it. Those that H~ is smooth through, as cos(phi) of the disk, do not count."""
    f = ended.f
    if ended.choice.method != "variational" or not (f.problem.free_hamiltonian and f.problem.free_lagrangian):
        return None
    at, slopes = _way(ended), [f.hamiltonian.diff(q) for q in f.symbols("q")]
    for item in f.denominators:
        now = real_value(item.formula, at(0.0))
        first = next((k for k in range(STEPS_AHEAD) if now * real_value(item.formula, at(k + 1.0)) <= 0), None)
        if first is None:
            continue
        low, high = float(first), first + 1.0
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            passed = now * real_value(item.formula, at(middle)) <= 0
            low, high = (low, middle) if passed else (middle, high)
        here, there = (max(abs(real_value(slope, at(part))) for slope in slopes) for part in (0.0, low))
        if not math.isfinite(there) or there > LARGE * (1.0 + here):
            return item.text, now
    return None


def _vanished(ended: Ended) -> tuple[str, float] | None:
    """The factor of L~'s denominators that passes 0 about the step that failed, with its value before it: from a step
    before the last good point to a step and a half after it."""
    choice, at = ended.choice, _way(ended)
    if choice.method not in ("variational", "modified"):
        return None
    raw = choice.method == "modified" or choice.form == "raw" or _has_two_places(choice)
    for item in ended.f.denominators:
        values = [real_value(item.formula, at(part)) for part in (-1.0, 0.0, 1.5)]
        passes = not min(values) * max(values) > 0 or abs(values[-1]) < 1e-3 * abs(values[1])
        if (raw or item.moves) and passes:
            return item.text, values[1]
    return None


def _has_two_places(choice: MethodChoice) -> bool:
    """Whether the Lagrangian is taken at two places of a step."""
    return choice.form != "verlet" and len(schemes.parts_of(choice)) == 2


def _remedy(f: Formulas, choice: MethodChoice) -> str:
    if _has_two_places(choice):
        return "leave out `symmetrised`, whose two points lie on different sides there; alpha = 1/2 also has order 2"
    if choice.method == "variational" and choice.form == "raw":
        return "use the Hamiltonian form, which is smooth there"
    if choice.method == "modified":
        names = ", ".join(f.problem.free_constants)
        constants = f"free constants {names}" if names else "free constants of L~"
        return f"choose smaller {constants}, another alpha, or the variational method in Hamiltonian form"
    return schemes.where_it_ends(f)


@dataclass(frozen=True, slots=True)
class Initial:
    """Values of state variables and first guesses of the unknowns' rates.

    `missing` is the outcome where a momentum has no value, so that the run cannot begin.
    """

    state: Numbers
    rates: Numbers = field(default_factory=dict)
    missing: Outcome | None = None


def initial(f: Formulas, choice: MethodChoice, start: Start, step: float, parameters: Mapping[str, float]) -> Initial:
    """State of the kernel at its start time, which is one of the parameters (0 if it is not)."""
    parameters = {str(MOMENT): 0.0, **parameters}
    q = _named("q", start.positions)
    if choice.method in method_table.POINT_METHODS:
        state = {**q, **_named("v", start.velocities)}
        at = (*parameters.items(), *state.items())
        return Initial(state, missing=no_one_motion(f, choice.method in BY_SLOPES, at))
    if start.convention == "discrete_constraint":
        if choice.order > 2:
            raise InputError("A composition starts from momenta: the discrete constraint is that of the plain step.")
        return _on_discrete_constraint(f, choice, start, step, parameters)
    if start.momenta is not None and choice.method != "modified":
        return Initial({**q, **_named("p", start.momenta)}, _named("d", start.velocities))
    return _at_point(f, choice, q, list(start.velocities), parameters)


def _named(letter: str, values: Sequence[float]) -> Numbers:
    return {f"{letter}{k}": float(value) for k, value in enumerate(values)}


def _at_point(
    f: Formulas, choice: MethodChoice, q: Numbers, velocities: list[float], parameters: Mapping[str, float]
) -> Initial:
    table = {**parameters, **q, **_named("v", velocities)}
    return _checked(f, choice, q, _momenta(f, choice, table), velocities, table)


def _momenta(f: Formulas, choice: MethodChoice, table: Mapping[str, float]) -> list[float]:
    """dL/dv; of L~ with the constraints put in where they hold, so that common factors A_alpha cancel."""
    velocities = f.symbols("v")
    if choice.method == "nonholonomic":
        return f.values([f.lagrangian.diff(v) for v in velocities], table)
    if not f.forms or not _holds(f, table):
        return f.values([f.free_lagrangian.diff(v) for v in velocities], table)
    given = {velocities[k]: value for k, value in f.dependent.items()}
    return f.values([f.free_lagrangian.diff(v).subs(given) for v in velocities], table)


def _holds(f: Formulas, table: Mapping[str, float]) -> bool:
    """Whether the velocities satisfy the constraints, to round-off."""
    size = max((abs(table[f"v{k}"]) for k in range(f.size)), default=0.0)
    values = f.values([_along(row, f.symbols("v")) + c for row, c in zip(f.forms, f.drifts, strict=True)], table)
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
    """The outcome if a force has no value at the start, where no step would notice this or no step succeeds."""
    for name, formula in zip(f.problem.coordinates, forces, strict=False):
        if not math.isfinite(real_value(formula, table)) or _divides_by_zero(formula, table):
            begin = table[str(MOMENT)]
            quantity = f"the force on {name} at the start, t = {begin:.12g}, which has no value"
            return Outcome("off_domain", 0, begin, quantity, None, BEGIN_ELSEWHERE)
    return None


def _divides_by_zero(formula: Formula, table: Mapping[str, float]) -> bool:
    """Whether it divides by 0 there, or takes the logarithm of 0: in doubles atan(v/x) has a value at x = 0."""
    powers = formula.atoms(symengine.Pow)
    divided = [power.args[0] for power in powers if power.args[1].is_Number and power.args[1].is_negative]
    divided += [logarithm.args[0] for logarithm in formula.atoms(symengine.log)]
    return any(real_value(base, table) == 0 for base in divided)


@lru_cache(maxsize=64)
def no_one_motion(f: Formulas, by_slopes: bool, at: tuple[tuple[str, float], ...]) -> Outcome | None:
    """The outcome where an acceleration has no value at the start, or is no Lipschitz function there.

    x'' = sqrt(x) has the motions x = 0 and x = (t - s)^4/144 for t > s, one for each s, from x = x' = 0. Where the
    motion leaves such a place at once it is the only one, but a method that solves by slopes may take another.
    """
    table = dict(at)
    undefined = undefined_force(f, f.accelerations, table)
    if undefined is not None or not f.walls_of(f.problem.accelerations or ()):
        return undefined
    steep = _steep(f, table)
    if any(steep) and not by_slopes:
        steep &= _steep(f, _a_little_later(f, table))
    for name, is_steep in zip(f.problem.coordinates, steep, strict=True):
        if is_steep:
            quantity = f"the force on {name}: its slope is infinite at the start, where more than one motion may begin"
            return Outcome("singular", 0, table[str(MOMENT)], quantity, None, "begin next to it")
    return None


def _a_little_later(f: Formulas, table: Mapping[str, float]) -> Numbers:
    """q + v s + f s^2/2 and v + f s."""
    moved = dict(table)
    for k, force in enumerate(f.values(f.accelerations, table)):
        moved[f"q{k}"] += LATER * (table[f"v{k}"] + LATER * force / 2)
        moved[f"v{k}"] += LATER * force
    return moved


def _steep(f: Formulas, table: Mapping[str, float]) -> NDArray[np.bool_]:
    """Of each force, whether it changes as a power below 1 of the distance: along q_k, v_k or oblique to them all."""
    names = [f"{letter}{k}" for letter in "qv" for k in range(f.size)]
    oblique = np.random.default_rng(0).normal(size=(4, len(names)))
    steep = np.zeros(f.size, dtype=bool)
    for way in (*np.eye(len(names)), *-np.eye(len(names)), *oblique):
        places = [dict(zip(names, size * way, strict=True)) for size in (0.0, *NEARER)]
        values = np.array(
            [f.values(f.accelerations, {**table} | {x: table[x] + place[x] for x in names}) for place in places]
        )
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
    parts = [float(part.subs({"a": choice.alpha})) for part in schemes.parts_of(choice)]
    q = [float(x) for x in start.positions]
    v = _discrete_velocities(f, q, list(start.velocities), parts, step, parameters)
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


@dataclass(frozen=True)
class Many:
    """The recorded points of N trajectories: `times` (m,), `positions` and `rates` (N, m, n), nan after a run's end.

    `rates` are the momenta p or velocities v of the method, as `carried` says; `memory` (places, N) is the final
    kernel memory of each.
    """

    times: Array
    positions: Array
    rates: Array
    carried: str
    card: Card
    memory: Array
    grid: Grid
    names: Mapping[str, str]
    cancelled: bool
    iterations: int

    @cached_property
    def completed(self) -> NDArray[np.bool_]:
        """Which trajectories reached the end, (N,)."""
        found: NDArray[np.bool_] = self.memory[self.card.layout.place(programs.STATUS)] == 0
        return found & (not self.cancelled)

    def outcome(self, member: int) -> Outcome:
        """The outcome of one trajectory."""
        kind = "cancelled" if self.cancelled else "completed"
        whole = Outcome(kind, self.grid.steps, float(self.times[-1]))
        return stopped(self.card, self.memory[:, member], self.names, self.grid) or whole


def lanes_here() -> int:
    """The number of doubles that a core processes at once."""
    return 8 if "+avx512f" in processor_features() else 4


def run_ensemble(
    problem: Problem,
    choice: MethodChoice,
    positions: Array,
    velocities: Array,
    grid: Grid,
    values: Mapping[str, float | Array],
    momenta: Array | None = None,
    steps: Array | None = None,
    stop: Stop | None = None,
    begins: Array | None = None,
) -> Many:
    """N trajectories from `positions` and `velocities` (N, n), or `momenta` where they are known.

    `values` gives each parameter a number or (N,) numbers; `steps` (N,) are individual steps that replace that of
    the grid, `begins` individual start times. InputError for input that a single run would refuse.
    """
    check(problem, choice)
    if choice.method in ("heyoka", "modified"):
        raise InputError(ALL_METHODS)
    f = Formulas(problem)
    kernel = kernel_of(f, choice, (), lanes_here())
    count, span = len(positions), range(f.size)
    columns: dict[str, float | Array] = {f"c{place}": values[name] for place, name in enumerate(problem.parameters)}
    columns |= {"h": grid.step if steps is None else steps, "a": _setting(choice)}
    columns[str(MOMENT)] = grid.begin if begins is None else begins
    columns |= {f"q{k}": positions[:, k] for k in span} | {f"v{k}": velocities[:, k] for k in span}
    if choice.method not in method_table.POINT_METHODS:
        start = _start_momenta(f, choice, columns) if momenta is None else momenta
        columns |= {f"p{k}": start[:, k] for k in span} | {f"d{k}_rate": velocities[:, k] for k in span}
    memory = memory_of(kernel.card, columns, count)
    record, iterations, cancelled = _run_groups(kernel, memory, weights_of(choice), grid, stop)
    flat = np.moveaxis(memory, 1, 0).reshape(memory.shape[1], -1)[:, :count]
    rows = np.moveaxis(record, (1, 2), (0, 1)).reshape(record.shape[1], record.shape[2], -1)[:, :, :count]
    return _together(f, choice, kernel.card, columns, rows, flat, grid, cancelled, iterations)


def _start_momenta(f: Formulas, choice: MethodChoice, columns: Mapping[str, float | Array]) -> Array:
    """dL/dv of the Lagrangian that the method discretizes, (N, n)."""
    velocities = f.symbols("v")
    lagrangian = f.lagrangian if choice.method == "nonholonomic" else f.free_lagrangian
    given = {velocities[k]: value for k, value in f.dependent.items()} if choice.method != "nonholonomic" else {}
    names = [*(str(name) for letter in "qv" for name in f.symbols(letter)), *f.parameters, str(MOMENT)]
    function = closure(names, [lagrangian.diff(v).subs(given) for v in velocities])
    with np.errstate(all="ignore"):
        found = function(np.stack(np.broadcast_arrays(*(columns[name] for name in names)), axis=1))
    return np.asarray(found, dtype=float).reshape(-1, f.size)


def _run_groups(
    kernel: Compiled, memory: Array, weights: tuple[float, ...], grid: Grid, stop: Stop | None
) -> tuple[Array, int, bool]:
    """Records (groups, rows, columns, lanes), iterations, and whether the run was stopped before its end."""
    every = max(1, min(grid.record_every, grid.steps))
    whole, rest = divmod(grid.steps, every)
    width = (len(kernel.card.layout.columns), kernel.card.lanes)
    record = np.full((len(memory), whole + bool(rest), *width), np.nan)
    substeps = np.array(weights, dtype=np.float64)

    control = np.zeros((2, len(memory), len(CONTROL)), dtype=np.int64)
    control[0, :, :4] = whole * every, len(substeps), every, every
    control[1, :, :4] = rest, len(substeps), every, rest
    at_once = max(1, STEPS_AT_ONCE // max(1, grid.steps * len(substeps)))

    def call(part: NDArray[np.int64]) -> bool:
        for groups in (slice(k, k + at_once) for k in range(part[0], part[-1] + 1, at_once)):
            if stop is not None and stop():
                return False
            groups = slice(groups.start, min(groups.stop, int(part[-1]) + 1))
            kernel.machine.call_groups(memory[groups], substeps, control[0, groups], record[groups])
            if rest:
                kernel.machine.call_groups(memory[groups], substeps, control[1, groups], record[groups, whole:])
        return True

    parts = [part for part in np.array_split(np.arange(len(memory)), settings.cores()) if len(part)]
    if len(memory) * grid.steps * len(substeps) < WORTH_THREADS:
        ran = list(map(call, parts))
    else:
        with ThreadPoolExecutor(settings.cores()) as pool:
            ran = list(pool.map(call, parts))
    return record, int(control[:, :, CONTROL.index("iterations")].sum()), not all(ran)


def _together(
    f: Formulas, choice: MethodChoice, card: Card, columns: Mapping[str, float | Array], rows: Array, memory: Array,
    grid: Grid, cancelled: bool, iterations: int,
) -> Many:  # fmt: skip
    """Records by member, beginning with the start; constant values are repeated."""
    letter = "v" if choice.method in method_table.POINT_METHODS else "p"
    places = {name: k for k, name in enumerate(card.layout.columns)}
    tables = []
    for kind in ("q", letter):
        table = np.empty((memory.shape[1], len(rows) + 1, f.size))
        for k in range(f.size):
            table[:, :, k] = np.reshape(columns[f"{kind}{k}"], (-1, 1))  # a value that is constant is not recorded
            if (place := places.get(f"{kind}{k}")) is not None:
                table[:, 1:, k] = rows[:, place].T
        tables.append(table)
    status, stopped_at = (memory[card.layout.place(name)] for name in (programs.STATUS, programs.STOPPED_AT))
    ended = (status[:, None] != 0) & (grid.recorded[None, :] > stopped_at[:, None])
    for table in tables:
        table[ended] = np.nan
    return Many(grid.times, tables[0], tables[1], letter, card, memory, grid, unknown_names(f), cancelled, iterations)
