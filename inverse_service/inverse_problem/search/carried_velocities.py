"""Systems w'' = 0, x'' = w' A(w) x' read off the terms of f, in blocks with A = W'(w) A_0, A_0 constant."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, add, divide, multiply, number, walk
from inverse_service.inverse_problem.search.material import antiderivatives
from inverse_service.inverse_problem.search.motion import MotionTerms
from inverse_service.inverse_problem.search.terms import (
    EMPTY,
    Monomial,
    Terms,
    TooManyTerms,
    derivative,
    monomial,
    monomial_tree,
    multiply_terms,
    times,
    tree_of,
)

Rows = dict[Velocity, dict[Velocity, Terms]]


@dataclass(frozen=True, slots=True)
class Block:
    """Velocities x' with x'' = w' W'(w) A_0 x': A_0 as terms, and W, a function of the carrier's coordinate."""

    velocities: tuple[Velocity, ...]
    matrix: tuple[tuple[Terms, ...], ...]
    rate: Expression


@dataclass(frozen=True, slots=True)
class Carried:
    """w' and the blocks."""

    carrier: Velocity
    blocks: tuple[Block, ...]


def carried(motion: MotionTerms) -> Carried | None:
    """The parts of f where some A is not zero, or None where f is of another kind."""
    for carrier, f in zip(motion.velocities, motion.forces, strict=True):
        if not f:
            found = _carried_by(carrier, motion)
            if found is not None:
                return found
    return None


def _carried_by(carrier: Velocity, motion: MotionTerms) -> Carried | None:
    rows = _rows(carrier, motion)
    if rows is None or not any(entry for row in rows.values() for entry in row.values()):
        return None
    w = Symbol(carrier.coordinate)
    blocks = [_block(rows, group, w) for group in _groups(rows)]
    found = tuple(block for block in blocks if block is not None)
    return Carried(carrier, found) if len(found) == len(blocks) else None


def _rows(carrier: Velocity, motion: MotionTerms) -> Rows | None:
    """The entries of A(w); None where f holds other terms."""
    others = [v for v in motion.velocities if v != carrier]
    w = Symbol(carrier.coordinate)
    moving = {*motion.coordinates, *motion.velocities, TIME} - {w}
    rows: Rows = {v: {other: {} for other in others} for v in motion.velocities}
    for v, f in zip(motion.velocities, motion.forces, strict=True):
        for key, value in f.items():
            letters = dict(key)
            own = [other for other in others if letters.get(other) == 1]
            rest = key - monomial(carrier, *own)
            if letters.get(carrier) != 1 or len(own) != 1 or any(node in moving for p, _ in rest for node in walk(p)):
                return None
            rows[v][own[0]][rest] = value
    return {v: row for v, row in rows.items() if v != carrier}


def _groups(rows: Rows) -> list[tuple[Velocity, ...]]:
    """Velocities that occur in each other's equations, directly or by others, in their order."""
    groups: list[set[Velocity]] = [{v} for v in rows]
    for v, row in rows.items():
        used = {v} | {other for other, entry in row.items() if entry}
        joined = set().union(*(group for group in groups if group & used))
        groups = [*(group for group in groups if not group & used), joined]
    return sorted((tuple(v for v in rows if v in group) for group in groups), key=lambda g: list(rows).index(g[0]))


def _block(rows: Rows, group: Sequence[Velocity], w: Symbol) -> Block | None:
    """None where the entries are no common function of w with an antiderivative that is a monomial."""
    parts: dict[Monomial, dict[tuple[Velocity, Velocity], Terms]] = {}
    for v in group:
        for other in group:
            for key, value in rows[v][other].items():
                function: Monomial = frozenset(item for item in key if w in set(walk(item[0])))
                parts.setdefault(function, {}).setdefault((v, other), {})[key - function] = value
    if not parts:
        return Block(tuple(group), tuple(tuple({} for _ in group) for _ in group), w)
    reference = next(iter(parts.values()))
    rates = [_rate(function, entries, reference, w) for function, entries in parts.items()]
    if any(rate is None for rate in rates):
        return None
    matrix = tuple(tuple(reference.get((v, other), {}) for other in group) for v in group)
    return Block(tuple(group), matrix, add(*(rate for rate in rates if rate is not None)))


def _rate(
    function: Monomial,
    entries: Mapping[tuple[Velocity, Velocity], Terms],
    reference: Mapping[tuple[Velocity, Velocity], Terms],
    w: Symbol,
) -> Expression | None:
    """factor * int function dw, where the entries are a factor times those of the reference."""
    place, first = next(iter(reference.items()))
    (key, value), *_ = first.items()
    factors: Iterable[Terms] = ({times(k, key, -1): a / value} for k, a in entries.get(place, {}).items())
    primitive = _primitive(function, w)
    for factor in factors if primitive is not None else ():
        if {at: multiply_terms(factor, terms) for at, terms in reference.items()} == dict(entries):
            return multiply(tree_of(factor), primitive) if primitive is not None else None
    return None


def _primitive(function: Monomial, w: Symbol) -> Expression | None:
    """A monomial whose derivative by w is a number times the function, divided by that number."""
    if function == EMPTY:
        return w
    for candidate in antiderivatives(function, w):
        try:
            slope = derivative(candidate, w)
        except TooManyTerms:
            continue
        if list(slope) == [function]:
            return divide(monomial_tree(candidate), number(slope[function]))
    return None
