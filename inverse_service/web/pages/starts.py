"""A start from which a system can be run: the first of some that stays where its formulas have values; sketches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from itertools import chain, combinations, islice
from typing import Any

import numpy as np

from inverse_service import catalogue
from inverse_service.deadline import now
from inverse_service.errors import InputError
from inverse_service.expressions.tree import Expression, Symbol
from inverse_service.integrators.trajectory import Array
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_condition, read_formula
from inverse_service.service.scenes.simulating import simulate
from inverse_service.simulation.array_values import array_value, table_of
from inverse_service.simulation.callables import walls
from inverse_service.web.pages.preview import accelerations_of
from inverse_service.web.pages.scenes import SceneForm, scene_document, scene_form

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
LONGEST_TRIAL = 3.0  # s
MOST_CHOICES = 100  # of velocities that are given
SIDE, MOST_CORNERS = 320, 200  # of a sketch


def with_good_start(
    form: SceneForm, system: Mapping[str, Any], answer: Mapping[str, Any], further: Mapping[str, Any] | None = None
) -> SceneForm:
    """The form with the start that lasts longest, and as many steps as it lasts; `further` is part of its scene.

    On the way the conditions of the domain of the answer's Lagrangian hold, its Hessian stays regular, and no wall of
    the accelerations is passed. With constraints it is the first start from which all methods can begin.
    """
    domain = (answer.get("lagrangian") or {}).get("domain", ())
    form = _with_velocities_that_fit(form, system)
    try:
        scene, found = accelerations_of(scene_document(form, system))
        names = Names(scene.coordinates, tuple(scene.values))
        watched = tuple(read_condition(condition, names) for condition in domain)
        hessian = tuple(read_formula(text, names) for line in answer.get("multiplier") or () for text in line)
    except InputError:
        return form
    if scene.constraints:
        return _where_all_methods_begin(form, system, further or {})
    if found is None:
        return form
    watched += _walls(scene, found)
    q, v = _starts(len(scene.coordinates))
    lasted, evenness, _ = _lasted(scene, (*found, *watched), hessian, q, v, int(form.steps))
    best = int(np.argmax(lasted + evenness))
    if not lasted[best]:
        return form
    steps = int(form.steps) if lasted[best] == int(form.steps) else max(1, int(SHARE * lasted[best]))
    return _as_long_as_it_runs(
        replace(
            form,
            positions=_texts(scene.coordinates, q[best]),
            velocities=_texts(scene.coordinates, v[best]),
            steps=str(steps),
        ),
        system,
    )


def _with_velocities_that_fit(form: SceneForm, system: Mapping[str, Any]) -> SceneForm:
    """The form with the first choice of velocities from which the constraints determine those left empty."""
    if all(form.velocities.values()):
        return form
    names, most = form.coordinates, len(form.coordinates) - 1
    chosen = (given for size in range(most, 0, -1) for given in combinations(names, size))
    choices = (replace(form, velocities={name: "1" if name in given else "" for name in names}) for given in chosen)
    for tried in islice(chain((form,), choices), MOST_CHOICES):
        with suppress(InputError):
            accelerations_of(scene_document(tried, system))
            return tried
    return form


def _where_all_methods_begin(form: SceneForm, system: Mapping[str, Any], further: Mapping[str, Any]) -> SceneForm:
    """The form at the first of some places at which each ticked method begins; as it is where there is none."""
    places = [_texts(form.coordinates, place) for place in _starts(len(form.coordinates))[0]]
    end = now() + LONGEST_TRIAL
    for positions in (form.positions, *places):
        if now() > end:
            break
        tried = replace(form, positions=positions, steps="1")
        methods = simulate({**scene_document(tried, system), **further}, time_limit=LONGEST_TRIAL)["methods"]
        if not {"unavailable", "off_domain"} & {method["outcome"] for method in methods}:
            return replace(form, positions=positions)
    return form


def _as_long_as_it_runs(form: SceneForm, system: Mapping[str, Any]) -> SceneForm:
    """The form with fewer steps where a method ends before the motion does: its steps are tried."""
    methods = simulate(scene_document(form, system), time_limit=LONGEST_TRIAL)["methods"]
    # What a busy machine does not finish says nothing about the motion.
    ended = [m["steps"] for m in methods if m["outcome"] not in ("completed", "unavailable", "cancelled")]
    return replace(form, steps=str(max(1, int(SHARE * min(ended))))) if ended else form


def _walls(scene: Any, accelerations: Sequence[Expression]) -> tuple[Expression, ...]:
    moving: set[Expression] = {Symbol(name) for name in scene.coordinates}
    return tuple(dict.fromkeys(wall for tree in accelerations for wall in walls(tree, moving)))


def _starts(n: int) -> Array:
    """Positions and velocities (2, m, n) of all starts."""
    return np.array([[[part[min(k, len(part) - 1)] for k in range(n)] for part in parts]
                     for parts in zip(*STARTS, strict=True)])  # fmt: skip


@lru_cache(maxsize=256)
def sketch(name: str) -> str | None:
    """A motion of a system of the catalogue as a small SVG without axes; None where it has none.

    The two coordinates that are least proportional to each other, of a single one its velocity over it.
    """
    form = scene_form(catalogue.document(name), "")
    scene, found = accelerations_of(scene_document(form, {"catalogue": name}))
    if found is None:
        return None
    q, v = _starts(len(scene.coordinates))
    lasted, _, motion = _lasted(scene, (*found, *_walls(scene, found)), (), q, v, int(form.steps))
    longest = int(lasted.max())
    starts = [motion[:longest, :, k] for k in np.flatnonzero(lasted == longest)]
    plane = min((_least_alike(start) for start in starts), key=lambda found: found[0])[1]
    return _drawn(plane[:: 1 + longest // MOST_CORNERS]) if longest > 1 else None


def _least_alike(motion: Array) -> tuple[float, Array]:
    """The two columns (m, 2) of a motion (m, 2, n) that are least proportional to each other, and how much they are."""
    columns = motion[:, 0] if motion.shape[2] > 1 else motion[:, :, 0]
    with np.errstate(all="ignore"):
        alike = np.nan_to_num(np.abs(np.corrcoef(columns.T)), nan=1.0)
    pair = sorted(divmod(int(np.argmin(alike)), len(alike)))
    return float(alike.min()), columns[:, pair]


def _drawn(plane: Array) -> str:
    """A line through points (m, 2) in a square; a direction in which nothing happens is not magnified."""
    low, high = plane.min(axis=0), plane.max(axis=0)
    size = high - low
    size = np.where(size > 1e-6 * size.max(), size, size.max() or 1.0)
    corners = SIDE / 2 + 0.9 * SIDE * (plane - (low + high) / 2) / size * (1, -1)
    points = " ".join(f"{round(x)},{round(y)}" for x, y in corners)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIDE} {SIDE}"><polyline fill="none" stroke="#3b82d0" '
        f'stroke-width="8" stroke-linejoin="round" points="{points}"/></svg>'
    )


def _texts(names: Sequence[str], values: Array) -> dict[str, str]:
    return {name: f"{value or 0:g}" for name, value in zip(names, values, strict=True)}


@np.errstate(all="ignore")
def _lasted(
    scene: Any, formulas: Sequence[Expression], hessian: Sequence[Expression], q: Array, v: Array, steps: int
) -> tuple[Array, Array, Array]:
    """For how many steps the classical Runge-Kutta method stays within bounds from each start (m,).

    And how even the determinant of the Hessian is on the way, from 0 to below 1; and the motions (steps, 2, m, n).
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
    motion = []
    for _ in range(steps):
        a = values(q, v)
        alive &= np.isfinite(a).all(1) & (np.abs(a[:, :n]) < LARGEST).all(1) & (np.abs(q) < LARGEST).all(1)
        alive &= (np.abs(a[:, n:]) > floor).all(1) & (np.sign(a[:, n:]) == np.sign(first[:, n:])).all(1)
        if not alive.any():
            break
        least = np.where(alive, np.minimum(least, np.abs(a[:, -1])), least)
        most = np.where(alive, np.maximum(most, np.abs(a[:, -1])), most)
        motion.append((q, v))
        b = values(q + h / 2 * v, v + h / 2 * a[:, :n])
        c = values(q + h / 2 * (v + h / 2 * a[:, :n]), v + h / 2 * b[:, :n])
        d = values(q + h * (v + h / 2 * b[:, :n]), v + h * c[:, :n])
        q = q + h * v + h * h / 6 * (a + b + c)[:, :n]
        v = v + h / 6 * (a + 2 * b + 2 * c + d)[:, :n]
        lasted += alive
    return lasted, np.nan_to_num(0.9 * least / most), np.array(motion)
