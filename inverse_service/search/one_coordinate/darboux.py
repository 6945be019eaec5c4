"""Darboux polynomials of Gamma = v d/dx + f d/dv with a cofactor fitted to a multiplier.

For x'' = f a multiplier obeys Gamma(g) + g df/dv = 0. With g = phi(x) P(x, v)^e this is
    e Gamma(P) + (df/dv + Gamma(log phi)) P = 0,
for given phi and e linear in P (Darboux 1878; Prelle and Singer 1983; Duarte, Duarte, da Mota and
Skea 2001). P is taken as a polynomial in v whose terms are closed under what cancels residuals;
the linear equations are solved at random points modulo a prime.

Lienard's equation with Chiellini's condition has one in any coordinate. With y' = E x', E = exp(-int a dx),
x'' = a x'^2 + b x' + c becomes y'' = b y' + h b, h = E c / b. Where dh/dy = -alpha b with constant alpha
(Chiellini 1931), 1/(alpha w^2 + h w + h^2), w = y', is a last multiplier.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from inverse_service import bounds
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import TIME, ZERO, Expression, Velocity, holds
from inverse_service.field.point import number_value
from inverse_service.field.truncated_series import SingularPoint
from inverse_service.search.factors import Factors
from inverse_service.search.linear_ansatz import letters_of, null_combinations
from inverse_service.search.material import Material, antiderivatives
from inverse_service.search.motion_terms import along, split_velocities
from inverse_service.search.multiplier_ansatz import tensors_of
from inverse_service.search.null_vectors import SPARE, pivots
from inverse_service.search.one_coordinate.algebra import expanded, factored
from inverse_service.search.sampling import (
    LetterTable,
    letter_table,
    make_sampler,
    monomial_values,
)
from inverse_service.search.terms import (
    EMPTY,
    Monomial,
    Terms,
    TooManyTerms,
    derivative_of_terms,
    monomial,
    monomial_tree,
    multiply_terms,
    rank,
    times,
    tree_of,
)


@dataclass(frozen=True, slots=True)
class Samples:
    """Letters, their values and logarithmic derivatives along the motion, and df/dv, at points of one prime."""

    places: dict[Expression, int]
    table: LetterTable
    slopes: tuple[int, ...]

    @property
    def prime(self) -> int:
        return self.table.prime

    def along(self, sample: int, key: Monomial) -> int:
        """Gamma(log key)."""
        rates = self.table.derivatives.along[sample]
        return sum(int(rates[self.places[p]]) * number_value(e, self.prime) for p, e in key) % self.prime


def sampled(material: Material, terms: Sequence[Monomial], count: int, seed: int) -> Samples:
    """`count` points for the letters of the terms; IrreducibleAtoms, SingularPoint or ValueError if there are none."""
    letters = letters_of(terms)
    sampler = make_sampler(material.analysis, dict.fromkeys(item for term in terms for item in term))
    table = letter_table(sampler, letters, count, seed)
    slopes = tuple(-2 * connection[0][0] % table.prime for connection, _ in tensors_of(sampler, table))
    return Samples({p: k for k, p in enumerate(letters)}, table, slopes)


def independent(samples: Samples, terms: Sequence[Monomial]) -> list[Monomial]:
    """The terms without those that are combinations of earlier ones as functions (1 = sin^2 + cos^2)."""
    rows = monomial_values(samples.table, list(samples.places), terms)
    return [terms[k] for k in pivots(rows, samples.prime)]


def montgomery_values(samples: Samples, terms: Sequence[Monomial]) -> list[list[int]]:
    """The value of each term at each sample in Montgomery form (times 2^64)."""
    return [[int(a) for a in row] for row in monomial_values(samples.table, list(samples.places), terms)]


_LINEAR = ("-3", "-2", "-1", "-4", "-3/2", "-1/2", "-5", "-5/2", "-4/3", "-5/3", "1", "2")
_QUADRATIC = ("-1", "-3/2", "-1/2", "-2", "-5/2", "1", "1/2")
EXPONENTS = (
    (1, tuple(map(Fraction, _LINEAR))),
    (2, tuple(map(Fraction, _QUADRATIC))),
    (3, (Fraction(-1),)),
    (4, (Fraction(-1),)),
)
_HIGHEST = max(degree for degree, _ in EXPONENTS)


@dataclass(frozen=True, slots=True)
class Power:
    """g = factor * base^exponent; `factor` holds no velocity, `base` is a polynomial in v."""

    factor: Monomial
    base: tuple[tuple[Monomial, Fraction], ...]
    exponent: Fraction


def darboux_powers(material: Material, factors: Factors, seed: int) -> list[Power]:
    """Multipliers phi P^e, P of degree 1 to 4 in v; empty where none is found.

    Where df/dv = 0 they are first integrals, and g = 1 is one: none can spare the integral of f that g = 1 needs.
    """
    found: dict[Power, None] = {}
    if not derivative_of_terms(material.motion.forces[0], material.motion.velocities[0]):
        return []
    for degree, exponents in EXPONENTS:
        try:
            found.update(dict.fromkeys(_of_degree(material, factors, degree, exponents, seed)))
        except (IrreducibleAtoms, SingularPoint, TooManyTerms, ValueError):
            continue
    return list(found)


def _of_degree(
    material: Material, factors: Factors, degree: int, exponents: Sequence[Fraction], seed: int
) -> Iterator[Power]:
    phis = {e: position_factors(factors, degree * e) for e in exponents}
    candidates = candidate_terms(material, degree)
    every = [*candidates, *(phi for group in phis.values() for phi in group)]
    samples = sampled(material, every, len(candidates) + SPARE, seed)
    candidates = independent(samples, candidates)
    values = montgomery_values(samples, candidates)
    rates = [[samples.along(k, key) for key in candidates] for k in range(len(values))]
    for e, group in phis.items():
        for phi in group:
            weight = number_value(e, samples.prime)
            wanted = [slope + samples.along(k, phi) for k, slope in enumerate(samples.slopes)]
            rows = _equations(values, rates, weight, wanted, samples.prime)
            for terms in null_combinations(np.array(rows, np.uint64), candidates, samples.prime):
                yield Power(phi, tuple(terms.items()), e)


def _equations(
    values: Sequence[Sequence[int]], rates: Sequence[Sequence[int]], weight: int, wanted: Sequence[int], prime: int
) -> list[list[int]]:
    """Rows of e Gamma(P) + (df/dv + Gamma(log phi)) P = 0 for the terms of P."""
    return [
        [value * (weight * rate + target) % prime for value, rate in zip(row, along_row, strict=True)]
        for row, along_row, target in zip(values, rates, wanted, strict=True)
    ]


def position_factors(factors: Factors, degree: Fraction) -> list[Monomial]:
    """1, and the factors that go with v^degree where f has a term c(x) v^2, times functions of t.

    With y' = E x', E = exp(-int c dx), a factor P(x, y')^e of a multiplier for y gives E^(2 + e) for x.
    """
    own = factors.along.get(0, EMPTY)
    fitted = [EMPTY, times(EMPTY, own, 2 + degree), times(EMPTY, own, 2)]
    return list(dict.fromkeys(times(phi, in_time) for phi in fitted for in_time in factors.in_time[:3]))


def candidate_terms(material: Material, degree: int) -> list[Monomial]:
    """v^degree and the terms B(x) v^j that can cancel residuals of terms before, simple ones first."""
    motion = material.motion
    velocity = motion.velocities[0]
    slope = derivative_of_terms(motion.forces[0], velocity)
    found: dict[Monomial, None] = {frozenset([(velocity, Fraction(degree))]): None}
    fresh = list(found)
    for _ in range(bounds.FEW):
        added: dict[Monomial, None] = {}
        for key in fresh:
            added.update(dict.fromkeys(m for m in _cancelling(material, key, slope, degree) if m not in found))
        fresh = sorted(added, key=rank)[: bounds.COLUMNS - len(found)]
        found.update(dict.fromkeys(fresh))
    return sorted(found, key=rank)


def _cancelling(material: Material, key: Monomial, slope: Terms, degree: int) -> list[Monomial]:
    """Those of `_raised` that are polynomials of this degree, with t only where L may contain it."""
    known: dict[Monomial, list[Monomial]] = material.shared.setdefault("cancelling", {})
    if key not in known:
        known[key] = _raised(material, key, slope)
    motion = material.motion
    return [m for m in known[key] if _is_admissible(m, motion.with_time, motion.velocities[0], degree)]


def _raised(material: Material, key: Monomial, slope: Terms) -> list[Monomial]:
    """B v^(j-1) with dB/dx = T for a residual T v^j, and T v^j / F for a term F of df/dv."""
    motion = material.motion
    x, velocity = motion.coordinates[0], motion.velocities[0]
    divisors = [split_velocities(part) for part in slope]
    found: dict[Monomial, None] = {}
    for term in {**along(motion, {key: Fraction(1)}), **multiply_terms({key: Fraction(1)}, slope)}:
        position, moving = split_velocities(term)
        lowered = times(moving, monomial(velocity), -1)
        if _is_polynomial(lowered, velocity, _HIGHEST):
            found.update(dict.fromkeys([lowered, *(times(m, lowered) for m in antiderivatives(position, x))]))
        if motion.with_time and _is_polynomial(moving, velocity, _HIGHEST):
            found.update(dict.fromkeys(times(m, moving) for m in antiderivatives(position, TIME)))
        quotients = ((part, times(moving, power, -1)) for part, power in divisors)
        found.update(
            (times(position, part, -1) | rest, None)
            for part, rest in quotients
            if _is_polynomial(rest, velocity, _HIGHEST)
        )
    return list(found)


def _is_polynomial(moving: Monomial, velocity: Velocity, degree: int) -> bool:
    return all(p == velocity and e.denominator == 1 and 0 <= e <= degree for p, e in moving)


def _is_admissible(key: Monomial, with_time: bool, velocity: Velocity, degree: int) -> bool:
    """A polynomial of this degree in v, with t only where L may contain it."""
    if not _is_polynomial(split_velocities(key)[1], velocity, degree):
        return False
    return with_time or not any(holds(p, TIME) for p, _ in key)


def inverse_multiplier(material: Material, factors: Factors) -> Expression | None:
    """(alpha E^2 v^2 + h E v + h^2)/E^2, or None where f is not of this kind."""
    motion = material.motion
    x, v = motion.coordinates[0], motion.velocities[0]
    parts = _by_powers(material)
    if parts is None or not parts.get(1) or not parts.get(0) or (parts.get(2) and 0 not in factors.along):
        return None
    scale, damping = monomial_tree(factors.along.get(0, EMPTY)), tree_of(parts[1])
    try:
        ratio = factored(scale * tree_of(parts[0]) / damping, [x])
        alpha = factored(-(differentiate(ratio, x) / (scale * damping)), [x])
        if alpha == ZERO or holds(alpha, x, TIME):
            return None
        lowered = expanded(factored(ratio / scale, [x]))
    except TooManyTerms:
        return None
    return alpha * v**2 + lowered * v + lowered**2


def _by_powers(material: Material) -> Mapping[int, Terms] | None:
    """The coefficients of 1, v and v^2 in f; None where f holds other functions of v, or t."""
    velocity = material.motion.velocities[0]
    table: dict[int, Terms] = {}
    for key, value in material.motion.forces[0].items():
        position, moving = split_velocities(key)
        degree = dict(moving).get(velocity, 0)
        if degree not in (0, 1, 2) or len(moving) > 1 or (moving and not degree):
            return None
        if any(holds(p, TIME) for p, _ in key):
            return None
        table.setdefault(int(degree), {})[position] = value
    return table
