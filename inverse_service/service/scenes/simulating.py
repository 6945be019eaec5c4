"""Simulation as it runs inside a worker process: scene document in, result document out.

Of an ensemble the result counts outcomes, and has last points and numbers of every member.
"""

import io
import json
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from pydantic_core import to_jsonable_python

from api_schemas.scene import SceneDocument
from inverse_service import __version__, deadline
from inverse_service.errors import InputError
from inverse_service.expressions.printing import to_text, with_decimals
from inverse_service.integrators.trajectory import Array
from inverse_service.service.documents import accepting
from inverse_service.service.scenes import scene_reading
from inverse_service.simulation import accuracy, derivation
from inverse_service.simulation.advice import advice, by_itself
from inverse_service.simulation.events import Found
from inverse_service.simulation.observing import columns_of, last_point, why_energy_varies
from inverse_service.simulation.running import EnsembleRun, MethodRun, SceneRun, run_scene
from inverse_service.simulation.scene_data import (
    FreeLagrangian,
    Progress,
    Requested,
    Scene,
    Truth,
)

FORMAT = "inverse-service/simulation/1"
# Points of a trajectory in a result document; files hold all that were recorded.
MOST_POINTS = 2001
MOST_EVENTS = 20_000
AGAIN_SECONDS = 600.0  # the deadline of a page comes first
# Time of a scene reserved for observing and writing the results: a fraction, larger for a short
# run; seconds.
SHARE_AFTER, LEAST_AFTER, LARGEST_SHARE = 0.1, 1.0, 0.3
MOST_MEMBERS = 10_000  # members whose numbers a result document lists; files contain all
MOST_ENDS = 20


class Ran(NamedTuple):
    """What was run, the seconds of each stage, and the decimal numbers that were typed."""

    found: SceneRun
    stages: dict[str, float]
    decimals: frozenset[Fraction]


def simulate(
    document: Any, progress: Progress | None = None, time_limit: float = 60.0
) -> dict[str, Any]:
    """The result document of a scene. Raises InputError for a scene that cannot be accepted.

    A method that is still running near the time limit is stopped there, and its outcome says so.
    """
    return simulation_document(run_document(document, progress, time_limit))


def simulate_tables(
    document: Any, progress: Progress | None = None, time_limit: float = 60.0
) -> dict[str, Any]:
    """The result document with all recorded points: {"result": ..., "tables": {label: {column:
    array}}}.
    """
    return with_tables(run_document(document, progress, time_limit))


def with_tables(ran: Ran) -> dict[str, Any]:
    """What `simulate_tables` gives of a scene that was run."""
    found, scene = ran.found, ran.found.scene
    single = [run for run in found.runs if isinstance(run, MethodRun)]
    tables = {
        run.requested.label: ensemble_arrays(scene, run)
        for run in found.runs
        if isinstance(run, EnsembleRun)
    }
    tables |= {
        run.requested.label: table_of_run(scene, run)
        for run in single
        if run.trajectory is not None
    }
    true = found.truth
    truth = (
        {"t": true.times, **columns_of(scene, true.positions)} if isinstance(true, Truth) else None
    )
    events = {}
    for run in (
        run for run in single if run.events
    ):  # the number of the event, t, the coordinates and velocities
        parts = [
            {"event": np.full(len(e.times), k), **_event_columns(scene, e)}
            for k, e in enumerate(run.events, 1)
        ]
        events[run.requested.label] = {
            name: np.concatenate([part[name] for part in parts]) for name in parts[0]
        }
    return {
        "result": simulation_document(ran),
        "tables": tables,
        "truth": truth,
        "events": events,
    }


def every_point(
    document: Mapping[str, Any], result: Mapping[str, Any], label: str
) -> dict[str, Array] | None:
    """All columns at every recorded point of a method of a stored result, whose steps are repeated.

    None where the result has no points of it. Where a time limit ended it elsewhere, the stored
    points, if these are all that were recorded; else an InputError.
    """
    methods = result.get("methods", [])
    place = next(
        (k for k, one in enumerate(methods) if one["label"] == label and one.get("points")), None
    )
    if place is None:
        return None
    stored, alone = methods[place], {**document, "methods": [document["methods"][place]]}
    found = simulate_tables(alone, time_limit=AGAIN_SECONDS)
    (again,) = found["result"]["methods"]
    if (again["outcome"], again["steps"]) == (stored["outcome"], stored["steps"]):
        table: dict[str, Array] = found["tables"][again["label"]]
        return table
    if stored["points"]["every"] > result["record_every"]:
        raise InputError(
            f"The run made {again['steps']} steps now and {stored['steps']} before: take the JSON."
        )
    return {
        name: np.array(column, dtype=float) for name, column in stored["points"]["columns"].items()
    }


def csv_bytes(columns: Mapping[str, Any]) -> bytes:
    """Columns of equal length as CSV, with all significant digits; nan where there is no value.

    Times k h have 15 digits, which is what they are known to: 0.15 and not 0.15000000000000002.
    """
    written = [
        [f"{value:.15g}" for value in column] if name == "t" else list(map(repr, column))
        for name, column in (
            (name, np.asarray(values, dtype=float).tolist()) for name, values in columns.items()
        )
    ]
    return "\n".join(map(",".join, ([*columns], *zip(*written, strict=True)))).encode() + b"\n"


class NpzFile(NamedTuple):
    """The bytes of a file, and its metadata as JSON."""

    content: bytes
    metadata: str


def npz_bytes(columns: Mapping[str, Any], document: Any, label: str, provenance: Any) -> NpzFile:
    """Arrays as NPZ, and its `metadata`: scene, method and version as text."""
    given = {"scene": document, "method": label, "provenance": provenance}
    metadata = json.dumps(given, ensure_ascii=False, default=str)
    stream = io.BytesIO()
    np.savez_compressed(stream, **columns, metadata=np.array(metadata))
    return NpzFile(stream.getvalue(), metadata)


# Values that are not finite are reported in the numbers, so numpy does not need to warn of them.
@np.errstate(all="ignore")
def run_document(document: Any, progress: Progress | None, time_limit: float) -> Ran:
    """Read, derive and run."""
    begun = time.perf_counter()
    after = max(SHARE_AFTER * time_limit, min(LEAST_AFTER, LARGEST_SHARE * time_limit))
    # CPU time counts, not wall-clock time, so that the load of the machine has no influence. An
    # ensemble uses threads.
    now = (
        time.monotonic
        if isinstance(document, Mapping) and document.get("ensemble")
        else deadline.now
    )
    end = now() + time_limit - after
    schema = scene_reading.scene_schema(document)
    with scene_reading.as_typed(document):
        scene, system = scene_reading.read_scene(schema)
    read = time.perf_counter()
    if progress is not None:
        progress("deriving")
    derived = derivation.Derived(scene, _finder(schema, system), lambda: now() > end)
    if not schema.methods:
        scene = by_itself(scene, derived)
    if "energy" in scene.observe and (scene.accelerations is not None or why_energy_varies(scene)):
        from inverse_service.service.scenes import scene_lagrangian

        scene = replace(scene, conserved=scene_lagrangian.conserved(system, derived))
    done = time.perf_counter()
    half = (now() + end) / 2
    found = run_scene(replace(derived, scene=scene), progress, lambda: now() > half)
    stages = {"read": read - begun, "derive": done - read, "run": time.perf_counter() - done}
    decimals = accepting.typed_decimals(document) | accepting.typed_decimals(system.document)
    return Ran(found, stages, decimals)


def _finder(schema: SceneDocument, system: scene_reading.MechanicalSystem) -> derivation.Find:
    """That of `scene_lagrangian`, which loads the solver, once a method needs a Lagrangian."""

    def find(*asked: Any) -> FreeLagrangian:
        from inverse_service.service.scenes import scene_lagrangian

        return scene_lagrangian.finder(schema, system)(*asked)

    return find


def table_of_run(scene: Scene, run: MethodRun) -> dict[str, Any]:
    """Columns of all recorded points: t, the coordinates, velocities v_x, momenta p_x, and observed
    quantities.
    """
    trajectory = run.trajectory
    assert trajectory is not None
    columns: dict[str, Any] = {"t": trajectory.times}
    velocities = None if run.observed is None else run.observed.velocities
    for prefix, table in (
        ("", trajectory.positions),
        ("v_", velocities),
        ("p_", trajectory.momenta),
    ):
        if table is not None:
            columns |= columns_of(scene, table, prefix)
    return columns | dict(run.series)


def simulation_document(ran: Ran) -> dict[str, Any]:
    """The simulated system, the outcome of each method, and every observed quantity."""
    with with_decimals(ran.decimals):
        return as_plain(_document_of(ran.found, ran.stages))


def _document_of(found: SceneRun, stages: Mapping[str, float]) -> dict[str, Any]:
    scene, truth = found.scene, found.truth
    equations = scene.accelerations and dict(
        zip(scene.coordinates, map(to_text, scene.accelerations), strict=True)
    )
    known: dict[str, Any] | None = (
        {"against": None, "reason": truth} if isinstance(truth, str) else None
    )
    if isinstance(truth, Truth):
        known = {name: getattr(truth, name) for name in ("against", "uncertainty", "seconds")}
        known |= {name: text for name in ("by", "reason") if (text := getattr(truth, name))}
    return {
        "format": FORMAT,
        "name": scene.name,
        "system": {
            "coordinates": scene.coordinates,
            "lagrangian": None if scene.lagrangian is None else to_text(scene.lagrangian),
            "constraints": [*map(to_text, scene.constraints)],
            "equations": equations,
            "effects": scene.effects,
            "parameters": scene.values,
        },
        "initial": {
            "positions": columns_of(scene, scene.positions),
            "velocities": columns_of(scene, scene.velocities),
        },
        "units": scene.units,
        "bodies": scene.bodies,
        "step": scene.grid.step,
        "steps": scene.grid.steps,
        "record_every": scene.grid.record_every,
        "observe": scene.observe,
        "effects": found.effects,
        "methods": [
            _method(scene, run) if isinstance(run, MethodRun) else ensemble_document(scene, run)
            for run in found.runs
        ],
        "truth": known,
        "advice": advice(scene, found.derived),
        **({} if found.lyapunov is None else {"lyapunov": found.lyapunov}),
        "circle_coordinates": None
        if scene.circle is None
        else [scene.coordinates[k] for k in scene.circle],
        "derived": sorted(found.derived.seconds),
        "seconds": dict(stages)
        | {f"derive: {name}": value for name, value in found.derived.seconds.items()},
        "notes": scene.notes,
        "provenance": {"program": "inverse-service", "version": __version__},
    }


def _method(scene: Scene, run: MethodRun) -> dict[str, Any]:
    requested, trajectory, switches = run.requested, run.trajectory, run.switches
    document = {**_requested(requested), **_outcome(scene, run), **run.numbers}
    if run.events:
        document["events"] = [
            {"when": to_text(one.event.formula), "count": len(one.times)}
            | {
                "columns": {
                    name: column[:MOST_EVENTS]
                    for name, column in _event_columns(scene, one).items()
                }
            }
            | ({"note": one.note} if one.note else {})
            for one in run.events
        ]
    if run.contacts:
        document["contacts"] = [
            {"name": one.name, "impacts": one.impacts, "greatest_force": one.greatest_force}
            | {"rests": [{"begin": begin, "end": end} for begin, end in one.rests]}
            for one in run.contacts
        ]
    if run.observed is not None:
        at, *states = run.final or last_point(run.observed)
        positions, velocities = (None if row is None else columns_of(scene, row) for row in states)
        document["final"] = {"t": at, "positions": positions, "velocities": velocities}
    if switches:
        listed, shown = switches[:MOST_EVENTS], {1: "above", -1: "below", 0: "sticks"}
        columns = {
            "t": [one.time for one in listed],
            "when": [to_text(one.function) for one in listed],
        }
        columns["to"] = [shown[one.side] for one in listed]
        document["switches"] = {"count": len(switches), "columns": columns}
    if run.free is not None:
        document["free_lagrangian"] = to_text(run.free.lagrangian)
        document["constants"] = dict(run.free.constants) | dict(requested.constants)
        document["free_lagrangian_source"] = run.free.source
    if trajectory is not None:
        document["force_evaluations"] = trajectory.force_evaluations
        document["newton_iterations"] = trajectory.newton_iterations
    if trajectory is not None and (run.series or "trajectory" in scene.observe):
        # Thinned series, only those of observed quantities.
        every = max(1, -(-(len(trajectory.times) - 1) // (MOST_POINTS - 1)))
        places = columns_of(scene, trajectory.positions) if "trajectory" in scene.observe else {}
        series = {"t": trajectory.times, **places, **run.series}
        thinned = {name: np.asarray(column)[::every] for name, column in series.items()}
        document["points"] = {"every": every * scene.grid.record_every, "columns": thinned}
    return document | {"seconds": run.seconds}


def _event_columns(scene: Scene, found: Found) -> dict[str, Array]:
    return {
        "t": found.times,
        **columns_of(scene, found.positions),
        **columns_of(scene, found.velocities, "v_"),
    }


def _requested(requested: Requested) -> dict[str, Any]:
    choice = requested.choice
    return {
        "label": requested.label,
        "method": requested.method.replace("_", "-"),
        "alpha": requested.alpha,
        "symmetrised": choice.symmetrised,
        "order": accuracy.order_of(requested),
        "form": choice.form if choice.method == "variational" else None,
        "start": requested.convention if requested.alpha is not None else None,
    }


def _outcome(scene: Scene, run: MethodRun) -> dict[str, Any]:
    """`outcome` and `steps` made; for a run that stopped, also where, the cause and the remedy."""
    outcome = run.outcome
    if run.trajectory is None:
        return {"outcome": outcome.kind, "steps": 0, "reason": outcome.remedy}
    note = {name: text for name in ("note", "doubt") if (text := getattr(outcome, name))}
    if outcome.completed:
        return {
            "outcome": outcome.kind,
            "steps": scene.grid.steps if outcome.step is None else outcome.step,
            **note,
        }
    parts: dict[str, Any] = {
        name: getattr(outcome, name) for name in ("step", "time", "quantity", "value", "remedy")
    }
    parts["sentence"] = outcome.sentence
    return {"outcome": outcome.kind, "steps": outcome.step or 0, "stopped": parts, **note}


def as_plain(value: Mapping[str, Any]) -> dict[str, Any]:
    """JSON types only; numbers that are not finite become null, which JSON can hold."""
    plain: dict[str, Any] = to_jsonable_python(
        value, inf_nan_mode="null", fallback=lambda array: array.tolist()
    )
    return plain


def ensemble_document(scene: Scene, run: EnsembleRun) -> dict[str, Any]:
    """One method of an ensemble: the count of each outcome, and columns with one number per
    member.
    """
    document = _requested(run.requested) | {"outcome": run.outcome.kind, "seconds": run.seconds}
    many, count = run.many, len(run.many.positions)
    ended = {int(k): many.outcome(int(k)) for k in np.nonzero(~many.completed)[0]}
    kinds = Counter(outcome.kind for outcome in ended.values())
    kinds["completed"] = count - len(ended)
    document |= {"steps": scene.grid.steps, "members": count, "outcomes": dict(kinds)}
    document |= {"doubt": run.outcome.doubt} if run.outcome.doubt else {}
    document["ended"] = [
        {
            "member": k,
            "outcome": o.kind,
            "step": o.step,
            "time": o.time,
            "quantity": o.quantity,
            "remedy": o.remedy,
        }
        for k, o in list(ended.items())[:MOST_ENDS]
    ]
    for name, column in run.numbers.items():
        finite = column[np.isfinite(column)]
        document[name] = float(finite.max()) if len(finite) else None
        document[f"median_{name}"] = float(np.median(finite)) if len(finite) else None
    if count <= MOST_MEMBERS:
        document["members_columns"] = {
            name: column.tolist() for name, column in member_columns(scene, run).items()
        }
    return document


def member_columns(scene: Scene, run: EnsembleRun) -> dict[str, Array]:
    """One number per member: varying parameters, start, end, and observed quantities."""
    columns = {} if scene.ensemble is None else dict(scene.ensemble.values)
    for k, name in enumerate(scene.coordinates):
        columns[f"{name}_start"] = run.many.positions[:, 0, k]
        columns[f"{name}_end"] = run.many.positions[:, -1, k]
        if run.velocities is not None:
            first = run.velocities[:, 0, k]
            columns |= {f"v_{name}_start": first} if np.ptp(first) > 0 else {}
            columns[f"v_{name}_end"] = run.velocities[:, -1, k]
    columns |= {f"{name}_end": column[:, -1] for name, column in run.series.items()}
    return columns | dict(run.numbers) | {"completed": run.many.completed.astype(float)}


def ensemble_arrays(scene: Scene, run: EnsembleRun) -> dict[str, Array]:
    """t (m,), each coordinate, velocity and observable (N, m), and one number per member: the
    content of NPZ files.
    """
    arrays: dict[str, Array] = {"t": run.many.grid.times} | columns_of(scene, run.many.positions)
    arrays |= {} if run.velocities is None else columns_of(scene, run.velocities, "v_")
    return (
        arrays
        | dict(run.series)
        | {f"member_{name}": x for name, x in member_columns(scene, run).items()}
    )
