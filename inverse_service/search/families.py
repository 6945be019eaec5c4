"""The rows of the ansatz: functions of the velocities times functions of position, by increasing
weight.

One place (t, q) shows which functions of the velocities can occur in a multiplier: for g = sum_k
c_k(t, q) Hessian(s_k), the coefficients and their derivatives are numbers at this place, and (H2),
(H3) are linear in them for every v. Functions s_k with c_k = 0 in all solutions are dropped before
coefficients are guessed. If no solution is regular, no ansatz with these shapes contains a
Lagrangian. The remaining functions are multiplied by short products of generators of f. If the
Hessian of a combination is a multiplier, its Euler-Lagrange expressions are affine in the
velocities: they equal those of a term A_i(t, q) v_i - V(t, q), which integration yields.

The factor e^(ct) follows from the divergence of f: (H2) gives Gamma(log det g) = 2 tr N = -div_v f,
so that n c is the constant part of -div_v f.
"""

import itertools
import random
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from itertools import combinations_with_replacement
from math import inf, lcm

import numpy as np
from flint import nmod_mat

from inverse_service import bounds, deadline, errors
from inverse_service.expressions import calculus, terms as tm, tree as ex
from inverse_service.field import exact_field, matrices, modular, real_branch
from inverse_service.field.echelon import Words
from inverse_service.field.modular import Variable, variables_in
from inverse_service.mechanics import second_order_system
from inverse_service.search import ansatz, antiderivatives, material as mt
from inverse_service.statements.questions import TIMED

# Functions of t that multiply terms. With 4 or 12 a system of three rates (e^(-t), e^(2 t/3), e^(3
# t/2)) has no L: four omit one of them, and twelve leave too little room for the other factors.
_MOST_IN_TIME = 6
_POWERS = tuple(Fraction(e, 2) for e in (1, 3, 4, 5, 6, 8, -2, -4))
_ROOTS = tuple(Fraction(e, 2) for e in (1, -1, 2, -2, 3, -3, 4))
_HALVES = (Fraction(1, 2), Fraction(-1, 2))
NAME = "the given terms"


def integrating_factor(
    material: mt.Material, c: tm.Terms, variable: ex.Symbol
) -> tm.Monomial | None:
    """exp(-int c d variable) if it is a product of powers of generators and exponentials, else
    None.
    """
    table, phi, rest = material.analysis.real_point, tm.EMPTY, tm.Terms()
    integrator = antiderivatives.Integrator(material.analysis.system, table)
    with suppress(tm.TooManyTerms):
        logarithm = _integral_of(material.analysis.system, frozenset(c.items()), variable)
        for key, value in logarithm.items() if logarithm is not None else ():
            match [*key]:
                case [(ex.Apply("log", ex.Sum() as base), power)] if power == 1:
                    phi = tm.times(
                        phi, tm.monomial(mt.positive_form(base, table)), value
                    )  # not expanded
                case _:
                    rest[key] = value
        found = None if logarithm is None else integrator.exponential(rest)
        return (
            tm.times(tm.EMPTY, tm.times(phi, next(iter(found))), -1)
            if found and len(found) == 1
            else None
        )
    return None


@lru_cache(maxsize=256)
def _integral_of(
    system: second_order_system.SecondOrderSystem,
    c: frozenset[tuple[tm.Monomial, Fraction]],
    variable: ex.Symbol,
) -> tm.Terms | None:
    """int c d variable, cached because both questions and several rows need it."""
    return antiderivatives.Integrator(system).function_of([variable], [dict(c)])


def divergence_factor(material: mt.Material) -> tm.Monomial | None:
    """exp(ct) with n c the constant terms of -div_v f; None if there are none, or too many terms."""
    motion = material.motion
    slopes = map(tm.derivative_of_terms, motion.forces, motion.velocities)
    try:
        rate = tm.weighted_sum((slope, Fraction(-1, motion.size)) for slope in slopes)
    except tm.TooManyTerms:
        return None
    moving = material.analysis.system.variables
    constant = {key: c for key, c in rate.items() if not tm.depends_on([key], *moving)}
    return (
        next(iter(tm.terms_of(ex.Apply("exp", tm.tree_of(constant) * ex.TIME))), None)
        if constant
        else None
    )


def excludes_factor_of_time(system: second_order_system.SecondOrderSystem) -> bool:
    """Whether div_v f = 0, or f is homogeneous of degree 2 in v: no factor e^(ct) follows then.

    With degree 2, q(at) is a motion if q(t) is one, so no rate c is special.
    """
    velocities = [ex.Velocity(name) for name in system.coordinates]
    slopes = [[calculus.differentiate(f, v) for v in velocities] for f in system.accelerations]
    turned = [
        ex.dot(row, velocities) - 2 * f for row, f in zip(slopes, system.accelerations, strict=True)
    ]
    with suppress(errors.InputError):
        divergence = ex.add(ex.ZERO, *(row[i] for i, row in enumerate(slopes)))
        return real_branch.vanishes(divergence) or all(map(real_branch.vanishes, turned))
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


def find_factors(material: mt.Material) -> Factors:
    """The integrating factors of all coefficients for which they are products of generators."""
    along: dict[int, tm.Monomial] = {}
    across: dict[int, tm.Monomial] = {}
    single: dict[tm.Monomial, None] = {tm.EMPTY: None}
    in_time: dict[tm.Monomial, None] = {}
    for i, c, variable in mt.integrating_candidates(material)[: bounds.COLUMNS]:
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
    whole = divergence_factor(material) if material.motion.question.timed else None
    ordered = dict.fromkeys([tm.EMPTY, *([whole] if whole else []), *sorted(in_time, key=tm.rank)])
    for i in range(material.motion.size):
        single[tm.times(across.get(i, tm.EMPTY), along.get(i, tm.EMPTY), 2)] = None
    inverted = [tm.times(tm.EMPTY, factor, -1) for factor in single]
    chosen = tuple(dict.fromkeys([*sorted(single, key=tm.rank), *sorted(inverted, key=tm.rank)]))[
        : bounds.CANDIDATES
    ]
    return Factors(along, across, tuple(ordered)[:_MOST_IN_TIME], chosen)


def has_factors_of_time(material: mt.Material) -> bool:
    return len(find_factors(mt.for_question(material, TIMED)).in_time) > 1


def products(left: Iterable[tm.Monomial], right: Sequence[tm.Monomial]) -> list[tm.Monomial]:
    """All products of one factor from each side."""
    return [tm.times(a, b) for a in left for b in right]


def _exponents(letter: ex.Expression, seen: set[Fraction]) -> list[Fraction]:
    """The exponents tried for a generator of position, given its exponents in f."""
    one = Fraction(1)
    if isinstance(letter, ex.Sum):
        return [one, -one, *_HALVES]
    if ex.is_exponential(letter):
        highest = int(max([one, *(abs(e) for e in seen)]))
        whole = [k * one for k in range(1, min(highest, bounds.POWER) + 1)]
        unit = Fraction(1, lcm(*(e.denominator for e in seen)))  # e^(3x/2) is a power of e^(x/2)
        return [sign * e for e in dict.fromkeys((*whole, unit)) for sign in (1, -1)]
    return [one, -one] if any(e < 0 for e in seen) else [one]


def position_monomials(material: mt.Material, degree: int, room: float = inf) -> list[tm.Monomial]:
    """Products of at most `degree` generators of position: sums with inverses and roots, other
    generators with powers as in f.

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


def functions_of_velocities(material: mt.Material) -> list[tm.Monomial]:
    """v_i v_j and v_i v_j / v_k, powers and logarithms of one velocity, and the functions that f
    contains.
    """
    own = (shape for v in material.motion.velocities for shape in single(v))
    return tm.distinct([*quadratic(material), *quotients(material), *own, *of_letters(material)])


def polynomials(material: mt.Material) -> list[tm.Monomial]:
    """Products of two, three, and four velocities of several coordinates."""
    if material.motion.size == 1:
        return []
    return [shape for degree in (2, 3, 4) for shape in powers(material, degree)]


def roots_of_constants(material: mt.Material) -> list[tm.Monomial]:
    """v_i v_j and 1 times roots of constant velocities and of their combinations in f, such as w^2
    + k.
    """
    constant = constant_velocities(material)
    moving: set[ex.Expression] = {*material.motion.coordinates, *material.motion.velocities}
    sums = [
        p
        for p in mt.moving_letters(material)
        if isinstance(p, ex.Sum) and not ex.holds(p, *moving.difference(constant))
    ]
    made = tm.distinct([*map(tm.monomial, sums), tm.monomial(*sums)]) if sums else []
    kept = list(map(tm.monomial, constant))
    rooted = [
        tm.times(tm.EMPTY, key, e)
        for key in (*kept, *products([tm.EMPTY, *kept], made))
        for e in _HALVES
    ]
    return [*quadratic(material), *products([tm.EMPTY, *quadratic(material)], rooted)]


def complex_logarithms(material: mt.Material) -> list[tm.Monomial]:
    """v_i v_j, and the parts of z' log z' for two velocities as one complex z': z'' = -(U_y + i
    U_x) z' has them.
    """
    found: list[tm.Monomial] = []
    for v, w in itertools.combinations(material.motion.velocities, 2):
        modulus = ex.Apply("log", v**2 + w**2)
        angle = ex.Apply("atan", w / v)
        found += [tm.monomial(letter, part) for letter in (v, w) for part in (modulus, angle)]
    return [*found, *quadratic(material)] if found else []


def quadratic(material: mt.Material) -> list[tm.Monomial]:
    """v_i v_j."""
    return powers(material, 2)


def powers(material: mt.Material, degree: int) -> list[tm.Monomial]:
    """Products of `degree` velocities."""
    velocities = material.motion.velocities
    return [
        tm.monomial(*chosen)
        for chosen in itertools.combinations_with_replacement(velocities, degree)
    ]


def quotients(material: mt.Material) -> list[tm.Monomial]:
    """v_i v_j / w, w another velocity.

    If some velocities are constant along the motion, only these are used as divisors.
    """
    return [
        tm.times(product, tm.monomial(w), -1)
        for product in quadratic(material)
        for w in constant_velocities(material) or material.motion.velocities
        if w not in dict(product)
    ]


def constant_velocities(material: mt.Material) -> list[ex.Velocity]:
    """The velocities that are constant along the motion."""
    return [
        v for v, f in zip(material.motion.velocities, material.motion.forces, strict=True) if not f
    ]


def single(velocity: ex.Expression) -> list[tm.Monomial]:
    """Powers of v, log v, and v log v."""
    log = ex.Apply("log", velocity)
    return [
        tm.monomial(velocity, log),
        tm.monomial(log),
        *(frozenset([(velocity, e)]) for e in _POWERS),
    ]


def of_letters(material: mt.Material) -> list[tm.Monomial]:
    """Powers, logarithms, and exponentials of the generators of f with velocities, and these times
    a velocity.
    """
    shapes: list[tm.Monomial] = exponentials(material)
    for letter in mt.moving_letters(material):
        if isinstance(letter, ex.Sum):
            # Its positive integer powers are sums of products that are already in the list.
            shapes += [frozenset([(letter, e)]) for e in _ROOTS if e < 0 or e.denominator > 1]
            shapes.append(tm.monomial(ex.Apply("log", letter)))
        else:
            shapes += [frozenset([(letter, Fraction(e))]) for e in (1, -1, 2)]
    plain = [tm.EMPTY, *(tm.monomial(v) for v in material.motion.velocities)]
    return tm.distinct([tm.times(a, b) for a in shapes for b in plain])


def exponentials(material: mt.Material) -> list[tm.Monomial]:
    """The products of exponentials of velocities in f, and their inverses."""
    found: dict[tm.Monomial, None] = {}
    keys = [key for terms in material.motion.forces for key in terms]
    for letter in material.velocity_letters:
        if isinstance(letter, ex.Sum):
            with suppress(tm.TooManyTerms):
                keys += list(tm.terms_of(letter))
    for key in keys:
        part: tm.Monomial = frozenset(
            (p, e) for p, e in key if ex.is_exponential(p) and tm.has_velocity(p)
        )
        if part:
            found[part] = None
            found[tm.times(tm.EMPTY, part, -1)] = None
            found.update(
                dict.fromkeys(
                    frozenset([(p, Fraction(s))]) for p, _ in part for s in (1, -1, 2, -2)
                )
            )
    return tm.distinct(list(found))


def is_admissible(material: mt.Material, key: tm.Monomial) -> bool:
    """L may contain t only where requested, and a pure constant is not a term."""
    if all(isinstance(letter, ex.Number) for letter, _ in key):
        return False
    return material.motion.question.timed or not tm.depends_on([key], ex.TIME)


def with_potential(
    material: mt.Material,
    combination: Mapping[tm.Monomial, Fraction],
    integrator: antiderivatives.Integrator | None = None,
) -> tm.Terms:
    """The combination, whose Hessian is a multiplier, plus the A_i(t, q) v_i - V(t, q) that make it
    a Lagrangian.

    Its Euler-Lagrange expressions are affine in the velocities. Empty if no A and V are found.
    """
    system, motion = material.analysis.system, material.motion
    integrator = integrator or antiderivatives.Integrator(system, material.analysis.real_point)

    def residuals() -> list[tm.Terms]:
        written = replace(motion, forces=tuple(map(tm.terms_of, system.accelerations)))
        momenta = [
            mt.rate_of_terms(written, tm.derivative_of_terms(combination, v))
            for v in motion.velocities
        ]
        slopes = [tm.derivative_of_terms(combination, q) for q in motion.coordinates]
        return [
            tm.add_terms(slope, momentum, -1)
            for slope, momentum in zip(slopes, momenta, strict=True)
        ]

    def over_one_denominator() -> list[tm.Terms]:
        return mt.over_one_denominator(
            list(map(tm.tree_of, residuals())), system.variables, exact_field.Budget.long()
        )

    # Few terms are integrated one by one. Over one denominator, terms that are not affine cancel.
    for wanted in (residuals, over_one_denominator):
        deadline.check()
        with suppress(exact_field.TooLarge, tm.TooManyTerms, ZeroDivisionError, KeyError):
            rest = integrator.linear_terms(wanted())
            if rest is not None:
                return tm.add_terms(dict(combination), rest)
    return {}


@dataclass(frozen=True, slots=True)
class Possible:
    """The shapes that can occur in a regular multiplier, and properties of their coefficients.

    `fixed` lists, for each shape, the variables among t and the coordinates on which its
    coefficient never depends.
    """

    shapes: list[tm.Monomial]
    fixed: Mapping[tm.Monomial, frozenset[Variable]] = field(default_factory=dict)

    def may_have(self, factor: tm.Monomial, shape: tm.Monomial) -> bool:
        """Whether a function of t and the coordinates can occur in the coefficient of a shape."""
        return self.fixed.get(shape, frozenset()).isdisjoint(
            name for p, _ in factor for name in variables_in(p)
        )


def possible_shapes(material: mt.Material, shapes: Sequence[tm.Monomial], seed: int) -> Possible:
    """The shapes that can occur; the simplest ones if the test is impossible."""
    try:
        return _possible_shapes(material, shapes, seed)
    except ansatz.NO_POINTS:
        return Possible(list(shapes[: bounds.SMALL]))


def _possible_shapes(material: mt.Material, shapes: Sequence[tm.Monomial], seed: int) -> Possible:
    if not shapes:
        return Possible([])
    unknowns = material.motion.size + 1 + material.motion.question.timed
    chosen = list(shapes[: bounds.SMALL])
    sampler = ansatz.sampler_of(material.analysis, chosen)
    points, letters = sampler.points(seed, material.motion.velocities), ansatz.letters_of(chosen)
    count = (len(chosen) * unknowns + matrices.SPARE) // material.motion.size**2 + 2
    table = ansatz.table_at(points, letters, count, order=3)
    matrix, hessians = ansatz.helmholtz_matrix(sampler, table, letters, chosen)
    generator = random.Random(f"velocity shapes {seed}")

    found = _random_solution(material, table, matrix, hessians, generator)
    weights = found[: len(chosen)]
    fixed = dict(zip(chosen, _fixed(material, found, len(chosen)), strict=True))
    return Possible(_used(chosen, weights, hessians[0], table.prime), fixed)


def _fixed(material: mt.Material, solution: Sequence[int], count: int) -> list[frozenset[Variable]]:
    """For each of `count` shapes, the variables among t and the coordinates by which the derivative
    of its coefficient is 0.

    A derivative that is 0 in a random solution is 0 in all solutions, at this place and so at
    almost all places.
    """
    names: list[Variable] = [
        *([ex.TIME] if material.motion.question.timed else []),
        *material.motion.coordinates,
    ]
    rates = {name: solution[(k + 1) * count : (k + 2) * count] for k, name in enumerate(names)}
    return [frozenset(name for name in names if not rates[name][shape]) for shape in range(count)]


def _random_solution(
    material: mt.Material,
    table: ansatz.LetterTable,
    matrix: Words,
    hessians: Words,
    generator: random.Random,
) -> list[int]:
    """The coefficients of the shapes of one group, followed by their derivatives, in a random
    solution at one place.
    """
    motion, prime = material.motion, table.prime
    rates = [
        [1] * motion.question.timed + [point.variable(v) for v in motion.velocities]
        for point in table.points
    ]
    samples, count, n, _ = hessians.shape
    rows = np.zeros((samples, n * n, 1 + len(rates[0]), count), np.uint64)
    rows[:, :, 0] = matrix.reshape(samples, n * n, count)
    # d_t c (if L may contain t) and each d_k c enter (H2) times 1 and v^k, but not (H3).
    moved = ansatz.to_montgomery(rates, prime)[:, None, :, None]
    i, j = np.triu_indices(n)
    forms = hessians[:, :, i, j].swapaxes(1, 2)[:, :, None]
    rows[:, : len(i), 1:] = ansatz.product(forms, moved, modular.field_of(prime))
    return matrices.random_null_vector(rows.reshape(samples * n * n, -1), prime, generator)


def _used(
    shapes: Sequence[tm.Monomial], weights: Sequence[int], hessians: Words, prime: int
) -> list[tm.Monomial]:
    """The shapes with a nonzero coefficient in a random solution; none if its g is singular, since
    then every g is.
    """
    n = hessians.shape[1]
    g = nmod_mat(1, len(weights), weights, prime) * nmod_mat(
        len(weights), n * n, hessians.ravel().tolist(), prime
    )
    if nmod_mat(n, n, g.entries(), prime).rank() < n:
        return []
    return [shape for shape, c in zip(shapes, weights, strict=True) if c]


@dataclass(frozen=True, slots=True)
class Family:
    """A row of the ansatz: functions of the velocities, and the number of terms to form with
    functions of position.

    If `given`, `shapes` are complete terms; those without a Hessian accompany every choice of the
    others.
    """

    name: str
    cost: float
    shapes: Callable[[mt.Material], Sequence[tm.Monomial]]
    terms: int
    given: bool = False


def kinetic_terms(
    material: mt.Material, family: Family, factors: Factors, seed: int
) -> Iterator[list[tm.Monomial]]:
    """The terms of an ansatz that have a Hessian, simple ones first; none if they cannot form a
    regular multiplier.

    Systems of several coordinates have few multipliers, so constant coefficients come before
    functions of position. A logarithm is defined for some velocities only, so terms without
    logarithms come first.
    """
    shapes = [key for key in family.shapes(material) if not tm.is_affine(key)]
    if family.given:
        yield [key for key in shapes if is_admissible(material, key)]
        return
    possible = possible_shapes(material, shapes, seed)
    chosen = possible.shapes
    if not chosen:
        yield chosen
        return
    if material.motion.size > 1:
        yield [
            shape
            for shape in chosen
            if not any(isinstance(p, ex.Apply) and not ex.is_exponential(p) for p, _ in shape)
        ]
    yield _with_functions(material, family, factors, possible, chosen)


def _with_functions(
    material: mt.Material,
    family: Family,
    factors: Factors,
    possible: Possible,
    chosen: Sequence[tm.Monomial],
) -> list[tm.Monomial]:
    """The shapes times functions of t and of position."""
    in_time = factors.in_time
    # For one coordinate every f has a Lagrangian, so most searches end with long rows, which have
    # found none there.
    terms = family.terms if material.motion.size > 1 else min(family.terms, bounds.SMALL)
    room = max(bounds.CANDIDATES, terms // (len(chosen) * len(in_time)))
    functions = products(in_time, _functions_of_position(material, factors, room))
    pairs = [(m, shape) for m in functions for shape in chosen if possible.may_have(m, shape)][
        : 2 * family.terms
    ]
    pairs += [
        (m, shape)
        for shape in chosen
        for m in _fitted(material, factors, shape)
        if possible.may_have(m, shape)
    ]
    if material.motion.question.timed and not material.position_letters:
        # If f contains no position, first integrals can be linear in t: x'' = x'^2 conserves 1/x' +
        # t.
        pairs += [
            (tm.monomial(ex.TIME), shape)
            for shape in chosen
            if possible.may_have(tm.monomial(ex.TIME), shape)
        ]
    found = tm.distinct([tm.times(m, shape) for m, shape in pairs])
    return [key for key in found if is_admissible(material, key) and not tm.is_affine(key)]


def _functions_of_position(material: mt.Material, factors: Factors, room: int) -> list[tm.Monomial]:
    """The simplest of 1, integrating factors, and products of generators of position."""
    fitted = list(dict.fromkeys([tm.EMPTY, *factors.plain[: room // 3]]))
    others = position_monomials(material, 4, 2 * room)
    # A coordinate that does not occur in f can still occur in L.
    plain = [
        tm.monomial(*some)
        for d in (1, 2)
        for some in combinations_with_replacement(material.motion.coordinates, d)
    ]
    # The antiderivative of log(x) holds x log(x).
    inverse = [
        p for p in material.position_letters if isinstance(p, ex.Apply) and p.function == "log"
    ]
    raised = [tm.monomial(p, p.argument) for p in inverse if isinstance(p.argument, ex.Symbol)]
    found = dict.fromkeys([*fitted, *raised, *others, *plain, *products(fitted, plain)])
    return list(found)[: max(room, len(fitted))]


def _fitted(material: mt.Material, factors: Factors, shape: tm.Monomial) -> Iterator[tm.Monomial]:
    """The factors, other than a power of v_i, that the coefficients of v_i v_l in f_i require."""
    for i, v in enumerate(material.motion.velocities):
        exponent = tm.exponent_of(shape, v)
        if shape == tm.monomial(ex.Apply("log", v)):
            yield from factors.of_degree(i, Fraction(-2))
        if exponent and len(shape) <= 2:
            for degree in {exponent - 2, Fraction(-1), Fraction(-2)}:
                yield from factors.of_degree(i, degree)


def label(family: Family, terms: Sequence[tm.Monomial]) -> str:
    """The displayed name of the ansatz in which these kinetic terms were found."""
    kinetic = [key for key in terms if not tm.is_affine(key)]
    degrees, moving = (
        set(map(tm.velocity_degree, kinetic)),
        [tm.split_velocities(key)[1] for key in kinetic],
    )
    if family.given:
        return family.name
    if None not in degrees:
        return "quadratic in the velocities" if degrees == {2} else "polynomial in the velocities"
    if not all(isinstance(p, ex.Velocity) for part in moving for p, _ in part):
        return "functions of the velocities"
    whole = all(e.denominator == 1 for part in moving for _, e in part)
    return "Laurent monomials in the velocities" if whole else "powers of the velocities"


def own_family(given: Sequence[ex.Expression]) -> Family | None:
    """The ansatz of the monomials of the given terms, each with its own coefficient; None without
    terms.

    As for any family, the search adds potentials and linear terms, so that kinetic terms are
    enough; given ones accompany every choice. A term whose expansion would be long is one
    generator.
    """
    monomials: dict[tm.Monomial, None] = {}
    for term in given:
        try:
            monomials |= dict.fromkeys(tm.terms_of(term))
        except tm.TooManyTerms:
            monomials[tm.monomial(term)] = None
    chosen = list(monomials)[: bounds.LARGE]
    return Family(NAME, 0, lambda material: chosen, 0, given=True) if chosen else None
