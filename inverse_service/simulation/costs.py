"""What the parts of a step cost: each effect and each observed quantity as the difference to the
scene without it.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from inverse_service.errors import InputError
from inverse_service.integrators import method_table, trajectory
from inverse_service.kernels.codegen import graph as graphs
from inverse_service.simulation import derivation, execution, looping, observing, scene_data as data
from inverse_service.simulation.sentences import say

IN_KERNEL = ("energy", "constraints")
TIMED_STEPS, MORE_STEPS = (
    20_000,
    8,
)  # steps that are timed at most, and how many times as many where they are too few
REPEATS, LEAST_REPEATS, LONG_ENOUGH = 15, 3, 0.03  # runs for one measurement, and their seconds


def part_costs(derived: derivation.Derived, requested: data.Requested) -> dict[str, Any]:
    """The key `cost` of a method: the whole step, and each part of it as the difference to the
    scene without it; no time where that is below the noise.
    """
    if not method_table.METHODS[requested.method].has_kernel:
        return {"note": say("no_kernel_to_time")}
    scene = derived.scene
    try:
        whole = _price(derived, requested)
    except InputError as error:
        return {"note": error.detail}
    together = _belongs_together(scene, requested)
    variants = (
        []
        if together
        else [(part.name, "effect", turned(derived, part)) for part in scene.parts if part.acts]
    )
    for name in (name for name in scene.observe if name in IN_KERNEL):
        others = tuple(one for one in scene.observe if one != name)
        variants.append((name, "observed", derived.but(observe=others)))
    parts = []
    for name, kind, variant in variants:
        part: dict[str, Any] = {"name": name, "kind": kind, "step_ns": None, "operations": None}
        try:
            found = _price(variant, requested)
            part["operations"] = whole[1].beyond(found[1])
            part |= (
                {"step_ns": whole[0] - found[0]}
                if whole[0] > found[0]
                else {"note": "Its time is below noise."}
            )
        except InputError as error:
            part["note"] = f"Without it: {error.detail}"
        parts.append(part)
    note = say("effects_together") if together and scene.parts else ""
    note = say("too_short_to_time") if np.isnan(whole[0]) else note
    numbers = {"step_ns": whole[0], "operations": whole[1].total, "steps": whole[2]}
    return numbers | ({"note": note} if note else {}) | {"parts": parts}


class Price(NamedTuple):
    """The cost of a step, and how many were timed."""

    nanoseconds: float
    operations: Operations
    steps: int


def _price(derived: derivation.Derived, requested: data.Requested) -> Price:
    """(ns of a step or nan, operations, steps that were timed). A step is timed as a run of many
    less that of one, each the best of several: to call a kernel takes longer than many steps.
    """
    scene = derived.scene
    problem = derivation.problem_of(requested, derived)
    own, observation = observing.observed_problem(scene, problem, requested.choice)
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
            least, spent, done = (
                min(least, ran.seconds),
                spent + ran.seconds,
                ran.outcome().step or 0,
            )
        return least, done

    begun, steps = fastest(1), min(scene.grid.steps, TIMED_STEPS)
    whole = fastest(steps)
    while not whole[0] > 2 * begun[0] and whole[1] == steps < TIMED_STEPS:
        steps = min(MORE_STEPS * steps, TIMED_STEPS)
        whole = fastest(steps)
    is_long = whole[0] > 2 * begun[0] and whole[1] > 1
    step = 1e9 * (whole[0] - begun[0]) / (whole[1] - 1) if is_long else np.nan
    return Price(step, operations(own, observation, requested.choice), whole[1])


def _belongs_together(scene: data.Scene, requested: data.Requested) -> bool:
    """Whether the effects of a method are in one free Lagrangian, from which none can be
    removed.
    """
    return bool(scene.constraints) and requested.method in method_table.USES_FREE


def turned(derived: derivation.Derived, part: data.Effect) -> derivation.Derived:
    """The scene without the effect, where it acts, or with it; nothing is derived for it yet."""
    names = (name for name in derived.scene.effects if name != part.name)
    effects = tuple(names) if part.acts else (*derived.scene.effects, part.name)
    scene = replace(
        derived.scene,
        lagrangian=part.lagrangian,
        constraints=part.constraints,
        forces=part.forces,
        effects=effects,
    )
    return derivation.Derived(scene, derived.find, derived.stop)


def effects_of(derived: derivation.Derived) -> dict[str, Any]:
    """{acting, left_out, method}: each effect with the operations of a step that it adds, or would
    add, to the first method that steps with a kernel; None if that cannot be determined.
    """
    scene = derived.scene
    method = next((one for one in scene.methods if method_table.METHODS[one.method].has_kernel
                   and not _belongs_together(scene, one)), None)  # fmt: skip

    def counted(known: derivation.Derived) -> Operations | None:
        if method is None:
            return None
        with suppress(InputError):  # the method may be for other scenes
            problem = derivation.problem_of(method, known)
            looping.refuse_long(problem, method.choice)
            return operations(
                *observing.observed_problem(known.scene, problem, method.choice), method.choice
            )
        return None

    whole = counted(derived)
    found: dict[bool, list[dict[str, Any]]] = {True: [], False: []}
    for part in scene.parts:
        other, more = None if whole is None else counted(turned(derived, part)), None
        if whole is not None and other is not None:
            more = whole.beyond(other) if part.acts else other.beyond(whole)
        found[part.acts].append({"name": part.name, "operations": more})
    label = None if whole is None or method is None else method.label
    total = None if whole is None else whole.total
    return {"acting": found[True], "left_out": found[False], "method": label, "operations": total}


@dataclass(frozen=True, slots=True)
class Operations:
    """What the formulas of a step compute, each value by what it is made of, and how often a step
    evaluates them.
    """

    values: frozenset[int]
    times: int

    @property
    def total(self) -> int:
        """Operations of a step."""
        return len(self.values) * self.times

    def beyond(self, other: Operations) -> int:
        """Those of a step that the other does not make."""
        return len(self.values - other.values) * self.times


def operations(
    problem: data.Problem, observation: data.Observation, choice: data.MethodChoice
) -> Operations:
    """The operations of the formulas that a step evaluates: the nodes of their graph, each counted
    once.
    """
    scene, outputs = looping.evaluated(problem, choice, observation)
    meanings, computed = dict[int, int](), set[int]()
    names = [
        "t",
        *problem.coordinates,
        *(f"{name}'" for name in problem.coordinates),
        "h",
        "a",
        *scene.problem.parameters,
    ]
    for k in scene.graph.below(outputs):
        operation, first, second = scene.graph.keys[k]
        parts = sorted(meanings[part] for part in scene.graph.parts(k))
        own = (
            names[first]
            if operation == graphs.LEAF and first < len(names)
            else ""
            if parts
            else first
        )
        meanings[k] = hash((operation, own, second if operation == graphs.FUNCTION else "", *parts))
        if operation > graphs.LEAF:
            computed.add(meanings[k])
    times = len(execution.weights_of(choice))
    if choice.method in method_table.EXPLICIT:
        order = choice.order
        if choice.method == "adaptive":
            order = method_table.order_of_pair(order)
        times = len(method_table.TABLEAUX[order].nodes)
    return Operations(frozenset(computed), times)
