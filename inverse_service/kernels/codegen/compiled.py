"""Programs compiled once: found by digest in memory, then on disk, else written as LLVM IR,
compiled and kept.

The digest is of all that a kernel is made from, so that a cached one is never the wrong one.
"""

import ctypes
import hashlib
import threading
import time
from collections.abc import Callable, Hashable
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, Protocol

import llvmlite.binding as llvm
import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from inverse_service.integrators.trajectory import Array
from inverse_service.kernels.codegen import kernel, llvm_writer
from inverse_service.kernels.codegen.program import Layout, Program, layout_of
from inverse_service.kernels.machine_code import code_store, loading

_ROOMS = ("kernels", "integrators", "simulation", "expressions")
MOST_IN_MEMORY = 256
LARGE = 8000  # lines: 4,010 of three links compile in 0.03 s in place of 0.12 s, and their steps take 5 times as long
_lock = threading.Lock()


@lru_cache(maxsize=1)
def code_digest() -> str:
    """Of our own sources that take part, of LLVM and of the processor."""
    root = Path(__file__).parents[2]
    paths = (
        path
        for room in _ROOMS
        for ending in ("py", "toml", "ll")
        for path in (root / room).rglob(f"*.{ending}")
    )
    return code_store.digest_of_files(paths, loading.processor_name().encode())


@lru_cache(maxsize=256)
def text_digest(identity: Hashable) -> str:
    """To write the text of a problem takes milliseconds."""
    return hashlib.sha256(repr(identity).encode()).hexdigest()


def object_code(ir: str, passes: Literal["few", "all"] = "few") -> bytes:
    """The IR optimized and compiled for this processor.

    Subexpressions are already shared, so a single trajectory needs little: LLVM's whole pipeline
    (`all`) takes 8 to 13 ms more, to compile in 15 to 33 ms, and its steps are no shorter;
    those of ensembles are, by 0 to 40 %. Of more than LARGE lines nothing is optimized: that would
    take longer than the run.
    """
    large = ir.count("\n") > LARGE
    machine = loading.target_machine(0 if large else 2)
    module = llvm.parse_assembly(ir)
    module.triple = machine.triple
    # Lanes are written out and loops are long: levels above 1 take half as long again and gain
    # nothing measurable.
    options = llvm.create_pipeline_tuning_options(speed_level=1)
    options.loop_vectorization = options.loop_unrolling = options.slp_vectorization = False
    builder = llvm.create_pass_builder(machine, options)
    if passes == "all" and not large:
        manager = builder.getModulePassManager()
    else:
        manager = llvm.create_new_module_pass_manager()
        manager.add_sroa_pass()
        if not large:
            manager.add_instruction_combine_pass()
            manager.add_simplify_cfg_pass()
            manager.add_new_gvn_pass()
            # Choices that a test before has made go: a step of the sleigh takes 5 % less.
            manager.add_jump_threading_pass()
            manager.add_simplify_cfg_pass()
            manager.add_new_gvn_pass()
    manager.run(module, builder)
    return bytes(machine.emit_object(module))


class Stepper(Protocol):
    """Runs steps: see `Machine.call`."""

    def call(
        self, memory: Array, weights: Array, control: NDArray[np.int64], record: Array
    ) -> None: ...


@dataclass(frozen=True, slots=True)
class Machine:
    """A loaded kernel; it lives as long as its engine."""

    engine: Any
    function: Any

    def call(
        self, memory: Array, weights: Array, control: NDArray[np.int64], record: Array
    ) -> None:
        """Run it with one row of `memory`, `control` and `record` after another; Python's lock is
        free meanwhile.
        """
        strides = np.array(
            [memory.strides[0], control.strides[0], record.strides[0]], dtype=np.int64
        )
        starts = memory.ctypes.data, weights.ctypes.data, control.ctypes.data, record.ctypes.data
        self.function(*starts, len(memory), strides.ctypes.data)


def load(code: bytes) -> Machine:
    """The kernel of an object file, ready to be called."""
    engine = loading.engine_of(code)
    address = engine.get_function_address("groups")
    if not address:
        raise OSError("the object file has no kernel")
    pointers = [ctypes.c_void_p] * 4
    return Machine(
        engine, ctypes.CFUNCTYPE(None, *pointers, ctypes.c_int64, ctypes.c_void_p)(address)
    )


@dataclass(frozen=True, slots=True)
class Card:
    """What a run needs to know of a kernel without its formulas."""

    layout: Layout
    solves: tuple[tuple[str, ...], ...]
    watches: tuple[tuple[str, str, str], ...]
    observed: tuple[str, ...]
    forces: int
    lanes: int


@dataclass(frozen=True, slots=True)
class Compiled:
    """A kernel ready to run; `seconds` by stage: "write", "compile", "load" (0 where it was
    found).
    """

    card: Card
    machine: Stepper
    seconds: dict[str, float]


loaded_kernels: dict[str, Compiled] = {}
_CARD = TypeAdapter(Card)  # as JSON gives it back


def compiled(identity: Hashable, make: Callable[[], Program], lanes: int = 1) -> Compiled:
    """The kernel of the program that `make` builds; `identity` says all on which the program
    depends.
    """
    return kept_kernel(
        f"{text_digest(identity)} {lanes}", _from_disk, lambda digest: _made(digest, make, lanes)
    )


def kept_kernel(
    name: str, stored: Callable[[str], Compiled | None], made: Callable[[str], Compiled]
) -> Compiled:
    """The kernel of this name in memory, else what is stored or made under the digest of its name
    and of our code.
    """
    digest = hashlib.sha256(f"{code_digest()} {name}".encode()).hexdigest()
    with _lock:  # LLVM's global context takes one thread at a time
        if (known := loaded_kernels.get(digest)) is not None:
            return Compiled(known.card, known.machine, {})
        if len(loaded_kernels) >= MOST_IN_MEMORY:
            loaded_kernels.clear()  # from disk they are loaded again in a millisecond
        found = loaded_kernels[digest] = stored(digest) or made(digest)
    return found


def kernel_text(program: Program, lanes: int = 1) -> str:
    """The LLVM IR of the program, to be looked at."""
    kind = kernel.Kernel if program.error is None else kernel.AdaptiveKernel
    return kind(program, llvm_writer.LlvmWriter(lanes)).write()


def _from_disk(digest: str) -> Compiled | None:
    begin = time.perf_counter()
    entry = code_store.read(digest)
    if entry is None:
        return None
    try:
        card, machine = _CARD.validate_python(entry[0]), load(entry[1])
    except (ValueError, RuntimeError, OSError):
        return None
    return Compiled(card, machine, {"load": time.perf_counter() - begin})


def _made(digest: str, make: Callable[[], Program], lanes: int) -> Compiled:
    begin = time.perf_counter()
    program = make()
    derived = time.perf_counter()
    text = kernel_text(program, lanes)
    written = time.perf_counter()
    code = object_code(text, "all" if lanes > 1 else "few")
    optimized = time.perf_counter()
    card = card_of(program, lanes)
    code_store.store_entry(digest, asdict(card), code)
    stored = time.perf_counter()
    machine = load(code)
    stages = {"derive": derived - begin, "write": written - derived, "compile": optimized - written}
    stages |= {"store": stored - optimized, "load": time.perf_counter() - stored}
    return Compiled(card, machine, stages)


def card_of(program: Program, lanes: int = 1) -> Card:
    solves = tuple(block.unknowns for block in program.solves)
    watches = tuple((watch.kind, watch.quantity, watch.remedy) for watch in program.watches)
    observed = tuple(name for name, _ in program.observed)
    return Card(layout_of(program), solves, watches, observed, program.forces, lanes)
