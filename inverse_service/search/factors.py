"""The functions of time and position by which an ansatz multiplies its functions of the velocities.

The factor e^(ct) follows from the divergence of f: (H2) gives Gamma(log det g) = 2 tr N = -div_v f, so that n c is the
constant part of -div_v f.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import inf, lcm

from inverse_service import bounds, errors
from inverse_service.expressions import derivative, tree as ex
from inverse_service.mechanics import implicit_equations, second_order_system
from inverse_service.search import gradients, terms as tm
from inverse_service.search.material import (
    Material,
    integrating_candidates,
    positive,
)

HALF = Fraction(1, 2)
# Functions of t that multiply terms. With 4 or 12 a system of three rates (e^(-t), e^(2 t/3), e^(3 t/2)) has
# no L: four omit one of them, and twelve leave too little room for the other factors.
_MOST_IN_TIME = 6


def integrating_factor(material: Material, c: tm.Terms, variable: ex.Symbol) -> tm.Monomial | None:
    """exp(-int c d variable) if it is a product of powers of generators and exponentials, else None."""
    table, phi, rest = material.analysis.real_point, tm.EMPTY, tm.Terms()
    integrator = gradients.Integrator(material.analysis.system, table)
    with suppress(tm.TooManyTerms):
        logarithm = _logarithm(material.analysis.system, frozenset(c.items()), variable)
        for key, value in logarithm.items() if logarithm is not None else ():
            match [*key]:
                case [(ex.Apply("log", ex.Sum() as base), power)] if power == 1:
                    phi = tm.times(phi, tm.monomial(positive(base, table)), value)  # not expanded
                case _:
                    rest[key] = value
        found = None if logarithm is None else integrator.exponential(rest)
        return tm.times(tm.EMPTY, tm.times(phi, next(iter(found))), -1) if found and len(found) == 1 else None
    return None


@lru_cache(maxsize=256)
def _logarithm(
    system: second_order_system.SecondOrderSystem, c: frozenset[tuple[tm.Monomial, Fraction]], variable: ex.Symbol
) -> tm.Terms | None:
    """int c d variable, cached because both questions and several rows need it."""
    return gradients.Integrator(system).function_of([variable], [dict(c)])


def divergence_factor(material: Material) -> tm.Monomial | None:
    """exp(ct) with n c the constant terms of -div_v f; None if there are none."""
    motion = material.motion
    slopes = map(tm.derivative_of_terms, motion.forces, motion.velocities)
    rate = tm.weighted_sum((slope, Fraction(-1, motion.size)) for slope in slopes)
    moving = material.analysis.system.variables
    constant = {key: c for key, c in rate.items() if not any(ex.holds(letter, *moving) for letter, _ in key)}
    return next(iter(tm.terms_of(ex.Apply("exp", tm.tree_of(constant) * ex.TIME))), None) if constant else None


def asks_for_no_time(system: second_order_system.SecondOrderSystem) -> bool:
    """Whether div_v f = 0, or f is homogeneous of degree 2 in v: no factor e^(ct) follows then.

    With degree 2, q(at) is a motion if q(t) is one, so no rate c is special.
    """
    velocities = [ex.Velocity(name) for name in system.coordinates]
    slopes = [[derivative.differentiate(f, v) for v in velocities] for f in system.accelerations]
    turned = [ex.dot(row, velocities) - 2 * f for row, f in zip(slopes, system.accelerations, strict=True)]
    with suppress(errors.InputError):
        divergence = ex.add(ex.ZERO, *(row[i] for i, row in enumerate(slopes)))
        return implicit_equations.vanishes(divergence) or all(map(implicit_equations.vanishes, turned))
    return False


@dataclass(frozen=True, slots=True)
class Factors:
    """The factors that follow from the coefficients c of v_i v_l and v_i in f_i.

    `along[i]` is exp(-int c_ii dq_i), `across[i]` the product of exp(-int c_il dq_l) over l != i;
    `in_time` holds 1 and exp(-int c dt); `plain` all factors for a quadratic L, and their inverses.
    """

    along: Mapping[int, tm.Monomial]
    across: Mapping[int, tm.Monomial]
    in_time: tuple[tm.Monomial, ...]
    plain: tuple[tm.Monomial, ...]

    def of_degree(self, i: int, degree: Fraction) -> list[tm.Monomial]:
        """Candidates phi for g_ii = phi v_i^degree, from all c_il or from c_ii alone."""
        own = tm.times(tm.EMPTY, self.along.get(i, tm.EMPTY), 2 + degree)
        return list(dict.fromkeys([own, tm.times(own, self.across.get(i, tm.EMPTY), 1 + degree)]))


NO_FACTORS = Factors({}, {}, (tm.EMPTY,), (tm.EMPTY,))


def find_factors(material: Material) -> Factors:
    """The integrating factors of all coefficients for which they are products of generators."""
    along: dict[int, tm.Monomial] = {}
    across: dict[int, tm.Monomial] = {}
    single: dict[tm.Monomial, None] = {tm.EMPTY: None}
    in_time: dict[tm.Monomial, None] = {tm.EMPTY: None}
    for i, c, variable in integrating_candidates(material)[: bounds.COLUMNS]:
        factor = integrating_factor(material, c, variable)
        if not factor:
            continue
        if variable == ex.TIME:
            # g = e^(-(1 + k) int c dt) v^k solves Gamma(g) = -g df/dv for f = c v.
            in_time.update(dict.fromkeys(tm.times(tm.EMPTY, factor, e) for e in (1, -1, 2, -2, 3)))
        elif variable == material.motion.coordinates[i]:
            along[i] = factor
            single[tm.times(tm.EMPTY, factor, 2)] = None
        else:
            across[i] = tm.times(across.get(i, tm.EMPTY), factor)
            single[factor] = None
    whole = divergence_factor(material) if material.motion.with_time else None
    if whole:
        in_time[whole] = None
    for i in range(material.motion.size):
        single[tm.times(across.get(i, tm.EMPTY), along.get(i, tm.EMPTY), 2)] = None
    inverted = [tm.times(tm.EMPTY, factor, -1) for factor in single]
    chosen = tuple(dict.fromkeys([*sorted(single, key=tm.rank), *sorted(inverted, key=tm.rank)]))[: bounds.CANDIDATES]
    return Factors(along, across, tuple(_first(in_time, whole)), chosen)


def _first(in_time: Iterable[tm.Monomial], whole: tm.Monomial | None) -> list[tm.Monomial]:
    """1, the factor `whole` of the divergence, and the simplest other factors."""
    ordered = [tm.EMPTY, *([whole] if whole else []), *sorted(in_time, key=tm.rank)]
    return list(dict.fromkeys(ordered))[:_MOST_IN_TIME]


def products(left: Iterable[tm.Monomial], right: Sequence[tm.Monomial]) -> list[tm.Monomial]:
    """All products of one factor from each side."""
    return [tm.times(a, b) for a in left for b in right]


def _exponents(letter: ex.Expression, seen: set[Fraction]) -> list[Fraction]:
    """The exponents tried for a generator of position, given its exponents in f."""
    one = Fraction(1)
    if isinstance(letter, ex.Sum):
        return [one, -one, HALF, -HALF]
    if ex.is_exponential(letter):
        highest = int(max([one, *(abs(e) for e in seen)]))
        whole = [k * one for k in range(1, min(highest, bounds.POWER) + 1)]
        unit = Fraction(1, lcm(*(e.denominator for e in seen)))  # e^(3x/2) is a power of e^(x/2)
        return [sign * e for e in dict.fromkeys((*whole, unit)) for sign in (1, -1)]
    return [one, -one] if any(e < 0 for e in seen) else [one]


def position_monomials(material: Material, degree: int, room: float = inf) -> list[tm.Monomial]:
    """Products of at most `degree` generators of position: sums with inverses and roots, other generators with powers
    as in f.

    Products of three or more generators are added only while there are at most `room` in all.
    """
    powers: dict[ex.Expression, set[Fraction]] = {}
    for terms in material.motion.forces:
        for key in terms:
            for letter, e in key:
                powers.setdefault(letter, set()).add(e)
    units: list[tm.Monomial] = []
    for letter in material.position_letters:
        units += [frozenset([(letter, e)]) for e in _exponents(letter, powers.get(letter, set()))]
    found, layer = {tm.EMPTY}, [(tm.EMPTY, 0)]  # products, and the first unit that may extend them
    for count in range(1, degree + 1):
        layer = [(tm.times(m, units[k]), k) for m, first in layer for k in range(first, len(units))]
        every = found.union(m for m, _ in layer)
        if count > 2 and len(every) > room:
            break
        found = every
    return sorted(found, key=tm.rank)
