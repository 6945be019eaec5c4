"""Systems without a Lagrangian: the nearest one against a search of a grid, which knows nothing of
multipliers with parameters, families, or projections.

A pair q'' = -K q - C q' of constant matrices has an L(t, q, q') exactly where some regular symmetric
g makes g T symmetric for T = Phi, nabla Phi, nabla^2 Phi (n = 2; Douglas 1941, 8): Phi = K - C^2/4,
and nabla T = (C T - T C)/2. These are three linear equations for (g_11, g_12, g_22).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inverse_service import solve

Letters = dict[str, Any]


def rows_of(letters: Letters) -> np.ndarray:
    """The equations for g at all points of a grid, (..., 3, 3)."""
    shape = np.broadcast_shapes(*(np.shape(value) for value in letters.values()))
    damping = np.empty((*shape, 2, 2))
    for place, name in (((0, 0), "a"), ((0, 1), "b"), ((1, 0), "c"), ((1, 1), "d")):
        damping[(..., *place)] = letters[name]
    tensor = np.array([[2.0, -1.0], [-1.0, 3.0]]) - damping @ damping / 4
    rows = []
    for _ in range(3):
        (p, q), (r, s) = np.moveaxis(tensor, (-2, -1), (0, 1))
        rows.append(np.stack([q, s - p, -r], axis=-1))
        tensor = (damping @ tensor - tensor @ damping) / 2
    return np.stack(rows, axis=-2)


def nearest_on_grid(fitted: dict[str, float], fixed: Letters, width: float, steps: int) -> float:
    """The least distance of a point where the equations become dependent and g is regular.

    Between neighbors of the grid their determinant is taken as linear.
    """
    axes = [np.linspace(value - width, value + width, steps) for value in fitted.values()]
    grid = np.meshgrid(*axes, indexing="ij")
    values = np.linalg.det(rows_of(fixed | dict(zip(fitted, grid, strict=True))))
    best = np.inf
    for axis in range(len(axes)):
        first = np.take(values, range(steps - 1), axis)
        second = np.take(values, range(1, steps), axis)
        for place in map(tuple, np.argwhere(first * second < 0)):
            point = [axes[k][i] for k, i in enumerate(place)]
            part = first[place] / (first[place] - second[place])
            point[axis] += part * (axes[axis][1] - axes[axis][0])
            distance = float(np.linalg.norm(np.array(point) - [*fitted.values()]))
            if distance < best and is_regular(fixed | dict(zip(fitted, point, strict=True))):
                best = distance
    return best


def is_regular(letters: Letters) -> bool:
    g = np.linalg.svd(rows_of(letters))[2][-1]
    return bool(abs(g[0] * g[2] - g[1] ** 2) > 0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fitted", "fixed", "width", "steps"),
    [
        # Springs with friction that is not proportional.
        ({"b": 0.2, "d": 0.1}, {"a": 0.5, "c": 0.3}, 1.2, 801),
        # Gyroscopic forces with friction.
        ({"a": 0.4, "b": 0.5, "c": -0.3}, {"d": 0.1}, 0.5, 81),
    ],
)
def test_the_distance_of_a_system_without_a_lagrangian_is_that_of_a_grid(
    fitted: dict[str, float], fixed: dict[str, float], width: float, steps: int
) -> None:
    table = {name: name for name in fitted} | {name: str(value) for name, value in fixed.items()}
    document = {
        "equations": {
            "x": "-2*x + y - {a}*x' - {b}*y'".format(**table),
            "y": "x - 3*y - {c}*x' - {d}*y'".format(**table),
        },
        "parameters": {name: str(value) for name, value in fitted.items()},
        "nearest": {"errors": 1},
        "first_integrals": False,
    }
    result = solve(document, time_limit=60)
    assert result["verdict_with_time"] == "not_variational"
    found = min(part["least"] for part in result["nearest"])
    spacing = 2 * width / (steps - 1)
    assert found == pytest.approx(nearest_on_grid(fitted, fixed, width, steps), abs=spacing)
