"""The values of the constants with which a picture begins: a member of the family that its answer is about."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

import mpmath

from inverse_service import errors
from inverse_service.certificate import checker
from inverse_service.expressions import calculus, tree as ex
from inverse_service.reading import names as nm, reader

Values = dict[str, float]
OTHERS = (2, 3, 0.5)  # of one constant, where the others are 1
APART = (1, 2, 0.5, 1.5, 3, 0.75)  # of all constants, in turn
ZERO = 1e-9


def general_values(
    names: nm.Names,
    accelerations: Sequence[ex.Expression],
    given: Mapping[str, float],
    exceptions: Sequence[str],
) -> Values:
    """1 for each constant without a given value; other values where that is an exception of the
    answer, or where linear forces leave a point at rest wherever it is.
    """
    excepted = [*_sets(names, exceptions)]
    forces = _slopes(names, accelerations)
    found = [dict(one) for one in _members(names.parameters, given)]
    general = [one for one in found if not any(_holds(one, trees) for trees in excepted)]
    bound = (one for one in general if forces is None or not _is_singular(one, forces))
    return next(bound, (general or found)[0])


def _members(letters: Sequence[str], given: Mapping[str, float]) -> Iterator[Values]:
    """Values of the constants, the simplest first."""
    free = [name for name in letters if name not in given]
    yield {name: given.get(name, 1) for name in letters}
    for value, name in itertools.product(OTHERS, free):
        yield {one: given.get(one, value if one == name else 1) for one in letters}
    for first in range(len(APART) if len(free) > 1 else 0):
        apart = dict(zip(free, itertools.islice(itertools.cycle(APART), first, None), strict=False))
        yield {one: given.get(one, apart.get(one, 1)) for one in letters}


def _sets(names: nm.Names, exceptions: Sequence[str]) -> Iterator[list[ex.Expression]]:
    """What vanishes on each exception that is written by equations."""
    for text in checker.read_exceptions(exceptions).values:
        with suppress(errors.InputError):
            sides = [part.partition(" = ")[::2] for part in text.split(" and ")]
            yield [
                ex.subtract(*(reader.read_formula(side, names) for side in pair)) for pair in sides
            ]


def _slopes(
    names: nm.Names, accelerations: Sequence[ex.Expression]
) -> list[list[ex.Expression]] | None:
    """The slopes of the forces in the coordinates, if these are constants and not all free of letters; else None."""
    try:
        rows = [
            [calculus.differentiate(f, ex.Symbol(name)) for name in names.coordinates]
            for f in accelerations
        ]
    except errors.InputError:  # of pieces
        return None
    letters = {ex.Symbol(name) for name in names.parameters}
    leaves = {
        node
        for row in rows
        for tree in row
        for node in ex.walk(tree)
        if isinstance(node, ex.Symbol | ex.Velocity | ex.Arbitrary)
    }
    return rows if len(rows) > 1 and leaves and leaves <= letters else None


def _value(values: Values, tree: ex.Expression) -> mpmath.mpf:
    """nan where it has none."""
    try:
        return calculus.evaluate(
            tree, {ex.Symbol(name): mpmath.mpf(one) for name, one in values.items()}
        )
    except (calculus.NoRealValue, ArithmeticError, KeyError):
        return mpmath.nan


def _holds(values: Values, trees: Sequence[ex.Expression]) -> bool:
    return all(abs(_value(values, tree)) < ZERO for tree in trees)


def _is_singular(values: Values, rows: Sequence[Sequence[ex.Expression]]) -> bool:
    matrix = mpmath.matrix([[_value(values, tree) for tree in row] for row in rows])
    return bool(abs(mpmath.det(matrix)) < ZERO)
