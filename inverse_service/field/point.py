"""Points over a prime field at which all atoms of a system have consistent random values, and sparse series about them.

A series of order D in m displacements is the tuple (y_0, …, y_D) of its homogeneous components,
each a python-flint nmod_mpoly; products cost no terms beyond degree D. Functions come from the
Euler operator E y = (0 y_0, 1 y_1, 2 y_2, …): for y = exp(u), E y = y E u reads
k y_k = sum_j j u_j y_{k-j}; powers, logarithms and trigonometric functions alike (Knuth, TAOCP 2, 4.7).
The constant y_0 of a transcendental function is an argument: who calls chooses it consistently.
"""

import itertools
import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from hashlib import blake2b

from flint import Ordering, nmod_mpoly, nmod_mpoly_ctx

from inverse_service.expressions import tree as ex
from inverse_service.field import modular

Series = tuple[nmod_mpoly, ...]

Variable = ex.Symbol | ex.Velocity


class SingularPoint(ArithmeticError):
    """A division by a series without constant term: the point is not generic enough."""


@dataclass(frozen=True, slots=True)
class SeriesRing:
    """Series of order `order` in `size` displacements modulo `prime`."""

    prime: int
    size: int
    order: int

    @property
    def context(self) -> nmod_mpoly_ctx:
        return _context(self.prime, self.size)

    def constant(self, value: int) -> Series:
        zero = self.context.constant(0)
        return (self.context.constant(value % self.prime),) + (zero,) * self.order

    def variable(self, index: int, value: int) -> Series:
        """value + the displacement number `index`."""
        series = list(self.constant(value))
        if self.order:
            series[1] = self.context.gen(index)
        return tuple(series)

    def invert_number(self, value: int) -> int:
        if value % self.prime == 0:
            raise SingularPoint("division by zero modulo the prime")
        return pow(value, -1, self.prime)


@lru_cache(maxsize=64)
def _context(prime: int, size: int) -> nmod_mpoly_ctx:
    names = tuple(f"d{index}" for index in range(size))
    return nmod_mpoly_ctx.get(names, modulus=prime, ordering=Ordering.degrevlex)


def value_at_point(series: Series) -> int:
    """The constant term."""
    terms = series[0].to_dict()
    return int(next(iter(terms.values()))) if terms else 0


def gradient(series: Series) -> list[int]:
    """The first derivatives at the point by all displacements."""
    values = [0] * series[1].context().nvars()
    for exponents, value in series[1].to_dict().items():
        values[exponents.index(1)] = int(value)
    return values


def add(left: Series, right: Series) -> Series:
    return tuple(a + b for a, b in zip(left, right, strict=True))


def subtract(left: Series, right: Series) -> Series:
    return tuple(a - b for a, b in zip(left, right, strict=True))


def scale(series: Series, factor: int) -> Series:
    return tuple(a * factor for a in series)


def multiply(left: Series, right: Series) -> Series:
    """The product, truncated."""
    size, zero = len(left), left[0] * 0
    factors = [(k, y) for k, y in enumerate(right) if y]
    result: list[nmod_mpoly | None] = [None] * size
    for j, x in enumerate(left):
        if not x:
            continue
        for k, y in factors:
            if j + k >= size:
                break
            before = result[j + k]
            result[j + k] = x * y if before is None else before + x * y
    return tuple(zero if part is None else part for part in result)


def _convolve(left: Series, right: Series, degree: int, first: int = 0) -> nmod_mpoly:
    """sum_{j=first}^{degree} left_j right_{degree-j}."""
    total = left[0] * 0
    for j in range(first, degree + 1):
        if left[j] and right[degree - j]:
            total += left[j] * right[degree - j]
    return total


def euler(series: Series) -> Series:
    """The Euler operator: component k times k."""
    return tuple(a * k for k, a in enumerate(series))


def inverse(ring: SeriesRing, series: Series) -> Series:
    """1/series; SingularPoint where the constant term is 0."""
    factor = ring.invert_number(value_at_point(series))
    result = [ring.context.constant(factor)]
    for degree in range(1, len(series)):
        padded = (*result, series[0] * 0)
        result.append(_convolve(series, padded, degree, first=1) * (-factor))
    return tuple(result)


def power(ring: SeriesRing, base: Series, exponent: Fraction, start: int) -> Series:
    """base^exponent with constant term `start`: b_0 k y_k = sum_{j>=1} (exponent j - (k-j)) b_j y_{k-j}."""
    factor = ring.invert_number(value_at_point(base))
    rational = exponent.numerator * ring.invert_number(exponent.denominator) % ring.prime
    result = [ring.context.constant(start)]
    for k in range(1, len(base)):
        total = base[0] * 0
        for j in range(1, k + 1):
            if base[j] and result[k - j]:
                total += base[j] * result[k - j] * ((rational * j - (k - j)) % ring.prime)
        result.append(total * (factor * ring.invert_number(k) % ring.prime))
    return tuple(result)


def integer_power(ring: SeriesRing, base: Series, exponent: int) -> Series:
    """base^exponent for any integer; works where base vanishes at the point, for exponent >= 0."""
    if exponent < 0:
        return integer_power(ring, inverse(ring, base), -exponent)
    if exponent > 4 and value_at_point(base):
        return power(ring, base, Fraction(exponent), pow(value_at_point(base), exponent, ring.prime))
    result = ring.constant(1)
    for digit in bin(exponent)[2:]:
        result = multiply(result, result)
        if digit == "1":
            result = multiply(result, base)
    return result


def exponential(ring: SeriesRing, argument: Series, start: int) -> Series:
    """exp(argument) with exp(argument_0) = start."""
    slope = euler(argument)
    result = [ring.context.constant(start)]
    for k in range(1, len(argument)):
        total = sum((slope[j] * result[k - j] for j in range(1, k + 1) if slope[j]), argument[0] * 0)
        result.append(total * ring.invert_number(k))
    return tuple(result)


def sine_cosine(ring: SeriesRing, argument: Series, sine: int, cosine: int) -> tuple[Series, Series]:
    """sin and cos of the argument, given their values at its constant term."""
    slope = euler(argument)
    s, c = [ring.context.constant(sine)], [ring.context.constant(cosine)]
    for k in range(1, len(argument)):
        factor = ring.invert_number(k)
        parts = [j for j in range(1, k + 1) if slope[j]]
        next_s = sum((slope[j] * c[k - j] for j in parts), argument[0] * 0) * factor
        next_c = sum((slope[j] * s[k - j] for j in parts), argument[0] * 0) * (-factor)
        s.append(next_s)
        c.append(next_c)
    return tuple(s), tuple(c)


def logarithm(ring: SeriesRing, argument: Series, start: int) -> Series:
    """log(argument) with the given constant term: E y = E u / u."""
    return antiderivative(ring, multiply(euler(argument), inverse(ring, argument)), start)


def arctangent(ring: SeriesRing, argument: Series, start: int) -> Series:
    """atan(argument) with the given constant term: E y = E u / (1 + u^2)."""
    denominator = add(ring.constant(1), multiply(argument, argument))
    return antiderivative(ring, multiply(euler(argument), inverse(ring, denominator)), start)


def antiderivative(ring: SeriesRing, slope: Series, start: int) -> Series:
    """y with E y = slope (slope_0 = 0) and y_0 = start."""
    tail = tuple(a * ring.invert_number(k) for k, a in enumerate(slope) if k)
    return (ring.context.constant(start), *tail)


def compose(ring: SeriesRing, arguments: Sequence[Series], jet: Callable[[tuple[int, ...]], int]) -> Series:
    """A(arguments) for an arbitrary function with partial derivatives jet(orders) at their values."""
    moved = [subtract(u, ring.constant(value_at_point(u))) for u in arguments]
    powers = [_powers(ring, u) for u in moved]
    total = ring.constant(0)
    for orders in itertools.product(range(ring.order + 1), repeat=len(arguments)):
        if sum(orders) > ring.order:
            continue
        term = ring.constant(1)
        for table, k in zip(powers, orders, strict=True):
            term = multiply(term, table[k]) if k else term
        factorials = math.prod(math.factorial(k) for k in orders)
        total = add(total, scale(term, jet(orders) * ring.invert_number(factorials) % ring.prime))
    return total


def _powers(ring: SeriesRing, series: Series) -> list[Series]:
    table = [ring.constant(1)]
    for _ in range(ring.order):
        table.append(multiply(table[-1], series))
    return table


def derivative(series: Series, index: int) -> Series:
    """The partial derivative; its top component (unknown) is dropped, so the order falls by one."""
    return tuple(component.derivative(index) if component else component for component in series[1:])


def along(field: Iterable[tuple[int, Series]], series: Series) -> Series:
    """sum_a X^a d_a y for the components (a, X^a) of a field, one order less; what is not known there is dropped."""
    length = len(series) - 1
    total = scale(series, 0)[:length]
    for index, part in field if any(series) else ():
        slope = derivative(series, index)
        if any(slope):
            total = add(total, multiply(part[:length], slope))
    return total


def terms(series: Series) -> Mapping[tuple[int, ...], int]:
    """All coefficients as {exponents: value}."""
    table: dict[tuple[int, ...], int] = {}
    for component in series:
        table.update((key, int(value)) for key, value in component.to_dict().items())
    return table


@dataclass(slots=True)
class Point:
    """Values of variables and atoms modulo `prime`; atoms are added innermost first.

    `signs` gives for a variable the sign of the residue symbol that its value is to have (the sign
    of the variable at the real point that represents the domain of the answer); `salts` choose
    among the random values of single variables and of the free generators that contain them.
    The square roots of the prime numbers in `flipped` have the other sign: a conjugate of what is meant.
    """

    prime: int
    seed: int
    signs: Mapping[Variable, int] = field(default_factory=dict)
    salts: Mapping[Variable, int] = field(default_factory=dict)
    flipped: frozenset[int] = frozenset()
    variables: dict[Variable, int] = field(default_factory=dict)
    atoms: dict[ex.Expression, int] = field(default_factory=dict)

    def draw(self, key: Hashable) -> int:
        """A random nonzero residue that depends on the seed and the key alone."""
        text = f"{self.seed}|{_text(key)}".encode()
        return int.from_bytes(blake2b(text, digest_size=16).digest()) % (self.prime - 3) + 2

    def draw_free(self, atom: ex.Expression) -> int:
        """A random nonzero residue for a free generator; the salts of its variables change it too."""
        return self.draw((atom, tuple(self.salts.get(name, 0) for name in variables_in(atom))))

    def atom(self, atom: ex.Apply) -> int:
        """The value of a transcendental atom; exp and log of a number need no rule."""
        if atom not in self.atoms and isinstance(atom.argument, ex.Number):
            return constant_value(atom.function, atom.argument.value, self)
        return self.atoms[atom]

    def variable(self, name: Variable) -> int:
        """The value of a coordinate, velocity, parameter, of t, or of pi."""
        if name not in self.variables:
            value = self.draw((name, self.salts.get(name, 0)))
            sign = self.signs.get(name, 0)
            if sign and modular.is_positive(value, self.prime) != (sign > 0):
                value = self.prime - value
            self.variables[name] = value
        return self.variables[name]

    def jet(self, name: str, arguments: tuple[int, ...], orders: tuple[int, ...]) -> int:
        """A partial derivative of an arbitrary function at a place: equal places, equal values."""
        return self.draw((name, arguments, orders))


def _text(key: Hashable) -> str:
    """What distinguishes a key of `Point.draw`: of a tree with salts only the salts are new at each point."""
    if isinstance(key, tuple):
        return f"({_known_text(key[0])}, {', '.join(map(repr, key[1:]))})"
    return _known_text(key)


@lru_cache(maxsize=4096)
def _known_text(key: Hashable) -> str:
    """The text of a tree takes longer than all else in a draw."""
    return repr(key)


@lru_cache(maxsize=1024)
def variables_in(expression: ex.Expression) -> tuple[Variable, ...]:
    """The coordinates, velocities and parameters in a tree, in the order of their first places."""
    return tuple(dict.fromkeys(node for node in ex.walk(expression) if isinstance(node, ex.Symbol | ex.Velocity)))


def constant_value(function: str, value: Fraction, point: Point) -> int:
    """exp(value) or, for a positive value, log(value): e and the logarithms of primes are free constants."""
    if function == "exp":
        return modular.positive_power(pow(point.draw("e"), 2, point.prime), value, point.prime)
    if function != "log" or value <= 0:
        raise KeyError(f"{function}({value})")
    total = sum(k * point.draw(("log", ell)) for ell, k in modular.prime_factors(value.numerator))
    total -= sum(k * point.draw(("log", ell)) for ell, k in modular.prime_factors(value.denominator))
    return total % point.prime


def number_value(value: Fraction, prime: int) -> int:
    numerator, denominator = value.as_integer_ratio()
    if denominator == 1:
        return numerator % prime
    if denominator % prime == 0:
        raise SingularPoint("denominator divisible by the prime")
    return numerator * pow(denominator, -1, prime) % prime


def evaluate(expression: ex.Expression, point: Point, known: dict[ex.Expression, int] | None = None) -> int:
    """The value at the point; SingularPoint where a denominator vanishes, ValueError for a missing root.

    `known` keeps the values found at this point, for trees that share parts.
    """
    known = {} if known is None else known
    value = known.get(expression)
    if value is None:
        known[expression] = value = _evaluate(expression, point, known)
    return value


def _evaluate(expression: ex.Expression, point: Point, known: dict[ex.Expression, int]) -> int:
    prime = point.prime
    match expression:
        case ex.Number(value):
            return number_value(value, prime)
        case ex.Symbol() | ex.Velocity():
            return point.variable(expression)
        case ex.Sum(terms):
            return sum(evaluate(term, point, known) for term in terms) % prime
        case ex.Product(factors):
            product = 1
            for factor in factors:
                product = product * evaluate(factor, point, known) % prime
            return product
        case ex.Power(base, ex.Number(exponent)):
            return _flip(base, exponent, point) * power_value(evaluate(base, point, known), exponent, prime) % prime
        case ex.Apply():
            return point.atom(expression)
        case ex.Arbitrary(name, arguments, orders):
            return point.jet(name, tuple(evaluate(argument, point, known) for argument in arguments), orders)
    raise TypeError(f"{type(expression).__name__} is not a kernel")


def _flip(base: ex.Expression, exponent: Fraction, point: Point) -> int:
    """The sign of a square root of a number at a conjugate point."""
    if not point.flipped or exponent.denominator != 2 or not isinstance(base, ex.Number):
        return 1
    odd = [ell for k in base.value.as_integer_ratio() for ell, times in modular.prime_factors(k) if times % 2]
    return -1 if len(point.flipped.intersection(odd)) % 2 else 1


def power_value(base: int, exponent: Fraction, prime: int) -> int:
    """base^exponent modulo the prime; SingularPoint for 0 to a negative power."""
    if base == 0 and exponent < 0:
        raise SingularPoint("division by zero modulo the prime")
    return modular.positive_power(base, exponent, prime)


@dataclass(slots=True)
class Expansion:
    """Taylor series about a point in the displacements of `variables`; equal trees are expanded once."""

    point: Point
    variables: Sequence[Variable]
    order: int
    known: dict[ex.Expression, Series] = field(default_factory=dict)
    ring: SeriesRing = field(init=False)

    def __post_init__(self) -> None:
        self.ring = SeriesRing(self.point.prime, len(self.variables), self.order)

    def expand(self, expression: ex.Expression) -> Series:
        """The series of an expression in kernels (see `kernels.to_kernels`)."""
        if expression not in self.known:
            self.known[expression] = self._expand(expression)
        return self.known[expression]

    def _expand(self, expression: ex.Expression) -> Series:
        ring = self.ring
        match expression:
            case ex.Number(value):
                return ring.constant(number_value(value, ring.prime))
            case ex.Symbol() | ex.Velocity():
                return self._variable(expression)
            case ex.Sum(terms):
                total = self.expand(terms[0])
                for term in terms[1:]:
                    total = add(total, self.expand(term))
                return total
            case ex.Product(factors):
                return self._product(factors)
            case ex.Power(base, ex.Number(exponent)):
                found = self._power(self.expand(base), exponent)
                return found if _flip(base, exponent, self.point) > 0 else scale(found, ring.prime - 1)
            case ex.Apply(function, argument):
                return self._apply(expression, function, self.expand(argument))
            case ex.Arbitrary(name, arguments, orders):
                return self._arbitrary(name, [self.expand(argument) for argument in arguments], orders)
        raise TypeError(f"{type(expression).__name__} is not a kernel")

    def _variable(self, name: Variable) -> Series:
        value = self.point.variable(name)
        if name in self.variables:
            return self.ring.variable(self.variables.index(name), value)
        return self.ring.constant(value)

    def _product(self, factors: Sequence[ex.Expression]) -> Series:
        product = self.expand(factors[0])
        for factor in factors[1:]:
            if isinstance(factors[0], ex.Number) and product is self.expand(factors[0]):
                product = scale(self.expand(factor), value_at_point(product))
            else:
                product = multiply(product, self.expand(factor))
        return product

    def _power(self, base: Series, exponent: Fraction) -> Series:
        if exponent.denominator == 1:
            return integer_power(self.ring, base, exponent.numerator)
        start = power_value(value_at_point(base), exponent, self.ring.prime)
        return power(self.ring, base, exponent, start)

    def _apply(self, node: ex.Expression, function: str, argument: Series) -> Series:
        ring, atoms = self.ring, self.point.atoms
        if function in ("sin", "cos"):
            inner = node.argument  # type: ignore[union-attr]
            pair = (atoms[ex.Apply("sin", inner)], atoms[ex.Apply("cos", inner)])
            sine, cosine = sine_cosine(ring, argument, *pair)
            self.known[ex.Apply("sin", inner)], self.known[ex.Apply("cos", inner)] = sine, cosine
            return sine if function == "sin" else cosine
        work = {"exp": exponential, "log": logarithm, "atan": arctangent}[function]
        return work(ring, argument, atoms[node])

    def _arbitrary(self, name: str, arguments: list[Series], orders: tuple[int, ...]) -> Series:
        place = tuple(value_at_point(argument) for argument in arguments)

        def jet(more: tuple[int, ...]) -> int:
            return self.point.jet(name, place, tuple(a + b for a, b in zip(orders, more, strict=True)))

        return compose(self.ring, arguments, jet)
