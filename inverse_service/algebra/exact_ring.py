"""The ring in which a system is differentiated exactly: generators, what they print as, derivatives."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.algebra.exact_derivations import Derivation
from inverse_service.algebra.rational_functions import Quotient, QuotientField, TooLarge
from inverse_service.expressions.tree import (
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    multiply,
    number,
)

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
    return tree if divisor == 1 else multiply(number(Fraction(1, divisor)), tree)
