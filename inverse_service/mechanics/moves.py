"""The list of moves by which a finished formula is brought into the form in which people write it.

A move is a function of a subject (a system, a Lagrangian) and a tree, with a name and with what it
keeps (`Holds`). The moves of a table are made in its order (`write`); of a table of forms, each is
tried and the cheapest kept (`cheapest`). Tables: GAUGES, FORMS and STYLE of `search.tidy` for L,
ENERGY of `mechanics.legendre` for H. A move can be switched off by its name (`without`), and
`counted` counts what each changes: `python -m benchmarks moves` prints both.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, TypeVar

from inverse_service.expressions import collecting, tree as ex

Subject = TypeVar("Subject")
Cost = Callable[[ex.Expression], tuple[int, int]]


class Holds(StrEnum):
    """In what the tree after a move agrees with the tree before it."""

    WHERE_DEFINED = "equal where both are defined"
    CONSTANT = "up to a constant"
    FACTOR = "up to a constant factor"
    DERIVATIVE = "up to a total derivative"


@dataclass(frozen=True, slots=True)
class Move(Generic[Subject]):
    """A step in the writing of a formula; its name is unique among all moves and forms of the
    table.
    """

    name: str
    holds: Holds
    apply: Callable[[Subject, ex.Expression], ex.Expression]


@dataclass(frozen=True, slots=True)
class Form(Generic[Subject]):
    """One of several ways to write a formula, which may come in variants; the cheapest of all is
    kept.

    `of_terms`: the result depends on the terms of the tree alone, not on how they are written.
    """

    name: str
    holds: Holds
    variants: Callable[[Subject, ex.Expression], Iterable[ex.Expression]]
    of_terms: bool = True


_off: ContextVar[frozenset[str]] = ContextVar("moves that are switched off", default=frozenset())
_changes: ContextVar[Counter[object] | None] = ContextVar(
    "how often each move changes a tree", default=None
)


@contextmanager
def without(*names: str) -> Iterator[None]:
    """Leave these moves out; only formulas that no cache holds yet are written otherwise."""
    token = _off.set(_off.get() | frozenset(names))
    try:
        yield
    finally:
        _off.reset(token)


@contextmanager
def counted() -> Iterator[Counter[object]]:
    """Count by move the trees that it changes, by form those for which it is chosen."""
    table = Counter[object]()
    token = _changes.set(table)
    try:
        yield table
    finally:
        _changes.reset(token)


def write(
    moves: Iterable[Move[Subject]],
    subject: Subject,
    tree: ex.Expression,
    failures: tuple[type[Exception], ...] = (),
) -> ex.Expression:
    """The tree after all moves, in their order; one that raises one of the `failures` is left
    out.
    """
    for move in moves:
        if move.name not in _off.get():
            with suppress(*failures):
                after = move.apply(subject, tree)
                _count(move, after != tree)
                tree = after
    return tree


def cheapest(
    forms: Iterable[Form[Subject]],
    subject: Subject,
    tree: ex.Expression,
    cost: Cost,
    admit: Callable[[ex.Expression], bool] = lambda form: True,
    failures: tuple[type[Exception], ...] = (),
) -> ex.Expression:
    """The tree, or the first of the cheapest forms that are admitted, powers merged, if that costs
    less.
    """
    found: dict[ex.Expression, Form[Subject]] = {}
    for form in forms:
        if form.name not in _off.get():
            with suppress(*failures):
                for variant in form.variants(subject, tree):
                    found.setdefault(variant, form)
    written = [(collecting.merge_powers(one), form) for one, form in found.items() if admit(one)]
    if not written:
        return tree
    best, form = min(written, key=lambda pair: cost(pair[0]))
    shorter = cost(best) < cost(tree)
    _count(form, shorter)
    return best if shorter else tree


def _count(move: object, changed: bool) -> None:
    table = _changes.get()
    if table is not None and changed:
        table[move] += 1
