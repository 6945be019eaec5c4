"""Nonholonomic integrators: the discrete Lagrange-d'Alembert equations.

D1 L_d(q_k, q_(k+1)) + D2 L_d(q_(k-1), q_k) = lambda_a omega^a(q_k) with the discrete constraints
omega^a(q) . (q_(k+1) - q_k) + h c^a(q) = 0 at q = (1 - alpha) q_k + alpha q_(k+1), or their mean over alpha and
1 - alpha.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from inverse_service.integrators.variational import Gradient, Number, Vector, between, raw_step

Forms = Callable[[Vector], list[Vector]]
Drifts = Callable[[Vector], Vector]


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
