"""Truncated power series modulo a prime as arrays of words: a small machine for them, compiled.

A register holds one series (`monomials.SeriesTables`), in Montgomery form; tops[register] is the degree from which on
all its coefficients are zero, less one (-1 for the series 0), and only those up to it are ever read. An
instruction is six numbers: operation, out, a, b, c, cut, with registers out, a, b and the place c of a
constant. Functions follow from the Euler operator as in `truncated_series.py`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from inverse_service.field.modular import Field, compiled, minus, multiply, plus, power
from inverse_service.field.monomials import SeriesTables

Words = npt.NDArray[np.uint64]
Integers = npt.NDArray[np.int64]

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


class Registers(NamedTuple):
    """The series of all registers end to end, `stride` words each, and the `tops` up to which they are not zero."""

    values: Words
    tops: Integers
    stride: int


class Machine(NamedTuple):
    """What every instruction may need: the registers, where products and derivatives stand, the prime.

    `small` holds 0, 1, 2, …, `inverses` 0 and their inverses, in Montgomery form: exponents and degrees as factors.
    """

    registers: Registers
    tables: SeriesTables
    field: Field
    small: Words
    inverses: Words


class SparseSeries(NamedTuple):
    """Coefficients that are not zero: series s has those from starts[s] to starts[s + 1], by ascending degree.

    `places` are those of the monomials among all of their degree.
    """

    starts: Integers
    places: Integers
    values: Words
    degrees: Integers


@compiled
def _extend(m: Machine, out: int, top: int) -> None:
    """Give out zeros up to degree `top`."""
    values, tops, stride = m.registers
    if top > tops[out]:
        for k in range(out * stride + m.tables.starts[tops[out] + 1], out * stride + m.tables.starts[top + 1]):
            values[k] = np.uint64(0)
        tops[out] = top


@compiled
def _start(m: Machine, out: int, constant: np.uint64) -> None:
    """out := constant."""
    m.registers.tops[out] = 0
    m.registers.values[out * m.registers.stride] = constant


@compiled
def _convolve(m: Machine, out: int, left: int, j: int, right: int, k: int, weight: np.uint64) -> None:
    """out_(j + k) += weight left_j right_k, for the homogeneous components of these degrees."""
    values, _, stride = m.registers
    counts, starts = m.tables.counts, m.tables.starts
    base, first, second = out * stride + starts[j + k], left * stride + starts[j], right * stride + starts[k]
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
    for k in range(out * stride + m.tables.starts[degree], out * stride + m.tables.starts[degree + 1]):
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
    """Up to which degree a function of a is computed: 0 for a constant."""
    return m.tables.order if m.registers.tops[a] > 0 else 0


@compiled
def _power(m: Machine, out: int, a: int, exponent: np.uint64, inverse: np.uint64) -> None:
    """a_0 k y_k = sum_j (exponent j - (k - j)) a_j y_(k-j), the constant term being there; `inverse` is 1/a_0."""
    for k in range(1, _last_degree(m, a) + 1):
        _extend(m, out, k)
        for j in range(1, min(k, m.registers.tops[a]) + 1):
            weight = minus(multiply(exponent, m.small[j], m.field), m.small[k - j], m.field)
            _convolve(m, out, a, j, out, k - j, weight)
        _scale(m, out, k, multiply(inverse, m.inverses[k], m.field))


@compiled
def _exponential(m: Machine, out: int, a: int) -> None:
    """k y_k = sum_j j a_j y_(k-j), the constant term being there."""
    for k in range(1, _last_degree(m, a) + 1):
        _extend(m, out, k)
        for j in range(1, min(k, m.registers.tops[a]) + 1):
            _convolve(m, out, a, j, out, k - j, m.small[j])
        _scale(m, out, k, m.inverses[k])


@compiled
def _sine_cosine(m: Machine, sine: int, cosine: int, a: int) -> None:
    """k s_k = sum_j j a_j c_(k-j), k c_k = -sum_j j a_j s_(k-j), the constant terms being there."""
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
    """k b_0 y_k = k a_k - sum_(0<j<k) (k - j) b_j y_(k-j), the constant term being there; `inverse` is 1/b_0."""
    for k in range(1, _last_degree(m, a) + 1):
        _extend(m, out, k)
        for j in range(1, min(k - 1, m.registers.tops[b]) + 1):
            _convolve(m, out, b, j, out, k - j, m.field.prime - m.small[k - j])
        _add(m, out, a, m.small[k], k, k)
        _scale(m, out, k, multiply(inverse, m.inverses[k], m.field))


@compiled
def _divide(m: Machine, operation: int, out: int, a: int, b: int, first: np.uint64, second: np.uint64) -> bool:
    """The operations that divide by a constant term, and their one or two constants; False where it is 0."""
    values, tops, stride = m.registers
    divisor = b if operation == PRIMITIVE else a
    if tops[divisor] < 0 or values[divisor * stride] == np.uint64(0):
        return False
    inverse = power(values[divisor * stride], m.field.prime - np.uint64(2), m.field)
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
def run(instructions: Integers, constants: Words, m: Machine) -> int:
    """Carry out all instructions; the number of the first that divides by a series without constant term, or -1."""
    values, _, stride = m.registers
    for number in range(len(instructions) // WIDTH):
        at = WIDTH * number
        operation, out, a, b = instructions[at], instructions[at + 1], instructions[at + 2], instructions[at + 3]
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
        elif not _divide(m, operation, out, a, b, constants[c], constants[min(c + 1, len(constants) - 1)]):
            return number
    return -1


@compiled
def list_coefficients(chosen: Integers, registers: Registers, starts: Integers, last: int, found: SparseSeries) -> None:
    """The coefficients of the chosen registers that are not zero, to degree `last`."""
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
