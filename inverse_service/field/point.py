"""Points over a prime field with consistent random values of all atoms of a system."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from hashlib import blake2b

from inverse_service.expressions import derivative, tree as ex
from inverse_service.field import modular

Variable = ex.Symbol | ex.Velocity


class SingularPoint(ArithmeticError):
    """A division by 0 or by a series without constant term, because the point is not generic."""


@dataclass(slots=True)
class Point:
    """Values of variables and atoms modulo `prime`; atoms are added innermost first.

    `signs` maps a variable to the required residue symbol of its value (the sign of the variable at the real point that
    represents the domain of the answer). `salts` select other random values of single variables and of the free
    generators that contain them. The square roots of the primes in `flipped` have the other sign, which gives a
    conjugate point.
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
        """A random nonzero residue for a free generator; it also depends on the salts of its variables."""
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
            if sign and modular.is_positive(value, self.prime) != (sign > 0):
                value = self.prime - value
            self.variables[name] = value
        return self.variables[name]

    def jet(self, name: str, arguments: tuple[int, ...], orders: tuple[int, ...]) -> int:
        """A partial derivative of an arbitrary function at a place; equal places give equal values."""
        return self.draw((name, arguments, orders))


def _text(key: Hashable) -> str:
    """The text that identifies a key of `Point.draw`; of a tree with salts, only the salts change between points."""
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
    """The value at the point; SingularPoint if a denominator vanishes, ValueError for a missing root.

    `known` caches values at this point, for trees with common parts.
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


def gradient(expression: ex.Expression, variables: Sequence[Variable], point: Point) -> list[int]:
    """The partial derivatives of a tree in kernels at the point."""
    known: dict[ex.Expression, int] = {}
    return [evaluate(derivative.differentiate(expression, x), point, known) for x in variables]


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
