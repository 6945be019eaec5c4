"""Variational integrators: discrete Euler-Lagrange equations of L_d(q, q + d) = L((1 - a) q + a (q
+ d), d/h).

Written for arrays of numbers or of formulas, and callables that give gradients. Unknowns are
increments; a step carries (q, p), p the discrete momentum D2 L_d of the step before times h.

With constraints, the discrete Lagrange-d'Alembert equations: D1 L_d(q_k, q_(k+1)) + D2 L_d(q_(k-1),
q_k) = lambda_a omega^a(q_k) with omega^a(q) . (q_(k+1) - q_k) + h c^a(q) = 0 at q = (1 - alpha) q_k
+ alpha q_(k+1), or their mean over alpha and 1 - alpha.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

Number = Any
Vector = Any  # an array
Gradient = Callable[[Vector, Vector], Vector]
Forms = Callable[[Vector], Vector]


def hamiltonian_step(
    q: Vector,
    p: Vector,
    d: Vector,
    e: Vector,
    h: Number,
    alpha: Number,
    slope_q: Gradient,
    slope_p: Gradient,
) -> tuple[Vector, Vector]:
    """(residuals, momentum increments) for increments d of q and e of p.

    d = h H_p(Q, P), e = -h H_q(Q, P) at Q = q + alpha d, P = p + (1 - alpha) e: symplectic Euler at
    0, the implicit midpoint rule at 1/2, the adjoint of symplectic Euler at 1. Equal to the
    discrete Euler-Lagrange equations of L with p = dL/dv solved for v; smooth where only L is
    singular.
    """
    place, momentum = q + d * alpha, p + e * (1 - alpha)
    return np.concatenate([d - slope_p(place, momentum) * h, e + slope_q(place, momentum) * h]), e


def symmetrised_hamiltonian_step(
    q: Vector, p: Vector, d: Vector, e: tuple[Vector, Vector], h: Number, alpha: Number, slope_q: Gradient,
    slope_p: Gradient,
) -> tuple[Vector, Vector]:  # fmt: skip
    """The mean of the alpha and the 1 - alpha discrete Lagrangians, each with its own momentum p +
    e.

    Both momenta have the velocity d/h. Their equality is written without h, so that the determinant
    has a limit for h -> 0 and keeps its sign in the backward substeps of a composition. At alpha =
    0 and a separable H these are the equations of Stormer and Verlet.
    """
    points = [
        (q + d * part, p + change) for part, change in zip((alpha, 1 - alpha), e, strict=True)
    ]
    slopes, rates = ([slope(*point) for point in points] for slope in (slope_q, slope_p))
    pull = e[0] + slopes[0] * ((1 - alpha) * h) + (e[1] + slopes[1] * (alpha * h))
    pushes = -(slopes[0] + slopes[1]) * h / 2
    return np.concatenate([d - rates[0] * h, rates[0] - rates[1], pull]), pushes


def raw_step(
    q: Vector,
    p: Vector,
    d: Vector,
    h: Number,
    parts: Sequence[Number],
    slope_q: Gradient,
    slope_v: Gradient,
) -> tuple[Vector, Vector]:
    """(residuals, momentum increments) of the discrete Euler-Lagrange equations in q and v
    themselves.

    `parts` is (alpha,), or (alpha, 1 - alpha) for the mean of both forms. Residual:
    h p - h L_v(Q, d/h) + (1 - alpha) h^2 L_q(Q, d/h), increment of p: h L_q(Q, d/h).
    """
    places = [q + d * part for part in parts]
    impulse, force = (
        sum(slope(place, d / h) * h for place in places) / len(parts)
        for slope in (slope_v, slope_q)
    )
    kick = sum(
        slope_q(place, d / h) * ((1 - part) * h * h)
        for part, place in zip(parts, places, strict=True)
    )
    return p * h - impulse + kick / len(parts), force


def lagrange_dalembert_step(
    q: Vector, p: Vector, d: Vector, m: Vector, h: Number, parts: Sequence[Number], slope_q: Gradient,
    slope_v: Gradient, forms: Forms, drifts: Forms,
) -> tuple[Vector, Vector]:  # fmt: skip
    """(residuals, momentum increments) for increments d and multipliers m = h lambda; omega_d times
    h is the mean over `parts` of omega(q + part d) . d + h c(q + part d).
    """
    free, kick = raw_step(q, p, d, h, parts, slope_q, slope_v)
    if not len(m):
        return free, kick
    held = m @ forms(q)
    places = [q + d * part for part in parts]
    defects = sum(forms(at) @ d + drifts(at) * h for at in places) / len(parts)
    return np.concatenate([free - held, defects]), kick - held / h
