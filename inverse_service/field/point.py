"""A point over a prime field at which all atoms of a system have consistent random values."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from hashlib import blake2b

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
    walk,
)
from inverse_service.field import truncated_series as ps
from inverse_service.field.modular import is_positive, positive_power, prime_factors
from inverse_service.field.truncated_series import Series, SeriesRing, SingularPoint

Variable = Symbol | Velocity


@dataclass(slots=True)
class Point:
    """Values of variables and atoms modulo `prime`; atoms are added innermost first.

    `signs` gives for a variable the sign of the residue symbol that its value is to have (the sign
    of the variable at the real point that stands for the domain of the answer); `salts` choose
    among the random values of single variables and of the free generators that contain them.
    The square roots of the prime numbers in `flipped` have the other sign: a conjugate of what is meant.
    """

    prime: int
    seed: int
    signs: Mapping[Variable, int] = field(default_factory=dict)
    salts: Mapping[Variable, int] = field(default_factory=dict)
    flipped: frozenset[int] = frozenset()
    variables: dict[Variable, int] = field(default_factory=dict)
    atoms: dict[Expression, int] = field(default_factory=dict)

    def draw(self, key: Hashable) -> int:
        """A random nonzero residue that depends on the seed and the key alone."""
        text = f"{self.seed}|{_text(key)}".encode()
        return int.from_bytes(blake2b(text, digest_size=16).digest()) % (self.prime - 3) + 2

    def draw_free(self, atom: Expression) -> int:
        """A random nonzero residue for a free generator; the salts of its variables change it too."""
        return self.draw((atom, tuple(self.salts.get(name, 0) for name in variables_in(atom))))

    def atom(self, atom: Apply) -> int:
        """The value of a transcendental atom; exp and log of a number need no rule."""
        if atom not in self.atoms and isinstance(atom.argument, Number):
            return constant_value(atom.function, atom.argument.value, self)
        return self.atoms[atom]

    def variable(self, name: Variable) -> int:
        """The value of a coordinate, velocity, parameter, of t, or of pi."""
        if name not in self.variables:
            value = self.draw((name, self.salts.get(name, 0)))
            sign = self.signs.get(name, 0)
            if sign and is_positive(value, self.prime) != (sign > 0):
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
def variables_in(expression: Expression) -> tuple[Variable, ...]:
    """The coordinates, velocities and parameters in a tree, in the order of their first places."""
    return tuple(dict.fromkeys(node for node in walk(expression) if isinstance(node, Symbol | Velocity)))


def constant_value(function: str, value: Fraction, point: Point) -> int:
    """exp(value) or, for a positive value, log(value): e and the logarithms of primes are free constants."""
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


def evaluate(expression: Expression, point: Point, known: dict[Expression, int] | None = None) -> int:
    """The value at the point; SingularPoint where a denominator vanishes, ValueError for a missing root.

    `known` keeps the values found at this point, for trees that share parts.
    """
    known = {} if known is None else known
    value = known.get(expression)
    if value is None:
        known[expression] = value = _evaluate(expression, point, known)
    return value


def _evaluate(expression: Expression, point: Point, known: dict[Expression, int]) -> int:
    prime = point.prime
    match expression:
        case Number(value):
            return number_value(value, prime)
        case Symbol() | Velocity():
            return point.variable(expression)
        case Sum(terms):
            return sum(evaluate(term, point, known) for term in terms) % prime
        case Product(factors):
            product = 1
            for factor in factors:
                product = product * evaluate(factor, point, known) % prime
            return product
        case Power(base, Number(exponent)):
            return _flip(base, exponent, point) * power_value(evaluate(base, point, known), exponent, prime) % prime
        case Apply():
            return point.atom(expression)
        case Arbitrary(name, arguments, orders):
            return point.jet(name, tuple(evaluate(argument, point, known) for argument in arguments), orders)
    raise TypeError(f"{type(expression).__name__} is not a kernel")


def _flip(base: Expression, exponent: Fraction, point: Point) -> int:
    """The sign of a square root of a number at a conjugate point."""
    if not point.flipped or exponent.denominator != 2 or not isinstance(base, Number):
        return 1
    odd = [ell for k in base.value.as_integer_ratio() for ell, times in prime_factors(k) if times % 2]
    return -1 if len(point.flipped.intersection(odd)) % 2 else 1


def power_value(base: int, exponent: Fraction, prime: int) -> int:
    """base^exponent modulo the prime; SingularPoint for 0 to a negative power."""
    if base == 0 and exponent < 0:
        raise SingularPoint("division by zero modulo the prime")
    return positive_power(base, exponent, prime)


@dataclass(slots=True)
class Expansion:
    """Taylor series about a point in the displacements of `variables`; equal trees are expanded once."""

    point: Point
    variables: Sequence[Variable]
    order: int
    known: dict[Expression, Series] = field(default_factory=dict)
    ring: SeriesRing = field(init=False)

    def __post_init__(self) -> None:
        self.ring = SeriesRing(self.point.prime, len(self.variables), self.order)

    def expand(self, expression: Expression) -> Series:
        """The series of an expression in kernels (see `kernels.to_kernels`)."""
        if expression not in self.known:
            self.known[expression] = self._expand(expression)
        return self.known[expression]

    def _expand(self, expression: Expression) -> Series:
        ring = self.ring
        match expression:
            case Number(value):
                return ring.constant(number_value(value, ring.prime))
            case Symbol() | Velocity():
                return self._variable(expression)
            case Sum(terms):
                total = self.expand(terms[0])
                for term in terms[1:]:
                    total = ps.add(total, self.expand(term))
                return total
            case Product(factors):
                return self._product(factors)
            case Power(base, Number(exponent)):
                found = self._power(self.expand(base), exponent)
                return found if _flip(base, exponent, self.point) > 0 else ps.scale(found, ring.prime - 1)
            case Apply(function, argument):
                return self._apply(expression, function, self.expand(argument))
            case Arbitrary(name, arguments, orders):
                return self._arbitrary(name, [self.expand(argument) for argument in arguments], orders)
        raise TypeError(f"{type(expression).__name__} is not a kernel")

    def _variable(self, name: Variable) -> Series:
        value = self.point.variable(name)
        if name in self.variables:
            return self.ring.variable(self.variables.index(name), value)
        return self.ring.constant(value)

    def _product(self, factors: Sequence[Expression]) -> Series:
        product = self.expand(factors[0])
        for factor in factors[1:]:
            if isinstance(factors[0], Number) and product is self.expand(factors[0]):
                product = ps.scale(self.expand(factor), ps.value_at_point(product))
            else:
                product = ps.multiply(product, self.expand(factor))
        return product

    def _power(self, base: Series, exponent: Fraction) -> Series:
        if exponent.denominator == 1:
            return ps.integer_power(self.ring, base, exponent.numerator)
        start = power_value(ps.value_at_point(base), exponent, self.ring.prime)
        return ps.power(self.ring, base, exponent, start)

    def _apply(self, node: Expression, function: str, argument: Series) -> Series:
        ring, atoms = self.ring, self.point.atoms
        if function in ("sin", "cos"):
            inner = node.argument  # type: ignore[union-attr]
            pair = (atoms[Apply("sin", inner)], atoms[Apply("cos", inner)])
            sine, cosine = ps.sine_cosine(ring, argument, *pair)
            self.known[Apply("sin", inner)], self.known[Apply("cos", inner)] = sine, cosine
            return sine if function == "sin" else cosine
        work = {"exp": ps.exponential, "log": ps.logarithm, "atan": ps.arctangent}[function]
        return work(ring, argument, atoms[node])

    def _arbitrary(self, name: str, arguments: list[Series], orders: tuple[int, ...]) -> Series:
        place = tuple(ps.value_at_point(argument) for argument in arguments)

        def jet(more: tuple[int, ...]) -> int:
            return self.point.jet(name, place, tuple(a + b for a, b in zip(orders, more, strict=True)))

        return ps.compose(self.ring, arguments, jet)
