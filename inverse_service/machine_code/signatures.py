"""What a kernel is called with: each argument's kind, which decides the machine code that takes it.

Kinds are texts: "int64", "uint64", "bool", and arrays such as "int64[2]" (element type, dimensions).
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

Kinds = tuple[str, ...]

ELEMENTS = ("int8", "int32", "int64", "uint64")
_TYPES: dict[Any, str] = {np.dtype(name): name for name in ELEMENTS}
_SCALARS = {int: "int64", np.int64: "int64", np.uint64: "uint64", bool: "bool", np.bool_: "bool"}
_MOST_DIMENSIONS = 4

# CPython's objects begin with this many bytes, the last of which are the address of the type.
HEADER = object.__basicsize__
TYPE = HEADER - 8
# PyArrayObject_fields of NumPy's C interface.
DATA, DIMENSIONS, SHAPE, ELEMENT, FLAGS = (HEADER + 8 * k for k in (0, 1, 2, 5, 6))
# C_CONTIGUOUS and ALIGNED.
REGULAR = 0x101


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
    return f"{name}[{argument.ndim}]"


def element_of(kind: str) -> tuple[str, int]:
    """(element type, dimensions) of the kind of an array; (kind, 0) of a number."""
    name, _, rest = kind.partition("[")
    return name, int(rest.rstrip("]") or 0)


def plain(argument: Any, kind: str) -> Any:
    """The same argument as machine code knows it: an array without subclass and with NumPy's own element type."""
    name, dimensions = element_of(kind)
    if dimensions:
        return np.asarray(argument).view(np.dtype(name))
    return {"int64": int, "uint64": np.uint64, "bool": bool}[name](argument)


@lru_cache(maxsize=1)
def layout_is_known() -> bool:
    """Whether this Python and this NumPy keep numbers and arrays where the entries look for them."""
    if ctypes.sizeof(ctypes.c_void_p) != 8 or HEADER < 16:
        return False
    array, word = np.zeros((2, 3), np.int64), np.uint64(0x123456789ABCDEF0)
    place = id(array)
    shape = _word(place + SHAPE)
    return bool(
        _word(place + TYPE) == id(np.ndarray)
        and _word(place + DATA) == array.ctypes.data
        and _word(place + DIMENSIONS) & 0xFFFFFFFF == 2
        and (_word(shape), _word(shape + 8)) == (2, 3)
        and _word(place + ELEMENT) == id(np.dtype("int64"))
        and _word(place + FLAGS) & REGULAR == REGULAR
        and _word(id(word) + TYPE) == id(np.uint64)
        and _word(id(word) + HEADER) == int(word)
    )


def _word(address: int) -> int:
    return ctypes.c_uint64.from_address(address).value
