"""What the names of a running program stand for, and how these are added, multiplied, and
differentiated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

from inverse_service.expressions import calculus, collecting, tree as ex
from inverse_service.reading.scripts import nodes as nd

# An expression, a list, or one of the classes below.
Value = Any
TREES = (
    ex.Number, ex.Symbol, ex.Velocity, ex.Acceleration, ex.Sum, ex.Product, ex.Power, ex.Apply,
    ex.Arbitrary,
)  # fmt: skip
_MOST_ROWS = 6  # of a matrix that is inverted
_MOST_ZEROS = 64  # of an array of zeros
STEP = ex.Symbol("dt")  # the step of time of a program that moves its state by itself


@dataclass(frozen=True, slots=True)
class Matrix:
    """A matrix of SymPy, MATLAB, or Maple; a column for a vector."""

    rows: tuple[tuple[Value, ...], ...]

    @property
    def entries(self) -> list[Value]:
        return [entry for row in self.rows for entry in row]

    def transposed(self) -> Matrix:
        return Matrix(tuple(zip(*self.rows, strict=True)))

    def is_vector(self) -> bool:
        return len(self.rows) == 1 or all(len(row) == 1 for row in self.rows)

    def each(self, change: Callable[[Value], Value]) -> Matrix:
        return Matrix(tuple(tuple(map(change, row)) for row in self.rows))


@dataclass(frozen=True, slots=True)
class Struct:
    """What MATLAB makes of par.w = 2: values by their names."""

    parts: dict[str, Value]


class Plain(list[Value]):
    """A list of Python or JavaScript, which + joins to others; an array is a list of this module."""


def as_array(value: Value) -> Value:
    return [as_array(one) for one in value] if isinstance(value, list) else value


@dataclass(frozen=True, slots=True)
class Equation:
    left: ex.Expression
    right: ex.Expression

    @property
    def difference(self) -> ex.Expression:
        return self.left - self.right


@dataclass(frozen=True, slots=True)
class Rule:
    """old -> new."""

    old: Value
    new: Value


@dataclass(frozen=True, slots=True)
class Moving:
    """A function of the time without its argument; x[1] of Mathematica may be its value at 1."""

    name: str
    may_be_initial: bool = False


@dataclass(frozen=True, slots=True)
class Derived:
    """A derivative of a function without its argument."""

    of: Value
    order: int


@dataclass(frozen=True, slots=True)
class Formula:
    """A function by its value at some names: unapply(x^2, x) of Maple."""

    value: Value
    names: tuple[ex.Symbol, ...]


@dataclass(frozen=True, slots=True)
class Operator:
    """Differential(t) of Julia, and its powers."""

    by: Value
    times: int = 1


@dataclass(slots=True)
class Closure:
    """A function of the program, with the names around it."""

    function: nd.Function
    names: dict[str, Value]


@dataclass(slots=True)
class Array:
    """An argument of a function of rates: a state, an array of parameters, or one number.

    `entries` are the symbols of those places that the function uses.
    """

    name: str
    first: int = 0  # the place of the first entry, which is called name_1
    entries: dict[int, ex.Symbol] = field(default_factory=dict)
    named: dict[int, str] = field(default_factory=dict)
    is_number: bool = False  # it is used without a place

    def entry(self, place: int) -> ex.Symbol:
        return self.entries.setdefault(place, ex.Symbol(f"{self.name}_{place + 1 - self.first}"))


@dataclass(slots=True)
class Filled:
    """An array that a program fills entry by entry; one of zeros with its rows and columns has 0
    where it is not filled.
    """

    entries: dict[int, Value] = field(default_factory=dict)
    zeros: tuple[int, int] | None = None
    first: int = 0  # the place of the first entry

    def in_order(self) -> list[Value]:
        return [self.entry(place) for place in self.places()]

    def places(self) -> list[int]:
        return sorted({*self.entries} | {*self._of_zeros()})

    def entry(self, place: int) -> Value | None:
        return self.entries.get(place, ex.ZERO if place in self._of_zeros() else None)

    def _of_zeros(self) -> range:
        rows, columns = self.zeros or (0, 0)
        known = 1 in (rows, columns) and rows * columns <= _MOST_ZEROS
        return range(self.first, self.first + (rows * columns if known else 0))

    def as_matrix(self) -> Matrix | None:
        """The matrix of zeros(2), where nothing is filled."""
        if self.zeros is None or self.entries:
            return None
        rows, columns = self.zeros
        if not 0 < rows * columns <= _MOST_ZEROS:
            return None
        return Matrix(((ex.ZERO,) * columns,) * rows)


def listed(value: Value) -> list[Value] | None:
    """The entries of a list, a vector, or a filled array."""
    if isinstance(value, list):
        return value
    if isinstance(value, Matrix):
        return value.entries
    return value.in_order() if isinstance(value, Filled) else None


def scalar(value: Value) -> ex.Expression:
    """The expression of one number; NotRead for anything else."""
    if isinstance(value, TREES):
        return value
    if isinstance(value, Matrix) and len(value.entries) == 1:
        return scalar(value.entries[0])
    if isinstance(value, Array):
        value.is_number = True
        return ex.TIME if value.name == "t" else ex.Symbol(value.name)
    if isinstance(value, Moving) and value.may_be_initial:
        raise nd.Initial(f"{value.name} at one time")
    raise nd.NotRead("a number is expected")


def added(left: Value, right: Value, sign: int = 1) -> Value:
    """left + right, entry by entry for vectors."""
    if isinstance(left, Plain) and isinstance(right, Plain) and sign == 1:
        return Plain([*left, *right])
    if isinstance(left, Plain) or isinstance(right, Plain):
        left, right = _as_operands(left, right)
    if isinstance(left, Matrix) and isinstance(right, Matrix):
        if [*map(len, left.rows)] != [*map(len, right.rows)]:
            raise nd.NotRead("a sum of matrices of two sizes")
        pairs = zip(left.rows, right.rows, strict=True)
        return Matrix(
            tuple(tuple(added(a, b, sign) for a, b in zip(*rows, strict=True)) for rows in pairs)
        )
    left, right = _with_entries(left, right)
    one, other = listed(left), listed(right)
    if one is not None and other is not None:
        if len(one) != len(other):
            raise nd.NotRead("a sum of lists of two lengths")
        found = [added(a, b, sign) for a, b in zip(one, other, strict=True)]
        return column(found) if isinstance(left, Matrix) or isinstance(right, Matrix) else found
    if one is not None or other is not None:
        return _spread(left, right, lambda a, b: added(a, b, sign))
    return scalar(left) + scalar(right) * ex.number(sign)


def _with_entries(left: Value, right: Value) -> tuple[Value, Value]:
    """Two operands, an array of unknown length beside a list as that many entries."""
    for one, other in ((left, right), (right, left)):
        entries = listed(other)
        if isinstance(one, Array) and entries is not None:
            found: Value = [one.entry(one.first + k) for k in range(len(entries))]
            if isinstance(other, Matrix):
                found = column(found)
            return (found, right) if one is left else (left, found)
    return left, right


def _as_operands(left: Value, right: Value) -> tuple[Value, Value]:
    """Two operands of which one is an array, so that the list beside it is one, too."""
    arrays = [one for one in (left, right) if isinstance(one, list) and not isinstance(one, Plain)]
    if not arrays:
        raise nd.Trap("arithmetic with a list that is no array")
    return as_array(left), as_array(right)


def multiplied(left: Value, right: Value) -> Value:
    """left * right: the product of two matrices, and entry by entry for lists."""
    if isinstance(left, Plain) or isinstance(right, Plain):
        left, right = _as_operands(left, right)
    if isinstance(left, Matrix) and isinstance(right, Array):  # A*x
        places = range(right.first, right.first + len(left.rows[0]))
        return multiplied(left, column(right.entry(place) for place in places))
    if isinstance(left, Matrix) and isinstance(right, list) and not left.is_vector():
        return multiplied(left, column(right)).entries  # a vector of Julia
    if isinstance(left, Matrix) and isinstance(right, Matrix):
        if 1 in (len(left.entries), len(right.entries)):
            return _spread_one(left, right)
        if len(left.rows[0]) != len(right.rows):
            raise nd.NotRead("a product of matrices whose sizes do not fit")
        columns = [list(entries) for entries in zip(*right.rows, strict=True)]
        found = [[dot(row, entries) for entries in columns] for row in left.rows]
        return found[0][0] if len(found) == len(columns) == 1 else Matrix(tuple(map(tuple, found)))
    left, right = _with_entries(left, right)
    one, other = listed(left), listed(right)
    if one is not None and other is not None:
        if len(one) != len(other):
            raise nd.NotRead("a product of lists of two lengths")
        return [multiplied(a, b) for a, b in zip(one, other, strict=True)]
    if one is not None or other is not None:
        return _spread(left, right, multiplied)
    return scalar(left) * scalar(right)


def _spread_one(left: Matrix, right: Matrix) -> Value:
    whole, one = (right, left) if len(left.entries) == 1 else (left, right)
    return whole.each(lambda entry: multiplied(entry, one.entries[0]))


def _spread(left: Value, right: Value, rule: Callable[[Value, Value], Value]) -> Value:
    """A rule for each entry of one side and the number on the other side."""
    if isinstance(left, Matrix):
        return left.each(lambda entry: rule(entry, right))
    if isinstance(right, Matrix):
        return right.each(lambda entry: rule(left, entry))
    if (entries := listed(left)) is not None:
        return [rule(entry, right) for entry in entries]
    return [rule(left, entry) for entry in listed(right) or []]


def dot(left: Value, right: Value) -> Value:
    """The scalar product of two vectors, or a matrix times a vector."""
    left, right = _with_entries(left, right)
    if isinstance(left, Matrix) and not left.is_vector() and isinstance(right, list):
        return multiplied(left, right)
    one, other = _entries(left), _entries(right)
    if other and all(isinstance(row, list) for row in other):  # the columns of an array of NumPy
        columns = [[*entries] for entries in zip(*other, strict=True)]
        if one and all(isinstance(row, list) for row in one):
            return [[dot(row, entries) for entries in columns] for row in one]
        return [dot(one, entries) for entries in columns]
    if one and isinstance(one[0], list):
        return [dot(row, other) for row in one]
    if len(one) != len(other) or not one:
        raise nd.NotRead("a scalar product of lists of two lengths")
    return reduce(added, (multiplied(a, b) for a, b in zip(one, other, strict=True)))


def solved(matrix: Value, right: Value) -> Value:
    """x of M x = b, also for a matrix b: M \\ b of MATLAB."""
    if not isinstance(matrix, Matrix):
        if isinstance(matrix, Array | ex.Symbol) and not isinstance(right, TREES):
            raise nd.Trap("the inverse of a letter that may be a matrix")
        return multiplied(ex.power(scalar(matrix), ex.MINUS_ONE), right)
    inverse = inverted(matrix)
    if isinstance(right, Array | Matrix):
        return multiplied(inverse, right)
    entries = _entries(right)
    found = multiplied(inverse, column(entries))
    return listed(found) if len(entries) > 1 else found


def inverted(matrix: Matrix) -> Matrix:
    """The inverse by cofactors, which few entries that are not 0 keep short."""
    size = len(matrix.rows)
    if size > _MOST_ROWS or any(len(row) != size for row in matrix.rows):
        raise nd.NotRead("the inverse of this matrix")
    rows = tuple(tuple(map(scalar, row)) for row in matrix.rows)
    whole = collecting.collect(_determinant(rows))
    if whole == ex.ZERO:
        raise nd.NotRead("the inverse of a matrix that has none")
    cofactors = [
        [
            _determinant(_without(rows, k, j)) * ex.number((-1) ** (k + j)) / whole
            for k in range(size)
        ]
        for j in range(size)
    ]
    return Matrix(tuple(map(tuple, cofactors)))


def _determinant(rows: tuple[tuple[ex.Expression, ...], ...]) -> ex.Expression:
    if not rows:
        return ex.ONE
    found: ex.Expression = ex.ZERO
    for j, entry in enumerate(rows[0]):
        if entry != ex.ZERO:
            found = found + entry * _determinant(_without(rows, 0, j)) * ex.number((-1) ** j)
    return found


def _without(
    rows: tuple[tuple[ex.Expression, ...], ...], row: int, place: int
) -> tuple[tuple[ex.Expression, ...], ...]:
    return tuple(
        tuple(entry for j, entry in enumerate(one) if j != place)
        for k, one in enumerate(rows)
        if k != row
    )


def _entries(value: Value) -> list[Value]:
    if isinstance(value, tuple):
        return [*value]
    found = listed(value)
    if found is None:
        raise nd.NotRead("a vector is expected")
    return found


def column(entries: Iterable[Value]) -> Matrix:
    return Matrix(tuple((entry,) for entry in entries))


def each(value: Value, change: Callable[[ex.Expression], Value]) -> Value:
    """A change of each expression inside a value."""
    if isinstance(value, Matrix):
        return value.each(lambda entry: each(entry, change))
    if isinstance(value, Equation):
        return Equation(change(value.left), change(value.right))
    if isinstance(value, Rule):
        return Rule(value.old, each(value.new, change))
    entries = listed(value)
    return change(scalar(value)) if entries is None else [each(one, change) for one in entries]


def equations_in(value: Value) -> Iterator[Equation]:
    """The equations of a value, the expressions as equations with 0 on the right side."""
    if isinstance(value, Equation):
        yield value
    elif isinstance(value, TREES):
        yield Equation(value, ex.ZERO)
    else:
        for one in listed(value) or []:
            yield from equations_in(one)


def partial(tree: ex.Expression, variable: ex.Expression) -> ex.Expression:
    try:
        return calculus.differentiate(tree, variable)
    except ValueError:
        raise nd.NotRead("a derivative by something that is no name") from None


def cut(tree: ex.Expression, order: int) -> ex.Expression:
    """A value up to a power of the step; NotRead where it has no limit as the step goes to 0."""
    if not ex.holds(tree, STEP):
        return tree
    if _divides_by_step(tree):
        tree = collecting.collect(tree)
        if _divides_by_step(tree):
            raise nd.NotRead("a value that has no limit as the step goes to 0")
    found: ex.Expression = ex.ZERO
    factor: ex.Expression = ex.ONE
    slope = tree
    for power in range(order + 1):
        if power:
            factor = factor * STEP / ex.number(power)
            slope = partial(slope, STEP)
        found = found + ex.substitute(slope, {STEP: ex.ZERO}) * factor
    return found


def _divides_by_step(tree: ex.Expression) -> bool:
    """Whether a power that is no positive number has a base that is 0 without the step."""
    return any(
        isinstance(node, ex.Power)
        and not (isinstance(node.exponent, ex.Number) and node.exponent.value > 0)
        and ex.holds(node.base, STEP)
        and collecting.collect(ex.substitute(node.base, {STEP: ex.ZERO})) == ex.ZERO
        for node in ex.walk(tree)
    )
