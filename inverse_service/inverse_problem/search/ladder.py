"""Families tried one after another until a regular Lagrangian is found."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from inverse_service.algebra.series import SingularPoint
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.analysis import Analysis
from inverse_service.inverse_problem.search.choice import as_tree, gauge_of, reduced, regular_members, scaled, signature
from inverse_service.inverse_problem.search.deadline import OutOfTime, check, until, within
from inverse_service.inverse_problem.search.factors import NO_FACTORS, Factors, find_factors
from inverse_service.inverse_problem.search.families import FAMILIES, Family, all_terms, kinetic_terms
from inverse_service.inverse_problem.search.found import Found, SearchOutcome
from inverse_service.inverse_problem.search.linear_ansatz import Combination, LagrangianSpace, solve_ansatz
from inverse_service.inverse_problem.search.material import Material, gather
from inverse_service.inverse_problem.search.multiplier_ansatz import solve_multiplier
from inverse_service.inverse_problem.search.own_terms import own_family
from inverse_service.inverse_problem.search.sampling import Sampler, make_sampler
from inverse_service.inverse_problem.search.specialists import SPECIALISTS, Specialist
from inverse_service.inverse_problem.search.terms import Monomial, TooManyTerms, add_terms
from inverse_service.inverse_problem.search.velocity_free import may_be_velocity_free
from inverse_service.mechanics.euler_lagrange import hessian

# An ansatz whose terms have no common points (a vanishing denominator, a missing root) finds nothing.
_NO_POINTS = (IrreducibleAtoms, SingularPoint, ValueError)


def search(
    analysis: Analysis,
    with_time: bool,
    seed: int,
    deadline: float,
    progress: Callable[[str], None],
    own_terms: Sequence[Expression] = (),
    holds: Callable[[Expression], bool] = lambda _: True,
) -> SearchOutcome:
    """The first family that holds a regular Lagrangian, or what was tried; the caller's own terms come first.

    A family counts only if one of its Lagrangians `holds`; those before that one are left out.
    """
    tried: list[tuple[str, int]] = []
    try:
        with until(deadline):
            candidates = _climb(analysis, with_time, seed, progress, own_terms, tried)
            found = next((kept for kept in (_kept(one, holds) for one in candidates) if kept), None)
    except OutOfTime:
        found = None
    return SearchOutcome(found, tuple(tried))


def _kept(found: Found, holds: Callable[[Expression], bool]) -> Found | None:
    """From the first Lagrangian on that holds."""
    for k, tree in enumerate(found.lagrangians):
        if holds(tree):
            return replace(found, lagrangians=found.lagrangians[k:], parts=() if k else found.parts)
    return None


def _climb(
    analysis: Analysis,
    with_time: bool,
    seed: int,
    progress: Callable[[str], None],
    own_terms: Sequence[Expression],
    tried: list[tuple[str, int]],
) -> Iterator[Found]:
    """What each rung finds, those that find nothing left out."""
    known: set[Monomial] = set()
    try:
        material = gather(analysis, with_time)
    except TooManyTerms:
        return
    factors: Factors | None = None
    quadratic: bool | None = None
    own = own_family(own_terms)
    rungs: list[Family | Specialist] = [*([own] if own else []), *FAMILIES, *SPECIALISTS]
    for rung in sorted(rungs, key=lambda rung: rung.cost):
        check()
        if isinstance(rung, Specialist):
            found = _proposed(material, rung, seed, tried, progress)
        else:
            if rung.quadratic:
                quadratic = may_be_velocity_free(material, seed) if quadratic is None else quadratic
                if not quadratic:
                    tried.append((rung.name, 0))
                    continue
            progress(f"ansatz: {rung.name}")
            factors = find_factors(material, seed) if factors is None and rung.cost > 1 else factors
            terms = kinetic_terms(material, rung, factors or NO_FACTORS)
            if tried and set(terms) <= known:
                continue
            known.update(terms)
            tried.append((rung.name, len(terms)))
            found = _solve(material, rung, terms, seed)
        if found is not None:
            yield found


def search_smaller(analysis: Analysis, with_time: bool, seed: int, seconds: float) -> Found | None:
    """The ladder for a system that a method makes out of the given one, in so much processor time."""
    with within(seconds):
        return search(analysis, with_time, seed, math.inf, lambda _: None).found


def _proposed(
    material: Material, specialist: Specialist, seed: int, tried: list[tuple[str, int]], progress: Callable[[str], None]
) -> Found | None:
    if not specialist.applies(material):
        return None
    progress(f"method: {specialist.name}")
    try:
        proposed = tuple(specialist.propose(material, seed, search_smaller))
    except (*_NO_POINTS, TooManyTerms):
        proposed = ()
    tried.append((specialist.name, len(proposed)))
    return Found(proposed, specialist.name, proposed[:1]) if proposed else None


def _solve(material: Material, family: Family, terms: Sequence[Monomial], seed: int) -> Found | None:
    """First the multipliers in the span of the terms, then Lagrangians for the simplest regular ones."""
    if not terms:
        return None
    try:
        space = solve_multiplier(_sampler(material, terms), terms, seed)
        chosen = dict.fromkeys(
            key for members in regular_members(space, seed) for k in members for key in space.combinations[k]
        )
        return _with_potentials(material, family, list(chosen), seed) if chosen else None
    except _NO_POINTS:
        return None


def _sampler(material: Material, terms: Sequence[Monomial]) -> Sampler:
    return make_sampler(material.analysis, dict.fromkeys(item for term in terms for item in term))


def _with_potentials(material: Material, family: Family, chosen: Sequence[Monomial], seed: int) -> Found | None:
    terms = all_terms(material, family, chosen)
    space = solve_ansatz(_sampler(material, terms), terms, seed)
    sets = regular_members(space, seed)
    if not sets:
        return None
    members = [_member(material, space, members, seed) for members in sets]
    members.sort(key=lambda member: not member[1])
    parts = tuple(as_tree(space.combinations[k]) for k in sets[0])
    return Found(tuple(dict.fromkeys(tree for tree, _ in members)), family.name, parts)


def _member(material: Material, space: LagrangianSpace, chosen: Sequence[int], seed: int) -> tuple[Expression, bool]:
    """The sum of the chosen combinations, each with the sign that makes its Hessian positive; is it definite?

    Where that sum is singular the parts get different weights.
    """
    names = material.analysis.system.coordinates
    gauge = gauge_of(space, seed)
    parts = [scaled(reduced(space.combinations[k], gauge)) for k in chosen]
    found = [signature(space, hessian(as_tree(part), names)) for part in parts]
    signs = [-1 if one is not None and one[1] > one[0] else 1 for one in found]
    tree, inertia = as_tree({}), None
    for spread in range(3):
        total: Combination = {}
        for k, (part, sign) in enumerate(zip(parts, signs, strict=True)):
            total = add_terms(total, part, sign * (1 + spread * k))
        tree = as_tree(reduced(total, gauge))
        inertia = signature(space, hessian(tree, names))
        if inertia is None or sum(inertia) == len(names):
            break
    return tree, inertia is not None and inertia[0] == len(names)
