"""An object file made a function of this process by LLVM and ctypes, and the processor that it is made for."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from inverse_service.machine_code.kernels import Kinds, array_of

ENTRY = "entry"
_ANSWERS: dict[str, Callable[[int], Any]] = {"none": lambda answer: None, "int64": int, "uint64": int, "bool": bool}
# Code lives as long as the process.
_kept: list[Any] = []


@lru_cache(maxsize=1)
def processor_features() -> str:
    return str(llvm.get_host_cpu_features().flatten())


@lru_cache(maxsize=1)
def processor_name() -> str:
    """The processor, and LLVM with its binding: code for one is not code for another."""
    machine = (llvmlite.__version__, llvm.llvm_version_info, llvm.get_host_cpu_name(), processor_features())
    return repr(machine)


def target_machine(level: int = 2) -> Any:
    """A new one each time: an engine takes its target machine for its own and ends it with itself."""
    _initialize()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=processor_features(), opt=level, reloc="pic", codemodel="jitdefault"
    )


@lru_cache(maxsize=1)
def _initialize() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()


def load(code: bytes, kinds: Kinds, answer: str) -> Callable[..., Any]:
    """The kernel in the object file as a function of arguments of these kinds; OverflowError for a number too large."""
    # One engine for each, 1 ms: in an engine that has an object already, LLVM finds the data of the next one wrongly.
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    address = engine.get_function_address(ENTRY)
    if not address:
        raise OSError("the object file has no entry")
    _kept.append(engine)
    result = ctypes.c_uint64 if answer == "uint64" else ctypes.c_int64
    function = ctypes.PYFUNCTYPE(result, *(word for kind in kinds for word in _words(kind)))(address)
    finished = _ANSWERS[answer]

    def call(*arguments: Any) -> Any:
        words: list[int] = []
        for argument in arguments:
            if isinstance(argument, np.ndarray):
                words += (argument.ctypes.data, *argument.shape)
            elif type(argument) is int and not -_LARGE <= argument < _LARGE:
                raise OverflowError("a number does not fit 64 bits")
            else:
                words.append(int(argument))
        return finished(function(*words))

    return call


_LARGE = 1 << 63


def _words(kind: str) -> list[Any]:
    """The C types of address and lengths of an array, or of a number."""
    dimensions = array_of(kind).dimensions
    if dimensions:
        return [ctypes.c_void_p, *[ctypes.c_int64] * dimensions]
    return [ctypes.c_uint64 if kind == "uint64" else ctypes.c_int64]
