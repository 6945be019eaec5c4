"""A start from which a system can be run: the first of some that stays where its formulas have values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, combinations, islice
from typing import Any

import numpy as np

from inverse_service.deadline import now
from inverse_service.errors import InputError
from inverse_service.expressions.tree import Expression, Symbol
from inverse_service.integrators.trajectory import Array
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_condition, read_formula
from inverse_service.service.scenes.simulating import simulate
from inverse_service.simulation.numeric_formulas import array_value, table_of, walls
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
LONGEST_TRIAL = 3.0  # s
MOST_CHOICES = 100  # of velocities that are given


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
    q, v = every_start(len(scene.coordinates))
    steps_lasted, evenness, _ = lasted(scene, (*found, *watched), hessian, q, v, int(form.steps))
    best = int(np.argmax(steps_lasted + evenness))
    if not steps_lasted[best]:
        return form
    whole = steps_lasted[best] == int(form.steps)
    steps = int(form.steps) if whole else max(1, int(SHARE * steps_lasted[best]))
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
    places = [_texts(form.coordinates, place) for place in every_start(len(form.coordinates))[0]]
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


def every_start(n: int) -> Array:
    """Positions and velocities (2, m, n) of all starts."""
    return np.array([[[part[min(k, len(part) - 1)] for k in range(n)] for part in parts]
                     for parts in zip(*STARTS, strict=True)])  # fmt: skip


def _texts(names: Sequence[str], values: Array) -> dict[str, str]:
    return {name: f"{value or 0:g}" for name, value in zip(names, values, strict=True)}


@np.errstate(all="ignore")
def lasted(
    scene: Any, formulas: Sequence[Expression], hessian: Sequence[Expression], q: Array, v: Array, steps: int
) -> tuple[Array, Array, Array]:
    """For how many steps the classical Runge-Kutta method stays within bounds from each start (m,).

    And how even the determinant of the Hessian is on the way, from 0 to below 1; and the motions (steps, 2, m, n).
    """
    n, h = len(scene.coordinates), float(scene.grid.step)

    def values(q: Array, v: Array) -> Array:
        table = table_of(scene.coordinates, q, v, scene.values)
        columns = [np.broadcast_to(array_value(formula, table), len(q)) for formula in (*formulas, *hessian)]
        matrices = np.stack(columns[len(formulas) :], axis=1).reshape(-1, n, n) if hessian else np.ones((len(q), 1, 1))
        return np.stack([*columns[: len(formulas)], np.linalg.det(matrices)], axis=1)

    found, alive, first = np.zeros(len(q)), np.ones(len(q), dtype=bool), values(q, v)
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
        found += alive
    return found, np.nan_to_num(0.9 * least / most), np.array(motion)
