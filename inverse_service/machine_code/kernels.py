"""Kernels: plain functions of numbers and arrays, compiled for the kinds of arguments they are called with.

The code is looked up in the store by a digest of all it is made from and loaded by LLVM; numba is imported only
where the store has none. A call costs 1 us and as much again for each array.

What a kernel is called with: each argument's kind, which decides the machine code that takes it.

Kinds are texts: "int64", "uint64", "bool", and arrays such as "int64[2]" (element type, dimensions) or
"const int64[2]", which the kernel only reads.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeVar, cast

import numpy as np

from inverse_service.machine_code import store

Kinds = tuple[str, ...]

ELEMENTS = ("int8", "int32", "int64", "uint64")
_TYPES: dict[Any, str] = {np.dtype(name): name for name in ELEMENTS}
_SCALARS = {int: "int64", np.int64: "int64", np.uint64: "uint64", bool: "bool", np.bool_: "bool"}
_MOST_DIMENSIONS = 4
_CONSTANT = "const "


@dataclass(frozen=True, slots=True)
class ArrayKind:
    """The kind of an array: element type, dimensions (0 for a number), whether the kernel only reads it."""

    element: str
    dimensions: int
    constant: bool


@lru_cache(maxsize=256)
def array_of(kind: str) -> ArrayKind:
    """The kind read; `dimensions` is 0 for that of a number."""
    name, _, rest = kind.removeprefix(_CONSTANT).partition("[")
    return ArrayKind(name, int(rest.rstrip("]") or 0), kind.startswith(_CONSTANT))


def kinds_of(arguments: Sequence[Any]) -> Kinds | None:
    """The kinds, or None where one argument is none that machine code of ours takes."""
    kinds = tuple(map(_kind, arguments))
    return None if None in kinds else cast(Kinds, kinds)


def _kind(argument: Any) -> str | None:
    if not isinstance(argument, np.ndarray):
        return _SCALARS.get(type(argument))
    flags = argument.flags
    if not (flags.c_contiguous and flags.aligned):
        return None
    return _array_kind(argument.dtype, argument.ndim, flags.writeable)


@lru_cache(maxsize=256)
def _array_kind(element: Any, dimensions: int, writable: bool) -> str | None:
    name = _TYPES.get(element)
    known = name is not None and 0 < dimensions <= _MOST_DIMENSIONS
    return f"{'' if writable else _CONSTANT}{name}[{dimensions}]" if known else None


Work = TypeVar("Work", bound=Callable[..., Any])

_KIND = "modular"
# Entries pass addresses as 64-bit numbers.
POINTERS_OF_64_BITS = sys.maxsize > 2**32
_lock = threading.RLock()


class Kernel:
    """A compiled function; `py_func` is its source."""

    __slots__ = ("_entries", "_made", "py_func")

    def __init__(self, work: Callable[..., Any]) -> None:
        self.py_func = work
        self._entries: dict[Kinds, Callable[..., Any]] = {}
        self._made: Any = None

    def __call__(self, *arguments: Any) -> Any:
        kinds = kinds_of(arguments) if POINTERS_OF_64_BITS else None
        if kinds is None:
            return self.made()(*arguments)
        entry = self._entries.get(kinds)
        if entry is None:
            with _lock:
                entry = self._entries[kinds] = self._entry(kinds)
        return entry(*arguments)

    def __repr__(self) -> str:
        return f"<kernel {self.py_func.__module__}.{self.py_func.__qualname__}>"

    def made(self) -> Any:
        """numba's function, as other kernels need it."""
        from inverse_service.machine_code.building import dispatcher  # numba takes 0.3 s to import

        with _lock:
            if self._made is None:
                self._made = dispatcher(self.py_func)
            return self._made

    def _entry(self, kinds: Kinds) -> Callable[..., Any]:
        from inverse_service.machine_code.loading import Unstorable  # LLVM takes 0.03 s to import

        try:
            return self._from_store(kinds) or self._built(kinds)
        except (Unstorable, OSError, RuntimeError):  # the last two where this LLVM wants it otherwise
            return cast(Callable[..., Any], self.made())

    def _from_store(self, kinds: Kinds) -> Callable[..., Any] | None:
        from inverse_service.machine_code.loading import kernel_digest, load

        found = store.read(kernel_digest(self.py_func, kinds), _KIND, with_program=True)
        try:
            return None if found is None else load(found[1], kinds, found[0]["answer"])
        except (OSError, RuntimeError):
            return None

    def _built(self, kinds: Kinds) -> Callable[..., Any]:
        from inverse_service.machine_code.building import object_code
        from inverse_service.machine_code.loading import kernel_digest, load

        code, answer = object_code(self.made(), kinds)
        noted = {"kernel": repr(self), "kinds": kinds, "answer": answer}
        store.write(kernel_digest(self.py_func, kinds), noted, code, _KIND, with_program=True)
        return load(code, kinds, answer)


class Intrinsic:
    """An operation that numba lacks, as code for LLVM; `py_func` writes it (numba.extending.intrinsic)."""

    __slots__ = ("_made", "py_func")

    def __init__(self, definition: Callable[..., Any]) -> None:
        self.py_func = definition
        self._made: Any = None

    def made(self) -> Any:
        from inverse_service.machine_code.building import made_intrinsic

        if self._made is None:
            self._made = made_intrinsic(self.py_func)
        return self._made


def compiled(work: Work) -> Work:
    """The function as a kernel; it calls other kernels and intrinsics, and its globals do not change."""
    return cast(Work, Kernel(work))


def intrinsic(definition: Callable[..., Any]) -> Any:
    """An operation for kernels; `definition` is as numba.extending.intrinsic wants it and imports numba itself."""
    return Intrinsic(definition)
