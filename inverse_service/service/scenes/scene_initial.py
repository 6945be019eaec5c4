"""Initial data of a scene on its constraints, and the members of an ensemble: starts and values of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np

from api_schemas.scene import MemberColumns, SceneEnsemble, SceneInitial
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.names import Names
from inverse_service.expressions.tree import Expression
from inverse_service.integrators.trajectory import Array
from inverse_service.service.documents.reading import escape
from inverse_service.service.scenes.scene_methods import number_of
from inverse_service.simulation.initial import check_constraints, initial_velocities, velocities_from_momenta
from inverse_service.simulation.scene import Members, Scene


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


MOST_NUMBERS = 40_000_000
TOO_LARGE = "the ensemble is too large: the limit is {} numbers; take fewer members or a larger record_every."
MOST_CONSTRAINED = 20_000
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
    positions, velocities = _starts(given, base, names, scene)
    rows = scene.grid.steps // scene.grid.record_every + 2
    if 2.0 * len(positions) * len(grid) * rows * len(names.coordinates) > MOST_NUMBERS:
        raise LimitError(TOO_LARGE.format(MOST_NUMBERS), "/ensemble")
    values = {name: np.tile([row[k] for row in grid], len(positions)) for k, name in enumerate(axes)}
    return Members(np.repeat(positions, len(grid), axis=0), np.repeat(velocities, len(grid), axis=0), values)


def _starts(given: SceneEnsemble, base: SceneInitial, names: Names, scene: Scene) -> tuple[Array, Array]:
    """(N, n) positions and velocities, before the parameters are varied."""
    if given.initial is None:
        return scene.positions[None], scene.velocities[None]
    if isinstance(given.initial, MemberColumns):
        return _by_columns(given.initial, base, names, scene)
    found = []
    for place, one in enumerate(given.initial):
        merged = one.model_copy(update={"positions": base.positions | one.positions})
        try:
            found.append(read_initial(merged, names, scene.lagrangian, scene.constraints, scene.values))
        except InputError as error:
            raise type(error)(
                error.detail, f"/ensemble/initial/{place}" + error.pointer.removeprefix("/initial")
            ) from None
    return np.array([q for q, _ in found]), np.array([v for _, v in found])


def _by_columns(given: MemberColumns, base: SceneInitial, names: Names, scene: Scene) -> tuple[Array, Array]:
    tables, lengths = [], set()
    for what, start in (("positions", scene.positions), ("velocities", scene.velocities)):
        columns: dict[int, list[float]] = {}
        for key, texts in getattr(given, what).items():
            pointer, name = f"/ensemble/initial/{what}/{escape(key)}", names.spelling(key)
            if name not in names.coordinates:
                raise InputError(f"the coordinates are {', '.join(names.coordinates)}.", pointer)
            columns[names.coordinates.index(name)] = [number_of(text, f"{pointer}/{k}") for k, text in enumerate(texts)]
        lengths |= {len(column) for column in columns.values()}
        tables.append((start, columns))
    if len(lengths) != 1:
        raise InputError("the columns of an ensemble have one length.", "/ensemble/initial")
    (count,) = lengths
    rows = []
    for start, columns in tables:
        table = np.tile(start, (count, 1))
        for k, column in columns.items():
            table[:, k] = column
        rows.append(table)
    return (rows[0], rows[1]) if not scene.constraints else _on_constraints(rows[0], rows[1], base, names, scene)


def _on_constraints(
    positions: Array, velocities: Array, base: SceneInitial, names: Names, scene: Scene
) -> tuple[Array, Array]:
    """Each start put on the constraints, the velocities left out in the scene filled in."""
    if len(positions) > MOST_CONSTRAINED:
        raise InputError(f"at most {MOST_CONSTRAINED} starts are put on constraints.", "/ensemble/initial")
    free = set(base.velocities or {}) or set(names.coordinates)
    found = []
    for q, v in zip(positions, velocities, strict=True):
        texts = ({name: repr(float(x)) for name, x in zip(names.coordinates, row, strict=True)} for row in (q, v))
        places, rates = texts
        one = SceneInitial(
            positions=places, velocities={k: x for k, x in rates.items() if k in free}, project=base.project
        )
        found.append(read_initial(one, names, scene.lagrangian, scene.constraints, scene.values))
    return np.array([q for q, _ in found]), np.array([v for _, v in found])
