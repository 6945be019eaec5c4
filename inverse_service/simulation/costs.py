"""What the parts of a step cost: each effect and each observed quantity as the difference to the scene without it."""

import re
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from inverse_service.errors import InputError
from inverse_service.integrators import method_table, trajectory
from inverse_service.kernels.codegen import compiled
from inverse_service.simulation import derivation, execution, numeric_formulas, observing, scene_data as data, schemes
from inverse_service.simulation.sentences import say

IN_KERNEL = ("energy", "constraints")
TIMED_STEPS, MORE_STEPS = 20_000, 8  # steps that are timed at most, and how many times as many where they are too few
REPEATS, LEAST_REPEATS, LONG_ENOUGH = 15, 3, 0.03  # runs for one measurement, and their seconds
LARGE = 2  # coordinates beyond which the operations of effects are counted where the cost is observed only
_OPERATION = re.compile(r"= (?:fadd|fsub|fmul|fdiv|fneg|fcmp|(?:tail )?call)\b")


def part_costs(derived: derivation.Derived, requested: data.Requested) -> dict[str, Any]:
    """The key `cost` of a method: the whole step, and each part of it as the difference to the scene without it; no
    time where that is below the noise."""
    if not method_table.METHODS[requested.method].has_kernel:
        return {"note": say("no_kernel_to_time")}
    scene = derived.scene
    try:
        whole = _price(derived, requested)
    except InputError as error:
        return {"note": error.detail}
    together = _belongs_together(scene, requested)
    variants = [] if together else [(part.name, "effect", turned(derived, part)) for part in scene.parts if part.acts]
    for name in (name for name in scene.observe if name in IN_KERNEL):
        others = tuple(one for one in scene.observe if one != name)
        variants.append((name, "observed", derived.but(observe=others)))
    parts = []
    for name, kind, variant in variants:
        part: dict[str, Any] = {"name": name, "kind": kind, "step_ns": None, "operations": None}
        try:
            found = _price(variant, requested)
            part["operations"] = whole[1] - found[1]
            part |= {"step_ns": whole[0] - found[0]} if whole[0] > found[0] else {"note": "Its time is below noise."}
        except InputError as error:
            part["note"] = f"Without it: {error.detail}"
        parts.append(part)
    note = say("effects_together") if together and scene.parts else ""
    note = say("too_short_to_time") if np.isnan(whole[0]) else note
    numbers = dict(zip(("step_ns", "operations", "steps"), whole, strict=True))
    return numbers | ({"note": note} if note else {}) | {"parts": parts}


def _price(derived: derivation.Derived, requested: data.Requested) -> tuple[float, int, int]:
    """(ns of a step or nan, operations, steps that were timed). A step is timed as a run of many less that of one, each
    the best of several: to call a kernel takes longer than many steps."""
    scene = derived.scene
    own, observation = observing.observed_problem(scene, derivation.problem_of(requested, derived))
    values, start = observing.beginning(scene, requested, derivation.free_of(requested, derived))
    ready = execution.prepared(own, requested.choice, start, scene.grid, values, observation)
    if isinstance(ready, trajectory.Trajectory):
        raise data.Unavailable("no step is made.")

    def fastest(steps: int) -> tuple[float, int]:
        """(seconds of the fastest run with so many steps, steps that it makes)."""
        least, spent, done = float("inf"), 0.0, 0
        for turn in range(REPEATS):
            if (turn >= LEAST_REPEATS and spent > LONG_ENOUGH) or (turn and derived.is_over):
                break
            ran = ready.go(replace(scene.grid, steps=steps))
            least, spent, done = min(least, ran.seconds), spent + ran.seconds, ran.outcome().step or 0
        return least, done

    begun, steps = fastest(1), min(scene.grid.steps, TIMED_STEPS)
    whole = fastest(steps)
    while not whole[0] > 2 * begun[0] and whole[1] == steps < TIMED_STEPS:
        steps = min(MORE_STEPS * steps, TIMED_STEPS)
        whole = fastest(steps)
    is_long = whole[0] > 2 * begun[0] and whole[1] > 1
    step = 1e9 * (whole[0] - begun[0]) / (whole[1] - 1) if is_long else np.nan
    return step, operations(own, observation, requested), whole[1]


def _belongs_together(scene: data.Scene, requested: data.Requested) -> bool:
    """Whether the effects of a method are in one free Lagrangian, from which none can be removed."""
    return bool(scene.constraints) and requested.method in method_table.USES_FREE


def turned(derived: derivation.Derived, part: data.Effect) -> derivation.Derived:
    """The scene without the effect, where it acts, or with it; nothing is derived for it yet."""
    names = (name for name in derived.scene.effects if name != part.name)
    effects = tuple(names) if part.acts else (*derived.scene.effects, part.name)
    scene = replace(
        derived.scene, lagrangian=part.lagrangian, constraints=part.constraints, forces=part.forces, effects=effects
    )
    return derivation.Derived(scene, derived.find, derived.stop)


def effects_of(derived: derivation.Derived) -> dict[str, Any]:
    """{acting, left_out, method}: each effect with the operations of a step that it adds, or would add, to the first
    method that steps with a kernel; None if that cannot be determined."""
    scene = derived.scene
    method = next((one for one in scene.methods if method_table.METHODS[one.method].has_kernel
                   and not _belongs_together(scene, one)), None)  # fmt: skip

    def count(known: derivation.Derived) -> int | None:
        if method is None or (len(scene.coordinates) > LARGE and "cost" not in scene.observe):
            return None
        with suppress(InputError):  # the method may be for other scenes
            return operations(*observing.observed_problem(known.scene, derivation.problem_of(method, known)), method)
        return None

    whole = count(derived)
    found: dict[bool, list[dict[str, Any]]] = {True: [], False: []}
    for part in scene.parts:
        other = None if whole is None else count(turned(derived, part))
        more = None if whole is None or other is None else (whole - other if part.acts else other - whole)
        found[part.acts].append({"name": part.name, "operations": more})
    label = None if whole is None or method is None else method.label
    return {"acting": found[True], "left_out": found[False], "method": label, "operations": whole}


def operations(problem: data.Problem, observation: data.Observation, requested: data.Requested) -> int:
    """Floating-point instructions and calls in the kernel of a method, each counted once: no load changes them."""
    text = compiled.kernel_text(schemes.program_of(numeric_formulas.Formulas(problem), requested.choice, observation))
    return len(_OPERATION.findall(text.partition("next_step:")[2]))
