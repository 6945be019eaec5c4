"""Which method to take for a scene, seen from its formulas, and what each effect and observed quantity adds to a step.

step_ns      time of a step of the whole scene, best of several runs over its first steps, or over more than it has,
             where these are too few, less that of a run of one step: to call a kernel takes longer than many steps
operations   floating-point instructions and calls in the text of its kernel, which no load changes
of a part    the difference to the same scene without it; no time where that is below the noise
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from inverse_service import errors
from inverse_service.expressions import derivative
from inverse_service.expressions import tree as ex
from inverse_service.integrators import method_table, trajectory
from inverse_service.kernels.codegen import compiled
from inverse_service.mechanics import method_advice
from inverse_service.simulation import derivation, initial, numeric_formulas, schemes
from inverse_service.simulation import scene_data as data

STIFF = 1e3  # decay times that a run is long, beyond which an explicit method spends its steps on what has decayed
SHARE = 10.0  # real parts compared with imaginary ones


def advice(
    scene: data.Scene, accelerations: tuple[ex.Expression, ...] | None, free: data.FreeLagrangian | None = None
) -> dict[str, Any] | None:
    """{method, order, alpha, reason}: separable, constrained, conservative, stiff or none of these.

    `free` is a Lagrangian that was found for a system given by its equations. None where L is degenerate.
    """
    lagrangian = free.lagrangian if scene.lagrangian is None and free is not None else scene.lagrangian
    decays = scene.lagrangian is None or scene.forces
    if accelerations is not None and decays and is_stiff(scene, accelerations):
        return method_advice.advice("stiff", None, "what decays fast would hold an explicit method to short steps.")
    if lagrangian is None or scene.forces:
        return method_advice.advice("adaptive", None, method_advice.NOTHING_KEPT)
    if scene.lagrangian is not None and initial.is_degenerate(scene):
        return None
    if scene.constraints:
        return method_advice.for_constraints(lagrangian, scene.constraints, scene.coordinates)
    moving: set[ex.Expression] = set(map(ex.Symbol, scene.coordinates))
    ends = () if free is None else (*numeric_formulas.walls(lagrangian, moving), *free.domain)
    return method_advice.for_lagrangian(lagrangian, scene.coordinates, ends)


def is_stiff(scene: data.Scene, accelerations: tuple[ex.Expression, ...]) -> bool:
    """Whether a real eigenvalue of the linearized motion at the start is fast compared with the length of the run."""
    n = len(scene.coordinates)
    table = numeric_formulas.table_of(scene.coordinates, scene.positions[None], scene.velocities[None], scene.values)
    names: list[ex.Expression] = [*map(ex.Symbol, scene.coordinates), *map(ex.Velocity, scene.coordinates)]
    rows = [
        [float(numeric_formulas.array_value(derivative.differentiate(f, name), table)[0]) for name in names]
        for f in accelerations
    ]
    matrix = np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), np.array(rows).reshape(n, 2 * n)])
    if not np.isfinite(matrix).all():
        return False
    values = np.linalg.eigvals(matrix)
    fastest = values[np.argmax(np.abs(values.real))]
    length = scene.grid.step * scene.grid.steps
    return bool(abs(fastest.real) * length > STIFF and abs(fastest.real) > SHARE * abs(fastest.imag))


COST = "cost"
IN_KERNEL = ("energy", "constraints", "momenta", "velocities")
MOST_STEPS = 20_000
MORE_STEPS = 8  # times as many where a run is too short
REPEATS, LEAST_REPEATS = 15, 3
LARGE = 8  # coordinates beyond which the operations of effects are counted where the cost is observed only
ENOUGH = 0.03  # seconds of running for one measurement
NO_STEP = "no step is made."
TOO_SHORT = "The run is too short for its steps to be timed: take more of them."
NOT_IN_STEPS = "The cost of parts is measured for methods that step with a kernel."
TOGETHER = "The free Lagrangian belongs to all effects together: they cannot be taken out of it one by one."
_OPERATION = re.compile(r"= (?:fadd|fsub|fmul|fdiv|fneg|fcmp|(?:tail )?call)\b")

Run = Callable[[data.Scene, data.Problem], trajectory.Trajectory | data.Unavailable]
Observe = Callable[[data.Scene, data.Problem], tuple[data.Problem, data.Observation]]


@dataclass(frozen=True, slots=True)
class Means:
    """How a scene is run, which problem and observation its kernel has, where free Lagrangians come from."""

    run: Run
    observe: Observe
    find: derivation.Find
    stop: data.Stop


@dataclass(frozen=True, slots=True)
class Price:
    """Nanoseconds of a step, operations of a kernel, and steps that were timed."""

    step: float
    operations: int
    steps: int


def part_costs(
    scene: data.Scene, requested: data.Requested, derived: derivation.Derived, means: Means
) -> dict[str, Any]:
    """The key `cost` of a method: the whole step, and each part of it."""
    problem = derivation.problem_of(scene, requested, derived)
    if not method_table.METHODS[requested.method].has_kernel or isinstance(problem, data.Unavailable):
        return {"note": NOT_IN_STEPS}
    short = replace(scene, grid=replace(scene.grid, steps=min(scene.grid.steps, MOST_STEPS)))
    whole = _price(short, problem, requested, means)
    if isinstance(whole, data.Unavailable):
        return {"note": whole.reason}
    document: dict[str, Any] = {"step_ns": whole.step, "operations": whole.operations, "steps": whole.steps}
    if np.isnan(whole.step):
        document["note"] = TOO_SHORT
    elif _belongs_together(scene, requested) and scene.parts:
        document["note"] = TOGETHER
    observed = [name for name in scene.observe if name in IN_KERNEL]
    acting = [] if _belongs_together(scene, requested) else [part for part in short.parts if part.acts]
    parts = [
        {"name": part.name, "kind": "effect"} | _part(turned(short, part), requested, whole, means) for part in acting
    ]
    for name in observed:
        variant = replace(short, observe=tuple(one for one in short.observe if one != name))
        parts.append({"name": name, "kind": "observed"} | _part(variant, requested, whole, means))
    return document | {"parts": parts}


def _belongs_together(scene: data.Scene, requested: data.Requested) -> bool:
    """Whether the effects of a method are in one free Lagrangian, out of which none can be taken."""
    return bool(scene.constraints) and requested.method in method_table.USES_FREE


def turned(scene: data.Scene, part: data.Effect) -> data.Scene:
    """The scene without the effect, where it acts, or with it."""
    names = (name for name in scene.effects if name != part.name)
    effects = tuple(names) if part.acts else (*scene.effects, part.name)
    return replace(scene, lagrangian=part.lagrangian, constraints=part.constraints, forces=part.forces, effects=effects)


def effects_of(scene: data.Scene, derived: derivation.Derived, means: Means) -> dict[str, Any]:
    """{acting, left_out, method}: each effect with the operations of a step that it adds, or would add, to the first
    method that steps with a kernel; None where that cannot be told."""
    method = next((one for one in scene.methods if method_table.METHODS[one.method].has_kernel
                   and not _belongs_together(scene, one)), None)  # fmt: skip
    whole = None if method is None or len(scene.coordinates) > LARGE else _count(scene, method, derived, means)
    found: dict[bool, list[dict[str, Any]]] = {True: [], False: []}
    for part in scene.parts:
        other = None if whole is None or method is None else _count(turned(scene, part), method, None, means)
        more = None if whole is None or other is None else (whole - other if part.acts else other - whole)
        found[part.acts].append({"name": part.name, "operations": more})
    label = None if whole is None or method is None else method.label
    return {"acting": found[True], "left_out": found[False], "method": label, "operations": whole}


def _count(
    scene: data.Scene, requested: data.Requested, derived: derivation.Derived | None, means: Means
) -> int | None:
    """Operations of a step; None where the method has none for this scene."""
    alone = replace(scene, methods=(requested,), observe=tuple(n for n in scene.observe if n in IN_KERNEL))
    problem = derivation.problem_of(scene, requested, derived or derivation.derive(alone, means.find))
    if isinstance(problem, data.Unavailable):
        return None
    try:
        return operations(*means.observe(scene, problem), requested)
    except errors.InputError:  # the method is not for such a scene
        return None


def _part(variant: data.Scene, requested: data.Requested, whole: Price, means: Means) -> dict[str, Any]:
    alone = replace(variant, methods=(requested,), observe=tuple(n for n in variant.observe if n in IN_KERNEL))
    problem = derivation.problem_of(variant, requested, derivation.derive(alone, means.find))
    found = problem if isinstance(problem, data.Unavailable) else _price(variant, problem, requested, means)
    if isinstance(found, data.Unavailable):
        return {"step_ns": None, "operations": None, "note": f"Without it: {found.reason}"}
    less = whole.step - found.step
    measured = {"step_ns": less} if less > 0 else {"step_ns": None, "note": "Its time is within the noise."}
    return {**measured, "operations": whole.operations - found.operations}


def _price(
    scene: data.Scene, problem: data.Problem, requested: data.Requested, means: Means
) -> Price | data.Unavailable:
    """The time beyond that of one step, of so many steps that they take longer than to begin; no number without."""
    begun = _best(scene, 1, problem, means)
    if isinstance(begun, data.Unavailable):
        return begun
    steps = scene.grid.steps
    while True:
        whole = _best(scene, steps, problem, means)
        if isinstance(whole, data.Unavailable):
            return whole
        is_long = whole[0] > 2 * begun[0]
        if is_long or whole[1] < steps or steps >= MOST_STEPS:
            break
        steps = min(MORE_STEPS * steps, MOST_STEPS)
    made = whole[1] - 1
    step = 1e9 * (whole[0] - begun[0]) / made if is_long and made > 0 else np.nan
    return Price(step, operations(*means.observe(scene, problem), requested), whole[1])


def _best(given: data.Scene, steps: int, problem: data.Problem, means: Means) -> tuple[float, int] | data.Unavailable:
    """(seconds of the fastest of several runs with so many steps, steps that they make)."""
    scene = replace(given, grid=replace(given.grid, steps=steps))
    best, spent, done = float("inf"), 0.0, 0
    for turn in range(REPEATS):
        if (turn >= LEAST_REPEATS and spent > ENOUGH) or (turn and means.stop()):
            break
        found = means.run(scene, problem)
        if isinstance(found, data.Unavailable):
            return found
        done = scene.grid.steps if found.outcome.completed else found.outcome.step or 0
        best, spent = min(best, found.run_seconds), spent + found.run_seconds
    return (best, done) if done else data.Unavailable(NO_STEP)


def operations(problem: data.Problem, observation: data.Observation, requested: data.Requested) -> int:
    """Floating-point instructions and calls in the kernel of a method, each counted once."""
    assert requested.choice is not None
    text = compiled.kernel_text(schemes.program_of(numeric_formulas.Formulas(problem), requested.choice, observation))
    return len(_OPERATION.findall(text))
