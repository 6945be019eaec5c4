"""Linear systems q'' = -C q' - (K_0 + sum_j phi_j(t) K_j) q + b(t), read off the terms of f."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.exact_ring import ExactRing
from inverse_service.algebra.rational_functions import Budget
from inverse_service.deadline import end
from inverse_service.expressions.tree import ONE, TIME, ZERO, Expression, Symbol, walk
from inverse_service.inverse_problem.search.linear_systems.matrices import Matrix
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.motion import MotionTerms
from inverse_service.inverse_problem.search.terms import Monomial, Terms, monomial_tree, tree_of

# A name that no formula can hold: the variable of characteristic polynomials.
EIGENVALUE = Symbol("an eigenvalue")
_TERMS, _WORK = 3_000, 400_000


@dataclass(frozen=True, slots=True)
class LinearTerms:
    """C and K_j as terms, and b: `damping[i][j]`, `stiffness[phi][i][j]`, phi = {} for K_0."""

    damping: tuple[tuple[Terms, ...], ...]
    stiffness: dict[Monomial, tuple[tuple[Terms, ...], ...]]
    forcing: tuple[Terms, ...]


@dataclass(frozen=True, slots=True)
class LinearSystem:
    """C, the pairs (phi_j(t), K_j) with phi_0 = 1 first, and b(t); entries exact in the parameters."""

    ring: ExactRing
    damping: Matrix
    stiffness: tuple[tuple[Expression, Matrix], ...]
    forcing: tuple[Expression, ...]

    @property
    def size(self) -> int:
        return len(self.damping)


def linear_terms(motion: MotionTerms) -> LinearTerms | None:
    """The parts of f, or None where f is not linear or C depends on time."""
    n = motion.size
    damping = _empty(n)
    stiffness: dict[Monomial, list[list[Terms]]] = {frozenset(): _empty(n)}
    forcing: list[Terms] = [{} for _ in range(n)]
    places: dict[Expression, tuple[int, int]] = {q: (k, 0) for k, q in enumerate(motion.coordinates)}
    places |= {v: (k, 1) for k, v in enumerate(motion.velocities)}
    for i, terms in enumerate(motion.forces):
        for key, value in terms.items():
            moving = [(letter, e) for letter, e in key if _holds(letter, places)]
            if not moving:
                forcing[i][key] = value
                continue
            if len(moving) > 1 or moving[0][1] != 1 or moving[0][0] not in places:
                return None
            column, kind = places[moving[0][0]]
            in_time: Monomial = frozenset(item for item in key if _holds(item[0], (TIME,)))
            if kind and in_time:
                return None
            target = damping if kind else stiffness.setdefault(in_time, _empty(n))
            target[i][column][key - frozenset(moving) - in_time] = -value
    return LinearTerms(_frozen(damping), {phi: _frozen(k) for phi, k in stiffness.items()}, tuple(forcing))


def _empty(n: int) -> list[list[Terms]]:
    return [[{} for _ in range(n)] for _ in range(n)]


def _frozen(rows: list[list[Terms]]) -> tuple[tuple[Terms, ...], ...]:
    return tuple(map(tuple, rows))


def _holds(letter: Expression, names: Iterable[Expression]) -> bool:
    wanted = set(names)
    return any(node in wanted for node in walk(letter))


def linear_system(material: Material) -> LinearSystem | None:
    """C, K and b with exact entries; None where f is not linear. TooLarge where a budget ends."""
    terms = linear_terms(material.motion)
    if terms is None:
        return None
    parts = [terms.damping, *terms.stiffness.values()]
    trees = [tree_of(entry) for rows in parts for row in rows for entry in row]
    budget = Budget(_TERMS, end(), _WORK)
    ring = exact_ring(trees, (), 0, budget, further=(EIGENVALUE,))
    factors = [monomial_tree(phi) if phi else ONE for phi in terms.stiffness]
    exact = [_exact(ring, rows) for rows in parts]
    forcing = tuple(tree_of(entry) if entry else ZERO for entry in terms.forcing)
    return LinearSystem(ring, exact[0], tuple(zip(factors, exact[1:], strict=True)), forcing)


def _exact(ring: ExactRing, rows: tuple[tuple[Terms, ...], ...]) -> Matrix:
    return tuple(tuple(ring.value(tree_of(entry)) for entry in row) for row in rows)
