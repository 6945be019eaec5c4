"""Ensembles: arrays of starts and parameters, trajectories in parallel SIMD lanes, groups of lanes on all cores.

The members of an ensemble of a scene: started, run and observed.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inverse_service import settings
from inverse_service.errors import InputError
from inverse_service.integrators.method_table import OWN_STEPS, POINT_METHODS, USES_FREE
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.kernels.codegen.compiled import Card, Compiled
from inverse_service.kernels.codegen.kernel import CONTROL
from inverse_service.kernels.codegen.program import NO_START, STATUS, STOPPED_AT, STOPPED_VALUE
from inverse_service.kernels.codegen.symengine_trees import closure
from inverse_service.kernels.machine_code.loading import processor_features
from inverse_service.simulation import initial, observing, scene_data as data
from inverse_service.simulation.derivation import Derived, problem_of
from inverse_service.simulation.estimates import TOO_LARGE, errors_of, finer
from inverse_service.simulation.execution import check, kernel_of, stopped, unknown_names, weights_of
from inverse_service.simulation.numeric_formulas import MOMENT, Formulas, NoValue, array_value, table_of

WORTH_THREADS = 2_000  # steps of groups that take as long as starting a thread
STEPS_AT_ONCE = 100_000  # steps of groups between two checks for a request to stop
ALL_METHODS = "Ensembles are run by methods that step with kernels: variational, nonholonomic, runge-kutta, and so on."


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
    grid: data.Grid
    names: Mapping[str, str]
    cancelled: bool
    iterations: int

    @cached_property
    def completed(self) -> NDArray[np.bool_]:
        """Which trajectories reached the end, (N,)."""
        found: NDArray[np.bool_] = self.memory[self.card.layout.place(STATUS)] == 0
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
    problem: data.Problem,
    choice: data.MethodChoice,
    positions: Array,
    velocities: Array,
    grid: data.Grid,
    values: Mapping[str, float | Array],
    momenta: Array | None = None,
    steps: Array | None = None,
    stop: data.Stop | None = None,
    begins: Array | None = None,
) -> Many:
    """N trajectories from `positions` and `velocities` (N, n), or `momenta` where they are known.

    `values` gives each parameter a number or (N,) numbers; `steps` (N,) are individual steps that replace that of
    the grid, `begins` individual start times. InputError for input that a single run would refuse.
    """
    check(problem, choice, [grid])
    if choice.method in ("heyoka", "modified"):
        raise InputError(ALL_METHODS)
    f = Formulas(problem)
    kernel = kernel_of(f, choice, (), lanes_here())
    count = len(positions)
    times = np.full(count, grid.begin) if begins is None else begins
    columns = _columns(f, choice, positions, velocities, momenta, values, times)
    columns["h"] = np.broadcast_to(grid.step if steps is None else steps, count)
    memory = _memory(kernel.card, columns, count)
    record, iterations, cancelled = _run_groups(kernel, memory, weights_of(choice), grid, stop)
    flat = np.moveaxis(memory, 1, 0).reshape(memory.shape[1], -1)[:, :count]
    rows = np.moveaxis(record, (1, 2), (0, 1)).reshape(record.shape[1], record.shape[2], -1)[:, :, :count]
    return _gathered(f, choice, kernel.card, columns, rows, flat, grid, cancelled, iterations)


def _columns(
    f: Formulas, choice: data.MethodChoice, positions: Array, velocities: Array, momenta: Array | None,
    values: Mapping[str, float | Array], times: Array,
) -> dict[str, Array]:  # fmt: skip
    """Values of state variables, rates and arguments by kernel name, (N,) each."""
    count = len(positions)
    given: dict[str, float | Array] = {"a": choice.tolerance if choice.method in OWN_STEPS else choice.alpha}
    for place, name in enumerate(f.problem.parameters):
        if name not in values:
            raise InputError(f"The parameter {name} needs a value.")
        given[f"c{place}"] = values[name]
    found = {name: np.broadcast_to(np.asarray(value, dtype=float), count) for name, value in given.items()}
    found[str(MOMENT)] = times
    found |= {f"q{k}": positions[:, k] for k in range(f.size)} | {f"v{k}": velocities[:, k] for k in range(f.size)}
    if choice.method in POINT_METHODS:
        return found
    start = _start_momenta(f, choice, found) if momenta is None else momenta
    found |= {f"p{k}": start[:, k] for k in range(f.size)}
    return found | {f"d{k}_rate": velocities[:, k] for k in range(f.size)}


def _start_momenta(f: Formulas, choice: data.MethodChoice, columns: Mapping[str, Array]) -> Array:
    """dL/dv of the Lagrangian that the method discretizes, (N, n)."""
    velocities = f.symbols("v")
    lagrangian = f.lagrangian if choice.method == "nonholonomic" else f.free_lagrangian
    given = {velocities[k]: value for k, value in f.dependent.items()} if choice.method != "nonholonomic" else {}
    names = [*(str(name) for letter in "qv" for name in f.symbols(letter)), *f.parameters, str(MOMENT)]
    function = closure(names, [lagrangian.diff(v).subs(given) for v in velocities])
    with np.errstate(all="ignore"):
        found = function(np.stack([columns[name] for name in names], axis=1))
    return np.asarray(found, dtype=float).reshape(-1, f.size)


def _memory(card: Card, columns: Mapping[str, Array], count: int) -> Array:
    """(groups, places, lanes); unused lanes repeat the last member."""
    layout, lanes = card.layout, card.lanes
    groups = -(-count // lanes)
    places = np.minimum(np.arange(groups * lanes), count - 1)
    memory = np.zeros((groups, layout.size, lanes))
    for name, column in columns.items():
        for place in [layout.place(name)] if name in layout.persistent else []:
            memory[:, place] = column[places].reshape(groups, lanes)
        if name in layout.arguments:
            memory[:, layout.argument_place(name)] = column[places].reshape(groups, lanes)
    memory[:, layout.place(STOPPED_AT)] = -1.0
    lost = ~np.isfinite(memory).all(axis=1)
    status, at, value = (layout.place(name) for name in (STATUS, STOPPED_AT, STOPPED_VALUE))
    memory[:, status][lost], memory[:, at][lost], memory[:, value][lost] = NO_START, 0.0, np.nan
    return memory


def _run_groups(
    kernel: Compiled, memory: Array, weights: tuple[float, ...], grid: data.Grid, stop: data.Stop | None
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


def _gathered(
    f: Formulas, choice: data.MethodChoice, card: Card, columns: Mapping[str, Array], rows: Array, memory: Array,
    grid: data.Grid, cancelled: bool, iterations: int,
) -> Many:  # fmt: skip
    """Records by member, beginning with the start; constant values are repeated."""
    letter = "v" if choice.method in POINT_METHODS else "p"
    places = {name: k for k, name in enumerate(card.layout.columns)}
    tables = []
    for kind in ("q", letter):
        table = np.empty((memory.shape[1], len(rows) + 1, f.size))
        for k in range(f.size):
            start = columns[f"{kind}{k}"]
            table[:, 0, k] = start
            place = places.get(f"{kind}{k}")
            table[:, 1:, k] = start[:, None] if place is None else rows[:, place].T
        tables.append(table)
    status, stopped_at = (memory[card.layout.place(name)] for name in (STATUS, STOPPED_AT))
    ended = (status[:, None] != 0) & (grid.recorded[None, :] > stopped_at[:, None])
    for table in tables:
        table[ended] = np.nan
    return Many(grid.times, tables[0], tables[1], letter, card, memory, grid, unknown_names(f), cancelled, iterations)


MOST_SHARPER = 2**22  # steps of all members together
ELSEWHERE = (
    "{} of {} members differ with {} by more than a tenth of the range of a coordinate. The first one of them is "
    "member {}."
)


@dataclass(frozen=True, slots=True)
class EnsembleRun:
    """One method for all members. `series` are columns (N, m) of what is observed, `numbers` (N,) of each member."""

    requested: data.Requested
    outcome: Outcome
    many: Many | None
    velocities: Array | None = None
    series: Mapping[str, Array] = field(default_factory=dict)
    numbers: Mapping[str, Array] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)


def run_members(scene: data.Scene, derived: Derived, requested: data.Requested, stop: data.Stop | None) -> EnsembleRun:
    """All members by one method."""
    assert scene.ensemble is not None
    if requested.method in (data.EXACT, "heyoka", "modified") or requested.choice is None:
        return EnsembleRun(requested, Outcome("unavailable", remedy=ALL_METHODS), None)
    problem = problem_of(scene, requested, derived)
    if isinstance(problem, data.Unavailable):
        return EnsembleRun(requested, Outcome("unavailable", remedy=problem.reason), None)
    problem = problem.with_used_parameters()
    free = derived.free.get(requested.free) if requested.method in USES_FREE else None
    known = free if isinstance(free, data.FreeLagrangian) else None
    members = scene.ensemble
    values: dict[str, float | Array] = {**scene.values, **(known.constants if known else {})}
    values |= dict(requested.constants) | dict(members.values)
    begun = time.perf_counter()
    momenta = _momenta(known, members, values)
    try:
        many = run_ensemble(
            problem, requested.choice, members.positions, members.velocities, scene.grid, values, momenta, stop=stop
        )
    except InputError as error:
        return EnsembleRun(requested, Outcome("unavailable", remedy=error.detail), None)
    ran = time.perf_counter()
    lost = initial.without_value(scene) & (many.memory[many.card.layout.place(STATUS)] == 0)
    for name, value in ((STATUS, NO_START), (STOPPED_AT, 0.0), (STOPPED_VALUE, np.nan)):
        many.memory[many.card.layout.place(name), lost] = value
    many.positions[lost, 1:] = many.rates[lost, 1:] = np.nan
    velocities = _point_velocities(scene, problem, requested, many, values)
    series, numbers = _observed(scene, many, velocities, values)
    seconds = {"run": ran - begun, "observed": time.perf_counter() - ran}
    estimates, doubt = ({}, "") if many.cancelled else _estimated(scene, problem, requested, many, values, momenta)
    numbers |= estimates
    outcome = Outcome("cancelled" if many.cancelled else _kind(many), scene.grid.steps, doubt=doubt)
    return EnsembleRun(requested, outcome, many, velocities, series, numbers, seconds)


def _kind(many: Many) -> str:
    """The common outcome: all members completed, some did, or, if none did, the most frequent outcome."""
    if many.completed.any():
        return "completed" if many.completed.all() else "partly"
    return Counter(many.outcome(member).kind for member in range(len(many.positions))).most_common(1)[0][0]


def _estimated(
    scene: data.Scene, problem: data.Problem, requested: data.Requested, many: Many,
    values: Mapping[str, float | Array], momenta: Array | None,
) -> tuple[dict[str, Array], str]:  # fmt: skip
    """({estimated_error: (N,)}, how many members differ with half the step, or a smaller tolerance), for as many
    members as MOST_SHARPER allows; nan for other members and those that did not reach the end."""
    members, count, again = scene.ensemble, len(many.positions), finer(requested, scene.grid)
    choice, most = again.requested.choice, max(1, MOST_SHARPER // max(again.grid.steps, 1))
    assert members is not None
    assert choice is not None
    rows = np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))
    own, begun = _part(values, momenta, rows)
    found = run_ensemble(problem, choice, members.positions[rows], members.velocities[rows], again.grid, own, begun)
    points, estimates = found.positions.shape[1], np.full(count, np.nan)
    errors, shares = errors_of(many.positions[rows, :points], found.positions, initial.angles(scene), again.part)
    estimates[rows] = np.where(many.completed[rows], errors.max(axis=(1, 2)), np.nan)
    far = (shares > TOO_LARGE).any(axis=(1, 2)) & many.completed[rows]
    looked = f"{len(rows):,}" if len(rows) == count else f"{len(rows):,} examined (of {count:,})"
    doubt = ELSEWHERE.format(f"{far.sum():,}", looked, again.how, rows[far.argmax()]) if far.any() else ""
    return {"estimated_error": estimates}, doubt


def _part(
    values: Mapping[str, float | Array], momenta: Array | None, rows: NDArray[np.int64]
) -> tuple[dict[str, float | Array], Array | None]:
    """Values and momenta of some members."""
    own = {name: value[rows] if isinstance(value, np.ndarray) else value for name, value in values.items()}
    return own, None if momenta is None else momenta[rows]


def _momenta(
    free: data.FreeLagrangian | None, members: data.Members, values: Mapping[str, float | Array]
) -> Array | None:
    """The momenta that L~ gives directly (they may be 0/0 in the velocities), by member if parameters differ."""
    if free is None or free.start_momenta is None:
        return None
    if not members.values:
        return free.start_momenta(members.positions, members.velocities, {k: float(x) for k, x in values.items()})
    rows = []
    for k, (q, v) in enumerate(zip(members.positions, members.velocities, strict=True)):
        own = {name: float(value[k]) if isinstance(value, np.ndarray) else value for name, value in values.items()}
        rows.append(free.start_momenta(q, v, own))
    return np.array(rows)


def _flat(values: Mapping[str, float | Array], points: int) -> Any:
    """Values of the parameters at all points of all members."""
    return {name: np.repeat(x, points) if isinstance(x, np.ndarray) else x for name, x in values.items()}


def _point_velocities(
    scene: data.Scene, problem: data.Problem, requested: data.Requested, many: Many, values: Mapping[str, float | Array]
) -> Array | None:
    """(N, m, n) at the recorded points."""
    if many.carried == "v":
        return many.rates
    shape = many.positions.shape
    flat = Trajectory(
        np.tile(many.times, shape[0]), many.positions.reshape(-1, shape[2]), many.rates.reshape(-1, shape[2]), None,
        Outcome("completed"), 0, 0, 0.0, 0.0,
    )  # fmt: skip
    found = observing.point_velocities(scene, problem, requested.method, flat, _flat(values, shape[1]))
    return None if found is None else found.reshape(shape)


def _observed(
    scene: data.Scene, many: Many, velocities: Array | None, values: Mapping[str, float | Array]
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Energy, where the scene observes it, and its own observables: columns (N, m), and numbers (N,)."""
    shape = many.positions.shape
    speeds = None if velocities is None else velocities.reshape(-1, shape[2])
    table = table_of(
        scene.coordinates, many.positions.reshape(-1, shape[2]), speeds, _flat(values, shape[1]),
        np.tile(many.times, shape[0]),
    )  # fmt: skip
    formulas = {one.name: one.expression for one in scene.own}
    if "energy" in scene.observe and scene.lagrangian is not None:
        formulas["energy"] = observing.energy(scene.lagrangian, scene.coordinates)
    series: dict[str, Array] = {}
    for name, tree in formulas.items():
        try:
            series[name] = array_value(tree, table).reshape(shape[:2])
        except NoValue:
            continue
    numbers: dict[str, Array] = {}
    if "energy" in series and velocities is not None and observing.why_energy_varies(scene) is None:
        begin = many.positions[:, 0], velocities[:, 0], np.full(shape[0], many.times[0])
        start = observing.without_noise(series["energy"][:, 0], observing.point_kinetic(scene, *begin, values))[:, None]
        with np.errstate(all="ignore"):
            errors = np.abs(series["energy"] - start) / np.where(start == 0, 1.0, np.abs(start))
        numbers["max_energy_error"] = np.where(many.completed, errors.max(axis=1), np.nan)
    return series, numbers
