"""Functions of position and time that multiply the velocity shapes of an ansatz."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from math import inf, lcm

from inverse_service import bounds
from inverse_service.expressions.tree import TIME, Expression, Sum, is_exponential
from inverse_service.search.integrating import divergence_factor, integrating_factor
from inverse_service.search.material import (
    Material,
    coefficient,
    integrating_candidates,
    simplified,
)
from inverse_service.search.motion_terms import split_velocities
from inverse_service.search.terms import (
    EMPTY,
    Monomial,
    Terms,
    TooManyTerms,
    add_terms,
    derivative_of_terms,
    letter_derivative,
    monomial,
    multiply_terms,
    rank,
    times,
)

HALF = Fraction(1, 2)
# Of the functions of t that stand before terms. With 4 or 12 a system of three rates (e^(-t), e^(2 t/3), e^(3 t/2)) has
# no L: four leave one of them out, and twelve leave too little room for what is multiplied with them.
_MOST_IN_TIME = 6


@dataclass(frozen=True, slots=True)
class Factors:
    """What follows from the coefficients c of v_i v_l and v_i in f_i.

    `along[i]` is exp(-int c_ii dq_i), `across[i]` the product of exp(-int c_il dq_l) over l != i;
    `in_time` holds 1 and exp(-int c dt); `plain` all factors for a quadratic L, and their inverses. `fitted[i, e]` is
    phi with g_ii = phi v_i^e for a diagonal g.
    """

    along: Mapping[int, Monomial]
    across: Mapping[int, Monomial]
    in_time: tuple[Monomial, ...]
    plain: tuple[Monomial, ...]
    fitted: Mapping[tuple[int, Fraction], Monomial] = field(default_factory=dict)

    def of_degree(self, i: int, degree: Fraction) -> list[Monomial]:
        """Candidates phi with g_ii = phi v_i^degree, from all c_il or from c_ii alone."""
        own = times(EMPTY, self.along.get(i, EMPTY), 2 + degree)
        fitted = [self.fitted[i, degree]] if (i, degree) in self.fitted else []
        return list(dict.fromkeys([*fitted, own, times(own, self.across.get(i, EMPTY), 1 + degree)]))


NO_FACTORS = Factors({}, {}, (EMPTY,), (EMPTY,))


def find_factors(material: Material, seed: int) -> Factors:
    """Integrating factors of all coefficients for which they are products of letters."""
    along: dict[int, Monomial] = {}
    across: dict[int, Monomial] = {}
    single: dict[Monomial, None] = {EMPTY: None}
    in_time: dict[Monomial, None] = {EMPTY: None}
    for i, c, variable in integrating_candidates(material)[: bounds.COLUMNS]:
        factor = integrating_factor(material, c, variable, seed)
        if not factor:
            continue
        if variable == TIME:
            # g = e^(-(1 + k) int c dt) v^k solves Gamma(g) = -g df/dv for f = c v.
            in_time.update(dict.fromkeys(times(EMPTY, factor, e) for e in (1, -1, 2, -2, 3)))
        elif variable == material.motion.coordinates[i]:
            along[i] = factor
            single[times(EMPTY, factor, 2)] = None
        else:
            across[i] = times(across.get(i, EMPTY), factor)
            single[factor] = None
    whole = divergence_factor(material, seed) if material.motion.with_time else None
    if whole:
        in_time[whole] = None
    for i in range(material.motion.size):
        single[times(across.get(i, EMPTY), along.get(i, EMPTY), 2)] = None
    inverted = [times(EMPTY, factor, -1) for factor in single]
    chosen = tuple(dict.fromkeys([*sorted(single, key=rank), *sorted(inverted, key=rank)]))[: bounds.CANDIDATES]
    return Factors(along, across, tuple(_first(in_time, whole)), chosen, dict(_fitted(material, seed)))


def _fitted(material: Material, seed: int) -> Iterator[tuple[tuple[int, Fraction], Monomial]]:
    """phi for a diagonal g with g_ii = phi v_i^e: (H2) asks for Gamma(log phi) = -df_i/dv_i - e f_i/v_i."""
    motion, room = material.motion, bounds.CANDIDATES
    for i, (v, f) in enumerate(zip(motion.velocities, motion.forces, strict=True)):
        for e in sorted({-dict(key).get(v, Fraction(0)) for key in f}, reverse=True):
            phi = None
            with suppress(TooManyTerms):
                divided = multiply_terms(f, {frozenset([(v, -Fraction(1))]): -e})
                rate = add_terms(divided, derivative_of_terms(f, v), -1)
                phi = _exponential_of(material, rate, seed) if rate and room else None
            if phi:
                room -= 1
                yield (i, e), phi


def _exponential_of(material: Material, rate: Terms, seed: int) -> Monomial | None:
    """phi(t, q) with Gamma(log phi) = rate, which is linear in the velocities then; None where none is found."""
    motion, phi = material.motion, EMPTY
    steps = [(TIME, EMPTY), *((q, monomial(v)) for q, v in zip(motion.coordinates, motion.velocities, strict=True))]
    if any(split_velocities(key)[1] not in [moving for _, moving in steps] for key in rate):
        return None
    for variable, moving in steps:
        slope = coefficient(rate, moving)
        for letter, e in phi:
            slope = add_terms(
                slope, multiply_terms(letter_derivative(letter, variable), {frozenset([(letter, -Fraction(1))]): e}), -1
            )
        if slope := simplified(material, slope):
            factor = integrating_factor(material, {key: -value for key, value in slope.items()}, variable, seed)
            if not factor:
                return None
            phi = times(phi, factor)
    return phi


def _first(in_time: Iterable[Monomial], whole: Monomial | None) -> list[Monomial]:
    """1, the factor of the divergence, and the simplest others."""
    ordered = [EMPTY, *([whole] if whole else []), *sorted(in_time, key=rank)]
    return list(dict.fromkeys(ordered))[:_MOST_IN_TIME]


def products(left: Iterable[Monomial], right: Sequence[Monomial]) -> list[Monomial]:
    """All products of one of each."""
    return [times(a, b) for a in left for b in right]


def _exponents(letter: Expression, seen: set[Fraction]) -> list[Fraction]:
    """The exponents with which a letter of position is offered, given those with which it stands in f."""
    one = Fraction(1)
    if isinstance(letter, Sum):
        return [one, -one, HALF, -HALF]
    if is_exponential(letter):
        highest = int(max([one, *(abs(e) for e in seen)]))
        whole = [k * one for k in range(1, min(highest, bounds.POWER) + 1)]
        unit = Fraction(1, lcm(*(e.denominator for e in seen)))  # e^(x/2) may be a part of e^(3x/2)
        return [sign * e for e in dict.fromkeys((*whole, unit)) for sign in (1, -1)]
    return [one, -one] if any(e < 0 for e in seen) else [one]


def position_monomials(material: Material, degree: int, room: float = inf) -> list[Monomial]:
    """Products of at most `degree` letters of position; sums also inverted and rooted, others as in f.

    Of three letters and more only where all of these make at most `room`.
    """
    powers: dict[Expression, set[Fraction]] = {}
    for terms in material.motion.forces:
        for key in terms:
            for letter, e in key:
                powers.setdefault(letter, set()).add(e)
    units: list[Monomial] = []
    for letter in material.position_letters:
        units += [frozenset([(letter, e)]) for e in _exponents(letter, powers.get(letter, set()))]
    found, layer = {EMPTY}, [(EMPTY, 0)]  # products, and the unit from which on they may go on
    for count in range(1, degree + 1):
        layer = [(times(m, units[k]), k) for m, first in layer for k in range(first, len(units))]
        every = found.union(m for m, _ in layer)
        if count > 2 and len(every) > room:
            break
        found = every
    return sorted(found, key=rank)
