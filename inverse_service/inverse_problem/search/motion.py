"""The equations of motion as terms, and the Euler-Lagrange expressions of monomials along them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, walk
from inverse_service.inverse_problem.search.terms import (
    Monomial,
    Terms,
    add_terms,
    derivative,
    derivative_of_terms,
    monomial,
    multiply_terms,
)


@dataclass(frozen=True, slots=True)
class MotionTerms:
    """q'' = f with f expanded; `with_time` says whether L may contain t."""

    coordinates: tuple[Symbol, ...]
    velocities: tuple[Velocity, ...]
    forces: tuple[Terms, ...]
    with_time: bool

    @property
    def size(self) -> int:
        return len(self.coordinates)


def euler_lagrange(motion: MotionTerms, candidate: Monomial) -> tuple[Terms, ...]:
    """sum_j f^j m_{v_i v_j} + v^j m_{v_i q_j} + m_{v_i t} - m_{q_i} for each i."""
    found = []
    for q, v in zip(motion.coordinates, motion.velocities, strict=True):
        momentum = derivative(candidate, v)
        total = along(motion, momentum)
        found.append(add_terms(total, derivative(candidate, q), -1))
    return tuple(found)


def along(motion: MotionTerms, terms: Mapping[Monomial, Fraction]) -> Terms:
    """Gamma(terms)."""
    total = derivative_of_terms(terms, TIME)
    for q, v, f in zip(motion.coordinates, motion.velocities, motion.forces, strict=True):
        total = add_terms(total, multiply_terms(derivative_of_terms(terms, v), f))
        total = add_terms(total, multiply_terms(derivative_of_terms(terms, q), {monomial(v): Fraction(1)}))
    return total


@lru_cache(maxsize=4096)
def has_velocity(letter: Expression) -> bool:
    return any(isinstance(node, Velocity) for node in walk(letter))


def split_velocities(key: Monomial) -> tuple[Monomial, Monomial]:
    """(letters without velocities, letters with)."""
    moving = frozenset(item for item in key if has_velocity(item[0]))
    return key - moving, moving
