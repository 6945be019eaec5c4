"""Systems without a Lagrangian: the nearest one against a search of a grid, which knows nothing of
multipliers with parameters, families, or projections.

A pair q'' = -K q - C q' of constant matrices has an L(t, q, q') exactly where some regular symmetric
g makes g T symmetric for T = Phi, nabla Phi, nabla^2 Phi (n = 2; Douglas 1941, 8): Phi = K - C^2/4,
and nabla T = (C T - T C)/2. These are three linear equations for (g_11, g_12, g_22).
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from inverse_service import nearest, solve

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
    """The least distance of a point on an edge of the grid where the equations become dependent and
    g is regular.
    """
    axes = [np.linspace(value - width, value + width, steps) for value in fitted.values()]
    grid = np.meshgrid(*axes, indexing="ij")
    values = np.linalg.det(rows_of(fixed | dict(zip(fitted, grid, strict=True))))
    found = list[tuple[float, list[float], list[float]]]()
    for axis in range(len(axes)):
        first = np.take(values, range(steps - 1), axis)
        second = np.take(values, range(1, steps), axis)
        for place in map(tuple, np.argwhere(first * second < 0)):
            left = [axes[k][i] for k, i in enumerate(place)]
            right = list(left)
            right[axis] = axes[axis][place[axis] + 1]
            middle = (np.array(left) + right) / 2
            found.append((float(np.linalg.norm(middle - [*fitted.values()])), left, right))
    for _, left, right in sorted(found):
        point = zero_between(np.array(left), np.array(right), [*fitted], fixed)
        g = np.linalg.svd(rows_of(fixed | dict(zip(fitted, point, strict=True))))[2][-1]
        if abs(g[0] * g[2] - g[1] ** 2) > 1e-5:
            return float(np.linalg.norm(point - [*fitted.values()]))
    return np.inf


def zero_between(
    left: np.ndarray, right: np.ndarray, names: list[str], fixed: Letters
) -> np.ndarray:
    """The point of an edge where the determinant vanishes, by bisection."""
    value = lambda point: float(  # noqa: E731
        np.linalg.det(rows_of(fixed | dict(zip(names, point, strict=True))))
    )
    sign = value(left) > 0
    for _ in range(45):
        middle = (left + right) / 2
        left, right = (middle, right) if (value(middle) > 0) is sign else (left, middle)
    return (left + right) / 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fitted", "fixed", "width", "steps"),
    [
        # Springs with friction that is not proportional.
        ({"b": 0.2, "d": 0.1}, {"a": 0.5, "c": 0.3}, 1.8, 401),
        # The same with letters of which the condition, of degree 3, is linear in neither.
        ({"a": 0.5, "d": 0.1}, {"b": 0.2, "c": 0.3}, 1.8, 401),
        # Gyroscopic forces with friction.
        ({"b": 0.6, "c": -0.4}, {"a": 0.2, "d": 0.1}, 0.8, 401),
        ({"a": 0.4, "b": 0.5, "c": -0.3}, {"d": 0.1}, 0.5, 61),
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
    found = min(part["least"] for part in result["nearest"] if part["degrees"] == 1)
    spacing = 2 * width / (steps - 1)
    assert found == pytest.approx(nearest_on_grid(fitted, fixed, width, steps), abs=spacing)
    # Where b = c and a = c + d all three equations are multiples of one, which the grid does not see.
    dependent = special(fitted, fixed)
    both = [part["distance"] for part in result["nearest"] if part["degrees"] == 2]
    assert dependent is None or min(abs(one - dependent) for one in both) < 1e-3


def special(fitted: dict[str, float], fixed: dict[str, float]) -> float | None:
    """The distance to b = c, a = c + d, by least squares in the letters that may move; None if these cannot reach it."""
    rows = {"a": (0, 1), "b": (1, 0), "c": (-1, -1), "d": (0, -1)}
    letters = fitted | fixed
    left = np.array([rows[name] for name in fitted], dtype=float).T
    right = np.array([[rows[name][k] * letters[name] for name in letters] for k in (0, 1)]).sum(
        axis=1
    )
    change = np.linalg.lstsq(left, -right, rcond=None)[0]
    return float(np.linalg.norm(change)) if np.allclose(left @ change, -right) else None


@pytest.mark.slow
def test_simple_fractions_of_a_special_set_stay_on_it() -> None:
    """x'' = -a x + b y, y'' = c x - d y - e y' on c = 0, 4 d = 4 a + e^2: the offered numbers satisfy both."""
    found = nearest(
        "x'' = -1.02*x + 0.51*y; y'' = 0.02*x - 1.03*y - 0.21*y'", errors=0.02, nice=True
    )
    offered = [
        one["nice"]["moved"] for one in found["nearest"] if one["kind"] == "leaf" and one["nice"]
    ]
    assert offered
    given = {"x'': x": "-1.02", "y'': x": "0.02", "y'': y": "-1.03", "y'': y'": "-0.21"}
    on_it = 0
    for moved in offered:
        a, c, d, e = (
            Fraction(moved[name]["to"] if name in moved else text) for name, text in given.items()
        )
        on_it += c == 0 and 4 * d - 4 * a + e**2 == 0
        assert c == 0 or moved.get("x'': y", {}).get("to") == "0"
    assert on_it
