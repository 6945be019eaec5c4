"""Truncated power series modulo a prime as arrays of words: a small machine for them, compiled.

A register holds one series (`monomials.SeriesTables`), in Montgomery form; tops[register] is the degree from which on
all its coefficients are zero, less one (-1 for the series 0), and only those up to it are ever read. An
instruction is six numbers: operation, out, a, b, c, cut, with registers out, a, b and the place c of a
constant. Functions follow from the Euler operator as in `series.py`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from inverse_service.algebra.modular import compiled, multiply, power

Words = npt.NDArray[np.uint64]
Integers = npt.NDArray[np.int64]
Places = npt.NDArray[np.int32]

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

# stride, order, counts, starts, product_starts, products: the words between registers and the `SeriesTables`.
Layout = tuple[int, int, Integers, Integers, Integers, Places]
# P, -1/P modulo 2^64, and 0, 1, 2, … and their inverses in Montgomery form.
Field = tuple[np.uint64, np.uint64, Words, Words]


@compiled
def _extend(values: Words, tops: Integers, out: int, top: int, layout: Layout) -> None:
    """Give out zeros up to degree `top`."""
    stride, _, _, starts, _, _ = layout
    if top > tops[out]:
        for k in range(out * stride + starts[tops[out] + 1], out * stride + starts[top + 1]):
            values[k] = np.uint64(0)
        tops[out] = top


@compiled
def _start(values: Words, tops: Integers, out: int, constant: np.uint64, layout: Layout) -> None:
    tops[out] = 0
    values[out * layout[0]] = constant


@compiled
def _convolve(
    values: Words, out: int, left: int, j: int, right: int, k: int, weight: np.uint64, layout: Layout, field: Field
) -> None:
    """out_(j + k) += weight left_j right_k, for the homogeneous components of these degrees."""
    stride, order, counts, starts, product_starts, products = layout
    prime, negative_inverse, _, _ = field
    base, first, second = out * stride + starts[j + k], left * stride + starts[j], right * stride + starts[k]
    for i in range(counts[j]):
        if values[first + i] == np.uint64(0):
            continue
        a = multiply(values[first + i], weight, prime, negative_inverse)
        row = product_starts[j * (order + 1) + k] + i * counts[k]
        for m in range(counts[k]):
            b = values[second + m]
            if b != np.uint64(0):
                place = base + products[row + m]
                total = values[place] + multiply(a, b, prime, negative_inverse)
                values[place] = total - prime if total >= prime else total


@compiled
def _scale(values: Words, out: int, degree: int, factor: np.uint64, layout: Layout, field: Field) -> None:
    """out_degree := factor out_degree."""
    stride, _, _, starts, _, _ = layout
    for k in range(out * stride + starts[degree], out * stride + starts[degree + 1]):
        if values[k] != np.uint64(0):
            values[k] = multiply(values[k], factor, field[0], field[1])


@compiled
def _add(
    values: Words, tops: Integers, out: int, a: int, factor: np.uint64, first: int, last: int,
    layout: Layout, field: Field,
) -> None:  # fmt: skip
    """out += factor a in the degrees first … last."""
    stride, _, _, starts, _, _ = layout
    prime, negative_inverse, _, _ = field
    last = min(last, tops[a])
    _extend(values, tops, out, last, layout)
    for k in range(starts[first], starts[last + 1]):
        value = values[a * stride + k]
        if value != np.uint64(0):
            total = values[out * stride + k] + multiply(value, factor, prime, negative_inverse)
            values[out * stride + k] = total - prime if total >= prime else total


@compiled
def _multiply(
    values: Words, tops: Integers, out: int, a: int, b: int, factor: np.uint64, limit: int,
    layout: Layout, field: Field,
) -> None:  # fmt: skip
    """out += factor a b to degree `limit`; out is neither a nor b."""
    if tops[a] < 0 or tops[b] < 0:
        return
    if tops[a] > tops[b]:
        a, b = b, a
    top = min(limit, tops[a] + tops[b])
    _extend(values, tops, out, top, layout)
    for j in range(min(tops[a], top) + 1):
        for k in range(min(tops[b], top - j) + 1):
            _convolve(values, out, a, j, b, k, factor, layout, field)


@compiled
def _differentiate(
    values: Words, tops: Integers, out: int, a: int, index: int, size: int,
    raised_starts: Integers, raised: Integers, exponents: Integers, layout: Layout, field: Field,
) -> None:  # fmt: skip
    stride, _, counts, starts, _, _ = layout
    prime, negative_inverse, small, _ = field
    highest = -1
    for degree in range(tops[a]):
        for i in range(counts[degree]):
            above = raised_starts[degree] + i * size + index
            value = values[a * stride + starts[degree + 1] + raised[above]]
            if value != np.uint64(0):
                value = multiply(value, small[exponents[above]], prime, negative_inverse)
                highest = degree
            values[out * stride + starts[degree] + i] = value
    tops[out] = highest


@compiled
def _power(
    values: Words, tops: Integers, out: int, a: int, exponent: np.uint64, inverse: np.uint64,
    layout: Layout, field: Field,
) -> None:  # fmt: skip
    """a_0 k y_k = sum_j (exponent j - (k - j)) a_j y_(k-j), the constant term being there; `inverse` is 1/a_0."""
    prime, negative_inverse, small, inverses = field
    for k in range(1, layout[1] + 1 if tops[a] > 0 else 1):
        _extend(values, tops, out, k, layout)
        for j in range(1, min(k, tops[a]) + 1):
            weight = multiply(exponent, small[j], prime, negative_inverse) + (prime - small[k - j])
            weight = weight - prime if weight >= prime else weight
            _convolve(values, out, a, j, out, k - j, weight, layout, field)
        _scale(values, out, k, multiply(inverse, inverses[k], prime, negative_inverse), layout, field)


@compiled
def _exponential(values: Words, tops: Integers, out: int, a: int, layout: Layout, field: Field) -> None:
    """k y_k = sum_j j a_j y_(k-j), the constant term being there."""
    _, _, small, inverses = field
    for k in range(1, layout[1] + 1 if tops[a] > 0 else 1):
        _extend(values, tops, out, k, layout)
        for j in range(1, min(k, tops[a]) + 1):
            _convolve(values, out, a, j, out, k - j, small[j], layout, field)
        _scale(values, out, k, inverses[k], layout, field)


@compiled
def _sine_cosine(values: Words, tops: Integers, sine: int, cosine: int, a: int, layout: Layout, field: Field) -> None:
    """k s_k = sum_j j a_j c_(k-j), k c_k = -sum_j j a_j s_(k-j), the constant terms being there."""
    prime, _, small, inverses = field
    for k in range(1, layout[1] + 1 if tops[a] > 0 else 1):
        _extend(values, tops, sine, k, layout)
        _extend(values, tops, cosine, k, layout)
        for j in range(1, min(k, tops[a]) + 1):
            _convolve(values, sine, a, j, cosine, k - j, small[j], layout, field)
            _convolve(values, cosine, a, j, sine, k - j, prime - small[j], layout, field)
        _scale(values, sine, k, inverses[k], layout, field)
        _scale(values, cosine, k, inverses[k], layout, field)


@compiled
def _primitive(
    values: Words, tops: Integers, out: int, a: int, b: int, inverse: np.uint64, layout: Layout, field: Field
) -> None:
    """k b_0 y_k = k a_k - sum_(0<j<k) (k - j) b_j y_(k-j), the constant term being there; `inverse` is 1/b_0."""
    prime, negative_inverse, small, inverses = field
    for k in range(1, layout[1] + 1 if tops[a] > 0 else 1):
        _extend(values, tops, out, k, layout)
        for j in range(1, min(k - 1, tops[b]) + 1):
            _convolve(values, out, b, j, out, k - j, prime - small[k - j], layout, field)
        _add(values, tops, out, a, small[k], k, k, layout, field)
        _scale(values, out, k, multiply(inverse, inverses[k], prime, negative_inverse), layout, field)


@compiled
def _divide(
    operation: int, out: int, a: int, b: int, c: int, constants: Words, values: Words, tops: Integers,
    one: np.uint64, layout: Layout, field: Field,
) -> bool:  # fmt: skip
    """The operations that divide by a constant term; False where it is 0."""
    prime, negative_inverse, _, _ = field
    divisor = b if operation == PRIMITIVE else a
    if tops[divisor] < 0 or values[divisor * layout[0]] == np.uint64(0):
        return False
    inverse = power(values[divisor * layout[0]], prime - np.uint64(2), one, prime, negative_inverse)
    if operation == INVERSE:
        _start(values, tops, out, inverse, layout)
        _power(values, tops, out, a, prime - one, inverse, layout, field)
    elif operation == POWER:
        _start(values, tops, out, constants[c + 1], layout)
        _power(values, tops, out, a, constants[c], inverse, layout, field)
    else:
        _start(values, tops, out, constants[c], layout)
        _primitive(values, tops, out, a, b, inverse, layout, field)
    return True


@compiled
def run(
    instructions: Integers, constants: Words, values: Words, tops: Integers, size: int, stride: int, order: int,
    counts: Integers, starts: Integers, product_starts: Integers, products: Places,
    raised_starts: Integers, raised: Integers, exponents: Integers, small: Words, inverses: Words,
    prime: np.uint64, negative_inverse: np.uint64, one: np.uint64,
) -> int:  # fmt: skip
    """Carry out all instructions; the number of the first that divides by a series without constant term, or -1."""
    layout = (stride, order, counts, starts, product_starts, products)
    field = (prime, negative_inverse, small, inverses)
    for number in range(len(instructions) // WIDTH):
        at = WIDTH * number
        operation, out, a, b = instructions[at], instructions[at + 1], instructions[at + 2], instructions[at + 3]
        c, limit = instructions[at + 4], order - instructions[at + 5]
        if operation == CONSTANT:
            _extend(values, tops, out, 0, layout)
            total = values[out * stride] + constants[c]
            values[out * stride] = total - prime if total >= prime else total
        elif operation == VARIABLE:
            _extend(values, tops, out, 1, layout)
            values[out * stride + 1 + counts[1] - 1 - a] = one
        elif operation == ADD:
            _add(values, tops, out, a, constants[c], 0, limit, layout, field)
        elif operation == PRODUCT:
            _multiply(values, tops, out, a, b, constants[c], limit, layout, field)
        elif operation == DERIVATIVE:
            _differentiate(values, tops, out, a, b, size, raised_starts, raised, exponents, layout, field)
        elif operation == WITHOUT_CONSTANT:
            _extend(values, tops, out, 0, layout)
            values[out * stride] = np.uint64(0)
        elif operation == EXPONENTIAL:
            _start(values, tops, out, constants[c], layout)
            _exponential(values, tops, out, a, layout, field)
        elif operation == TRIGONOMETRIC:
            _start(values, tops, out, constants[c], layout)
            _start(values, tops, b, constants[c + 1], layout)
            _sine_cosine(values, tops, out, b, a, layout, field)
        elif not _divide(operation, out, a, b, c, constants, values, tops, one, layout, field):
            return number
    return -1


@compiled
def count_coefficients(
    registers: Integers, values: Words, tops: Integers, last: int, stride: int, starts: Integers
) -> int:
    """The number of coefficients that are not zero, to degree `last`."""
    count = 0
    for r in registers:
        for k in range(r * stride, r * stride + starts[min(last, tops[r]) + 1]):
            count += 1 if values[k] != np.uint64(0) else 0
    return count


@compiled
def list_coefficients(
    registers: Integers, values: Words, tops: Integers, last: int, stride: int, starts: Integers,
    firsts: Integers, places: Integers, found: Words, degrees: Integers,
) -> None:  # fmt: skip
    """Those coefficients of each register, from firsts[number] on: place within the degree, value, degree."""
    count = 0
    for number in range(len(registers)):
        r = registers[number]
        for degree in range(min(last, tops[r]) + 1):
            for k in range(starts[degree], starts[degree + 1]):
                value = values[r * stride + k]
                if value != np.uint64(0):
                    places[count], found[count], degrees[count] = k - starts[degree], value, degree
                    count += 1
        firsts[number + 1] = count
