"""Equations as a document gives them, not solved for q'', against those of a certificate.

A caller evaluates trees of its own by the operations of a ring (`add`, `multiply`, `real_power`,
`constant`, `function`, and those below), and says what has to vanish and what has to be regular:
what has to vanish is zero by algebra, what has to be regular is so by balls at the real point.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from itertools import combinations
from typing import Any, NamedTuple

from . import cell, formulas as fm, numbers as nb, question as qu
from .cell import Cell
from .judging import CheckResult, judged

Ring = Any  # one of the checker's, and an element of it
Value = Any
Rows = list[list[Value]]
# What has to vanish, each with what is wrong otherwise, and the matrix that has to be regular.
Parts = Callable[[Ring], tuple[list[tuple[Value, str]], Rows]]


def examined(
    system: Mapping[str, Any],
    claim: Mapping[str, Any],
    parts: Parts,
    regular: Callable[[Ring], Rows] | None,
    rational: bool,
    sentences: tuple[str, str],
    time_limit: float,
) -> CheckResult:
    """The verdict by the checker's two rules on what has to vanish and what has to be regular;
    never raises.

    `regular` reads the matrix without f, to say where it is regular; None for a matrix of
    constants. `sentences` say what a valid claim means, and what is wrong where it is singular.
    """

    def claims(ring: Ring) -> qu.Claims:
        zeros, rows = parts(ring)
        numbers = [[entry.get(0, 0) for entry in row] for row in rows]
        return qu.Claims([qu.Zero(*pair) for pair in zeros], [qu.Regular(numbers, sentences[1])])

    def where(question: qu.Question) -> Cell:
        if question.unsolved:
            return Cell()
        sides = cell.sides_of(question, parts)
        if regular is None:
            return sides
        found = cell.where_regular(question, regular)
        domain, unknown = (*sides.domain, *found.domain), sides.unknown or found.unknown
        return replace(sides, domain=domain, unknown=unknown)

    def work(tools: qu.Tools) -> list[str]:
        question = qu.Question(tools, system, claim=claim)
        question.prepare(parts, (), rational)
        question.settle(0, claims)
        try:
            cells.append(where(question))
        except fm.Ended:
            cells.append(Cell(unknown=True))
        return [sentences[0]]

    cells, begun = list[Cell](), time.thread_time()
    found = judged(work, time_limit, None)
    left = time_limit - (time.thread_time() - begun)
    # The points are drawn at random: other points may decide what these did not.
    if found.verdict == "incomplete" and left > time_limit / 2:
        found = judged(work, left, None)
    return replace(found, cell=cells[-1]) if found.verdict == "valid" else found


def forces(ring: Ring, values: Mapping[str, Value]) -> list[Value]:
    """f of the certificate, with these values of the velocities."""
    bound = {name: value for name, value in values.items() if name.endswith("'")}
    found: list[Value] = fm.read_formulas(ring, ring.question.force_texts, **bound)
    return found


def against_lines(value: Value, ring: Ring, candidates: list[Sequence[tuple[int, int]]]) -> Value:
    """A value that vanishes where E is a line of the certificate or the sum of two, each with a
    sign.

    That is if these lines are not solved for q''. As the matrix dE/dq'' is regular, so is the
    matrix of the signs. The first call finds the candidates: a difference that is not 0 at one
    point is not 0.
    """
    texts = ring.question.unsolved
    if not texts:
        return value
    lines = [fm.value_of(ring, text) for text in texts]
    alone = [(k, sign) for k in range(len(lines)) for sign in (1, -1)]
    every = [
        *((one,) for one in alone),
        *(pair for pair in combinations(alone, 2) if pair[0][0] != pair[1][0]),
    ]
    differences = {
        chosen: ring.add(
            [value, *(lines[k] for k, _ in chosen)], [1, *(sign for _, sign in chosen)]
        )
        for chosen in candidates or every
    }
    if not candidates:
        candidates += [one for one in every if _may_vanish(differences[one], ring)] or every
    return reduce(
        lambda left, right: ring.multiply(left, right, 0), [differences[one] for one in candidates]
    )


def _may_vanish(value: Value, ring: Ring) -> bool:
    """Whether a value read at one point is 0 there, or in balls perhaps."""
    return all(
        number.contains(0) if isinstance(ring.arithmetic, nb.Balls) else number == 0
        for number in value.values()
    )


class Told(NamedTuple):
    """The texts of values that a ring was given, and its names with these values."""

    values: Mapping[str, str]
    names: Mapping[str, Value]


def second_reading(
    ring: Ring, sides: tuple[str, str], values: Mapping[str, str], known: Mapping[str, Value]
) -> Value | None:
    """left - right by the checker's reader, with texts and values of names; None where one of the
    texts is not in its grammar.
    """
    said = {**values, **dict.fromkeys(known, "")}
    try:
        # Once for all equations, so that they share their parts. Whether it was done is a matter of
        # texts: all rings have to meet the same atoms, and the values of some are the same where
        # those of others are not.
        told = getattr(ring, "told", None)
        if told is None or told.values != said or told.names is not ring.names:
            given = {
                name: fm.value_of(ring, fm.read_tokens(written, "formula"))
                for name, written in values.items()
            }
            ring.names = ring.names | known | given
            ring.told = Told(said, ring.names)
        both = [fm.value_of(ring, fm.read_tokens(side, "formula")) for side in sides]
    except fm.Ended as end:
        if end.args[0] == "incomplete":
            raise
        return None
    return ring.add(both, [1, -1])


def is_irrational(texts: Sequence[str]) -> bool:
    """Whether the checker's reader meets more than rational operations; False for what it cannot
    read.
    """
    try:
        return any(fm.is_irrational(fm.read_tokens(text, "formula")) for text in texts)
    except fm.Ended:
        return False


def real_power(ring: Ring, base: Value, exponent: Value) -> Value:
    """base^exponent for an exponent that is no integer."""
    return fm.combined(ring, "^", base, exponent)


def applied(
    ring: Ring, name: str, argument: Value, order: tuple[Value, int, bool] | None = None
) -> Value:
    """A function of the grammar; `order`: that of a function with one, its integer part, and
    whether it is an integer.
    """
    if name not in fm.SPECIAL:
        return fm.applied(ring, name, argument)
    value, shift, whole = order or (None, 0, False)
    values = [argument] if order is None else [value, argument]
    return ring.special(name, values, fm.Order(shift, whole))
