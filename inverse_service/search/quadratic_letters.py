"""Antiderivatives of monomials with a power of a letter p that is quadratic in the variable v.

With p' = dp/dv, p'' and D = 2 p p'' - p'^2, which does not hold v,
    d/dv (p' p^e) = (1 + 2 e) p'' p^e - e D p^(e-1)
steps through the powers, down from p^(3/2) and up from p^(-5/2) or 1/p^2, until there is left
    d/dv atan(p'/sqrt D) = sqrt(D)/(2 p),    d/dv log(p' + sqrt(2 p'' p)) = sqrt(p''/(2 p)).
With D < 0 logarithms of p' -+ sqrt(-D) take the place of the first, with p'' < 0 asin(p'/sqrt(-D)) of the second.
So 1/(x^2 + y^2) leads to atan(x/y)/y, 1/sqrt(x^2 + y^2) to log(x + sqrt(x^2 + y^2)), and the inverse cube of
the distance to z/((x^2 + y^2) sqrt(x^2 + y^2 + z^2)).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

from inverse_service import bounds
from inverse_service.expressions.tree import Apply, Expression, Sum, holds
from inverse_service.search.terms import (
    EMPTY,
    Monomial,
    Terms,
    TooManyTerms,
    add_terms,
    derivative_of_terms,
    letter_derivative,
    monomial,
    monomial_tree,
    multiply_terms,
    split_content,
    terms_of,
    times,
    tree_of,
)

_HALF = Fraction(1, 2)


def quadratic_antiderivatives(key: Monomial, variable: Expression) -> Iterator[Monomial]:
    """Candidates for the antiderivative of the monomial, constant factors left out."""
    for letter, e in key:
        whole = e.denominator == 1 and e < 0
        if isinstance(letter, Sum) and abs(e) <= bounds.POWER and (whole or e.denominator == 2):
            try:
                yield from _of_letter(key, letter, e, variable)
            except TooManyTerms:
                continue


def _of_letter(key: Monomial, letter: Sum, e: Fraction, variable: Expression) -> Iterator[Monomial]:
    slope = letter_derivative(letter, variable)
    second = derivative_of_terms(slope, variable)
    if not second or holds(tree_of(second), variable):
        return
    squared = multiply_terms(slope, slope)
    D = add_terms({k: 2 * a for k, a in multiply_terms(terms_of(letter), second).items()}, squared, -1)
    if not D:
        return
    rest, scale = times(key, frozenset([(letter, e)]), -1), _monomial(D)
    for exponent, power_of_d in _steps(e):
        outer = times(times(rest, frozenset([(letter, exponent)])), scale, power_of_d)
        yield from (times(outer, part) for part in slope)
    if e == Fraction(-3, 2):
        return  # 1 + 2 e is zero on the way up: nothing is left
    functions = _of_inverse(slope, D) if e.denominator == 1 else _of_root(letter, slope, second, D)
    last = times(rest, scale, math.floor(e + 1))
    for k in range(3 if e in (-1, -_HALF) else 1):  # the variable itself may stand in the monomial: v/p, v^2/p
        yield from (times(times(last, monomial(variable), -k), function) for function in functions)


def _steps(e: Fraction) -> list[tuple[Fraction, int]]:
    """(power of p, power of D) of the terms p' p^… D^…: up to the last negative power, or down to the last positive."""
    if e < 0:
        return [(e + k, -k) for k in range(1, bounds.POWER + 1) if e + k < 0]
    return [(e - k, k) for k in range(bounds.POWER + 1) if e - k > 0]


def _of_inverse(slope: Terms, D: Terms) -> list[Monomial]:
    """atan(p'/sqrt D)/sqrt D, or log(p' -+ sqrt(-D))/sqrt(-D)."""
    root = _root(_magnitude(D))
    inverse = times(EMPTY, _monomial(root), -1)
    if _is_negative(D):
        return [times(inverse, _logarithm(add_terms(slope, root, sign))) for sign in (1, -1)]
    return [times(inverse, monomial(Apply("atan", tree_of(_quotient(slope, root)))))]


def _of_root(letter: Sum, slope: Terms, second: Terms, D: Terms) -> list[Monomial]:
    """log(p' + sqrt(2 p'' p)), or asin(p'/sqrt(-D)) where p'' is negative."""
    if _is_negative(second):
        return [monomial(Apply("asin", tree_of(_quotient(_magnitude(slope), _root(_magnitude(D))))))]
    doubled = {key: 2 * value for key, value in second.items()}
    radical: Terms = {frozenset([(letter, _HALF)]): Fraction(1)}
    return [_logarithm(add_terms(slope, multiply_terms(_root(doubled), radical)))]


def _is_negative(terms: Terms) -> bool:
    return all(value < 0 for value in terms.values())


def _magnitude(terms: Terms) -> Terms:
    return {key: -value for key, value in terms.items()} if _is_negative(terms) else terms


def _quotient(above: Terms, below: Terms) -> Terms:
    return multiply_terms(above, terms_of(tree_of(below) ** -1))


def _logarithm(terms: Terms) -> Monomial:
    """The log of a sum, constant factors left out."""
    _, common, primitive = split_content(terms)
    return monomial(Apply("log", monomial_tree(common) * primitive))


def _monomial(terms: Terms) -> Monomial:
    """The sum as one monomial, its number left out."""
    ((key, _),) = terms_of(tree_of(terms) ** -1).items()
    return times(EMPTY, key, -1)


def _root(terms: Terms) -> Terms:
    """The square root: of a monomial taken letter by letter, of a sum a letter."""
    if len(terms) == 1:
        ((key, value),) = terms.items()
        above, below = math.isqrt(abs(value.numerator)), math.isqrt(value.denominator)
        if value > 0 and above**2 == value.numerator and below**2 == value.denominator:
            return {frozenset((letter, e / 2) for letter, e in key): Fraction(above, below)}
    return terms_of(tree_of(terms) ** _HALF)
