"""Terms that the user supplies, as a family of their own: the first that is tried."""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.search.families import Family
from inverse_service.inverse_problem.search.terms import Monomial, TooManyTerms, monomial, terms_of

NAME = "the given terms"
_MOST_TERMS = 1_000


def own_family(given: Sequence[Expression]) -> Family | None:
    """The ansatz of the monomials of the given terms, each with a coefficient of its own; None without terms.

    Potentials and linear terms are added as to any family, so that kinetic terms are enough; those
    that are given go with every choice.
    """
    monomials = list(dict.fromkeys(key for term in given for key in monomials_of(term)))[:_MOST_TERMS]
    if not monomials:
        return None
    return Family(NAME, 0, lambda material: [], 0, tuple(monomials))


def monomials_of(term: Expression) -> list[Monomial]:
    """The monomials of a term multiplied out; the term as one letter where that would be long."""
    try:
        return list(terms_of(term))
    except TooManyTerms:
        return [monomial(term)]
