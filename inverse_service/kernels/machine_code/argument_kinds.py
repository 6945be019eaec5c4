"""The kinds of the arguments of kernels, and the words that machine code takes for them.

Kinds are texts: "int64", "uint64", "bool", and arrays such as "int64[2]" (element type, dimensions)
or "const int64[2]", which the kernel only reads. A NamedTuple of such arguments is one argument,
whose kind is the class with the kinds of its parts. Machine code takes one address: that of the
words of all parts, one after another. The words of arrays that do not move are held: those of small
read-only arrays and of a `Kept` struct.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

Kind = str | tuple[type, "Kinds"]
Kinds = tuple[Kind, ...]

ELEMENTS = ("int8", "int32", "int64", "uint64")
_TYPES: dict[Any, str] = {np.dtype(name): name for name in ELEMENTS}
_SCALARS = {int: "int64", np.int64: "int64", np.uint64: "uint64", bool: "bool", np.bool_: "bool"}
_MOST_DIMENSIONS = 4
_CONSTANT = "const "
_LARGE = 1 << 63
_LARGEST = (1 << 64) - 1
# By `id`: arguments whose arrays do not move, with kind and words (none before the first call). An
# entry keeps its argument alive.
_held: dict[int, tuple[Any, Kind, list[int]]] = {}
_MOST_HELD = 256
Struct = TypeVar("Struct", bound=tuple[Any, ...])
_buffer: Callable[[Any], ctypes.c_char] = ctypes.c_char.from_buffer
_SMALL = 4096


@dataclass(frozen=True, slots=True)
class ArrayKind:
    """The kind of an array: element type, dimensions (0 for a number), whether the kernel only
    reads it.
    """

    element: str
    dimensions: int
    constant: bool


@lru_cache(maxsize=256)
def array_of(kind: str) -> ArrayKind:
    """Parse the kind; `dimensions` is 0 for a number."""
    name, _, rest = kind.removeprefix(_CONSTANT).partition("[")
    return ArrayKind(name, int(rest.rstrip("]") or 0), kind.startswith(_CONSTANT))


def kinds_of(arguments: Sequence[Any], words: list[int]) -> Kinds | None:
    """The kinds, or None if our machine code cannot take one of the arguments. Appends the words of
    the arguments.

    The words of an array are its address and its lengths. OverflowError for an integer of more than
    64 bits.
    """
    kinds: list[Kind] = []
    for argument in arguments:
        kind: Kind | None = _SCALARS.get(type(argument))
        if kind is not None:
            if type(argument) is int and not -_LARGE <= argument < _LARGE:
                raise OverflowError("a number does not fit 64 bits")
            words.append(int(argument) & _LARGEST)
        elif (known := _held.get(id(argument))) is not None and known[2]:
            words += known[2]
            kind = known[1]
        elif isinstance(argument, np.ndarray):
            kind = _kind_of_array(argument, words)
        elif isinstance(argument, tuple):
            kind = _kind_of_struct(argument, words)
        if kind is None:
            return None
        kinds.append(kind)
    return tuple(kinds)


def _hold(argument: Any, kind: Kind, words: list[int]) -> None:
    if len(_held) >= _MOST_HELD:
        _held.clear()
    _held[id(argument)] = argument, kind, words


class Kept(Generic[Struct]):
    """A NamedTuple of arrays, none of which is resized, whose words are kept for the lifetime of
    this object.
    """

    __slots__ = ("struct",)

    def __init__(self, struct: Struct) -> None:
        self.struct = struct
        _hold(struct, "", [])

    def __del__(self) -> None:
        _held.pop(id(self.struct), None)


def _kind_of_struct(struct: tuple[Any, ...], words: list[int]) -> Kind | None:
    """The kind of a NamedTuple. It is held if all its arrays are read-only, as in tables that are
    built once.
    """
    own: list[int] = []
    parts = kinds_of(struct, own) if hasattr(struct, "_fields") else None
    if parts is None:
        return None
    words += own
    kind = (type(struct), parts)
    if id(struct) in _held or _is_constant(parts):
        _hold(struct, kind, own)
    return kind


@lru_cache(maxsize=256)
def _is_constant(parts: Kinds) -> bool:
    return all(leaf.startswith(_CONSTANT) or "[" not in leaf for leaf in leaves(parts))


def leaves(kinds: Kinds) -> Iterator[str]:
    """The kinds of numbers and arrays, with each NamedTuple replaced by its parts."""
    for kind in kinds:
        if isinstance(kind, str):
            yield kind
        else:
            yield from leaves(kind[1])


def told(kinds: Kinds) -> list[Any]:
    """The kinds as texts and lists. A NamedTuple includes the names of its parts, which determine
    their places.
    """
    return [
        k if isinstance(k, str) else [k[0].__qualname__, *getattr(k[0], "_fields", ()), told(k[1])]
        for k in kinds
    ]


def _kind_of_array(array: npt.NDArray[Any], words: list[int]) -> str | None:
    """The kind of an array. A small, read-only array that is not a view is held, because tables are
    built once.
    """
    flags = array.flags
    writable = flags.writeable
    kind = (
        _array_kind(array.dtype, array.ndim, writable)
        if flags.c_contiguous and flags.aligned
        else None
    )
    if kind is None:
        return None
    shape = array.shape
    if 0 in shape:
        own = [0, *shape]
    elif writable:  # the address of a buffer takes 0.3 us, that of any array 1 us
        own = [ctypes.addressof(_buffer(array)), *shape]
    else:
        own = [array.ctypes.data, *shape]
        if array.size < _SMALL and flags.owndata:
            _hold(array, kind, own)
    words += own
    return kind


@lru_cache(maxsize=256)
def _array_kind(element: Any, dimensions: int, writable: bool) -> str | None:
    name = _TYPES.get(element)
    known = name is not None and 0 < dimensions <= _MOST_DIMENSIONS
    return f"{'' if writable else _CONSTANT}{name}[{dimensions}]" if known else None
