"""Kernels: plain functions of numbers and arrays, compiled for the kinds of their arguments
(`argument_kinds`).

The code comes from the library of the installation or from the user's store (`code_store`), where
it is looked up by a digest of everything it is built from and loaded by LLVM. numba is imported
only if neither has it. A call takes 2 us, and 1 us more for each array that is not held.
"""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any, TypeVar, cast

from inverse_service.kernels.machine_code import code_store
from inverse_service.kernels.machine_code.argument_kinds import Kinds, kinds_of, told

Work = TypeVar("Work", bound=Callable[..., Any])
_KIND = "modular"
# Entries pass addresses as 64-bit numbers.
POINTERS_OF_64_BITS = sys.maxsize > 2**32
_lock = threading.RLock()
KERNELS: list[Kernel] = []


class Kernel:
    """A compiled function; `py_func` is its source."""

    __slots__ = ("_entries", "_made", "py_func")

    def __init__(self, work: Callable[..., Any]) -> None:
        self.py_func = work
        self._entries: dict[Kinds, code_store.Entry | None] = {}
        self._made: Any = None
        KERNELS.append(self)

    def __call__(self, *arguments: Any) -> Any:
        words: list[int] = []
        kinds = kinds_of(arguments, words) if POINTERS_OF_64_BITS else None
        if kinds is None:
            return self.made()(*arguments)
        if kinds not in self._entries:
            with _lock:
                self._entries[kinds] = self._entry(kinds)
        entry = self._entries[kinds]
        return self.made()(*arguments) if entry is None else entry(words)

    @property
    def name(self) -> str:
        return f"{self.py_func.__module__}.{self.py_func.__qualname__}"

    @property
    def entries(self) -> Iterator[Kinds]:
        """The kinds for which it was compiled to machine code that does not need numba."""
        return (kinds for kinds, entry in self._entries.items() if entry is not None)

    @property
    def unstorable(self) -> Iterator[Kinds]:
        """The kinds for which numba has to call it; they are compiled in each process."""
        return (kinds for kinds, entry in self._entries.items() if entry is None)

    def __repr__(self) -> str:
        return f"<kernel {self.name}>"

    def made(self) -> Any:
        """The numba function, as other kernels need it."""
        from inverse_service.kernels.machine_code.building import (
            dispatcher,
        )  # numba takes 0.3 s to import

        with _lock:
            if self._made is None:
                self._made = dispatcher(self.py_func)
            return self._made

    def _entry(self, kinds: Kinds) -> code_store.Entry | None:
        """The machine code for arguments of these kinds, or None if numba has to call it."""
        found = code_store.library_entry(self.name, told(kinds))
        if found is not None:
            return found
        from inverse_service.kernels.machine_code import loading  # LLVM takes 0.03 s to import

        try:
            digest = loading.kernel_digest(self.py_func, kinds)
            stored = code_store.read(digest, _KIND)
            with contextlib.suppress(OSError, RuntimeError):  # where this LLVM wants it otherwise
                if stored is not None:
                    return loading.load(stored[1], stored[0]["answer"])
            from inverse_service.kernels.machine_code.building import object_code

            code, answer = object_code(self.made(), kinds)
            code_store.store_entry(
                digest, {"kernel": repr(self), "kinds": told(kinds), "answer": answer}, code, _KIND
            )
            return loading.load(code, answer)
        except (loading.Unstorable, OSError, RuntimeError):
            return None


class Intrinsic:
    """An operation that numba lacks, as code for LLVM; `py_func` writes it
    (numba.extending.intrinsic).
    """

    __slots__ = ("_made", "py_func")

    def __init__(self, definition: Callable[..., Any]) -> None:
        self.py_func = definition
        self._made: Any = None

    def made(self) -> Any:
        from numba.extending import intrinsic as made

        if self._made is None:
            self._made = made(self.py_func)
        return self._made


def compiled(work: Work) -> Work:
    """Make the function a kernel. It may call other kernels and intrinsics, and its globals must
    not change.
    """
    return cast(Work, Kernel(work))


def intrinsic(definition: Callable[..., Any]) -> Any:
    """An operation for kernels; `definition` is in the form of numba.extending.intrinsic and
    imports numba itself.
    """
    return Intrinsic(definition)
