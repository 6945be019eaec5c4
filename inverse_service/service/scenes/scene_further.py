"""What a scene adds to its system: forces, observables and events by formula, and where it begins."""

from __future__ import annotations

from typing import Any

from api_schemas.scene import SceneDocument, SceneInitial
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import ZERO, Expression, Velocity, add, negate
from inverse_service.service.documents.reading import escape
from inverse_service.service.scenes.scene_formulas import Definitions, defined, refuse_open_functions
from inverse_service.service.scenes.scene_numbers import number_of
from inverse_service.service.scenes.scene_system import MechanicalSystem, formula
from inverse_service.simulation.choices import Observable
from inverse_service.simulation.scene import Event

FORCES, RAYLEIGH = "forces", "rayleigh"
TAKEN = frozenset({"t", "energy", "discrete_energy", "error", "phase_error", "power", "work"})
NO_INITIAL = "The key 'initial' is missing; it must be an object with positions and velocities or momenta."


def _read(text: str, system: MechanicalSystem, definitions: Definitions, pointer: str) -> Expression:
    tree = defined(formula(text, system.names, pointer), definitions)
    refuse_open_functions([tree], system.names)
    return tree


def read_forces(
    schema: SceneDocument, system: MechanicalSystem, definitions: Definitions, effects: tuple[str, ...]
) -> tuple[Expression, ...]:
    """Q_i = forces_i - dR/dq_i' of those that are in effect, (n,); empty where nothing acts."""
    names = system.names
    found: dict[str, Expression] = {}
    for key, text in schema.forces.items() if FORCES in effects else ():
        pointer, name = f"/forces/{escape(key)}", names.spelling(key)
        if name not in names.coordinates:
            known = ", ".join(names.coordinates)
            raise InputError(f"a force acts on a coordinate: the coordinates are {known}.", pointer)
        found[name] = _read(text, system, definitions, pointer)
    if schema.rayleigh is not None and RAYLEIGH in effects:
        function = _read(schema.rayleigh, system, definitions, "/rayleigh")
        for name in names.coordinates:
            slope = differentiate(function, Velocity(name))
            found[name] = collect(add(found.get(name, ZERO), negate(slope)))
    forces = tuple(found.get(name, ZERO) for name in names.coordinates)
    return forces if any(force != ZERO for force in forces) else ()


def read_observables(
    schema: SceneDocument, system: MechanicalSystem, definitions: Definitions
) -> tuple[Observable, ...]:
    """The observables that the scene gives by formula, in its order; their names are columns of their own."""
    found: dict[str, Observable] = {}
    for place, item in enumerate(schema.observe):
        for name, text in item.items() if isinstance(item, dict) else ():
            pointer = f"/observe/{place}/{escape(name)}"
            if name in TAKEN or name in found or name in system.names.coordinates:
                raise InputError("this name is taken by another column: give the observable another.", pointer)
            found[name] = Observable(name, _read(text, system, definitions, pointer))
    return tuple(found.values())


def read_events(schema: SceneDocument, system: MechanicalSystem, definitions: Definitions) -> tuple[Event, ...]:
    """The events of a scene; `when` may be an equation with 0 on its right."""
    found = []
    for place, event in enumerate(schema.events):
        pointer = f"/events/{place}/when"
        left, equals, right = event.when.partition("=")
        if equals and right.strip() not in ("0", "0.0"):
            raise InputError('write the event as a formula, or as "formula = 0".', pointer)
        found.append(Event(_read(left, system, definitions, pointer), event.direction, event.do == "stop"))
    return tuple(found)


def beginning(schema: SceneDocument) -> tuple[float, SceneInitial]:
    """The time at which the scene begins, and its initial data: its own, or the end of the result it restarts from."""
    if schema.restart is None:
        if schema.initial is None:
            raise InputError(NO_INITIAL, "/initial")
        begin = 0.0 if schema.start_time is None else number_of(schema.start_time, "/start_time")
        return begin, schema.initial
    if schema.initial is not None or schema.start_time is not None:
        raise InputError("a scene that restarts begins where the result ended: leave initial and start_time out.",
                         "/restart")  # fmt: skip
    final = _final(schema.restart)
    positions, velocities = (
        {name: repr(float(x)) for name, x in final[key].items()} for key in ("positions", "velocities")
    )
    return float(final["t"]), SceneInitial(positions=positions, velocities=velocities, project=True)


def _final(result: dict[str, Any]) -> dict[str, Any]:
    """The last point of the first method that has one."""
    methods = result.get("methods")
    for method in methods if isinstance(methods, list) else []:
        final = method.get("final") if isinstance(method, dict) else None
        if isinstance(final, dict) and {"t", "positions", "velocities"} <= final.keys() and final["velocities"]:
            return final
    raise InputError("no method of this result has a last point with velocities: give the result of simulate.",
                     "/restart")  # fmt: skip


def check_size(numbers: float, most: int, what: str) -> None:
    """LimitError where an ensemble would hold more than `most` numbers."""
    if numbers > most:
        raise LimitError(
            f"{what}: the limit is {most} numbers; take fewer members or a larger record_every.", "/ensemble"
        )
