"""A start from which a system can be run: the first of some that stays where its formulas have values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from inverse_service.errors import InputError
from inverse_service.expressions.names import Names
from inverse_service.expressions.reader import read_formula
from inverse_service.expressions.tree import Expression, Symbol
from inverse_service.integrators.trajectory import Array
from inverse_service.simulation.array_values import array_value, table_of
from inverse_service.simulation.formulas import walls
from inverse_service.web.pages.preview import accelerations_of
from inverse_service.web.pages.scenes import SceneForm, scene_document

# Positions and velocities in turn of the first coordinates, the last of each for all further ones.
STARTS = (
    ((0.1, 0.0), (1.0, 1.0, 0.0)),
    ((1.0, 0.5, 0.2), (0.1, 1.0, 0.3)),
    ((1.0, 0.3, 0.1), (0.2, 0.4, 0.1)),
    ((0.5, 0.2, 0.1), (0.1, 0.2, 0.3)),
    ((3.0, 1.0, 0.5), (0.1, 0.5, 0.2)),
    ((-1.0, -0.5, -0.2), (-0.1, -0.3, 0.2)),
    ((0.2, -0.3, 0.1), (-0.05, 0.1, 0.07)),
)
LARGEST = 50.0  # of accelerations and of places
NEAR = 0.02  # a condition of the domain that comes closer to zero
LEAST_PART = 0.1  # of the determinant of the Hessian at the start
SHARE = 0.8


def with_good_start(form: SceneForm, system: Mapping[str, Any], answer: Mapping[str, Any]) -> SceneForm:
    """The form with the start that lasts longest, and as many steps as it lasts.

    On the way the conditions of the domain of the answer's Lagrangian hold, its Hessian stays regular, and no wall of
    the accelerations is passed.
    """
    domain = (answer.get("lagrangian") or {}).get("domain", ())
    try:
        scene, found = accelerations_of(scene_document(form, system))
        names = Names(scene.coordinates, tuple(scene.values))
        watched = tuple(_left(condition, names) for condition in domain)
        hessian = tuple(read_formula(text, names) for line in answer.get("multiplier") or () for text in line)
    except InputError:
        return form
    if found is None or scene.constraints:
        return form
    moving: set[Expression] = {Symbol(name) for name in scene.coordinates}
    watched += tuple(dict.fromkeys(wall for tree in found for wall in walls(tree, moving)))
    q, v = (np.array([[part[min(k, len(part) - 1)] for k in range(len(scene.coordinates))] for part in parts])
            for parts in zip(*STARTS, strict=True))  # fmt: skip
    with np.errstate(all="ignore"):
        lasted, evenness = _lasted(scene, (*found, *watched), hessian, q, v, int(form.steps))
    best = int(np.argmax(lasted + evenness))
    if not lasted[best]:
        return form
    steps = int(form.steps) if lasted[best] == int(form.steps) else max(1, int(SHARE * lasted[best]))
    return replace(form, positions=_texts(scene.coordinates, q[best]), velocities=_texts(scene.coordinates, v[best]),
                   steps=str(steps))  # fmt: skip


def _texts(names: Sequence[str], values: Array) -> dict[str, str]:
    return {name: f"{value:g}" for name, value in zip(names, values, strict=True)}


def _left(condition: str, names: Names) -> Expression:
    """The difference of the two sides of a condition, which is not zero on the domain."""
    for sign in (" != ", " > ", " < ", " >= ", " <= "):
        left, found, right = condition.partition(sign)
        if found:
            return read_formula(f"({left}) - ({right})", names)
    return read_formula(condition, names)


def _lasted(
    scene: Any, formulas: Sequence[Expression], hessian: Sequence[Expression], q: Array, v: Array, steps: int
) -> tuple[Array, Array]:
    """For how many steps the classical Runge-Kutta method stays within bounds from each start (m,).

    And how even the determinant of the Hessian is on the way, from 0 to below 1.
    """
    n, h = len(scene.coordinates), float(scene.grid.step)

    def values(q: Array, v: Array) -> Array:
        table = table_of(scene.coordinates, q, v, scene.values)
        found = [np.broadcast_to(array_value(formula, table), len(q)) for formula in (*formulas, *hessian)]
        matrices = np.stack(found[len(formulas) :], axis=1).reshape(-1, n, n) if hessian else np.ones((len(q), 1, 1))
        return np.stack([*found[: len(formulas)], np.linalg.det(matrices)], axis=1)

    lasted, alive, first = np.zeros(len(q)), np.ones(len(q), dtype=bool), values(q, v)
    floor = np.full_like(first[:, n:], NEAR)
    floor[:, -1] = LEAST_PART * np.abs(first[:, -1])
    least = most = np.abs(first[:, -1])
    for _ in range(steps):
        a = values(q, v)
        alive &= np.isfinite(a).all(1) & (np.abs(a[:, :n]) < LARGEST).all(1) & (np.abs(q) < LARGEST).all(1)
        alive &= (np.abs(a[:, n:]) > floor).all(1) & (np.sign(a[:, n:]) == np.sign(first[:, n:])).all(1)
        if not alive.any():
            break
        least = np.where(alive, np.minimum(least, np.abs(a[:, -1])), least)
        most = np.where(alive, np.maximum(most, np.abs(a[:, -1])), most)
        b = values(q + h / 2 * v, v + h / 2 * a[:, :n])
        c = values(q + h / 2 * (v + h / 2 * a[:, :n]), v + h / 2 * b[:, :n])
        d = values(q + h * (v + h / 2 * b[:, :n]), v + h * c[:, :n])
        q = q + h * v + h * h / 6 * (a + b + c)[:, :n]
        v = v + h / 6 * (a + 2 * b + 2 * c + d)[:, :n]
        lasted += alive
    return lasted, np.nan_to_num(0.9 * least / most)
