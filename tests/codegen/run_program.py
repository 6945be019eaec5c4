"""Run programs in which each formula is the increment of one state variable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from inverse_service.kernels.codegen.compiled import (
    Card,
    Machine,
    card_of,
    kernel_text,
    load,
    object_code,
)
from inverse_service.kernels.codegen.program import Program
from inverse_service.kernels.codegen.symengine_trees import Formula


def program_for(formulas: Sequence[Formula], arguments: Sequence[str]) -> Program:
    """State s0, s1, ... each with its formula as increment."""
    state = tuple(f"s{k}" for k in range(len(formulas)))
    return Program(state, ("h", *arguments), (), tuple(formulas))


def call(
    machine: Machine,
    card: Card,
    memory: np.ndarray,
    steps: int = 1,
    weights: Sequence[float] = (1.0,),
) -> int:
    """Run the program; return the number of steps."""
    substeps = np.array(weights)
    control = np.array([steps, len(substeps), 10**9, 10**9, 0, 0, 0], dtype=np.int64)
    record = np.zeros((1, len(card.layout.columns), memory.shape[1]))
    machine.call(memory[None], substeps, control[None], record[None])
    return int(control[4])


def memory_for(card: Card, lanes: Sequence[Mapping[str, float]]) -> np.ndarray:
    memory = np.zeros((len(card.layout.names), len(lanes)))
    for lane, values in enumerate(lanes):
        for name in card.layout.arguments:
            memory[card.layout.names.index(name), lane] = values.get(name, 1.0)
        for name, value in values.items():
            if name in card.layout.persistent:
                memory[card.layout.names.index(name), lane] = value
    return memory


def values_of(formulas: Sequence[Formula], lanes: Sequence[Mapping[str, float]]) -> np.ndarray:
    """The values of the formulas from the compiled kernel, (formulas, lanes)."""
    names = sorted({name for values in lanes for name in values})
    program = program_for(formulas, names)
    card = card_of(program, len(lanes))
    memory = memory_for(card, lanes)
    machine = load(object_code(kernel_text(program, len(lanes))))
    call(machine, card, memory)
    return np.array([memory[card.layout.names.index(name)] for name in program.state])
