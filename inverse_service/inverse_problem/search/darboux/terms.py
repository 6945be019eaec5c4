"""Ansatz terms made of Darboux polynomials and first integrals.

With P_i = factor * base of first degree, Q of second degree, phi a function of position:
    phi P_i P_j, phi P_i P_j / P_k, phi P_i log P_j, phi log P_i, phi P_i^e, phi Q^e, phi Q log Q,
    phi Q / P_i, and, for the simplest, phi P_i^(1/2), phi (P_i P_j)^(1/2), phi P_i Q^(1/2).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction

from inverse_service.expressions.tree import Apply
from inverse_service.inverse_problem.search.choice import complexity
from inverse_service.inverse_problem.search.darboux.forms import Form, darboux_polynomials
from inverse_service.inverse_problem.search.factors import HALF, Factors, position_monomials, products
from inverse_service.inverse_problem.search.material import Material, distinct
from inverse_service.inverse_problem.search.terms import EMPTY, Monomial, monomial, terms_of, times

_SEED = 1
_MOST_QUADRATIC = 2
# Roots restrict the points modulo a prime, each to half of them.
_MOST_ROOTED = 2
_MOST_BEYOND_SIZE = 2
_MOST_OWN_FUNCTIONS = 12
_MOST_FUNCTIONS = 20
_MOST_WITH_OWN, _MOST_WITH_OTHERS = 700, 400
_EXPONENTS = tuple(map(Fraction, (3, 4, -1, -2)))


def of_darboux_polynomials(material: Material, factors: Factors) -> list[Monomial]:
    """Terms in Darboux polynomials and velocities; none where only velocities are found.

    The simplest polynomials, one more than coordinates, are multiplied by more functions of position.
    """
    forms = darboux_polynomials(material, factors, _SEED)
    if all(form.base in material.motion.velocities for form in forms):
        return []
    size = material.motion.size
    linear = _completed(material, sorted((form for form in forms if form.degree == 1), key=_order))
    quadratic = sorted((form for form in forms if form.degree == 2), key=_order)[:_MOST_QUADRATIC]
    every = [*_of_linear(linear[: size + _MOST_BEYOND_SIZE]), *_roots(linear[:_MOST_ROOTED])]
    every += [shape for form in quadratic for shape in _of_quadratic(form, linear[:size])]
    simplest = [*_quotients(linear[: size + 1]), *_logarithms(linear[: size + 1])]
    own, others = _functions(material, factors, forms)
    return [*_with(own, every, _MOST_WITH_OWN), *_with(others, simplest, _MOST_WITH_OTHERS)]


def _order(form: Form) -> tuple[Fraction, int]:
    return complexity(terms_of(form.base))


def _completed(material: Material, linear: Sequence[Form]) -> list[Form]:
    """With velocities where there are fewer polynomials than coordinates."""
    missing = max(0, material.motion.size - len(linear))
    known = {form.base for form in linear}
    return [*linear, *[Form(v, EMPTY, 1) for v in material.motion.velocities if v not in known][:missing]]


def _product(*forms: Form) -> Monomial:
    whole = monomial(*(form.base for form in forms))
    for form in forms:
        whole = times(whole, form.factor)
    return whole


def _quotients(linear: Sequence[Form]) -> list[Monomial]:
    """P_i P_j and P_i P_j / P_k."""
    pairs = list(itertools.combinations_with_replacement(linear, 2))
    divided = [times(_product(*pair), _product(p), -1) for p in linear for pair in pairs if p not in pair]
    return [*(_product(*pair) for pair in pairs), *divided]


def _logarithms(linear: Sequence[Form]) -> list[Monomial]:
    """P_i log P_j and log P_i."""
    logs = [Apply("log", form.base) for form in linear]
    return [*(times(_product(form), monomial(log)) for log in logs for form in linear), *map(monomial, logs)]


def _of_linear(linear: Sequence[Form]) -> list[Monomial]:
    powers = [times(EMPTY, _product(form), e) for form in linear for e in _EXPONENTS]
    return [*_quotients(linear), *_logarithms(linear), *powers]


def _roots(linear: Sequence[Form]) -> list[Monomial]:
    """P^(1/2), P^(3/2) and (P_i P_j)^(1/2)."""
    alone = [times(EMPTY, _product(form), e) for form in linear for e in (HALF, 3 * HALF)]
    return [*alone, *(times(EMPTY, _product(*pair), HALF) for pair in itertools.combinations(linear, 2))]


def _of_quadratic(form: Form, linear: Sequence[Form]) -> Iterator[Monomial]:
    """Q^e, log Q, Q log Q, Q / P_i and P_i Q^(+-1/2)."""
    whole, log = _product(form), Apply("log", form.base)
    yield from (times(EMPTY, whole, Fraction(e) * HALF) for e in (1, 2, 3, 4, -1, -2))
    yield from (monomial(log), times(whole, monomial(log)))
    for p in linear:
        yield from (times(_product(p), whole, e) for e in (HALF, -HALF))
        yield times(whole, _product(p), -1)


def _functions(material: Material, factors: Factors, forms: Sequence[Form]) -> tuple[list[Monomial], list[Monomial]]:
    """1 and the factors of the polynomials; integrating factors and products of letters."""
    own = [times(EMPTY, form.factor, e) for form in forms for e in (1, -1)]
    quotients = [times(a, b) for a, b in itertools.combinations(dict.fromkeys(own), 2)]
    first = list(dict.fromkeys([EMPTY, *distinct(own), *distinct(quotients)]))[:_MOST_OWN_FUNCTIONS]
    plain = [key for key in position_monomials(material, 2) if all(e.denominator == 1 for _, e in key)]
    others = dict.fromkeys([*factors.plain[:4], *plain])
    return first, [key for key in others if key not in first][:_MOST_FUNCTIONS]


def _with(functions: Sequence[Monomial], shapes: Iterable[Monomial], most: int) -> list[Monomial]:
    """Products, of as many functions as fit and at least two."""
    every = list(dict.fromkeys(shapes))
    return products(functions[: max(2, most // max(1, len(every)))], every)
