"""An object file made a built-in function of this process, by LLVM alone.

The processor that machine code is made for.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from inverse_service.machine_code.entry import TABLE


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


_FASTCALL = 0x80
_OBJECTS: dict[str, Any] = {
    "int": int, "np.int64": np.int64, "np.uint64": np.uint64, "True": True, "False": False, "None": None,
}  # fmt: skip
# Code, method definitions and what the tables point to live as long as the process.
_kept: list[Any] = []


class _Method(ctypes.Structure):
    """PyMethodDef."""

    _fields_ = (
        ("name", ctypes.c_char_p), ("function", ctypes.c_void_p), ("flags", ctypes.c_int), ("text", ctypes.c_char_p),
    )  # fmt: skip


def load(code: bytes, name: str, other: Callable[..., Any]) -> Callable[..., Any]:
    """The entry in the object file; `other` gets the calls whose arguments are of other kinds."""
    # One engine for each, 1 ms: in an engine that has an object already, LLVM finds the data of the next one wrongly.
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    function, table = engine.get_function_address("entry"), engine.get_global_value_address("table")
    if not function or not table:
        raise OSError("the object file has no entry")
    places = (ctypes.c_uint64 * len(TABLE)).from_address(table)
    places[:] = [_address(word, other) for word in TABLE]
    method = _Method(name.encode(), function, _FASTCALL, None)
    make = ctypes.pythonapi.PyCFunction_NewEx
    make.restype, make.argtypes = ctypes.py_object, [ctypes.POINTER(_Method), ctypes.py_object, ctypes.py_object]
    _kept.append((engine, method, other))
    return make(ctypes.byref(method), None, None)  # type: ignore[no-any-return]


def _address(word: str, other: Callable[..., Any]) -> int:
    """Of an object, of a function of Python's C interface, or of `other`."""
    if word == "OTHER":
        return id(other)
    if word in _OBJECTS:
        return id(_OBJECTS[word])
    return ctypes.cast(getattr(ctypes.pythonapi, word), ctypes.c_void_p).value or 0
