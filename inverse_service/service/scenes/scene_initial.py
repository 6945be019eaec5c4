"""Initial data of a scene on its constraints, and the members of an ensemble: starts and values of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np

from api_schemas.scene import MemberColumns, SceneEnsemble, SceneInitial
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.tree import Expression
from inverse_service.integrators.trajectory import Array
from inverse_service.reading.names import Names
from inverse_service.service.documents.plain_data import escape
from inverse_service.service.scenes.scene_methods import number_of
from inverse_service.simulation.initial import check_constraints, initial_velocities, velocities_from_momenta
from inverse_service.simulation.scene_data import Members, Scene


def read_initial(
    given: SceneInitial,
    names: Names,
    lagrangian: Expression | None,
    constraints: tuple[Expression, ...],
    values: Mapping[str, float],
) -> tuple[Array, Array]:
    """Positions and velocities, (n,) each, the velocities on the constraints."""
    start = _of_all(given.positions, names, "position", "/initial/positions")
    if (given.velocities is None) == (given.momenta is None):
        raise InputError("give either 'velocities' or 'momenta' with the positions.", "/initial")
    if given.momenta is not None:
        speeds = _from_momenta(given.momenta, names, lagrangian, values, start)
    else:
        speeds = _by_coordinate(given.velocities or {}, names, "/initial/velocities")
    check_constraints(names.coordinates, constraints, values, start)
    velocities = initial_velocities(names.coordinates, constraints, lagrangian, values, start, speeds, given.project)
    return start, velocities


def _from_momenta(
    given: Mapping[str, str],
    names: Names,
    lagrangian: Expression | None,
    values: Mapping[str, float],
    start: Array,
) -> dict[str, float]:
    target = _of_all(given, names, "momentum", "/initial/momenta")
    if lagrangian is None:
        raise InputError("the system has no Lagrangian, so no momenta: give velocities.", "/initial/momenta")
    velocities = velocities_from_momenta(names.coordinates, lagrangian, values, start, target)
    return dict(zip(names.coordinates, map(float, velocities), strict=True))


def _of_all(given: Mapping[str, str], names: Names, what: str, pointer: str) -> Array:
    found = _by_coordinate(given, names, pointer)
    missing = ", ".join(name for name in names.coordinates if name not in found)
    if missing:
        raise InputError(f"the initial {what} of {missing} is missing: add it.", pointer)
    return np.array([found[name] for name in names.coordinates])


def _by_coordinate(given: Mapping[str, str], names: Names, pointer: str) -> dict[str, float]:
    found = {}
    for key, text in given.items():
        place = f"{pointer}/{escape(key)}"
        name = names.spelling(key.removeprefix("p_") if pointer.endswith("momenta") else key)
        if name not in names.coordinates:
            known = ", ".join(names.coordinates)
            raise InputError(f"'{escape(key)}' is not a coordinate: the coordinates are {known}.", place)
        found[name] = number_of(text, place)
    return found


MOST_NUMBERS = 40_000_000
TOO_LARGE = "the ensemble is too large: the limit is {} numbers; take fewer members or a larger record_every."
OBSERVED = ("trajectory", "velocities", "energy")


def read_members(given: SceneEnsemble, base: SceneInitial, names: Names, scene: Scene) -> Members:
    """Starts times combinations of parameters, the parameters running fastest; each start on the constraints."""
    unseen = [name for name in scene.observe if name not in OBSERVED]
    if scene.events or unseen:
        what = f"'{unseen[0]}' is" if unseen else "events are"
        raise InputError(f"{what} observed in single runs: an ensemble has {', '.join(OBSERVED)} and formulas.",
                         "/events" if scene.events else "/observe")  # fmt: skip
    axes = {}
    for key, texts in given.parameters.items():
        name, pointer = names.spelling(key), f"/ensemble/parameters/{escape(key)}"
        if name not in scene.values:
            known = ", ".join(scene.values) or "none"
            raise InputError(f"the system has no parameter '{escape(key)}': its parameters are {known}.", pointer)
        axes[name] = [number_of(text, f"{pointer}/{k}") for k, text in enumerate(texts)]
    grid = list(product(*axes.values()))
    starts = [base] if given.initial is None else given.initial
    count = len(starts) if isinstance(starts, list) else len(next(iter(_columns(starts)), ()))
    rows = scene.grid.steps // scene.grid.record_every + 2
    if 2.0 * count * len(grid) * rows * len(names.coordinates) > MOST_NUMBERS:
        raise LimitError(TOO_LARGE.format(MOST_NUMBERS), "/ensemble")
    values = {name: np.tile([row[k] for row in grid], count) for k, name in enumerate(axes)}
    try:
        if isinstance(given.initial, list) or base.momenta is not None:
            return _one_by_one(starts, base, names, scene, values)
        return _together(given.initial, base, names, scene, values)
    except InputError as error:
        raise error.placed(error.pointer.replace("/initial", "/ensemble/initial", 1)) from None


def _columns(given: MemberColumns) -> list[list[str]]:
    return [*given.positions.values(), *given.velocities.values()]


def _one_by_one(
    starts: list[SceneInitial] | MemberColumns, base: SceneInitial, names: Names, scene: Scene, values: dict[str, Array]
) -> Members:
    """Each start with each value of the parameters, on which momenta and constraints may depend."""
    if isinstance(starts, MemberColumns):
        raise InputError("columns of starts need velocities: give these in the scene in the place of momenta.",
                         "/initial")  # fmt: skip
    found, each = [], len(next(iter(values.values()), starts)) // len(starts)
    for place, one in enumerate(starts):
        velocities = one.velocities if one.velocities is not None or one.momenta is not None else base.velocities
        momenta = one.momenta if one.velocities is not None or one.momenta is not None else base.momenta
        changed = {"positions": base.positions | one.positions, "velocities": velocities, "momenta": momenta}
        merged = one.model_copy(update=changed)
        for member in range(place * each, (place + 1) * each):
            own = {**scene.values, **{name: float(column[member]) for name, column in values.items()}}
            try:
                found.append(read_initial(merged, names, scene.lagrangian, scene.constraints, own))
            except InputError as error:
                raise error.placed(error.pointer.replace("/initial", f"/initial/{place}", 1)) from None
    return Members(np.array([q for q, _ in found]), np.array([v for _, v in found]), values)


def _together(
    given: MemberColumns | None, base: SceneInitial, names: Names, scene: Scene, values: dict[str, Array]
) -> Members:
    """Columns, each start repeated for the values of the parameters; velocities left out are filled in."""
    tables, free = [scene.positions[None], scene.velocities[None]], set(base.velocities or {})
    if given is not None:
        if len({len(column) for column in _columns(given)}) != 1:
            raise InputError("the columns of an ensemble must have the same length.", "/initial")
        for k, what in enumerate(("positions", "velocities")):
            tables[k] = np.tile(tables[k], (len(_columns(given)[0]), 1))
            for key, texts in getattr(given, what).items():
                pointer, name = f"/initial/{what}/{escape(key)}", names.spelling(key)
                if name not in names.coordinates:
                    raise InputError(f"the coordinates are {', '.join(names.coordinates)}.", pointer)
                column = [number_of(text, f"{pointer}/{row}") for row, text in enumerate(texts)]
                tables[k][:, names.coordinates.index(name)] = column
        free |= {names.spelling(name) for name in given.velocities}
    each = len(next(iter(values.values()), tables[0])) // len(tables[0])
    positions, velocities = (np.repeat(table, each, axis=0) for table in tables)
    if scene.constraints:
        speeds: dict[str, float | Array] = {
            name: velocities[:, k] for k, name in enumerate(names.coordinates) if name in free
        }
        numbers: dict[str, float | Array] = {**scene.values, **values}
        velocities = initial_velocities(
            names.coordinates, scene.constraints, scene.lagrangian, numbers, positions, speeds, base.project
        )
    return Members(positions, velocities, values)
