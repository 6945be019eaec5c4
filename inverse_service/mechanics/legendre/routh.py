"""Blocks quadratic in some of their velocities w, with coefficients that depend on the others u.

L = L_0(u) + A(u) w + w^T G(u) w/2 gives w = G^-1 (p_w - A). Routh's function
R(u; p_w) = L - p_w w = L_0 - (p_w - A)^T G^-1 (p_w - A)/2 is a Lagrangian in u alone, and its
H = p_u u - R is that of L (Routh 1877).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations

from inverse_service.expressions.collecting import expand
from inverse_service.expressions.collecting_trees import Monomial, Term, terms_tree
from inverse_service.expressions.tree import HALF, ZERO, Expression, Symbol, add, substitute
from inverse_service.mechanics.legendre.blocks import Block, Branch, Solver, degrees
from inverse_service.mechanics.legendre.forms import simplified
from inverse_service.mechanics.legendre.linear import linear_coefficients
from inverse_service.mechanics.legendre.quadratic import Inverse, form_matrix, invert, quadratic_form

_MOST_CHOICES = 12


@dataclass(frozen=True, slots=True)
class _Parts:
    """rest + linear[i] w_i + w^T G w/2, with G^-1."""

    rest: Expression
    linear: tuple[Expression, ...]
    inverse: Inverse


def routh_branches(block: Block, solve: Solver) -> Iterator[Branch]:
    """The branches for the largest sets of velocities that can be eliminated so."""
    for ignored in _choices(block):
        parts = _parts(block, ignored)
        if parts is None:
            continue
        left = [name for name in block.names if name not in ignored]
        shifted = _shifted([block.momenta[name] for name in ignored], parts)
        form = substitute(quadratic_form(parts.inverse, [block.momenta[name] for name in ignored]), shifted)
        function = simplified(parts.rest - HALF * form)
        for inner in solve(function, left, block.momenta):
            yield _joined(block, ignored, left, parts, inner)


def _choices(block: Block) -> Iterator[tuple[str, ...]]:
    """Sets of velocities in which every term has degree 2 at most, not all, the largest first."""
    tables = [(degrees(monomial, [name]), name) for name in block.names for monomial, _ in _terms(block)]
    unfit = {name for found, name in tables if found is None or found.get(name, 0) not in (0, 1, 2)}
    fit = [name for name in block.names if name not in unfit]
    count = 0
    for size in range(min(len(fit), len(block.names) - 1), 0, -1):
        for chosen in combinations(fit, size):
            if count < _MOST_CHOICES and all(_degree(monomial, chosen) <= 2 for monomial, _ in _terms(block)):
                count += 1
                yield chosen


def _terms(block: Block) -> tuple[Term, ...]:
    return expand(block.function)


def _degree(monomial: Monomial, names: Sequence[str]) -> Fraction:
    found = degrees(monomial, names) or {}
    return sum(found.values(), Fraction(0))


def _parts(block: Block, ignored: Sequence[str]) -> _Parts | None:
    groups: tuple[list[Term], list[Term], list[Term]] = ([], [], [])
    for monomial, value in _terms(block):
        groups[int(_degree(monomial, ignored))].append((monomial, value))
    rest, linear, quadratic = groups
    matrix = form_matrix(quadratic, ignored) if quadratic else None
    inverse = invert(matrix) if matrix else None
    slopes = linear_coefficients(linear, ignored)
    if inverse is None or slopes is None:
        return None
    return _Parts(terms_tree(rest), tuple(slopes.get(name, ZERO) for name in ignored), inverse)


def _shifted(momenta: Sequence[Symbol], parts: _Parts) -> dict[Expression, Expression]:
    return {p: p - a for p, a in zip(momenta, parts.linear, strict=True) if a != ZERO}


def _joined(block: Block, ignored: Sequence[str], left: Sequence[str], parts: _Parts, inner: Branch) -> Branch:
    shifted = [block.momenta[name] - a for name, a in zip(ignored, parts.linear, strict=True)]
    velocities = dict(zip(left, inner.velocities, strict=True))
    for name, row in zip(ignored, parts.inverse.entries, strict=True):
        velocities[name] = simplified(add(*(entry * p for entry, p in zip(row, shifted, strict=True))))
    return Branch(
        tuple(velocities[name] for name in block.names),
        inner.hamiltonian,
        inner.conditions,
    )
