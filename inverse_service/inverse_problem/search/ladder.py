"""Families tried one after another until a regular Lagrangian is found."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from inverse_service.algebra.series import SingularPoint
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import Apply, Expression
from inverse_service.inverse_problem.decision.analysis import Analysis
from inverse_service.inverse_problem.search.choice import as_tree
from inverse_service.inverse_problem.search.deadline import OutOfTime, check, until, within
from inverse_service.inverse_problem.search.factors import NO_FACTORS, Factors, find_factors
from inverse_service.inverse_problem.search.families import FAMILIES, Family, all_terms, kinetic_terms, label
from inverse_service.inverse_problem.search.found import Found, SearchOutcome
from inverse_service.inverse_problem.search.linear_ansatz import solve_ansatz
from inverse_service.inverse_problem.search.material import Material, gather
from inverse_service.inverse_problem.search.members import best_members, needed_combinations
from inverse_service.inverse_problem.search.multiplier_ansatz import solve_multiplier
from inverse_service.inverse_problem.search.own_terms import own_family
from inverse_service.inverse_problem.search.residuals import answers
from inverse_service.inverse_problem.search.sampling import Sampler, make_sampler
from inverse_service.inverse_problem.search.specialists import SPECIALISTS, Specialist
from inverse_service.inverse_problem.search.terms import Monomial, TooManyTerms
from inverse_service.inverse_problem.search.tidy import tidied

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
    highest: float = math.inf,
) -> SearchOutcome:
    """The first family that holds a regular Lagrangian, or what was tried; the caller's own terms come first.

    Families and methods of more than the `highest` cost are left out.

    A family counts only if one of its Lagrangians `holds`; those before that one are left out.
    """
    tried: list[tuple[str, int]] = []
    try:
        with until(deadline):
            rungs = _climb(analysis, with_time, seed, progress, own_terms, tried, highest)
            candidates = (_kept(one, analysis, holds) for one in rungs)
            found = next((kept for kept in candidates if kept), None)
    except OutOfTime:
        found = None
    return SearchOutcome(found, tuple(tried))


def _kept(found: Found, analysis: Analysis, holds: Callable[[Expression], bool]) -> Found | None:
    """From the first Lagrangian on that holds, each written shorter where that is possible."""
    for k, tree in enumerate(found.lagrangians):
        for form in dict.fromkeys((tidied(tree, analysis.system), tree)):
            if holds(form):
                others = (tidied(other, analysis.system) for other in found.lagrangians[k + 1 :])
                trees = tuple(dict.fromkeys((form, *others)))
                return replace(found, lagrangians=trees, parts=() if k else found.parts)
    return None


def _climb(
    analysis: Analysis,
    with_time: bool,
    seed: int,
    progress: Callable[[str], None],
    own_terms: Sequence[Expression],
    tried: list[tuple[str, int]],
    highest: float,
) -> Iterator[Found]:
    """What each rung finds, those that find nothing left out."""
    known: set[Monomial] = set()
    try:
        material = gather(analysis, with_time)
    except TooManyTerms:
        return
    factors: Factors | None = None
    own = own_family(own_terms)
    rungs: list[Family | Specialist] = [*([own] if own else []), *FAMILIES, *SPECIALISTS]
    for rung in sorted((rung for rung in rungs if rung.cost <= highest), key=lambda rung: rung.cost):
        check()
        if isinstance(rung, Specialist):
            found = _proposed(material, rung, seed, tried, progress)
        else:
            progress(f"ansatz: {rung.name}")
            factors = find_factors(material, seed) if factors is None and rung.cost > 1 else factors
            terms = kinetic_terms(material, rung, factors or NO_FACTORS, seed)
            if terms and set(terms) <= known:
                continue
            known.update(terms)
            tried.append((rung.name, len(terms)))
            found = _solve(material, rung, terms, seed)
        if found is not None:
            yield found


def search_smaller(analysis: Analysis, with_time: bool, seed: int, work: int) -> Found | None:
    """The ladder for a system that a method makes out of the given one, with so much work (see `deadline`)."""
    with within(work):
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
        members = needed_combinations(space, seed)
        chosen = list(dict.fromkeys(key for k in members for key in space.combinations[k]))
        residuals = [answers(material, space.combinations[k]) for k in members]
        further = dict.fromkeys(key for group in residuals for key in group)
        return _with_potentials(material, family, chosen, list(further), seed) if chosen else None
    except _NO_POINTS:
        return None


def _sampler(material: Material, terms: Sequence[Monomial]) -> Sampler:
    return make_sampler(material.analysis, dict.fromkeys(item for term in terms for item in term))


def _with_potentials(
    material: Material, family: Family, chosen: Sequence[Monomial], further: Sequence[Monomial], seed: int
) -> Found | None:
    """Letters that only antiderivatives bring in may have no value where f has one: then without them."""
    terms = all_terms(material, family, [*chosen, *further])
    try:
        space = solve_ansatz(_sampler(material, terms), terms, seed)
    except _NO_POINTS:
        terms = _in_known_letters(material, terms, chosen)
        space = solve_ansatz(_sampler(material, terms), terms, seed)
    members = best_members(space, seed)
    if not members:
        return None
    trees = dict.fromkeys(as_tree(member.terms) for member in members)
    return Found(tuple(trees), label(family, chosen), tuple(map(as_tree, members[0].parts)))


def _in_known_letters(material: Material, terms: Sequence[Monomial], chosen: Sequence[Monomial]) -> list[Monomial]:
    """The terms in letters of f and of the chosen terms, and in logarithms of these."""
    motion = material.motion
    known = {*motion.coordinates, *motion.velocities, *material.position_letters, *material.velocity_letters}
    known |= {letter for key in (*chosen, *material.parameter_monomials) for letter, _ in key}
    known |= {Apply("log", letter) for letter in material.position_letters}
    return [key for key in terms if all(letter in known for letter, _ in key)]
