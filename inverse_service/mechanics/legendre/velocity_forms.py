"""The Legendre transform in linear forms of the velocities, for an L that is written in them.

With w = A(t, q) v and L(t, q, v) = M(t, q, w) the momenta are p = A^T pi, pi = dM/dw, and H(q, p) =
K(q, A^-T p) where K belongs to M: L = (r cos u)' log (r cos u)' + … is solved so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from mpmath import mp, mpf

from inverse_service.errors import InputError
from inverse_service.expressions.collecting import expand
from inverse_service.expressions.collecting_trees import terms_tree
from inverse_service.expressions.evaluation import Real
from inverse_service.expressions.tree import ONE, ZERO, Expression, Number, Sum, Symbol, Velocity, add, substitute, walk
from inverse_service.mechanics.legendre.forms import simplified, size
from inverse_service.mechanics.legendre.points import DIGITS, Claim, Point, judge, sample_points, value
from inverse_service.mechanics.legendre.transform import LegendreTransform, legendre, on_branch

Row = list[Expression]
_TIME_LIMIT = 2.0
_TINY = mpf(10) ** -30


def in_velocity_forms(lagrangian: Expression, implicit: LegendreTransform, names: Sequence[str]) -> LegendreTransform:
    """The transform with H in closed form where the sums of velocities in L allow it; else the given one."""
    points = sample_points([lagrangian, *implicit.momenta])
    chosen = _basis(lagrangian, names, points[0]) if points else []
    inverse = _inverse([row for _, row in chosen], points[0]) if chosen else None
    if inverse is None:
        return implicit
    taken = {node.name for node in walk(lagrangian) if isinstance(node, Symbol)} | set(names)
    rates = [Velocity(name) for name in _fresh(len(names), taken)]
    forms: dict[Expression, Expression] = {form: rate for (form, _), rate in zip(chosen, rates, strict=True)}
    solved: dict[Expression, Expression] = {
        Velocity(name): _combined(row, rates) for name, row in zip(names, inverse, strict=True)
    }
    try:
        other = legendre(
            substitute(substitute(lagrangian, forms), solved), [rate.coordinate for rate in rates], _TIME_LIMIT
        )
    except InputError:
        return implicit
    if other.implicit:
        return implicit
    closed = _carried_back(other, implicit, inverse)
    back = {**_momenta_table(other, implicit, inverse), **{rate: form for form, rate in forms.items()}}
    conditions = [substitute(condition, back) for condition in other.conditions]
    if judge(_claim(closed, names), conditions, points) is None:
        return implicit
    return on_branch(closed, tuple(c for c in conditions if not _is_positive_at(c, points)), names)


def _is_positive_at(condition: Expression, points: Sequence[Point]) -> bool:
    """Whether the condition holds at all points, so that it tells nothing."""
    with mp.workdps(DIGITS):
        numbers = [value(condition, point) for point in points]
    return all(number is not None and number > 0 for number in numbers)


def _forms(lagrangian: Expression, names: Sequence[str]) -> Iterator[tuple[Expression, Row]]:
    """Sums of velocities in L, those that stand there most often first, then velocities; each with its row.

    Of the velocities those that stand in L outside these sums come first.
    """
    counts = Counter(node for node in walk(lagrangian) if isinstance(node, Sum))
    rows = [(form, _row(form, names)) for form, _ in counts.most_common()]
    found = {form: row for form, row in rows if row is not None}
    yield from found.items()
    outside = set(walk(substitute(lagrangian, dict.fromkeys(found, ONE))))
    for name in sorted(names, key=lambda name: Velocity(name) not in outside):
        yield Velocity(name), [ONE if name == other else ZERO for other in names]


def _row(form: Expression, names: Sequence[str]) -> Row | None:
    """The coefficients of a linear form without constant term."""
    parts: dict[str, list[Expression]] = {name: [] for name in names}
    for monomial, coefficient in expand(form).terms:
        moving = [(base, e) for base, e in monomial if any(isinstance(node, Velocity) for node in walk(base))]
        if len(moving) != 1 or not isinstance(moving[0][0], Velocity) or moving[0][1] != 1:
            return None
        velocity = moving[0][0]
        rest = tuple(pair for pair in monomial if pair[0] != velocity)
        parts[velocity.coordinate].append(terms_tree([(rest, coefficient)]))
    return [add(ZERO, *parts[name]) for name in names]


def _basis(lagrangian: Expression, names: Sequence[str], point: Point) -> list[tuple[Expression, Row]]:
    """n independent forms, the first that can be had; none where only velocities are left."""
    chosen: list[tuple[Expression, Row]] = []
    reduced: list[list[Real]] = []
    with mp.workdps(DIGITS):
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


def _inverse(matrix: Sequence[Row], point: Point) -> list[Row] | None:
    """A^-1 by Gauss and Jordan, the shortest pivots first; None where a pivot is lost."""
    n = len(matrix)
    rows = [[*row, *(ONE if i == j else ZERO for j in range(n))] for i, row in enumerate(matrix)]
    for column in range(n):
        usable = [k for k in range(column, n) if _is_nonzero(rows[k][column], point)]
        if not usable:
            return None
        best = min(usable, key=lambda k: size(rows[k][column]))
        rows[column], rows[best] = rows[best], rows[column]
        pivot = rows[column][column]
        rows[column] = [simplified(entry / pivot) for entry in rows[column]]
        for k in range(n):
            factor = rows[k][column]
            if k != column and factor != ZERO:
                pairs = zip(rows[k], rows[column], strict=True)
                rows[k] = [simplified(a - factor * b) if b != ZERO else a for a, b in pairs]
    return [row[n:] for row in rows]


def _is_nonzero(entry: Expression, point: Point) -> bool:
    if isinstance(entry, Number):
        return entry != ZERO
    with mp.workdps(DIGITS):
        found = value(entry, point)
        return found is not None and bool(abs(found) > _TINY)


def _fresh(count: int, taken: set[str]) -> list[str]:
    free = (f"form{k}" for k in range(1, count + len(taken) + 1))
    return [name for name in free if name not in taken][:count]


def _combined(row: Row, factors: Sequence[Expression]) -> Expression:
    return add(ZERO, *(entry * factor for entry, factor in zip(row, factors, strict=True) if entry != ZERO))


def _carried_back(other: LegendreTransform, implicit: LegendreTransform, inverse: Sequence[Row]) -> LegendreTransform:
    """K and w(pi) with pi = A^-T p, v = A^-1 w."""
    table = _momenta_table(other, implicit, inverse)
    rates = [substitute(rate, table) for rate in other.velocities or ()]
    velocities = tuple(_combined(row, rates) for row in inverse)
    return LegendreTransform(
        implicit.lagrangian,
        implicit.symbols,
        substitute(other.hamiltonian, table),
        implicit.momenta,
        velocities,
        False,
        chained=velocities,
    )


def _momenta_table(
    other: LegendreTransform, implicit: LegendreTransform, inverse: Sequence[Row]
) -> dict[Expression, Expression]:
    """pi = A^-T p."""
    columns = [list(column) for column in zip(*inverse, strict=True)]
    return {
        symbol: simplified(_combined(column, implicit.symbols))
        for symbol, column in zip(other.symbols, columns, strict=True)
    }


def _claim(closed: LegendreTransform, names: Sequence[str]) -> Claim:
    known = dict(zip(closed.symbols, closed.momenta, strict=True))
    return Claim(closed.lagrangian, tuple(names), known, closed.velocities or (), closed.hamiltonian)
