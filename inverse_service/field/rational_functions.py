"""Exact quotients N / (D_1^e_1 ... D_m^e_m) over Q in generators with simple algebraic relations.

A `QuotientField` holds a fixed supply of generators (lexicographic order, the first one greatest)
and two growing lists: monic relations g^q = P, P in smaller generators (a root, sin^2 = 1 - cos^2),
and denominators. Denominators are never multiplied out: a derivation only raises exponents of known
ones, so trial division replaces the gcd, which dominates for n = 4 systems when fractions are kept
expanded (Phi, nabla Phi and R of a rational n = 4 system: about 20 ms).

The relations have coprime leading terms g^q, so they are a Groebner basis and the remainder decides
zero whenever the ideal is prime; where atoms have relations that were not found, zero may go
unrecognised but every identity stays true.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from flint import Ordering, fmpq, fmpq_mpoly, fmpq_mpoly_ctx
from flint.utils.flint_exceptions import DomainError

from inverse_service.deadline import end, now

Exponents = tuple[tuple[int, int], ...]


class TooLarge(ArithmeticError):
    """A computation passed its budget of terms or of time; its text is the reason for the reader."""


# What a step costs besides its terms.
_WORK_OF_A_STEP = 20
# In one variable, of a polynomial that is factored: at 400 that takes 0.2 s at most, at 800 half a minute.
LARGEST_DEGREE = 500


@dataclass(frozen=True, slots=True)
class Relation:
    """g^degree = right-hand side, for the generator of this index."""

    generator: int
    degree: int
    right: fmpq_mpoly


@dataclass(slots=True)
class Budget:
    """How large one polynomial may become, until when (`now`) work may go on, and how much of it.

    `work` counts the terms of all polynomials together, so it ends at the same place on every machine.
    """

    terms: int = 20_000
    deadline: float = float("inf")
    work: float = float("inf")
    done: int = 0

    @classmethod
    def short(cls) -> Budget:
        """For a step among many that may be left out, within the time set outside: what is longer is no help."""
        return cls(500, end(), 75_000)

    @classmethod
    def long(cls) -> Budget:
        """For a step without which a whole way of searching ends, within the time set outside."""
        return cls(4_000, end(), 150_000)

    def charge(self, terms: int) -> None:
        """Raise TooLarge where a polynomial of about so many terms is beyond the budget."""
        self.done += terms + _WORK_OF_A_STEP
        if terms > self.terms:
            raise TooLarge(f"an expression would have more than {self.terms} terms")
        if self.done > self.work:
            raise TooLarge("the work for exact expressions is used up")
        if now() > self.deadline:
            raise TooLarge("the time for exact expressions is used up")


@dataclass(slots=True)
class QuotientField:
    """The generators' polynomial ring, their relations, and the denominators met so far."""

    context: fmpq_mpoly_ctx
    relations: dict[int, Relation] = field(default_factory=dict)
    denominators: list[fmpq_mpoly] = field(default_factory=list)
    budget: Budget = field(default_factory=Budget)

    @classmethod
    def with_generators(cls, size: int, budget: Budget | None = None) -> QuotientField:
        """A field with `size` generators and no relation yet."""
        names = tuple(f"g{index}" for index in range(max(size, 1)))
        return cls(fmpq_mpoly_ctx.get(names, Ordering.lex), budget=budget or Budget())

    def constant(self, value: int | Fraction) -> Quotient:
        fraction = Fraction(value)
        return Quotient(self, self.context.constant(fmpq(fraction.numerator, fraction.denominator)), ())

    def generator(self, index: int) -> Quotient:
        return Quotient(self, self.context.gen(index), ())

    def relate(self, generator: int, degree: int, right: fmpq_mpoly) -> None:
        """Impose g^degree = right; right must hold smaller generators (larger indices) only."""
        used = [index for index, power in enumerate(right.degrees()) if power]
        if any(index <= generator for index in used):
            raise ValueError("a relation must reduce a generator to smaller ones")
        self.relations[generator] = Relation(generator, degree, right)

    def reduce(self, polynomial: fmpq_mpoly) -> fmpq_mpoly:
        """The remainder modulo the relations, greatest generator first."""
        for index in sorted(self.relations):
            relation = self.relations[index]
            if not polynomial.is_zero() and polynomial.degrees()[index] >= relation.degree:
                self.budget.charge(len(polynomial))
                polynomial = polynomial % (self.context.gen(index) ** relation.degree - relation.right)
        return polynomial

    def product(self, left: fmpq_mpoly, right: fmpq_mpoly) -> fmpq_mpoly:
        """The reduced product; charged before it is formed, at a tenth of the worst case."""
        if len(left) > 1 and len(right) > 1:
            self.budget.charge(len(left) * len(right) // 10)
        return self.reduce(left * right)

    def denominator_powers(self, polynomial: fmpq_mpoly) -> tuple[Fraction, Exponents]:
        """polynomial = constant * product of listed denominators, new irreducible ones being listed.

        Radicands (1 - cos^2 among them) become powers of their generator before anything is factored.
        """
        self.budget.charge(20 * len(polynomial))
        table = dict[int, int]()
        for relation in self.relations.values():
            polynomial, power = divided_out(polynomial, relation.right)
            if power:
                table[self._index_of(self.context.gen(relation.generator))] = power * relation.degree
        constant, factors = factored(polynomial)
        for factor, power in factors:
            scale, index = self._listed(factor)
            constant *= scale**power
            table[index] = table.get(index, 0) + power
        return constant, tuple(sorted(table.items()))

    def _listed(self, factor: fmpq_mpoly) -> tuple[Fraction, int]:
        """(constant, index) with factor = constant * D_index."""
        for index, known in enumerate(self.denominators):
            ratio = _constant_ratio(factor, known)
            if ratio is not None:
                return ratio, index
        return Fraction(1), self._index_of(factor)

    def _index_of(self, denominator: fmpq_mpoly) -> int:
        for index, known in enumerate(self.denominators):
            if known == denominator:
                return index
        self.denominators.append(denominator)
        return len(self.denominators) - 1

    def expand(self, exponents: Exponents) -> fmpq_mpoly:
        """The product D^e, multiplied out (used to bring fractions to one denominator)."""
        result = self.context.constant(1)
        for index, power in exponents:
            self.budget.charge(power)  # a step costs something even where a monomial is multiplied
            for _ in range(power):
                result = self.product(result, self.denominators[index])
        return result

    def quotient(self, numerator: fmpq_mpoly, exponents: Exponents) -> Quotient:
        """numerator / D^exponents, cancelled by trial division."""
        if numerator.is_zero():
            return Quotient(self, numerator, ())
        remaining = []
        for index, power in exponents:
            while power:
                smaller = self._divided(numerator, self.denominators[index])
                if smaller is None:
                    break
                numerator, power = smaller, power - 1
            if power:
                remaining.append((index, power))
        return Quotient(self, numerator, tuple(remaining))

    def _divided(self, numerator: fmpq_mpoly, denominator: fmpq_mpoly) -> fmpq_mpoly | None:
        """numerator / denominator where it is a polynomial, by the relation g^q = P if D is g."""
        exact = _exact_division(numerator, denominator)
        relation = self._relation_of(denominator)
        if exact is not None or relation is None:
            return exact
        lowest = numerator.subs({relation.generator: 0})
        without = _exact_division(lowest, relation.right)
        if without is None:
            return None
        root = self.context.gen(relation.generator)
        return without * root ** (relation.degree - 1) + (numerator - lowest) / root

    def _relation_of(self, denominator: fmpq_mpoly) -> Relation | None:
        for relation in self.relations.values():
            if denominator == self.context.gen(relation.generator):
                return relation
        return None


def as_fraction(value: fmpq) -> Fraction:
    return Fraction(int(value.p), int(value.q))


def factored(polynomial: fmpq_mpoly) -> tuple[Fraction, list[tuple[fmpq_mpoly, int]]]:
    """(rational content, [(irreducible factor, multiplicity)]); TooLarge where exponents are too large for flint.

    x^4001 - x takes it minutes: what remains without the product of powers of the generators has a bounded degree.
    """
    lowest = polynomial.term_content().degrees() if len(polynomial) > 1 else polynomial.degrees()
    if any(high - low > LARGEST_DEGREE for high, low in zip(polynomial.degrees(), lowest, strict=True)):
        raise TooLarge("the degree of a polynomial is too large to factor it")
    try:
        content, found = polynomial.factor()
    except RuntimeError as error:
        raise TooLarge("the degrees of a polynomial are too large to factor it") from error
    return as_fraction(content), [(factor, int(power)) for factor, power in found]


def _exact_division(numerator: fmpq_mpoly, denominator: fmpq_mpoly) -> fmpq_mpoly | None:
    try:
        return numerator / denominator
    except DomainError:
        return None


def divided_out(polynomial: fmpq_mpoly, factor: fmpq_mpoly) -> tuple[fmpq_mpoly, int]:
    """polynomial = rest * factor^power, power greatest; power 0 for a constant factor, and for 0, which has all."""
    power = 0
    if factor.is_constant() or not polynomial:
        return polynomial, power
    while (smaller := _exact_division(polynomial, factor)) is not None:
        polynomial, power = smaller, power + 1
    return polynomial, power


def coefficients_of(polynomial: fmpq_mpoly, generators: Sequence[int]) -> dict[tuple[int, ...], fmpq_mpoly]:
    """What stands in a polynomial with each product of powers of some generators, by the exponents of these."""
    tables: dict[tuple[int, ...], dict[tuple[int, ...], fmpq]] = {}
    for exponents, value in polynomial.terms():
        rest = [int(e) for e in exponents]
        for index in generators:
            rest[index] = 0
        tables.setdefault(tuple(int(exponents[index]) for index in generators), {})[tuple(rest)] = value
    return {powers: polynomial.context().from_dict(table) for powers, table in tables.items()}


def _constant_ratio(left: fmpq_mpoly, right: fmpq_mpoly) -> Fraction | None:
    """left / right where that is a number."""
    if len(left) != len(right) or left.is_zero():
        return None
    ratio = left.leading_coefficient() / right.leading_coefficient()
    return as_fraction(ratio) if left == right * ratio else None


@dataclass(frozen=True, slots=True, eq=False)
class Quotient:
    """numerator / product of denominators[index] ** power; normal form of `QuotientField`."""

    field: QuotientField
    numerator: fmpq_mpoly
    exponents: Exponents

    @property
    def is_zero(self) -> bool:
        return bool(self.numerator.is_zero())

    @property
    def constant_value(self) -> Fraction | None:
        """The value where it is a rational number."""
        if self.exponents or not self.numerator.is_constant():
            return None
        return Fraction(0) if self.is_zero else as_fraction(self.numerator.leading_coefficient())

    def __add__(self, other: Quotient) -> Quotient:
        if self.is_zero or other.is_zero:
            return other if self.is_zero else self
        if self.exponents == other.exponents:
            return self.field.quotient(self.numerator + other.numerator, self.exponents)
        common = _maximum(self.exponents, other.exponents)
        left, right = (
            self.field.product(part.numerator, self.field.expand(_difference(common, part.exponents)))
            for part in (self, other)
        )
        self.field.budget.charge(len(left) + len(right))
        return self.field.quotient(left + right, common)

    def __neg__(self) -> Quotient:
        return Quotient(self.field, -self.numerator, self.exponents)

    def __sub__(self, other: Quotient) -> Quotient:
        return self + (-other)

    def __mul__(self, other: Quotient) -> Quotient:
        if self.is_zero or other.is_zero:
            return self if self.is_zero else other
        product = self.field.product(self.numerator, other.numerator)
        return self.field.quotient(product, combined(self.exponents, other.exponents))

    def parts(self, generators: Sequence[int]) -> dict[tuple[int, ...], Quotient]:
        """The sum of terms of the numerator that hold the same powers of some generators, for each of these."""
        found, gen = {}, self.field.context.gen
        for powers, part in coefficients_of(self.numerator, generators).items():
            for index, power in zip(generators, powers, strict=True):
                part = part * gen(index) ** power
            found[powers] = self.field.quotient(part, self.exponents)
        return found

    def scaled(self, factor: int | Fraction) -> Quotient:
        """factor times self, factor a rational number."""
        if not factor:
            return self.field.constant(0)
        fraction = Fraction(factor)
        return Quotient(self.field, self.numerator * fmpq(fraction.numerator, fraction.denominator), self.exponents)

    def inverse(self) -> Quotient:
        """1/self; ZeroDivisionError for 0."""
        if self.is_zero:
            raise ZeroDivisionError("division by an expression that is identically zero")
        constant, powers = self.field.denominator_powers(self.numerator)
        return self.field.quotient(self.field.expand(self.exponents), powers).scaled(1 / constant)

    def __truediv__(self, other: Quotient) -> Quotient:
        return self * other.inverse()

    def __pow__(self, exponent: int) -> Quotient:
        if exponent < 0:
            return self.inverse() ** -exponent
        result = self.field.constant(1)
        for digit in bin(exponent)[2:]:
            result = result * result
            if digit == "1":
                result = result * self
        return result


def combined(left: Exponents, right: Exponents) -> Exponents:
    """The exponents of a product."""
    table = dict(left)
    for index, power in right:
        table[index] = table.get(index, 0) + power
    return tuple(sorted(table.items()))


def _maximum(left: Exponents, right: Exponents) -> Exponents:
    table = dict(left)
    for index, power in right:
        table[index] = max(table.get(index, 0), power)
    return tuple(sorted(table.items()))


def _difference(left: Exponents, right: Exponents) -> Exponents:
    table = dict(right)
    return tuple((index, power - table.get(index, 0)) for index, power in left if power > table.get(index, 0))


def common_factor(coefficients: Sequence[Quotient]) -> Quotient:
    """A quotient by which all can be divided, so that polynomials without a common factor remain."""
    owner = coefficients[0].field
    numerator = functools.reduce(lambda a, b: a.gcd(b), (c.numerator for c in coefficients))
    worst: dict[int, int] = {}
    for coefficient in coefficients:
        for index, power in coefficient.exponents:
            worst[index] = max(worst.get(index, 0), power)
    content = owner.quotient(numerator, tuple(sorted(worst.items())))
    leading = coefficients[0] / content
    number = leading.constant_value
    return content if number is None else content.scaled(number)
