"""Trajectories of a problem by a method: `run`, one, and `run_ensemble`, many in parallel SIMD
lanes on all cores, are the only entry points to the integrators.

    check, `initial`      the choice, and the state to begin with: from velocities or momenta, at a
    point or on the
                          discrete constraint
    kernel_of, `Prepared` the compiled step, run piece by piece: bounded memory, and a way to stop
    trajectory_of         the result of the kernel, with a typed outcome: the vanishing formula in
    the user's names

Zeros of the denominators of L~ just ahead of where a run stopped are its cause where the formulas
have a pole there.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

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
from inverse_service.kernels.codegen.looped import looped
from inverse_service.kernels.codegen.symengine_trees import Formula
from inverse_service.kernels.machine_code.loading import processor_features
from inverse_service.simulation import looping, peers, scene_graph, schemes
from inverse_service.simulation.numeric_formulas import MOMENT, Formulas, formulas_of
from inverse_service.simulation.scene_data import (
    Grid,
    MethodChoice,
    Observation,
    Problem,
    Start,
    Stop,
)
from inverse_service.simulation.sentences import say

_FIRST_PIECE = 4096
# A grid with fewer points shows nothing about the steps between them; a method takes many steps if
# these are more for a point, beyond those in which the first step grows to a usual length.
LEAST_POINTS, STEPS_PER_POINT, STEPS_TO_GROW = 16, 1.3, 4
_FIRST_OWN = 8  # of a method that takes any number of steps between two points
_SECONDS_PER_PIECE = 0.1
_ENDS = "stop before"
_SQUARE_OVERFLOWS = 1e150
_KINDS = {"bound": "guard", "map": "off_domain", "domain": "off_domain"}
# Newton that fails after the determinant has sunk below this part of its first value fails because
# of that.
NEARLY_SINGULAR = 0.25
MOST_NAMED = 4  # unknowns in a sentence
# At this distance a pole affects the guard or Newton's method; the path to it is nearly straight.
STEPS_AHEAD, SECTIONS, LARGE = 20, 8, 1e4
Numbers = dict[str, float]
Columns = dict[str, Any]  # numbers by name, each one or (N,)
# Distances at which a power of the distance is read off, their ratio in decades, and what counts as
# a power below 1: in doubles a smooth force shows 1, a jump 0, and round-off two powers that
# differ.
NEARER, NEARER_BY = (1e-4, 1e-7, 1e-10), 3
# Powers of the distance: of a jump at most the first, of a smooth force at least the second, and
# two that differ by less than the third are the same.
POWER_OF_JUMP, POWER_OF_SMOOTH, SAME_POWER = 0.02, 0.97, 0.02
LATER = 1e-3
WORTH_THREADS = 2_000  # steps of groups that take as long as starting a thread
STEPS_AT_ONCE = 100_000  # steps of groups between two checks for a request to stop


def refuse_choice(problem: Problem, choice: MethodChoice) -> None:
    """Raise InputError for a choice that the problem does not allow, or whose step is too long."""
    if (
        choice.method in method_table.GEOMETRIC
        and choice.order > 2
        and choice.alpha != 0.5
        and not choice.symmetrised
    ):
        raise InputError(say("not_symmetric"))
    if (
        choice.symmetrised
        and choice.alpha != 0.5
        and choice.form != "verlet"
        and problem.depends_on_time
    ):
        raise InputError(say("symmetrised_with_time"))
    looping.refuse_long(problem, choice)


def kernel_of(
    formulas: Formulas, choice: MethodChoice, observation: Observation, lanes: int = 1
) -> Compiled:
    """The compiled step of the method, made only once for all values of h, alpha, parameters and
    weights.
    """
    order = choice.order if choice.method == "runge_kutta" else 0
    if choice.method == "adaptive":
        order = method_table.order_of_pair(choice.order)
    identity = (
        formulas.problem, choice.method, choice.form, order, tuple(map(str, schemes.parts_of(choice))),
        str(schemes.alpha_of(choice)), choice.guard, observation,
    )  # fmt: skip
    if looping.is_looped(formulas.problem, choice):  # one lane after the other
        return looped(identity, lambda: looping.program_of(formulas.problem, choice, observation))
    return compiled(identity, lambda: schemes.program_of(formulas, choice, observation), lanes)


def run(
    problem: Problem, choice: MethodChoice, start: Start, grid: Grid, values: Mapping[str, float],
    observation: Observation = (), stop: Stop | None = None,
) -> Trajectory:  # fmt: skip
    """One trajectory; `values` gives every parameter (free constants too) a number.

    If the method cannot continue, the outcome says so and the rows up to there are kept. InputError
    for a choice that the problem does not allow. `stop` is asked about ten times a second; True
    ends the run as "cancelled".
    """
    if choice.method == "heyoka":
        return peers.run_heyoka(problem, start, grid, values, observation, choice.tolerance, stop)
    if choice.method in method_table.SCIPY:
        return peers.run_scipy(problem, choice, start, grid, values, stop)
    ready = prepared(problem, choice, start, grid, values, observation)
    if isinstance(ready, Trajectory):
        return ready
    found = trajectory_of(ready.go(grid, stop))
    return (
        found
        if choice.guard
        else replace(found, outcome=replace(found.outcome, note=say("no_guard")))
    )


@dataclass(frozen=True, slots=True)
class Prepared:
    """`count` runs of a kernel that have everything but the number of steps; `begin` has the
    numbers of the kernel by name, each one or (count,).
    """

    formulas: Formulas
    choice: MethodChoice
    kernel: Compiled
    begin: Mapping[str, Any]
    count: int = 1

    def go(self, grid: Grid, stop: Stop | None = None) -> Run:
        """All steps of the grid from the start, in pieces, after each of which `stop` is asked;
        groups on all cores.
        """
        kernel, card = self.kernel, self.kernel.card
        memory, substeps = (
            memory_of(card, self.begin, self.count),
            np.array(weights_of(self.choice), dtype=np.float64),
        )
        every = max(1, min(grid.record_every, grid.steps))
        whole, rest = divmod(grid.steps, every)
        record = np.full(
            (len(memory), whole + bool(rest), len(card.layout.columns), card.lanes), np.nan
        )
        control = np.zeros((len(memory), len(CONTROL)), dtype=np.int64)
        steps, until_record, made = (
            control[:, CONTROL.index(name)] for name in ("steps", "until_record", "done")
        )
        control[:, 1:3] = len(substeps), every
        least = _FIRST_OWN if programs.TRIAL in card.layout.persistent else _FIRST_PIECE
        at_once, seconds = max(1, STEPS_AT_ONCE // max(1, grid.steps * len(substeps))), [0.0]

        def work(groups: slice) -> None:
            piece, done = least, 0
            for end in (whole * every, grid.steps):
                until_record[groups] = min(
                    every, grid.steps - done
                )  # the last step is always recorded
                while done < end:
                    if stop is not None and stop():
                        return
                    steps[groups], made[groups] = (todo := min(piece, end - done)), 0
                    clock = time.perf_counter()
                    kernel.machine.call(memory[groups], substeps, control[groups], record[groups])
                    seconds.append(time.perf_counter() - clock)
                    done += int(made[groups].max())
                    if made[groups].max() < todo:
                        return
                    piece = max(
                        least,
                        min(4 * piece, int(piece * _SECONDS_PER_PIECE / max(seconds[-1], 1e-6))),
                    )

        parts = [slice(k, min(k + at_once, len(memory))) for k in range(0, len(memory), at_once)]
        if len(memory) * grid.steps * len(substeps) < WORTH_THREADS or len(parts) == 1:
            for part in parts:
                work(part)
        else:
            with ThreadPoolExecutor(settings.cores()) as pool:
                list(pool.map(work, parts))
        return Run(
            self,
            grid,
            record,
            memory,
            int(control[:, CONTROL.index("iterations")].sum()),
            sum(seconds),
        )


def prepared(
    problem: Problem, choice: MethodChoice, start: Start, grid: Grid, values: Mapping[str, float],
    observation: Observation,
) -> Prepared | Trajectory:  # fmt: skip
    """The run made ready, or the start alone where it cannot begin."""
    refuse_choice(problem, choice)
    formulas = formulas_of(problem)
    begin = initial(formulas, choice, start, arguments_of(problem, choice, grid, values))
    if isinstance(begin, Outcome):
        return Trajectory.of_start(grid.begin, start.positions, None, begin)
    found = Prepared(formulas, choice, kernel_of(formulas, choice, observation), begin)
    if choice.method != "adaptive" or choice.order in method_table.PAIRS:
        return found
    own = problem.accelerations is None
    if looping.depends_on_velocities(problem) if own else formulas.depends_on_velocities:
        return found
    # More than STEPS_PER_POINT steps from one point of the grid to the next: a few show it, where
    # they are a small part of all.
    steps = min(_FIRST_OWN, grid.steps // LEAST_POINTS)
    if (
        steps
        and found.go(replace(grid, steps=steps)).iterations
        <= STEPS_TO_GROW + STEPS_PER_POINT * steps
    ):
        return found
    highest = replace(choice, order=method_table.PAIRS[-1])
    return replace(found, choice=highest, kernel=kernel_of(formulas, highest, observation))


def with_order(
    problem: Problem, choice: MethodChoice, start: Start, grid: Grid, values: Mapping[str, float],
    observation: Observation,
) -> MethodChoice:  # fmt: skip
    """The choice with the order that a run of `adaptive` over the grid chooses, so that its parts
    have the same kernel.
    """
    ready = prepared(problem, choice, start, grid, values, observation)
    own = ready.choice if isinstance(ready, Prepared) else choice
    return replace(choice, order=method_table.order_of_pair(own.order))


def arguments_of(
    problem: Problem, choice: MethodChoice, grid: Grid, values: Mapping[str, float | Array]
) -> Columns:
    """What a kernel takes beside the state: the step, the time, alpha or the tolerance, and the
    parameters.
    """
    setting = choice.tolerance if choice.method in method_table.OWN_STEPS else choice.alpha
    parameters = {f"c{place}": values[name] for place, name in enumerate(problem.parameters)}
    return {"h": grid.step, str(MOMENT): grid.begin, "a": setting, **parameters}


@dataclass(frozen=True)
class Run:
    """What kernels did from each start, in groups of their lanes: `record` (groups, rows, columns,
    lanes) at the recorded steps after the start, and the `memory` (groups, places, lanes) at the
    end. `remedy` replaces those of kernels.
    """

    ready: Prepared
    grid: Grid
    record: Array
    memory: Array
    iterations: int
    seconds: float
    remedy: str = ""

    @property
    def card(self) -> Card:
        return self.ready.kernel.card

    def last(self, name: str) -> Array:
        """A number of the memory, (N,)."""
        return self.memory[:, self.card.layout.names.index(name)].ravel()[: self.ready.count]

    def column(self, name: str) -> Array:
        """A column of the record, (N, rows)."""
        found = self.record[:, :, self.card.layout.columns.index(name)].swapaxes(1, 2)
        return found.reshape(found.shape[0] * found.shape[1], found.shape[2])[: self.ready.count]

    def _points(self, letter: str) -> Array:
        """(N, m, n) at the start and the recorded steps, nan after the end; a constant value is not
        recorded.
        """
        found = np.empty((self.ready.count, self.record.shape[1] + 1, self.ready.formulas.size))
        for k in range(found.shape[2]):
            found[:, :, k] = np.reshape(self.ready.begin.get(f"{letter}{k}", math.nan), (-1, 1))
            if f"{letter}{k}" in self.card.layout.columns:
                found[:, 1:, k] = self.column(f"{letter}{k}")
        last = np.where(self.last(programs.STATUS) != 0, self.last(programs.STOPPED_AT), np.inf)
        found[self.grid.recorded > last[:, None]] = np.nan
        return found

    @property
    def letter(self) -> str:
        """v or p: what `rates` are."""
        return "v" if self.ready.choice.method in method_table.POINT_METHODS else "p"

    @cached_property
    def positions(self) -> Array:
        return self._points("q")

    @cached_property
    def rates(self) -> Array:
        return self._points(self.letter)

    @cached_property
    def completed(self) -> NDArray[np.bool_]:
        """Which reached the end, (N,)."""
        found: NDArray[np.bool_] = (self.last(programs.CLOCK) == self.grid.steps) & (
            self.last(programs.STATUS) == 0
        )
        return found

    @property
    def cancelled(self) -> bool:
        """Whether one was neither completed nor ended by its formulas."""
        return bool((~self.completed & (self.last(programs.STATUS) == 0)).any())

    def numbers(self, member: int = 0) -> dict[str, float]:
        """State variables, rates, arguments and what the kernel notes, after the last good step."""
        layout, (group, lane) = self.card.layout, divmod(member, self.card.lanes)
        return dict(zip(layout.names, self.memory[group, :, lane].tolist(), strict=True))

    def outcome(self, member: int = 0) -> Outcome:
        """How one ended."""
        card, grid, last, problem = (
            self.card,
            self.grid,
            self.numbers(member),
            self.ready.formulas.problem,
        )
        code, done = int(last[programs.STATUS]), int(last[programs.CLOCK])
        if not code:
            return Outcome(
                "completed" if done == grid.steps else "cancelled",
                done,
                grid.begin + done * grid.step,
            )
        step, value = int(last[programs.STOPPED_AT]), last[programs.STOPPED_VALUE]

        def ends(kind: str, quantity: str, value: float, remedy: str) -> Outcome:
            return Outcome(
                kind, step, grid.begin + step * grid.step, quantity, value, self.remedy or remedy
            )

        if code >= programs.UNOBSERVABLE:
            quantity = f"{card.observed[code - programs.UNOBSERVABLE]}, which has no finite value"
            if max(abs(last.get(name, 0.0)) for name in card.layout.columns) > _SQUARE_OVERFLOWS:
                return ends("not_finite", quantity, value, say("smaller_step"))
            return ends("off_domain", quantity, value, say("undefined"))
        if code >= programs.WATCHED:
            kind, quantity, remedy = card.watches[code - programs.WATCHED]
            value = abs(value) if kind == "bound" else value
            return ends(_KINDS.get(kind, "singular"), quantity, value, remedy)
        if code >= programs.GUARDED:
            quantity = (
                f"1 - det/det(h -> 0): {_determinant(card, code - programs.GUARDED, problem)}"
            )
            return ends("guard", quantity, value, say("smaller_step"))
        if code >= programs.SINGULAR:
            return ends(
                "singular",
                _determinant(card, code - programs.SINGULAR, problem),
                value,
                say("smaller_step"),
            )
        if code >= programs.NO_CONVERGENCE:
            place = code - programs.NO_CONVERGENCE
            quantity = _determinant(card, place, problem)
            if place < len(card.solves) and abs(last[f"last_{place}"]) < NEARLY_SINGULAR * abs(
                last[f"first_{place}"]
            ):
                return ends("singular", quantity, last[f"last_{place}"], say("smaller_step"))
            remedy = say("smaller_or_stop") if math.isnan(value) else say("smaller_step")
            return ends(
                "no_convergence", quantity, value if place < len(card.solves) else math.nan, remedy
            )
        if code == programs.NO_START:
            return ends(
                "off_domain",
                "the state at the start, which has no finite value",
                value,
                say("undefined"),
            )
        if code == programs.TOO_MANY:
            quantity = f"the step chosen by the method: {MOST_TRIES} such steps do not reach the next point"
            return ends("unresolved", quantity, value, say("faster"))
        if code == programs.TOO_SHORT:
            return ends("singular", "a step within the tolerance", value, _ENDS)
        assert code == programs.NOT_FINITE
        return ends("not_finite", "a coordinate or momentum", math.nan, say("smaller_step"))


def memory_of(card: Card, numbers: Mapping[str, float | Array], count: int = 1) -> Array:
    """(groups, places, lanes): the numbers of `count` runs, each one or (count,), where the kernel
    looks for them.

    Unused lanes repeat the last run. A run with a number that is not finite does not start.
    """
    layout, lanes = card.layout, card.lanes
    groups = -(-count // lanes)
    rows = np.minimum(np.arange(groups * lanes), count - 1)
    memory = np.zeros((groups, len(layout.names), lanes))
    for place, name in enumerate(layout.names):
        if name in numbers:
            given = np.asarray(numbers[name])
            memory[:, place] = given if given.size == 1 else given[rows].reshape(groups, lanes)
    memory[:, layout.names.index(programs.STOPPED_AT)] = -1.0
    if (lost := ~np.isfinite(memory).all(axis=1)).any():
        for name, value in programs.NOT_STARTED.items():
            memory[:, layout.names.index(name)][lost] = value
    return memory


def _determinant(card: Card, place: int, problem: Problem) -> str:
    """The equations of a block, by its unknowns in the user's names, of which many are counted."""
    if place >= len(card.solves):
        return "the stage equations, whose iteration does not converge"
    changes, shown = {"d": "step of ", "f": "acceleration of "}, []
    for name in card.solves[place]:
        letter, k = name[0], int(name[1:].rpartition("_")[2])  # those of a stage are f0_1 and m0_1
        change = changes.get(letter, "change of p_")
        shown.append(
            f"multiplier {k + 1}" if letter == "m" else f"the {change}{problem.coordinates[k]}"
        )
    if len(shown) > MOST_NAMED:
        shown[MOST_NAMED - 1 :] = [f"{len(shown) - MOST_NAMED + 1} others"]
    return f"determinant of the discrete equations for {', '.join(shown)}"


def trajectory_of(run: Run) -> Trajectory:
    """The first run as a trajectory."""
    card, choice, outcome = run.card, run.ready.choice, run.outcome()
    done = outcome.step or 0
    rows = run.grid.recorded <= done
    carried = run.rates[0, rows]
    # Of forces: in every trial step where the method chooses its own, else in every substep and
    # iteration.
    each = 6 if choice.method == "reference" else 1
    evaluations = card.forces * done * len(weights_of(choice)) + run.iterations * each
    own_steps = choice.method in method_table.OWN_STEPS
    # The first value of an observed quantity is repeated in front, because no step leads to the
    # start.
    seen = {name: run.column(f"observed_{k}")[0] for k, name in enumerate(card.observed)}
    return Trajectory(
        times=run.grid.times[rows],
        positions=run.positions[0, rows],
        momenta=carried if run.letter == "p" and not np.isnan(carried).any() else None,
        velocities=carried if run.letter == "v" else None,
        outcome=_explained(run, outcome),
        force_evaluations=card.forces * run.iterations if own_steps else evaluations,
        newton_iterations=0 if own_steps else run.iterations,
        compile_seconds=sum(run.ready.kernel.seconds.values()),
        run_seconds=run.seconds,
        series={
            name: np.append(column[:1] if len(column) else np.nan, column)[rows]
            for name, column in seen.items()
        },
        maxima={name: float(run.last(f"maximum_{k}")[0]) for k, name in enumerate(card.observed)},
    )


def weights_of(choice: MethodChoice) -> tuple[float, ...]:
    return (
        method_table.composition(choice.order)
        if choice.method in method_table.GEOMETRIC
        else (1.0,)
    )


def _explained(run: Run, halt: Outcome) -> Outcome:
    """The outcome with its cause where that lies in the formulas of L~, and with the step that
    passes a guard.
    """
    f, choice, grid = run.ready.formulas, run.ready.choice, run.grid
    if (
        choice.method == "modified"
        and halt.kind == "singular"
        and len(schemes.parts_of(choice)) == 1
    ):
        # It has its own singular set: it is smooth through the zeros of A_alpha, even if other
        # factors vanish nearby.
        return replace(halt, remedy=_remedy(f, choice))
    if cause := _cause(run, halt):
        return replace(halt, kind="singular", quantity=cause[0], value=cause[1], remedy=cause[2])
    if halt.kind == "guard" and halt.value:
        # The determinant differs from its limit by h^2 at alpha = 1/2, other guards are
        # proportional to h.
        of_determinant = programs.GUARDED <= int(run.numbers()[programs.STATUS]) < programs.WATCHED
        excess = math.sqrt(halt.value) if of_determinant else abs(halt.value)
        passes = f"|step| below {abs(grid.step) / excess:.3g} passes here; guard = false continues unchecked"
        return replace(halt, remedy=f"{halt.remedy}; {passes}")
    return halt


class Cause(NamedTuple):
    """The quantity that ended a run, its value there, and what to do."""

    text: str
    value: float
    remedy: str


def _cause(run: Run, halt: Outcome) -> Cause | None:
    """(text, value now, remedy) of the first denominator of L~ that passes 0 about the step that
    failed, from a step before the last good point to a step and a half after it; or further ahead,
    where dH~/dq has a pole there: guard and Newton fail because of it. Those that H~ is smooth
    through, as cos(phi) of the disk, do not count.
    """
    f, choice = run.ready.formulas, run.ready.choice
    if choice.method not in ("variational", "modified"):
        return None
    last, start, step = run.numbers(), run.ready.begin, run.grid.step
    passed = last[programs.CLOCK] * step
    means = [
        (last[f"q{k}"] - float(start[f"q{k}"])) / passed if passed else 0.0 for k in range(f.size)
    ]
    # A rate of 0 is that of the step that failed; the mean one says where the way led.
    rates = [last.get(f"d{k}_rate", 0.0) or mean for k, mean in enumerate(means)]
    table = {str(MOMENT): run.grid.begin, **start, **last, **_named("v", rates)}

    def along(formulas: Sequence[Formula], parts: Array) -> Array:
        """Formulas so many steps after the last good point on the straight path from it, (parts,
        formulas).
        """
        return f.rows(
            formulas,
            table | {f"q{k}": last[f"q{k}"] + parts * step * rate for k, rate in enumerate(rates)},
        )

    raw = choice.method == "modified" or choice.form == "raw" or _has_two_places(choice)
    for item in f.denominators if halt.kind in ("no_convergence", "not_finite", "singular") else ():
        values = along([item.formula], np.array([-1.0, 0.0, 1.5]))[:, 0]
        passes = not values.min() * values.max() > 0 or abs(values[2]) < 1e-3 * abs(values[1])
        if (raw or item.moves) and passes:
            return Cause(item.text, float(values[1]), _remedy(f, choice))
    if choice.method == "modified" or not (
        f.problem.free_hamiltonian and f.problem.free_lagrangian
    ):
        return None
    slopes = [f.hamiltonian.diff(q) for q in f.symbols("q")]
    for item in f.denominators:
        places = np.arange(STEPS_AHEAD + 1.0)
        for _ in range(SECTIONS):
            values = along([item.formula], places)[:, 0]
            if not (beyond := values[0] * values <= 0)[1:].any():
                break
            end = int(beyond[1:].argmax()) + 1
            places = np.linspace(places[end - 1], places[end], STEPS_AHEAD + 1)
        else:
            now, before = along([item.formula], np.zeros(1))[0, 0], np.array([0.0, places[0]])
            here, there = np.abs(along(slopes, before)).max(axis=1)
            if not math.isfinite(there) or there > LARGE * (1.0 + here):
                return Cause(item.text, float(now), schemes.where_it_ends(f))
    return None


def _has_two_places(choice: MethodChoice) -> bool:
    """Whether the Lagrangian is taken at two places of a step."""
    return choice.form != "verlet" and len(schemes.parts_of(choice)) == 2


def _remedy(f: Formulas, choice: MethodChoice) -> str:
    if _has_two_places(choice):
        return say("not_symmetrised")
    if choice.method == "variational" and choice.form == "raw":
        return say("hamiltonian_form")
    if choice.method == "modified":
        return say("smaller_constants", ", ".join(f.problem.free_constants) or "of L~")
    return schemes.where_it_ends(f)


def initial(
    f: Formulas, choice: MethodChoice, start: Start, arguments: Columns
) -> Columns | Outcome:
    """The numbers of a kernel at the start: its arguments, the state, and first guesses of the
    rates of the unknowns; the outcome where a momentum or a force has no value there, so that the
    run cannot begin.
    """
    table = {**arguments, **_named("q", start.positions), **_named("v", start.velocities)}
    if choice.method in method_table.POINT_METHODS:
        at = tuple((name, value) for name, value in table.items() if name not in ("h", "a"))
        return no_one_motion(f, choice.method == "stiff", at) or table | looping.kept_at_start(
            f.problem, choice, table
        )
    momenta = (
        None if start.momenta is None or choice.method == "modified" else np.array(start.momenta)
    )
    if start.convention == "discrete_constraint":
        if choice.order > 2:
            raise InputError(
                "A composition starts from momenta: the discrete constraint is that of the plain step."
            )
        velocities, momenta = _on_discrete_constraint(f, choice, table, table["h"])
        table |= _named("v", velocities)
    elif momenta is not None:
        return carried(f, choice, table, momenta)
    found = carried(f, choice, table, momenta) | looping.kept_at_start(f.problem, choice, table)
    undefined = undefined_force(f, f.forces, table)
    if undefined is None and f.problem.depends_on_time:  # elsewhere L~ may be 0/0 at the start
        undefined = undefined_force(
            f, [f.discretized(choice.method).diff(x) for x in f.symbols("q")], table
        )
    if all(map(np.isfinite, found.values())):
        return undefined or found
    values = zip(
        f.denominators, f.values([item.formula for item in f.denominators], table), strict=True
    )
    known = [(item.text, value) for item, value in values if math.isfinite(value)]
    quantity, value = min(known, key=lambda item: abs(item[1]), default=("dL/dv", math.nan))
    return Outcome(
        "off_domain", 0, table[str(MOMENT)], quantity, value, say("start_where_not_zero")
    )


def carried(f: Formulas, choice: MethodChoice, columns: Columns, momenta: Array | None) -> Columns:
    """Columns with q and v as a method on (q, p) carries them: momenta, those given or dL/dv, and
    rates.
    """
    is_own = choice.method == "nonholonomic" or scene_graph.uses_own_lagrangian(f.problem)
    if momenta is None and is_own:
        momenta = looping.momenta_at(f.problem, columns)
    if (
        momenta is None
    ):  # of L~ with the constraints put in, which hold, so that common factors A_alpha cancel
        slopes = [
            f.discretized(choice.method).diff(v).subs(f.on_constraints) for v in f.symbols("v")
        ]
        momenta = f.rows(slopes, columns)
    kept = [k for k in range(f.size) if choice.method != "modified" or k not in f.dependent]
    others = {name: value for name, value in columns.items() if name[0] != "v"}
    rates = {f"d{k}_rate": columns[f"v{k}"] for k in range(f.size)}
    return others | {f"p{k}": momenta[..., k] for k in kept} | rates


def _named(letter: str, values: Sequence[float] | Array) -> Columns:
    """The entries of (n,) numbers, or of each of (N, n), by name."""
    return {f"{letter}{k}": value for k, value in enumerate(np.asarray(values, dtype=float).T)}


def _on_discrete_constraint(
    f: Formulas, choice: MethodChoice, table: Numbers, step: float
) -> tuple[Array, Array]:
    """v, so that q_1 = q_0 + h v is on the discrete constraint, and p_0 = -D1 L_d(q_0, q_1)."""
    parts = [float(part.subs({"a": choice.alpha})) for part in schemes.parts_of(choice)]
    v = np.array([table[f"v{k}"] for k in range(f.size)])

    def mean(formulas: Sequence[Formula], part: float) -> Array:
        """Formulas at the discrete point."""
        place = {f"q{k}": table[f"q{k}"] + part * step * rate for k, rate in enumerate(v)}
        return np.array(f.values(formulas, {**table, **place, **_named("v", v)}))

    for _ in range(50):  # a few sweeps where the dependent velocities enter their own formulas
        old = v.copy()
        v[[*f.dependent]] = np.mean([mean([*f.dependent.values()], part) for part in parts], axis=0)
        if (np.abs(v - old) <= 1e-15 * np.abs(old)).all():
            break
    whole, given = f.discretized(choice.method), f.on_constraints
    if choice.method == "nonholonomic" or len(parts) > 1:
        given = {}
    impulses, pulls = ([whole.diff(x).subs(given) for x in f.symbols(letter)] for letter in "vq")
    pulls = pulls if not len(f.forces) else [a + b for a, b in zip(pulls, f.forces, strict=True)]
    return v, np.mean(
        [mean(impulses, part) - (1 - part) * step * mean(pulls, part) for part in parts], axis=0
    )


def undefined_force(
    f: Formulas, forces: Sequence[Formula], table: Mapping[str, float]
) -> Outcome | None:
    """The outcome if a force has no value at the start, where no step would notice this or no step
    succeeds.
    """
    for name, formula in zip(f.problem.coordinates, forces, strict=False):
        # It has none either where it divides by 0, or takes the logarithm of 0: in doubles
        # atan(v/x) is pi/2 at x = 0.
        powers = formula.atoms(symengine.Pow)
        divided = [
            power.args[0]
            for power in powers
            if power.args[1].is_Number and power.args[1].is_negative
        ]
        divided += [logarithm.args[0] for logarithm in formula.atoms(symengine.log)]
        value, *others = f.values([formula, *divided], table)
        if not math.isfinite(value) or 0 in others:
            begin = table[str(MOMENT)]
            quantity = say("force_without_value", name, begin)
            return Outcome("off_domain", 0, begin, quantity, None, say("begin_elsewhere_or_later"))
    return None


@lru_cache(maxsize=64)
def no_one_motion(
    f: Formulas, by_slopes: bool, at: tuple[tuple[str, float], ...]
) -> Outcome | None:
    """The outcome where an acceleration has no value at the start, or is no Lipschitz function
    there.

    x'' = sqrt(x) has the motions x = 0 and x = (t - s)^4/144 for t > s, one for each s, from x = x'
    = 0. Where the motion leaves such a place at once it is the only one, but a method that solves
    by slopes may take another.
    """
    table = dict(at)
    if f.problem.accelerations is None:
        return looping.without_force(f.problem, table)
    undefined = undefined_force(f, f.accelerations, table)
    if undefined is not None or not f.walls_of(f.problem.accelerations or ()):
        return undefined
    steep = _steep(f, table)
    if any(steep) and not by_slopes:
        later = dict(table)  # q + v s + f s^2/2 and v + f s
        for k, force in enumerate(f.values(f.accelerations, table)):
            later[f"q{k}"] += LATER * (table[f"v{k}"] + LATER * force / 2)
            later[f"v{k}"] += LATER * force
        steep &= _steep(f, later)
    for name, is_steep in zip(f.problem.coordinates, steep, strict=True):
        if is_steep:
            quantity = f"the force on {name}: its slope is infinite at the start, where more than one motion may begin"
            return Outcome("singular", 0, table[str(MOMENT)], quantity, None, "begin next to it")
    return None


def _steep(f: Formulas, table: Mapping[str, float]) -> NDArray[np.bool_]:
    """Of each force, whether it changes as a power below 1 of the distance: along q_k, v_k or
    oblique to them all.
    """
    names = [f"{letter}{k}" for letter in "qv" for k in range(f.size)]
    axes, sizes = np.eye(len(names)), np.array([0.0, *NEARER])
    ways = np.concatenate([axes, -axes, np.random.default_rng(0).normal(size=(4, len(names)))])
    moved = {x: table[x] + np.outer(sizes, ways[:, k]).ravel() for k, x in enumerate(names)}
    values = f.rows(f.accelerations, {**table, **moved}).reshape(len(sizes), len(ways), f.size)
    with np.errstate(all="ignore"):
        first, last = -np.diff(np.log10(np.abs(values[1:] - values[0])), axis=0) / NEARER_BY
    powers = (last > POWER_OF_JUMP) & (last < POWER_OF_SMOOTH) & (np.abs(first - last) < SAME_POWER)
    return np.asarray(powers.any(axis=0))


def run_ensemble(
    problem: Problem, choice: MethodChoice, positions: Array, velocities: Array, grid: Grid,
    values: Mapping[str, float | Array], momenta: Array | None = None, steps: Array | None = None,
    stop: Stop | None = None, begins: Array | None = None,
) -> Run:  # fmt: skip
    """N trajectories from `positions` and `velocities` (N, n), or `momenta` where they are known.

    `values` gives each parameter a number or (N,) numbers; `steps` (N,) are individual steps that
    replace that of the grid, `begins` individual start times. InputError for input that a single
    run would refuse.
    """
    refuse_choice(problem, choice)
    if choice.method in ("heyoka", "modified"):
        raise InputError(say("ensemble_methods"))
    f = Formulas(problem)
    lanes = 8 if "+avx512f" in processor_features() else 4  # doubles that a core takes at once
    columns = (
        arguments_of(problem, choice, grid, values)
        | _named("q", positions)
        | _named("v", velocities)
    )
    is_long = grid.steps > 1  # in one step, nothing grows
    kept = looping.kept_at_start if is_long else looping.first_signs
    columns |= kept(problem, choice, columns)
    columns |= ({} if steps is None else {"h": steps}) | (
        {} if begins is None else {str(MOMENT): begins}
    )
    if choice.method not in method_table.POINT_METHODS:
        columns = carried(f, choice, columns, momenta)
    return Prepared(f, choice, kernel_of(f, choice, (), lanes), columns, len(positions)).go(
        grid, stop
    )
