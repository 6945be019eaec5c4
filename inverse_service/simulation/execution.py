"""Kernels run piece by piece: bounded memory, a way to stop, and status codes turned into outcomes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inverse_service.codegen.adaptive_kernel import MOST_TRIES
from inverse_service.codegen.compiled import Card, Compiled
from inverse_service.codegen.kernel import CONTROL
from inverse_service.codegen.program import (
    GUARDED,
    NO_CONVERGENCE,
    NO_START,
    NOT_FINITE,
    SINGULAR,
    STATUS,
    STOPPED_AT,
    STOPPED_VALUE,
    TOO_MANY,
    TOO_SHORT,
    TRIAL,
    UNOBSERVABLE,
    UNRESOLVED,
    WATCHED,
)
from inverse_service.integrators.trajectory import Array
from inverse_service.simulation.scene_data import Grid

_FIRST_PIECE = 4096
_FIRST_OWN = 8  # of a method that takes any number of steps between two points
_SECONDS_PER_PIECE = 0.1
_REMEDY = "take a smaller step"
_UNDEFINED = "begin elsewhere, stop before, or leave the quantity out of observe"
_NO_VALUE = "take a smaller step; where a formula has no value, stop before"
_ENDS = "stop before: the motion or a formula ends there"
_FASTER = "take a smaller step or a larger tolerance; where something decays fast, `stiff`"
_BENT = "the third difference of the path compared with its steps, squared: fewer than five steps in a turn"
_KINDS = {"resolution": "unresolved", "bound": "guard", "map": "off_domain", "domain": "off_domain"}
# Newton that fails after the determinant has sunk below this part of its first value fails because of that.
NEARLY_SINGULAR = 0.25


@dataclass(frozen=True, slots=True)
class Run:
    """What a kernel left: `rows` (recorded, columns), `memory` (places,) after the last good step."""

    rows: Array
    steps_at: NDArray[np.int64]
    memory: Array
    iterations: int
    seconds: float
    cancelled: bool
    done: int


def memory_of(card: Card, state: Mapping[str, float], arguments: Mapping[str, float]) -> Array:
    """(places,): the state with the rates, and the arguments, where the kernel looks for them."""
    layout = card.layout
    memory = np.zeros(layout.size)
    for name, value in state.items():
        if name in layout.persistent:
            memory[layout.place(name)] = value
    for name in layout.arguments:
        memory[layout.argument_place(name)] = arguments[name]
    memory[layout.place(STOPPED_AT)] = -1.0
    return memory


def execute(
    kernel: Compiled, memory: Array, weights: Sequence[float], grid: Grid, stop: Callable[[], bool] | None = None
) -> Run:
    """All steps of the grid; `memory` is changed."""
    columns = len(kernel.card.layout.columns)
    every = max(1, min(grid.record_every, grid.steps or 1))
    substeps = np.array(weights, dtype=np.float64)
    pieces: list[Array] = []
    steps_at: list[int] = []
    done = iterations = 0
    seconds, cancelled = 0.0, False
    least = _FIRST_OWN if TRIAL in kernel.card.layout.persistent else _FIRST_PIECE
    piece = least
    until = every
    while done < grid.steps and not cancelled:
        todo, until = _portion(piece, grid.steps - done, until)
        last = done + todo == grid.steps
        control = np.array([todo, len(substeps), every, until, 0, 0, 0], dtype=np.int64)
        record = np.empty((todo // every + 2, columns))
        addresses = [array.ctypes.data for array in (memory, substeps, control, record)]
        begin = time.perf_counter()
        kernel.machine.call(*addresses)
        passed = time.perf_counter() - begin
        state = dict(zip(CONTROL, (int(x) for x in control), strict=True))
        pieces.append(record[: state["rows"]].copy() if state["rows"] < len(record) else record)
        steps_at += [done + until + k * every for k in range(state["rows"])]
        until, done, iterations = state["until_record"], done + state["done"], iterations + state["iterations"]
        seconds += passed
        if state["done"] < todo or last:
            break
        piece = max(least, min(4 * piece, int(piece * _SECONDS_PER_PIECE / max(passed, 1e-6))))
        cancelled = bool(stop and stop())
    rows = np.concatenate(pieces) if pieces else np.empty((0, columns))
    return Run(rows, np.array(steps_at, dtype=np.int64), memory, iterations, seconds, cancelled, done)


def _portion(piece: int, left: int, until: int) -> tuple[int, int]:
    """(steps to do now, steps to the next record): the very last step is recorded whatever the rhythm."""
    if left == 1:
        return 1, 1
    return min(piece, left - 1), until


@dataclass(frozen=True, slots=True)
class Stopped:
    """Why a run stopped: kind, quantity, value, remedy; `step` counts from 0.

    `block` is the place of the implicit block whose determinant it was, None for other quantities.
    """

    kind: str
    step: int
    quantity: str
    value: float
    remedy: str
    block: int | None = None


def stopped(card: Card, memory: Array, unknown_names: Mapping[str, str]) -> Stopped | None:
    """The meaning of the status in the memory (places,), None where the run went to the end."""
    layout = card.layout
    code = int(memory[layout.place(STATUS)])
    if code == 0:
        return None
    step = int(memory[layout.place(STOPPED_AT)])
    value = float(memory[layout.place(STOPPED_VALUE)])
    if code >= UNOBSERVABLE:
        quantity = f"{card.observed[code - UNOBSERVABLE]}, which has no finite value"
        return Stopped("off_domain", step, quantity, value, _UNDEFINED)
    if code >= WATCHED:
        kind, quantity, remedy = card.watches[code - WATCHED]
        remedy = _NO_VALUE if kind == "resolution" and math.isnan(value) else remedy
        return Stopped(_KINDS.get(kind, "singular"), step, quantity, value, remedy)
    if code >= GUARDED:
        quantity = f"1 - det/det(h -> 0): {_determinant(card, code - GUARDED, unknown_names)}"
        return Stopped("guard", step, quantity, value, _REMEDY)
    if code >= SINGULAR:
        place = code - SINGULAR
        return Stopped("singular", step, _determinant(card, place, unknown_names), value, _REMEDY, place)
    if code >= NO_CONVERGENCE:
        place = code - NO_CONVERGENCE
        quantity = _determinant(card, place, unknown_names)
        if place < len(card.solves):
            first, last = (float(memory[layout.place(f"{which}_{place}")]) for which in ("first", "last"))
            if abs(last) < NEARLY_SINGULAR * abs(first):
                return Stopped("singular", step, quantity, last, _REMEDY, place)
        remedy = _NO_VALUE if math.isnan(value) else _REMEDY
        return Stopped("no_convergence", step, quantity, value if place < len(card.solves) else math.nan, remedy)
    if code == NO_START:
        return Stopped("off_domain", 0, "the state at the start, which has no finite value", value, _UNDEFINED)
    if code == UNRESOLVED:
        return Stopped("unresolved", step, _BENT, value, f"{_REMEDY}; guard = false continues unchecked")
    if code == TOO_MANY:
        quantity = f"a step of its own: {MOST_TRIES} such steps do not reach the next point"
        return Stopped("unresolved", step, quantity, value, _FASTER)
    if code == TOO_SHORT:
        return Stopped("singular", step, "the step that the tolerance asks for", value, _ENDS)
    assert code == NOT_FINITE
    return Stopped("not_finite", step, "a coordinate or momentum", math.nan, _REMEDY)


def _determinant(card: Card, place: int, unknown_names: Mapping[str, str]) -> str:
    if place >= len(card.solves):
        return "the stage equations, whose iteration does not converge"
    names = ", ".join(unknown_names.get(name, name) for name in card.solves[place])
    return f"determinant of the discrete equations for {names}"


def at_last(card: Card, memory: Array) -> dict[str, float]:
    """State variables and rates after the last good step."""
    layout = card.layout
    return {name: float(memory[place]) for place, name in enumerate(layout.persistent)}
