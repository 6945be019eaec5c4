"""What programs of all languages are read into. `at` is the column of the text, from 1."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any


class NotRead(Exception):
    """A part of a program that cannot be evaluated; `at` is its column."""

    def __init__(self, what: str, at: int = 0) -> None:
        super().__init__(what)
        self.what, self.at = what, at


class Trap(NotRead):
    """What a program does that its lines, read one by one, do not say: a condition, a loop, a list
    that is changed in place. Where it decides the result, no other reader is right either.
    """


class Initial(NotRead):
    """x[0], a value at one time."""


@dataclass(frozen=True, slots=True)
class Node:
    at: int


@dataclass(frozen=True, slots=True)
class Constant(Node):
    """A number, or a text in quotes."""

    value: Fraction | str
    is_whole: bool = False  # written without a decimal point


@dataclass(frozen=True, slots=True)
class Name(Node):
    text: str


@dataclass(frozen=True, slots=True)
class Call(Node):
    function: Node
    arguments: tuple[Node, ...]
    keywords: tuple[tuple[str, Node], ...] = ()


@dataclass(frozen=True, slots=True)
class Index(Node):
    base: Node
    places: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Slice(Node):
    first: Node | None
    last: Node | None


@dataclass(frozen=True, slots=True)
class Member(Node):
    base: Node
    name: str


@dataclass(frozen=True, slots=True)
class Binary(Node):
    sign: str
    left: Node
    right: Node


@dataclass(frozen=True, slots=True)
class Unary(Node):
    sign: str
    operand: Node


@dataclass(frozen=True, slots=True)
class Items(Node):
    """A list, tuple, or set; the rows of a MATLAB matrix are such lists."""

    items: tuple[Node, ...]
    is_matrix: bool = False


@dataclass(frozen=True, slots=True)
class Primed(Node):
    """x' of Mathematica, and the transpose of MATLAB."""

    operand: Node
    order: int


@dataclass(frozen=True, slots=True)
class Assign(Node):
    """target = value; `sign` is + in target += value. `declares` is true where the statement
    makes a new name: double x = 1.
    """

    target: Node
    value: Node
    sign: str = ""
    declares: bool = False


@dataclass(frozen=True, slots=True)
class Function(Node):
    """A function of the program; `results` are the names that MATLAB returns, `defaults` the values
    of the last parameters. One that is defined by = and not by := has `keeps_values`: the names in
    it have the values of that place.
    """

    name: str
    parameters: tuple[str, ...]
    body: tuple[Node, ...]
    results: tuple[str, ...] = ()
    defaults: tuple[Node, ...] = ()
    keeps_values: bool = False


@dataclass(frozen=True, slots=True)
class Return(Node):
    value: Node | None


@dataclass(frozen=True, slots=True)
class Block(Node):
    """What a loop repeats, or what a condition decides about; `counter` is the name that counts."""

    body: tuple[Node, ...]
    is_loop: bool
    counter: str = ""


@dataclass(frozen=True, slots=True)
class Stop(Node):
    """A statement that changes what the others mean; `is_around` where it makes names those around
    a function.
    """

    what: str
    is_around: bool = False


MORE = "<more>"  # a call of this has a value that the lines of a program alone do not say


def walk(node: Any) -> Iterator[Node]:
    """All nodes below one."""
    if isinstance(node, Node):
        yield node
        for name in node.__dataclass_fields__:
            yield from walk(getattr(node, name))
    elif isinstance(node, tuple):
        for one in node:
            yield from walk(one)


def names_of(target: Node) -> list[str]:
    match target:
        case Name(text=text):
            return [text]
        case Items(items=items):
            return [name for item in items for name in names_of(item)]
        case Index(base=base) | Member(base=base) | Call(function=base):
            return names_of(base)
    return []
