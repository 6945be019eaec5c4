"""Polynomials over the rationals by flint, within bounds of size."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from flint import fmpq, fmpq_mpoly

# The largest degree in one variable of a factored polynomial: factoring takes at most 0.2 s at 400,
# half a minute at 800.
LARGEST_DEGREE = 500
# Kept factors: polynomials, and terms of one, whose text costs less than its factors.
_MOST_KNOWN, _MOST_KNOWN_TERMS = 4096, 200


class TooLarge(ArithmeticError):
    """A computation exceeded its budget of terms or time; its text is the reason shown to users."""


def as_fraction(value: fmpq) -> Fraction:
    return Fraction(int(value.p), int(value.q))


class Factors(NamedTuple):
    """A polynomial as content times factors with their powers."""

    content: Fraction
    powers: list[tuple[fmpq_mpoly, int]]


def factors_if_small(polynomial: fmpq_mpoly) -> Factors:
    """The factors; the polynomial as one of them where its exponents are too large."""
    try:
        return factor_polynomial(polynomial)
    except TooLarge:
        return Factors(Fraction(1), [(polynomial, 1)])


# The factors of polynomials by variables, ordering, and text. Of the polynomials of one question
# about a motion two thirds were factored before.
_known: dict[tuple[object, object, str], Factors] = {}


def factor_polynomial(polynomial: fmpq_mpoly) -> Factors:
    """(rational content, [(irreducible factor, multiplicity)]); TooLarge if exponents are too large
    for flint.

    flint takes minutes for x^4001 - x, so the degree without the product of generator powers is
    bounded.
    """
    if len(polynomial) > _MOST_KNOWN_TERMS:
        return _factored(polynomial)
    whole = polynomial.context()
    key = whole.names(), whole.ordering(), str(polynomial)
    found = _known.get(key)  # other threads ask, too
    if found is None:
        found = _factored(polynomial)
        if len(_known) >= _MOST_KNOWN:
            _known.clear()
        _known[key] = found
    return Factors(found.content, [*found.powers])


def _factored(polynomial: fmpq_mpoly) -> Factors:
    lowest = polynomial.term_content().degrees() if len(polynomial) > 1 else polynomial.degrees()
    if any(
        high - low > LARGEST_DEGREE for high, low in zip(polynomial.degrees(), lowest, strict=True)
    ):
        raise TooLarge("the degree of a polynomial is too large to factor it")
    whole, used = polynomial.context(), [k for k, e in enumerate(polynomial.degrees()) if e]
    small = type(whole).get([f"x{k}" for k in range(len(used))], whole.ordering())
    try:  # flint takes 0.1 s for a polynomial in 6 of 600 variables, and 0.1 ms for one in 6 of 6
        there: dict[str | int, str | int] = {place: k for k, place in enumerate(used)}
        content, found = polynomial.project_to_context(small, there).factor()
    except (RuntimeError, OverflowError) as error:
        raise TooLarge("the degrees of a polynomial are too large to factor it") from error
    back: dict[str | int, str | int] = dict(enumerate(used))
    return Factors(
        as_fraction(content),
        [(factor.project_to_context(whole, back), int(power)) for factor, power in found],
    )
