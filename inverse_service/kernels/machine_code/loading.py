"""Load an object file as a function of this process with LLVM and ctypes, and name the processor it
is compiled for.
"""

import dis
import hashlib
import importlib.util
import sys
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, cast

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from inverse_service.kernels.machine_code import argument_kinds, code_store

ENTRY = "entry"
# Loaded code is never freed.
_kept: list[Any] = []
_CONSTANTS = (bool, int, float, np.generic)


@lru_cache(maxsize=1)
def processor_features() -> str:
    return str(llvm.get_host_cpu_features().flatten())


@lru_cache(maxsize=1)
def processor_name() -> str:
    """The processor, and LLVM with its binding: code for one is not code for another."""
    machine = (
        llvmlite.__version__,
        llvm.llvm_version_info,
        llvm.get_host_cpu_name(),
        processor_features(),
    )
    return repr(machine)


def target_machine(level: int = 2) -> Any:
    """A new target machine each time: an engine owns its target machine and frees it at its end."""
    _initialize()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=processor_features(),
        opt=level,
        reloc="pic",
        codemodel="jitdefault",
    )


@lru_cache(maxsize=1)
def _initialize() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()


def engine_of(code: bytes) -> Any:
    """Load the object file; its code lives until the engine ends."""
    # One engine for each, 1 ms: in an engine that already has an object, LLVM locates the data of
    # the next one wrongly.
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return engine


def load(code: bytes, answer: str) -> code_store.Entry:
    """Load the kernel in the object file as a function of the words of its arguments
    (`kinds_of`).
    """
    engine = engine_of(code)
    address = engine.get_function_address(ENTRY)
    if not address:
        raise OSError("the object file has no entry")
    _kept.append(engine)
    return code_store.called(address, answer)


class Unstorable(Exception):
    """A kernel uses an object that its text does not identify."""


def used(work: Callable[..., Any]) -> dict[str, Any]:
    """The globals that a function uses."""
    function = cast(FunctionType, work)
    space = function.__globals__
    return {name: space[name] for name in _names(function.__code__) if name in space}


def _names(code: CodeType) -> Iterator[str]:
    """The names of globals. An attribute may have the name of a global that the function does not
    use.
    """
    yield from dict.fromkeys(
        found.argval for found in dis.get_instructions(code) if found.opname == "LOAD_GLOBAL"
    )
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield from _names(part)


def kernel_digest(work: Callable[..., Any], kinds: argument_kinds.Kinds) -> str:
    """SHA-256 of the kernel for arguments of these kinds; raises Unstorable."""
    digest = hashlib.sha256(_makers().encode())
    for part in (repr(argument_kinds.told(kinds)), *_described(work)):
        digest.update(part.encode() + b"\0")
    return digest.hexdigest()


def _described(work: Callable[..., Any]) -> Iterator[str]:
    function = cast(FunctionType, work)
    if function.__closure__ or function.__kwdefaults__:
        raise Unstorable(f"{function.__qualname__} holds values that are not global")
    yield f"{function.__module__}.{function.__qualname__} {function.__defaults__!r}"
    yield from _of_code(function.__code__)
    for name, value in used(work).items():
        yield name
        yield from _of_global(name, value)


def _of_code(code: CodeType) -> Iterator[str]:
    yield repr((code.co_code, code.co_names, code.co_varnames, code.co_argcount, code.co_flags))
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield from _of_code(part)
        else:
            yield repr(part)


def _of_global(name: str, value: Any) -> Iterator[str]:
    # Kernels and intrinsics contribute their own sources.
    made_from = getattr(value, "py_func", None)
    if made_from is not None:
        yield from _described(made_from)
    elif isinstance(value, ModuleType):
        yield value.__name__
    elif isinstance(value, _CONSTANTS):
        yield f"{type(value).__name__} {value!r}"
    elif isinstance(value, type):
        yield f"{value.__module__}.{value.__qualname__}"
    else:
        raise Unstorable(f"{name} is a {type(value).__name__}")


@lru_cache(maxsize=1)
def _makers() -> str:
    """The versions of this package, numba, LLVM, the processor, and Python."""
    text = repr((sys.version, processor_name())).encode()
    return code_store.digest_of_files(Path(__file__).parent.glob("*.py"), text, _numba_version())


def _numba_version() -> bytes:
    """The version from numba's files: importing numba takes a quarter of a second."""
    found = importlib.util.find_spec("numba")
    if found is None or found.origin is None:
        raise Unstorable("numba is not installed as files")
    return Path(found.origin).with_name("_version.py").read_bytes()
