"""Trees as fractions of polynomials over Q in independent generators, to factor what stands under roots.

Generators are the variables, e^(u/m) for free exponentials, tan(phi/2m) for free angles (sin and
cos are rational in it), the other free atoms, and roots of irreducible factors. Without roots the
generators are algebraically independent and the ring is factorial, which is what the factors are
used for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from flint import Ordering, fmpq, fmpq_mpoly, fmpq_mpoly_ctx

from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import (
    PI,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    apply,
    multiply,
    number,
)
from inverse_service.field.modular import prime_factors
from inverse_service.field.rational_functions import TooLarge, factored
from inverse_service.field.rules import RADIAN, AngleRule, ArctangentRule, ExponentialRule, LogarithmRule, half_angle
from inverse_service.field.tower import Tower

_MOST_TERMS = 3_000
# Of an angle under a root: its sine has twice this degree in the tangent of the half angle.
_LARGEST_MULTIPLE = 24


@dataclass(frozen=True, slots=True)
class Quotient:
    """numerator / denominator, not reduced."""

    numerator: fmpq_mpoly
    denominator: fmpq_mpoly


@dataclass(slots=True)
class Generators:
    """A growing list of generators (as trees) and the polynomial ring over them.

    Where `opaque`, functions and roots are generators as they stand, whatever relations they have.
    """

    tower: Tower
    trees: list[Expression] = field(default_factory=list)
    squares: dict[Expression, Expression] = field(default_factory=dict)
    capacity: int = 48
    opaque: bool = False

    @property
    def context(self) -> fmpq_mpoly_ctx:
        return fmpq_mpoly_ctx.get(tuple(f"g{k}" for k in range(self.capacity)), Ordering.degrevlex)

    def generator(self, tree: Expression) -> fmpq_mpoly:
        if tree not in self.trees:
            if len(self.trees) == self.capacity:
                raise IrreducibleAtoms("too many different atoms stand under roots")
            self.trees.append(tree)
        return self.context.gen(self.trees.index(tree))

    def constant(self, value: Fraction) -> fmpq_mpoly:
        return self.context.constant(fmpq(value.numerator, value.denominator))

    def tree_of(self, polynomial: fmpq_mpoly) -> Expression:
        """The polynomial as a tree."""
        parts = []
        for exponents, coefficient in polynomial.to_dict().items():
            factors = [self.trees[k] ** int(e) for k, e in enumerate(exponents) if e]
            parts.append(multiply(number(Fraction(int(coefficient.p), int(coefficient.q))), *factors))
        return add(*parts)

    def sign(self, factor: Expression) -> int:
        """The sign of an irreducible factor at the real point, as far as branches are fixed by now."""
        if isinstance(factor, Symbol | Velocity):
            return self.tower.real_signs.get(factor, 1)
        return next((sign for known, sign in self.tower.signs if known == factor), 1)

    def has_roots(self, polynomial: fmpq_mpoly) -> bool:
        return any(self.trees[k] in self.squares for k in used_generators(polynomial))


def used_generators(polynomial: fmpq_mpoly) -> list[int]:
    return [k for k, degree in enumerate(polynomial.degrees()) if degree > 0]


def factors(polynomial: fmpq_mpoly) -> tuple[Fraction, list[tuple[fmpq_mpoly, int]]]:
    """(rational content, [(irreducible factor, multiplicity)]); IrreducibleAtoms where it grows out of bounds."""
    try:
        return factored(polynomial)
    except TooLarge as error:
        raise IrreducibleAtoms(str(error)) from error


def to_quotient(ring: Generators, expression: Expression) -> Quotient:
    """The tree (in kernels) over the generators; IrreducibleAtoms where it grows out of bounds."""
    result = _to_quotient(ring, expression)
    if max(len(result.numerator), len(result.denominator)) > _MOST_TERMS:
        raise IrreducibleAtoms("an expression under a root is too large to be factored")
    return result


def _to_quotient(ring: Generators, expression: Expression) -> Quotient:
    one = ring.constant(Fraction(1))
    match expression:
        case Number(value):
            return Quotient(ring.constant(value), one)
        case Symbol() | Velocity() | Arbitrary():
            return Quotient(ring.generator(expression), one)
        case Sum(terms):
            return _sum(ring, [to_quotient(ring, term) for term in terms])
        case Product(parts):
            return _product(ring, [to_quotient(ring, part) for part in parts])
        case Power(base, Number(exponent)) if exponent.denominator == 1:
            return _integer_power(to_quotient(ring, base), int(exponent))
        case _ if ring.opaque:
            return Quotient(ring.generator(expression), one)
        case Power(base, Number(exponent)):
            return _root(ring, base, exponent)
        case Apply():
            return _atom(ring, expression)
    raise TypeError(f"{type(expression).__name__} is not a kernel")


def _sum(ring: Generators, parts: list[Quotient]) -> Quotient:
    total = parts[0]
    for part in parts[1:]:
        if total.denominator == part.denominator:
            total = Quotient(total.numerator + part.numerator, total.denominator)
        else:
            total = Quotient(
                total.numerator * part.denominator + part.numerator * total.denominator,
                total.denominator * part.denominator,
            )
    return Quotient(reduce_roots(ring, total.numerator), total.denominator)


def _product(ring: Generators, parts: list[Quotient]) -> Quotient:
    numerator = denominator = ring.constant(Fraction(1))
    for part in parts:
        numerator, denominator = numerator * part.numerator, denominator * part.denominator
    return Quotient(reduce_roots(ring, numerator), reduce_roots(ring, denominator))


def _integer_power(base: Quotient, exponent: int) -> Quotient:
    if exponent < 0:
        return Quotient(base.denominator ** (-exponent), base.numerator ** (-exponent))
    return Quotient(base.numerator**exponent, base.denominator**exponent)


def _root(ring: Generators, base: Expression, exponent: Fraction) -> Quotient:
    """prod p_i^(k_i exponent) over the irreducible factors of the base; under even roots all |p_i|."""
    quotient = to_quotient(ring, base)
    even = exponent.denominator % 2 == 0
    sign = 1 if even else _content_sign(quotient) ** exponent.numerator
    result = Quotient(ring.constant(Fraction(sign)), ring.constant(Fraction(1)))
    for tree, multiplicity in positive_factors(ring, quotient):
        positive = -tree if even and ring.sign(tree) < 0 else tree
        result = _product(ring, [result, _root_power(ring, positive, exponent * multiplicity)])
    return result


def _content_sign(quotient: Quotient) -> int:
    contents = [factors(polynomial)[0] for polynomial in (quotient.numerator, quotient.denominator)]
    return -1 if (contents[0] < 0) != (contents[1] < 0) else 1


def positive_factors(ring: Generators, quotient: Quotient) -> Iterator[tuple[Expression, int]]:
    """Irreducible factors (primes of the content first) of numerator and denominator, as trees."""
    for polynomial, side in ((quotient.numerator, 1), (quotient.denominator, -1)):
        content, found = factors(polynomial)
        for value, way in ((abs(content.numerator), 1), (content.denominator, -1)):
            yield from ((number(ell), side * way * k) for ell, k in prime_factors(value))
        yield from ((ring.tree_of(factor), side * k) for factor, k in found)


def _root_power(ring: Generators, base: Expression, exponent: Fraction) -> Quotient:
    """base^exponent with a generator for the root of smallest denominator."""
    whole = math.floor(exponent)
    part = exponent - whole
    result = _integer_power(_to_quotient(ring, base), whole)
    if part:
        root = base ** Fraction(1, part.denominator)
        if part.denominator == 2:
            ring.squares[root] = base
        else:
            ring.squares.setdefault(root, root)
        generator = ring.generator(root) ** part.numerator
        result = Quotient(result.numerator * generator, result.denominator)
    return result


def reduce_roots(ring: Generators, polynomial: fmpq_mpoly) -> fmpq_mpoly:
    """r^2 replaced by its radicand for generators r that are square roots of polynomials."""
    for k in used_generators(polynomial):
        tree = ring.trees[k]
        square = ring.squares.get(tree)
        if square is None or square == tree or polynomial.degrees()[k] < 2:
            continue
        radicand = _to_quotient(ring, square)
        low, high = split_square(ring, polynomial, k)
        while high:
            polynomial = low + reduce_roots(ring, high * radicand.numerator)
            low, high = split_square(ring, polynomial, k)
    return polynomial


def split_square(ring: Generators, polynomial: fmpq_mpoly, k: int) -> tuple[fmpq_mpoly, fmpq_mpoly]:
    """(low, high) with polynomial = low + r^2 high, low of degree <= 1 in generator k."""
    low: dict[tuple[int, ...], fmpq] = {}
    high: dict[tuple[int, ...], fmpq] = {}
    for exponents, coefficient in polynomial.to_dict().items():
        if exponents[k] < 2:
            low[exponents] = coefficient
        else:
            high[(*exponents[:k], exponents[k] - 2, *exponents[k + 1 :])] = coefficient
    return ring.context.from_dict(low), ring.context.from_dict(high)


def _atom(ring: Generators, atom: Apply) -> Quotient:
    one = ring.constant(Fraction(1))
    for rule in ring.tower.rules:
        if isinstance(rule, AngleRule):
            if rule.angle == atom.argument and atom.function in ("sin", "cos"):
                cosine, sine = _sine_cosine(ring, rule)
                return sine if atom.function == "sin" else cosine
        elif rule.atom == atom:
            if isinstance(rule, ExponentialRule) and not rule.free:
                return _dependent_exponential(ring, rule)
            if isinstance(rule, LogarithmRule | ArctangentRule) and not rule.free:
                return _linear(ring, rule)
    return Quotient(ring.generator(atom), one)


def _dependent_exponential(ring: Generators, rule: ExponentialRule) -> Quotient:
    parts = [_root_power(ring, atom, a) for atom, a in rule.exponentials]
    parts += [_root(ring, argument, a) for argument, a in rule.arguments_of_logarithms]
    parts += [_root_power(ring, number(ell), a) for ell, a in rule.prime_powers]
    if rule.constant:
        parts.append(Quotient(ring.generator(apply("exp", number(rule.constant))), ring.constant(Fraction(1))))
    return _product(ring, parts)


def _linear(ring: Generators, rule: LogarithmRule | ArctangentRule) -> Quotient:
    parts = [to_quotient(ring, a * u) for u, a in rule.linear]
    if isinstance(rule, ArctangentRule):
        parts.append(to_quotient(ring, rule.turns * PI))
    else:
        parts.append(_constant_logarithm(ring, rule))
    return _sum(ring, parts)


def _constant_logarithm(ring: Generators, rule: LogarithmRule) -> Quotient:
    total = ring.constant(Fraction(0))
    for value, way in ((rule.constant.numerator, 1), (rule.constant.denominator, -1)):
        for ell, k in prime_factors(value):
            total += ring.generator(apply("log", number(ell))) * ring.constant(Fraction(way * k, rule.root))
    return Quotient(total, ring.constant(Fraction(1)))


def _sine_cosine(ring: Generators, rule: AngleRule) -> tuple[Quotient, Quotient]:
    """(cos, sin) as fractions in tan(half angle)."""
    if rule.turns or rule.arctangents:
        raise IrreducibleAtoms("an angle with pi or an arctangent stands under a root")
    one = ring.constant(Fraction(1))
    real, imaginary, denominator = one, one * 0, one
    steps: Mapping[Expression, Fraction] = {rule.angle: Fraction(1)} if rule.free else dict(rule.angles)
    if rule.radians:
        steps = {**steps, RADIAN: rule.radians}
    for angle, factor in steps.items():
        scale = ring.tower.scale(angle)
        t = ring.generator(half_angle(angle, scale))
        count = int(factor * scale)
        if abs(count) > _LARGEST_MULTIPLE:
            raise IrreducibleAtoms("an angle under a root is too large a multiple of another to be reduced")
        c, s = one - t * t, t * (2 if count > 0 else -2)
        for _ in range(abs(count)):
            real, imaginary = real * c - imaginary * s, real * s + imaginary * c
        denominator *= (one + t * t) ** abs(count)
    return Quotient(real, denominator), Quotient(imaginary, denominator)
