"""Arithmetic modulo a safe prime P = 2Q + 1 below 2^62, with a root for every square, and points
over such a field.

Modulo P = 3 mod 4 the quadratic residues form a group of odd prime order Q, in which every element
has exactly one k-th root for each k < Q, and exactly one of w, -w is a residue. Residues therefore
behave under products and rational powers as positive reals do: sqrt(xy) = sqrt(x) sqrt(y) for
positive x, y, (x^2)^(1/2) = |x|, x^(1/2) x^(1/3) = x^(5/6). Taking every root there respects all
multiplicative relations among roots without knowing them. P = -1 modulo 4 l makes the prime l a
residue, so that sqrt(2), sqrt(3), … exist.

In Montgomery form x stands for x R modulo P, R = 2^64; a product costs three multiplications
(Montgomery, Math. Comp. 44 (1985) 519). numba, whose wheels contain the compiler, compiles the
functions on 64-bit words; the code is cached. A `Point` has consistent random values of all atoms
of a system.
"""

import math
import random
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from hashlib import blake2b
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt
from flint import fmpz

from inverse_service.expressions import calculus, jets, tree as ex
from inverse_service.kernels.machine_code.kernels import compiled as compiled, intrinsic

# For primes that are -1 modulo this, 2, 3, 5, 7, 11, and 13 are residues.
_MODULUS = 8 * 3 * 5 * 7 * 11 * 13
_BITS = 61
# splitmix64 (Steele, Lea and Flood, OOPSLA 2014), for numbers that only need to be unpredictable.
GOLDEN = np.uint64(0x9E3779B97F4A7C15)
# The size of the first table of a prime, which is enough for most purposes.
_LEAST = 512
Variable = ex.Symbol | ex.Velocity


@lru_cache(maxsize=256)
def safe_prime(seed: int, residues: frozenset[int] = frozenset(), order: int = 2) -> int:
    """A random safe prime of 61 bits modulo which 2 … 13 and all of `residues` (primes) are
    residues.

    `order` divides the number of points of the circle, which is the prime plus one.
    """
    generator, modulus = random.Random(f"prime {seed}"), math.lcm(_MODULUS, order)
    low, high = 2 ** (_BITS - 1) // modulus, 2**_BITS // modulus
    while True:
        candidate = generator.randrange(low, high) * modulus - 1
        if not _is_safe_prime(candidate):
            continue
        if all(is_positive(ell, candidate) for ell in residues):
            return candidate


def _is_safe_prime(candidate: int) -> bool:
    half = (candidate - 1) // 2
    if any(half % ell == 0 for ell in (17, 19, 23, 29, 31, 37, 41, 43)):
        return False
    return bool(fmpz(half).is_prime()) and bool(fmpz(candidate).is_prime())


def is_positive(value: int, prime: int) -> bool:
    """Whether a nonzero residue class is a square."""
    return int(fmpz(value).jacobi(prime)) == 1


def positive_power(value: int, exponent: Fraction | int, prime: int) -> int:
    """value^exponent; for a fraction, the root that is itself a square (odd roots are unique).

    Raises ValueError if no such root exists: an even root of a nonsquare, 0 to a negative power.
    """
    if value % prime == 0:
        if exponent <= 0:
            raise ValueError("zero to a negative power")
        return 0
    if exponent.denominator == 1:
        return pow(value, exponent.numerator, prime)
    order = (prime - 1) // 2
    if not is_positive(value, prime):
        if exponent.denominator % 2 == 0:
            raise ValueError("even root of a negative residue")
        sign = -1 if exponent.numerator % 2 else 1
        return sign * positive_power(-value % prime, exponent, prime) % prime
    return pow(value, exponent.numerator * pow(exponent.denominator, -1, order) % order, prime)


def root_exponent(exponent: Fraction | int, prime: int) -> int:
    """The k with x^k = `positive_power` of x, for each x that is not 0 and has one, modulo a safe
    prime.

    The squares have the order (prime - 1)/2, an odd prime. An odd root of -x is that of x with the
    other sign, as k is odd with the numerator.
    """
    order = prime // 2 if exponent.denominator % 2 == 0 else prime - 1
    return exponent.numerator * pow(exponent.denominator, -1, order) % order


def prime_factors(value: int) -> Iterable[tuple[int, int]]:
    """(prime, multiplicity) of a positive integer."""
    return [(int(ell), int(k)) for ell, k in fmpz(value).factor()]


def reconstruct(residue: int, prime: int, bound: int = 10**6) -> Fraction | None:
    """The fraction a/b with |a|, b <= bound that is `residue` modulo `prime` (Wang), or None."""
    r0, s0, r1, s1 = prime, 0, residue % prime, 1
    while r1 > bound:
        quotient = r0 // r1
        r0, s0, r1, s1 = r1, s1, r0 - quotient * r1, s0 - quotient * s1
    if s1 == 0 or abs(s1) > bound:
        return None
    return Fraction(r1, s1)


# numba and LLVM are imported only to compile an operation: the import takes 0.3 s, and stored code
# needs neither.


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


def _add_product(typing_context: Any, low: Any, high: Any, a: Any, b: Any) -> Any:
    """2^64 high + low + a b in two words, lower first, as code for the compiler."""
    from llvmlite import ir
    from numba import types

    words = types.UniTuple(types.uint64, 2)  # type: ignore[no-untyped-call]
    signature = words(types.uint64, types.uint64, types.uint64, types.uint64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        wide = ir.IntType(128)
        lower, upper, left, right = (builder.zext(argument, wide) for argument in arguments)
        shift = ir.Constant(wide, 64)
        before = builder.or_(builder.shl(upper, shift), lower)
        total = builder.add(before, builder.mul(left, right))
        parts = (builder.trunc(x, ir.IntType(64)) for x in (total, builder.lshr(total, shift)))
        return context.make_tuple(builder, signature.return_type, list(parts))

    return signature, generate


add_product = cast(
    Callable[[np.uint64, np.uint64, np.uint64, np.uint64], tuple[np.uint64, np.uint64]],
    intrinsic(_add_product),
)


def _leading_zeros(typing_context: Any, word: Any) -> Any:
    """The number of zero bits above the highest bit, as code for the compiler."""
    from llvmlite import ir
    from numba import types

    signature = types.int64(types.uint64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ctlz(arguments[0], ir.Constant(ir.IntType(1), 0))

    return signature, generate


leading_zeros = cast(Callable[[np.uint64], int], intrinsic(_leading_zeros))


class Field(NamedTuple):
    """The integers modulo a prime P < 2^62 for compiled loops: P, -1/P modulo R, R modulo P, R^2
    modulo P.
    """

    prime: np.uint64
    negative_inverse: np.uint64
    one: np.uint64
    square: np.uint64


@compiled
def plus(a: np.uint64, b: np.uint64, field: Field) -> np.uint64:
    """a + b modulo the prime."""
    total = a + b
    return total - field.prime if total >= field.prime else total


@compiled
def minus(a: np.uint64, b: np.uint64, field: Field) -> np.uint64:
    """a - b modulo the prime."""
    return a - b if a >= b else a + (field.prime - b)


@compiled
def multiply(a: np.uint64, b: np.uint64, field: Field) -> np.uint64:
    """a b / R modulo the prime."""
    prime = field.prime
    low = a * b
    high = high_product(a, b)
    correction = high_product(low * field.negative_inverse, prime)
    # low + (low * negative_inverse * prime) is 0 modulo R; it carries exactly when low != 0.
    result = high + correction + (np.uint64(1) if low != np.uint64(0) else np.uint64(0))
    return result - prime if result >= prime else result


@compiled
def montgomery_power(base: np.uint64, exponent: np.uint64, field: Field) -> np.uint64:
    """base^exponent, base and result in Montgomery form."""
    result = field.one
    while exponent > np.uint64(0):
        if exponent & np.uint64(1):
            result = multiply(result, base, field)
        base = multiply(base, base, field)
        exponent >>= np.uint64(1)
    return result


@compiled
def mixed(state: np.uint64) -> np.uint64:
    """The random word of a state; the next state is this one plus GOLDEN."""
    word = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


@lru_cache(maxsize=256)
def field_of(prime: int) -> Field:
    """The field of this prime."""
    radix = 1 << 64
    return Field(
        np.uint64(prime),
        np.uint64(-pow(prime, -1, radix) % radix),
        np.uint64(radix % prime),
        np.uint64(radix * radix % prime),
    )


def small_numbers(prime: int, count: int) -> npt.NDArray[np.uint64]:
    """0, 1, …, at least to count - 1, in Montgomery form."""
    return _small_numbers(prime, max(_LEAST, 1 << (count - 1).bit_length()))


@lru_cache(maxsize=64)
def _small_numbers(prime: int, count: int) -> npt.NDArray[np.uint64]:
    numbers = np.zeros(count, np.uint64)
    _count_up(numbers, field_of(prime))
    numbers.setflags(write=False)
    return numbers


@compiled
def _count_up(numbers: npt.NDArray[np.uint64], field: Field) -> None:
    """numbers[k] = k, where numbers[0] is 0."""
    for k in range(1, len(numbers)):
        numbers[k] = plus(numbers[k - 1], field.one, field)


class SingularPoint(ArithmeticError):
    """A division by 0 or by a series without constant term, because the point is not generic."""


@dataclass(slots=True)
class Point:
    """Values of variables and atoms modulo `prime`; atoms are added innermost first.

    `signs` maps a variable to the required residue symbol of its value (the sign of the variable at
    the real point that represents the domain of the answer). `salts` select other random values of
    single variables and of the free generators that contain them. The square roots of the primes in
    `flipped` have the other sign, which gives a conjugate point.
    """

    prime: int
    seed: int
    signs: Mapping[Variable, int] = field(default_factory=dict)
    salts: Mapping[Variable, int] = field(default_factory=dict)
    flipped: frozenset[int] = frozenset()
    variables: dict[Variable, int] = field(default_factory=dict)
    atoms: dict[ex.Expression, int] = field(default_factory=dict)

    def draw(self, key: Hashable) -> int:
        """A random nonzero residue that depends only on the seed and the key."""
        text = f"{self.seed}|{_text(key)}".encode()
        return int.from_bytes(blake2b(text, digest_size=16).digest()) % (self.prime - 3) + 2

    def draw_free(self, atom: ex.Expression) -> int:
        """A random nonzero residue for a free generator; it also depends on the salts of its
        variables.
        """
        return self.draw((atom, tuple(self.salts.get(name, 0) for name in variables_in(atom))))

    def atom(self, atom: ex.Apply) -> int:
        """The value of a transcendental atom; exp and log of a number need no rule."""
        if atom not in self.atoms and isinstance(atom.argument, ex.Number):
            return constant_value(atom.function, atom.argument.value, self)
        return self.atoms[atom]

    def variable(self, name: Variable) -> int:
        """The value of a coordinate, velocity, or parameter, of t, or of pi."""
        if name not in self.variables:
            value = self.draw((name, self.salts.get(name, 0)))
            sign = self.signs.get(name, 0)
            if sign and is_positive(value, self.prime) != (sign > 0):
                value = self.prime - value
            self.variables[name] = value
        return self.variables[name]

    def jet(self, name: str, arguments: tuple[int, ...], orders: tuple[int, ...]) -> int:
        """A partial derivative of an arbitrary function at a place; equal places give equal
        values.
        """
        return self.draw((name, arguments, orders))


def _text(key: Hashable) -> str:
    """The text that identifies a key of `Point.draw`; of a tree with salts, only the salts change
    between points.
    """
    if isinstance(key, tuple):
        return f"({_known_text(key[0])}, {', '.join(map(repr, key[1:]))})"
    return _known_text(key)


@lru_cache(maxsize=4096)
def _known_text(key: Hashable) -> str:
    """The text of a tree, cached because it is the slowest part of a draw."""
    return repr(key)


@lru_cache(maxsize=1024)
def variables_in(expression: ex.Expression) -> tuple[Variable, ...]:
    """The coordinates, velocities, and parameters in a tree, in order of first occurrence."""
    return tuple(
        dict.fromkeys(
            node for node in ex.walk(expression) if isinstance(node, ex.Symbol | ex.Velocity)
        )
    )


def constant_value(function: str, value: Fraction, point: Point) -> int:
    """exp(value) or, for a positive value, log(value): e and the logarithms of primes are free
    constants.
    """
    if function == "exp":
        return positive_power(pow(point.draw("e"), 2, point.prime), value, point.prime)
    if function != "log" or value <= 0:
        raise KeyError(f"{function}({value})")
    total = sum(k * point.draw(("log", ell)) for ell, k in prime_factors(value.numerator))
    total -= sum(k * point.draw(("log", ell)) for ell, k in prime_factors(value.denominator))
    return total % point.prime


def number_value(value: Fraction, prime: int) -> int:
    numerator, denominator = value.as_integer_ratio()
    if denominator == 1:
        return numerator % prime
    if denominator % prime == 0:
        raise SingularPoint("denominator divisible by the prime")
    return numerator * pow(denominator, -1, prime) % prime


def evaluate(
    expression: ex.Expression, point: Point, known: dict[ex.Expression, int] | None = None
) -> int:
    """The value at the point; SingularPoint if a denominator vanishes, ValueError for a missing
    root.

    `known` caches values at this point, for trees with common parts.
    """
    known = {} if known is None else known
    value = known.get(expression)
    if value is None:
        known[expression] = value = _evaluate(expression, point, known)
    return value


def _evaluate(expression: ex.Expression, point: Point, known: dict[ex.Expression, int]) -> int:
    """By the kinds of nodes, the most frequent ones first; `match` takes twice as long."""
    prime, kind = point.prime, type(expression)
    if kind is ex.Symbol or kind is ex.Velocity:
        return point.variable(cast("Variable", expression))
    if isinstance(expression, ex.Product):
        product = 1
        for factor in expression.factors:
            value = known.get(factor)
            product = product * (evaluate(factor, point, known) if value is None else value) % prime
        return product
    if isinstance(expression, ex.Sum):
        return sum([evaluate(term, point, known) for term in expression.terms]) % prime
    if isinstance(expression, ex.Power) and isinstance(expression.exponent, ex.Number):
        base, exponent = expression.base, expression.exponent.value
        value = evaluate(base, point, known)
        if exponent.denominator == 1 and value:
            return pow(value, exponent.numerator, prime)
        return _flip(base, exponent, point) * power_value(value, exponent, prime) % prime
    if isinstance(expression, ex.Number):
        return number_value(expression.value, prime)
    if isinstance(expression, ex.Apply):
        return point.atom(expression)
    if isinstance(expression, ex.Arbitrary):
        if (law := jets.by_independent(expression)) is not None:
            return evaluate(law, point, known)
        arguments = tuple(evaluate(argument, point, known) for argument in expression.arguments)
        return point.jet(expression.name, arguments, expression.orders)
    raise TypeError(f"{type(expression).__name__} is not a kernel")


def gradient(expression: ex.Expression, variables: Sequence[Variable], point: Point) -> list[int]:
    """The partial derivatives of a tree in kernels at the point."""
    known: dict[ex.Expression, int] = {}
    return [evaluate(calculus.differentiate(expression, x), point, known) for x in variables]


def _flip(base: ex.Expression, exponent: Fraction, point: Point) -> int:
    """The sign of a square root of a number at a conjugate point."""
    if not point.flipped or exponent.denominator != 2 or not isinstance(base, ex.Number):
        return 1
    odd = [
        ell for k in base.value.as_integer_ratio() for ell, times in prime_factors(k) if times % 2
    ]
    return -1 if len(point.flipped.intersection(odd)) % 2 else 1


def power_value(base: int, exponent: Fraction, prime: int) -> int:
    """base^exponent modulo the prime; SingularPoint for 0 to a negative power."""
    if base == 0 and exponent < 0:
        raise SingularPoint("division by zero modulo the prime")
    return positive_power(base, exponent, prime)
