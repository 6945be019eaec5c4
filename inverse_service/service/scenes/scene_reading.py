"""A scene document to the scene: values, effects, forces, observables and events, initial data, grid and methods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from api_schemas.scene import SceneDocument, SceneInitial
from inverse_service.errors import InputError
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import Definitions, define_functions, differentiate
from inverse_service.expressions.tree import TIME, ZERO, Expression, Symbol, Velocity, holds, walk
from inverse_service.reading.document_names import Declared
from inverse_service.reading.names import declared_name
from inverse_service.service.documents.plain_data import escape
from inverse_service.service.scenes import scene_system
from inverse_service.service.scenes.scene_initial import read_initial, read_members
from inverse_service.service.scenes.scene_methods import number_of, read_circle, read_grid, read_methods
from inverse_service.simulation.derivation import BUILT_IN, CONSTRAINTS, KINETIC, lagrangian_parts, with_effects
from inverse_service.simulation.scene_data import OBSERVED, Effect, Event, Observable, Scene

MOST_ACTS = 10_000
FORCES, RAYLEIGH = "forces", "rayleigh"
TAKEN = frozenset({"t", "energy", "discrete_energy", "error", "phase_error", "power", "work"})
NO_INITIAL = "The key 'initial' is missing; it must be an object with positions and velocities or momenta."


def _read(text: str, system: scene_system.MechanicalSystem, definitions: Definitions, pointer: str) -> Expression:
    tree = scene_system.without_steps(define_functions(scene_system.formula(text, system.names, pointer), definitions))
    scene_system.refuse_open_functions([tree], system.names)
    return tree


def read_forces(
    schema: SceneDocument, system: scene_system.MechanicalSystem, definitions: Definitions, effects: tuple[str, ...]
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
            found[name] = collect(found.get(name, ZERO) - slope)
    forces = tuple(found.get(name, ZERO) for name in names.coordinates)
    return forces if any(force != ZERO for force in forces) else ()


def read_observables(
    schema: SceneDocument, system: scene_system.MechanicalSystem, definitions: Definitions
) -> tuple[Observable, ...]:
    """The observables that the scene gives by formula, in its order; their names are columns of their own."""
    found: dict[str, Observable] = {}
    taken = _columns(system.names.coordinates).union(system.names.coordinates)
    for place, item in enumerate(schema.observe):
        for name, text in item.items() if isinstance(item, dict) else ():
            pointer = f"/observe/{place}/{escape(name)}"
            if name in taken or name in found:
                raise InputError("this name is taken by another column: give the observable another.", pointer)
            found[name] = Observable(name, _read(text, system, definitions, pointer))
    for body, texts in schema.points.items():
        for axis, text in zip("xy", texts, strict=True):
            pointer = f"/points/{escape(body)}/{'xy'.index(axis)}"
            found[f"{body}_{axis}"] = Observable(f"{body}_{axis}", _read(text, system, definitions, pointer))
    return tuple(found.values())


def _columns(coordinates: Sequence[str]) -> frozenset[str]:
    """The names of the columns that a table may have besides the coordinates and the observables by formula."""
    return TAKEN.union(f"{kind}_{name}" for kind in ("v", "p", "discrete_v") for name in coordinates)


def read_events(
    schema: SceneDocument, system: scene_system.MechanicalSystem, definitions: Definitions
) -> tuple[Event, ...]:
    """The events of a scene; `when` may be an equation with 0 on its right."""
    found = []
    for place, event in enumerate(schema.events):
        pointer = f"/events/{place}/when"
        left, equals, right = event.when.partition("=")
        if equals and right.strip() not in ("0", "0.0"):
            raise InputError('write the event as a formula, or as "formula = 0".', pointer)
        formula = _read(left, system, definitions, pointer)
        sets: tuple[tuple[Expression, Expression], ...] = ()
        if not isinstance(event.do, str):
            sets = tuple(_set(key, text, system, definitions, place) for key, text in event.do.set.items())
        stops = event.do == "stop" or (event.do == "record" and event.count is not None)
        found.append(Event(formula, event.direction, stops, sets, event.count or (MOST_ACTS if sets else 1)))
    return tuple(found)


def _set(
    key: str, text: str, system: scene_system.MechanicalSystem, definitions: Definitions, place: int
) -> tuple[Expression, Expression]:
    """A coordinate or velocity and the formula of its new value."""
    pointer = f"/events/{place}/do/set/{escape(key)}"
    target, names = scene_system.formula(key, system.names, pointer), system.names.coordinates
    if target not in (*map(Symbol, names), *map(Velocity, names)):
        raise InputError(f"an event sets coordinates and velocities: {', '.join(names)}, {names[0]}'.", pointer)
    return target, _read(text, system, definitions, pointer)


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
    try:
        positions, velocities = (
            {name: repr(float(x)) for name, x in final[key].items()} for key in ("positions", "velocities")
        )
        begin = number_of(repr(float(final["t"])), "/restart")
        return begin, SceneInitial(positions=positions, velocities=velocities, project=True)
    except (AttributeError, TypeError, ValueError):
        raise InputError("this result has no last point: give the result of simulate.", "/restart") from None


def _final(result: dict[str, Any]) -> dict[str, Any]:
    """The last point of the first method that has one."""
    methods = result.get("methods")
    for method in methods if isinstance(methods, list) else []:
        final = method.get("final") if isinstance(method, dict) else None
        if isinstance(final, dict) and {"t", "positions", "velocities"} <= final.keys() and final["velocities"]:
            return final
    raise InputError("no method of this result has a last point with velocities: give the result of simulate.",
                     "/restart")  # fmt: skip


Constraints = tuple[Expression, ...]
TIME_REFUSED = (
    "constraints that depend on the time t are not simulated: write a further coordinate for t, with kinetic energy of "
    "its own, and start it at 0 with velocity 1."
)


def _refuse_other_halves(initial: SceneInitial, system: scene_system.MechanicalSystem) -> None:
    """InputError for a start of p in first-order equations x' = h, p' = F, of which x alone is a coordinate."""
    equations, known = str((system.document or {}).get("equations")), ", ".join(system.names.coordinates)
    for part in ("positions", "velocities", "momenta"):
        for name in getattr(initial, part) or {}:
            if name not in system.names.coordinates and f"{name}'" in equations:
                raise InputError(
                    f"of these first-order equations only {known} has a position, and the rest is its velocity: "
                    f"leave '{escape(name)}' out, and give positions and velocities of {known}.",
                    f"/initial/{part}/{escape(name)}",
                )


def read_scene(schema: SceneDocument) -> tuple[Scene, scene_system.MechanicalSystem]:
    """The scene and its system; InputError with the pointer of what is wrong."""
    extra = [declared_name(name, f"/parameters/{escape(name)}", "parameter") for name in schema.parameters]
    system = scene_system.mechanical_system(schema.system, extra)
    _refuse_unknown(system, extra, _has_formulas(schema))
    names = system.names
    if taken := _columns(names.coordinates).intersection(names.coordinates):
        raise InputError(f"the motion has another column {min(taken)}: give the coordinate another name.", "/system")
    values = _values(schema, system)
    definitions = scene_system.read_definitions(schema.functions, names)
    lagrangian, constraints, forces, effects, parts = _with_effects(schema, system, definitions)
    accelerations = system.accelerations and tuple(define_functions(tree, definitions) for tree in system.accelerations)
    formulas = [tree for tree in (lagrangian, *constraints, *(accelerations or ())) if tree is not None]
    scene_system.refuse_open_functions(formulas, names)
    if any(holds(tree, TIME) for tree in constraints):
        raise InputError(TIME_REFUSED, "/system")
    begin, initial = beginning(schema)
    _refuse_other_halves(initial, system)
    positions, velocities = read_initial(initial, names, lagrangian, constraints, values)
    grid, notes = read_grid(schema, begin)
    scene = Scene(
        name=schema.name or system.name,
        coordinates=names.coordinates,
        values=values,
        lagrangian=lagrangian,
        constraints=constraints,
        accelerations=accelerations or None,
        effects=effects,
        positions=positions,
        velocities=velocities,
        grid=grid,
        methods=read_methods(schema),
        observe=tuple(name for name in OBSERVED if name in schema.observe),
        circle=read_circle(schema, names),
        notes=notes,
        parts=parts,
        forces=forces,
        own=read_observables(schema, system, definitions),
        events=read_events(schema, system, definitions),
        bodies={body: (f"{body}_x", f"{body}_y") for body in schema.points},
        units={names.spelling(name): unit for name, unit in schema.units.items()},
    )
    if schema.ensemble is not None:
        scene = replace(scene, ensemble=read_members(schema.ensemble, initial, names, scene))
    return scene, replace(system, definitions=definitions)


def _has_formulas(schema: SceneDocument) -> bool:
    """Whether the scene has formulas beyond those of its system, which may use parameters that the system has not."""
    own = (
        schema.terms,
        schema.functions,
        schema.free_lagrangian,
        schema.forces,
        schema.rayleigh,
        schema.events,
        schema.points,
    )
    return any(own) or any(isinstance(item, dict) for item in schema.observe) or _method_lagrangians(schema)


def _refuse_unknown(system: scene_system.MechanicalSystem, extra: Sequence[str], formulas: bool) -> None:
    """A parameter of the scene that its system neither declares nor uses, nor further formulas may."""
    parameters, trees = system.names.parameters, (system.lagrangian, *system.constraints, *(system.accelerations or ()))
    known = {node.name for tree in trees if tree is not None for node in walk(tree) if isinstance(node, Symbol)}
    known |= set(Declared(parameters=(system.document or {}).get("parameters", ())).named_parameters())
    known = set(parameters) & (set(parameters) if formulas else set(map(system.names.spelling, known)))
    for name in extra:
        if system.names.spelling(name) not in known:
            names = ", ".join(name for name in parameters if name in known) or "none"
            detail = f"the system has no parameter '{name}': its parameters are {names}."
            raise InputError(detail, f"/parameters/{escape(name)}")


def _method_lagrangians(schema: SceneDocument) -> bool:
    return any(method.free_lagrangian for method in schema.methods)


def _values(schema: SceneDocument, system: scene_system.MechanicalSystem) -> dict[str, float]:
    names = system.names
    texts = dict(system.values)
    for given, text in schema.parameters.items():
        name = names.spelling(declared_name(given, f"/parameters/{escape(given)}", "parameter"))
        texts[name] = text
    missing = [name for name in names.parameters if name not in texts]
    if missing:
        raise InputError(f"the parameters {', '.join(missing)} have no value: add them to 'parameters'.", "/parameters")
    return {name: number_of(texts[name], f"/parameters/{name}") for name in names.parameters}


DISSIPATION = frozenset({"friction", "drag", "damping", "dissipation"})


def _refuse_dissipation(schema: SceneDocument) -> None:
    """A term of L dissipates nothing: one called friction would change masses instead."""
    for name in schema.terms:
        if name.casefold() in DISSIPATION and not schema.as_lagrangian:
            detail = (
                f"a term of L called '{name}' dissipates no energy, it changes the masses: write the force in "
                """"forces", as in {"x": "-c*x'"}, or "rayleigh": "c*x'^2/2"; or set "as_lagrangian": true."""
            )
            raise InputError(detail, f"/terms/{escape(name)}")


def _with_effects(
    schema: SceneDocument, system: scene_system.MechanicalSystem, definitions: Definitions
) -> tuple[Expression | None, Constraints, Constraints, tuple[str, ...], tuple[Effect, ...]]:
    """L with the effects named, the constraints and forces that act, all names in effect, and each effect that the
    system has turned round."""
    _refuse_dissipation(schema)
    texts = {
        name: scene_system.formula(text, system.names, f"/terms/{escape(name)}") for name, text in schema.terms.items()
    }
    terms = {name: define_functions(tree, definitions) for name, tree in texts.items()}
    further = [name for name, given in ((FORCES, schema.forces), (RAYLEIGH, schema.rayleigh)) if given]
    known = (*BUILT_IN, *terms, *further)
    named = tuple(dict.fromkeys(schema.effects if schema.effects is not None else known))
    for place, name in enumerate(named):
        if name not in known:
            detail = f"'{escape(name)}' is no effect of this scene: use {', '.join(known)}."
            raise InputError(detail, f"/effects/{place}")
    if system.lagrangian is None:
        if terms or further or schema.effects is not None:
            pointer = "/terms" if terms else f"/{further[0]}" if further else "/effects"
            detail = "effects, terms and forces need a Lagrangian, and this system has equations: leave them out."
            raise InputError(detail, pointer)
        return None, (), (), (), ()
    whole = define_functions(system.lagrangian, definitions)
    parts = lagrangian_parts(whole, system.names.coordinates)
    given = tuple(define_functions(w, definitions) for w in system.constraints)

    def acting(names: Sequence[str]) -> tuple[Expression, Constraints, Constraints]:
        forces = read_forces(schema, system, definitions, tuple(names))
        return with_effects(parts, terms, names), given if CONSTRAINTS in names else (), forces

    whole_scene = acting(named)
    found = []
    for name in known:
        other = [one for one in named if one != name] if name in named else [*named, name]
        if name != KINETIC and (turned := acting(other)) != whole_scene:
            found.append(Effect(name, name in named, *turned))
    return *whole_scene, named, tuple(found)
