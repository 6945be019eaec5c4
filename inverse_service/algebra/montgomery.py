"""Arithmetic modulo a prime below 2^62 on 64-bit words, compiled.

Montgomery form: x stands for x R modulo P, R = 2^64; a product costs three multiplications
(Montgomery, Math. Comp. 44 (1985) 519). Compiled by numba, whose wheels carry their compiler, and kept.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from inverse_service.machine_code.kernels import compiled as compiled
from inverse_service.machine_code.kernels import intrinsic

# numba and LLVM are imported where an operation is compiled: they take 0.3 s, and stored code needs neither.


def _upper_word(typing_context: Any, a: Any, b: Any) -> Any:
    """The upper 64 bits of the 128-bit product, as code for the compiler."""
    from llvmlite import ir
    from numba import types

    signature = types.uint64(types.uint64, types.uint64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        wide = ir.IntType(128)
        left, right = (builder.zext(argument, wide) for argument in arguments)
        upper = builder.lshr(builder.mul(left, right), ir.Constant(wide, 64))
        return builder.trunc(upper, ir.IntType(64))

    return signature, generate


high_product = cast(Callable[[np.uint64, np.uint64], np.uint64], intrinsic(_upper_word))


def _leading_zeros(typing_context: Any, word: Any) -> Any:
    """The number of zero bits above the highest bit, as code for the compiler."""
    from llvmlite import ir
    from numba import types

    signature = types.int64(types.uint64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ctlz(arguments[0], ir.Constant(ir.IntType(1), 0))

    return signature, generate


leading_zeros = cast(Callable[[np.uint64], int], intrinsic(_leading_zeros))


@compiled
def multiply(a: np.uint64, b: np.uint64, prime: np.uint64, negative_inverse: np.uint64) -> np.uint64:
    """a b / R modulo the prime."""
    low = a * b
    high = high_product(a, b)
    correction = high_product(low * negative_inverse, prime)
    # low + (low * negative_inverse * prime) is 0 modulo R; it carries exactly when low != 0.
    result = high + correction + (np.uint64(1) if low != np.uint64(0) else np.uint64(0))
    return result - prime if result >= prime else result


@compiled
def power(
    base: np.uint64, exponent: np.uint64, one: np.uint64, prime: np.uint64, negative_inverse: np.uint64
) -> np.uint64:
    """base^exponent, base and result in Montgomery form."""
    result = one
    while exponent > np.uint64(0):
        if exponent & np.uint64(1):
            result = multiply(result, base, prime, negative_inverse)
        base = multiply(base, base, prime, negative_inverse)
        exponent >>= np.uint64(1)
    return result


# splitmix64 (Steele, Lea and Flood, OOPSLA 2014), for numbers that need no more than to be unforeseen.
GOLDEN = np.uint64(0x9E3779B97F4A7C15)


@compiled
def mixed(state: np.uint64) -> np.uint64:
    """The random word of a state, to which GOLDEN is added for the next."""
    word = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


@lru_cache(maxsize=256)
def constants(prime: int) -> tuple[np.uint64, np.uint64, np.uint64, np.uint64]:
    """(P, -1/P modulo R, R modulo P, R^2 modulo P)."""
    radix = 1 << 64
    return (
        np.uint64(prime),
        np.uint64(-pow(prime, -1, radix) % radix),
        np.uint64(radix % prime),
        np.uint64(radix * radix % prime),
    )


@lru_cache(maxsize=64)
def small_numbers(prime: int, count: int) -> npt.NDArray[np.uint64]:
    """0, 1, …, count - 1 in Montgomery form."""
    numbers = np.array([k * (1 << 64) % prime for k in range(count)], np.uint64)
    numbers.setflags(write=False)
    return numbers
