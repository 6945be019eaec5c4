"""Programs for `loops`: the formulas of a scene compiled once, as a kernel that runs like one
written out.

The matrix of the linear equations is stored by diagonals where its rows, in their order, couple
near ones only, else as a whole.
"""

from __future__ import annotations

import ctypes
import hashlib
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from inverse_service.integrators.method_table import TABLEAUX
from inverse_service.integrators.trajectory import Array
from inverse_service.kernels.codegen import (
    compiled,
    graph as graphs,
    graph_code,
    loops,
    program as programs,
)
from inverse_service.kernels.machine_code import code_store, loading

Entries = Mapping[tuple[int, int], int]
HELD = "held_"  # with its place: 1 for a coordinate that stays at rest


@dataclass(frozen=True, slots=True)
class LoopProgram:
    """The right-hand side (N,) and the nonzero entries (N, N) of linear equations, or of Newton's,
    as nodes of a graph.

    Without entries the right-hand side are the accelerations themselves. `pushes` (n,) are the
    rates of the momenta of an implicit step, `noise` (n,) the squared terms of the accelerations,
    where they are needed. `tableau` is the order of an explicit method, 0 of an implicit one.
    `watches` are walls whose sign stays, or which stay positive.
    """

    graph: graphs.Graph
    size: int
    parameters: int
    right: Sequence[int]
    entries: Entries = field(default_factory=dict)
    pushes: Sequence[int] = ()
    noise: Sequence[int] = ()
    watches: Sequence[tuple[str, int, str, str]] = ()
    observed: Sequence[tuple[str, int]] = ()
    tableau: int = 0
    adaptive: bool = False
    moving: int = 0  # the bits of leaves that change in a run

    @property
    def outputs(self) -> dict[str, list[int]]:
        """Those of the functions of the scene."""
        seen = [*(node for _, node, _, _ in self.watches), *(node for _, node in self.observed)]
        found = {"evaluate": [*self.right, *self.entries.values(), *self.pushes], "inspect": seen}
        return found | {"noise": [*self.noise]}


@dataclass(frozen=True, slots=True)
class Plan:
    """What `loops` needs to know: `numbers` of its PLAN by name, places of the entries, of the
    rows, kinds of walls.
    """

    driver: str
    tableau: int
    numbers: dict[str, int]
    places: tuple[int, ...]
    order: tuple[int, ...]
    kinds: tuple[int, ...]


_PLAN, _CARD = TypeAdapter(Plan), TypeAdapter(compiled.Card)


def plan_of(program: LoopProgram) -> Plan:
    """The plan of a program, with the rows in an order that keeps its entries near the diagonal."""
    rows, pairs = len(program.right), [*program.entries]
    order = graphs.ordering(rows, pairs)
    below = max((order[i] - order[j] for i, j in pairs), default=0)
    above = max((order[j] - order[i] for i, j in pairs), default=0)
    below, above = max(below, 0), max(above, 0)
    width = 2 * below + above + 1
    stride, shift, cells = (
        (width - 1, below, rows * width) if width < rows else (rows, 0, rows * rows)
    )
    graph, tableau = program.graph, TABLEAUX.get(program.tableau)
    is_constant = bool(pairs) and not any(
        graph.masks[node] & program.moving for node in program.entries.values()
    )
    numbers = {
        "size": program.size, "rows": rows, "entries": len(pairs), "below": below, "above": above, "stride": stride,
        "shift": shift, "cells": cells, "constant": int(is_constant), "direct": int(not pairs),
        "parameters": program.parameters, "walls": len(program.watches), "observed": len(program.observed),
        "kept": program.size if program.tableau else rows, "adaptive": int(program.adaptive),
        "noisy": int(bool(program.noise)),
    }  # fmt: skip
    if tableau is not None:
        root = 1023 << 52
        falls = max(tableau.falls, 1)
        numbers |= {
            "stages": len(tableau.nodes), "nystrom": int(not tableau.rows.any()), "estimates": len(tableau.errors),
            "falls": falls, "root_of_one": root + root // (2 * falls),
        }  # fmt: skip
    places = tuple(order[i] * stride + order[j] + shift for i, j in pairs)
    kinds = tuple(int(kind == "domain") for kind, *_ in program.watches)
    return Plan(
        "explicit" if program.tableau else "implicit",
        program.tableau,
        numbers,
        places,
        tuple(order),
        kinds,
    )


def card_of(program: LoopProgram) -> compiled.Card:
    """The layout of the memory, with the names that a run uses."""
    n, rows, implicit = program.size, len(program.right), not program.tableau
    letter = "p" if implicit else "v"
    state = [f"{one}{k}" for one in ("q", letter) for k in range(n)]
    unknowns = [f"d{k}" if k < n else f"m{k - n}" for k in range(rows)] if implicit else []
    tried = (
        programs.TRIAL if program.adaptive else programs.size_name(0, "d") if implicit else "unused"
    )
    kept = [f"{name}_rate" for name in unknowns] or [f"{HELD}{k}" for k in range(n)]
    fixed = (tried if name == programs.TRIAL else name for name in loops.FIXED)
    persistent = (
        *fixed, *state, *(f"{name}_low" for name in state),
        "first_0", "last_0", *(f"watch_{k}" for k in range(len(program.watches))),
        *(f"maximum_{k}" for k in range(len(program.observed))), *kept,
    )  # fmt: skip
    columns = (*state, *(f"observed_{k}" for k in range(len(program.observed))))
    layout = programs.Layout(
        persistent, ("h", "a", *(f"c{k}" for k in range(program.parameters))), columns
    )
    names = unknowns or [f"f0_{k}" if k < n else f"m0_{k - n}" for k in range(rows)]
    watches = tuple((kind, text, remedy) for kind, _, text, remedy in program.watches)
    forces = 1 if implicit else len(TABLEAUX[program.tableau].nodes)
    return compiled.Card(
        layout, (tuple(names),), watches, tuple(name for name, _ in program.observed), forces, 1
    )


@dataclass(frozen=True, slots=True)
class LoopMachine:
    """The loaded functions of a scene with the loops; it lives as long as its engine."""

    engine: Any
    plan: Plan

    def call(
        self, memory: Array, weights: Array, control: NDArray[np.int64], record: Array
    ) -> None:
        """Run one row of `memory`, `control` and `record` after another; Python's lock is free
        meanwhile.
        """
        words, kept = self._words()
        run, factored = driver(self.plan.driver), loops.PLAN.index("factored")
        plan, parts = words.ctypes.data, weights.ctypes.data
        starts = [(one.ctypes.data, one.strides[0]) for one in (memory, control, record)]
        for row in range(len(memory)):
            words[factored] = 0
            own, ends, points = (start + row * stride for start, stride in starts)
            run(plan, own, parts, ends, points)
        del kept

    def _words(self) -> tuple[NDArray[np.int64], list[Any]]:
        """The words of the plan, with the arrays whose addresses they hold: each call has its
        own.
        """
        plan, numbers = self.plan, self.plan.numbers
        n, rows = numbers["size"], numbers["rows"]
        watched = max(1, numbers["walls"] + numbers["observed"])
        outputs = rows + numbers["entries"] + n + 1
        arrays: dict[str, Array | NDArray[np.int64]] = {
            "x": np.zeros(4 * n + rows + numbers["parameters"] + 4), "y": np.zeros(outputs), "z": np.zeros(watched),
            "matrix": np.zeros(max(1, numbers["cells"])), "right": np.zeros(rows), "scratch": np.zeros(
                loops.SCRATCH * max(n, rows)), "pivots": np.zeros(rows, dtype=np.int64),
            "places": np.array(plan.places or (0,), dtype=np.int64), "order": np.array(plan.order, dtype=np.int64),
            "kinds": np.array(plan.kinds or (0,), dtype=np.int64),
        }  # fmt: skip
        if plan.tableau:
            t, nystrom = TABLEAUX[plan.tableau], bool(numbers["nystrom"])
            by_places = (
                (t.places, t.ends, t.end_errors) if nystrom else (t.rows, t.weights, t.errors)
            )
            tables = dict(zip(("place_weights", "ends", "end_errors"), by_places, strict=True))
            tables |= {
                "nodes": t.nodes,
                "row_weights": t.rows,
                "stage_weights": t.weights,
                "errors": t.errors,
            }
            arrays |= {
                name: np.ascontiguousarray(table, dtype=np.float64)
                for name, table in tables.items()
            }
            arrays |= {name: np.zeros(n * len(t.nodes)) for name in ("speeds", "forces")}
        words = np.zeros(len(loops.PLAN), dtype=np.int64)
        for name, value in numbers.items():
            words[loops.PLAN.index(name)] = value
        for name, array in arrays.items():
            words[loops.PLAN.index(name)] = array.ctypes.data
        for name in ("evaluate", "inspect", "noise"):
            words[loops.PLAN.index(name)] = self.engine.get_function_address(name)
        return words, [*arrays.values()]


@lru_cache(maxsize=4)
def driver(name: str) -> Any:
    """The loops of this name as a function of five addresses."""
    address = _loops(name).get_function_address(name)
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 5)(address)


@lru_cache(maxsize=4)
def _loops(name: str) -> Any:
    digest = hashlib.sha256(f"{compiled.code_digest()} loops {name}".encode()).hexdigest()
    entry = code_store.read(digest)
    if entry is None:
        code = compiled.object_code(loops.driver_text(name))  # "all" passes gain nothing
        code_store.store_entry(digest, {}, code)
        return loading.engine_of(code)
    return loading.engine_of(entry[1])


def looped(identity: Hashable, make: Callable[[], LoopProgram]) -> compiled.Compiled:
    """The kernel of the program that `make` builds; `identity` says all on which the program
    depends.
    """
    return compiled.kept_kernel(
        f"loops {compiled.text_digest(identity)}", _from_disk, lambda digest: _made(digest, make())
    )


def _from_disk(digest: str) -> compiled.Compiled | None:
    begin = time.perf_counter()
    entry = code_store.read(digest)
    if entry is None:
        return None
    try:
        card, plan = (
            _CARD.validate_python(entry[0]["card"]),
            _PLAN.validate_python(entry[0]["plan"]),
        )
        _loops(plan.driver)
        machine = LoopMachine(loading.engine_of(entry[1]), plan)
    except (LookupError, ValueError, RuntimeError, OSError):
        return None
    return compiled.Compiled(card, machine, {"load": time.perf_counter() - begin})


def _made(digest: str, program: LoopProgram) -> compiled.Compiled:
    begin = time.perf_counter()
    text = graph_code.evaluator_text(program.graph, program.outputs)
    written = time.perf_counter()
    code = compiled.object_code(text)
    card, plan = card_of(program), plan_of(program)
    _loops(plan.driver)
    optimized = time.perf_counter()
    code_store.store_entry(digest, {"card": asdict(card), "plan": asdict(plan)}, code)
    machine = LoopMachine(loading.engine_of(code), plan)
    stages = {
        "write": written - begin,
        "compile": optimized - written,
        "load": time.perf_counter() - optimized,
    }
    return compiled.Compiled(card, machine, stages)
