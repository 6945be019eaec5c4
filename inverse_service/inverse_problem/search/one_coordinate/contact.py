"""One coordinate after a contact transformation: multipliers that hold the velocity from some that do not.

g (dy - v dt) ^ (dv - f dt) is closed exactly for multipliers g (Helmholtz), and a change of (t, y, v) that takes
dy - v dt to a multiple of itself takes it to one of the same form. So a multiplier phi(T, Y) of the changed equation
gives one of y'' = f:
Legendre   T = v, Y = t v - y, V = t       Y'' = 1/f,        g = phi/f
exchange   T = y, Y = t, V = 1/v           Y'' = -f/v^3,     g = phi/v^3
The first makes y'' (a + b t) = 1 with a and b functions of v linear, and what is written in t y' - y; the second takes
f that is cubic in v, without constant term, to one that is quadratic.
"""

from __future__ import annotations

from dataclasses import replace

from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.evaluation import NoRealValue
from inverse_service.expressions.tree import (
    TIME,
    Expression,
    Symbol,
    add,
    divide,
    multiply,
    negate,
    power,
    substitute,
    subtract,
    walk,
)
from inverse_service.inverse_problem.decision.analysis import analyse
from inverse_service.inverse_problem.search.completion import completed
from inverse_service.inverse_problem.search.material import Material, gather
from inverse_service.inverse_problem.search.one_coordinate.algebra import factored, negated
from inverse_service.inverse_problem.search.one_coordinate.kinetic import Place, potential
from inverse_service.inverse_problem.search.scalar_multiplier import function_of_position
from inverse_service.inverse_problem.search.terms import TooManyTerms, terms_of


def propose(material: Material, seed: int) -> list[Expression]:
    """Lagrangians with such a multiplier; each is a candidate only."""
    f, point = material.analysis.system.accelerations[0], material.analysis.real_point
    y, v = material.motion.coordinates[0], material.motion.velocities[0]
    legendre = {TIME: v, y: subtract(multiply(TIME, v), y), v: TIME}
    exchange = {TIME: y, y: TIME, v: power(v, -1)}
    changes = [(legendre, power(f, -1), power(f, -1)), (exchange, negate(divide(f, power(v, 3))), power(v, -3))]
    found = []
    for table, changed, weight in changes if point is not None else ():
        try:
            phi = _multiplier(material, substitute(changed, table))
            if phi is not None:
                g = multiply(substitute(phi, table), weight)
                found.append(_lagrangian(g, f, Place(y, v, point)))
        except (TooManyTerms, NoRealValue, IrreducibleAtoms, ZeroDivisionError):
            continue
    allowed = [tree for tree in found if tree is not None]
    return [tree for tree in allowed if material.motion.with_time or TIME not in walk(tree)]


def _multiplier(material: Material, force: Expression) -> Expression | None:
    """phi(t, y) for y'' = force."""
    symbols = [*material.motion.coordinates, *material.motion.velocities]
    system = replace(material.analysis.system, accelerations=(factored(force, symbols),), branch=None)
    return function_of_position(gather(analyse(system), with_time=True))


def _lagrangian(g: Expression, force: Expression, place: Place) -> Expression | None:
    """K + U with d2K/dv2 = g; None where an integral is not found."""
    kinetic: Expression | None = factored(g, [place.x, place.v])
    rate = Symbol("the rate")
    for _ in range(2):
        kinetic = kinetic and completed([rate.name], [terms_of(substitute(kinetic, {place.v: rate}))])
        kinetic = kinetic and negated(substitute(kinetic, {rate: place.v}))
    rest = kinetic and potential(kinetic, force, place)
    return kinetic and rest and add(kinetic, rest)
