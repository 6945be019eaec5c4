"""The ring in which a system is differentiated exactly: generators, what they print as, derivatives.

Derivations of quotients that keep the denominators factored.

Ring elements as trees for people: factored, roots and exponentials merged, in the user's atoms.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from flint import fmpq_mpoly

from inverse_service.expressions.tree import (
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    multiply,
    number,
    powers_of,
)
from inverse_service.field.rational_functions import (
    Exponents,
    Quotient,
    QuotientField,
    TooLarge,
    as_fraction,
    combined,
    divided_out,
    factored,
)


def sum_of(zero: Quotient, terms: Iterable[Quotient]) -> Quotient:
    """The sum, terms of equal denominators first, so that few fractions are brought together."""
    groups: dict[Exponents, Quotient] = {}
    for term in terms:
        if not term.is_zero:
            known = groups.get(term.exponents)
            groups[term.exponents] = (
                term if known is None else Quotient(term.field, known.numerator + term.numerator, term.exponents)
            )
    total = zero
    for exponents, term in groups.items():
        total = total + term.field.quotient(term.numerator, exponents)
    return total


@dataclass(frozen=True, slots=True)
class Derivation:
    """A derivation X, given by X(g) for the generators where that is not zero.

    `undefined` are generators whose derivative was not provided for: meeting one raises TooLarge.
    """

    images: Mapping[int, Quotient]
    undefined: frozenset[int] = frozenset()

    def of_polynomial(self, owner: QuotientField, polynomial: fmpq_mpoly) -> Quotient:
        """X(N) = sum over generators of (dN/dg) X(g)."""
        terms = []
        degrees = polynomial.degrees() if self.undefined else ()
        if any(degrees[index] > 0 for index in self.undefined):
            raise TooLarge("a derivative of an arbitrary function beyond the order prepared is needed")
        for index, image in self.images.items():
            slope = polynomial.derivative(index)
            if not slope.is_zero():
                terms.append(Quotient(owner, slope, ()) * image)
        return sum_of(owner.constant(0), terms)

    def __call__(self, element: Quotient) -> Quotient:
        """X(N/D) = (X(N) - N sum e_i X(D_i)/D_i) / D."""
        owner = element.field
        terms = [self.of_polynomial(owner, element.numerator)]
        for index, exponent in element.exponents:
            slope = self.of_polynomial(owner, owner.denominators[index])
            if not slope.is_zero:
                logarithmic = slope * Quotient(owner, owner.context.constant(-exponent), ((index, 1),))
                terms.append(Quotient(owner, element.numerator, ()) * logarithmic)
        whole = sum_of(owner.constant(0), terms)
        return owner.quotient(whole.numerator, combined(whole.exponents, element.exponents))


# Integer powers beyond this are refused: their expansion would be useless to a reader.
LARGEST_EXPONENT = 64


@dataclass(slots=True)
class ExactRing:
    """A quotient field whose generators are the atoms of given formulas.

    `variables` are t, coordinates and velocities; `atoms` gives the value of each atom's tree;
    `trees[index]` is what generator `index` prints as; `images[k][index]` is its derivative by
    `variables[k]`, where the ring has `slopes`; `undefined` are generators whose derivatives lie beyond the
    order asked for.
    Generators are handed out from the last, so that a later one is greater in the order.
    """

    field: QuotientField
    variables: tuple[Expression, ...]
    free: int
    slopes: bool = True
    atoms: dict[Expression, Quotient] = dataclasses.field(default_factory=dict)
    trees: dict[int, Expression] = dataclasses.field(default_factory=dict)
    images: list[dict[int, Quotient]] = dataclasses.field(default_factory=list)
    undefined: set[int] = dataclasses.field(default_factory=set)

    def new_generator(self, tree: Expression) -> int:
        """The next unused generator, printing as `tree`."""
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
        for variable in range(len(self.variables)) if self.slopes else ():
            total = self.constant(0)
            for slope, argument in slopes:
                total = total + slope * self.partial(variable)(argument)
            if not total.is_zero:
                self.images[variable][index] = total

    def partial(self, variable: int) -> Derivation:
        """The partial derivative by variables[variable]; ValueError where the ring has no slopes."""
        self._need_slopes()
        return Derivation(self.images[variable], frozenset(self.undefined))

    def along(self, components: Sequence[Quotient | None]) -> Derivation:
        """The derivation sum_k components[k] d/d variables[k]; None stands for 0."""
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

    def value(self, tree: Expression) -> Quotient:
        """The tree as a ring element; ZeroDivisionError for a division by identically zero."""
        if tree in self.atoms:
            return self.atoms[tree]
        match tree:
            case Number(value):
                return self.constant(value)
            case Sum(terms):
                return self._sum(terms)
            case Product(factors):
                return self._product(factors)
            case Power(base, Number(exponent)) if exponent.denominator == 1:
                if abs(exponent) > LARGEST_EXPONENT:
                    raise TooLarge(f"a power above {LARGEST_EXPONENT} is not expanded")
                return self.value(base) ** int(exponent)
        raise KeyError(f"{type(tree).__name__} node is not an atom of this ring")

    def _sum(self, terms: Sequence[Expression]) -> Quotient:
        total = self.constant(0)
        for term in terms:
            total = total + self.value(term)
        return total

    def _product(self, factors: Sequence[Expression]) -> Quotient:
        total = self.constant(1)
        for factor in factors:
            total = total * self.value(factor)
        return total


def is_integer_power(tree: Expression) -> bool:
    """Whether the node is a Power with an integer exponent, which needs no generator."""
    return isinstance(tree, Power) and isinstance(tree.exponent, Number) and tree.exponent.value.denominator == 1


def add_symbols(ring: ExactRing, symbols: Sequence[Symbol | Velocity]) -> None:
    """One generator for each symbol; the variables among them get derivative 1."""
    ring.images = [{} for _ in ring.variables]
    for symbol in symbols:
        index = ring.new_generator(symbol)
        ring.atoms[symbol] = ring.generator(index)
        if symbol in ring.variables:
            ring.images[ring.variables.index(symbol)][index] = ring.constant(1)


def scaled_tree(tree: Expression, divisor: int) -> Expression:
    """tree / divisor."""
    return tree if divisor == 1 else Fraction(1, divisor) * tree


# Factoring costs more than it helps the reader beyond this many terms, or this degree.
FACTORED_TERMS = 120
FACTORED_DEGREE = 60


def quotient_tree(ring: ExactRing, quotient: Quotient) -> Expression:
    """The element as constant * factors / denominators, or a sum of such where that is shorter."""
    if quotient.is_zero:
        return number(0)
    return add(*(_factored(ring, part) for part in _split_by_roots(ring, quotient)))


def _split_by_roots(ring: ExactRing, quotient: Quotient) -> list[Quotient]:
    """The parts by powers of each root in the denominator: (P + Q r^5)/r^5 = P/r^5 + Q, if that is shorter."""
    parts = [quotient]
    for index in ring.field.relations:
        root = ring.field.context.gen(index)
        if any(ring.field.denominators[place] == root for place, _ in quotient.exponents):
            parts = [piece for part in parts for _, piece in sorted(part.parts([index]).items())]
    shorter = sum(len(part.numerator) for part in parts) < len(quotient.numerator)
    return parts if shorter else [quotient]


def _factored(ring: ExactRing, quotient: Quotient) -> Expression:
    """constant * factors / denominators, monomials before sums."""
    constant, factors = _factors(ring, quotient.numerator)
    table = dict[Expression, Fraction]()
    for polynomial, exponent in factors:
        _collect(ring, table, polynomial, exponent)
    for index, exponent in quotient.exponents:
        _collect(ring, table, ring.field.denominators[index], -exponent)
    rank = {tree: _place(ring, index) for index, tree in ring.trees.items() if tree in table}
    ordered = sorted(table.items(), key=lambda item: (item[1] < 0, isinstance(item[0], Sum), rank.get(item[0], (3, 0))))
    return multiply(number(constant), *(generator_power(tree, exponent) for tree, exponent in ordered if exponent))


def factor_trees(ring: ExactRing, quotient: Quotient) -> list[Expression]:
    """The factors of the numerator that are not numbers, each once: where the element can vanish."""
    _, factors = _factors(ring, quotient.numerator)
    return [polynomial_tree(ring, factor) for factor, _ in factors if not factor.is_constant()]


def _factors(ring: ExactRing, polynomial: fmpq_mpoly) -> tuple[Fraction, list[tuple[fmpq_mpoly, int]]]:
    """constant and factors; radicands and 1 - cos^2 are taken out whole, as powers of their generator."""
    found = []
    for relation in ring.field.relations.values():
        polynomial, exponent = divided_out(polynomial, relation.right)
        if exponent:
            found.append((ring.field.context.gen(relation.generator), exponent * relation.degree))
    if len(polynomial) > FACTORED_TERMS or polynomial.total_degree() > FACTORED_DEGREE:
        return Fraction(1), [*found, (polynomial, 1)]
    content, factors = factored(polynomial)
    return content, [*found, *factors]


def _collect(ring: ExactRing, table: dict[Expression, Fraction], factor: fmpq_mpoly, exponent: int) -> None:
    """Multiply the power of a factor into the table of trees and exponents."""
    for base, inner in powers_of(polynomial_tree(ring, factor)):
        table[base] = table.get(base, Fraction(0)) + inner * exponent


def polynomial_tree(ring: ExactRing, polynomial: fmpq_mpoly) -> Expression:
    """The polynomial as a sum of monomials."""
    used = (index for index, degree in enumerate(polynomial.degrees()) if degree > 0 and index in ring.trees)
    order = sorted(used, key=lambda index: _place(ring, index))
    powers: dict[tuple[int, int], Expression] = {}
    return add(*(_monomial_tree(ring, order, powers, e, as_fraction(c)) for e, c in polynomial.terms()))


def _monomial_tree(
    ring: ExactRing,
    order: Sequence[int],
    powers: dict[tuple[int, int], Expression],
    exponents: Sequence[int],
    coefficient: Fraction,
) -> Expression:
    """One term; `powers` keeps the powers of generators built so far."""
    parts = []
    for index in order:
        exponent = int(exponents[index])
        if exponent and (index, exponent) not in powers:
            powers[index, exponent] = generator_power(ring.trees[index], Fraction(exponent))
        if exponent:
            parts.append(powers[index, exponent])
    return multiply(number(coefficient), *parts)


def _place(ring: ExactRing, index: int) -> tuple[int, int]:
    """Parameters first, then coordinates and velocities, then functions."""
    tree = ring.trees.get(index)
    if isinstance(tree, Symbol) and tree not in ring.variables:
        return (0, index)
    return (1 if tree in ring.variables else 2, index)


def generator_power(tree: Expression, exponent: Fraction) -> Expression:
    """tree ^ exponent, with (u^c)^e = u^(c e) for a root and exp(u)^e = exp(e u)."""
    match tree:
        case Power(base, Number(inner)) if inner.denominator != 1:
            return base ** (inner * exponent)
        case Power(base, inner_exponent) if not isinstance(inner_exponent, Number):
            return base ** (exponent * inner_exponent)
        case Apply("exp", argument):
            return Apply("exp", exponent * argument) if exponent != 1 else tree
    return tree**exponent
