"""Variational integrators: discrete Euler-Lagrange equations of L_d(q, q + d) = L((1 - a) q + a (q + d), d/h).

Written for any arithmetic: lists of numbers or of formulas, and callables that give gradients as lists. Unknowns are
increments; a step carries (q, p), p the discrete momentum D2 L_d of the step before times h.

With constraints, the discrete Lagrange-d'Alembert equations: D1 L_d(q_k, q_(k+1)) + D2 L_d(q_(k-1), q_k) =
lambda_a omega^a(q_k) with omega^a(q) . (q_(k+1) - q_k) + h c^a(q) = 0 at q = (1 - alpha) q_k + alpha q_(k+1), or their
mean over alpha and 1 - alpha.
"""

from collections.abc import Callable, Sequence
from typing import Any

Number = Any
Vector = list[Number]
Gradient = Callable[[Vector, Vector], Vector]
Forms = Callable[[Vector], list[Vector]]
Drifts = Callable[[Vector], Vector]


def between(start: Sequence[Number], change: Sequence[Number], part: Number) -> Vector:
    """start + part change."""
    return [a + part * b for a, b in zip(start, change, strict=True)]


def hamiltonian_step(
    q: Vector, p: Vector, d: Vector, e: Vector, h: Number, alpha: Number, slope_q: Gradient, slope_p: Gradient
) -> tuple[Vector, Vector]:
    """(residuals, momentum increments) for increments d of q and e of p.

    d = h H_p(Q, P), e = -h H_q(Q, P) at Q = q + alpha d, P = p + (1 - alpha) e: symplectic Euler at 0, the implicit
    midpoint rule at 1/2, the adjoint of symplectic Euler at 1. Equal to the discrete Euler-Lagrange equations of L
    with p = dL/dv solved for v; smooth where only L is singular.
    """
    place, momentum = between(q, d, alpha), between(p, e, 1 - alpha)
    rates = [d_i - h * rate for d_i, rate in zip(d, slope_p(place, momentum), strict=True)]
    forces = [e_i + h * force for e_i, force in zip(e, slope_q(place, momentum), strict=True)]
    return [*rates, *forces], e


def symmetrised_hamiltonian_step(
    q: Vector, p: Vector, d: Vector, e: tuple[Vector, Vector], h: Number, alpha: Number, slope_q: Gradient,
    slope_p: Gradient,
) -> tuple[Vector, Vector]:  # fmt: skip
    """The mean of the alpha and the 1 - alpha discrete Lagrangians, each with its own momentum p + e.

    Both momenta have the velocity d/h. Their equality is written without h, so that the determinant has a limit for
    h -> 0 and keeps its sign in the backward substeps of a composition. At alpha = 0 and a separable H these are the
    equations of Stormer and Verlet.
    """
    parts = (alpha, 1 - alpha)
    places = [between(q, d, part) for part in parts]
    momenta = [between(p, change, 1) for change in e]
    slopes = [slope_q(*point) for point in zip(places, momenta, strict=True)]
    rates = [slope_p(*point) for point in zip(places, momenta, strict=True)]
    residuals: Vector = [d_i - h * rate for d_i, rate in zip(d, rates[0], strict=True)]
    residuals += [left - right for left, right in zip(*rates, strict=True)]
    for k in range(len(q)):
        pulls = [e[j][k] + (1 - part) * h * slopes[j][k] for j, part in enumerate(parts)]
        residuals.append(sum(pulls[1:], pulls[0]))
    return residuals, [-h * (slopes[0][k] + slopes[1][k]) / 2 for k in range(len(q))]


def raw_step(
    q: Vector, p: Vector, d: Vector, h: Number, parts: Sequence[Number], slope_q: Gradient, slope_v: Gradient
) -> tuple[Vector, Vector]:
    """(residuals, momentum increments) of the discrete Euler-Lagrange equations in q and v themselves.

    `parts` is (alpha,), or (alpha, 1 - alpha) for the mean of both forms. Residual:
    h p - h L_v(Q, d/h) + (1 - alpha) h^2 L_q(Q, d/h), increment of p: h L_q(Q, d/h).
    """
    velocity = [d_i / h for d_i in d]
    places = [between(q, d, part) for part in parts]
    impulses = [slope_v(place, velocity) for place in places]
    forces = [slope_q(place, velocity) for place in places]
    share = len(parts)
    residuals, changes = [], []
    for k in range(len(q)):
        pull = sum((h * impulse[k] for impulse in impulses[1:]), h * impulses[0][k]) / share
        kicks = [(1 - part) * h * h * force[k] for part, force in zip(parts, forces, strict=True)]
        residuals.append(h * p[k] - pull + sum(kicks[1:], kicks[0]) / share)
        changes.append(sum((h * force[k] for force in forces[1:]), h * forces[0][k]) / share)
    return residuals, changes


def discrete_constraints(
    q: Vector, d: Vector, h: Number, parts: Sequence[Number], forms: Forms, drifts: Drifts
) -> Vector:
    """omega_d times h: the mean over `parts` of omega(q + part d) . d + h c(q + part d)."""
    places = [between(q, d, part) for part in parts]
    values = [
        [_dot(form, d) + h * drift for form, drift in zip(forms(place), drifts(place), strict=True)] for place in places
    ]
    return [sum((value[a] for value in values[1:]), values[0][a]) / len(parts) for a in range(len(values[0]))]


def lagrange_dalembert_step(
    q: Vector, p: Vector, d: Vector, m: Vector, h: Number, parts: Sequence[Number], slope_q: Gradient,
    slope_v: Gradient, forms: Forms, drifts: Drifts,
) -> tuple[Vector, Vector]:  # fmt: skip
    """(residuals, momentum increments) for increments d and multipliers m = h lambda."""
    free, kicks = raw_step(q, p, d, h, parts, slope_q, slope_v)
    reactions = forms(q)
    residuals, changes = [], []
    for k in range(len(q)):
        held = sum((m[a] * reactions[a][k] for a in range(1, len(m))), m[0] * reactions[0][k]) if m else 0
        residuals.append(free[k] - held)
        changes.append(kicks[k] - held / h)
    return [*residuals, *(discrete_constraints(q, d, h, parts, forms, drifts) if m else [])], changes


def _dot(left: Sequence[Number], right: Sequence[Number]) -> Number:
    products = [a * b for a, b in zip(left, right, strict=True)]
    return sum(products[1:], products[0])
