"""The list of moves by which a finished formula is brought into the form in which people write it.

A move is a function of a subject (a system, a Lagrangian) and a tree, with a name and with what it
keeps (`Holds`). The moves of a table are made in its order (`write`); of a table of forms, each is
tried and the one with the least `cost` kept (`cheapest`). Tables: GAUGES, FORMS and STYLE of
`search.tidy` for L, ENERGY of `mechanics.legendre` for H, INTEGRALS of `mechanics.first_integrals`,
DOMAINS of `decision.certify` for the trees of inequalities. A move can be switched off by its name
(`without`), and `counted` counts what each changes: `python -m benchmarks moves` prints both.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Generic, TypeVar

from inverse_service.expressions import collecting, terms as tm, tree as ex

Subject = TypeVar("Subject")
# What counts besides the nodes: a term, a minus before a bracket, a divisor in a divisor. Fitted on
# tests/corpus/costs.ndjson, a hundred formulas of textbooks, each with a form of the same formula
# that this program printed: `python -m benchmarks costs` prints how many of them each weight of a
# term orders as the book does. With more than 3 some are longer: ((x - y)^2 + x^2 + y^2)/2.
TERM, BEFORE_A_BRACKET, FRACTION_IN_FRACTION = 3, 12, 4
# What the cost of a form falls at most, as a rule, when it is finished.
_NEAR = 12


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


@lru_cache(maxsize=1024)
def size(tree: ex.Expression) -> int:
    """The number of nodes, with high penalties for a minus before a bracket and a divisor inside a
    divisor.
    """
    return ex.node_count(tree) + sum(map(_penalty, ex.walk(tree)))


def cost(tree: ex.Expression) -> int:
    """The size and what each term counts: the form of least cost is shown."""
    return size(tree) + TERM * len(ex.summands(tree))


def _penalty(node: ex.Expression) -> int:
    """Only products and powers have one."""
    return _sign(node) + _fractions(node) if isinstance(node, ex.Product | ex.Power) else 0


def _sign(node: ex.Expression) -> int:
    """What the factor -1 of a product counts: a minus before a term less than its nodes, before a
    bracket more.
    """
    if not isinstance(node, ex.Product) or node.factors[0] != ex.MINUS_ONE:
        return 0
    if len(node.factors) > 2:
        return -1
    return BEFORE_A_BRACKET if isinstance(node.factors[1], ex.Sum) else -2


def _fractions(node: ex.Expression) -> int:
    """A penalty for (c + 2 x'/x)/a, which is (c x + 2 x')/(a x), and for (x - 3 y/4)^2."""
    if isinstance(node, ex.Power) and isinstance(node.base, ex.Sum) and not tm.has_velocity(node):
        return FRACTION_IN_FRACTION * any(
            ex.coefficient(term).denominator > 1 for term in node.base.terms
        )
    if not (isinstance(node, ex.Product) and any(map(is_divisor, node.factors))):
        return 0
    terms = (term for factor in node.factors if isinstance(factor, ex.Sum) for term in factor.terms)
    return FRACTION_IN_FRACTION * any(
        is_divisor(part) for term in terms for part in ex.factors_of(term)
    )


def is_divisor(node: ex.Expression) -> bool:
    return (
        isinstance(node, ex.Power)
        and isinstance(node.exponent, ex.Number)
        and node.exponent.value < 0
    )


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
    admit: Callable[[ex.Expression], bool] = lambda form: True,
    failures: tuple[type[Exception], ...] = (),
    finish: Callable[[ex.Expression], ex.Expression] | None = None,
) -> ex.Expression:
    """The tree, or the first of the cheapest forms that are admitted, powers merged, if that costs
    less.

    Forms of nearly the least cost are compared after `finish`, which makes them cheaper.
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
    if finish is not None:
        most = min(cost(one) for one, _ in written) + _NEAR
        written = [(finish(one), form) for one, form in written if cost(one) <= most]
    best, form = min(written, key=lambda pair: cost(pair[0]))
    shorter = cost(best) < cost(tree)
    _count(form, shorter)
    return best if shorter else tree


def _count(move: object, changed: bool) -> None:
    table = _changes.get()
    if table is not None and changed:
        table[move] += 1
