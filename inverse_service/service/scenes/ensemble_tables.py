"""An ensemble in a result document: outcomes counted, last points and numbers of every member, arrays for files."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from inverse_service.integrators.trajectory import Array
from inverse_service.simulation.ensemble_members import EnsembleRun
from inverse_service.simulation.scene_data import Scene

MOST_MEMBERS = 10_000  # whose numbers a result document lists; files hold all
MOST_ENDS = 20


def ensemble_document(scene: Scene, run: EnsembleRun) -> dict[str, Any]:
    """One method of an ensemble: how many ended how, and columns with one number a member."""
    document: dict[str, Any] = {"outcome": run.outcome.kind, "steps": 0, "seconds": dict(run.seconds)}
    if run.many is None:
        return document | {"reason": run.outcome.remedy}
    many, count = run.many, len(run.many.positions)
    ended = {int(k): many.outcome(int(k)) for k in np.nonzero(~many.completed)[0]}
    kinds = Counter(outcome.kind for outcome in ended.values())
    kinds["completed"] = count - len(ended)
    document |= {"steps": scene.grid.steps, "members": count, "outcomes": dict(kinds)}
    document |= {"doubt": run.outcome.doubt} if run.outcome.doubt else {}
    document["ended"] = [
        {"member": k, "outcome": o.kind, "step": o.step, "time": o.time, "quantity": o.quantity, "remedy": o.remedy}
        for k, o in list(ended.items())[:MOST_ENDS]
    ]
    for name, column in run.numbers.items():
        finite = column[np.isfinite(column)]
        document[name] = float(finite.max()) if len(finite) else None
        document[f"median_{name}"] = float(np.median(finite)) if len(finite) else None
    document["seconds"]["per_member_step"] = run.seconds["run"] / count / scene.grid.steps
    if count <= MOST_MEMBERS:
        document["members_columns"] = {name: column.tolist() for name, column in member_columns(scene, run).items()}
    return document


def member_columns(scene: Scene, run: EnsembleRun) -> dict[str, Array]:
    """One number a member: parameters that differ, start, end, and what was observed."""
    assert run.many is not None
    assert scene.ensemble is not None
    columns = dict(scene.ensemble.values)
    for k, name in enumerate(scene.coordinates):
        columns[f"{name}_start"] = run.many.positions[:, 0, k]
        columns[f"{name}_end"] = run.many.positions[:, -1, k]
        if run.velocities is not None:
            columns[f"v_{name}_end"] = run.velocities[:, -1, k]
    columns |= {f"{name}_end": column[:, -1] for name, column in run.series.items()}
    return columns | dict(run.numbers) | {"completed": run.many.completed.astype(float)}


def ensemble_arrays(scene: Scene, run: EnsembleRun) -> dict[str, Array]:
    """t (m,), each coordinate, velocity and observable (N, m), and a number a member: what NPZ files hold."""
    assert run.many is not None
    arrays: dict[str, Array] = {"t": run.many.times}
    for k, name in enumerate(scene.coordinates):
        arrays[name] = run.many.positions[:, :, k]
        if run.velocities is not None:
            arrays[f"v_{name}"] = run.velocities[:, :, k]
    return arrays | dict(run.series) | {f"member_{name}": x for name, x in member_columns(scene, run).items()}
