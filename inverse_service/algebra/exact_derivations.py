"""Derivations of quotients that keep the denominators factored."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from flint import fmpq_mpoly

from inverse_service.algebra.rational_functions import Exponents, Quotient, QuotientField, TooLarge, combined


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
        for index, power in element.exponents:
            slope = self.of_polynomial(owner, owner.denominators[index])
            if not slope.is_zero:
                logarithmic = slope * Quotient(owner, owner.context.constant(-power), ((index, 1),))
                terms.append(Quotient(owner, element.numerator, ()) * logarithmic)
        whole = sum_of(owner.constant(0), terms)
        return owner.quotient(whole.numerator, combined(whole.exponents, element.exponents))
