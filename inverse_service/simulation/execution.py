"""Kernels run piece by piece: bounded memory, a way to stop, and status codes turned into outcomes.

What a kernel left, as a trajectory with a typed outcome: what vanished is said as a formula in the user's names.

Zeros of the denominators of L~ just ahead of where a run stopped are its cause where the formulas have a pole there.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
import symengine
from numpy.typing import NDArray

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Apply, Expression, Symbol, Velocity, add, multiply, number
from inverse_service.integrators.method_table import GEOMETRIC, OWN_STEPS, POINT_METHODS
from inverse_service.integrators.tableaux import composition
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.kernels.codegen.adaptive_kernel import MOST_TRIES
from inverse_service.kernels.codegen.compiled import Card, Compiled
from inverse_service.kernels.codegen.kernel import CONTROL
from inverse_service.kernels.codegen.planning import limit_at_zero_step
from inverse_service.kernels.codegen.program import (
    CLOCK,
    GUARDED,
    NO_CONVERGENCE,
    NO_START,
    NOT_FINITE,
    SINGULAR,
    STATUS,
    STOPPED_AT,
    STOPPED_VALUE,
    TOO_MANY,
    TOO_SHORT,
    TRIAL,
    UNOBSERVABLE,
    UNRESOLVED,
    WATCHED,
    Program,
    Solve,
)
from inverse_service.kernels.codegen.symengine_trees import STEP, Formula, real_value, symbol
from inverse_service.simulation.callables import Denominator, Formulas
from inverse_service.simulation.scene_data import Grid, MethodChoice, Observation, Start
from inverse_service.simulation.schemes import parts_of, program_of
from inverse_service.simulation.starting import Initial
from inverse_service.simulation.watches import where_it_ends

_FIRST_PIECE = 4096
_FIRST_OWN = 8  # of a method that takes any number of steps between two points
_SECONDS_PER_PIECE = 0.1
_REMEDY = "take a smaller step"
_UNDEFINED = "begin elsewhere, stop before, or leave the quantity out of observe"
_NO_VALUE = "take a smaller step; where a formula has no value, stop before"
_ENDS = "stop before: the motion or a formula ends there"
_FASTER = "take a smaller step or a larger tolerance; where something decays fast, `stiff`"
_BENT = "the third difference of the path compared with its steps, squared: fewer than five steps in a turn"
_KINDS = {"resolution": "unresolved", "bound": "guard", "map": "off_domain", "domain": "off_domain"}
# Newton that fails after the determinant has sunk below this part of its first value fails because of that.
NEARLY_SINGULAR = 0.25


@dataclass(frozen=True, slots=True)
class Run:
    """What a kernel left: `rows` (recorded, columns), `memory` (places,) after the last good step."""

    rows: Array
    steps_at: NDArray[np.int64]
    memory: Array
    iterations: int
    seconds: float
    cancelled: bool
    done: int


def memory_of(card: Card, state: Mapping[str, float], arguments: Mapping[str, float]) -> Array:
    """(places,): the state with the rates, and the arguments, where the kernel looks for them."""
    layout = card.layout
    memory = np.zeros(layout.size)
    for name, value in state.items():
        if name in layout.persistent:
            memory[layout.place(name)] = value
    for name in layout.arguments:
        memory[layout.argument_place(name)] = arguments[name]
    memory[layout.place(STOPPED_AT)] = -1.0
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
    least = _FIRST_OWN if TRIAL in kernel.card.layout.persistent else _FIRST_PIECE
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
    """(steps to do now, steps to the next record): the very last step is recorded whatever the rhythm."""
    if left == 1:
        return 1, 1
    return min(piece, left - 1), until


@dataclass(frozen=True, slots=True)
class Stopped:
    """Why a run stopped: kind, quantity, value, remedy; `step` counts from 0.

    `block` is the place of the implicit block whose determinant it was, None for other quantities.
    """

    kind: str
    step: int
    quantity: str
    value: float
    remedy: str
    block: int | None = None


def stopped(card: Card, memory: Array, unknown_names: Mapping[str, str]) -> Stopped | None:
    """The meaning of the status in the memory (places,), None where the run went to the end."""
    layout = card.layout
    code = int(memory[layout.place(STATUS)])
    if code == 0:
        return None
    step = int(memory[layout.place(STOPPED_AT)])
    value = float(memory[layout.place(STOPPED_VALUE)])
    if code >= UNOBSERVABLE:
        quantity = f"{card.observed[code - UNOBSERVABLE]}, which has no finite value"
        return Stopped("off_domain", step, quantity, value, _UNDEFINED)
    if code >= WATCHED:
        kind, quantity, remedy = card.watches[code - WATCHED]
        remedy = _NO_VALUE if kind == "resolution" and math.isnan(value) else remedy
        return Stopped(_KINDS.get(kind, "singular"), step, quantity, value, remedy)
    if code >= GUARDED:
        quantity = f"1 - det/det(h -> 0): {_determinant(card, code - GUARDED, unknown_names)}"
        return Stopped("guard", step, quantity, value, _REMEDY)
    if code >= SINGULAR:
        place = code - SINGULAR
        return Stopped("singular", step, _determinant(card, place, unknown_names), value, _REMEDY, place)
    if code >= NO_CONVERGENCE:
        place = code - NO_CONVERGENCE
        quantity = _determinant(card, place, unknown_names)
        if place < len(card.solves):
            first, last = (float(memory[layout.place(f"{which}_{place}")]) for which in ("first", "last"))
            if abs(last) < NEARLY_SINGULAR * abs(first):
                return Stopped("singular", step, quantity, last, _REMEDY, place)
        remedy = _NO_VALUE if math.isnan(value) else _REMEDY
        return Stopped("no_convergence", step, quantity, value if place < len(card.solves) else math.nan, remedy)
    if code == NO_START:
        return Stopped("off_domain", 0, "the state at the start, which has no finite value", value, _UNDEFINED)
    if code == UNRESOLVED:
        return Stopped("unresolved", step, _BENT, value, f"{_REMEDY}; guard = false continues unchecked")
    if code == TOO_MANY:
        quantity = f"a step of its own: {MOST_TRIES} such steps do not reach the next point"
        return Stopped("unresolved", step, quantity, value, _FASTER)
    if code == TOO_SHORT:
        return Stopped("singular", step, "the step that the tolerance asks for", value, _ENDS)
    assert code == NOT_FINITE
    return Stopped("not_finite", step, "a coordinate or momentum", math.nan, _REMEDY)


def _determinant(card: Card, place: int, unknown_names: Mapping[str, str]) -> str:
    if place >= len(card.solves):
        return "the stage equations, whose iteration does not converge"
    names = ", ".join(unknown_names.get(name, name) for name in card.solves[place])
    return f"determinant of the discrete equations for {names}"


def at_last(card: Card, memory: Array) -> dict[str, float]:
    """State variables and rates after the last good step."""
    layout = card.layout
    return {name: float(memory[place]) for place, name in enumerate(layout.persistent)}


_LONGEST = 160
_FUNCTIONS = {"sin", "cos", "tan", "exp", "log", "sinh", "cosh", "tanh", "asin", "acos", "atan"}


def limit_text(f: Formulas, program: Program, block: int) -> tuple[str, int] | None:
    """The determinant of an implicit block as h -> 0, over q, q' and the momenta, with the sign it was multiplied by.

    The sign makes a constant term -1 into 1. None where the limit is not known or too long to be read.
    """
    solves = [one for one in program.blocks if isinstance(one, Solve)]
    if block >= len(solves):
        return None
    limit = limit_at_zero_step(solves[block].jacobian, [symbol(name) for name in solves[block].unknowns])
    if limit is None:
        return None
    formula = limit.subs({symbol(f"d{k}"): STEP * symbol(f"v{k}") for k in range(f.size)}).expand()
    sign = -1 if isinstance(formula, symengine.Add) and symengine.Integer(-1) in formula.args else 1
    tree = _tree((sign * formula).expand(), _names(f))
    text = to_text(collect(tree)) if tree is not None else ""
    return (text, sign) if 0 < len(text) <= _LONGEST else None


def _names(f: Formulas) -> dict[str, Expression]:
    coordinates, parameters = f.problem.coordinates, f.problem.parameters
    table: dict[str, Expression] = {f"c{k}": Symbol(name) for k, name in enumerate(parameters)}
    for k, name in enumerate(coordinates):
        table |= {f"q{k}": Symbol(name), f"v{k}": Velocity(name), f"p{k}": Symbol(f"p_{name}")}
    return table


def _tree(formula: Formula, names: dict[str, Expression]) -> Expression | None:
    """A formula of symengine as a tree; None where it holds something else."""
    if formula.is_Symbol:
        return names.get(str(formula))
    if isinstance(formula, symengine.Rational):
        return number(Fraction(str(formula)))
    if not formula.args:
        return None
    parts = [_tree(part, names) for part in formula.args]
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return None
    if isinstance(formula, symengine.Add):
        return add(*known)
    if isinstance(formula, symengine.Mul):
        return multiply(*known)
    if isinstance(formula, symengine.Pow):
        return known[0] ** known[1]
    name = type(formula).__name__.lower()
    return Apply(name, known[0]) if name in _FUNCTIONS and len(known) == 1 else None


# So far ahead a pole is felt by the guard or by Newton; the way there is nearly straight.
STEPS_AHEAD = 20
_NEAR = 1e-9
_LARGE = 1e4

State = Mapping[str, float]


def pole_ahead(f: Formulas, state: State, rates: Sequence[float], step: float) -> tuple[str, float] | None:
    """(text, value now) of the first denominator that passes 0 in STEPS_AHEAD steps, where dH~/dq has a pole.

    `state` gives positions, momenta and parameters by kernel name, `rates` the velocities. Denominators that H~ is
    smooth through, as cos(phi) of the disk, do not count.
    """
    for item in f.denominators:
        part = _zero_ahead(item, state, rates, step)
        if part is not None and _has_pole(f, state, rates, part * step):
            return item.text, real_value(item.formula, _moved(state, rates, 0.0))
    return None


def _moved(state: State, rates: Sequence[float], time: float) -> dict[str, float]:
    table = dict(state) | {f"v{k}": rate for k, rate in enumerate(rates)}
    return table | {f"q{k}": state[f"q{k}"] + time * rate for k, rate in enumerate(rates)}


def _zero_ahead(item: Denominator, state: State, rates: Sequence[float], step: float) -> float | None:
    """After how many steps on the straight way the denominator passes 0, by bisection; None where it does not."""
    value = real_value(item.formula, _moved(state, rates, 0.0))
    for k in range(STEPS_AHEAD):
        low, high = float(k), float(k + 1)
        if not value * real_value(item.formula, _moved(state, rates, high * step)) <= 0:
            continue
        while high - low > _NEAR:
            middle = (low + high) / 2
            passed = value * real_value(item.formula, _moved(state, rates, middle * step)) <= 0
            low, high = (low, middle) if passed else (middle, high)
        return low
    return None


def _has_pole(f: Formulas, state: State, rates: Sequence[float], time: float) -> bool:
    slopes: list[Formula] = [f.hamiltonian.diff(q) for q in f.symbols("q")]
    now, there = (
        max(abs(real_value(slope, _moved(state, rates, moment))) for slope in slopes) for moment in (0.0, time)
    )
    return not math.isfinite(there) or there > _LARGE * (1.0 + now)


def failed_start(start: Start, outcome: Outcome, time: float = 0.0) -> Trajectory:
    """A run that cannot begin: the start alone."""
    begin = np.array([list(start.positions)], dtype=np.float64)
    return Trajectory(np.array([time]), begin, None, None, outcome, 0, 0, 0.0, 0.0)


@dataclass(frozen=True)
class Ended:
    """A run of a kernel from `begin`, as far as it came."""

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
    def halt(self) -> Stopped | None:
        """Why it stopped; None where it went to the end."""
        return stopped(self.card, self.run.memory, unknown_names(self.f))

    @cached_property
    def last(self) -> dict[str, float]:
        """State variables and rates after the last good step."""
        return at_last(self.card, self.run.memory)

    @cached_property
    def parameters(self) -> dict[str, float]:
        """The arguments of the kernel but h."""
        layout = self.card.layout
        return {name: float(self.run.memory[layout.argument_place(name)]) for name in layout.arguments if name != "h"}


def trajectory_of(ended: Ended, observation: Observation) -> Trajectory:
    """The run as a trajectory."""
    card, run, begin, grid, halt = ended.card, ended.run, ended.begin, ended.grid, ended.halt
    kept = run.steps_at <= (halt.step if halt else run.done)
    columns = {name: run.rows[kept, place] for place, name in enumerate(card.layout.columns)}
    size = ended.f.size
    letter = "v" if ended.choice.method in POINT_METHODS else "p"
    carried = _with_start(columns, begin, [f"{letter}{k}" for k in range(size)])
    velocities = carried if letter == "v" else _velocities(columns, begin, card, size)
    taken = int(run.memory[card.layout.place("clock")]) if halt is None else halt.step
    return Trajectory(
        times=grid.begin + np.concatenate([[0.0], run.steps_at[kept] * grid.step]),
        positions=_with_start(columns, begin, [f"q{k}" for k in range(size)]),
        momenta=carried if letter == "p" and observation.momenta and not np.isnan(carried).any() else None,
        velocities=velocities if observation.velocities or letter == "v" else None,
        outcome=_outcome(ended),
        force_evaluations=_evaluations(ended.choice, card, taken, run.iterations),
        newton_iterations=0 if ended.choice.method in OWN_STEPS else run.iterations,
        compile_seconds=sum(ended.kernel.seconds.values()),
        run_seconds=run.seconds,
        series={name: _headed(columns[f"observed_{k}"]) for k, name in enumerate(card.observed)},
        maxima={name: float(run.memory[card.layout.place(f"maximum_{k}")]) for k, name in enumerate(card.observed)},
    )


def weights_of(choice: MethodChoice) -> tuple[float, ...]:
    return composition(choice.order) if choice.method in GEOMETRIC else (1.0,)


def _evaluations(choice: MethodChoice, card: Card, taken: int, iterations: int) -> int:
    """Of forces: in every trial step where the method chooses its own, else in every substep and iteration."""
    if choice.method in OWN_STEPS:
        return card.forces * iterations
    return card.forces * taken * len(weights_of(choice)) + iterations * (6 if choice.method == "reference" else 1)


def _with_start(columns: dict[str, Array], begin: Initial, names: list[str]) -> Array:
    """Recorded values with the start in front; what never changes is repeated, what is not carried is NaN."""
    rows = len(next(iter(columns.values()))) if columns else 0
    table = np.empty((rows + 1, len(names)))
    for k, name in enumerate(names):
        table[0, k] = begin.state.get(name, math.nan)
        table[1:, k] = columns.get(name, table[0, k])
    return table


def _velocities(columns: dict[str, Array], begin: Initial, card: Card, size: int) -> Array | None:
    if not card.displacement:
        return None
    table = np.stack([_headed(columns[f"velocity_{k}"]) for k in range(size)], axis=1)
    if len(table) == 1:
        table[0] = [begin.rates.get(f"d{k}", math.nan) for k in range(size)]
    return table


def _headed(values: Array) -> Array:
    """The first value repeated in front: the start has no step of its own."""
    return np.concatenate([values[:1] if len(values) else [math.nan], values])


def unknown_names(f: Formulas) -> dict[str, str]:
    """Unknowns of the kernels in the user's names."""
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
    when = grid.begin + halt.step * grid.step
    if choice.method == "modified" and halt.kind == "singular" and len(parts_of(choice)) == 1:
        # Its own singular set: smooth through the zeros of A_alpha, whatever passes 0 nearby.
        return Outcome(halt.kind, halt.step, when, *_own_singular_set(f, choice, halt), _remedy(f, choice))
    if halt.kind in ("no_convergence", "not_finite", "singular") and (cause := _vanished(ended)):
        return Outcome("singular", halt.step, when, *cause, _remedy(f, choice))
    if cause := _pole(ended):
        return Outcome("singular", halt.step, when, *cause, where_it_ends(f))
    remedy = halt.remedy
    if halt.kind == "guard" and halt.value:
        # The determinant differs from its limit by h^2 at alpha = 1/2, other guards are proportional to h.
        excess = math.sqrt(halt.value) if halt.quantity.startswith("1 - det") else abs(halt.value)
        remedy += f"; |step| below {abs(grid.step) / excess:.3g} passes here; guard = false continues unchecked"
    return Outcome(halt.kind, halt.step, when, halt.quantity, halt.value, remedy)


def _pole(ended: Ended) -> tuple[str, float] | None:
    """What L~ and H~ divide by, where it passes 0 just ahead: guard and Newton fail because of it."""
    f, last = ended.f, ended.last
    if ended.choice.method != "variational" or not (f.problem.free_hamiltonian and f.problem.free_lagrangian):
        return None
    state = {**ended.begin.state, **last, **ended.parameters}
    return pole_ahead(f, state, [last.get(f"d{k}_rate", 0.0) for k in range(f.size)], ended.grid.step)


def _own_singular_set(f: Formulas, choice: MethodChoice, halt: Stopped) -> tuple[str, float]:
    """The determinant as the formula that it is for h -> 0, with its value; its plain name where that is too long."""
    program = program_of(f, choice, Observation(momenta=False, velocities=False))
    found = None if halt.block is None else limit_text(f, program, halt.block)
    if found is None:
        return halt.quantity, halt.value
    text, sign = found
    return f"{text} (for h -> 0 the {halt.quantity})", sign * halt.value


def _vanished(ended: Ended) -> tuple[str, float] | None:
    """The factor of L~'s denominators that passes 0 about the step that failed, with its value before it."""
    choice = ended.choice
    if choice.method not in ("variational", "modified"):
        return None
    raw = (
        choice.method == "modified" or choice.form == "raw" or (choice.form != "verlet" and len(parts_of(choice)) == 2)
    )
    points = _way(ended)
    for item in ended.f.denominators:
        if not (raw or item.moves):
            continue
        values = [real_value(item.formula, point) for point in points]
        if not min(values) * max(values) > 0 or abs(values[-1]) < 1e-3 * abs(values[1]):
            return item.text, values[1]
    return None


def _way(ended: Ended) -> list[dict[str, float]]:
    """(q, v) a step before the last good point, at it, and where its velocity leads in a step and a half."""
    last, start, step = ended.last, ended.begin.state, ended.grid.step
    passed = last[CLOCK] * step
    means = [(last[f"q{k}"] - start[f"q{k}"]) / passed if passed else 0.0 for k in range(ended.f.size)]
    # A rate of 0 is that of the step that failed; the mean one says where the way led.
    rates = [last.get(f"d{k}_rate", 0.0) or mean for k, mean in enumerate(means)]
    table = ended.parameters | {f"v{k}": rate for k, rate in enumerate(rates)}
    return [
        table | {f"q{k}": last[f"q{k}"] + part * step * rate for k, rate in enumerate(rates)}
        for part in (-1.0, 0.0, 1.5)
    ]


def _remedy(f: Formulas, choice: MethodChoice) -> str:
    if choice.form != "verlet" and len(parts_of(choice)) == 2:
        return "leave symmetrised out: its two places lie on different sides there; alpha = 1/2 has order 2 too"
    if choice.method == "variational" and choice.form == "raw":
        return "use the Hamiltonian form, which is smooth there"
    if choice.method == "modified":
        names = ", ".join(f.problem.free_constants)
        constants = f"free constants {names}" if names else "free constants of L~"
        return f"choose smaller {constants}, another alpha, or the variational method in Hamiltonian form"
    return where_it_ends(f)
