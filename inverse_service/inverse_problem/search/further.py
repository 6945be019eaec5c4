"""Further Lagrangians of a system of which one is known.

A coordinate x that L couples with no other, and whose part of L holds no t, has an energy h = x' dL/dx' - L of its own.
For every function F, x' int F(h)/x'^2 dx' may stand for that part (h is conserved, and its Hessian is F'(h)/x' dh/dx'):
F = h is the part itself, and F = h^2 of m x'^2/2 - V gives m^2 x'^4/12 + m x'^2 V - V^2 (Currie and Saletan 1966).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

import mpmath

from inverse_service import bounds
from inverse_service.algebra.real_point import RealTable
from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, walk
from inverse_service.inverse_problem.search.motion_terms import split_velocities
from inverse_service.inverse_problem.search.terms import (
    Monomial,
    Terms,
    TooManyTerms,
    add_terms,
    derivative_of_terms,
    monomial,
    multiply_terms,
    terms_of,
    times,
    tree_of,
)
from inverse_service.mechanics.euler_lagrange import hessian

_TINY, _STEP = mpmath.mpf(10) ** -20, mpmath.mpf(129) / 128


def with_squared_energies(lagrangian: Expression, names: Sequence[str]) -> Expression | None:
    """L with F = h^2 for every coordinate that has an energy of its own; None where there is none."""
    try:
        whole = terms_of(lagrangian)
        parts = dict(_own_parts(whole, names))
        raised = [_raised(part, Velocity(name)) for name, part in parts.items()]
    except TooManyTerms:
        return None
    if not raised or None in raised:
        return None
    rest = {key: value for key, value in whole.items() if not any(key in part for part in parts.values())}
    for terms in raised:
        rest = add_terms(rest, terms or {})
    return tree_of(rest)


def _own_parts(whole: Terms, names: Sequence[str]) -> Iterator[tuple[str, Terms]]:
    """The terms with x or x' for each x whose terms hold neither t nor another coordinate."""
    held = {key: _leaves(key, names) for key in whole}
    for name in names:
        part = {key: value for key, value in whole.items() if name in held[key]}
        if 0 < len(part) <= bounds.CANDIDATES and all(held[key] == {name} for key in part):
            yield name, part


def _leaves(key: Monomial, names: Sequence[str]) -> set[str]:
    """The coordinates in a monomial, whose velocities count, and "" for t."""
    found = set()
    for letter, _ in key:
        for node in walk(letter):
            match node:
                case Velocity(name):
                    found.add(name)
                case Symbol(name) if name in names or node == TIME:
                    found.add("" if node == TIME else name)
    return found


def _raised(part: Terms, velocity: Velocity) -> Terms | None:
    """x' int h^2/x'^2 dx'; None where h is no Laurent polynomial in x', or the integral a logarithm."""
    works = multiply_terms(derivative_of_terms(part, velocity), {monomial(velocity): Fraction(1)})
    energy = add_terms(works, part, -1)
    found: Terms = {}
    for key, value in multiply_terms(energy, energy).items():
        moving = split_velocities(key)[1]
        degree = dict(moving).get(velocity, Fraction(0))
        if moving != times(frozenset(), monomial(velocity), degree) or degree == 1:
            return None
        found[key] = value / (degree - 1)
    return found


def is_multiple(first: Expression, second: Expression, names: Sequence[str], table: RealTable | None) -> bool:
    """Whether the Hessians are constant multiples of each other, seen at the real point and at one beside it."""
    if table is None:
        return first == second
    rows = zip(hessian(first, names), hessian(second, names), strict=True)
    entries = [pair for row in rows for pair in zip(*row, strict=True)]
    moving = {*map(Symbol, names), *map(Velocity, names)}
    try:
        with mpmath.workdps(30):
            beside = {leaf: value * _STEP if leaf in moving else value for leaf, value in table.items()}
            pairs = [(evaluate(x, point), evaluate(y, point)) for point in (table, beside) for x, y in entries]
            a, b = max(pairs, key=lambda pair: abs(pair[0]))
            return all(abs(x * b - y * a) < _TINY * (1 + abs(a * b)) for x, y in pairs)
    except NoRealValue:
        return False
