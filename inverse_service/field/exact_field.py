"""The exact field over Q in which a system is differentiated: quotients, derivations, and
conversion from and to trees.

A `QuotientField` has quotients N / (D_1^e_1 ... D_m^e_m) in a fixed supply of generators
(lexicographic order, the first one greatest), and two growing lists: monic relations g^q = P, P in
smaller generators (a root, sin^2 = 1 - cos^2), and denominators. Denominators are never expanded: a
derivation only raises exponents of known ones, so trial division replaces the gcd, which dominates
for n = 4 systems when fractions are expanded (Phi, nabla Phi and R of a rational n = 4 system:
about 20 ms). The relations have coprime leading terms g^q, so they are a Groebner basis, and the
remainder decides zero whenever the ideal is prime. If atoms satisfy undiscovered relations, zero
may remain unrecognized, but every identity found is true.

An `ExactRing` adds the trees of its generators and their derivatives. `quotient_tree` converts an
element to a readable tree: factored, with roots and exponentials merged.

`exact_ring` takes formulas into the field. Their functions become generators, level by level of
nesting; each partial derivative of an arbitrary function is a separate generator. exp(2x) and
exp(x), sin(a - b) and sin a, sin b are dependent because their arguments are: within a level the
arguments of exp, log and the trigonometric functions are first written in a basis over Q, scaled so
that each is an integer combination, which gives independent generators. sin and cos, and sinh and
cosh, are one pair (s, c) for each argument of the basis, with sign = -1 for the trigonometric and
+1 for the hyperbolic one: ds = c du, dc = sign s du, c^2 - sign s^2 = 1. If only the tangent of an
argument occurs, the tangent itself is the generator: dT = (1 - sign T^2) du.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
import operator
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from typing import Any, Literal, NamedTuple

from flint import Ordering, fmpq, fmpq_mat, fmpq_mpoly, fmpq_mpoly_ctx, fmpz
from flint.utils.flint_exceptions import DomainError

from inverse_service.deadline import end, now
from inverse_service.expressions import calculus, functions, jets, tree as ex
from inverse_service.expressions.polynomials import (
    TooLarge as TooLarge,
    as_fraction,
    factor_polynomial,
)

Exponents = tuple[tuple[int, int], ...]
# The cost of a step in addition to its terms.
_WORK_OF_A_STEP = 20
# Larger integer powers raise TooLarge, because their expansion would be unreadable.
LARGEST_EXPONENT = 64
# Beyond this many terms, or this degree, factoring is not worth its cost.
FACTORED_TERMS = 120
FACTORED_DEGREE = 60

# Of a special function in one formula, more than the orders of polygamma.
_MOST_DERIVATIVES = 14
# Numbers of exponents beyond which a polynomial is listed with its own generators alone.
_MANY_EXPONENTS = 300

Family = tuple[str, tuple[ex.Expression, ...]]
Coordinates = Mapping[Any, Fraction]
# The largest multiple of a basis element; powers of a generator are expanded.
_LARGEST_MULTIPLE = 1_000
# sin(k x) is a polynomial of degree k in sin x and cos x.
LARGEST_MULTIPLE = 64


@dataclass(frozen=True, slots=True)
class Relation:
    """g^degree = right-hand side, for the generator g of this index; `whole` is g^degree - right."""

    generator: int
    degree: int
    right: fmpq_mpoly
    root: fmpq_mpoly
    whole: fmpq_mpoly


@dataclass(slots=True)
class Budget:
    """Limits on the size of one polynomial, the time (`now`), and the total work.

    `work` counts the terms of all polynomials, so a computation ends at the same place on every
    machine.
    """

    terms: int = 20_000
    deadline: float = float("inf")
    work: float = float("inf")
    done: int = 0

    @classmethod
    def short(cls) -> Budget:
        """The budget of one optional step among many, within the outer time limit; longer results
        would be useless.
        """
        return cls(500, end(), 75_000)

    @classmethod
    def long(cls) -> Budget:
        """The budget of a step without which a whole search method ends, within the outer time
        limit.
        """
        return cls(4_000, end(), 150_000)

    def charge(self, terms: int) -> None:
        """Raise TooLarge if a polynomial of about `terms` terms exceeds the budget."""
        self.done += terms + _WORK_OF_A_STEP
        if terms > self.terms:
            raise TooLarge(f"an expression would have more than {self.terms} terms")
        if self.done > self.work:
            raise TooLarge("the work for exact expressions is used up")
        self.check_time()

    def check_time(self) -> None:
        """Raise TooLarge after the deadline."""
        if now() > self.deadline:
            raise TooLarge("the time for exact expressions is used up")


@dataclass(slots=True)
class QuotientField:
    """The polynomial ring of the generators, their relations, and the denominators so far."""

    context: fmpq_mpoly_ctx
    relations: dict[int, Relation] = field(default_factory=dict)
    denominators: list[fmpq_mpoly] = field(default_factory=list)
    budget: Budget = field(default_factory=Budget)
    constants: dict[int | Fraction, Quotient] = field(
        default_factory=dict, repr=False, compare=False
    )
    # The relations of denominators, by index, as far as they were asked for.
    roots: dict[int, Relation | None] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def with_generators(cls, size: int, budget: Budget | None = None) -> QuotientField:
        """A field with `size` generators and no relation yet."""
        names = tuple(f"g{index}" for index in range(max(size, 1)))
        return cls(fmpq_mpoly_ctx.get(names, Ordering.lex), budget=budget or Budget())

    def constant(self, value: int | Fraction) -> Quotient:
        found = self.constants.get(value)
        if found is None:
            number = self.context.constant(fmpq(value.numerator, value.denominator))
            found = self.constants[value] = Quotient(self, number, ())
        return found

    def generator(self, index: int) -> Quotient:
        return Quotient(self, self.context.gen(index), ())

    def relate(self, generator: int, degree: int, right: fmpq_mpoly) -> None:
        """Impose g^degree = right; right must contain only smaller generators (larger indices)."""
        used = [index for index, power in enumerate(right.degrees()) if power]
        if any(index <= generator for index in used):
            raise ValueError("a relation must reduce a generator to smaller ones")
        root = self.context.gen(generator)
        whole = root**degree - right
        self.relations[generator] = Relation(generator, degree, right, root, whole)
        self.roots.clear()

    def reduce(self, polynomial: fmpq_mpoly) -> fmpq_mpoly:
        """The remainder modulo the relations, greatest generator first."""
        degrees = polynomial.degrees() if self.relations and polynomial else ()
        for index in sorted(self.relations):
            relation = self.relations[index]
            if degrees and degrees[index] >= relation.degree:
                self.budget.charge(len(polynomial))
                polynomial = polynomial % relation.whole
                degrees = polynomial.degrees() if polynomial else ()
        return polynomial

    def product(self, left: fmpq_mpoly, right: fmpq_mpoly) -> fmpq_mpoly:
        """The reduced product; a tenth of the worst case is charged before it is computed."""
        if len(left) > 1 and len(right) > 1:
            self.budget.charge(len(left) * len(right) // 10)
        elif right.is_one() or left.is_one():
            return left if right.is_one() else right
        return self.reduce(left * right)

    def denominator_powers(self, polynomial: fmpq_mpoly) -> tuple[Fraction, Exponents]:
        """(constant, exponents) with polynomial = constant * product of listed denominators; new
        irreducible ones are added.

        Radicands (1 - cos^2 among them) become powers of their generator before anything is
        factored.
        """
        self.budget.charge(20 * len(polynomial))
        table = dict[int, int]()
        for relation in self.relations.values():
            polynomial, power = divided_out(polynomial, relation.right)
            if power:
                table[self._index_of(self.context.gen(relation.generator))] = (
                    power * relation.degree
                )
        constant, factors = factor_polynomial(polynomial)
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
        """The expanded product D^e (used to bring fractions to one denominator)."""
        result = self.context.constant(1)
        for index, power in exponents:
            base = self.denominators[index]
            if (
                len(base) == 1 and self._relation_of(base) is None
            ):  # exp(t/1000)^999999 is one monomial
                base, power = base**power, 1
            self.budget.charge(power)  # a step has a cost even if a monomial is multiplied
            for _ in range(power):
                result = self.product(result, base)
        return result

    def quotient(self, numerator: fmpq_mpoly, exponents: Exponents) -> Quotient:
        """numerator / D^exponents, canceled by trial division."""
        if numerator.is_zero():
            return Quotient(self, numerator, ())
        remaining = []
        for index, power in exponents:
            while power:
                smaller = self._divided(numerator, index)
                if smaller is None:
                    break
                numerator, power = smaller, power - 1
            if power:
                remaining.append((index, power))
        return Quotient(self, numerator, tuple(remaining))

    def _divided(self, numerator: fmpq_mpoly, index: int) -> fmpq_mpoly | None:
        """numerator / D_index if it is a polynomial, by the relation g^q = P if D_index is g; else
        None.
        """
        exact = _exact_division(numerator, self.denominators[index])
        if exact is not None:
            return exact
        relation = self._relation_at(index)
        if relation is None:
            return None
        lowest = numerator.subs({relation.generator: 0})
        without = _exact_division(lowest, relation.right)
        if without is None:
            return None
        return (
            without * relation.root ** (relation.degree - 1) + (numerator - lowest) / relation.root
        )

    def _relation_at(self, index: int) -> Relation | None:
        """The relation of the generator that the denominator is."""
        if index not in self.roots:
            self.roots[index] = self._relation_of(self.denominators[index])
        return self.roots[index]

    def _relation_of(self, denominator: fmpq_mpoly) -> Relation | None:
        for relation in self.relations.values():
            if denominator == relation.root:
                return relation
        return None


def _exact_division(numerator: fmpq_mpoly, denominator: fmpq_mpoly) -> fmpq_mpoly | None:
    try:
        return numerator / denominator
    except DomainError:
        return None


def divided_out(polynomial: fmpq_mpoly, factor: fmpq_mpoly) -> tuple[fmpq_mpoly, int]:
    """(rest, power) with polynomial = rest * factor^power, power maximal; power 0 for a constant
    factor and for 0.
    """
    power = 0
    if factor.is_constant() or not polynomial:
        return polynomial, power
    while (smaller := _exact_division(polynomial, factor)) is not None:
        polynomial, power = smaller, power + 1
    return polynomial, power


def coefficients_of(
    polynomial: fmpq_mpoly, generators: Sequence[int]
) -> dict[tuple[int, ...], fmpq_mpoly]:
    """The coefficients of a polynomial in some of its generators, keyed by their exponents."""
    tables: dict[tuple[int, ...], dict[tuple[int, ...], fmpq]] = {}
    for exponents, value in polynomial.terms():
        rest = [int(e) for e in exponents]
        for index in generators:
            rest[index] = 0
        tables.setdefault(tuple(int(exponents[index]) for index in generators), {})[tuple(rest)] = (
            value
        )
    return {powers: polynomial.context().from_dict(table) for powers, table in tables.items()}


def coefficient(polynomial: fmpq_mpoly, index: int, power: int) -> fmpq_mpoly:
    """The coefficient of that power of a generator, a polynomial in the others."""
    generator = polynomial.context().gen(index)
    degree = int(polynomial.degrees()[index]) if not polynomial.is_zero() else 0
    while True:
        high = polynomial
        for _ in range(degree):
            high = high.derivative(index)
        high = high / math.factorial(degree)
        if degree <= power or polynomial.is_zero():
            return high if degree == power else high * 0
        polynomial = polynomial - high * generator**degree
        degree = int(polynomial.degrees()[index]) if not polynomial.is_zero() else 0


class Division(NamedTuple):
    """scale P = quotient divisor + rest."""

    scale: fmpq_mpoly
    quotient: fmpq_mpoly
    rest: fmpq_mpoly


def pseudo_division(
    rest: fmpq_mpoly, divisor: fmpq_mpoly, index: int, budget: Budget | None = None
) -> Division:
    """(scale, quotient, rest) with scale * P = quotient * divisor + rest, of lower degree in one
    generator.

    The scale divides a power of the leading coefficient of the divisor.
    """
    degree = divisor.degrees()[index]
    leading, scale, quotient = coefficient(divisor, index, degree), rest * 0 + 1, rest * 0
    while not rest.is_zero() and (top := rest.degrees()[index]) >= degree:
        head = coefficient(rest, index, top)
        common = leading if leading.is_constant() else leading.gcd(head)
        up, step = leading / common, head / common * rest.context().gen(index) ** (top - degree)
        if budget is not None:
            budget.charge(len(rest) * len(up) + len(step) * len(divisor))
        scale, quotient, rest = scale * up, quotient * up + step, rest * up - step * divisor
    return Division(scale, quotient, rest)


def _constant_ratio(left: fmpq_mpoly, right: fmpq_mpoly) -> Fraction | None:
    """left / right if that is a number, else None."""
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

    def __init__(self, field: QuotientField, numerator: fmpq_mpoly, exponents: Exponents) -> None:
        """By the slots, as every operation makes one and `object.__setattr__` takes twice as
        long.
        """
        _set_field(self, field)
        _set_numerator(self, numerator)
        _set_exponents(self, exponents)

    @property
    def is_zero(self) -> bool:
        return bool(self.numerator.is_zero())

    @property
    def constant_value(self) -> Fraction | None:
        """The value if it is a rational number, else None."""
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
            self.field.product(part.numerator, self.field.expand(rest)) if rest else part.numerator
            for part in (self, other)
            for rest in (_difference(common, part.exponents),)
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
        """The sum of the terms with the same powers of some generators, for each combination of
        powers.
        """
        found, gen = {}, self.field.context.gen
        for powers, part in coefficients_of(self.numerator, generators).items():
            for index, power in zip(generators, powers, strict=True):
                part = part * gen(index) ** power
            found[powers] = self.field.quotient(part, self.exponents)
        return found

    def scaled(self, factor: int | Fraction) -> Quotient:
        """factor times self."""
        if not factor:
            return self.field.constant(0)
        fraction = Fraction(factor)
        return Quotient(
            self.field,
            self.numerator * fmpq(fraction.numerator, fraction.denominator),
            self.exponents,
        )

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
        if exponent == 0:
            return self.field.constant(1)
        result = self
        for digit in bin(exponent)[3:]:
            result = result * result
            if digit == "1":
                result = result * self
        return result


_set_field, _set_numerator, _set_exponents = (
    getattr(Quotient, name).__set__ for name in ("field", "numerator", "exponents")
)


def rationalised(quotient: Quotient) -> Quotient:
    """The quotient with each denominator a + b g, g^2 = P, multiplied by a - b g: cos^2/(1 + sin)
    is 1 - sin.
    """
    owner = quotient.field
    for index in sorted(owner.relations):
        for place, _ in quotient.exponents:
            power = dict(quotient.exponents).get(
                place, 0
            )  # none of it is left where a step before has canceled it
            denominator = owner.denominators[place]
            lowest = denominator.subs({index: 0})
            if (
                power
                and owner.relations[index].degree == 2
                and not lowest.is_zero()
                and lowest != denominator
            ):
                conjugate = Quotient(owner, 2 * lowest - denominator, ())
                norm = Quotient(owner, denominator, ()) * conjugate
                without = tuple(item for item in quotient.exponents if item[0] != place)
                quotient = (
                    Quotient(owner, quotient.numerator, without) * (conjugate / norm) ** power
                )
    return quotient


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
    return tuple(
        (index, power - table.get(index, 0)) for index, power in left if power > table.get(index, 0)
    )


def common_divisor(polynomials: Iterable[fmpq_mpoly]) -> fmpq_mpoly:
    """The greatest one."""
    return functools.reduce(lambda a, b: a.gcd(b), polynomials)


def common_factor(coefficients: Sequence[Quotient]) -> Quotient:
    """The quotient that divides all coefficients so that polynomials without a common factor
    remain.
    """
    owner = coefficients[0].field
    numerator = common_divisor(c.numerator for c in coefficients)
    content = owner.quotient(
        numerator, functools.reduce(_maximum, (c.exponents for c in coefficients))
    )
    leading = coefficients[0] / content
    number = leading.constant_value
    return content if number is None else content.scaled(number)


def primitive_vector(vector: Sequence[Quotient]) -> list[Quotient]:
    """The multiple of a nonzero vector that consists of polynomials without a common factor."""
    inverse = common_factor([entry for entry in vector if not entry.is_zero]).inverse()
    return [entry * inverse for entry in vector]


def sum_of(zero: Quotient, terms: Iterable[Quotient]) -> Quotient:
    """The sum; terms with equal denominators are added first, so that few fractions are
    combined.
    """
    groups: dict[Exponents, Quotient] = {}
    for term in terms:
        if not term.is_zero:
            known = groups.get(term.exponents)
            groups[term.exponents] = (
                term
                if known is None
                else Quotient(term.field, known.numerator + term.numerator, term.exponents)
            )
    total = zero
    for exponents, term in groups.items():
        total = total + term.field.quotient(term.numerator, exponents)
    return total


@dataclass(frozen=True, slots=True)
class Derivation:
    """A derivation X, given by its nonzero values X(g) on the generators.

    `undefined` are generators whose derivative was not prepared; differentiating one raises
    TooLarge.
    """

    images: Mapping[int, Quotient]
    undefined: frozenset[int] = frozenset()

    def of_polynomial(self, owner: QuotientField, polynomial: fmpq_mpoly) -> Quotient:
        """X(N) = sum over generators of (dN/dg) X(g)."""
        held = {index for index, degree in enumerate(polynomial.degrees()) if degree > 0}
        if not held.isdisjoint(self.undefined):
            raise TooLarge(
                "a derivative of an arbitrary function beyond the order prepared is needed"
            )
        slopes = ((polynomial.derivative(k), self.images[k]) for k in self.images if k in held)
        return sum_of(
            owner.constant(0), [Quotient(owner, slope, ()) * image for slope, image in slopes]
        )

    def __call__(self, element: Quotient) -> Quotient:
        """X(N/D) = (X(N) - N sum e_i X(D_i)/D_i) / D."""
        owner = element.field
        terms = [self.of_polynomial(owner, element.numerator)]
        for index, exponent in element.exponents:
            slope = self.of_polynomial(owner, owner.denominators[index])
            if not slope.is_zero:
                logarithmic = slope * Quotient(
                    owner, owner.context.constant(-exponent), ((index, 1),)
                )
                terms.append(Quotient(owner, element.numerator, ()) * logarithmic)
        whole = sum_of(owner.constant(0), terms)
        return owner.quotient(whole.numerator, combined(whole.exponents, element.exponents))


@dataclass(slots=True)
class ExactRing:
    """A quotient field whose generators are the atoms of given formulas.

    `variables` are t, coordinates, and velocities; `atoms` maps the tree of each atom to its value;
    `trees[index]` is the tree of generator `index`; `images[k][index]` is its derivative by
    `variables[k]` if the ring has `slopes`; `undefined` are generators whose derivatives exceed the
    requested order; with `plain_powers`, powers of generators are written exp(u)^2 and sqrt(u)^3.
    Generators are assigned from the last index down, so that later ones are greater in the order.
    """

    field: QuotientField
    variables: tuple[ex.Expression, ...]
    free: int
    slopes: bool = True
    plain_powers: bool = False
    atoms: dict[ex.Expression, Quotient] = dataclasses.field(default_factory=dict)
    trees: dict[int, ex.Expression] = dataclasses.field(default_factory=dict)
    images: list[dict[int, Quotient]] = dataclasses.field(default_factory=list)
    undefined: set[int] = dataclasses.field(default_factory=set)
    # The trees of denominators, by index, as far as they were asked for.
    below: dict[int, ex.Expression] = dataclasses.field(default_factory=dict, repr=False)

    def new_generator(self, tree: ex.Expression) -> int:
        """The next unused generator, with this tree."""
        if self.free == 0:
            raise TooLarge("the formulas hold more functions than were counted")
        self.free -= 1
        self.trees[self.free] = tree
        return self.free

    def generator(self, index: int) -> Quotient:
        return self.field.generator(index)

    def constant(self, value: int | Fraction) -> Quotient:
        return self.field.constant(value)

    def set_slopes(self, index: int, slopes: Sequence[tuple[Quotient, Quotient]]) -> None:
        """d(generator) = sum of slope d(argument) over the pairs (slope, argument)."""
        self.set_gradient(index, [(slope, self.gradient(argument)) for slope, argument in slopes])

    def gradient(self, value: Quotient) -> dict[int, Quotient]:
        """The derivatives of the value that are not zero, by places in `variables`; none if the
        ring has no slopes.
        """
        places = range(len(self.variables)) if self.slopes else ()
        found = {place: self.partial(place)(value) for place in places}
        return {place: slope for place, slope in found.items() if not slope.is_zero}

    def set_gradient(
        self, index: int, slopes: Sequence[tuple[Quotient, Mapping[int, Quotient]]]
    ) -> None:
        """d(generator) = sum of slope * gradient over the pairs."""
        self.field.budget.check_time()
        for variable in range(len(self.variables)) if self.slopes else ():
            total = self.constant(0)
            for slope, gradient in slopes:
                if variable in gradient:
                    total = total + slope * gradient[variable]
            if not total.is_zero:
                self.images[variable][index] = total

    def partial(self, variable: int) -> Derivation:
        """The partial derivative by variables[variable]; ValueError if the ring has no slopes."""
        self._need_slopes()
        return Derivation(self.images[variable], frozenset(self.undefined))

    def along(self, components: Sequence[Quotient | None]) -> Derivation:
        """The derivation sum_k components[k] d/d variables[k]; None means 0."""
        self._need_slopes()
        images: dict[int, Quotient] = {}
        for component, table in zip(components, self.images, strict=True):
            if component is None or component.is_zero:
                continue
            for index, image in table.items():
                term = component * image
                images[index] = images[index] + term if index in images else term
        return Derivation(images, frozenset(self.undefined))

    def _need_slopes(self) -> None:
        if not self.slopes:
            raise ValueError("this ring was made without derivatives")

    def value(self, tree: ex.Expression) -> Quotient:
        """The tree as a ring element; ZeroDivisionError for a division by an element that is
        identically zero.
        """
        if tree in self.atoms:
            return self.atoms[tree]
        match tree:
            case ex.Number(value):
                return self.constant(value)
            case ex.Sum(terms):
                return sum_of(self.constant(0), map(self.value, terms))
            case ex.Product(factors):
                return functools.reduce(operator.mul, map(self.value, factors))
            case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1:
                if abs(exponent) > LARGEST_EXPONENT:
                    raise TooLarge(f"a power above {LARGEST_EXPONENT} is not expanded")
                return self.value(base) ** int(exponent)
        raise KeyError(f"{type(tree).__name__} node is not an atom of this ring")


def is_integer_power(tree: ex.Expression) -> bool:
    """Whether the node is a Power with an integer exponent, which needs no generator."""
    return (
        isinstance(tree, ex.Power)
        and isinstance(tree.exponent, ex.Number)
        and tree.exponent.value.denominator == 1
    )


def opaque_ring(
    trees: Iterable[ex.Expression],
    budget: Budget | None = None,
    places: Mapping[ex.Expression, int] | None = None,
) -> ExactRing:
    """A ring that holds the trees, in which symbols, functions, and roots are independent
    generators.

    An identity in it is true, but an element that is not zero may be the zero function. Symbols
    come first, velocities last, each by its number in `places` and then as they appear: so products
    look like R sin(phi) phi'.
    """
    powers = dict(pair for tree in trees for pair in _powers_in(tree))
    atoms = _atoms_of(powers.values())
    roots = {
        atom.base: (atom, atom.exponent.value.denominator)
        for atom in atoms
        if isinstance(atom, ex.Power) and isinstance(atom.exponent, ex.Number)
    }
    known = places or {}
    atoms.sort(key=lambda atom: (_rank(atom), known.get(atom, math.inf)))
    owner = QuotientField.with_generators(len(atoms), budget)
    ring = ExactRing(owner, (), len(atoms), slopes=False, plain_powers=True)
    for atom in reversed(atoms):
        ring.atoms[atom] = ring.generator(ring.new_generator(atom))
    for node, (base, exponent) in powers.items():
        if base in roots and exponent != 1:  # u^-2 beside sqrt(u) is sqrt(u)^-4
            base, degree = roots[base]
            exponent *= degree
        if base in ring.atoms:
            ring.atoms[node] = ring.atoms[base] ** exponent
    return ring


def _powers_in(tree: ex.Expression) -> Iterator[tuple[ex.Expression, tuple[ex.Expression, int]]]:
    """(node, (u, k)) for each node u^k outside of functions and roots; u^(p/q) is the p-th power of
    u^(1/q).
    """
    match tree:
        case ex.Power(base, ex.Number(value)) if value.denominator > 1:
            yield tree, (ex.Power(base, ex.number(Fraction(1, value.denominator))), value.numerator)
        case ex.Power(base, ex.Number(value)):
            yield tree, (base, value.numerator)
            yield from _powers_in(base)
        case ex.Sum() | ex.Product():
            for part in ex.children(tree):
                yield from _powers_in(part)
        case _ if not isinstance(tree, ex.Number):
            yield tree, (tree, 1)


def opaque_atoms(tree: ex.Expression) -> list[ex.Expression]:
    """The symbols, functions, and roots outside of functions and roots, in order of appearance."""
    return _atoms_of(power for _, power in _powers_in(tree))


def _atoms_of(powers: Iterable[tuple[ex.Expression, int]]) -> list[ex.Expression]:
    return [base for base in dict.fromkeys(base for base, _ in powers) if not _is_composed(base)]


def _is_composed(tree: ex.Expression) -> bool:
    return isinstance(tree, ex.Sum | ex.Product | ex.Number) or is_integer_power(tree)


def _rank(atom: ex.Expression) -> int:
    return 0 if isinstance(atom, ex.Symbol) else 2 if isinstance(atom, ex.Velocity) else 1


def add_symbols(ring: ExactRing, symbols: Sequence[ex.Symbol | ex.Velocity]) -> None:
    """One generator for each symbol; the variables among them get derivative 1."""
    ring.images = [{} for _ in ring.variables]
    for symbol in symbols:
        index = ring.new_generator(symbol)
        ring.atoms[symbol] = ring.generator(index)
        if symbol in ring.variables:
            ring.images[ring.variables.index(symbol)][index] = ring.constant(1)


def scaled_tree(tree: ex.Expression, divisor: int) -> ex.Expression:
    """tree / divisor."""
    return tree if divisor == 1 else Fraction(1, divisor) * tree


def quotient_tree(ring: ExactRing, quotient: Quotient) -> ex.Expression:
    """The element as constant * factors / denominators, or a sum of such quotients if that is
    shorter.
    """
    if quotient.is_zero:
        return ex.number(0)
    return ex.add(*(_factored(ring, part) for part in _split_by_roots(ring, quotient)))


def _split_by_roots(ring: ExactRing, quotient: Quotient) -> list[Quotient]:
    """The parts by powers of each root in the denominator: (P + Q r^5)/r^5 = P/r^5 + Q, if that is
    shorter.
    """
    parts = [quotient]
    for index in ring.field.relations:
        root = ring.field.context.gen(index)
        if any(ring.field.denominators[place] == root for place, _ in quotient.exponents):
            parts = [piece for part in parts for _, piece in sorted(part.parts([index]).items())]
    shorter = sum(len(part.numerator) for part in parts) < len(quotient.numerator)
    return parts if shorter else [quotient]


def _factored(ring: ExactRing, quotient: Quotient) -> ex.Expression:
    """constant * factors / denominators, monomials before sums."""
    constant, factors = _factors(ring, quotient.numerator)
    table = dict[ex.Expression, Fraction]()
    for polynomial, exponent in factors:
        _collect(ring, table, polynomial_tree(ring, polynomial), exponent)
    for index, exponent in quotient.exponents:
        if index not in ring.below:
            ring.below[index] = polynomial_tree(ring, ring.field.denominators[index])
        _collect(ring, table, ring.below[index], -exponent)
    rank = {tree: _place(ring, index) for index, tree in ring.trees.items() if tree in table}
    ordered = sorted(
        table.items(),
        key=lambda item: (item[1] < 0, isinstance(item[0], ex.Sum), rank.get(item[0], (3, 0))),
    )
    powers = [(tree, exponent) for tree, exponent in ordered if exponent]
    below = [(tree, -exponent) for tree, exponent in powers if exponent < 0]
    if ring.plain_powers and len(below) > 1:  # 1/(u^a w^a) rather than u^(-a) w^(-a)
        powers = [
            *powers[: -len(below)],
            (ex.multiply(*(tree**exponent for tree, exponent in below)), Fraction(-1)),
        ]
    return ex.multiply(
        ex.number(constant), *(_power(ring, tree, exponent) for tree, exponent in powers)
    )


def factor_trees(ring: ExactRing, quotient: Quotient) -> list[ex.Expression]:
    """The distinct nonconstant factors of the numerator, which determine where the element can
    vanish.
    """
    _, factors = _factors(ring, quotient.numerator)
    return [polynomial_tree(ring, factor) for factor, _ in factors if not factor.is_constant()]


def _factors(
    ring: ExactRing, polynomial: fmpq_mpoly
) -> tuple[Fraction, list[tuple[fmpq_mpoly, int]]]:
    """The constant and the factors; radicands and 1 - cos^2 are taken out whole, as powers of their
    generator.
    """
    found = []
    for relation in ring.field.relations.values():
        polynomial, exponent = divided_out(polynomial, relation.right)
        if exponent:
            found.append((ring.field.context.gen(relation.generator), exponent * relation.degree))
    if len(polynomial) > FACTORED_TERMS or polynomial.total_degree() > FACTORED_DEGREE:
        return Fraction(1), [*found, (polynomial, 1)]
    content, factors = factor_polynomial(polynomial)
    return content, [*found, *factors]


def _collect(
    ring: ExactRing, table: dict[ex.Expression, Fraction], tree: ex.Expression, exponent: int
) -> None:
    """Multiply a power of a factor into the table of trees and exponents."""
    for base, inner in [(tree, Fraction(1))] if ring.plain_powers else ex.powers_of(tree):
        table[base] = table.get(base, Fraction(0)) + inner * exponent


def polynomial_tree(ring: ExactRing, polynomial: fmpq_mpoly) -> ex.Expression:
    """The polynomial as a sum of monomials."""
    degrees = polynomial.degrees()
    held = [index for index, degree in enumerate(degrees) if degree]
    used = (index for index in held if index in ring.trees)
    order = sorted(used, key=lambda index: _place(ring, index))
    powers: dict[tuple[int, int], ex.Expression] = {}
    if len(polynomial) == 1:  # its exponents are its degrees
        value = polynomial.leading_coefficient()
        return _monomial_tree(ring, order, powers, degrees, ex.ratio(int(value.p), int(value.q)))
    places: Mapping[int, int] = {index: index for index in order}
    if len(polynomial) * len(degrees) > _MANY_EXPONENTS:  # of generators that do not occur
        whole, places = polynomial.context(), {index: k for k, index in enumerate(held)}
        small = type(whole).get([f"x{k}" for k in places.values()], whole.ordering())
        there: dict[str | int, str | int] = {index: k for k, index in enumerate(held)}
        polynomial = polynomial.project_to_context(small, there)
    return ex.add(
        *(
            _monomial_tree(ring, order, powers, e, ex.ratio(int(c.p), int(c.q)), places)
            for e, c in polynomial.terms()
        )
    )


def _monomial_tree(
    ring: ExactRing,
    order: Sequence[int],
    powers: dict[tuple[int, int], ex.Expression],
    exponents: Sequence[int],
    coefficient: ex.Number,
    places: Mapping[int, int] | None = None,
) -> ex.Expression:
    """One term; `powers` caches the powers of generators, `places` are theirs in the exponents."""
    parts = []
    for index in order:
        exponent = int(exponents[index if places is None else places[index]])
        if exponent:
            power = powers.get((index, exponent))
            if power is None:
                power = _power(ring, ring.trees[index], Fraction(exponent))
                powers[index, exponent] = power
            parts.append(power)
    return ex.multiply(coefficient, *parts)


def _power(ring: ExactRing, tree: ex.Expression, exponent: Fraction) -> ex.Expression:
    return tree**exponent if ring.plain_powers else generator_power(tree, exponent)


def _place(ring: ExactRing, index: int) -> tuple[int, int]:
    """A sort key: parameters first, then coordinates and velocities, then functions."""
    tree = ring.trees.get(index)
    if isinstance(tree, ex.Symbol) and tree not in ring.variables:
        return (0, index)
    return (1 if tree in ring.variables else 2, index)


def generator_power(tree: ex.Expression, exponent: Fraction) -> ex.Expression:
    """tree ^ exponent, with (u^c)^e = u^(c e) for a root and exp(u)^e = exp(e u)."""
    match tree:
        case ex.Power(base, ex.Number(inner)) if inner.denominator != 1:
            return base ** (inner * exponent)
        case ex.Power(base, inner_exponent) if not isinstance(inner_exponent, ex.Number):
            return base ** (exponent * inner_exponent)
        case ex.Apply("exp", argument):
            return ex.Apply("exp", exponent * argument) if exponent != 1 else tree
    return tree**exponent


def adjoin_arbitrary(ring: ExactRing, nodes: Sequence[ex.Arbitrary], further: int) -> None:
    """Add generators for the functions in `nodes` and for their derivatives of up to `further` more
    orders.

    The derivatives of the highest order are marked undefined, because their derivatives are not in
    the ring.
    """
    families: dict[Family, int] = {}
    for node in nodes:
        if isinstance(node, ex.Integral):
            index = ring.new_generator(node)
            ring.atoms[node] = ring.generator(index)
            ring.undefined.add(index)
            continue
        family = (node.name, node.arguments)
        families[family] = max(families.get(family, 0), sum(node.orders))
    for (name, arguments), order in families.items():
        _adjoin_family(ring, name, arguments, order + further)


def _adjoin_family(
    ring: ExactRing, name: str, arguments: tuple[ex.Expression, ...], highest: int
) -> None:
    values = [ring.value(argument) for argument in arguments]
    gradients = [*map(ring.gradient, values)] if highest else []
    indices: dict[tuple[int, ...], int] = {}
    # From the highest order down, so that lower derivatives are the greater generators.
    every = itertools.product(range(highest + 1), repeat=len(arguments))
    for orders in sorted((k for k in every if sum(k) <= highest), key=lambda k: (-sum(k), k)):
        node = ex.Arbitrary(name, arguments, orders)
        indices[orders] = ring.new_generator(node)
        ring.atoms[node] = ring.generator(indices[orders])
        if sum(orders) == highest:
            ring.undefined.add(indices[orders])
            continue
        slopes = [(_next(ring, indices, orders, place), one) for place, one in enumerate(gradients)]
        ring.set_gradient(indices[orders], slopes)


def _adjoin_special(ring: ExactRing, nodes: Sequence[ex.Expression], further: int) -> None:
    """Add generators for the independent derivatives of special functions."""
    families: dict[Family, int] = {}
    for node in nodes:
        assert isinstance(node, ex.Arbitrary)
        family = (node.name, node.arguments)
        families[family] = max(families.get(family, 0), node.orders[-1])
    chain: list[tuple[int, ex.Arbitrary]] = []  # a generator, and what its derivative is
    for (name, arguments), order in families.items():
        count = functions.FUNCTION[name].jets or order + further + 1
        kernels = [
            functions.special_kernel(name, *arguments, derivative=k) for k in range(count + 1)
        ]
        for node, after in reversed([*pairwise(kernels)]):
            index = ring.new_generator(calculus.special_function(node))
            ring.atoms[node] = ring.generator(index)
            chain.append((index, after))
    for index, after in chain:
        slope = jets.by_independent(after) or after
        try:
            ring.set_slopes(index, [(ring.value(slope), ring.value(after.arguments[-1]))])
        except KeyError:  # beyond the last derivative, or of functions that are not in the ring
            ring.undefined.add(index)


def _next(
    ring: ExactRing, indices: dict[tuple[int, ...], int], orders: tuple[int, ...], place: int
) -> Quotient:
    raised = tuple(order + (position == place) for position, order in enumerate(orders))
    return ring.generator(indices[raised])


def adjoin_roots(ring: ExactRing, powers: Sequence[ex.Power]) -> None:
    """Add generators for rational powers; powers of one base share the root of the common
    denominator.
    """
    degrees: dict[ex.Expression, int] = {}
    for node in powers:
        assert isinstance(node.exponent, ex.Number)
        degrees[node.base] = math.lcm(degrees.get(node.base, 1), node.exponent.value.denominator)
    for base, degree in degrees.items():
        root = root_generator(ring, ring.value(base), base, degree)
        for node in powers:
            if node.base == base and isinstance(node.exponent, ex.Number):
                ring.atoms[node] = root ** int(node.exponent.value * degree)


def root_generator(
    ring: ExactRing, radicand: Quotient, tree: ex.Expression, degree: int
) -> Quotient:
    """An element r with r^degree = radicand; the same radicand gives the same generator.

    For the radicand a/b the generator is b (a/b)^(1/degree), a root of the polynomial a
    b^(degree-1).
    """
    if radicand.is_zero:
        return radicand
    below = Quotient(ring.field, ring.field.expand(radicand.exponents), ())
    polynomial = (Quotient(ring.field, radicand.numerator, ()) * below ** (degree - 1)).numerator
    for relation in ring.field.relations.values():
        if (
            relation.degree % degree == 0
            and relation.right == polynomial
            and _is_root(ring, relation.generator)
        ):
            return ring.generator(relation.generator) ** (relation.degree // degree) / below
    root = tree ** Fraction(1, degree)
    index = ring.new_generator(polynomial_tree(ring, below.numerator) * root)
    ring.field.relate(index, degree, polynomial)
    whole = Quotient(ring.field, polynomial, ())
    ring.set_slopes(index, [(ring.generator(index) / whole.scaled(degree), whole)])
    return ring.generator(index) / below


def _is_root(ring: ExactRing, index: int) -> bool:
    """Whether the generator is a root, not a sine; sqrt(1 - cos^2) is sin up to a sign only."""
    return not isinstance(ring.trees[index], ex.Apply)


def adjoin_inverse(ring: ExactRing, node: ex.Apply) -> None:
    """Add a generator for asin, acos, atan, asinh, acosh, or atanh of an argument."""
    slope = functions.FUNCTION[node.function].slope
    assert slope is not None
    sign, constant, quadratic, exponent = slope
    argument = ring.value(node.argument)
    below = ring.constant(constant) + (argument * argument).scaled(quadratic)
    if exponent.denominator == 2:
        square = node.argument**2
        tree = constant + quadratic * square
        below = root_generator(ring, below, tree, 2)
    index = ring.new_generator(node)
    ring.set_slopes(index, [(below.inverse().scaled(sign), argument)])
    ring.atoms[node] = ring.generator(index)


def exact_ring(
    trees: Sequence[ex.Expression],
    variables: Sequence[ex.Symbol | ex.Velocity],
    orders: int | None,
    budget: Budget,
    further: Sequence[ex.Symbol] = (),
    unused: Literal["dropped", "kept"] = "dropped",
) -> ExactRing:
    """A ring that contains the trees and can differentiate them `orders` times by the variables.

    With None it cannot differentiate, which saves the derivatives of all generators. `further` are
    additional constants that do not occur in the trees. `unused`: what becomes of generators that
    the trees turn out not to need; keeping them avoids building the ring twice for short work.
    Raises TooLarge if the budget is exhausted, and ZeroDivisionError for a division by zero in a
    tree.
    """
    trees = _with_laws(trees) if orders else trees
    symbols = [*further, *_symbols(trees, variables)]
    size = len(symbols) + _generators_needed(trees, orders or 0)
    generous = _build(trees, variables, symbols, orders, budget, size)
    used = len(generous.trees)
    if unused == "kept" or generous.free == 0:
        return generous
    return _build(trees, variables, symbols, orders, budget, used)


def _with_laws(trees: Sequence[ex.Expression]) -> Sequence[ex.Expression]:
    """The trees, and those to which the derivatives of special functions in them lead."""
    special = [
        functions.in_kernels(node)
        for node in ex.distinct_nodes(trees)
        if isinstance(node, ex.Apply) and node.function in functions.SPECIAL
    ]
    return [*trees, *jets.with_laws(special)[len(special) :]] if special else trees


def factored(
    trees: Sequence[ex.Expression], symbols: Sequence[ex.Symbol | ex.Velocity], budget: Budget
) -> list[ex.Expression]:
    """The trees, each over its common denominator with factored numerator and denominator, with all
    relations used.

    The shorter of two forms: denominators with square roots and sines, or without them. TooLarge if
    the budget is exhausted, ZeroDivisionError if a denominator vanishes, KeyError for an unknown
    atom.
    """
    ring = exact_ring(trees, symbols, None, budget, unused="kept")
    return [shortest_tree(ring, ring.value(tree)) for tree in trees]


def shortest_tree(ring: ExactRing, value: Quotient) -> ex.Expression:
    """The tree of the value or, if it is shorter, of the value with a rationalised denominator."""
    plain = rationalised(value)
    trees = (quotient_tree(ring, one) for one in ((value,) if plain is value else (value, plain)))
    return min(trees, key=ex.node_count)


def _build(
    trees: Sequence[ex.Expression],
    variables: Sequence[ex.Symbol | ex.Velocity],
    symbols: Sequence[ex.Symbol | ex.Velocity],
    orders: int | None,
    budget: Budget,
    size: int,
) -> ExactRing:
    owner = QuotientField.with_generators(size, budget)
    ring = ExactRing(owner, tuple(variables), size, slopes=orders is not None)
    add_symbols(ring, symbols)
    names = _occurring(trees)
    for level in _levels(trees):
        _adjoin_level(ring, level, orders or 0, names)
    return ring


def _symbols(
    trees: Sequence[ex.Expression], variables: Sequence[ex.Symbol | ex.Velocity]
) -> list[ex.Symbol | ex.Velocity]:
    """All symbols, with parameters and numbers such as pi last, so that they are smallest in the
    order.
    """
    found = dict.fromkeys(
        node for node in ex.distinct_nodes(trees) if isinstance(node, ex.Symbol | ex.Velocity)
    )
    constants = [symbol for symbol in found if symbol not in variables]
    return constants + list(reversed(variables))


def _occurring(trees: Sequence[ex.Expression]) -> frozenset[str]:
    """The names of the functions in the trees, and "power" for a power with a symbolic exponent."""
    names = set()
    for node in ex.distinct_nodes(trees):
        if isinstance(node, ex.Apply):
            names.add(node.function)
        elif isinstance(node, ex.Power) and not isinstance(node.exponent, ex.Number):
            names.add("power")
    return frozenset(names)


def _is_function(node: ex.Expression) -> bool:
    return isinstance(node, ex.Apply | ex.Arbitrary) or (
        isinstance(node, ex.Power) and not is_integer_power(node)
    )


def _generators_needed(trees: Sequence[ex.Expression], orders: int) -> int:
    """An upper bound of the number of generators; an exact count would require the arguments'
    relations.
    """
    atoms = {node for node in ex.distinct_nodes(trees) if _is_function(node)}
    total = 0
    for node in atoms:
        total += 4
        if isinstance(node, ex.Apply) and node.function in functions.SPECIAL:
            total += orders + _MOST_DERIVATIVES
        if isinstance(node, ex.Arbitrary):
            total += math.comb(len(node.arguments) + sum(node.orders) + orders, len(node.arguments))
    return total


def _levels(trees: Sequence[ex.Expression]) -> list[list[ex.Expression]]:
    """The functions in the trees by nesting level: arguments at level k contain only levels below
    k.
    """
    depth: dict[ex.Expression, int] = {}

    def measure(node: ex.Expression) -> int:
        if node not in depth:
            inside = max(map(measure, ex.children(node)), default=0)
            depth[node] = inside + 1 if _is_function(node) else inside
        return depth[node]

    top = max(map(measure, trees), default=0)
    found = [node for node in depth if _is_function(node)]
    return [[node for node in found if depth[node] == level] for level in range(1, top + 1)]


def _adjoin_level(
    ring: ExactRing, level: Sequence[ex.Expression], orders: int, names: frozenset[str]
) -> None:
    """Add generators for all functions of one level."""
    adjoin_roots(
        ring,
        [
            node
            for node in level
            if isinstance(node, ex.Power) and isinstance(node.exponent, ex.Number)
        ],
    )
    symbolic = [
        node
        for node in level
        if isinstance(node, ex.Power) and not isinstance(node.exponent, ex.Number)
    ]
    _adjoin_logarithms(
        ring, [*_applied(level, {"log"}), *(ex.Apply("log", node.base) for node in symbolic)]
    )
    hyperbolic = _applied(level, functions.HYPERBOLIC)
    by_exponentials = bool(names & {"exp", "power"})
    exponentials = _applied(level, {"exp"}) + (hyperbolic if by_exponentials else [])
    _adjoin_exponentials(ring, exponentials, symbolic)
    adjoin_pairs(ring, _applied(level, functions.CIRCULAR), -1)
    if not by_exponentials:
        adjoin_pairs(ring, hyperbolic, 1)
    for node in _applied(level, functions.INVERSE):
        adjoin_inverse(ring, node)
    arbitrary = [node for node in level if isinstance(node, ex.Arbitrary)]
    adjoin_arbitrary(ring, [node for node in arbitrary if not jets.is_special(node)], orders)
    special = {node: functions.in_kernels(node) for node in _applied(level, functions.SPECIAL)}
    kernels = [node for node in ex.distinct_nodes(special.values()) if jets.is_special(node)]
    _adjoin_special(ring, [*filter(jets.is_special, arbitrary), *kernels], orders)
    ring.atoms |= {node: ring.value(kernel) for node, kernel in special.items()}


def _applied(level: Sequence[ex.Expression], names: Iterable[str]) -> list[ex.Apply]:
    wanted = frozenset(names)
    return [node for node in level if isinstance(node, ex.Apply) and node.function in wanted]


def _adjoin_logarithms(ring: ExactRing, nodes: Sequence[ex.Apply]) -> None:
    """Add generators for logarithms of a basis over Q of the arguments' exponent vectors."""
    nodes = list(dict.fromkeys(node for node in nodes if node not in ring.atoms))
    arguments = [ring.value(node.argument) for node in nodes]
    basis = argument_basis([factor_coordinates(argument) for argument in arguments])
    generators = []
    for place, scale in zip(basis.chosen, basis.scales, strict=True):
        index = ring.new_generator(scaled_tree(nodes[place], scale))
        slope = arguments[place].inverse().scaled(Fraction(1, scale))
        ring.set_slopes(index, [(slope, arguments[place])])
        generators.append(ring.generator(index))
    for node, row in zip(nodes, basis.coefficients, strict=True):
        total = ring.constant(0)
        for generator, coefficient in zip(generators, row, strict=True):
            total = total + generator.scaled(coefficient)
        ring.atoms[node] = total


def _adjoin_exponentials(
    ring: ExactRing, nodes: Sequence[ex.Apply], powers: Sequence[ex.Power]
) -> None:
    """Add generators for exp(u), u^e = exp(e log u), and hyperbolic functions by exp(u); u^(e + 1)
    is u u^e.
    """
    parts = [ex.split_exponent(node.exponent) for node in powers]
    symbolic = [ex.Power(node.base, rest) for node, (rest, _) in zip(powers, parts, strict=True)]
    arguments = [ring.value(node.argument) for node in nodes]
    arguments += [
        ring.value(node.exponent) * ring.value(ex.Apply("log", node.base)) for node in symbolic
    ]
    trees: list[ex.Expression] = [ex.Apply("exp", node.argument) for node in nodes]
    basis = argument_basis([coordinates_of(argument) for argument in arguments])
    generators = []
    for place, scale in zip(basis.chosen, basis.scales, strict=True):
        tree = (trees + symbolic)[place]
        index = ring.new_generator(generator_power(tree, Fraction(1, scale)))
        argument = arguments[place].scaled(Fraction(1, scale))
        ring.set_slopes(index, [(ring.generator(index), argument)])
        generators.append(ring.generator(index))
    functions: list[ex.Apply | ex.Power] = [*nodes, *powers]
    wholes = [*(0 for _ in nodes), *(whole for _, whole in parts)]
    for node, whole, row in zip(functions, wholes, basis.coefficients, strict=True):
        product = ring.constant(1)
        for generator, coefficient in zip(generators, row, strict=True):
            product = product * generator**coefficient
        ring.atoms[node] = (
            _of_exponential(node.function, product)
            if isinstance(node, ex.Apply)
            else product * ring.value(node.base) ** whole
        )


def _of_exponential(function: str, e: Quotient) -> Quotient:
    """exp u, or a hyperbolic function of u, given exp(u)."""
    if function == "exp":
        return e
    other = e.inverse()
    return _of_pair(
        function, Pair((e - other).scaled(Fraction(1, 2)), (e + other).scaled(Fraction(1, 2)))
    )


@dataclass(frozen=True, slots=True)
class ArgumentBasis:
    """Arguments u_k = sum_b coefficients[k][b] * u_(chosen[b]) / scales[b] with integer
    coefficients.
    """

    chosen: tuple[int, ...]
    scales: tuple[int, ...]
    coefficients: tuple[tuple[int, ...], ...]


def coordinates_of(argument: Quotient) -> Coordinates:
    """The argument as a combination of monomials over its denominator."""
    terms = argument.numerator.terms()
    return {(argument.exponents, monomial): as_fraction(value) for monomial, value in terms}


def factor_coordinates(argument: Quotient) -> Coordinates:
    """The exponents of the prime numbers, irreducible numerator factors and denominators."""
    constant, factors = factor_polynomial(argument.numerator)
    table: dict[Any, Fraction] = {(0, repr(factor)): Fraction(power) for factor, power in factors}
    table |= {(1, index): Fraction(-power) for index, power in argument.exponents}
    for sign, value in ((1, abs(constant.numerator)), (-1, constant.denominator)):
        table |= {(2, int(ell)): Fraction(sign * int(power)) for ell, power in fmpz(value).factor()}
    return table


def argument_basis(vectors: Sequence[Coordinates]) -> ArgumentBasis:
    """A basis chosen from the vectors, simplest first."""

    def size(index: int) -> tuple[int, int, int]:
        values = vectors[index].values()
        return len(values), sum(abs(c.numerator) + c.denominator for c in values), index

    order = sorted(range(len(vectors)), key=size)
    chosen: list[int] = []
    expressed: dict[int, list[Fraction]] = {}
    for index in order:
        combination = _solve([vectors[other] for other in chosen], vectors[index])
        if combination is None:
            combination = [Fraction(0)] * len(chosen) + [Fraction(1)]
            chosen.append(index)
        expressed[index] = combination
    rows = [
        expressed[k] + [Fraction(0)] * (len(chosen) - len(expressed[k]))
        for k in range(len(vectors))
    ]
    scales = tuple(
        math.lcm(*(row[column].denominator for row in rows)) for column in range(len(chosen))
    )
    integers = tuple(tuple(int(c * m) for c, m in zip(row, scales, strict=True)) for row in rows)
    if any(abs(k) > _LARGEST_MULTIPLE for row in integers for k in row):
        raise TooLarge(
            "the arguments of exponentials or angles are too large multiples of a common one"
        )
    return ArgumentBasis(tuple(chosen), scales, integers)


def _solve(basis: Sequence[Coordinates], target: Coordinates) -> list[Fraction] | None:
    """Coefficients c with target = sum c_b basis_b for independent basis vectors, or None."""
    keys, size = {key for vector in (*basis, target) for key in vector}, len(basis)
    entries = [
        fmpq(*vector.get(key, Fraction(0)).as_integer_ratio())
        for key in keys
        for vector in (*basis, target)
    ]
    reduced, rank = fmpq_mat(len(keys), size + 1, entries).rref()
    return [as_fraction(reduced[row, size]) for row in range(size)] if rank == size else None


@dataclass(frozen=True, slots=True)
class Pair:
    """(sin u, cos u) or (sinh u, cosh u)."""

    sine: Quotient
    cosine: Quotient


def adjoin_pairs(ring: ExactRing, nodes: Sequence[ex.Apply], sign: int) -> None:
    """Values of the trigonometric (sign -1) or hyperbolic (1) functions in `nodes`; TooLarge for
    large multiples.
    """
    arguments = [ring.value(node.argument) for node in nodes]
    turns = [_quarter_turns(ring, argument) if sign < 0 else 0 for argument in arguments]
    free = [
        argument - _quarters(ring, count) for argument, count in zip(arguments, turns, strict=True)
    ]
    basis = argument_basis([coordinates_of(argument) for argument in free])
    if any(
        abs(coefficient) > LARGEST_MULTIPLE for row in basis.coefficients for coefficient in row
    ):
        raise TooLarge(f"an angle is more than {LARGEST_MULTIPLE} times another one")
    pairs: list[Pair | None] = []
    for column, (place, scale) in enumerate(zip(basis.chosen, basis.scales, strict=True)):
        users = [index for index, row in enumerate(basis.coefficients) if row[column]]
        if _only_tangents(nodes, turns, basis, users):
            _adjoin_tangent(ring, [nodes[index] for index in users], free[place], sign)
            pairs.append(None)
        else:
            plain = nodes[place].argument if not turns[place] else None
            pairs.append(_new_pair(ring, plain, free[place], scale, sign))
    for node, count, row in zip(nodes, turns, basis.coefficients, strict=True):
        if node not in ring.atoms:
            ring.atoms[node] = _of_pair(node.function, _combined(ring, pairs, row, count, sign))


def _quarter_turns(ring: ExactRing, argument: Quotient) -> int:
    """k if the argument contains k pi/2 with an integer k, else 0."""
    if ex.PI not in ring.atoms:
        return 0
    (key,) = coordinates_of(ring.atoms[ex.PI])
    twice = 2 * coordinates_of(argument).get(key, Fraction(0))
    return int(twice) if twice.denominator == 1 else 0


def _quarters(ring: ExactRing, count: int) -> Quotient:
    return ring.atoms[ex.PI].scaled(Fraction(count, 2)) if count else ring.constant(0)


def _only_tangents(
    nodes: Sequence[ex.Apply], turns: Sequence[int], basis: ArgumentBasis, users: Sequence[int]
) -> bool:
    """Whether a basis argument occurs only alone and only under tan and cot (tanh and coth)."""
    return all(
        nodes[index].function in ("tan", "cot", "tanh", "coth")
        and not turns[index]
        and sorted(basis.coefficients[index])[-1] == 1 == sum(map(abs, basis.coefficients[index]))
        for index in users
    )


def _adjoin_tangent(
    ring: ExactRing, nodes: Sequence[ex.Apply], argument: Quotient, sign: int
) -> None:
    name = "tan" if sign < 0 else "tanh"
    index = ring.new_generator(ex.Apply(name, nodes[0].argument))
    tangent = ring.generator(index)
    ring.set_slopes(index, [(ring.constant(1) - (tangent * tangent).scaled(sign), argument)])
    for node in nodes:
        ring.atoms[node] = tangent if node.function == name else tangent.inverse()


def _new_pair(
    ring: ExactRing, plain: ex.Expression | None, argument: Quotient, scale: int, sign: int
) -> Pair:
    """Generators for the argument divided by `scale`; the square of the sine is reduced."""
    names = ("sin", "cos") if sign < 0 else ("sinh", "cosh")
    tree = scaled_tree(plain if plain is not None else quotient_tree(ring, argument), scale)
    below = argument.scaled(Fraction(1, scale))
    cosine_index = ring.new_generator(ex.Apply(names[1], tree))
    sine_index = ring.new_generator(ex.Apply(names[0], tree))
    pair = Pair(ring.generator(sine_index), ring.generator(cosine_index))
    square = (pair.cosine * pair.cosine - ring.constant(1)).scaled(sign)
    ring.field.relate(sine_index, 2, square.numerator)
    # Neither slope needs the derivative of the other, so the order of these two lines does not
    # matter.
    ring.set_slopes(sine_index, [(pair.cosine, below)])
    ring.set_slopes(cosine_index, [(pair.sine.scaled(sign), below)])
    return pair


def _combined(
    ring: ExactRing, pairs: Sequence[Pair | None], row: Sequence[int], turns: int, sign: int
) -> Pair:
    """The pair of sum row[b] u_b + turns pi/2, by the addition theorems."""
    total = Pair(ring.constant(0), ring.constant(1))
    for _ in range(turns % 4):
        total = Pair(total.cosine, -total.sine)
    for pair, coefficient in zip(pairs, row, strict=True):
        if pair is None or not coefficient:
            continue
        step = pair if coefficient > 0 else Pair(-pair.sine, pair.cosine)
        for _ in range(abs(coefficient)):
            total = _added(total, step, sign)
    return total


def _added(left: Pair, right: Pair, sign: int) -> Pair:
    sine = left.sine * right.cosine + left.cosine * right.sine
    return Pair(sine, left.cosine * right.cosine + (left.sine * right.sine).scaled(sign))


def _of_pair(function: str, pair: Pair) -> Quotient:
    match function.removesuffix("h"):
        case "sin":
            return pair.sine
        case "cos":
            return pair.cosine
        case "tan":
            return pair.sine / pair.cosine
        case "cot":
            return pair.cosine / pair.sine
        case "sec":
            return pair.cosine.inverse()
        case "csc":
            return pair.sine.inverse()
    raise ValueError(f"{function} is not a trigonometric or hyperbolic function")
