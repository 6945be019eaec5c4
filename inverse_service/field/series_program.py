"""Trees in kernels as a program for the machine of `series_kernels.py`, written once and run at any point.

The instructions depend on the trees and the displacements alone (and serve for all orders up to the one that
arbitrary functions are expanded to); what depends on the point are the constants: values of numbers, variables
and atoms, roots, partial derivatives of arbitrary functions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from inverse_service.expressions.tree import (
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    factors_of,
)
from inverse_service.field import modular
from inverse_service.field import series_kernels as machine
from inverse_service.field.monomials import SeriesTables, coefficients, products, series_tables
from inverse_service.field.point import Point, Variable, evaluate, number_value, power_value
from inverse_service.field.truncated_series import SingularPoint
from inverse_service.kernels.machine_code.kernels import Kept

Integers = npt.NDArray[np.int64]
Words = npt.NDArray[np.uint64]
# The value of a constant at a point; the table keeps what was evaluated there.
Recipe = Callable[[Point, dict[Expression, int]], int]
_ONE = 0
# Larger programs than this are slower than sparse polynomials, or need too much memory.
_MOST_WORDS, _MOST_PRODUCTS = 16_000_000, 3_000_000


class TooLarge(Exception):
    """The series would take too many words."""


@dataclass(slots=True)
class SeriesProgram:
    """Instructions and constants, for orders up to `order`; registers are numbered as they come, constant 0 is 1.

    TooLarge where the tables would hold more than `most_products` numbers, or the registers more than `most_words`.
    """

    variables: Sequence[Variable]
    order: int
    most_products: int = _MOST_PRODUCTS
    most_words: int = _MOST_WORDS
    registers: int = 0
    instructions: list[tuple[int, int, int, int, int, int]] = field(default_factory=list)
    recipes: list[Recipe] = field(default_factory=lambda: [lambda point, known: 1])
    known: dict[Hashable, int] = field(default_factory=dict)
    numbers: dict[tuple[int, int], int] = field(default_factory=lambda: {(1, 1): _ONE})
    places: dict[Variable, int] = field(init=False)

    def __post_init__(self) -> None:
        self.places = {variable: place for place, variable in enumerate(self.variables)}
        if products(len(self.variables), self.order) > self.most_products:
            raise TooLarge

    def register(self, count: int = 1) -> int:
        """The first of so many new registers, whose series are 0."""
        self.registers += count
        if self.registers * coefficients(len(self.variables), self.order) > self.most_words:
            raise TooLarge
        return self.registers - count

    def constant(self, recipe: Recipe) -> int:
        """The place of a new constant."""
        self.recipes.append(recipe)
        return len(self.recipes) - 1

    def number(self, value: Fraction) -> int:
        """The place of a number."""
        key = (value.numerator, value.denominator)
        if key not in self.numbers:
            self.numbers[key] = self.constant(lambda point, known: number_value(value, point.prime))
        return self.numbers[key]

    def write(self, operation: int, out: int, a: int = 0, b: int = 0, c: int = _ONE) -> int:
        """Append an instruction; its register `out`."""
        self.instructions.append((operation, out, a, b, c, 0))
        return out

    def expand(self, tree: Expression) -> int:
        """The register of the series of a tree; equal trees are expanded once."""
        found = self.known.get(tree)
        if found is None:
            found = self.known[tree] = self._expand(tree)
        return found

    def _expand(self, tree: Expression) -> int:
        match tree:
            case Number(value):
                return self.write(machine.CONSTANT, self.register(), c=self.number(value))
            case Symbol() | Velocity():
                return self._variable(tree)
            case Sum(terms):
                return self._sum(terms)
            case Product(factors):
                factor, rest = _split(factors)
                return self.write(machine.ADD, self.register(), self._product(rest), c=self.number(factor))
            case Power(base, Number(exponent)):
                return self._power(base, exponent)
            case Apply():
                return self._apply(tree)
            case Arbitrary():
                return self._arbitrary(tree)
        raise TypeError(f"{type(tree).__name__} is not a kernel")

    def _variable(self, name: Variable) -> int:
        value = self.constant(lambda point, known: point.variable(name))
        out = self.write(machine.CONSTANT, self.register(), c=value)
        if name in self.places:
            self.write(machine.VARIABLE, out, self.places[name])
        return out

    def _sum(self, terms: Sequence[Expression]) -> int:
        out = self.register()
        for term in terms:
            factor, rest = _split(factors_of(term))
            if rest:
                self.write(machine.ADD, out, self._product(rest), c=self.number(factor))
            else:
                self.write(machine.CONSTANT, out, c=self.number(factor))
        return out

    def _product(self, factors: tuple[Expression, ...]) -> int:
        """The product of trees that are no numbers."""
        if len(factors) == 1:
            return self.expand(factors[0])
        if not factors:
            return self.expand(Number(Fraction(1)))
        found = self.known.get(factors)
        if found is None:
            pair = self._product(factors[:-1]), self.expand(factors[-1])
            found = self.known[factors] = self.write(machine.PRODUCT, self.register(), *pair)
        return found

    def _power(self, base: Expression, exponent: Fraction) -> int:
        inner = self.expand(base)
        if exponent.denominator == 1:
            return self._integer_power(base, inner, exponent.numerator)
        residue = self.constant(lambda point, known: number_value(exponent, point.prime))
        self.constant(lambda point, known: power_value(evaluate(base, point, known), exponent, point.prime))
        return self.write(machine.POWER, self.register(), inner, c=residue)

    def _integer_power(self, base: Expression, inner: int, exponent: int) -> int:
        if exponent == 1:
            return inner
        key = ("power", base, exponent)
        if key not in self.known:
            self.known[key] = self._new_power(base, inner, exponent)
        return self.known[key]

    def _new_power(self, base: Expression, inner: int, exponent: int) -> int:
        if exponent == 0:
            return self.write(machine.CONSTANT, self.register())
        if exponent == -1:
            return self.write(machine.INVERSE, self.register(), inner)
        if exponent < 0:
            inverse = self._integer_power(base, inner, -1)
            return self._integer_power(Power(base, Number(Fraction(-1))), inverse, -exponent)
        half = self._integer_power(base, inner, exponent // 2)
        rest = self._integer_power(base, inner, exponent - exponent // 2)
        return self.write(machine.PRODUCT, self.register(), half, rest)

    def _apply(self, tree: Apply) -> int:
        inner = self.expand(tree.argument)
        start = self.constant(lambda point, known: point.atom(tree))
        if tree.function == "exp":
            return self.write(machine.EXPONENTIAL, self.register(), inner, c=start)
        if tree.function == "log":
            return self.write(machine.PRIMITIVE, self.register(), inner, inner, start)
        if tree.function == "atan":
            slope = self.write(machine.CONSTANT, self.register())
            self.write(machine.PRODUCT, slope, inner, inner)
            return self.write(machine.PRIMITIVE, self.register(), inner, slope, start)
        return self._sine_cosine(tree, inner)

    def _sine_cosine(self, tree: Apply, inner: int) -> int:
        pair = Apply("sin", tree.argument), Apply("cos", tree.argument)
        first = self.constant(lambda point, known: point.atoms[pair[0]])
        self.constant(lambda point, known: point.atoms[pair[1]])
        sine, cosine = self.register(), self.register()
        self.write(machine.TRIGONOMETRIC, sine, inner, cosine, first)
        self.known.update(zip(pair, (sine, cosine), strict=True))
        return sine if tree.function == "sin" else cosine

    def _arbitrary(self, tree: Arbitrary) -> int:
        """The Taylor series of the function about the place of its arguments."""
        moved = []
        for argument in tree.arguments:
            out = self.write(machine.ADD, self.register(), self.expand(argument))
            moved.append(self.write(machine.WITHOUT_CONSTANT, out))
        return self._taylor(tree, moved, ())

    def _taylor(self, tree: Arbitrary, moved: Sequence[int], orders: tuple[int, ...]) -> int:
        """sum over the orders that follow these of their Taylor terms, without the powers for these."""
        out = self.register()
        if len(orders) == len(moved):
            return self.write(machine.CONSTANT, out, c=self.constant(_taylor_coefficient(tree, orders)))
        step, power = moved[len(orders)], None
        for k in range(self.order - sum(orders) + 1):
            inner = self._taylor(tree, moved, (*orders, k))
            if k > 1:
                power = self.write(machine.PRODUCT, self.register(), step if power is None else power, step)
            if k == 0:
                self.write(machine.ADD, out, inner)
            else:
                self.write(machine.PRODUCT, out, inner, step if power is None else power)
        return out


def _split(factors: tuple[Expression, ...]) -> tuple[Fraction, tuple[Expression, ...]]:
    """The product of the numbers among the factors, and the others."""
    value = math.prod((f.value for f in factors if isinstance(f, Number)), start=Fraction(1))
    return value, tuple(f for f in factors if not isinstance(f, Number))


def _taylor_coefficient(tree: Arbitrary, more: tuple[int, ...]) -> Recipe:
    """A partial derivative of the function, over the factorials."""
    orders = tuple(a + b for a, b in zip(tree.orders, more, strict=True))
    factorials = math.prod(math.factorial(k) for k in more)

    def value(point: Point, known: dict[Expression, int]) -> int:
        place = tuple(evaluate(argument, point, known) for argument in tree.arguments)
        return point.jet(tree.name, place, orders) * pow(factorials, -1, point.prime) % point.prime

    return value


@dataclass(frozen=True, slots=True)
class Registers:
    """All registers after a run: values, and the degree up to which each is not zero."""

    prime: int
    tables: SeriesTables
    values: Words
    tops: Integers

    def numbers(self, register: int) -> list[int]:
        """All coefficients of one register, as integers."""
        stride, inverse = len(self.values) // len(self.tops), pow(1 << 64, -1, self.prime)
        kept = self.values[register * stride : register * stride + int(self.tops[register]) + 1]
        return [int(value) * inverse % self.prime for value in kept] + [0] * (stride - len(kept))

    def value(self, register: int) -> int:
        """The constant term of one register."""
        stride = len(self.values) // len(self.tops)
        known = int(self.values[register * stride]) if self.tops[register] >= 0 else 0
        return known * pow(1 << 64, -1, self.prime) % self.prime

    @property
    def stored(self) -> machine.Registers:
        """As the kernels have them."""
        return machine.Registers(self.values, self.tops, len(self.values) // len(self.tops))

    def coefficients(self, registers: Integers, last: int) -> Kept[machine.SparseSeries]:
        """The coefficients of some registers that are not zero, to degree `last`."""
        starts, room = np.zeros(len(registers) + 1, np.int64), len(registers) * int(self.tables.starts[last + 1])
        places, degrees = np.empty((2, room), np.int64)
        found = Kept(machine.SparseSeries(starts, places, np.empty(room, np.uint64), degrees))
        machine.list_coefficients(registers, self.stored, self.tables.starts, last, found.struct)
        return found


def constants_at(program: SeriesProgram, point: Point) -> Words:
    """The constants at the point; SingularPoint for a division by zero, ValueError for a missing root."""
    known: dict[Expression, int] = {}
    return np.array([_montgomery(recipe(point, known), point.prime) for recipe in program.recipes], np.uint64)


def run(
    program: SeriesProgram,
    instructions: Integers,
    constants: Words,
    prime: int,
    order: int,
    given: Sequence[Sequence[int]] = (),
) -> Registers:
    """All registers, their series to this order; SingularPoint where a denominator vanishes.

    The coefficients of the first registers may be `given`, where no instruction writes them.
    """
    tables, stride = series_tables(len(program.variables), order), coefficients(len(program.variables), order)
    values, tops = np.empty(program.registers * stride, np.uint64), np.full(program.registers, -1, np.int64)
    for place, known in enumerate(given):
        values[place * stride : (place + 1) * stride] = [_montgomery(value, prime) for value in known[:stride]]
        tops[place] = order
    return _run(Registers(prime, tables, values, tops), instructions, constants)


def run_again(
    before: Registers, kept: int, count: int, instructions: Integers, numbers: Sequence[int], order: int
) -> Registers:
    """Further instructions, with integers for constants, on the first `kept` registers of a run, to a lower order."""
    tables, stride = series_tables(before.tables.size, order), coefficients(before.tables.size, order)
    values, tops = np.empty(count * stride, np.uint64), np.full(count, -1, np.int64)
    given = before.values.reshape(len(before.tops), -1)
    values[: kept * stride].reshape(kept, stride)[:] = given[:kept, :stride]
    tops[:kept] = np.minimum(before.tops[:kept], order)
    constants = np.array([_montgomery(number % before.prime, before.prime) for number in numbers], np.uint64)
    return _run(Registers(before.prime, tables, values, tops), instructions, constants)


def _run(registers: Registers, instructions: Integers, constants: Words) -> Registers:
    prime, order = registers.prime, registers.tables.order
    small, inverses = modular.small_numbers(prime, order + 2), _inverses(prime, order + 1)
    given = machine.Machine(registers.stored, registers.tables, modular.field_of(prime), small, inverses)
    if machine.run(instructions, constants, given) >= 0:
        raise SingularPoint("division by a series that vanishes at the point")
    return registers


def _montgomery(value: int, prime: int) -> int:
    return (value << 64) % prime


@lru_cache(maxsize=64)
def _inverses(prime: int, count: int) -> Words:
    """0, and 1/1, 1/2, …, in Montgomery form."""
    numbers = np.array([0, *(_montgomery(pow(k, -1, prime), prime) for k in range(1, count))], np.uint64)
    numbers.setflags(write=False)
    return numbers
