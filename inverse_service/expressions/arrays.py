"""Evaluate trees in floating point, at one point or at many at once: a name is a number or an array
of numbers.
"""

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from mpmath import MPContext, fp
from mpmath.libmp import NoConvergence
from numpy.typing import NDArray

from inverse_service import errors
from inverse_service.expressions import functions, tree as ex

Array = NDArray[np.float64]
# The functions of `fp` are wrong where their terms cancel: fp.bessely(0, 0.5) is -1.4 for -0.44.
_EXACT = MPContext()


class NoValue(errors.InputError):
    """A formula contains a name without a value."""

    code = "no-value"


def array_value(expression: ex.Expression, table: Mapping[ex.Expression, Any]) -> Array:
    """The formula at every row of the table, as (m,); nan or infinite where it has no real value.

    Raises NoValue for a name or an arbitrary function that the table does not hold.
    """
    return array_values([expression], table)[0]


def array_values(
    expressions: Sequence[ex.Expression], table: Mapping[ex.Expression, Any]
) -> list[Array]:
    """The values of several formulas; common subexpressions are computed once."""
    sizes = [np.shape(value) for value in table.values() if np.ndim(value)]
    known = dict(table)
    with np.errstate(all="ignore"):
        found = [np.asarray(_value(one, known), dtype=float) for one in expressions]
    return [np.broadcast_to(one, sizes[0] if sizes else (1,)) for one in found]


def function_of(
    expressions: Sequence[ex.Expression], variables: Sequence[ex.Expression]
) -> Callable[[Sequence[float]], list[float]]:
    """The values of several formulas as one function of the variables, for many points one after
    another: the formulas are read once, and common subexpressions are computed once.

    The function raises ArithmeticError or ValueError where a formula has no real value. Raises
    NoValue for a name or an arbitrary function that is no variable.
    """
    program = _Program({variable: place for place, variable in enumerate(variables)})
    places = [program.place(one) for one in expressions]
    numbers, steps = tuple(program.numbers), tuple(program.in_order(len(variables)))
    moved = [program.moved(place, len(variables)) for place in places]

    def values(point: Sequence[float]) -> list[float]:
        known = [*point, *numbers]
        for operation, one, other in steps:
            known.append(operation(known[one], known[other]))
        return [known[place] for place in moved]

    return values


def special_values(function: str, *arguments: Any) -> Array:
    """A special function of (its order and) its argument in double precision, by mpmath; nan where
    it has no real value.
    """
    row = functions.FUNCTION[function]
    operation = getattr(fp if row.library else _EXACT, row.mpmath or function)

    def value(*inner: float) -> float:
        if not (row.library or all(map(math.isfinite, inner))):
            return math.nan
        try:
            found = operation(*inner)
        except (ValueError, ZeroDivisionError, OverflowError, NoConvergence):
            return math.nan
        return float(found) if isinstance(found, float | _EXACT.mpf) else math.nan

    return np.asarray(np.vectorize(value, otypes=[float])(*arguments))


def _value(expression: ex.Expression, known: dict[ex.Expression, Any]) -> Any:
    if expression in known:
        return known[expression]
    found: Any
    match expression:
        case ex.Number(value):
            found = float(value)
        case ex.Sum(terms):
            found = sum(_value(term, known) for term in terms)
        case ex.Product(factors):
            found = math.prod(_value(factor, known) for factor in factors)
        case ex.Power(base, ex.Number(value)) if value.denominator == 1 and abs(value) <= 8:
            found = np.asarray(_value(base, known), dtype=float) ** abs(int(value))
            found = found if value >= 0 else 1 / found
        case ex.Power(base, ex.Number(value)) if abs(value) == Fraction(1, 2):
            found = np.sqrt(_value(base, known))
            found = found if value > 0 else 1 / found
        case ex.Power(base, exponent):
            found = np.power(np.asarray(_value(base, known), dtype=float), _value(exponent, known))
        case ex.Apply(function) if function in functions.SPECIAL:
            inner = functions.arguments_of(expression)[::-1]  # the order first
            found = special_values(function, *(_value(part, known) for part in inner))
        case ex.Apply(function, argument):
            below, inner = functions.RECIPROCALS.get(function), _value(argument, known)
            found = (
                np.heaviside(inner, np.nan)
                if function == functions.STEP
                else getattr(np, below or function)(inner)
            )
            found = 1 / found if below else found
        case _ if expression == ex.PI:
            found = np.pi
        case _:
            raise NoValue(
                f"a formula has no value here: {getattr(expression, 'name', 'a name')} is not given."
            )
    known[expression] = found
    return found


_Operation = Callable[[float, float], float]


class _Program:
    """Formulas as a list of operations on two earlier values each.

    Places of variables come first. A number has the place -1 - k of `numbers[k]`, an operation the
    place of the variables and operations before it.
    """

    def __init__(self, known: dict[ex.Expression, int]) -> None:
        self.known, self.numbers = known, list[float]()
        self.steps, self.first = list[tuple[_Operation, int, int]](), len(known)

    def number(self, value: float) -> int:
        self.numbers.append(value)
        return -len(self.numbers)

    def step(self, operation: _Operation, one: int, other: int) -> int:
        self.steps.append((operation, one, other))
        return self.first + len(self.steps) - 1

    def moved(self, place: int, count: int) -> int:
        """The place in the list of the variables, the numbers, and the results, in this order."""
        if place < 0:
            return count - 1 - place
        return place if place < count else place + len(self.numbers)

    def in_order(self, count: int) -> list[tuple[_Operation, int, int]]:
        return [
            (f, self.moved(one, count), self.moved(other, count)) for f, one, other in self.steps
        ]

    def place(self, tree: ex.Expression) -> int:
        if tree not in self.known:
            self.known[tree] = self.added(tree)
        return self.known[tree]

    def joined(self, operation: _Operation, trees: Sequence[ex.Expression]) -> int:
        first, *others = map(self.place, trees)
        for other in others:
            first = self.step(operation, first, other)
        return first

    def added(self, tree: ex.Expression) -> int:
        """The place of a formula that is not known yet."""
        match tree:
            case ex.Number(value):
                return self.number(float(value))
            case ex.Sum(terms):
                return self.joined(operator.add, terms)
            case ex.Product(factors):
                return self.joined(operator.mul, factors)
            case ex.Power(base, ex.Number(value)) if abs(value) == Fraction(1, 2):
                root = self.alone(math.sqrt, self.place(base))
                return root if value > 0 else self.inverted(root)
            case ex.Power(base, exponent):
                return self.step(math.pow, self.place(base), self.place(exponent))
            case ex.Apply(function) if function in functions.SPECIAL:
                inner = [self.place(part) for part in functions.arguments_of(tree)]
                return self.special(function, *inner)
            case ex.Apply(function, argument):
                below = functions.RECIPROCALS.get(function)
                place = self.alone(_operation(below or function), self.place(argument))
                return self.inverted(place) if below else place
            case _ if tree == ex.PI:
                return self.number(math.pi)
        raise NoValue(
            f"a formula has no value here: {getattr(tree, 'name', 'a name')} is not given."
        )

    def inverted(self, place: int) -> int:
        return self.step(operator.truediv, self.number(1.0), place)

    def alone(self, operation: Callable[[float], float], place: int) -> int:
        return self.step(lambda value, _: operation(value), place, place)

    def special(self, function: str, place: int, order: int | None = None) -> int:
        if order is None:
            return self.alone(lambda value: float(special_values(function, value)), place)
        return self.step(
            lambda first, value: float(special_values(function, first, value)), order, place
        )


def _operation(function: str) -> Callable[[float], float]:
    """A function of one number; ValueError or a value that is not finite where it is not defined."""
    if function == functions.STEP:
        return lambda value: float(np.heaviside(value, np.nan))
    found = getattr(math, function, None)
    return found or (lambda value: float(getattr(np, function)(value)))
