"""The Legendre transform in linear forms of the velocities, for an L that is written in them.

With w = A(t, q) v and L(t, q, v) = M(t, q, w) the momenta are p = A^T pi, pi = dM/dw, and H(q, p) =
K(q, A^-T p) where K belongs to M: L = (r cos u)' log (r cos u)' + … is solved so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

from mpmath import mp, mpf

from inverse_service import bounds
from inverse_service.errors import InputError
from inverse_service.expressions.collecting import expand
from inverse_service.expressions.collecting_trees import monomial_tree
from inverse_service.expressions.evaluation import Real
from inverse_service.expressions.tree import ONE, ZERO, Expression, Sum, Symbol, Velocity, substitute, walk
from inverse_service.mechanics.legendre.blocks import Block, Branch
from inverse_service.mechanics.legendre.linear import Form, Table, after_change, linear_coefficients
from inverse_service.mechanics.legendre.points import Point, judge, sample_points, value
from inverse_service.mechanics.legendre.quadratic import invert
from inverse_service.mechanics.legendre.short_forms import velocities_in
from inverse_service.mechanics.legendre.transform import LegendreTransform, claim_of, legendre, on_branch

_TIME_LIMIT = 2.0
_TINY = mpf(10) ** -30


def in_velocity_forms(lagrangian: Expression, implicit: LegendreTransform, names: Sequence[str]) -> LegendreTransform:
    """The transform with H in closed form where the sums of velocities in L allow it; else the given one."""
    points = sample_points([lagrangian, *implicit.momenta])
    chosen = _basis(lagrangian, names, points[0]) if points else []
    rows = [row for _, row in chosen]
    inverse = invert(rows) if chosen else None
    if inverse is None:
        return implicit
    block = Block(lagrangian, tuple(names), dict(zip(names, implicit.symbols, strict=True)))
    written: Table = {form: Velocity(name) for (form, _), name in zip(chosen, names, strict=True)}
    branch = next(after_change(block, rows, inverse, _closed_form, written), None)
    if branch is None:
        return implicit
    closed = LegendreTransform(
        lagrangian, implicit.symbols, branch.hamiltonian, implicit.momenta, branch.velocities, False,
        chained=branch.velocities,
    )  # fmt: skip
    if judge(claim_of(closed, block.names), branch.conditions, points) is None:
        return implicit
    return on_branch(closed, tuple(c for c in branch.conditions if not _is_positive_at(c, points)), names)


def _closed_form(function: Expression, names: Sequence[str], momenta: Mapping[str, Symbol]) -> Iterator[Branch]:
    """The transform of the whole, if it has a closed form in momenta of these names."""
    with suppress(InputError):
        found = legendre(function, names, _TIME_LIMIT)
        if found.velocities is not None and found.symbols == tuple(momenta.values()):
            yield Branch(found.velocities, found.hamiltonian, found.conditions)


def _is_positive_at(condition: Expression, points: Sequence[Point]) -> bool:
    """Whether the condition holds at all points, so that it tells nothing."""
    with mp.workdps(bounds.DIGITS):
        numbers = [value(condition, point) for point in points]
    return all(number is not None and number > 0 for number in numbers)


def _forms(lagrangian: Expression, names: Sequence[str]) -> Iterator[tuple[Expression, Form]]:
    """Sums of velocities in L, those that stand there most often first, then velocities; each with its row.

    Of the velocities those that stand in L outside these sums come first.
    """
    counts = Counter(node for node in walk(lagrangian) if isinstance(node, Sum))
    rows = [(form, _row(form, names)) for form, _ in counts.most_common()]
    found = {form: row for form, row in rows if row is not None}
    yield from found.items()
    outside = set(walk(substitute(lagrangian, dict.fromkeys(found, ONE))))
    for name in sorted(names, key=lambda name: Velocity(name) not in outside):
        yield Velocity(name), tuple(ONE if name == other else ZERO for other in names)


def _row(form: Expression, names: Sequence[str]) -> Form | None:
    """The coefficients of a linear form without constant term."""
    terms = expand(form)
    found = linear_coefficients(terms, names)
    if found is None or not all(velocities_in(monomial_tree(monomial), names) for monomial, _ in terms):
        return None
    return tuple(found.get(name, ZERO) for name in names)


def _basis(lagrangian: Expression, names: Sequence[str], point: Point) -> list[tuple[Expression, Form]]:
    """n independent forms, the first that can be had; none where only velocities are left."""
    chosen: list[tuple[Expression, Form]] = []
    reduced: list[list[Real]] = []
    with mp.workdps(bounds.DIGITS):
        for form, row in _forms(lagrangian, names):
            numbers = [value(entry, point) for entry in row]
            rest = _eliminated(numbers, reduced) if None not in numbers else None
            if rest is not None:
                reduced.append(rest)
                chosen.append((form, row))
            if len(chosen) == len(names):
                break
    plain = all(isinstance(form, Velocity) for form, _ in chosen)
    return [] if plain or len(chosen) < len(names) else chosen


def _eliminated(numbers: Sequence[Real], reduced: Sequence[Sequence[Real]]) -> list[Real] | None:
    """The row less its part in the rows before, with leading entry 1; None where nothing is left."""
    rest = list(numbers)
    for other in reduced:
        place = next(k for k, entry in enumerate(other) if abs(entry) > _TINY)
        rest = [a - rest[place] * b for a, b in zip(rest, other, strict=True)]
    pivot = next((entry for entry in rest if abs(entry) > _TINY), None)
    return None if pivot is None else [entry / pivot for entry in rest]
