"""LLVM IR to machine code, and machine code kept: in memory, and on disk between processes."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any

import llvmlite.binding as llvm

from inverse_service.machine_code.processor import target_machine


def object_code(ir: str, thorough: bool = False) -> bytes:
    """The IR optimised and compiled for this processor.

    Subexpressions are already shared, so a single trajectory needs little: LLVM's whole pipeline (`thorough`) takes 8
    to 13 ms more, to compile in 15 to 33 ms, and its steps are no shorter; those of ensembles are, by 0 to 40 %.
    """
    machine = target_machine()
    module = llvm.parse_assembly(ir)
    module.triple = machine.triple
    _optimise(machine, module, thorough)
    return bytes(machine.emit_object(module))


def _optimise(machine: Any, module: Any, thorough: bool) -> None:
    # Lanes are written out and loops are long: levels above 1 take half as long again and gain nothing measurable.
    options = llvm.create_pipeline_tuning_options(speed_level=1)
    options.loop_vectorization = options.loop_unrolling = options.slp_vectorization = False
    builder = llvm.create_pass_builder(machine, options)
    if thorough:
        builder.getModulePassManager().run(module, builder)
        return
    passes = llvm.create_new_module_pass_manager()
    passes.add_sroa_pass()
    passes.add_instruction_combine_pass()
    passes.add_simplify_cfg_pass()
    passes.add_new_gvn_pass()
    passes.run(module, builder)


@dataclass(frozen=True, slots=True)
class Machine:
    """A loaded kernel; it lives as long as its engine."""

    engine: Any
    function: Any

    def call(self, memory: int, weights: int, control: int, record: int) -> None:
        """Run the kernel on these addresses; Python's lock is free meanwhile."""
        self.function(memory, weights, control, record)


def load(code: bytes) -> Machine:
    """The kernel of an object file, ready to be called."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    address = engine.get_function_address("kernel")
    if not address:
        raise OSError("the object file has no kernel")
    return Machine(engine, ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)(address))
