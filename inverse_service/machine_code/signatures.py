"""What a kernel is called with: each argument's kind, which decides the machine code that takes it.

Kinds are texts: "int64", "uint64", "bool", and arrays such as "int64[2]" (element type, dimensions) or
"const int64[2]", which the kernel only reads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

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

    @property
    def size(self) -> int:
        """Bytes of an element."""
        return np.dtype(self.element).itemsize

    @property
    def letter(self) -> str:
        """The element type in the format of the buffer protocol (PEP 3118)."""
        return memoryview(np.empty(1, np.dtype(self.element)).data).format


@lru_cache(maxsize=256)
def array_of(kind: str) -> ArrayKind:
    """The kind read; `dimensions` is 0 for that of a number."""
    name, _, rest = kind.removeprefix(_CONSTANT).partition("[")
    return ArrayKind(name, int(rest.rstrip("]") or 0), kind.startswith(_CONSTANT))


def kinds_of(arguments: Sequence[Any]) -> Kinds | None:
    """The kinds, or None where one argument is none that machine code of ours takes."""
    kinds = [_kind(argument) for argument in arguments]
    return None if None in kinds else tuple(kind for kind in kinds if kind is not None)


def _kind(argument: Any) -> str | None:
    if not isinstance(argument, np.ndarray):
        return _SCALARS.get(type(argument))
    flags = argument.flags
    name = _TYPES.get(argument.dtype)
    if name is None or not (flags.c_contiguous and flags.aligned) or not 0 < argument.ndim <= _MOST_DIMENSIONS:
        return None
    return f"{'' if flags.writeable else _CONSTANT}{name}[{argument.ndim}]"


def plain(argument: Any, kind: str) -> Any:
    """The same argument as machine code knows it: an array without subclass and with NumPy's own element type."""
    array = array_of(kind)
    if array.dimensions:
        return np.asarray(argument).view(np.dtype(array.element))
    return {"int64": int, "uint64": np.uint64, "bool": bool}[kind](argument)
