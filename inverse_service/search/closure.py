"""Terms that an ansatz needs besides its kinetic ones: what can cancel the residuals of these.

Of a single term the residuals T(q) w(v) are answered by B(q) w v_i / v_j with dB/dq_j = T. Those of a combination
that has a multiplier as Hessian are the Euler-Lagrange expressions of some A_i(q) v_i - V(q), so they are linear in
the velocities, at the latest once everything is put over one denominator: terms T(q) and T(q) v_j, answered by B(q)
and B(q) v_k with dB/dq_j = T. Closures term by term cannot see this where polynomials in the velocities are letters,
as their relations to the velocities are used only there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from inverse_service import bounds
from inverse_service.deadline import STEP, check
from inverse_service.expressions.tree import TIME, Apply, Number, Sum, Symbol, Velocity, holds, walk
from inverse_service.field.exact_atoms import factored
from inverse_service.field.rational_functions import Budget, TooLarge
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual
from inverse_service.search.material import Material, antiderivatives, distinct, oriented
from inverse_service.search.motion_terms import MotionTerms, euler_lagrange, split_velocities
from inverse_service.search.terms import (
    EMPTY,
    Monomial,
    TooManyTerms,
    monomial,
    rank,
    terms_of,
    times,
    tree_of,
)


def closed(material: Material, seeds: Sequence[Monomial], depth: int, bound: int) -> list[Monomial]:
    """The seeds, and terms whose Euler-Lagrange expressions can cancel those of the terms before.

    A residual T(q) w(v) in equation i is cancelled by B(q) w v_i / v_j with dB/dq_j = T; only the
    velocity shapes of the seeds, 1 and v_k are admitted. Stops at `bound` terms beyond the seeds.
    """
    shapes = {split_velocities(key)[1] for key in seeds}
    shapes |= {EMPTY, *(monomial(v) for v in material.motion.velocities)}
    found = dict.fromkeys(seeds)
    fresh, room = list(seeds), bound
    for _ in range(depth):
        added: dict[Monomial, None] = {}
        for key in fresh:
            added.update(dict.fromkeys(extra for extra in _cancelling(material, key, shapes) if extra not in found))
            if len(added) > 2 * room:
                break
        fresh = sorted(added, key=rank)[:room]
        room -= len(fresh)
        found.update(dict.fromkeys(fresh))
    return list(found)


def _cancelling(material: Material, key: Monomial, shapes: set[Monomial]) -> list[Monomial]:
    """Admissible terms that answer the residuals of one candidate."""
    check(STEP)
    try:
        residuals = euler_lagrange(material.motion, key)
    except TooManyTerms:
        return []
    found: dict[Monomial, None] = {}
    motion = material.motion
    answered: dict[Monomial, list[tuple[Symbol, Monomial]]] = {}
    for v, residual in zip(motion.velocities, residuals, strict=True):
        for term in residual:
            position, moving = split_velocities(term)
            whole = times(moving, monomial(v))
            if whole not in answered:
                answered[whole] = _answering(motion, whole, shapes)
            for q, shape in answered[whole]:
                found.update(dict.fromkeys(times(m, shape) for m in antiderivatives(position, q)))
    found.update(dict.fromkeys(m for extra in list(found) for m in without_squares(extra)))
    return list(found)


def _answering(motion: MotionTerms, whole: Monomial, shapes: set[Monomial]) -> list[tuple[Symbol, Monomial]]:
    """(q_j, w v_i / v_j) for the admitted shapes among these, `whole` being w v_i."""
    every = zip(motion.coordinates, motion.velocities, strict=True)
    return [(q, shape) for q, w in every if (shape := times(whole, monomial(w), -1)) in shapes]


def without_squares(key: Monomial) -> list[Monomial]:
    """With sin^2 u or cos^2 u also the monomial without it, 1 = sin^2 u + cos^2 u; sinh and cosh likewise."""
    return [
        times(key, frozenset([(letter, Fraction(2))]), -1)
        for letter, e in key
        if isinstance(letter, Apply) and letter.function in ("sin", "cos", "sinh", "cosh") and e >= 2
    ]


def each_once(terms: Sequence[Monomial]) -> list[Monomial]:
    """The terms without m sin^2 u where m and m cos^2 u are among them, and without m sinh^2 u likewise."""
    every = set(terms)
    pairs = {"sin": "cos", "sinh": "cosh"}

    def is_sum(key: Monomial) -> bool:
        squares = [p for p, e in key if isinstance(p, Apply) and p.function in pairs and e >= 2]
        return any(
            {rest := times(key, monomial(p), -2), times(rest, monomial(Apply(pairs[p.function], p.argument)), 2)}
            <= every
            for p in squares
        )

    return [key for key in terms if not is_sum(key)]


def potentials(material: Material, seeds: Iterable[Monomial], bound: int) -> list[Monomial]:
    """B(q) and B(q) v_k with dB/dq_j = phi T, phi the factor of a seed that holds v_i, T from f^i.

    In f^i = g^-1 (dL/dq - …) the potential and the linear terms of L stand undivided, so T runs over
    the terms of f^i with all that holds velocities left out. At most `bound` of each kind.
    """
    motion = material.motion
    found: dict[Monomial, None] = {}
    linear: dict[Monomial, None] = {}
    for product in sorted(_forces_of_seeds(material, seeds), key=rank)[: 4 * bound]:
        for q in motion.coordinates:
            for m in antiderivatives(product, q):
                found[m] = None
                linear.update(dict.fromkeys(times(m, monomial(v)) for v in motion.velocities))
    for extra in list(found):
        found.update(dict.fromkeys(without_squares(extra)))
    return [*sorted(found, key=rank)[:bound], *sorted(linear, key=rank)[:bound]]


def _forces_of_seeds(material: Material, seeds: Iterable[Monomial]) -> set[Monomial]:
    """phi T for the factor phi of each seed and the position parts T of the forces on its velocities."""
    motion = material.motion
    parts = [{split_velocities(key)[0] for key in terms} for terms in motion.forces]
    factors = set()
    for seed in seeds:
        position, moving = split_velocities(seed)
        nodes = {node for letter, _ in moving for node in walk(letter)}
        factors |= {(position, i) for i, v in enumerate(motion.velocities) if v in nodes}
    return {times(position, part) for position, i in factors for part in parts[i]}


def is_admissible(material: Material, key: Monomial) -> bool:
    """L may contain t only where asked for, and a pure constant is no term."""
    if all(isinstance(letter, Number) for letter, _ in key):
        return False
    return material.motion.with_time or not any(holds(letter, TIME) for letter, _ in key)


def answers(material: Material, combination: Mapping[Monomial, Fraction]) -> list[Monomial]:
    """B and B v_k for the residuals of a combination; none where they are too large to be written out."""
    system = material.analysis.system
    try:
        check()
        trees = euler_lagrange_residual(tree_of(combination), system.coordinates, system.accelerations)
        motion, point = material.motion, material.analysis.real_point
        symbols: list[Symbol | Velocity] = [TIME, *motion.coordinates, *motion.velocities]
        parts = _linear_parts(material, (key for tree in trees for key in oriented(terms_of(tree), point)))
        sums = {letter for key in combination for letter, e in key if isinstance(letter, Sum) and e > 0}
        # With 3 x^2 + 1 in L, and below f, each term of (3 x^2 + 1)/(3 x^2 + 1) has a divisor that cancels.
        if any(part is None or any(letter in sums and e < 0 for letter, e in part) for part in parts):
            quotients = factored(list(trees), symbols, Budget.long())
            parts = _linear_parts(material, (key for tree in quotients for key in oriented(terms_of(tree), point)))
    except (TooLarge, TooManyTerms, ZeroDivisionError, KeyError):
        return []
    return _primitives(material, [position for position in parts if position is not None])[: bounds.SMALL]


def _linear_parts(material: Material, keys: Iterable[Monomial]) -> list[Monomial | None]:
    """T for each term T or T v_j, None for any other."""
    linear = {EMPTY, *map(monomial, material.motion.velocities)}
    pairs = (split_velocities(key) for key in keys)
    return [position if moving in linear else None for position, moving in pairs]


def _primitives(material: Material, parts: Iterable[Monomial]) -> list[Monomial]:
    """B and B v_k for each T."""
    motion = material.motion
    found: dict[Monomial, None] = {}
    for position in parts:
        for q in motion.coordinates:
            raised = antiderivatives(position, q)
            found.update(dict.fromkeys(raised))
            found.update(dict.fromkeys(times(m, monomial(v)) for m in raised for v in motion.velocities))
    return distinct(list(found))
