"""Digest of what a kernel is made from, so that stored code is never the wrong one.

Taken from the bytecode, which is what numba compiles: the kernel's own, that of every kernel and intrinsic it
calls, and the constants it uses; with the versions of all that turns them into code.
"""

from __future__ import annotations

import hashlib
import importlib.util
import sys
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, cast

import numpy as np

from inverse_service.machine_code.kernels import Kinds
from inverse_service.machine_code.loading import processor_name

_CONSTANTS = (bool, int, float, np.generic)


class Unstorable(Exception):
    """A kernel uses something whose text says too little of what it is."""


def used(work: Callable[..., Any]) -> dict[str, Any]:
    """The globals that a function names."""
    function = cast(FunctionType, work)
    space = function.__globals__
    return {name: space[name] for name in _names(function.__code__) if name in space}


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield from _names(part)


def kernel_digest(work: Callable[..., Any], kinds: Kinds) -> str:
    """SHA-256 of the kernel for arguments of these kinds; raises Unstorable."""
    digest = hashlib.sha256(_makers())
    for part in (repr(kinds), *_described(work)):
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
    # Kernels and intrinsics say what they are made from.
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
def _makers() -> bytes:
    """Of this room, numba, LLVM, the processor and the Python whose bytecode and objects are read."""
    digest = hashlib.sha256(repr((sys.version, processor_name())).encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    digest.update(_numba_version())
    return digest.digest()


def _numba_version() -> bytes:
    """Read from its files: to import numba takes a quarter of a second."""
    found = importlib.util.find_spec("numba")
    if found is None or found.origin is None:
        raise Unstorable("numba is not installed as files")
    path = Path(found.origin)
    text = path.with_name("_version.py")
    return text.read_bytes() if text.is_file() else repr((path.stat().st_mtime_ns, path.stat().st_size)).encode()
