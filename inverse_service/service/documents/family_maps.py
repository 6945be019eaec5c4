"""The map of a family for two of its constants: in the color of the general member, with curves and
points where members have another answer.

A leaf is a curve where one of its equations holds the two constants, and points where several do;
the other constants have given values. Curves are zero sets on a grid, refined by secants. What a
mark looks like says its verdict: lines are solid with an L(q, q'), dashed with an L(t, q, q')
alone, dotted without; points are filled, hollow or crossed alike. Dots fill where the kinetic
energy of the general member's L, or of -L, is positive (T > 0), where that depends on the constants
alone: on those of a x'^2 + b r^2 y'^2, too.
"""

from __future__ import annotations

import html
import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Literal, NamedTuple

import mpmath
import numpy as np

from inverse_service import errors
from inverse_service.expressions import calculus, collecting, printing, terms as tm, tree as ex
from inverse_service.mechanics import euler_lagrange
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import printed_pages, stated
from inverse_service.service.documents.family_tables import lagrangian_of_leaf, own_names, table_of
from inverse_service.service.documents.sheets import (
    LONGEST_CONDITION,
    NO,
    YES,
    FamilyTable,
    Formula,
    Member,
    formula_of,
)

SPAN = 3.0  # the constants of a map go from -SPAN to SPAN
CELLS, COARSE = 96, 60  # of the grids for lines and regions, in each direction
POSITIVE, ROUND_OFF = "T > 0 for L or \u2212L", 1e-9
WIDTH, HEIGHT, LEFT, TOP, SIDE = 560, 524, 44, 14, 470  # of the figure, and of the square in it
CHARACTER, LINE = 12.2, 30.0  # of a label as on a phone, where its letters are largest
EXACT, REACH = 1e-3, 0.09  # how far a member may be from a set that it belongs to, and from a curve
ON, POINTS_APART, STEP = 1e-4, 0.02, 1e-4  # how far lines and points are from what is left out
AXES = 2  # constants of a map
# Of Newton's method: steps, the last one, digits of what is found, and how far it may be.
MOST_STEPS, CLOSE, DIGITS, MOST_FAR = 60, 1e-9, 6, 50.0
Point = tuple[float, float]
Number = Callable[[float, float], float]
COLORS = {
    "paper": "#fbfaf7",
    "tint": "#e8eff8",
    "edge": "#858b97",
    "ink": "#1c2330",
    "yes": "#1d6b45",
    "no": "#9a3324",
}


@dataclass(frozen=True, slots=True)
class Mark:
    """What a leaf is in the plane: lines and points, or all of it."""

    member: Member
    lines: tuple[tuple[Point, ...], ...] = ()
    points: tuple[Point, ...] = ()
    is_everywhere: bool = False


@dataclass(frozen=True, slots=True)
class Map:
    """The plane of two constants at values of the others."""

    across: str
    up: str
    values: Mapping[str, float]
    table: FamilyTable
    marks: tuple[Mark, ...]
    positive: tuple[tuple[Point, ...], ...] = ()  # polygons where the kinetic energy is definite

    @property
    def general(self) -> Member:
        """The set that most points of the plane belong to."""
        return next(
            (one.member for one in reversed(self.marks) if one.is_everywhere), self.table.members[0]
        )


def letters_of(result: Mapping[str, Any]) -> list[str]:
    """The constants of a family that a map may show; fewer than two if there is none."""
    return list((result.get("family") or {}).get("letters") or ())


class Plane(NamedTuple):
    """The constants on the two axes of a map."""

    across: str
    up: str


def plane_of(result: Mapping[str, Any]) -> Plane:
    """(across, up): the constants of the shortest equation with two of them, else the first two."""
    letters = letters_of(result)
    equations = [
        [name for name in letters if _holds(one["text"], name)]
        for leaf in result["family"]["leaves"]
        for one in leaf["equations"]
    ]
    two = next((held for held in sorted(equations, key=len) if len(held) >= 2), letters)
    first, second = sorted(two[:2], key=letters.index)
    return Plane(first, second)


def _holds(text: str, name: str) -> bool:
    return re.search(rf"\b{name}\b", text) is not None


def map_of(
    result: Mapping[str, Any], across: str, up: str, values: Mapping[str, float]
) -> Map | None:
    """The map of a result; None if it has no family in these constants, or unknown functions alone."""
    table, letters = table_of(result), letters_of(result)
    if table is None or across == up or not {across, up} <= {*letters}:
        return None
    fixed = {name: values.get(name, 1.0) for name in letters if name not in (across, up)}
    plane, marks, last = _Plane(across, up, fixed), list[Mark](), 0
    listed = conditions_of(result)
    for conditions, member in zip(listed, table.members, strict=True):
        found = None if conditions is None else _mark(member, conditions, plane)
        if found is not None and member.leaf:
            marks.append(found)
            last = len(marks) if found.is_everywhere else last
    if last and (whole := listed[marks[last - 1].member.leaf]) is not None:
        marks[last:last] = _left_out(result, whole, plane)
    shown = Map(across, up, fixed, table, tuple(marks))
    terms = _hessian_terms(result, shown.general.leaf)
    positive = tuple(_positive(terms, across, up, fixed)) if terms else ()
    return replace(shown, positive=positive)


def _tree(text: str, names: Names) -> ex.Expression:
    left, right = text.split(" = ")
    return reader.read_formula(left, names) - reader.read_formula(right, names)


class Conditions(NamedTuple):
    """What holds on a leaf, and what vanishes nowhere on it."""

    equations: list[ex.Expression]
    apart: list[ex.Expression]


def conditions_of(result: Mapping[str, Any]) -> list[Conditions | None]:
    """The conditions of each leaf on the constants; None where an equation holds functions."""
    names, found = Names((), tuple(letters_of(result)), {}), list[Conditions | None]()
    for leaf in result["family"]["leaves"]:
        apart = list[ex.Expression]()
        for text in leaf["nonzero"]:
            with suppress(errors.InputError):  # a general function satisfies it
                apart.append(reader.read_formula(text, names))
        try:
            found.append(
                Conditions([_tree(one["text"], names) for one in leaf["equations"]], apart)
            )
        except errors.InputError:
            found.append(None)
    return found


class _Plane(NamedTuple):
    """Two constants, and the values of the others."""

    across: str
    up: str
    values: Mapping[str, float]

    def put_in(self, tree: ex.Expression) -> ex.Expression:
        known: dict[ex.Expression, ex.Expression] = {
            ex.Symbol(name): ex.number(f"{value:.4f}") for name, value in self.values.items()
        }
        return collecting.collect(ex.substitute(tree, known))

    def has(self, tree: ex.Expression) -> bool:
        """Whether one of the two constants occurs."""
        return any(ex.holds(tree, ex.Symbol(name)) for name in (self.across, self.up))

    def number(self, tree: ex.Expression) -> Number:
        return _number(tree, self.across, self.up)


def _mark(member: Member, conditions: Conditions, plane: _Plane) -> Mark | None:
    apart = list(map(plane.put_in, conditions.apart))
    equations = [one for one in map(plane.put_in, conditions.equations) if one != ex.ZERO]
    if ex.ZERO in apart or not all(map(plane.has, equations)):
        return None  # it is at other values of the sliders
    if not equations:
        return Mark(member, is_everywhere=True)
    functions = list(map(plane.number, equations))
    without = [plane.number(one) for one in apart if plane.has(one)]
    lines = [part for one in _zero_set(functions[0]) for part in _outside(one, without)]
    if len(functions) == 1:
        return Mark(member, lines=tuple(lines)) if lines else None
    points = tuple(
        one for one in _common(lines, functions[1:]) if not _is_on(one, without, POINTS_APART)
    )
    return Mark(member, points=points) if points else None


def _left_out(result: Mapping[str, Any], conditions: Conditions, plane: _Plane) -> Iterator[Mark]:
    """The lines that inequations take out of a set that is all of the plane otherwise."""
    for tree in filter(plane.has, map(plane.put_in, conditions.apart)):
        where = (f"{printing.to_text(tree)} = 0",)
        for line in _zero_set(plane.number(tree)):
            x, y = line[len(line) // 3]
            member = member_at(result, {**plane.values, plane.across: x, plane.up: y})
            if member is not None:
                yield Mark(replace(member, where=where), lines=(line,))


def _outside(line: Sequence[Point], functions: Sequence[Number]) -> Iterator[tuple[Point, ...]]:
    """The parts of a line on which none of the functions vanishes."""
    for is_on, points in itertools.groupby(line, lambda one: _is_on(one, functions, ON)):
        part = tuple(points)
        if not is_on and len(part) > 1:
            yield part


def _is_on(point: Point, functions: Sequence[Number], near: float) -> bool:
    """Whether one of the functions has a zero that is at most about this far."""
    x, y = point
    for one in functions:
        slopes = (one(x + STEP, y) - one(x - STEP, y), one(x, y + STEP) - one(x, y - STEP))
        if abs(one(x, y)) <= near * (math.hypot(*slopes) / (2 * STEP) or 1):
            return True
    return False


def _number(tree: ex.Expression, across: str, up: str) -> Number:
    """The tree as a function of two numbers; nan where it has no value."""
    terms = _terms(tree, across, up)
    if terms is not None:
        return lambda x, y: sum(c * x**i * y**j for c, i, j in terms)
    first, second = ex.Symbol(across), ex.Symbol(up)

    def value(x: float, y: float) -> float:
        try:
            return float(calculus.evaluate(tree, {first: mpmath.mpf(x), second: mpmath.mpf(y)}))
        except (calculus.NoRealValue, ArithmeticError, ValueError, TypeError):
            return math.nan

    return value


def _terms(tree: ex.Expression, across: str, up: str) -> list[tuple[float, int, int]] | None:
    """The terms of a polynomial, (coefficient, exponents); None for others."""
    found = list[tuple[float, int, int]]()
    for monomial, coefficient in collecting.expand(tree):
        exponents = {across: 0, up: 0}
        for base, exponent in monomial:
            if not (isinstance(base, ex.Symbol) and base.name in exponents):
                return None
            if exponent.denominator != 1 or exponent < 0:
                return None
            exponents[base.name] = int(exponent)
        found.append((float(coefficient), exponents[across], exponents[up]))
    return found


def _zero_set(function: Number) -> Iterator[tuple[Point, ...]]:
    """The zero set in the square as lines: pieces in the cells of a grid, joined."""
    # No corner lies on a line through nice numbers, so that each cell has an even number of zeros.
    step = 2 * SPAN / CELLS
    grid, rows = (
        [-SPAN + step * (k + shift) for k in range(-1, CELLS + 2)] for shift in (0.1371, 0.3183)
    )
    values = [[function(x, y) for y in rows] for x in grid]
    links = dict[tuple[int, int, int], list[tuple[int, int, int]]]()
    places = dict[tuple[int, int, int], Point]()

    def crossing(i: int, j: int, way: int) -> tuple[int, int, int] | None:
        """The zero on the edge from (i, j) along x (0) or y (1)."""
        a = values[i][j]
        k, m = (i + 1, j) if way == 0 else (i, j + 1)
        b = values[k][m]
        if not (a * b < 0):
            return None
        key = (i, j, way)
        if key not in places:
            t = _secant(function, (grid[i], rows[j]), (grid[k], rows[m]), a, b)
            places[key] = (
                grid[i] + t * (grid[k] - grid[i]),
                rows[j] + t * (rows[m] - rows[j]),
            )
        return key

    for i in range(len(grid) - 1):
        for j in range(len(rows) - 1):
            edges = (crossing(i, j, 0), crossing(i, j, 1), crossing(i + 1, j, 1), crossing(i, j + 1, 0))  # fmt: skip
            ends = [one for one in edges if one is not None]
            for left, right in zip(ends[::2], ends[1::2], strict=False):
                links.setdefault(left, []).append(right)
                links.setdefault(right, []).append(left)
    for chain in _chains(links):
        yield from _within([places[one] for one in chain])


def _within(line: Sequence[Point]) -> Iterator[tuple[Point, ...]]:
    """The parts of a line in the square, each up to the side that it crosses."""
    part = list[Point]()
    for one, other in itertools.pairwise(line):
        low, high = 0.0, 1.0
        for a, b in zip(one, other, strict=True):
            if a != b:
                near, far = sorted(((-SPAN - a) / (b - a), (SPAN - a) / (b - a)))
                low, high = max(low, near), min(high, far)
            elif abs(a) > SPAN:
                high = -1.0
        if part and (low > 0 or high < low):
            yield tuple(part)
            part = []
        if high >= low:
            ends = [(one[0] + t * (other[0] - one[0]), one[1] + t * (other[1] - one[1]))
                    for t in (low, high)]  # fmt: skip
            part += ends[bool(part) :]
    if part:
        yield tuple(part)


def _secant(function: Number, left: Point, right: Point, a: float, b: float) -> float:
    """Where between two points of different sign the function is zero, as a part of the way."""
    low, high = 0.0, 1.0
    for _ in range(24):
        t = low + (high - low) * a / (a - b)
        t = min(max(t, low + 0.05 * (high - low)), high - 0.05 * (high - low))
        value = function(left[0] + t * (right[0] - left[0]), left[1] + t * (right[1] - left[1]))
        if not value or high - low < 1e-6:
            return t
        if (value < 0) == (a < 0):
            low, a = t, value
        else:
            high, b = t, value
    return (low + high) / 2


def _chains(
    links: Mapping[tuple[int, int, int], list[tuple[int, int, int]]],
) -> Iterator[list[tuple[int, int, int]]]:
    left = {key: list(others) for key, others in links.items()}
    for start in sorted(left, key=lambda key: len(left[key])):
        chain, here = [start], start
        while left[here]:
            there = left[here].pop()
            if here in left[there]:
                left[there].remove(here)
            chain.append(there)
            here = there
        if len(chain) > 1:
            yield chain


def _common(lines: Iterable[Sequence[Point]], functions: Sequence[Number]) -> Iterator[Point]:
    """Points of the lines at which the other functions vanish, too."""
    first, *others = functions
    found = list[Point]()
    for line in lines:
        for left, right in itertools.pairwise(line):
            a, b = first(*left), first(*right)
            if a * b > 0 or math.isnan(a * b):
                continue
            t = a / (a - b) if a != b else 0.5
            point = (left[0] + t * (right[0] - left[0]), left[1] + t * (right[1] - left[1]))
            near = all(abs(one(*point)) < 0.02 * (1 + abs(one(*left)) + abs(one(*right))) for one in others)  # fmt: skip
            if near and all(math.dist(point, one) > 0.05 for one in found):
                found.append(point)
                yield point


# Where the kinetic energy is positive.

Terms = list[tuple[float, dict[str, int]]]  # c a^i b^j ... as (c, {a: i, b: j})


def _hessian_terms(result: Mapping[str, Any], number: int) -> list[list[Terms]] | None:
    """A matrix of constants C that is definite where the Hessian in the velocities of the L of a
    leaf is; None if there is none.

    The Hessian is m D C D with D = diag(1, d_2, ...), d_i^2 = m_i/m, where each entry of C stands
    at a product of other things m_ij with m_ij^2 = m_i m_j, and m_i/m is a square or an
    exponential, so positive: (r'^2 + r^2 phi'^2) a/2 is with a alone.
    """
    leaf, letters = result["family"]["leaves"][number], {*letters_of(result)}
    shown = lagrangian_of_leaf(leaf, result)
    if not shown:
        return None
    with suppress(errors.InputError):
        names = own_names(leaf | {"lagrangian": shown}, result)
        tree = reader.read_formula(shown["text"], names)
        hessian = euler_lagrange.hessian(tree, result["system"]["coordinates"])
        parted = [[_by_constants(entry, letters) for entry in row] for row in hessian]
        if any(len(entry) > 1 for row in parted for entry in row):
            return None  # several sizes: what is positive depends on the place
        moving = [[next(iter(entry), None) for entry in row] for row in parted]
        first, *others = (moving[i][i] for i in range(len(moving)))
        if first is None or any(m is None or not _is_square(m, first) for m in others):
            return None
        for i, j in itertools.combinations(range(len(moving)), 2):
            m, one, other = moving[i][j], moving[i][i], moving[j][j]
            if m is not None and tm.times(m, m) != tm.times(one, other):  # type: ignore[arg-type]
                return None
        return [[entry.get(m, []) if m is not None else [] for entry, m in zip(*rows, strict=True)]
                for rows in zip(parted, moving, strict=True)]  # fmt: skip
    return None


def _by_constants(entry: ex.Expression, letters: set[str]) -> dict[tm.Monomial, Terms]:
    """The terms in the constants at each product of other things."""
    found = dict[tm.Monomial, Terms]()
    for monomial, value in collecting.expand(entry):
        exponents, rest = dict[str, int](), set[tuple[ex.Expression, Fraction]]()
        for base, power in monomial:
            if isinstance(base, ex.Symbol) and base.name in letters and power.denominator == 1:
                exponents[base.name] = int(power)
            else:
                rest.add((base, power))
        found.setdefault(frozenset(rest), []).append((float(value), exponents))
    return found


def _is_square(above: tm.Monomial, below: tm.Monomial) -> bool:
    """Whether the quotient is a square or an exponential, and so positive."""
    quotient = tm.times(above, below, -1)
    return all(
        ex.is_exponential(base) or (exponent.denominator == 1 and exponent % 2 == 0)
        for base, exponent in quotient
    )


def _positive(
    hessian: Sequence[Sequence[Terms]], across: str, up: str, values: Mapping[str, float]
) -> Iterator[tuple[Point, ...]]:
    """Polygons where the Hessian is definite: whole parts of rows of a grid, and parts of cells."""
    grid = np.linspace(-SPAN, SPAN, COARSE + 1)
    known: dict[str, Any] = {**values, across: grid[:, None], up: grid[None, :]}
    shape = len(grid), len(grid)
    with np.errstate(all="ignore"):
        g = np.array([
            [sum((c * math.prod((known[name] ** float(e) for name, e in exponents.items()), start=np.ones(shape))
                  for c, exponents in entry), np.zeros(shape)) for entry in row]
            for row in hessian
        ])  # fmt: skip
    g = np.moveaxis(g, (0, 1), (2, 3))
    least = np.full(shape, -1.0)
    finite = np.isfinite(g).all(axis=(2, 3))
    roots = np.linalg.eigvalsh(g[finite])
    least[finite] = np.maximum(roots[:, 0], -roots[:, -1]) - ROUND_OFF
    for j in range(COARSE):
        begun = None
        for i in range(COARSE + 1):
            corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            inside = [i < COARSE and least[corner] > 0 for corner in corners]
            if all(inside):
                begun = i if begun is None else begun
                continue
            if begun is not None:
                left, right, low, high = grid[begun], grid[i], grid[j], grid[j + 1]
                yield (left, low), (right, low), (right, high), (left, high)
                begun = None
            if any(inside):
                yield tuple(_clipped([((grid[a], grid[b]), least[a, b]) for a, b in corners]))


def _clipped(corners: Sequence[tuple[Point, float]]) -> Iterator[Point]:
    """The part of a polygon where a function, given at its corners, is positive."""
    for (here, a), (there, b) in itertools.pairwise([*corners, corners[0]]):
        if a > 0:
            yield here
        if (a > 0) != (b > 0):
            t = a / (a - b)
            yield here[0] + t * (there[0] - here[0]), here[1] + t * (there[1] - here[1])


# Members.


def member_at(result: Mapping[str, Any], values: Mapping[str, float]) -> Member | None:
    """The set to which a member belongs, the last one of which it is at most this far; None if the
    family has none.
    """
    table = table_of(result)
    if table is None:
        return None
    for conditions, member in reversed(
        list(zip(conditions_of(result), table.members, strict=True))
    ):
        if conditions is None:
            continue
        on, off = ([_distance(tree, values) <= EXACT for tree in trees] for trees in conditions)
        if all(on) and not any(off):
            return member
    return table.members[0]


def _distance(tree: ex.Expression, values: Mapping[str, float]) -> float:
    """About how far a member is from the zeros of an equation: f over its gradient."""
    table: dict[ex.Expression, Any] = {
        ex.Symbol(name): mpmath.mpf(value) for name, value in values.items()
    }
    try:
        size = abs(float(calculus.evaluate(tree, table)))
        slopes = [
            float(calculus.evaluate(calculus.differentiate(tree, ex.Symbol(name)), table))
            for name in values
        ]
    except (calculus.NoRealValue, ArithmeticError, ValueError, TypeError):
        return math.inf
    steep = math.hypot(*slopes)
    return size / steep if steep else size


def nearest_in(
    result: Mapping[str, Any], values: Mapping[str, float], wanted: Callable[[Member], bool]
) -> dict[str, float] | None:
    """The values of a member of one of these sets that is nearly the nearest to the given ones;
    None if none is found, as where a set has equations between functions.

    Newton's method for the equations of a set, each step the shortest: c - J^T (J J^T)^-1 h.
    """
    table, found = table_of(result), list[dict[str, float]]()
    for conditions, member in zip(
        conditions_of(result), table.members if table else (), strict=True
    ):
        if conditions is None or not wanted(member):
            continue
        for start in _starts(values):
            there = _projected(conditions.equations, start)
            if there is not None and member_at(result, there) == member:
                found.append(there)
                break
    here = list(values.values())
    return min(found, key=lambda one: math.dist(list(one.values()), here), default=None)


def _starts(values: Mapping[str, float]) -> Iterator[dict[str, float]]:
    """The values, and others around them."""
    yield dict(values)
    for shift, name in itertools.product((0.5, -0.5, 1.5, -1.5), values):
        yield {**values, name: values[name] + shift}
    yield {name: value + 0.3 + 0.17 * k for k, (name, value) in enumerate(values.items())}


def _projected(
    trees: Sequence[ex.Expression], start: Mapping[str, float]
) -> dict[str, float] | None:
    names, here = [*start], np.array([*start.values()])
    slopes = [[calculus.differentiate(tree, ex.Symbol(name)) for name in names] for tree in trees]
    for _ in range(MOST_STEPS):
        table = {
            ex.Symbol(name): mpmath.mpf(value) for name, value in zip(names, here, strict=True)
        }

        def numbers(row: Sequence[ex.Expression], table: Any = table) -> list[float]:
            return [float(calculus.evaluate(tree, table)) for tree in row]

        try:
            left, jacobian = np.array(numbers(trees)), np.array([numbers(row) for row in slopes])
        except (calculus.NoRealValue, ArithmeticError, ValueError, TypeError):
            return None
        step = np.linalg.pinv(jacobian.reshape(len(trees), len(names))) @ left
        here = here - step
        if not np.isfinite(here).all() or abs(here).max() > MOST_FAR:
            return None
        if np.linalg.norm(step) < CLOSE:
            rounded = [round(float(value), DIGITS) + 0.0 for value in here]  # no -0
            return dict(zip(names, rounded, strict=True))
    return None


def snapped(shown: Map, point: Point) -> Point:
    """The point, or one of a curve or a mark that is nearly there."""
    near = [
        (math.dist(point, one), one)
        for mark in shown.marks
        for one in (*mark.points, *(each for line in mark.lines for each in _between(line)))
    ]
    points = {one for mark in shown.marks for one in mark.points}
    near.sort(key=lambda pair: (pair[0] - REACH * (pair[1] in points), pair[1]))
    return near[0][1] if near and near[0][0] <= REACH else point


def _between(line: Sequence[Point]) -> Iterator[Point]:
    """Points of a line, close to each other."""
    for left, right in itertools.pairwise(line):
        for k in range(4):
            yield tuple(a + (b - a) * k / 4 for a, b in zip(left, right, strict=True))  # type: ignore[misc]


def with_numbers(
    result: Mapping[str, Any], member: Member, values: Mapping[str, float]
) -> list[Formula]:
    """The Lagrangian of a member with its constants put in, or its equations where no L is known."""
    leaf, system = result["family"]["leaves"][member.leaf], result["system"]
    known: dict[ex.Expression, ex.Expression] = {
        ex.Symbol(name): ex.number(f"{value:.4f}") for name, value in values.items()
    }

    def put_in(text: str, names: Names) -> ex.Expression:
        return _without_zeros(ex.substitute(reader.read_formula(text, names), known))

    given = lagrangian_of_leaf(leaf, result)
    if given and (_is_singular(leaf, values) or len(given["text"]) > LONGEST_CONDITION):
        given = None
    with suppress(errors.InputError, ZeroDivisionError, calculus.NoRealValue):
        if given:
            names = own_names(leaf | {"lagrangian": given}, result)
            tree = put_in(given["text"], names)
            written = {"text": printing.to_text(tree), "latex": printing.to_latex(tree)}
            return [formula_of("L", written, names)]
        names = stated.names_of(system)
        return [
            Formula(reader.equation_line(name, printing.to_text(put_in(text, names))), names)
            for name, text in system["equations"].items()
        ]
    return []


def _without_zeros(tree: ex.Expression) -> ex.Expression:
    """The tree with e^0 = 1."""
    tree = ex.rebuild(tree, _without_zeros)
    return ex.ONE if ex.is_exponential(tree) and tree.argument == ex.ZERO else tree


def _is_singular(leaf: Mapping[str, Any], values: Mapping[str, float]) -> bool:
    """Whether the L of a leaf is none for this member."""
    names = Names((), tuple(values), {})
    for text in (leaf.get("proof") or {}).get("exceptions") or ():
        with suppress(errors.InputError, ValueError):
            if _distance(_tree(text, names), values) <= EXACT:
                return True
    return False


# As SVG.


def svg_of(
    shown: Map, at: Point | None = None, colors: Literal["own", "of the page"] = "own"
) -> str:
    """The map as SVG, with a ring at a member."""
    general = shown.general
    style = f"<style>{_style()}</style>" if colors == "own" else ""
    fill = "tint" if general.verdict == YES else "hatched"
    said = f"{printed_pages.plain_text(general.where)}: {general.word}"
    parts = [
        f'<rect class="plane" x="{LEFT}" y="{TOP}" width="{SIDE}" height="{SIDE}"/>',
        f'<rect class="{fill}" x="{LEFT}" y="{TOP}" width="{SIDE}" height="{SIDE}"/>',
        *(_dotted(shown) if shown.positive else ()),
        *_axes(shown),
    ]
    held = [_at(point) for mark in shown.marks for line in mark.lines for point in line]
    held += [_at(point) for mark in shown.marks for point in mark.points]
    taken = list[tuple[float, float, float, float]]()
    everywhere = [(LEFT + SIDE * x / 8, TOP + SIDE * y / 12) for y in range(13) for x in range(9)]
    labels = list[str]()
    if place := _free(everywhere, said, taken, held):
        labels.append(_label(place, said))
    wide = sorted(shown.positive, key=lambda one: one[0][0] - one[1][0])
    dotted = [_at((one[0][0], one[3][1])) for one in wide if len(one) == 4]
    if place := _free(dotted, POSITIVE, taken, held):
        labels.append(_label(place, POSITIVE))
    for mark in shown.marks:
        kind = _kind(mark.member)
        for line in mark.lines:
            way = "L".join(f"{x:.2f} {y:.2f}" for x, y in map(_at, line))
            parts.append(f'<path class="curve {kind}" d="M{way}" data-leaf="{mark.member.leaf}"/>')
        for point in mark.points:
            x, y = _at(point)
            parts.append(
                f'<circle class="point {kind}" cx="{x:.2f}" cy="{y:.2f}" r="5.5" '
                f'data-leaf="{mark.member.leaf}"/>'
            )
        places = [_at(point) for line in mark.lines for point in line[:: max(1, len(line) // 24)]]
        places += [_at(point) for point in mark.points]
        for text in _names(mark.member) if places else ():
            if (free := _free(places, text, taken, held)) is not None:
                labels.append(_label(free, text, kind))
                break
    if at is not None:
        x, y = _at(at)
        labels.append(f'<circle class="ring" cx="{x:.1f}" cy="{y:.1f}" r="9"/>')
    title = f"Map of the members by {shown.across} and {shown.up}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" class="map">'
        f"<title>{html.escape(title)}</title>{style}{_PATTERN}{''.join([*parts, *labels])}</svg>"
    )


def keys_of(result: Mapping[str, Any], table: FamilyTable) -> list[str]:
    """What each set looks like on a map, as small SVG: an area, a line, or a point."""
    found = list[str]()
    for conditions, member in zip(conditions_of(result), table.members, strict=True):
        kind = _kind(member)
        if conditions is None:
            found.append("")
            continue
        trees = conditions.equations
        fill = "tint" if member.verdict == YES else "hatched"
        shape = f'<path class="curve {kind}" d="M1 8H27"/>'
        if not trees:
            shape = f'<rect class="{fill}" x="1" y="1" width="26" height="14"/>'
        elif len(trees) > 1:
            shape = f'<circle class="point {kind}" cx="14" cy="8" r="5.5"/>'
        found.append(
            f'<svg class="map key" viewBox="0 0 28 16" width="28" height="16" aria-hidden="true">{shape}</svg>'
        )
    return found


def _dotted(shown: Map) -> Iterator[str]:
    lines = ("L".join(f"{x:.1f} {y:.1f}" for x, y in map(_at, one)) for one in shown.positive)
    yield f'<path class="dotted" d="{"".join(f"M{line}Z" for line in lines)}"/>'


_PATTERN = (
    '<defs><pattern id="dots" width="10" height="10" patternUnits="userSpaceOnUse">'
    '<circle class="dot" cx="5" cy="5" r="1.1"/></pattern></defs>'
    '<defs><pattern id="hatch" width="9" height="9" patternUnits="userSpaceOnUse" '
    'patternTransform="rotate(45)"><path class="stroke" d="M0 0V9"/></pattern></defs>'
)


def _style() -> str:
    """Colors for a figure that is alone."""
    ink, paper, edge, yes, no = (COLORS[key] for key in ("ink", "paper", "edge", "yes", "no"))
    rules = {
        "text": f"font:13px sans-serif;fill:{ink};paint-order:stroke;stroke:{paper};stroke-width:4px",
        ".plane": f"fill:{paper};stroke:{edge}",
        ".tint": f"fill:{COLORS['tint']}",
        ".hatched": "fill:url(#hatch)",
        ".stroke": f"stroke:{edge};stroke-width:.7",
        ".dotted": "fill:url(#dots)",
        ".dot": f"fill:{edge}",
        ".axis": f"stroke:{edge};stroke-width:.6",
        ".curve": "fill:none;stroke-width:2.2",
        ".curve.yes": f"stroke:{yes}",
        ".curve.timed": f"stroke:{yes};stroke-dasharray:7 5",
        ".curve.none": f"stroke:{no};stroke-dasharray:2 4",
        "circle.yes,circle.timed": f"fill:{yes}",
        "circle.none": f"fill:{paper};stroke:{no};stroke-width:2.2",
        ".ring": f"fill:none;stroke:{ink};stroke-width:2.5",
    }
    return "".join(f"{name}{{{rule}}}" for name, rule in rules.items())


def _kind(member: Member) -> str:
    if member.verdict == NO:
        return "none"
    return "timed" if "with t" in member.word else "yes"


def _names(member: Member) -> tuple[str, str]:
    """The equations of a set with its answer, and its number with it, which is shorter."""
    where = printed_pages.plain_text(member.where)
    return f"{where}: {member.word}", f"set {member.leaf}: {member.word}"


def _at(point: Point) -> Point:
    x, y = point
    scale = SIDE / (2 * SPAN)
    x, y = (min(max(one, -SPAN), SPAN) for one in (x, y))
    return LEFT + (x + SPAN) * scale, TOP + (SPAN - y) * scale


def _axes(shown: Map) -> Iterator[str]:
    for value in range(-int(SPAN), int(SPAN) + 1):
        x, y = _at((float(value), float(value)))
        text = str(value).replace("-", "\u2212")
        if value == 0:
            yield f'<path class="axis" d="M{x:.1f} {TOP}V{TOP + SIDE}M{LEFT} {y:.1f}H{LEFT + SIDE}"/>'
        if value != int(SPAN):
            yield f'<text class="tick" x="{x:.1f}" y="{TOP + SIDE + 18}" text-anchor="middle">{text}</text>'
            if value != -int(SPAN):  # the corner has one number
                yield f'<text class="tick" x="{LEFT - 8}" y="{y + 4.5:.1f}" text-anchor="end">{text}</text>'
    yield f'<text class="name" x="{LEFT + SIDE}" y="{TOP + SIDE + 20}" text-anchor="end">{html.escape(shown.across)}</text>'
    yield f'<text class="name" x="{LEFT - 12}" y="{TOP + 12}" text-anchor="end">{html.escape(shown.up)}</text>'


def _label(place: Point, text: str, kind: str = "") -> str:
    return f'<text class="label {kind}" x="{place[0]:.1f}" y="{place[1]:.1f}">{html.escape(text)}</text>'


def _free(
    places: Sequence[Point],
    text: str,
    taken: list[tuple[float, float, float, float]],
    held: Sequence[Point],
) -> Point | None:
    """A place for a text beside one of these places, on no other text and no point that is held;
    None if there is none.
    """
    width, height = CHARACTER * len(text), LINE
    right, bottom = LEFT + SIDE, TOP + SIDE
    for x, y in places:
        for left in (x + 8, x - width - 8):
            for top in (y - height - 6, y + 6, y - height / 2):
                inside = LEFT + 2 < left < right - width - 2 and TOP + 2 < top < bottom - height - 2
                apart = all(
                    left + width < a or a + c < left or top + height < b or b + d < top
                    for a, b, c, d in taken
                )
                if (
                    inside
                    and apart
                    and not any(
                        left - 2 < a < left + width + 2 and top - 1 < b < top + height + 1
                        for a, b in held
                    )
                ):
                    taken.append((left, top, width, height))
                    return left, top + 0.75 * height
    return None
