"""Initial data of a scene: by coordinate, from velocities or momenta, on the constraints."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from api_schemas.scene import SceneInitial
from inverse_service.errors import InputError
from inverse_service.expressions.names import Names
from inverse_service.expressions.tree import Expression
from inverse_service.service.documents.reading import escape
from inverse_service.service.scenes.scene_numbers import number_of
from inverse_service.simulation.initial import check_constraints, initial_velocities, velocities_from_momenta

Array = NDArray[np.float64]


def read_initial(
    given: SceneInitial,
    names: Names,
    lagrangian: Expression | None,
    constraints: tuple[Expression, ...],
    values: Mapping[str, float],
) -> tuple[Array, Array]:
    """Positions and velocities, (n,) each, the velocities on the constraints."""
    positions = _by_coordinate(given.positions, names, "/initial/positions")
    missing = [name for name in names.coordinates if name not in positions]
    if missing:
        raise InputError(f"the initial position of {', '.join(missing)} is missing: add it.", "/initial/positions")
    start = np.array([positions[name] for name in names.coordinates])
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
    momenta = _by_coordinate(given, names, "/initial/momenta")
    missing = [name for name in names.coordinates if name not in momenta]
    if missing:
        raise InputError(f"the initial momentum of {', '.join(missing)} is missing: add it.", "/initial/momenta")
    if lagrangian is None:
        raise InputError("the system has no Lagrangian, so no momenta: give velocities.", "/initial/momenta")
    target = np.array([momenta[name] for name in names.coordinates])
    velocities = velocities_from_momenta(names.coordinates, lagrangian, values, start, target)
    return dict(zip(names.coordinates, map(float, velocities), strict=True))


def _by_coordinate(given: Mapping[str, str], names: Names, pointer: str) -> dict[str, float]:
    found = {}
    for key, text in given.items():
        place = f"{pointer}/{escape(key)}"
        name = names.spelling(key.removeprefix("p_") if pointer.endswith("momenta") else key)
        if name not in names.coordinates:
            known = ", ".join(names.coordinates)
            raise InputError(f"'{escape(key)}' is no coordinate: the coordinates are {known}.", place)
        found[name] = number_of(text, place)
    return found
