"""Ensembles: arrays of starts and parameters, trajectories in parallel SIMD lanes, groups of lanes on all cores.

`ensemble_runs` starts, runs and observes the members of the ensemble of a scene.
"""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inverse_service import settings
from inverse_service.errors import InputError
from inverse_service.integrators.method_table import OWN_STEPS, POINT_METHODS
from inverse_service.integrators.trajectory import Array, Outcome
from inverse_service.kernels.codegen.compiled import Card, Compiled
from inverse_service.kernels.codegen.kernel import CONTROL
from inverse_service.kernels.codegen.program import STATUS, STOPPED_AT
from inverse_service.kernels.codegen.symengine_trees import closure
from inverse_service.kernels.machine_code.loading import processor_features
from inverse_service.simulation import scene_data as data
from inverse_service.simulation.execution import check, kernel_of, memory_of, stopped, unknown_names, weights_of
from inverse_service.simulation.numeric_formulas import MOMENT, Formulas

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
    check(problem, choice)
    if choice.method in ("heyoka", "modified"):
        raise InputError(ALL_METHODS)
    f = Formulas(problem)
    kernel = kernel_of(f, choice, (), lanes_here())
    count = len(positions)
    times = np.full(count, grid.begin) if begins is None else begins
    columns = _columns(f, choice, positions, velocities, momenta, values, times)
    columns["h"] = np.broadcast_to(grid.step if steps is None else steps, count)
    memory = memory_of(kernel.card, columns, count)
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
