"""Truncated power series modulo a prime as arrays of words, and trees as programs for a small
compiled machine.

Monomials in m displacements are 64-bit keys, sums of exponents being sums of keys. A series of
order D in m displacements is one array of C(m + D, D) words, its homogeneous components one after
the other, monomials of one degree as in `exponents_of_degree`.

A register of the machine holds one series (`SeriesTables`) in Montgomery form; tops[register] is
the highest degree of a nonzero coefficient (-1 for the series 0), and only coefficients up to it
are read. An instruction is six numbers: operation, out, a, b, c, cut, with registers out, a, b and
the place c of a constant. Functions follow from the Euler operator E y = (0 y_0, 1 y_1, 2 y_2, …):
for y = exp(u), E y = y E u reads k y_k = sum_j j u_j y_(k-j); powers, logarithms and trigonometric
functions alike (Knuth, TAOCP 2, 4.7).

A `SeriesProgram` is written once and run at any point. The instructions depend only on the trees
and the displacements (and serve for all orders up to the order to which arbitrary functions are
expanded). Only the constants depend on the point: values of numbers, variables, and atoms, roots,
and partial derivatives of arbitrary functions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from inverse_service.expressions import tree as ex
from inverse_service.field import modular
from inverse_service.field.exact_field import TooLarge
from inverse_service.field.modular import Field, compiled, minus, montgomery_power, multiply, plus
from inverse_service.kernels.machine_code.argument_kinds import Kept

Integers = npt.NDArray[np.int64]
Places = npt.NDArray[np.int32]
_NONE = np.empty(0, np.int32)

Words = npt.NDArray[np.uint64]

CONSTANT = 0  # out := out + c
VARIABLE = 1  # out := out + displacement number a
ADD = 2  # out := out + c a, to the order less `cut`
PRODUCT = 3  # out := out + c a b, to the order less `cut`
DERIVATIVE = 4  # out := the partial derivative of a by displacement number b
WITHOUT_CONSTANT = 5  # out := out less its constant term
INVERSE = 6  # out := 1/a
POWER = 7  # out := a^c with the constant term c + 1
EXPONENTIAL = 8  # out := exp a with the constant term c
TRIGONOMETRIC = 9  # out, b := sin a, cos a with the constant terms c, c + 1
PRIMITIVE = 10  # out := y with b E y = E a (log a for b = a) and the constant term c
WIDTH = 6
# The value of a constant at a point; the table caches values at that point.
Recipe = Callable[[modular.Point, dict[ex.Expression, int]], int]
_ONE = 0
# Limits on the words of registers and of product tables; positive answers about motions require
# orders up to 12.
_MOST_WORDS, _MOST_PRODUCTS = 40_000_000, 16_000_000


@dataclass(frozen=True, slots=True)
class MonomialKeys:
    """Keys for exponents in `size` variables, each of floor(63/size) bits."""

    size: int

    @property
    def bits(self) -> int:
        return 63 // self.size

    def key(self, exponents: Sequence[int]) -> int:
        return sum(int(e) << (self.bits * k) for k, e in enumerate(exponents))


@lru_cache(maxsize=2048)
def exponents_of_degree(size: int, degree: int) -> npt.NDArray[np.int8]:
    """All exponent vectors of one total degree in ascending order, (count, size)."""
    if size == 1:
        table = np.array([[degree]], np.int8)
    else:
        parts = [exponents_of_degree(size - 1, degree - first) for first in range(degree + 1)]
        firsts = np.repeat(np.arange(degree + 1, dtype=np.int8), [len(part) for part in parts])
        table = np.column_stack([firsts, np.concatenate(parts)])
    table.setflags(write=False)
    return table


@lru_cache(maxsize=128)
def raised_places(size: int, degree: int) -> npt.NDArray[np.int64]:
    """The place of alpha + e_a among the exponents of degree + 1, (count, size)."""
    table, above = exponents_of_degree(size, degree), exponents_of_degree(size, degree + 1)
    monomials = MonomialKeys(size)
    known = keys_of(monomials, above)
    order = np.argsort(known)
    raised = keys_of(monomials, table)[:, None] + np.array(
        [1 << (monomials.bits * a) for a in range(size)]
    )
    places: npt.NDArray[np.int64] = order[np.searchsorted(known, raised, sorter=order)]
    places.setflags(write=False)
    return places


def keys_of(monomials: MonomialKeys, exponents: npt.NDArray[np.int8]) -> npt.NDArray[np.int64]:
    """The keys of rows of exponents."""
    shifts = np.array([1 << (monomials.bits * k) for k in range(monomials.size)], np.int64)
    return exponents.astype(np.int64) @ shifts


def places_among(
    size: int, known: npt.NDArray[np.int8], keys_wanted: npt.NDArray[np.int64]
) -> npt.NDArray[np.int64]:
    """The places of monomials with these keys among the known ones, which include them all."""
    keys = keys_of(MonomialKeys(size), known)
    order = np.argsort(keys)
    found: npt.NDArray[np.int64] = order[np.searchsorted(keys, keys_wanted, sorter=order)]
    return found


@lru_cache(maxsize=256)
def products_of_degree(size: int, low: int, high: int) -> npt.NDArray[np.int32]:
    """The place of m m' among the monomials of degree low + high, (monomials m of `high`, those m'
    of `low`).
    """
    if high == 0:
        places = np.arange(math.comb(size - 1 + low, low), dtype=np.int32)[None]
    else:  # m = x_a n, so the place of m m' is that of x_a times (n m')
        before, variable = _divided(size, high)
        above = raised_places(size, low + high - 1).ravel()
        places = products_of_degree(size, low, high - 1)[before] * np.int64(size)
        places = above[places + variable[:, None]].astype(np.int32)
    places.setflags(write=False)
    return places


def _divided(size: int, degree: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """For each monomial of a degree above 0, the place of x_a^-1 times it, and a."""
    raised = raised_places(size, degree - 1)
    before, variable = np.empty((2, math.comb(size - 1 + degree, degree)), np.int64)
    before[raised], variable[raised] = np.indices(raised.shape)
    return before, variable


def coefficients(size: int, order: int) -> int:
    """C(size + order, order), the number of coefficients of one series."""
    return math.comb(size + order, order)


def products(size: int, order: int) -> int:
    """C(2 size + order, order), the number of pairs of coefficients whose product is not cut
    off.
    """
    return math.comb(2 * size + order, order)


class SeriesTables(NamedTuple):
    """Tables for `size` displacements to degree `order`.

    Degree d has counts[d] monomials from starts[d] on; the last of `starts` is the number of all.
    The place, within degree j + l, of the product of monomial i of degree j and monomial k of
    degree l is products[product_starts[j (order + 1) + l] + i counts[l] + k]. For monomial i of
    degree d < order, raised[raised_starts[d] + i size + a] is the place of x_a times it, and
    `exponents` at the same index its exponent of x_a.
    """

    size: int
    order: int
    counts: Integers
    starts: Integers
    product_starts: Integers
    products: Places
    raised_starts: Integers
    raised: Integers
    exponents: Integers


@lru_cache(maxsize=64)
def series_tables(size: int, order: int) -> SeriesTables:
    """The tables, cached; for large sizes they contain about `products(size, order)` numbers."""
    degrees = range(order + 1)
    counts = np.array([len(exponents_of_degree(size, d)) for d in degrees], np.int64)
    pairs = [
        products_of_degree(size, k, j).ravel() if j + k <= order else _NONE
        for j in degrees
        for k in degrees
    ]
    raised = [raised_places(size, d).ravel() for d in range(order)]
    exponents = [exponents_of_degree(size, d).ravel().astype(np.int64) + 1 for d in range(order)]
    nothing = np.empty(0, np.int64)
    found = SeriesTables(
        size, order, counts, _ends(counts), _ends([len(part) for part in pairs]), np.concatenate(pairs),
        _ends([len(part) for part in raised]), np.concatenate([nothing, *raised]),
        np.concatenate([nothing, *exponents]),
    )  # fmt: skip
    freeze(found)
    return found


def freeze(tables: Iterable[Any]) -> None:
    """Make the arrays among these read-only, because all callers share them."""
    for table in tables:
        if isinstance(table, np.ndarray):
            table.setflags(write=False)


def _ends(lengths: list[int] | Integers) -> Integers:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)


class Storage(NamedTuple):
    """The series of all registers end to end, `stride` words each, and their `tops`."""

    values: Words
    tops: Integers
    stride: int


class Machine(NamedTuple):
    """The data shared by all instructions: registers, places of products and derivatives, and the
    prime.

    `small` holds 0, 1, 2, …, `inverses` 0 and their inverses, in Montgomery form: exponents and
    degrees as factors.
    """

    registers: Storage
    tables: SeriesTables
    field: Field
    small: Words
    inverses: Words


class SparseSeries(NamedTuple):
    """Nonzero coefficients: those of series s are at starts[s] to starts[s + 1], by ascending
    degree.

    `places` are the places of the monomials among all monomials of their degree.
    """

    starts: Integers
    places: Integers
    values: Words
    degrees: Integers


@compiled
def _extend(m: Machine, out: int, top: int) -> None:
    """Fill `out` with zeros up to degree `top`."""
    values, tops, stride = m.registers
    if top > tops[out]:
        for k in range(
            out * stride + m.tables.starts[tops[out] + 1], out * stride + m.tables.starts[top + 1]
        ):
            values[k] = np.uint64(0)
        tops[out] = top


@compiled
def _start(m: Machine, out: int, constant: np.uint64) -> None:
    """out := constant."""
    m.registers.tops[out] = 0
    m.registers.values[out * m.registers.stride] = constant


@compiled
def _convolve(
    m: Machine, out: int, left: int, j: int, right: int, k: int, weight: np.uint64
) -> None:
    """out_(j + k) += weight left_j right_k, for the homogeneous components of these degrees."""
    values, _, stride = m.registers
    counts, starts = m.tables.counts, m.tables.starts
    base, first, second = (
        out * stride + starts[j + k],
        left * stride + starts[j],
        right * stride + starts[k],
    )
    for i in range(counts[j]):
        if values[first + i] == np.uint64(0):
            continue
        a = multiply(values[first + i], weight, m.field)
        row = m.tables.product_starts[j * (m.tables.order + 1) + k] + i * counts[k]
        for n in range(counts[k]):
            b = values[second + n]
            if b != np.uint64(0):
                place = base + m.tables.products[row + n]
                values[place] = plus(values[place], multiply(a, b, m.field), m.field)


@compiled
def _scale(m: Machine, out: int, degree: int, factor: np.uint64) -> None:
    """out_degree := factor out_degree."""
    values, _, stride = m.registers
    for k in range(
        out * stride + m.tables.starts[degree], out * stride + m.tables.starts[degree + 1]
    ):
        if values[k] != np.uint64(0):
            values[k] = multiply(values[k], factor, m.field)


@compiled
def _add(m: Machine, out: int, a: int, factor: np.uint64, first: int, last: int) -> None:
    """out += factor a in the degrees first … last."""
    values, tops, stride = m.registers
    last = min(last, tops[a])
    _extend(m, out, last)
    for k in range(m.tables.starts[first], m.tables.starts[last + 1]):
        value = values[a * stride + k]
        if value != np.uint64(0):
            place = out * stride + k
            values[place] = plus(values[place], multiply(value, factor, m.field), m.field)


@compiled
def _multiply(m: Machine, out: int, a: int, b: int, factor: np.uint64, limit: int) -> None:
    """out += factor a b to degree `limit`; out is neither a nor b."""
    tops = m.registers.tops
    if tops[a] < 0 or tops[b] < 0:
        return
    if tops[a] > tops[b]:
        a, b = b, a
    top = min(limit, tops[a] + tops[b])
    _extend(m, out, top)
    for j in range(min(tops[a], top) + 1):
        for k in range(min(tops[b], top - j) + 1):
            _convolve(m, out, a, j, b, k, factor)


@compiled
def _differentiate(m: Machine, out: int, a: int, index: int) -> None:
    """out := the partial derivative of a by displacement number `index`."""
    values, tops, stride = m.registers
    tables, highest = m.tables, -1
    for degree in range(tops[a]):
        for i in range(tables.counts[degree]):
            above = tables.raised_starts[degree] + i * tables.size + index
            value = values[a * stride + tables.starts[degree + 1] + tables.raised[above]]
            if value != np.uint64(0):
                value = multiply(value, m.small[tables.exponents[above]], m.field)
                highest = degree
            values[out * stride + tables.starts[degree] + i] = value
    tops[out] = highest


@compiled
def _last_degree(m: Machine, a: int) -> int:
    """The degree up to which a function of a is computed: 0 for a constant."""
    return m.tables.order if m.registers.tops[a] > 0 else 0


@compiled
def _power(m: Machine, out: int, a: int, exponent: np.uint64, inverse: np.uint64) -> None:
    """a_0 k y_k = sum_j (exponent j - (k - j)) a_j y_(k-j), given the constant term; `inverse` is
    1/a_0.
    """
    for k in range(1, _last_degree(m, a) + 1):
        _extend(m, out, k)
        for j in range(1, min(k, m.registers.tops[a]) + 1):
            weight = minus(multiply(exponent, m.small[j], m.field), m.small[k - j], m.field)
            _convolve(m, out, a, j, out, k - j, weight)
        _scale(m, out, k, multiply(inverse, m.inverses[k], m.field))


@compiled
def _exponential(m: Machine, out: int, a: int) -> None:
    """k y_k = sum_j j a_j y_(k-j), given the constant term."""
    for k in range(1, _last_degree(m, a) + 1):
        _extend(m, out, k)
        for j in range(1, min(k, m.registers.tops[a]) + 1):
            _convolve(m, out, a, j, out, k - j, m.small[j])
        _scale(m, out, k, m.inverses[k])


@compiled
def _sine_cosine(m: Machine, sine: int, cosine: int, a: int) -> None:
    """k s_k = sum_j j a_j c_(k-j), k c_k = -sum_j j a_j s_(k-j), given the constant terms."""
    for k in range(1, _last_degree(m, a) + 1):
        _extend(m, sine, k)
        _extend(m, cosine, k)
        for j in range(1, min(k, m.registers.tops[a]) + 1):
            _convolve(m, sine, a, j, cosine, k - j, m.small[j])
            _convolve(m, cosine, a, j, sine, k - j, m.field.prime - m.small[j])
        _scale(m, sine, k, m.inverses[k])
        _scale(m, cosine, k, m.inverses[k])


@compiled
def _primitive(m: Machine, out: int, a: int, b: int, inverse: np.uint64) -> None:
    """k b_0 y_k = k a_k - sum_(0<j<k) (k - j) b_j y_(k-j), given the constant term; `inverse` is
    1/b_0.
    """
    for k in range(1, _last_degree(m, a) + 1):
        _extend(m, out, k)
        for j in range(1, min(k - 1, m.registers.tops[b]) + 1):
            _convolve(m, out, b, j, out, k - j, m.field.prime - m.small[k - j])
        _add(m, out, a, m.small[k], k, k)
        _scale(m, out, k, multiply(inverse, m.inverses[k], m.field))


@compiled
def _divide(
    m: Machine, operation: int, out: int, a: int, b: int, first: np.uint64, second: np.uint64
) -> bool:
    """Carry out an operation that divides by a constant term, given its constants; False if the
    divisor is 0.
    """
    values, tops, stride = m.registers
    divisor = b if operation == PRIMITIVE else a
    if tops[divisor] < 0 or values[divisor * stride] == np.uint64(0):
        return False
    inverse = montgomery_power(values[divisor * stride], m.field.prime - np.uint64(2), m.field)
    if operation == INVERSE:
        _start(m, out, inverse)
        _power(m, out, a, m.field.prime - m.field.one, inverse)
    elif operation == POWER:
        _start(m, out, second)
        _power(m, out, a, first, inverse)
    else:
        _start(m, out, first)
        _primitive(m, out, a, b, inverse)
    return True


@compiled
def carry_out(instructions: Integers, constants: Words, m: Machine) -> int:
    """Carry out all instructions; return the first index that divides by a series without constant
    term, or -1.
    """
    values, _, stride = m.registers
    for number in range(len(instructions) // WIDTH):
        at = WIDTH * number
        operation, out, a, b = (
            instructions[at],
            instructions[at + 1],
            instructions[at + 2],
            instructions[at + 3],
        )
        c, limit = instructions[at + 4], m.tables.order - instructions[at + 5]
        if operation == CONSTANT:
            _extend(m, out, 0)
            values[out * stride] = plus(values[out * stride], constants[c], m.field)
        elif operation == VARIABLE:
            if limit > 0:  # to order 0 no register has room for a displacement
                _extend(m, out, 1)
                values[out * stride + 1 + m.tables.counts[1] - 1 - a] = m.field.one
        elif operation == ADD:
            _add(m, out, a, constants[c], 0, limit)
        elif operation == PRODUCT:
            _multiply(m, out, a, b, constants[c], limit)
        elif operation == DERIVATIVE:
            _differentiate(m, out, a, b)
        elif operation == WITHOUT_CONSTANT:
            _extend(m, out, 0)
            values[out * stride] = np.uint64(0)
        elif operation == EXPONENTIAL:
            _start(m, out, constants[c])
            _exponential(m, out, a)
        elif operation == TRIGONOMETRIC:
            _start(m, out, constants[c])
            _start(m, b, constants[c + 1])
            _sine_cosine(m, out, b, a)
        elif not _divide(
            m, operation, out, a, b, constants[c], constants[min(c + 1, len(constants) - 1)]
        ):
            return number
    return -1


@compiled
def list_coefficients(
    chosen: Integers, registers: Storage, starts: Integers, last: int, found: SparseSeries
) -> None:
    """List the nonzero coefficients of the chosen registers up to degree `last`."""
    values, tops, stride = registers
    count = 0
    for number in range(len(chosen)):
        r = chosen[number]
        for degree in range(min(last, tops[r]) + 1):
            for k in range(starts[degree], starts[degree + 1]):
                value = values[r * stride + k]
                if value != np.uint64(0):
                    found.places[count], found.values[count] = k - starts[degree], value
                    found.degrees[count] = degree
                    count += 1
        found.starts[number + 1] = count


@dataclass(slots=True)
class SeriesProgram:
    """Instructions and constants for orders up to `order`; registers are numbered in order of
    creation, constant 0 is 1.

    TooLarge if the tables or the registers would take too much memory.
    """

    variables: Sequence[modular.Variable]
    order: int
    registers: int = 0
    instructions: list[tuple[int, int, int, int, int, int]] = field(default_factory=list)
    recipes: list[Recipe] = field(default_factory=lambda: [lambda point, known: 1])
    known: dict[Hashable, int] = field(default_factory=dict)
    numbers: dict[tuple[int, int], int] = field(default_factory=lambda: {(1, 1): _ONE})
    places: dict[modular.Variable, int] = field(init=False)
    kept: tuple[int, Integers] | None = None  # the instructions so far, in one array

    def __post_init__(self) -> None:
        self.places = {variable: place for place, variable in enumerate(self.variables)}
        if products(len(self.variables), self.order) > _MOST_PRODUCTS:
            raise TooLarge("its series would take too many words")

    @property
    def listed(self) -> Integers:
        """The instructions in one array for a run, made once for all points."""
        if self.kept is None or self.kept[0] != len(self.instructions):
            flat = np.fromiter(chain.from_iterable(self.instructions), np.int64)
            self.kept = len(self.instructions), flat
        return self.kept[1]

    def register(self, count: int = 1) -> int:
        """The first of `count` new registers, whose series are 0."""
        self.registers += count
        if self.registers * coefficients(len(self.variables), self.order) > _MOST_WORDS:
            raise TooLarge("its series would take too many words")
        return self.registers - count

    def constant(self, recipe: Recipe) -> int:
        """The place of a new constant."""
        self.recipes.append(recipe)
        return len(self.recipes) - 1

    def number(self, value: int | Fraction) -> int:
        """The place of a constant number."""
        key = (value.numerator, value.denominator)
        if key not in self.numbers:
            self.numbers[key] = self.constant(
                lambda point, known: modular.number_value(Fraction(value), point.prime)
            )
        return self.numbers[key]

    def write(
        self, operation: int, out: int, a: int = 0, b: int = 0, c: int = _ONE, lost: int = 0
    ) -> int:
        """Append an instruction; return its register `out`, known to `lost` orders less than the
        program's.
        """
        self.instructions.append((operation, out, a, b, c, lost))
        return out

    def expand(self, tree: ex.Expression) -> int:
        """The register of the series of a tree; equal trees are expanded once."""
        found = self.known.get(tree)
        if found is None:
            found = self.known[tree] = self._expand(tree)
        return found

    def _expand(self, tree: ex.Expression) -> int:
        match tree:
            case ex.Number(value):
                return self.write(CONSTANT, self.register(), c=self.number(value))
            case ex.Symbol() | ex.Velocity():
                return self._variable(tree)
            case ex.Sum(terms):
                return self._sum(terms)
            case ex.Product(factors):
                factor, rest = _split(factors)
                return self.write(ADD, self.register(), self._product(rest), c=self.number(factor))
            case ex.Power(base, ex.Number(exponent)):
                return self._power(base, exponent)
            case ex.Apply():
                return self._apply(tree)
            case ex.Arbitrary():
                return self._arbitrary(tree)
        raise TypeError(f"{type(tree).__name__} is not a kernel")

    def _variable(self, name: modular.Variable) -> int:
        value = self.constant(lambda point, known: point.variable(name))
        out = self.write(CONSTANT, self.register(), c=value)
        if name in self.places:
            self.write(VARIABLE, out, self.places[name])
        return out

    def _sum(self, terms: Sequence[ex.Expression]) -> int:
        out = self.register()
        for term in terms:
            factor, rest = _split(ex.factors_of(term))
            if rest:
                self.write(ADD, out, self._product(rest), c=self.number(factor))
            else:
                self.write(CONSTANT, out, c=self.number(factor))
        return out

    def _product(self, factors: tuple[ex.Expression, ...]) -> int:
        """The product of trees other than numbers."""
        if len(factors) == 1:
            return self.expand(factors[0])
        if not factors:
            return self.expand(ex.Number(Fraction(1)))
        found = self.known.get(factors)
        if found is None:
            pair = self._product(factors[:-1]), self.expand(factors[-1])
            found = self.known[factors] = self.write(PRODUCT, self.register(), *pair)
        return found

    def _power(self, base: ex.Expression, exponent: Fraction) -> int:
        inner = self.expand(base)
        if exponent.denominator == 1:
            return self._integer_power(base, inner, exponent.numerator)
        residue = self.constant(lambda point, known: modular.number_value(exponent, point.prime))
        self.constant(
            lambda point, known: modular.power_value(
                modular.evaluate(base, point, known), exponent, point.prime
            )
        )
        return self.write(POWER, self.register(), inner, c=residue)

    def _integer_power(self, base: ex.Expression, inner: int, exponent: int) -> int:
        if exponent == 1:
            return inner
        key = ("power", base, exponent)
        if key not in self.known:
            self.known[key] = self._new_power(base, inner, exponent)
        return self.known[key]

    def _new_power(self, base: ex.Expression, inner: int, exponent: int) -> int:
        if exponent == 0:
            return self.write(CONSTANT, self.register())
        if exponent == -1:
            return self.write(INVERSE, self.register(), inner)
        if exponent < 0:
            inverse = self._integer_power(base, inner, -1)
            return self._integer_power(ex.Power(base, ex.Number(Fraction(-1))), inverse, -exponent)
        half = self._integer_power(base, inner, exponent // 2)
        rest = self._integer_power(base, inner, exponent - exponent // 2)
        return self.write(PRODUCT, self.register(), half, rest)

    def _apply(self, tree: ex.Apply) -> int:
        inner = self.expand(tree.argument)
        start = self.constant(lambda point, known: point.atom(tree))
        if tree.function == "exp":
            return self.write(EXPONENTIAL, self.register(), inner, c=start)
        if tree.function == "log":
            return self.write(PRIMITIVE, self.register(), inner, inner, start)
        if tree.function == "atan":
            slope = self.write(CONSTANT, self.register())
            self.write(PRODUCT, slope, inner, inner)
            return self.write(PRIMITIVE, self.register(), inner, slope, start)
        return self._sine_cosine(tree, inner)

    def _sine_cosine(self, tree: ex.Apply, inner: int) -> int:
        pair = ex.Apply("sin", tree.argument), ex.Apply("cos", tree.argument)
        first = self.constant(lambda point, known: point.atoms[pair[0]])
        self.constant(lambda point, known: point.atoms[pair[1]])
        sine, cosine = self.register(), self.register()
        self.write(TRIGONOMETRIC, sine, inner, cosine, first)
        self.known.update(zip(pair, (sine, cosine), strict=True))
        return sine if tree.function == "sin" else cosine

    def _arbitrary(self, tree: ex.Arbitrary) -> int:
        """The Taylor series of the function about the values of its arguments."""
        moved = []
        for argument in tree.arguments:
            out = self.write(ADD, self.register(), self.expand(argument))
            moved.append(self.write(WITHOUT_CONSTANT, out))
        return self._taylor(tree, moved, ())

    def _taylor(self, tree: ex.Arbitrary, moved: Sequence[int], orders: tuple[int, ...]) -> int:
        """sum over the orders that follow these of their Taylor terms, without the powers for
        these.
        """
        out = self.register()
        if len(orders) == len(moved):
            return self.write(CONSTANT, out, c=self.constant(_taylor_coefficient(tree, orders)))
        step, power = moved[len(orders)], None
        for k in range(self.order - sum(orders) + 1):
            inner = self._taylor(tree, moved, (*orders, k))
            if k > 1:
                power = self.write(PRODUCT, self.register(), step if power is None else power, step)
            if k == 0:
                self.write(ADD, out, inner)
            else:
                self.write(PRODUCT, out, inner, step if power is None else power)
        return out


def _split(factors: tuple[ex.Expression, ...]) -> tuple[Fraction, tuple[ex.Expression, ...]]:
    """The product of the numbers among the factors, and the others."""
    value = math.prod((f.value for f in factors if isinstance(f, ex.Number)), start=Fraction(1))
    return value, tuple(f for f in factors if not isinstance(f, ex.Number))


def _taylor_coefficient(tree: ex.Arbitrary, more: tuple[int, ...]) -> Recipe:
    """A partial derivative of the function divided by the factorials."""
    orders = tuple(a + b for a, b in zip(tree.orders, more, strict=True))
    factorials = math.prod(math.factorial(k) for k in more)

    raised = ex.Arbitrary(tree.name, tree.arguments, orders)

    def value(point: modular.Point, known: dict[ex.Expression, int]) -> int:
        slope = modular.evaluate(raised, point, known)
        return slope * pow(factorials, -1, point.prime) % point.prime

    return value


@dataclass(slots=True)
class Series:
    """A sum of products of registers, each times a number: a scalar of `mechanics.conditions`,
    written when it is used.

    The `lost` highest degrees of the program are invalid: each derivative loses one more.
    """

    program: SeriesProgram
    terms: tuple[tuple[int | Fraction, int, int | None], ...] = ()
    lost: int = 0
    place: int | None = None  # its register, once it is written

    @property
    def is_zero(self) -> bool:
        """Whether it is 0 at all points by construction."""
        return not self.terms

    def __add__(self, other: Series) -> Series:
        return Series(self.program, self.terms + other.terms, max(self.lost, other.lost))

    def __sub__(self, other: Series) -> Series:
        terms = tuple((-weight, a, b) for weight, a, b in other.terms)
        return Series(self.program, self.terms + terms, max(self.lost, other.lost))

    def __mul__(self, other: Series) -> Series:
        (factor, a), (times, b) = self.multiple(), other.multiple()
        return Series(self.program, ((factor * times, a, b),), max(self.lost, other.lost))

    def scaled(self, factor: int | Fraction) -> Series:
        terms = tuple(
            (factor if weight == 1 else factor * weight, a, b) for weight, a, b in self.terms
        )
        return Series(self.program, terms, self.lost)

    def derivative(self, place: int) -> Series:
        """By a displacement."""
        factor, a = self.multiple()
        key = ("derivative", a, place)
        if key not in self.program.known:
            self.program.known[key] = self.program.write(
                DERIVATIVE, self.program.register(), a, place
            )
        return Series(self.program, ((factor, self.program.known[key], None),), self.lost + 1)

    def multiple(self) -> tuple[int | Fraction, int]:
        """(number, register) whose product is the series."""
        if len(self.terms) == 1 and self.terms[0][2] is None:
            return self.terms[0][:2]
        return 1, self.register

    @property
    def register(self) -> int:
        """The register of the sum, which is written only once."""
        if self.place is None:
            factor, a, b = self.terms[0] if len(self.terms) == 1 else (0, 0, 0)
            self.place = a if factor == 1 and b is None else self._written()
        return self.place

    def _written(self) -> int:
        out = self.program.register()
        for factor, a, b in self.terms:
            operation, right = (ADD, 0) if b is None else (PRODUCT, b)
            self.program.write(operation, out, a, right, self.program.number(factor), self.lost)
        return out


def series_of(program: SeriesProgram, tree: ex.Expression) -> Series:
    """The Taylor series of a tree."""
    return Series(program, ((1, program.expand(tree), None),))


def derivative_along(components: Iterable[tuple[int, Series]], series: Series) -> Series:
    """sum_a X^a d_a y for the components (a, X^a) of a field; the derivatives are not cached."""
    if series.is_zero:
        return series
    program, (factor, y) = series.program, series.multiple()
    parts = [(place, part.lost, *part.multiple()) for place, part in components if not part.is_zero]
    lost, out = max([series.lost + 1, *(lost for _, lost, _, _ in parts)]), program.register()
    if "spare" not in program.known:
        program.known["spare"] = program.register()
    spare = program.known["spare"]
    for place, _, times, x in parts:
        program.write(DERIVATIVE, spare, y, place)
        program.write(PRODUCT, out, x, spare, program.number(factor * times), lost)
    return Series(program, ((1, out, None),), lost)


@dataclass(frozen=True, slots=True)
class Registers:
    """All registers after a run: their values, and the highest nonzero degree of each."""

    prime: int
    tables: SeriesTables
    values: Words
    tops: Integers

    def numbers(self, register: int) -> list[int]:
        """All coefficients of one register, as integers."""
        stride, prime = len(self.values) // len(self.tops), self.prime
        inverse = _inverse_of_radix(prime)
        kept = self.values[register * stride :][: self.tables.starts[self.tops[register] + 1]]
        found = [value * inverse % prime for value in kept.tolist()]
        return found + [0] * (stride - len(found))

    def value(self, register: int) -> int:
        """The constant term of one register."""
        stride = len(self.values) // len(self.tops)
        known = int(self.values[register * stride]) if self.tops[register] >= 0 else 0
        return known * _inverse_of_radix(self.prime) % self.prime

    @property
    def stored(self) -> Storage:
        """The registers in the form that the kernels use."""
        return Storage(self.values, self.tops, len(self.values) // len(self.tops))

    def coefficients(self, registers: Integers, last: int) -> Kept[SparseSeries]:
        """The nonzero coefficients of some registers up to degree `last`."""
        starts, room = (
            np.zeros(len(registers) + 1, np.int64),
            len(registers) * int(self.tables.starts[last + 1]),
        )
        places, degrees = np.empty((2, room), np.int64)
        found = Kept(SparseSeries(starts, places, np.empty(room, np.uint64), degrees))
        list_coefficients(registers, self.stored, self.tables.starts, last, found.struct)
        return found


def constants_at(program: SeriesProgram, point: modular.Point) -> Words:
    """The constants at the point; SingularPoint for a division by zero, ValueError for a missing
    root.
    """
    known: dict[ex.Expression, int] = {}
    return np.array(
        [_montgomery(recipe(point, known), point.prime) for recipe in program.recipes], np.uint64
    )


def run(
    program: SeriesProgram,
    instructions: Integers,
    constants: Words,
    prime: int,
    order: int,
    given: Sequence[Sequence[int]] = (),
) -> Registers:
    """All registers with their series to this order; SingularPoint if a denominator vanishes.

    `given` may supply the coefficients of the first registers, which no instruction then writes.
    """
    tables, stride = (
        series_tables(len(program.variables), order),
        coefficients(len(program.variables), order),
    )
    values, tops = (
        np.empty(program.registers * stride, np.uint64),
        np.full(program.registers, -1, np.int64),
    )
    for place, known in enumerate(given):
        values[place * stride : (place + 1) * stride] = [
            _montgomery(value, prime) for value in known[:stride]
        ]
        tops[place] = order
    return _run(Registers(prime, tables, values, tops), instructions, constants)


def run_again(
    before: Registers,
    kept: int,
    count: int,
    instructions: Integers,
    numbers: Sequence[int],
    order: int,
) -> Registers:
    """Run more instructions, with integer constants, on the first `kept` registers of a run, to a
    lower order.
    """
    tables, stride = (
        series_tables(before.tables.size, order),
        coefficients(before.tables.size, order),
    )
    values, tops = np.empty(count * stride, np.uint64), np.full(count, -1, np.int64)
    given = before.values.reshape(len(before.tops), -1)
    values[: kept * stride].reshape(kept, stride)[:] = given[:kept, :stride]
    tops[:kept] = np.minimum(before.tops[:kept], order)
    constants = np.array(
        [_montgomery(number % before.prime, before.prime) for number in numbers], np.uint64
    )
    return _run(Registers(before.prime, tables, values, tops), instructions, constants)


def _run(registers: Registers, instructions: Integers, constants: Words) -> Registers:
    prime, order = registers.prime, registers.tables.order
    small, inverses = modular.small_numbers(prime, order + 2), _inverses(prime, order + 1)
    given = Machine(registers.stored, registers.tables, modular.field_of(prime), small, inverses)
    if carry_out(instructions, constants, given) >= 0:
        raise modular.SingularPoint("division by a series that vanishes at the point")
    return registers


def _montgomery(value: int, prime: int) -> int:
    return (value << 64) % prime


@lru_cache(maxsize=64)
def _inverse_of_radix(prime: int) -> int:
    """What a number in Montgomery form is multiplied by to leave it."""
    return pow(1 << 64, -1, prime)


@lru_cache(maxsize=64)
def _inverses(prime: int, count: int) -> Words:
    """0, and 1/1, 1/2, …, in Montgomery form."""
    numbers = np.array(
        [0, *(_montgomery(pow(k, -1, prime), prime) for k in range(1, count))], np.uint64
    )
    numbers.setflags(write=False)
    return numbers
