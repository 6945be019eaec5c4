"""What a kernel left, as a trajectory with a typed outcome: what vanished is said as a formula in the user's names.

Zeros of the denominators of L~ just ahead of where a run stopped are its cause where the formulas have a pole there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
import symengine

from inverse_service.codegen.compiled import Card, Compiled
from inverse_service.codegen.planning import limit_at_zero_step
from inverse_service.codegen.program import CLOCK, Program, Solve
from inverse_service.codegen.symengine_trees import STEP, Formula, real_value, symbol
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Apply, Expression, Symbol, Velocity, add, multiply, number
from inverse_service.integrators.method_table import GEOMETRIC, OWN_STEPS, POINT_METHODS
from inverse_service.integrators.tableaux import composition
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.simulation.callables import Denominator, Formulas
from inverse_service.simulation.execution import Run, Stopped, at_last, stopped
from inverse_service.simulation.scene_data import Grid, MethodChoice, Observation, Start
from inverse_service.simulation.schemes import parts_of, program_of
from inverse_service.simulation.starting import Initial
from inverse_service.simulation.watches import where_it_ends

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
