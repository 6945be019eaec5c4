"""L(q, q') of linear systems with damping: sums over coordinates in which the system falls apart.

For u'' = -c u' - k u the function D = v^2 + c u v + k u^2 has Gamma(D) = -c D, so that 1/D is a multiplier
(Jacobi's last; Chandrasekar, Senthilvelan and Lakshmanan 2005). With d = 4k - c^2 and w = sqrt|d|
    L = (2v + cu)/(wu) atan((2v + cu)/(wu)) - log(D)/2                    for d > 0,
    L = ((v - r u) log(v - r u) - (v - s u) log(v - s u)) / (w u)         for d < 0, r > s roots of z^2 + cz + k,
    L = -log(v + c u/2) for d = 0, and L = v log v - c u for k = 0.
A constant force b moves u by b/k, or v by b/c. The form is chosen by the sign of d at a real point.
"""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.algebra.exact_ring import ExactRing
from inverse_service.algebra.exact_trees import quotient_tree
from inverse_service.algebra.rational_functions import TooLarge
from inverse_service.algebra.real_point import RealTable, find_real_point, real_sign
from inverse_service.expressions.tree import (
    HALF,
    ZERO,
    Apply,
    Expression,
    add,
    divide,
    multiply,
    negate,
    number,
    power,
    square_root,
    subtract,
)
from inverse_service.inverse_problem.decision.analysis import variables_of
from inverse_service.inverse_problem.search.linear_systems.coordinates import (
    Separate,
    linear_form,
    separate_coordinates,
)
from inverse_service.inverse_problem.search.linear_systems.reading import linear_system, linear_terms
from inverse_service.inverse_problem.search.linear_systems.roots import even_root
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.motion import MotionTerms
from inverse_service.inverse_problem.search.numerical_verification import holds_numerically
from inverse_service.inverse_problem.search.terms import TooManyTerms, terms_of, tree_of


def is_autonomous_and_linear(material: Material) -> bool:
    """Whether L(q, q') is asked for and f is linear."""
    return not material.motion.with_time and linear_terms(material.motion) is not None


def separate_lagrangians(material: Material, seed: int) -> Sequence[Expression]:
    """The sum of the Lagrangians of separate coordinates, verified to 40 digits; none where there are none."""
    system, table = material.analysis.system, material.analysis.real_point
    try:
        linear = linear_system(material) if table is not None else None
        parts = separate_coordinates(linear) if linear is not None else None
        if linear is None or parts is None or table is None:
            return ()
        tree = add(*(_of_part(linear.ring, part, material.motion, table) for part in parts))
    except (TooLarge, ZeroDivisionError, KeyError):
        return ()
    point = find_real_point([*material.analysis.accelerations, tree], variables_of(system), seed)
    return (tree,) if point is not None and holds_numerically(system, tree, point, seed) else ()


def _of_part(ring: ExactRing, part: Separate, motion: MotionTerms, table: RealTable) -> Expression:
    """The Lagrangian of one coordinate."""
    u, v = (_expanded(linear_form(part.weights, letters)) for letters in (motion.coordinates, motion.velocities))
    c, k = (quotient_tree(ring, value) for value in (part.damping, part.stiffness))
    if part.damping.is_zero:
        potential = subtract(multiply(HALF, k, power(u, 2)), multiply(part.force, u))
        return subtract(multiply(HALF, power(v, 2)), potential)
    if part.stiffness.is_zero:
        return _resisted(u, v, c, part.force, table)
    u = subtract(u, divide(part.force, k)) if part.force != ZERO else u
    discriminant = part.stiffness.scaled(4) - part.damping * part.damping
    if discriminant.is_zero:
        return negate(Apply("log", _expanded(add(v, multiply(HALF, c, u)))))
    d = quotient_tree(ring, discriminant)
    if real_sign(d, table) > 0:
        return _oscillating(u, v, c, k, _root(d))
    return _overdamped(u, v, c, _root(quotient_tree(ring, -discriminant)))


def _resisted(u: Expression, v: Expression, c: Expression, force: Expression, table: RealTable) -> Expression:
    """(v - b/c) log|v - b/c| - c u on the side of v = b/c where v = 0 is."""
    limit = divide(force, c)
    below = force != ZERO and real_sign(limit, table) > 0
    argument = subtract(limit, v) if below else subtract(v, limit)
    return subtract(multiply(subtract(v, limit), Apply("log", argument)), multiply(c, u))


def _root(radicand: Expression) -> Expression:
    outside, inside = even_root(radicand)
    return multiply(outside, square_root(_expanded(inside)))


def _oscillating(u: Expression, v: Expression, c: Expression, k: Expression, w: Expression) -> Expression:
    ratio = divide(_expanded(add(multiply(number(2), v), multiply(c, u))), multiply(w, u))
    form = _expanded(add(power(v, 2), multiply(c, u, v), multiply(k, power(u, 2))))
    return subtract(multiply(ratio, Apply("atan", ratio)), multiply(HALF, Apply("log", form)))


def _overdamped(u: Expression, v: Expression, c: Expression, w: Expression) -> Expression:
    first, second = (
        _expanded(add(v, multiply(HALF, subtract(c, rate), u))) for rate in (w, negate(w))
    )  # fmt: skip
    above = subtract(multiply(first, Apply("log", first)), multiply(second, Apply("log", second)))
    return divide(above, multiply(w, u))


def _expanded(tree: Expression) -> Expression:
    try:
        return tree_of(terms_of(tree))
    except TooManyTerms:
        return tree
