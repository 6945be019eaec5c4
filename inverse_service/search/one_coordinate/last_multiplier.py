"""Lagrangians for one coordinate from Jacobi's last multipliers (Jacobi 1844; Darboux 1894): phi(x) P_1^e_1 P_2^e_2.

First powers phi P^e of one polynomial (see `darboux`); then the irreducible factors
P_j of all of them are combined with letters of f, by linear algebra in the exponents:
    sum_j e_j Gamma(log P_j) = -df/dv.
The quotient of two multipliers is a first integral I of Gamma, and g I^k is a multiplier again, so
different solutions e are the functions of first integrals times a multiplier that are in reach.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction

from inverse_service import bounds
from inverse_service.deadline import check
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.evaluation import NoRealValue
from inverse_service.expressions.tree import (
    ONE,
    TIME,
    ZERO,
    Apply,
    Expression,
    Integral,
    Number,
    Power,
    add,
    factors_of,
    holds,
    is_exponential,
    multiply,
    negated,
    powers_of,
    walk,
)
from inverse_service.field.real_point import real_sign
from inverse_service.field.truncated_series import SingularPoint
from inverse_service.search.choice import scaled
from inverse_service.search.factors import Factors, find_factors
from inverse_service.search.material import Material
from inverse_service.search.motion_terms import has_velocity, split_velocities
from inverse_service.search.null_vectors import SPARE, small_solution
from inverse_service.search.one_coordinate.algebra import (
    expanded,
    factored,
    weight,
)
from inverse_service.search.one_coordinate.darboux import (
    Samples,
    darboux_powers,
    inverse_multiplier,
    position_factors,
    sampled,
)
from inverse_service.search.one_coordinate.kinetic import (
    NotElementary,
    Place,
    coefficients,
    double_integral,
    potential,
)
from inverse_service.search.quadratures import (
    antiderivative,
    exponential_of_integral,
    fresh_names,
    potential_with_integrals,
)
from inverse_service.search.terms import (
    EMPTY,
    Monomial,
    TooManyTerms,
    derivative_of_terms,
    monomial,
    monomial_tree,
    terms_of,
    times,
    tree_of,
)


@dataclass(frozen=True, slots=True)
class LastMultiplier:
    """g = factor * product of base^exponent; only the bases, polynomials in v, hold the velocity."""

    factor: Monomial
    moving: tuple[tuple[Expression, Fraction], ...]


def last_multipliers(material: Material, factors: Factors, seed: int) -> list[LastMultiplier]:
    """Multipliers in factors, each once, few factors first.

    Those without velocity are only candidates: most of them fulfil no equation.
    """
    factors = _simplified(material, factors)
    found = dict.fromkeys(LastMultiplier(phi, ()) for phi in position_factors(factors, Fraction(0)) if phi)
    if not derivative_of_terms(material.motion.forces[0], material.motion.velocities[0]):
        found[LastMultiplier(EMPTY, ())] = None
    powers = [
        (power.factor, tree_of(dict(power.base)), power.exponent) for power in darboux_powers(material, factors, seed)
    ]
    inverse = inverse_multiplier(material, factors)
    if inverse is not None:
        powers.append((EMPTY, inverse, Fraction(-1)))
    moving = _moving_factors(material)
    if moving and all(isinstance(e, Number) for _, e in moving):
        found[LastMultiplier(EMPTY, tuple((base, -e.value) for base, e in moving if isinstance(e, Number)))] = None
    for phi, base, exponent in powers:
        try:
            found[_in_factors(material, phi, base, exponent)] = None
        except TooManyTerms:
            continue
    bases = list(dict.fromkeys(base for multiplier in found for base, _ in multiplier.moving))
    found.update(dict.fromkeys(_combined(material, bases[: bounds.FEW], seed)))
    return sorted(found, key=lambda multiplier: len(multiplier.moving))


def _simplified(material: Material, factors: Factors) -> Factors:
    """With the argument of the exponential in exp(-int c dx) over one denominator."""
    x = material.motion.coordinates[0]
    along = {}
    for i, phi in factors.along.items():
        arguments = [e * p.argument for p, e in phi if is_exponential(p)]
        rest = frozenset(item for item in phi if not is_exponential(item[0]))
        try:
            ((key, _),) = terms_of(Apply("exp", factored(add(*arguments), [x]))).items()
            along[i] = times(rest, key) if arguments else phi
        except TooManyTerms:
            along[i] = phi
    return replace(factors, along=along)


def _in_factors(material: Material, phi: Monomial, polynomial: Expression, exponent: Fraction) -> LastMultiplier:
    """phi P^e with P factored; its factors without velocity go into phi, constants are dropped."""
    x, v = material.motion.coordinates[0], material.motion.velocities[0]
    moving = []
    for base, e in powers_of(factored(polynomial, [x, v])):
        if has_velocity(base):
            moving.append((expanded(base), e * exponent))
        elif not isinstance(base, Number) and holds(base, x, TIME):
            phi = times(phi, _letters(base), e * exponent)
    return LastMultiplier(phi, tuple(moving))


def _letters(base: Expression) -> Monomial:
    """A factor as a monomial; exp(u + …) is a product of letters."""
    if is_exponential(base):
        ((key, _),) = terms_of(base).items()
        return key
    return monomial(base)


def _combined(material: Material, bases: Sequence[Expression], seed: int) -> Iterable[LastMultiplier]:
    """One base, or two linear ones with e_1 + e_2 = -3, with exponents of letters of f, for df/dv."""
    if not bases:
        return
    letters = [p for p in material.position_letters if not isinstance(p, Number)][: bounds.FEW]
    try:
        samples = sampled(material, [monomial(p) for p in (*bases, *letters)], len(letters) + SPARE, seed)
    except (IrreducibleAtoms, SingularPoint, ValueError):
        return
    linear = [base for base in bases if _degree(material, base) == 1]
    choices: list[tuple[Expression, ...]] = [(base,) for base in bases]
    for chosen in [*choices, *itertools.combinations(linear, 2)]:
        solution = small_solution(_equations(samples, chosen, letters), samples.prime)
        if solution is not None:
            used = [(p, e) for p, e in zip([*chosen, *letters], solution, strict=True) if e]
            yield LastMultiplier(
                frozenset(item for item in used if item[0] not in chosen),
                tuple(item for item in used if item[0] in chosen),
            )


def _degree(material: Material, base: Expression) -> int:
    try:
        return len(coefficients(base, material.motion.velocities[0])) - 1
    except NotElementary:
        return 0


def _equations(samples: Samples, chosen: Sequence[Expression], letters: Sequence[Expression]) -> list[list[int]]:
    """Rows (Gamma(log p) for each p, -df/dv), and for two factors the one that makes the integral algebraic."""
    columns = [monomial(p) for p in (*chosen, *letters)]
    rows = [
        [*(samples.along(k, key) for key in columns), -slope % samples.prime] for k, slope in enumerate(samples.slopes)
    ]
    if len(chosen) == 2:
        rows.append([1, 1, *(0 for _ in letters), samples.prime - 3])
    return rows


def _moving_factors(material: Material) -> list[tuple[Expression, Expression]]:
    """(base, exponent) of the factors of f that hold v, numbers left out: for f = F(v) G(t, x), 1/F is a multiplier."""
    x, v = material.motion.coordinates[0], material.motion.velocities[0]
    try:
        force = factored(material.analysis.system.accelerations[0], [x, v])
    except TooManyTerms:
        return []
    factors = factors_of(force)
    pairs = [(f.base, f.exponent) if isinstance(f, Power) else (f, ONE) for f in factors]
    return [(base, exponent) for base, exponent in pairs if has_velocity(base)]


def _of_symbolic_power(material: Material) -> Expression | None:
    """For f = P^e G, P = a v + b and e a letter: int int P^(-e) = P^(2 - e)/((1 - e)(2 - e) a^2), and a potential."""
    point, moving = material.analysis.real_point, _moving_factors(material)
    if point is None or len(moving) != 1 or isinstance(moving[0][1], Number):
        return None
    ((base, e),) = moving
    place = Place(material.motion.coordinates[0], material.motion.velocities[0], point)
    try:
        _, a = coefficients(base, place.v)
        below = (1 - e) * (2 - e) * a**2
        kinetic = base ** (2 - e) / below
        rest = potential(kinetic, material.analysis.system.accelerations[0], place)
    except (ValueError, NotElementary, NoRealValue, IrreducibleAtoms, TooManyTerms):
        return None
    return None if rest is None else kinetic + rest


def propose_function_of_velocity(material: Material, seed: int) -> list[Expression]:
    """As `propose_with_integrals`, where all integrals are elementary."""
    found = propose_with_integrals(material, seed)
    return [tree for tree in found if not any(isinstance(node, Integral) for node in walk(tree))]


def propose_with_integrals(material: Material, seed: int) -> list[Expression]:
    """L with g = phi(t, x)/F(v), for the first F that will do; phi, the two integrals of g and the potential by
    quadratures."""
    for function in _functions_of_velocity(material):
        with suppress(TooManyTerms):
            found = _of_function(material, function)
            if found is not None:
                return [found]
    return []


def _functions_of_velocity(material: Material) -> Iterator[Expression]:
    """Candidates for F: the factors of f that hold v alone, and what each term of f holds of v."""
    x = material.motion.coordinates[0]
    found = [multiply(*(base**e for base, e in _moving_factors(material) if not holds(base, x, TIME)))]
    found += [monomial_tree(split_velocities(key)[1]) for key in material.motion.forces[0]]
    yield from dict.fromkeys(tree for tree in found if not holds(tree, x, TIME))


def _of_function(material: Material, function: Expression) -> Expression | None:
    """phi (v P - Q) + int phi G dx for f = F (G - A P - B Q), where P' = 1/F, Q' = v/F, A = phi_t/phi, B = phi_x/phi.

    1/F is a multiplier of f = F G; A(t) and B(x) follow from F d(f/F)/dv = -(A + B v).
    """
    x, v = material.motion.coordinates[0], material.motion.velocities[0]
    system = material.analysis.system
    rest = factored(system.accelerations[0] / function, [x, v])
    rate = factored(function * (-differentiate(rest, v)), [x, v])
    along = factored(differentiate(rate, v), [x, v])
    in_time = factored(rate - v * along, [x, v])
    if holds(along, v, TIME) or holds(in_time, v, x) or (in_time != ZERO and not material.motion.with_time):
        return None
    phi = multiply(*(exponential_of_integral(c, q, material.analysis) for c, q in ((in_time, TIME), (along, x))))
    names = fresh_names(system, phi)
    integrals = []
    for slope, c in ((1 / function, in_time), (v / function, along)):
        known = antiderivative(system, tree_of(terms_of(slope)), v, material.analysis.real_point)
        if known is None and c != ZERO:
            return None
        tree = Integral(next(names), (v,), (0,), (tree_of(terms_of(slope)),)) if known is None else known
        integrals.append(tree)
        rest = rest + c * tree if c != ZERO else rest
    force = phi * factored(rest, [x, v])
    kinetic = phi * (v * integrals[0] - integrals[1])
    potential_part = potential_with_integrals(system, kinetic, terms_of(-force), material.analysis.real_point)
    return None if potential_part is None else tree_of(terms_of(kinetic)) + potential_part


# With 60 a force of many terms takes 6 s in vain.
_MOST_TERMS_OF_FORCE = 30


def applies(material: Material) -> bool:
    """One coordinate, f of moderate size with a real point."""
    motion = material.motion
    moderate = motion.size == 1 and len(motion.forces[0]) <= _MOST_TERMS_OF_FORCE
    return moderate and material.analysis.real_point is not None


def propose(material: Material, seed: int) -> Sequence[Expression]:
    """Lagrangians whose multiplier is a product of Darboux factors, the simplest first; each is a candidate only."""
    found: dict[Expression, None] = {}
    for multiplier in last_multipliers(material, find_factors(material, seed), seed)[: bounds.CANDIDATES]:
        check()
        lagrangian = lagrangian_of(material, multiplier)
        if lagrangian is not None:
            found[lagrangian] = None
    symbolic = _of_symbolic_power(material)
    if symbolic is not None:
        found[symbolic] = None
    return sorted(found, key=weight)


def lagrangian_of(material: Material, multiplier: LastMultiplier) -> Expression | None:
    """L = K + U in closed form, with d2L/dv2 positive at the real point of f; None where there is none."""
    motion, point = material.motion, material.analysis.real_point
    force = material.analysis.system.accelerations[0]
    if point is None:
        return None
    place = Place(motion.coordinates[0], motion.velocities[0], point)
    try:
        bases = [(_oriented(base, place), e) for base, e in multiplier.moving]
        kinetic = double_integral(monomial_tree(multiplier.factor), bases, place)
        rest = potential(kinetic, force, place)
        return None if rest is None else _positive(kinetic + rest, place)
    except (NotElementary, NoRealValue, IrreducibleAtoms, TooManyTerms):
        return None


def _oriented(base: Expression, place: Place) -> Expression:
    """The base or its opposite, positive at the real point."""
    return base if real_sign(base, place.point) > 0 else negated(base)


def _positive(lagrangian: Expression, place: Place) -> Expression:
    """The shorter of the tree and its expansion with simple coefficients, with a positive Hessian at the point."""
    tree = min((tree_of(scaled(terms_of(lagrangian))), lagrangian), key=weight)
    hessian = differentiate(differentiate(tree, place.v), place.v)
    if real_sign(hessian, place.point) > 0:
        return tree
    return negated(tree)
