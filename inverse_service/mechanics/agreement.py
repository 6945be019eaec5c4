"""Whether the right sides of a certificate satisfy equations as they were given, unsolved.

The given trees are evaluated, with q'' := f as the checker reads f, at random points: modulo primes where all is
rational, else to 144 digits.
Nothing of the way from the given equations to f is used: no matrix inverted, no term collected. What the
checker's reader understands too is read twice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from operator import add, mul

from mpmath import mp

from inverse_service.certificate.checker import CheckResult, Ended, Undefined
from inverse_service.certificate.places import Kind, Place, Value, tried
from inverse_service.expressions.derivative import differentiate, differentiate_in_time
from inverse_service.expressions.evaluation import NoRealValue, evaluate_once
from inverse_service.expressions.tree import (
    Acceleration,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    subtract,
    walk,
)
from inverse_service.mechanics.nonholonomic.system import NonholonomicSystem

Table = dict[Expression, Value]

# Larger arguments of functions, and logarithms of powers, are not looked at: another point is drawn.
_FARTHEST = 10_000


@dataclass(frozen=True, slots=True)
class Canonical:
    """What a certificate says of its system, as plain data, and the point that it names."""

    system: object
    near: object = None


@dataclass(frozen=True, slots=True)
class GivenText:
    """An equation as it was typed, left and right, and the texts of parameters that have values."""

    left: str
    right: str
    values: Mapping[str, str]


def equations_agree(
    equations: Sequence[Expression],
    coordinates: Sequence[str],
    canonical: Canonical,
    time_limit: float = 60.0,
    texts: Sequence[GivenText | None] = (),
) -> CheckResult:
    """Whether E_k(t, q, q', f) = 0 for all k and dE/dq'' is regular there: then f is what E = 0 determines.

    `texts`, one for each equation or none, are read by the checker's reader as well, where it accepts them: the
    two have to agree about E_k.
    """
    if len(equations) != len(coordinates):
        return CheckResult("invalid", ("The number of equations as given is not that of the coordinates.",))
    slopes = [[differentiate(equation, Acceleration(name)) for name in coordinates] for equation in equations]

    def trial(place: Place) -> str:
        table = _table(place, coordinates, place.values)
        for number, equation in enumerate(equations, 1):
            (value,), size = _row([equation], place, table)
            if not place.vanishes(value, size):
                raise Ended("invalid", f"The accelerations do not satisfy equation {number} as given.")
            second = _second_reading(texts[number - 1], place, table) if texts else None
            if second is not None and not place.vanishes(second - value, size):
                raise Ended("invalid", f"Two readers understand equation {number} as given differently.")
        if not _regular(slopes, place, table):
            raise Ended("invalid", "The equations as given do not determine the accelerations.")
        return "The accelerations satisfy the equations as given, which determine them."

    return tried(canonical.system, canonical.near, _defined(trial), _kind(equations), time_limit)


def motion_agrees(given: NonholonomicSystem, canonical: Canonical, time_limit: float = 60.0) -> CheckResult:
    """Whether f is the motion of L under the constraints w(t, q, v) = 0, where they hold.

    At points with w = 0: dw/dt = 0, and the Euler-Lagrange expressions of L are a combination of the
    rows of dw/dv; with M = d2L/dv2 the matrix (M, (dw/dv)^T; dw/dv, 0) is regular, so there is one such f.
    """
    names, count = given.coordinates, len(given.constraints)
    slopes = [[differentiate(each, Velocity(name)) for name in names] for each in given.constraints]
    momenta = [differentiate(given.lagrangian, Velocity(name)) for name in names]
    masses = [[differentiate(momentum, Velocity(name)) for name in names] for momentum in momenta]
    rates = [differentiate_in_time(each, names) for each in given.constraints]
    forces = [
        subtract(differentiate_in_time(momentum, names), differentiate(given.lagrangian, Symbol(name)))
        for momentum, name in zip(momenta, names, strict=True)
    ]

    def trial(place: Place) -> str:
        table = _table(place, names, _on_constraints(given, slopes, place))
        for rate in (*given.constraints, *rates):
            (value,), size = _row([rate], place, table)
            if not place.vanishes(value, size):
                raise Ended("invalid", "The accelerations leave the constraints as given.")
        rows = [_row(row, place, table) for row in slopes]
        if place.rank(*_columns([*rows, _row(forces, place, table)])) != place.rank(*_columns(rows)):
            raise Ended("invalid", "On the constraints these are not the accelerations of the Lagrangian as given.")
        if place.rank(*_columns(_bordered(masses, rows, place, table))) != len(names) + count:
            raise Ended("invalid", "The Lagrangian and the constraints as given do not determine the motion.")
        return "On the constraints the accelerations are the motion of the Lagrangian as given, which determines it."

    formulas = (given.lagrangian, *given.constraints)
    return tried(canonical.system, canonical.near, _defined(trial), _kind(formulas), time_limit)


_Row = tuple[list[Value], Value]  # values, and the size that rounding is measured against


def _columns(rows: Sequence[_Row]) -> tuple[list[list[Value]], list[Value]]:
    return [values for values, _ in rows], [size for _, size in rows]


def _bordered(masses: list[list[Expression]], rows: list[_Row], place: Place, table: Table) -> list[_Row]:
    """(M, W^T; W, 0)."""
    zero = place.number(Fraction(0))
    above = [_row(row, place, table) for row in masses]
    columns = [[values[k] for values, _ in rows] for k in range(len(above))]
    largest = max((size for _, size in rows), default=0)
    top = [(values + column, max(size, largest)) for (values, size), column in zip(above, columns, strict=True)]
    return top + [(values + [zero] * len(rows), size) for values, size in rows]


def _on_constraints(given: NonholonomicSystem, slopes: list[list[Expression]], place: Place) -> dict[str, Value]:
    """The point with some velocities moved to where the constraints hold."""
    values = place.values
    table = _leaves(given.coordinates, values)
    rows = [_row(row, place, table)[0] + _row([each], place, table)[0] for row, each in
            zip(slopes, given.constraints, strict=True)]  # fmt: skip
    for k, step in _solution(rows).items():
        values[f"{given.coordinates[k]}'"] -= step
    return values


def _solution(rows: list[list[Value]]) -> dict[int, Value]:
    """One solution of the linear equations (coefficients, right side), the other unknowns being 0."""
    pivots: list[int] = []
    for number, row in enumerate(rows):
        pivot = max(range(len(row) - 1), key=lambda k: abs(row[k]))
        if not abs(row[pivot]):
            raise Undefined
        rows[number] = row = [entry / row[pivot] for entry in row]
        for other, line in enumerate(rows):
            if other != number:
                rows[other] = [a - line[pivot] * b for a, b in zip(line, row, strict=True)]
        pivots.append(pivot)
    return {pivot: row[-1] for pivot, row in zip(pivots, rows, strict=True)}


def _second_reading(text: GivenText | None, place: Place, table: Table) -> Value | None:
    """left - right by the checker's reader; None where one of the texts is not in its grammar."""
    if text is None:
        return None
    given = {f"{node.coordinate}''": value for node, value in table.items() if isinstance(node, Acceleration)}
    for name, written in text.values.items():
        value = place.read(written, {})
        if value is None:
            return None
        given[name] = value
    left, right = (place.read(side, given) for side in (text.left, text.right))
    return None if left is None or right is None else left - right


def _kind(formulas: Iterable[Expression]) -> Kind:
    """Whether they are rational in everything, and whether they have roots or other powers with a branch."""
    nodes = [node for formula in formulas for node in walk(formula)]
    whole = [isinstance(node.exponent, Number) and node.exponent.value.denominator == 1
             for node in nodes if isinstance(node, Power)]  # fmt: skip
    return Kind(all(whole) and not any(isinstance(node, Apply) for node in nodes), not all(whole))


def _defined(trial: Callable[[Place], str]) -> Callable[[Place], str]:
    """The trial; where a given formula has no real value, another point is wanted."""

    def tried_there(place: Place) -> str:
        try:
            return trial(place)
        except NoRealValue:
            raise Undefined from None

    return tried_there


def _leaves(coordinates: Iterable[str], values: dict[str, Value]) -> Table:
    velocities = {f"{name}'": name for name in coordinates}
    return {Velocity(velocities[name]) if name in velocities else Symbol(name): value for name, value in values.items()}


def _table(place: Place, coordinates: Sequence[str], values: dict[str, Value]) -> Table:
    """Values of all leaves, q'' := f."""
    accelerations = place.accelerations({name: values[name] for name in values if name.endswith("'")})
    solved = {Acceleration(name): f for name, f in zip(coordinates, accelerations, strict=True)}
    return _leaves(coordinates, values) | solved


def _row(trees: Sequence[Expression], place: Place, table: Table) -> _Row:
    for tree in trees:
        for node in reversed(list(walk(tree))):  # parts before what they are parts of
            if node not in table:
                if not place.exact:
                    _refuse_far_values(node, table)
                _evaluate(node, place, table)
    return [table[tree] for tree in trees], 0 if place.exact else max(_size(tree, table) for tree in trees)


def _evaluate(node: Expression, place: Place, table: Table) -> None:
    match node:
        case Arbitrary(name, arguments, orders):
            table[node] = place.function(name, orders, [table[argument] for argument in arguments])
        case Number(value):
            table[node] = place.number(value)
        case Sum(terms):
            table[node] = reduce(add, [table[term] for term in terms])
        case Product(factors):
            table[node] = reduce(mul, [table[factor] for factor in factors])
        case Power(base, Number(value)) if value.denominator == 1 and place.exact:
            table[node] = table[base] ** value.numerator
        case _:
            evaluate_once(node, table)


def _refuse_far_values(node: Expression, table: Table) -> None:
    """NoRealValue where a function or a power would be far from 1: exp(exp(exp(9))) takes all memory there is."""
    match node:
        case Apply(_, argument) if abs(table[argument]) > _FARTHEST:
            raise NoRealValue("an argument is too large to be compared")
        case Power(base, exponent) if table[base] and abs(table[exponent] * mp.log(abs(table[base]))) > _FARTHEST:
            raise NoRealValue("a power is too large to be compared")


def _size(tree: Expression, table: Table) -> Value:
    """A bound for the terms that are added up in a tree."""
    match tree:
        case Sum(terms):
            return mp.fsum([_size(term, table) for term in terms])
        case Product(factors):
            return mp.fprod([_size(factor, table) for factor in factors])
        case Power(base, Number(value)) if value.denominator == 1 and value > 0:
            return _size(base, table) ** value.numerator
        case _:
            return abs(evaluate_once(tree, table))


def _regular(matrix: list[list[Expression]], place: Place, table: Table) -> bool:
    return place.rank(*_columns([_row(row, place, table) for row in matrix])) == len(matrix)
