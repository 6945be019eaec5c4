"""One coordinate after a contact transformation: multipliers that hold the velocity from some that do not.

g (dy - v dt) ^ (dv - f dt) is closed exactly for multipliers g (Helmholtz), and a change of (t, y, v) that takes
dy - v dt to a multiple of itself takes it to one of the same form. So a multiplier phi(T, Y) of the changed equation
gives one of y'' = f:
Legendre   T = v, Y = t v - y, V = t       Y'' = 1/f,        g = phi/f
exchange   T = y, Y = t, V = 1/v           Y'' = -f/v^3,     g = phi/v^3
The first makes y'' (a + b t) = 1 with a and b functions of v linear, and what is written in t y' - y; the second takes
f that is cubic in v, without constant term, to one that is quadratic. L is v int g dv - int v g dv and what is linear
in v.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, substitute
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.search.material import Material, antiderivatives, gather
from inverse_service.inverse_problem.search.one_coordinate.algebra import factored
from inverse_service.inverse_problem.search.scalar_multiplier import function_of_position
from inverse_service.inverse_problem.search.terms import (
    Monomial,
    Terms,
    TooManyTerms,
    monomial,
    monomial_tree,
    multiply_terms,
    terms_of,
    times,
)

_RATE = Symbol("rate of y")


def kinetic_terms(material: Material) -> list[Monomial]:
    """The terms of int int g dv dv for such multipliers g."""
    if material.motion.size > 1:
        return []
    f, (y,), (v,) = material.analysis.system.accelerations[0], material.motion.coordinates, material.motion.velocities
    legendre: dict[Expression, Expression] = {TIME: v, y: TIME * v - y, v: TIME}
    exchange: dict[Expression, Expression] = {TIME: y, y: TIME, v: v**-1}
    changes = [(legendre, f**-1, f**-1), (exchange, -(f / v**3), v**-3)]
    found: dict[Monomial, None] = {}
    for table, changed, weight in changes:
        try:
            phi = _multiplier(material, substitute(changed, table))
            if phi is not None:
                g = factored(substitute(phi, table) * weight, [y, v])
                found.update(dict.fromkeys(_twice_integrated(terms_of(substitute(g, {v: _RATE})))))
        except (TooManyTerms, IrreducibleAtoms, ZeroDivisionError):
            continue
    return [key for term in found for key in terms_of(substitute(monomial_tree(term), {_RATE: v}))]


def _multiplier(material: Material, force: Expression) -> Expression | None:
    """phi(t, y) for y'' = force."""
    symbols: list[Symbol | Velocity] = [*material.motion.coordinates, *material.motion.velocities]
    system = replace(material.analysis.system, accelerations=(factored(force, symbols),), branch=None)
    return function_of_position(gather(analyze(system), with_time=True))


def _twice_integrated(g: Terms) -> list[Monomial]:
    rate = monomial(_RATE)
    once = [times(m, rate) for key in g for m in antiderivatives(key, _RATE)]
    return [*once, *(m for key in multiply_terms(g, {rate: Fraction(1)}) for m in antiderivatives(key, _RATE))]
