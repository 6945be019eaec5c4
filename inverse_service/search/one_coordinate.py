"""Lagrangians for one coordinate from Jacobi's last multiplier, which satisfies Gamma(g) + g df/dv
= 0 for x'' = f.

Multipliers are products of Darboux polynomials of Gamma = v d/dx + f d/dv: with g = phi(x) P(x,
v)^e the equation

    e Gamma(P) + (df/dv + Gamma(log phi)) P = 0

is linear in P for given phi and e. P is a polynomial in v whose set of terms is closed under adding
terms that cancel residuals, and the equations are solved at random points modulo a prime. The
multipliers tried are such powers of one polynomial, powers of its irreducible factors, and those
suggested by the factors of f itself: constant powers e_i of them with

    sum_i e_i Gamma(P_i)/P_i + df/dv = 0.

Two integrations give K with d2K/dv2 = g. Then E(K) = f K_vv +
v K_vx + K_vt - K_x is free of v, since dE/dv = Gamma(g) + g df/dv = 0, and L = K + U with dU/dx =
E(K) satisfies the Euler-Lagrange equation. Source: G. Darboux, 1878; M. J. Prelle, M. F. Singer,
1983; L. G. S. Duarte, S. E. S. Duarte, L. A. C. P. da Mota, J. E. F. Skea, 2001.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction

import mpmath
import numpy as np

from inverse_service import bounds, deadline, errors
from inverse_service.expressions import calculus, terms as tm, tree as ex
from inverse_service.field import exact_field, matrices, modular, real_branch
from inverse_service.search import ansatz, antiderivatives, families, material as mt

# The exponents tried for a polynomial of degree 1 or 2 in v.
_EXPONENTS = {
    1: tuple(
        map(
            Fraction,
            ("-3", "-2", "-1", "-4", "-3/2", "-1/2", "-5", "-5/2", "-4/3", "-5/3", "1", "2"),
        )
    ),
    2: tuple(map(Fraction, ("-1", "-3/2", "-1/2", "-2", "-5/2", "1", "1/2"))),
}
_HIGHEST = max(_EXPONENTS)
# With 60, a force of many terms takes 6 s and yields nothing.
_MOST_TERMS_OF_FORCE = 30
_MOST_FACTORS = 8


@dataclass(frozen=True, slots=True)
class LastMultiplier:
    """g = factor * product of base^exponent; only the bases, polynomials in v, contain the
    velocity.
    """

    factor: tm.Monomial
    moving: tuple[tuple[ex.Expression, ex.Expression], ...]


def _darboux_powers(
    material: mt.Material, factors: families.Factors, seed: int, degree: int
) -> Iterator[LastMultiplier]:
    """Multipliers phi P^e in factored form, with P of this degree in v."""
    phis = {e: _position_factors(factors, degree * e) for e in _EXPONENTS[degree]}
    candidates = _candidate_terms(material, degree)
    every = [*candidates, *(phi for group in phis.values() for phi in group)]
    letters, sampler = ansatz.letters_of(every), ansatz.sampler_of(material.analysis, every)
    table = ansatz.table_at(sampler.points(seed), letters, len(candidates) + matrices.SPARE)
    prime, places = table.prime, {p: k for k, p in enumerate(letters)}
    slopes = [-2 * connection[0][0] for connection, _ in ansatz.tensors_of(sampler, table)]  # df/dv

    rates_of_letters = ansatz.residues(table.derivatives.along, prime)

    def along(key: tm.Monomial) -> list[int]:
        """Gamma(log key) at each sample."""
        powers = [(places[p], modular.number_value(e, prime)) for p, e in key]
        return [sum(rates[k] * e for k, e in powers) for rates in rates_of_letters]

    products = ansatz.monomial_values(table.values, letters, candidates, prime)
    independent = matrices.pivots(products, prime)  # without 1 where it is sin^2 + cos^2
    candidates, values = (
        [candidates[k] for k in independent],
        products[:, independent].astype(object),
    )
    rates = np.array(list(map(along, candidates)), object).T
    for e, group in phis.items():
        for phi in group:
            wanted = np.array(
                [slope + rate for slope, rate in zip(slopes, along(phi), strict=True)], object
            )
            # e Gamma(P) + (df/dv + Gamma(log phi)) P = 0 for the terms of P.
            rows = values * (modular.number_value(e, prime) * rates + wanted[:, None]) % prime
            for terms in ansatz.null_combinations(
                matrices.kernel_modulo(rows.astype(np.uint64), prime), candidates
            ):
                with suppress(tm.TooManyTerms):
                    yield _in_factors(material, phi, tm.tree_of(terms), e)


def _position_factors(factors: families.Factors, degree: Fraction) -> list[tm.Monomial]:
    """1, and the factors that accompany v^degree if f has a term c(x) v^2, times functions of t.

    With y' = E x', E = exp(-int c dx), a factor P(x, y')^e of a multiplier for y gives E^(2 + e)
    for x.
    """
    own = factors.along.get(0, tm.EMPTY)
    fitted = [tm.EMPTY, tm.times(tm.EMPTY, own, 2 + degree), tm.times(tm.EMPTY, own, 2)]
    return list(
        dict.fromkeys(tm.times(phi, in_time) for phi in fitted for in_time in factors.in_time[:3])
    )


def _candidate_terms(material: mt.Material, degree: int) -> list[tm.Monomial]:
    """v^degree and the terms B(x) v^j that can cancel residuals of previous terms, simple ones
    first.
    """
    motion = material.motion
    velocity = motion.velocities[0]
    slope = tm.derivative_of_terms(motion.forces[0], velocity)
    found: dict[tm.Monomial, None] = {frozenset([(velocity, Fraction(degree))]): None}
    fresh = list(found)
    for _ in range(bounds.FEW):
        added: dict[tm.Monomial, None] = {}
        for key in fresh:
            added.update(
                dict.fromkeys(
                    m for m in _cancelling(material, key, slope, degree) if m not in found
                )
            )
        fresh = sorted(added, key=tm.rank)[: bounds.COLUMNS - len(found)]
        found.update(dict.fromkeys(fresh))
    return sorted(found, key=tm.rank)


def _cancelling(
    material: mt.Material, key: tm.Monomial, slope: tm.Terms, degree: int
) -> list[tm.Monomial]:
    """The results of `_raised` that are polynomials of at most this degree, with t only if L may
    contain it.
    """
    known: dict[tm.Monomial, list[tm.Monomial]] = material.shared.setdefault("cancelling", {})
    if key not in known:
        known[key] = _raised(material, key, slope)
    motion = material.motion
    own = (
        known[key]
        if motion.question.timed
        else [m for m in known[key] if not tm.depends_on([m], ex.TIME)]
    )
    return [m for m in own if _is_polynomial(m, degree)]


def _raised(material: mt.Material, key: tm.Monomial, slope: tm.Terms) -> list[tm.Monomial]:
    """B v^(j-1) with dB/dx = T for a residual T v^j, and T v^j / F for a term F of df/dv."""
    motion = material.motion
    x, velocity = motion.coordinates[0], motion.velocities[0]
    divisors = [tm.split_velocities(part) for part in slope]
    found: dict[tm.Monomial, None] = {}
    for term in {
        **mt.rate_of_terms(motion, {key: Fraction(1)}),
        **tm.multiply_terms({key: Fraction(1)}, slope),
    }:
        position, moving = tm.split_velocities(term)
        lowered = tm.times(moving, tm.monomial(velocity), -1)
        if _is_polynomial(lowered):
            found.update(
                dict.fromkeys(
                    [
                        lowered,
                        *(tm.times(m, lowered) for m in mt.antiderivative_candidates(position, x)),
                    ]
                )
            )
        if motion.question.timed and _is_polynomial(moving):
            found.update(
                dict.fromkeys(
                    tm.times(m, moving) for m in mt.antiderivative_candidates(position, ex.TIME)
                )
            )
        quotients = ((part, tm.times(moving, power, -1)) for part, power in divisors)
        found.update(
            (tm.times(position, part, -1) | rest, None)
            for part, rest in quotients
            if _is_polynomial(rest)
        )
    return list(found)


def _is_polynomial(key: tm.Monomial, degree: int = _HIGHEST) -> bool:
    """Whether this is a polynomial of at most this degree in v."""
    found = tm.velocity_degree(key)
    return found is not None and found <= degree


def _last_multipliers(
    material: mt.Material, factors: families.Factors, seed: int
) -> list[LastMultiplier]:
    """Distinct multipliers in factored form that pass `_may_hold`, few factors first.

    If df/dv = 0, multipliers are first integrals and g = 1 is one of them; no other avoids the
    integral of f that g = 1 requires.
    """
    found = dict.fromkeys(
        LastMultiplier(phi, ()) for phi in _position_factors(factors, Fraction(0)) if phi
    )
    powers = dict[LastMultiplier, None]()
    if not tm.derivative_of_terms(material.motion.forces[0], material.motion.velocities[0]):
        found[LastMultiplier(tm.EMPTY, ())] = None
    else:
        for degree in _EXPONENTS:
            with suppress(
                errors.IrreducibleAtoms, modular.SingularPoint, tm.TooManyTerms, ValueError
            ):
                powers |= dict.fromkeys(_darboux_powers(material, factors, seed, degree))
    if moving := moving_factors(material):
        found[LastMultiplier(tm.EMPTY, tuple((base, ex.negated(e)) for base, e in moving))] = None
        found |= dict.fromkeys(_powers_of_factors(material))
    fulfilled = (multiplier for multiplier in found | powers if _may_hold(material, multiplier))
    return sorted(fulfilled, key=lambda multiplier: len(multiplier.moving))


def _may_hold(material: mt.Material, multiplier: LastMultiplier) -> bool:
    """Whether Gamma(log g) + df/dv is 0 at the real point, a necessary condition, and the factors
    are short.
    """
    (x,), (v,), (f,) = (
        material.motion.coordinates,
        material.motion.velocities,
        material.analysis.system.accelerations,
    )
    factors = [(tm.monomial_tree(multiplier.factor), ex.ONE), *multiplier.moving]
    if max(ex.node_count(base) for base, _ in factors) > 2 * bounds.NODES:
        return False
    rates = [
        e * weight * calculus.differentiate(base, letter) / base
        for base, e in factors
        for letter, weight in ((ex.TIME, ex.ONE), (x, v), (v, f))
    ]
    with mpmath.workdps(bounds.DIGITS), suppress(calculus.NoRealValue):
        residual = ex.add(calculus.differentiate(f, v), *rates)
        return real_branch.is_small(residual, material.analysis.real_point or {})
    return True


def _in_factors(
    material: mt.Material, phi: tm.Monomial, polynomial: ex.Expression, exponent: Fraction
) -> LastMultiplier:
    """phi P^e with P factored; factors without velocity join phi, and constants are dropped."""
    x, v = material.motion.coordinates[0], material.motion.velocities[0]
    moving = []
    for base, e in ex.powers_of(antiderivatives.factored_tree(polynomial, [x, v])):
        if tm.has_velocity(base):
            moving.append(
                (tm.tree_of(tm.shortest_in_angles(tm.terms_of(base))), ex.number(e * exponent))
            )
        elif not isinstance(base, ex.Number) and ex.holds(base, x, ex.TIME):
            phi = tm.times(phi, antiderivatives.monomial_of(base), e * exponent)
    return LastMultiplier(phi, tuple(moving))


def moving_factors(material: mt.Material) -> list[tuple[ex.Expression, ex.Expression]]:
    """(base, exponent) of the factors of f that contain v; 1/F is a multiplier of f = F(v) G(t,
    x).
    """
    x, v = material.motion.coordinates[0], material.motion.velocities[0]
    try:
        force = antiderivatives.factored_tree(material.analysis.system.accelerations[0], [x, v])
    except tm.TooManyTerms:
        return []
    factors = ex.factors_of(force)
    pairs = [(f.base, f.exponent) if isinstance(f, ex.Power) else (f, ex.ONE) for f in factors]
    return [(base, exponent) for base, exponent in pairs if tm.has_velocity(base)]


def _powers_of_factors(material: mt.Material) -> list[LastMultiplier]:
    """Products of constant powers of the factors of f and of x that are multipliers.

    For f from L = v^2/2 - V(x, v), d2L/dv2 is the denominator of f up to such factors. A product
    that is constant along all motions may leave one of them out.
    """
    x, v = material.motion.coordinates[0], material.motion.velocities[0]
    (force,) = material.analysis.system.accelerations
    with suppress(exact_field.TooLarge, ZeroDivisionError, tm.TooManyTerms):
        factors = ex.powers_of(antiderivatives.factored_tree(force, [x, v]))
        bases = list(dict.fromkeys([*(base for base, _ in factors if ex.holds(base, x, v)), x]))
        timed = any(ex.holds(base, ex.TIME) for base in bases)
        if len(bases) > _MOST_FACTORS or (timed and not material.motion.question.timed):
            return []
        rates = [
            ex.add(
                *(
                    weight * calculus.differentiate(base, letter)
                    for letter, weight in ((ex.TIME, ex.ONE), (x, v), (v, force))
                )
            )
            / base
            for base in bases
        ]
        trees = [*rates, calculus.differentiate(force, v)]
        ring = exact_field.exact_ring(trees, [ex.TIME, x, v], None, exact_field.Budget.long())
        vectors = matrices.null_vectors(ring, [[ring.value(tree)] for tree in trees])
        integrals = [vector for vector in vectors if vector[-1].is_zero]
        exponents = [
            [c / last for c in (*rest, last)] for *rest, last in vectors if not last.is_zero
        ]
        exponents += [
            [c - d * one[k] / other[k] for c, d in zip(one, other, strict=True)]
            for one in exponents
            for other in integrals
            for k, c in enumerate(other)
            if not (c.is_zero or one[k].is_zero)
        ]
        return [
            LastMultiplier(
                tm.EMPTY,
                tuple(
                    (base, exact_field.quotient_tree(ring, e))
                    for base, e in zip(bases, one, strict=False)
                    if not e.is_zero
                ),
            )
            for one in exponents
        ]
    return []


def propose_function_of_velocity(material: mt.Material, seed: int) -> list[ex.Expression]:
    """L with g = phi(t, x)/F(v) for the first suitable F; quadratures give phi, K with K_vv = g,
    and the potential.
    """
    for function in _functions_of_velocity(material):
        with suppress(tm.TooManyTerms):
            found = _of_function(material, function)
            if found is not None:
                return [found]
    return []


def _functions_of_velocity(material: mt.Material) -> Iterator[ex.Expression]:
    """Candidates for F: the factors of f that contain only v, and the v-dependent part of each term
    of f.
    """
    x = material.motion.coordinates[0]
    found = [
        ex.multiply(
            *(base**e for base, e in moving_factors(material) if not ex.holds(base, x, ex.TIME))
        )
    ]
    found += [tm.monomial_tree(tm.split_velocities(key)[1]) for key in material.motion.forces[0]]
    yield from dict.fromkeys(tree for tree in found if not ex.holds(tree, x, ex.TIME))


def _of_function(material: mt.Material, function: ex.Expression) -> ex.Expression | None:
    """phi (v P - Q) + int phi G dx for f = F (G - A P - B Q), where P' = 1/F, Q' = v/F, A =
    phi_t/phi, B = phi_x/phi.

    1/F is a multiplier of f = F G; A(t) and B(x) follow from F d(f/F)/dv = -(A + B v).
    """
    x, v = material.motion.coordinates[0], material.motion.velocities[0]
    system = material.analysis.system
    rest = antiderivatives.factored_tree(system.accelerations[0] / function, [x, v])
    rate = antiderivatives.factored_tree(function * (-calculus.differentiate(rest, v)), [x, v])
    along = antiderivatives.factored_tree(calculus.differentiate(rate, v), [x, v])
    in_time = antiderivatives.factored_tree(rate - v * along, [x, v])
    if (
        ex.holds(along, v, ex.TIME)
        or ex.holds(in_time, v, x)
        or (in_time != ex.ZERO and not material.motion.question.timed)
    ):
        return None
    integrator = antiderivatives.Integrator(
        system, material.analysis.real_point, integral_signs=True
    )
    phi = antiderivatives.ONE_TERM
    for c, q in ((in_time, ex.TIME), (along, x)):
        logarithm = integrator.function_of([q], [tm.terms_of(c)])
        if logarithm is None:
            return None
        phi = tm.multiply_terms(phi, integrator.exponential(logarithm))
    integrals = []
    for slope, c in ((1 / function, in_time), (v / function, along)):
        plain = tm.tree_of(tm.terms_of(slope))
        found = antiderivatives.antiderivative(system, plain, v, material.analysis.real_point)
        if found is None and c != ex.ZERO:
            return None
        integral = (
            ex.Integral(next(integrator.names), (v,), (0,), (plain,)) if found is None else found
        )
        integrals.append(integral)
        rest = rest + c * integral
    force = tm.terms_of(tm.tree_of(phi) * antiderivatives.factored_tree(rest, [x, v]))
    if any(tm.has_velocity(letter) for key in force for letter, _ in key):
        return None
    potential_part = integrator.function_of([x], [force])
    kinetic = tm.terms_of(tm.tree_of(phi) * (v * integrals[0] - integrals[1]))
    return None if potential_part is None else tm.tree_of(kinetic) + tm.tree_of(potential_part)


def applies(material: mt.Material) -> bool:
    """Whether f has moderate size and depth and a real point."""
    force = material.motion.forces[0]
    return (
        len(force) <= _MOST_TERMS_OF_FORCE
        and not antiderivatives.is_deep(letter for key in force for letter, _ in key)
        and material.analysis.real_point is not None
    )


def propose(material: mt.Material, seed: int) -> Sequence[ex.Expression]:
    """Lagrangians whose multiplier is a product of Darboux factors, simplest first; unverified
    candidates.
    """
    found: dict[ex.Expression, None] = {}
    for multiplier in _last_multipliers(material, families.find_factors(material), seed)[
        : bounds.CANDIDATES
    ]:
        deadline.check()
        lagrangian = lagrangian_of_multiplier(material, multiplier)
        if lagrangian is not None:
            found[lagrangian] = None
    return sorted(found, key=antiderivatives.reading_weight)


def lagrangian_of_multiplier(
    material: mt.Material, multiplier: LastMultiplier
) -> ex.Expression | None:
    """L in closed form, with d2L/dv2 positive at the real point of f; None if none is found."""
    motion, point = material.motion, material.analysis.real_point
    if point is None:
        return None
    integrator, (velocity,) = (
        antiderivatives.Integrator(material.analysis.system, point),
        motion.velocities,
    )
    with suppress(calculus.NoRealValue, errors.IrreducibleAtoms, tm.TooManyTerms):
        bases = [mt.positive_form(base, point) ** e for base, e in multiplier.moving]
        slope: tm.Terms | None = tm.terms_of(
            ex.multiply(tm.monomial_tree(multiplier.factor), *bases)
        )
        for _ in range(2):
            slope = None if slope is None else integrator.function_of([velocity], [slope])
        # Terms linear in the velocity are left to the potential: they may be total derivatives.
        found = slope and families.with_potential(
            material, {key: c for key, c in slope.items() if not tm.is_affine(key)}
        )
        return _with_positive_hessian(found, velocity, point) if found else None
    return None


def _with_positive_hessian(
    lagrangian: tm.Terms, velocity: ex.Velocity, point: real_branch.RealTable
) -> ex.Expression:
    """The simpler of L and its multiple with simple coefficients, with a positive Hessian at the
    point.
    """
    tree = min(
        tm.tree_of(lagrangian),
        tm.tree_of(ansatz.with_simple_coefficients(lagrangian)),
        key=antiderivatives.reading_weight,
    )
    hessian = calculus.differentiate(calculus.differentiate(tree, velocity), velocity)
    return tree if real_branch.real_sign(hessian, point) > 0 else ex.negated(tree)
