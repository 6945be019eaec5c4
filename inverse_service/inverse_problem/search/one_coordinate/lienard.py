"""Lienard's equation with Chiellini's condition, in any coordinate.

With y' = E x', E = exp(-int a dx), x'' = a x'^2 + b x' + c becomes y'' = b y' + h b, h = E c / b. Where
dh/dy = -alpha b with constant alpha (Chiellini 1931), 1/(alpha w^2 + h w + h^2), w = y', is a last multiplier.
"""

from __future__ import annotations

from collections.abc import Mapping

from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    TIME,
    ZERO,
    Expression,
    add,
    divide,
    multiply,
    negate,
    power,
    walk,
)
from inverse_service.inverse_problem.search.factors import Factors
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.motion import split_velocities
from inverse_service.inverse_problem.search.one_coordinate.algebra import expanded, factored
from inverse_service.inverse_problem.search.terms import EMPTY, Terms, TooManyTerms, monomial_tree, tree_of


def inverse_multiplier(material: Material, factors: Factors) -> Expression | None:
    """(alpha E^2 v^2 + h E v + h^2)/E^2, or None where f is not of this kind."""
    motion = material.motion
    x, v = motion.coordinates[0], motion.velocities[0]
    parts = _by_powers(material)
    if parts is None or not parts.get(1) or not parts.get(0) or (parts.get(2) and 0 not in factors.along):
        return None
    scale, damping = monomial_tree(factors.along.get(0, EMPTY)), tree_of(parts[1])
    try:
        ratio = factored(divide(multiply(scale, tree_of(parts[0])), damping), [x])
        alpha = factored(negate(divide(differentiate(ratio, x), multiply(scale, damping))), [x])
        if alpha == ZERO or any(node in (x, TIME) for node in walk(alpha)):
            return None
        lowered = expanded(factored(divide(ratio, scale), [x]))
    except TooManyTerms:
        return None
    return add(multiply(alpha, power(v, 2)), multiply(lowered, v), power(lowered, 2))


def _by_powers(material: Material) -> Mapping[int, Terms] | None:
    """The coefficients of 1, v and v^2 in f; None where f holds other functions of v, or t."""
    velocity = material.motion.velocities[0]
    table: dict[int, Terms] = {}
    for key, value in material.motion.forces[0].items():
        position, moving = split_velocities(key)
        degree = dict(moving).get(velocity, 0)
        if degree not in (0, 1, 2) or len(moving) > 1 or (moving and not degree):
            return None
        if any(node == TIME for p, _ in key for node in walk(p)):
            return None
        table.setdefault(int(degree), {})[position] = value
    return table
