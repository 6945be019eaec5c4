"""What a kernel is called with: each argument's kind, which decides the machine code that takes it.

Kinds are texts: "int64", "uint64", "bool", and arrays such as "int64[2]" (element type, dimensions) or
"const int64[2]", which the kernel only reads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, cast

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
