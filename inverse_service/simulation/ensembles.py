"""The members of an ensemble of a scene: started, run by one method, observed and checked."""

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inverse_service.errors import InputError
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.kernels.codegen.program import NOT_STARTED, STATUS
from inverse_service.simulation import initial, observing, scene_data as data, truth
from inverse_service.simulation.derivation import Derived, free_of, problem_of
from inverse_service.simulation.estimates import TOO_LARGE, errors_of, finer
from inverse_service.simulation.execution import ALL_METHODS, Many, run_ensemble
from inverse_service.simulation.numeric_formulas import NoValue, array_value, table_of

MOST_SHARPER, LOOKED_AT = 2**22, 16  # steps of all members together; members in which a missed force is looked for
MEMBER = "Member {}: {}"
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


def run_members(derived: Derived, requested: data.Requested, stop: data.Stop | None) -> EnsembleRun:
    """All members by one method; an outcome where it cannot run them."""
    try:
        return _run_members(derived, requested, stop)
    except InputError as error:
        return EnsembleRun(requested, Outcome("unavailable", remedy=error.detail), None)


def _run_members(derived: Derived, requested: data.Requested, stop: data.Stop | None) -> EnsembleRun:
    scene = derived.scene
    members = scene.ensemble
    assert members is not None
    if requested.choice is None:
        raise data.Unavailable(ALL_METHODS)
    known, problem = free_of(requested, derived), problem_of(requested, derived).with_used_parameters()
    values: dict[str, float | Array] = {**scene.values, **(known.constants if known else {})}
    values |= dict(requested.constants) | dict(members.values)
    begun = time.perf_counter()
    momenta = _momenta(known, members, values)
    many = run_ensemble(
        problem, requested.choice, members.positions, members.velocities, scene.grid, values, momenta, stop=stop
    )
    ran = time.perf_counter()
    lost = initial.without_value(scene) & (many.memory[many.card.layout.place(STATUS)] == 0)
    for name, value in NOT_STARTED.items():
        many.memory[many.card.layout.place(name), lost] = value
    many.positions[lost, 1:] = many.rates[lost, 1:] = np.nan
    velocities = _point_velocities(scene, problem, requested, many, values)
    series, numbers = _observed(scene, many, velocities, values)
    seconds = {"run": ran - begun, "observed": time.perf_counter() - ran}
    estimates, doubt = ({}, "") if many.cancelled else _estimated(scene, problem, requested, many, values, momenta)
    numbers |= estimates
    if not many.cancelled and not doubt:
        run = EnsembleRun(requested, Outcome(""), many, velocities, series, numbers)
        doubt = _missed(scene, problem, run, derived, values, stop)
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


def _missed(
    scene: data.Scene, problem: data.Problem, run: EnsembleRun, derived: Derived, values: Mapping[str, float | Array],
    stop: data.Stop | None,
) -> str:  # fmt: skip
    """The doubt of the first of LOOKED_AT members that misses a force acting within a step, with its error."""
    many, members, estimates = run.many, scene.ensemble, run.numbers["estimated_error"]
    assert many is not None
    assert members is not None
    for row in np.flatnonzero(many.completed)[:: max(1, len(many.positions) // LOOKED_AT)]:
        if run.velocities is None or (stop is not None and stop()):
            break
        own = _of_member(values, row)
        start = members.positions[row], members.velocities[row]
        alone = replace(scene, positions=start[0], velocities=start[1], values=own, ensemble=None)
        ran = Trajectory(many.times, many.positions[row], None, run.velocities[row], many.outcome(row))
        seen = observing.Observed(alone, run.requested, ran, problem, own, None, in_pieces=True)
        found = truth.with_missed_force(seen, {"estimated_error": estimates[row], "doubt": ""}, derived, stop)
        if found["doubt"]:
            estimates[row] = np.nan if found["estimated_error"] is None else found["estimated_error"]
            return MEMBER.format(row, found["doubt"])
    return ""


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
    starts = enumerate(zip(members.positions, members.velocities, strict=True))
    return np.array([free.start_momenta(q, v, _of_member(values, k)) for k, (q, v) in starts])


def _of_member(values: Mapping[str, float | Array], row: int) -> dict[str, float]:
    return {name: float(value[row]) if isinstance(value, np.ndarray) else value for name, value in values.items()}


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
        Outcome("completed"),
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
        moments = np.full(shape[0], many.times[0])
        begin = table_of(scene.coordinates, many.positions[:, 0], velocities[:, 0], values, moments)
        start = observing.without_noise(*observing.energies(scene, begin))[:, None]
        with np.errstate(all="ignore"):
            errors = np.abs(series["energy"] - start) / np.where(start == 0, 1.0, np.abs(start))
        numbers["max_energy_error"] = np.where(many.completed, errors.max(axis=1), np.nan)
    return series, numbers
