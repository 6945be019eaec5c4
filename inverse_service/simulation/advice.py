"""Recommend a method for a scene from its formulas."""

from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from inverse_service.errors import InputError
from inverse_service.integrators import method_table
from inverse_service.mechanics import euler_lagrange
from inverse_service.simulation import (
    derivation,
    numeric_formulas,
    scene_data as data,
    scene_graph,
)
from inverse_service.simulation.sentences import say

STIFF = 1e3  # length of a run in decay times beyond which an explicit method spends its steps on decayed components
SLOWER = 1e6  # decay times beyond which `adaptive` reaches 1e-12 later than `stiff`
SHARE = 10.0  # real parts compared with imaginary ones


def advice(scene: data.Scene, derived: derivation.Derived) -> dict[str, Any] | None:
    """{method, order, alpha, reason}: separable, constrained, conservative, stiff or none of these;
    None if L is degenerate. Of a system given by its equations a Lagrangian may have been found.
    """
    free = scene.found
    lagrangian = free.lagrangian if free is not None else scene.lagrangian
    if is_stiff(derived):
        return euler_lagrange.advice(
            "stiff", None, "what decays fast would hold an explicit method to short steps."
        )
    if lagrangian is None or scene.forces:
        return euler_lagrange.advice("adaptive", None, euler_lagrange.NOTHING_KEPT)
    if derived.degenerate:
        return None
    if scene.constraints:
        return euler_lagrange.advice_for_constraints(
            lagrangian, scene.constraints, scene.coordinates
        )
    ends = (
        (*numeric_formulas.walls(lagrangian, scene.coordinates), *free.domain)
        if free is not None
        else ()
    )
    return euler_lagrange.advice_for_lagrangian(lagrangian, scene.coordinates, ends)


def by_itself(scene: data.Scene, derived: derivation.Derived) -> data.Scene:
    """A scene that names no method, with `stiff` in the place of `adaptive` where this is
    faster.
    """
    if not is_stiff(derived, SLOWER):
        return scene
    choice = data.MethodChoice("stiff", tolerance=method_table.METHODS["adaptive"].tolerance or 0.0)
    instead = data.Requested("stiff", choice)
    return replace(scene, methods=(instead,), notes=(*scene.notes, say("stiff_instead")))


def is_stiff(derived: derivation.Derived, beyond: float = STIFF) -> bool:
    """Whether an explicit method would be held to short steps by what decays, as far as the
    accelerations tell.
    """
    scene = derived.scene
    if scene.lagrangian is not None and not scene.forces:
        return False
    with suppress(InputError):
        return not derived.degenerate and decay_times(scene, derived.motion()) > beyond
    return False


def decay_times(scene: data.Scene, motion: data.Problem) -> float:
    """The length of the run in those of the fastest real eigenvalue of the linearized motion at the
    start; 0 where oscillations are as fast.
    """
    n, graph = len(scene.coordinates), scene_graph.graph_of(motion)
    inputs = graph.inputs(
        scene.positions[None], scene.velocities[None], scene.values, scene.grid.begin
    )
    matrix = np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), graph.slopes(inputs)])
    if not np.isfinite(matrix).all():
        return 0.0
    values = np.linalg.eigvals(matrix)
    fastest = values[np.argmax(np.abs(values.real))]
    length = abs(fastest.real) * scene.grid.step * scene.grid.steps
    return float(length) if abs(fastest.real) > SHARE * abs(fastest.imag) else 0.0
