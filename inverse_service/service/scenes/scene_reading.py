"""Translate scene documents, in this order: the system, from the catalogue, a document or a result,
with symbolic parameters and formulas in the place of its functions; effects, forces, observables
and events; the whole scene; the grid of times, methods with their settings and labels, initial data
on the constraints, and the members of an ensemble.

Each error is one sentence with its location.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np

from api_schemas import base, scene as schemas
from api_schemas.system import TAGS
from inverse_service import catalogue
from inverse_service.errors import DocumentRefused, InputError, LimitError
from inverse_service.expressions import (
    arrays,
    calculus,
    collecting,
    functions,
    refusals,
    tree as ex,
)
from inverse_service.integrators.method_table import GEOMETRIC, METHODS, OWN_STEPS, RUNGE_KUTTA
from inverse_service.integrators.trajectory import Array
from inverse_service.reading import names as nm, reader
from inverse_service.reading.declarations import AND_GUESS, Declared
from inverse_service.reading.document_names import document_names, known_names
from inverse_service.service.documents import accepting
from inverse_service.service.documents.plain_data import escape
from inverse_service.simulation import derivation, numeric_formulas, observing, scene_data as data
from inverse_service.simulation.initial import (
    System,
    check_constraints,
    initial_velocities,
    velocities_from_momenta,
)

LAGRANGIAN_KEYS = "name, coordinates, lagrangian, constraints, parameters, functions, where, time"
# Keys of a nonholonomic document that are options of `solve` and do not affect the motion.
SOLVE_ONLY = frozenset({
    "multiples", "search", "special_cases", "family", "first_integrals", "time_dependent_lagrangian", "ansatz",
    "series_order", "question", "id",
})  # fmt: skip
SYSTEM_WORDING = accepting.Wording(
    "The system",
    accepting.EXPECTED,
    lambda _, where: (
        f"The key {where} is not known here; a system with a Lagrangian has the keys {LAGRANGIAN_KEYS}."
    ),
    lambda steps: tuple(
        step for step in steps if step not in ("dict", "list") and not str(step).endswith("]")
    ),
)
HIDDEN = frozenset({*TAGS, "[key]", "quantity", "formulas", "columns", "list"})
MOST_ACTS = 10_000
SHORT_PARTS = 3  # times more of them in a formula: `x12 - x34` has a part for each second character
FORCES, RAYLEIGH = "forces", "rayleigh"
TABLE = tomllib.loads((Path(__file__).parent / "wording.toml").read_text(encoding="utf-8"))
FILLED = {
    "methods": ", ".join(get_args(schemas.MethodName)), "quantities": ", ".join(get_args(schemas.Observed)),
    "orders": ", ".join(map(str, RUNGE_KUTTA)), "most steps": schemas.MAX_STEPS, "most methods": schemas.MAX_METHODS,
}  # fmt: skip
Constraints = tuple[ex.Expression, ...]
POSITIVE = 5e-324  # the smallest positive number
PENETRATION = 1e-12  # of the size of the positions, by round-off
DISSIPATION = frozenset({"friction", "drag", "damping", "dissipation"})
MOST_RECORDED = 100_000
MOST_STATES = 20_000_000  # numbers: 160 MB
MOST_WITH_EVENTS = 2_000_000
_DECIMAL = re.compile(r"[-+]?[0-9]{1,40}(\.[0-9]{0,40})?([eE][-+]?[0-9]{1,3})?")
INSIDE = {"runge-kutta": "runge_kutta", "stormer-verlet": "variational"}
MOST_NUMBERS = 40_000_000
PARTS = ("positions", "velocities", "momenta")  # of the initial data
OF_MEMBERS = ("trajectory", "velocities", "energy")


def refusal(
    key: str, pointer: str, kind: type[InputError] = InputError, **words: object
) -> InputError:
    """The error of this key in `wording.toml`, with its words, at a place of the scene."""
    return kind(TABLE["refused"][key].format(**words), pointer)


def read_definitions(given: Mapping[str, str], names: nm.Names) -> calculus.Definitions:
    """The formula of each function over its own arguments; InputError with the pointer below
    /functions.
    """
    found = {}
    for key, text in given.items():
        pointer = f"/functions/{key}"
        name = names.spelling(key)
        if name not in names.functions:
            known = ", ".join(names.functions) or "none"
            raise refusal("no_function", pointer, name=key[:40], known=known)
        arguments = names.functions[name]
        with reader.placed_at(pointer):
            tree = reader.read_formula(text, nm.Names(names.coordinates, names.parameters))
        words = {word: of[0] for word in arguments if (of := names.derivative(word))}
        tree = ex.substitute(
            tree, {ex.Velocity(name): ex.Symbol(word) for word, name in words.items()}
        )
        others = (ex.Symbol(other) for other in names.coordinates if other not in arguments)
        if ex.holds(tree, *others, *map(ex.Velocity, names.coordinates)):
            raise refusal("other_arguments", pointer, name=name, arguments=", ".join(arguments))
        found[name] = (arguments, tree)
    return found


def refuse_open_functions(formulas: Sequence[ex.Expression], names: nm.Names) -> None:
    """InputError if a formula contains an arbitrary function for which the scene gives no
    formula.
    """
    missing = sorted(
        {node.name for tree in formulas for node in ex.walk(tree) if isinstance(node, ex.Arbitrary)}
    )
    if missing:
        first, argument = missing[0], names.functions[missing[0]][0]
        raise refusal(
            "open_functions",
            "/functions",
            missing=", ".join(missing),
            first=first,
            argument=argument,
        )


@dataclass(frozen=True, slots=True)
class KnownLagrangian:
    """The text of an L~ and the conditions under which it is one of the system, such as "x > 0"."""

    text: str
    domain: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class MechanicalSystem:
    """Coordinates with L and constraints, or with accelerations; `names` are those its formulas may
    use.

    `values` are the parameters that its document gives a value. `known` are the L~ that come with
    the system, the best first, `source` says from where. `document` is what `solve` would be asked
    about. `definitions` are the formulas that the scene gives to its functions. `catalogue_name` is
    there where it comes from the catalogue.
    """

    names: nm.Names
    lagrangian: ex.Expression | None
    constraints: tuple[ex.Expression, ...]
    accelerations: tuple[ex.Expression, ...] | None
    values: Mapping[str, str]
    name: str = ""
    known: tuple[KnownLagrangian, ...] = ()
    source: str = ""
    document: Mapping[str, Any] | None = None
    definitions: calculus.Definitions = field(default_factory=dict)
    catalogue_name: str | None = None


def _of_catalogue(name: str, extra: Sequence[str]) -> MechanicalSystem:
    entry = catalogue.entry(name)
    known = entry.get("expected", {}).get("lagrangians", [])
    found = replace(_of_document(entry["document"], extra), catalogue_name=name)
    if found.accelerations is not None and known:
        return replace(
            found,
            known=(KnownLagrangian(known[0]),),
            source="the known Lagrangian of the catalogue",
        )
    return found


def _of_result(result: Mapping[str, Any], extra: Sequence[str]) -> MechanicalSystem:
    result = accepting.inward(result)
    system = result.get("system")
    if not isinstance(system, Mapping):
        raise refusal("no_system", "")
    given = system.get("given")
    if isinstance(given, Mapping) and "lagrangian" in given:
        found = _of_document(given, extra)
    else:
        keys = ("name", "coordinates", "equations", "parameters", "functions")
        found = _of_document({key: system[key] for key in keys if key in system}, extra)
    return replace(found, known=lagrangians_of(result, found.names), source="the result given")


def lagrangians_of(result: Mapping[str, Any], names: nm.Names) -> tuple[KnownLagrangian, ...]:
    """The Lagrangians of a result on all its branches, also with t, the most suitable first: those
    with a Hamiltonian in closed form, and of these those with the fewest walls, at which a motion
    would end.
    """
    branches = [
        result,
        *(branch for branch in result.get("branches") or () if isinstance(branch, Mapping)),
    ]
    answers = [
        answer
        for branch in branches
        for answer in (branch, branch.get("with_time"))
        if isinstance(answer, Mapping) and _is_part(answer.get("lagrangian"))
    ]

    def rank(answer: Mapping[str, Any]) -> tuple[bool, int]:
        hamiltonian, tree = (
            answer.get("hamiltonian"),
            reader.read_formula(answer["lagrangian"]["text"], names),
        )
        closed = _is_part(hamiltonian) and not (hamiltonian or {}).get("implicit")
        return not closed, len({*numeric_formulas.walls(tree, names.coordinates)})

    parts = [answer["lagrangian"] for answer in sorted(answers, key=rank)]
    return tuple(
        dict.fromkeys(
            KnownLagrangian(part["text"], tuple(part.get("domain") or ())) for part in parts
        )
    )


def _is_part(value: Any) -> bool:
    return isinstance(value, Mapping) and isinstance(value.get("text"), str)


def _of_document(document: Mapping[str, Any], extra: Sequence[str]) -> MechanicalSystem:
    ready = accepting.prepared(document)
    if accepting.uses_the_letter_t(ready):
        raise refusal("letter_t", "/coordinates")
    if beside := sorted(accepting.OF_SCENES.intersection(document)):
        raise refusal("beside_system", f"/{beside[0]}", name=beside[0])
    # What is left out of a document to be solved may be what moves the bodies here: it is refused.
    unknown = ready.extra.get("ignored", ())
    document = {**ready.document, **{key: document[key] for key in unknown}}
    if "lagrangian" in document and "equations" in document:
        raise refusal("two_systems", "")
    try:
        if "lagrangian" in document:
            return _of_lagrangian(document, extra)
        if "equations" in document:
            return _of_equations(document, extra)
    except InputError as error:
        raise ready.error(error) from None
    raise refusal("neither_system", "", what=TABLE["expected"]["system"])


def _of_lagrangian(document: Mapping[str, Any], extra: Sequence[str]) -> MechanicalSystem:
    own = {key: value for key, value in document.items() if key not in SOLVE_ONLY}
    schema = accepting.validated(own, schemas.LagrangianDocument, SYSTEM_WORDING)
    parameters, values = _parameters(
        schema.parameters, [name for name in extra if name not in schema.coordinates]
    )
    declared = Declared(
        schema.coordinates, parameters, schema.functions, schema.where, base.MAX_SIMULATED
    )
    known = known_names(declared, {"/lagrangian": schema.lagrangian}, order=1)
    names = known.remaining()
    if schema.constraints:
        declared = replace(declared, coordinates=names.coordinates)
        from inverse_service.mechanics.constrained_motion import read_nonholonomic

        system = read_nonholonomic(declared, schema.lagrangian, schema.constraints)
        lagrangian, constraints = system.lagrangian, system.constraints
    else:
        lagrangian, constraints = (
            known.put_in(formula(schema.lagrangian, known.names, "/lagrangian")),
            (),
        )
    return MechanicalSystem(
        names, lagrangian, constraints, None, values, schema.name, document=document
    )


def _of_equations(document: Mapping[str, Any], extra: Sequence[str]) -> MechanicalSystem:
    schema = accepting.validated(document, schemas.EquationsDocument)
    coordinates = schema.coordinates or schema.equations
    parameters, values = _parameters(
        schema.parameters, [name for name in extra if name not in coordinates]
    )
    from inverse_service.mechanics.second_order_system import read_system

    system = read_system(
        schema.coordinates,
        schema.equations,
        parameters,
        schema.functions,
        schema.name,
        schema.where,
        base.MAX_SIMULATED,
    )
    functions = dict(system.functions)
    names = document_names(
        Declared(system.coordinates, system.parameters, functions, most=base.MAX_SIMULATED), {}
    )
    accelerations = tuple(map(without_steps, system.accelerations))
    return MechanicalSystem(names, None, (), accelerations, values, schema.name, document=document)


READERS: dict[str, Callable[[Any, Sequence[str]], MechanicalSystem]] = {
    "catalogue": _of_catalogue, "document": _of_document, "result": _of_result, "": _of_document,
}  # fmt: skip


def mechanical_system(given: Any, extra: Sequence[str]) -> MechanicalSystem:
    """The system that the scene's `system` names; `extra` are additional parameters with values in
    the scene.

    InputError with its pointer below /system.
    """
    key = next((key for key in READERS if hasattr(given, key)), "")
    pointer = f"/system/{key}" if key else "/system"
    try:
        return READERS[key](getattr(given, key) if key else given, extra)
    except DocumentRefused as error:
        raise DocumentRefused(
            tuple(replace(p, pointer=pointer + p.pointer) for p in error.places)
        ) from None
    except InputError as error:
        raise error.at(pointer) from None


def without_steps(tree: ex.Expression) -> ex.Expression:
    """The tree with step functions written with u/sqrt(u^2), like sign(u)."""
    steps = [
        node
        for node in ex.walk(tree)
        if isinstance(node, ex.Apply) and node.function == functions.STEP
    ]
    if not steps:
        return tree
    from inverse_service.field import tower  # the exact field takes longer to load than a run

    return ex.substitute(tree, {node: tower.to_kernels(node) for node in steps})


def formula(text: str, names: nm.Names, pointer: str) -> ex.Expression:
    """A formula of coordinates and velocities; InputError at the pointer."""
    with reader.placed_at(pointer):
        return reader.without_accelerations(reader.read_formula(text, names), "the formula", "")


def _parameters(given: Any, extra: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """All parameter names, with the values of the document; values are not substituted, so that one
    kernel serves all values.
    """
    values = (
        {name: text for name, text in given.items() if text is not None}
        if isinstance(given, Mapping)
        else {}
    )
    declared = Declared(parameters=given)
    names = list(declared.named_parameters())
    more = [AND_GUESS] if declared.guesses else []
    spelled = nm.Names((), tuple(extra))
    taken = {spelled.spelling(name) for name in names}
    return [*names, *(name for name in extra if name not in taken), *more], values


def scene_schema(document: Any) -> schemas.SceneDocument:
    """The scene in its schema; raises DocumentRefused with every fault found."""
    with refusals.longer_texts(base.LONGER_IN_SCENES, SHORT_PARTS):
        prepared = accepting.prepared_scene(document)
        return accepting.validated(prepared.document, schemas.SceneDocument, WORDING)


@contextmanager
def as_typed(document: Any) -> Iterator[None]:
    """Errors about a formula of the scene point to where it was typed."""
    try:
        yield
    except InputError as error:
        raise accepting.prepared_scene(document).error(error) from None


def _steps(loc: accepting.Steps) -> accepting.Steps:
    steps = accepting.without(loc, HIDDEN)
    is_tagged = len(steps) > 1 and steps[0] == "system" and steps[1] in schemas.SYSTEM_TAGS
    # The tag for the form of the system is not a key of the document.
    return (steps[0], *steps[2:]) if is_tagged else steps


def _unknown(steps: accepting.Steps, where: str) -> str:
    models: dict[int | str, Any] = {
        "initial": schemas.SceneInitial,
        "methods": schemas.SceneMethod,
        "events": schemas.SceneEvent,
        "contacts": schemas.SceneContact,
        "ensemble": schemas.SceneEnsemble,
        "system": schemas.LagrangianDocument,
    }
    model = models.get(steps[0]) if len(steps) > 1 else schemas.SceneDocument
    keys = [str(steps[0])] if model is None else list(model.model_fields)
    if model is schemas.LagrangianDocument:  # a system has these, or one of the first three
        keys = [*schemas.SYSTEM_TAGS[:3], *keys]
    known = f"The key {where} is not known here; the keys are {', '.join(keys)}."
    return str(TABLE["not_simulated"].get(steps[-1], known))


# What each place takes.
EXPECTED: dict[accepting.Steps, str] = {
    tuple(filter(None, place.split("."))): re.sub(
        "<(.+?)>", lambda name: str(FILLED[name[1]]), text
    )
    for place, text in TABLE["expected"].items()
}
WORDING = accepting.Wording("The scene", EXPECTED, _unknown, _steps)


def read_expression(text: str, system: MechanicalSystem, pointer: str) -> ex.Expression:
    """A formula of the scene, with those of its functions; InputError at the pointer, or where a
    function has none.
    """
    given = formula(text, system.names, pointer)
    tree = without_steps(calculus.define_functions(given, system.definitions))
    refuse_open_functions([tree], system.names)
    return tree


def read_forces(
    schema: schemas.SceneDocument, system: MechanicalSystem, effects: tuple[str, ...]
) -> tuple[ex.Expression, ...]:
    """Q_i = forces_i - dR/dq_i' of the active effects, (n,); empty if there are none."""
    names = system.names
    found: dict[str, ex.Expression] = {}
    for key, text in schema.forces.items() if FORCES in effects else ():
        pointer = f"/forces/{escape(key)}"
        found[_coordinate(key, names, pointer)] = read_expression(text, system, pointer)
    if schema.rayleigh is not None and RAYLEIGH in effects:
        function = read_expression(schema.rayleigh, system, "/rayleigh")
        for name in names.coordinates:
            slope = calculus.differentiate(function, ex.Velocity(name))
            found[name] = collecting.collect(found.get(name, ex.ZERO) - slope)
    forces = tuple(found.get(name, ex.ZERO) for name in names.coordinates)
    return forces if any(force != ex.ZERO for force in forces) else ()


def read_observables(
    schema: schemas.SceneDocument, system: MechanicalSystem
) -> tuple[data.Observable, ...]:
    """The observables that the scene gives by formula, in its order; each name is a separate
    column.
    """
    found: dict[str, data.Observable] = {}
    coordinates = system.names.coordinates
    contacts = [one.name or f"contact_{place}" for place, one in enumerate(schema.contacts, 1)]
    columns = observing.names_of_columns(coordinates, len(system.constraints), contacts)

    def add(name: str, text: str, pointer: str) -> None:
        if name in coordinates or name in found or columns.fullmatch(name):
            raise refusal("taken", pointer, name=name[:40])
        found[name] = data.Observable(name, read_expression(text, system, pointer))

    for place, item in enumerate(schema.observe):
        for name, text in item.items() if isinstance(item, dict) else ():
            add(name, text, f"/observe/{place}/{escape(name)}")
    for body, texts in schema.points.items():
        for axis, text in zip("xy", texts, strict=True):
            add(f"{body}_{axis}", text, f"/points/{escape(body)}/{'xy'.index(axis)}")
    return tuple(found.values())


def read_events(schema: schemas.SceneDocument, system: MechanicalSystem) -> tuple[data.Event, ...]:
    """The events of a scene; `when` may be an equation with 0 on its right."""
    found = []
    for place, event in enumerate(schema.events):
        pointer = f"/events/{place}/when"
        left, equals, right = event.when.partition("=")
        if equals and right.strip() not in ("0", "0.0"):
            raise refusal("equation", pointer)
        when, names, sets = read_expression(left, system, pointer), system.names, []
        for key, text in () if isinstance(event.do, str) else event.do.set.items():
            pointer = f"/events/{place}/do/set/{escape(key)}"
            target, known = formula(key, names, pointer), names.coordinates
            if target not in numeric_formulas.state_names(known):
                raise refusal("sets", pointer, known=", ".join(known), first=known[0])
            sets.append((target, read_expression(text, system, pointer)))
        stops = event.do == "stop" or (event.do == "record" and event.count is not None)
        most = event.count or (MOST_ACTS if sets else 1)
        found.append(data.Event(when, event.direction, stops, tuple(sets), most))
    return tuple(found)


def read_contacts(
    schema: schemas.SceneDocument,
    system: MechanicalSystem,
    values: Mapping[str, float],
    state: data.Point,
) -> tuple[data.Contact, ...]:
    """The contacts of a scene; none may be penetrated at the start, and each name is a separate
    column.
    """
    names, found = system.names, dict[str, data.Contact]()
    if schema.contacts and system.lagrangian is None and len(names.coordinates) > 1:
        raise refusal("contacts_without_masses", "/contacts")
    for place, given in enumerate(schema.contacts):
        pointer, name = f"/contacts/{place}", given.name or f"contact_{place + 1}"
        if name in found:
            raise refusal("contact_twice", f"{pointer}/name", name=name)
        gap = read_expression(given.gap, system, f"{pointer}/gap")
        if not ex.holds(gap, *map(ex.Symbol, names.coordinates)):
            raise refusal(
                "gap_of_no_coordinate", f"{pointer}/gap", known=", ".join(names.coordinates)
            )
        if ex.has(gap, ex.Velocity):
            raise refusal("gap_of_velocities", f"{pointer}/gap")
        powers = [power for part, power in ex.powers_of(gap) if ex.has(part, ex.Symbol)]
        if not any(power.denominator == 1 and power % 2 for power in powers):
            raise refusal("gap_never_negative", f"{pointer}/gap")
        restitution = number_of(
            given.restitution or "0", f"{pointer}/restitution", "restitution", 0, 1
        )
        friction = number_of(given.friction or "0", f"{pointer}/friction", "friction", 0)
        slides = (
            ex.ZERO
            if given.slides is None
            else read_expression(given.slides, system, f"{pointer}/slides")
        )
        if friction and not ex.has(slides, ex.Velocity):
            raise refusal("no_sliding", f"{pointer}/slides", first=names.coordinates[0])
        slopes = [calculus.differentiate(slides, ex.Velocity(x)) for x in names.coordinates]
        if any(ex.has(slope, ex.Velocity) for slope in slopes):
            raise refusal("sliding_not_linear", f"{pointer}/slides")
        table = numeric_formulas.arrays_by_name(
            names.coordinates, state[1][None], state[2][None], values, np.array([state[0]])
        )
        (start,) = arrays.array_value(gap, table)
        if not start >= -PENETRATION * (1 + np.abs(state[1]).max()):
            raise refusal("penetrated", f"{pointer}/gap", name=name, value=f"{start:.6g}")
        found[name] = data.Contact(name, gap, restitution, friction, slides)
    return tuple(found.values())


class Beginning(NamedTuple):
    """The time at which a scene begins, and its initial data."""

    time: float
    initial: schemas.SceneInitial


def beginning(schema: schemas.SceneDocument) -> Beginning:
    """The start time and initial data of the scene, given directly or taken from the end of the
    restarted result.
    """
    if schema.restart is None:
        if schema.initial is None:
            raise refusal("no_initial", "/initial")
        begin = 0.0 if schema.start_time is None else number_of(schema.start_time, "/start_time")
        return Beginning(begin, schema.initial)
    if schema.initial is not None or schema.start_time is not None:
        raise refusal("begins_twice", "/restart")
    methods = schema.restart.get("methods")
    for method in methods if isinstance(methods, list) else []:
        with suppress(
            InputError, AttributeError, KeyError, TypeError, ValueError
        ):  # it has no last point
            final = method["final"]
            given = (final["positions"], final["velocities"])
            positions, velocities = (
                {name: repr(float(x)) for name, x in one.items()} for one in given
            )
            begin = number_of(repr(float(final["t"])), "/restart")
            return Beginning(
                begin,
                schemas.SceneInitial(positions=positions, velocities=velocities, project=True),
            )
    raise refusal("no_end", "/restart")


def read_scene(schema: schemas.SceneDocument) -> tuple[data.Scene, MechanicalSystem]:
    """The scene and its system; InputError with a pointer to the error."""
    with refusals.longer_texts(base.LONGER_IN_SCENES, SHORT_PARTS):
        return _read_scene(schema)


def _read_scene(schema: schemas.SceneDocument) -> tuple[data.Scene, MechanicalSystem]:
    given = {
        nm.declared_name(name, f"/parameters/{escape(name)}", "parameter"): text
        for name, text in schema.parameters.items()
    }
    system = mechanical_system(schema.system, list(given))
    # Formulas that the scene adds to those of its system may use additional parameters.
    keys = (
        "terms",
        "functions",
        "free_lagrangian",
        "forces",
        "rayleigh",
        "events",
        "contacts",
        "points",
    )
    has_formulas = any(getattr(one, key, None) for one in (schema, *schema.methods) for key in keys)
    _refuse_unknown(
        system, given, has_formulas or any(isinstance(item, dict) for item in schema.observe)
    )
    names = system.names
    columns = observing.names_of_columns(names.coordinates, len(system.constraints))
    if taken := [*filter(columns.fullmatch, names.coordinates)]:
        raise refusal("column", "/system", name=min(taken))
    texts = dict(system.values) | {names.spelling(name): text for name, text in given.items()}
    if missing := [name for name in names.parameters if name not in texts]:
        raise refusal("no_value", "/parameters", missing=", ".join(missing))
    values = {name: number_of(texts[name], f"/parameters/{name}") for name in names.parameters}
    system = replace(system, definitions=read_definitions(schema.functions, names))
    lagrangian, constraints, forces, effects, parts = _with_effects(schema, system)
    accelerations = tuple(
        calculus.define_functions(tree, system.definitions) for tree in system.accelerations or ()
    )
    formulas = [tree for tree in (lagrangian, *constraints, *accelerations) if tree is not None]
    refuse_open_functions(formulas, names)
    if any(ex.holds(tree, ex.TIME) for tree in constraints):
        raise refusal("time", "/system")
    begin, initial = beginning(schema)
    # A start of p in first-order equations x' = h, p' = F, of which x alone is a coordinate.
    equations, known = str((system.document or {}).get("equations")), ", ".join(names.coordinates)
    for kind in PARTS:
        for name in getattr(initial, kind) or {}:
            if name not in names.coordinates and f"{name}'" in equations:
                raise refusal(
                    "first_order", f"/initial/{kind}/{escape(name)}", known=known, name=escape(name)
                )
    what = data.Problem(names.coordinates, (), lagrangian, constraints)
    positions, velocities = read_initial(initial, names, what, values)
    grid, notes = read_grid(schema, begin, len(names.coordinates))
    scene = data.Scene(
        name=schema.name or system.name, coordinates=names.coordinates, values=values,
        lagrangian=lagrangian, constraints=constraints, accelerations=accelerations or None, forces=forces,
        effects=effects, parts=parts, positions=positions, velocities=velocities, grid=grid, notes=notes,
        methods=read_methods(schema), observe=tuple(one for one in get_args(schemas.Observed) if one in schema.observe),
        circle=read_circle(schema, names), own=read_observables(schema, system), events=read_events(schema, system),
        contacts=read_contacts(schema, system, values, (grid.begin, positions, velocities)),
        bodies={body: (f"{body}_x", f"{body}_y") for body in schema.points},
        units={names.spelling(name): unit for name, unit in schema.units.items()},
    )  # fmt: skip
    if schema.ensemble is not None:
        scene = replace(scene, ensemble=read_members(schema.ensemble, initial, names, scene))
    return scene, system


def _refuse_unknown(system: MechanicalSystem, extra: Iterable[str], formulas: bool) -> None:
    """Reject a parameter that neither the system nor an additional formula of the scene can use."""
    parameters, trees = (
        system.names.parameters,
        (system.lagrangian, *system.constraints, *(system.accelerations or ())),
    )
    known = {
        node.name
        for tree in trees
        if tree is not None
        for node in ex.walk(tree)
        if isinstance(node, ex.Symbol)
    }
    known |= set(
        Declared(parameters=(system.document or {}).get("parameters", ())).named_parameters()
    )
    known = set(parameters) & (
        set(parameters) if formulas else set(map(system.names.spelling, known))
    )
    for name in extra:
        if system.names.spelling(name) not in known:
            names = ", ".join(name for name in parameters if name in known) or "none"
            raise refusal("no_parameter", f"/parameters/{escape(name)}", name=name, known=names)


class WithEffects(NamedTuple):
    """What acts in a scene, the names in effect, and effects that were turned round."""

    lagrangian: ex.Expression | None
    constraints: Constraints
    forces: Constraints
    names: tuple[str, ...]
    effects: tuple[data.Effect, ...]


def _with_effects(schema: schemas.SceneDocument, system: MechanicalSystem) -> WithEffects:
    """L with the effects named, the constraints and forces that act, all names in effect, and each
    effect that the system has turned round.
    """
    for name in schema.terms:
        if (
            name.casefold() in DISSIPATION and not schema.as_lagrangian
        ):  # masses change and no energy is dissipated
            raise refusal("dissipation", f"/terms/{escape(name)}", name=name)
    terms = {
        name: read_expression(text, system, f"/terms/{escape(name)}")
        for name, text in schema.terms.items()
    }
    further = [
        name for name, given in ((FORCES, schema.forces), (RAYLEIGH, schema.rayleigh)) if given
    ]
    known = (*derivation.BUILT_IN, *terms, *further)
    named = tuple(dict.fromkeys(schema.effects if schema.effects is not None else known))
    for place, name in enumerate(named):
        if name not in known:
            raise refusal(
                "no_effect", f"/effects/{place}", name=escape(name), known=", ".join(known)
            )
    if system.lagrangian is None:
        if terms or further or schema.effects is not None:
            raise refusal(
                "no_lagrangian", "/terms" if terms else f"/{further[0]}" if further else "/effects"
            )
        return WithEffects(None, (), (), (), ())
    whole = calculus.define_functions(system.lagrangian, system.definitions)
    parts = [*derivation.lagrangian_parts(whole, system.names.coordinates).items(), *terms.items()]
    given = tuple(calculus.define_functions(w, system.definitions) for w in system.constraints)

    def acting(names: Sequence[str]) -> tuple[ex.Expression, Constraints, Constraints]:
        forces = read_forces(schema, system, tuple(names))
        # All other parts are left out completely.
        chosen = (tree for name, tree in parts if name in (derivation.KINETIC, *names))
        return ex.add(*chosen), given if derivation.CONSTRAINTS in names else (), forces

    whole_scene = acting(named)
    found = []
    for name in known:
        other = [one for one in named if one != name] if name in named else [*named, name]
        if name != derivation.KINETIC and (turned := acting(other)) != whole_scene:
            found.append(data.Effect(name, name in named, *turned))
    return WithEffects(*whole_scene, named, tuple(found))


def number_of(
    text: str, pointer: str, key: str = "", low: float = -math.inf, high: float = math.inf
) -> float:
    """A number written as 0.1, "1/2" or "pi/4"; InputError for all other values and for values that
    are not finite, and for one that is not from `low` to `high`, whose refusal has the `key`.
    """
    value = float(text) if _DECIMAL.fullmatch(text) else math.nan
    if not math.isfinite(value):
        with suppress(InputError, arrays.NoValue, OverflowError):
            value = float(
                arrays.array_value(reader.read_formula(text, nm.Names(time=False)), {})[0]
            )
    if not math.isfinite(value):
        raise refusal("no_number", pointer, text=refusals.shorten(text))
    if not low <= value <= high:
        raise refusal(key, pointer)
    return value


def read_grid(
    schema: schemas.SceneDocument, begin: float = 0.0, size: int = 1
) -> tuple[data.Grid, tuple[str, ...]]:
    """The step, the number of steps and which are recorded, with a note if not all requested ones
    are, which would take too much memory; `size` is the number of coordinates.
    """
    step = number_of(schema.step, "/step", "backwards", POSITIVE)
    if (schema.steps is None) == (schema.time is None):
        raise refusal("two_lengths", "")
    notes: tuple[str, ...] = ()
    steps = schema.steps or 0
    if schema.time is not None:
        length = number_of(schema.time, "/time", "no_length", POSITIVE)
        if (count := length / step) > schemas.MAX_STEPS:
            raise refusal("most_steps", "/time", LimitError, most=schemas.MAX_STEPS)
        steps = max(
            1, round(count) if abs(count - round(count)) < 1e-9 * count else math.ceil(count)
        )
        if abs(steps * step - length) > 1e-9 * length:
            notes = (
                f"The run takes {steps * step:.10g}, up to the first grid point beyond {length:.10g}.",
            )
    every = schema.record_every or 1
    if (schema.events or schema.contacts) and (every > 1 or steps > MOST_WITH_EVENTS):
        raise refusal(
            "every_step", "/events" if schema.events else "/contacts", most=MOST_WITH_EVENTS
        )
    most = min(MOST_RECORDED, MOST_STATES // (2 * size))
    if not (schema.events or schema.contacts) and steps // every > most:
        every = math.ceil(steps / most)
        notes += (f"One step in {every} is recorded, so that at most {most} points are kept.",)
    return data.Grid(step, steps, min(every, steps), begin), notes


def read_methods(schema: schemas.SceneDocument) -> tuple[data.Requested, ...]:
    """The methods in the order of the scene, each with a unique label."""
    found, counts = list[data.Requested](), Counter[str]()
    for place, given in enumerate(schema.methods or [schemas.SceneMethod(method="adaptive")]):
        one = _requested(schema, given, f"/methods/{place}")
        counts[one.label] += 1
        again = counts[one.label] > 1
        found.append(replace(one, label=f"{one.label}-{counts[one.label]}") if again else one)
    return tuple(found)


def _requested(
    schema: schemas.SceneDocument, given: schemas.SceneMethod, pointer: str
) -> data.Requested:
    verlet = given.method == "stormer-verlet"
    method = INSIDE.get(given.method, given.method)
    alpha = number_of(given.alpha or "0.5", f"{pointer}/alpha", "alpha", 0, 1)
    allowed = METHODS[method].orders
    if given.order is not None and given.order not in allowed:
        choice = (
            f"takes the orders {METHODS[method].listed_orders}"
            if allowed
            else "has no order to choose"
        )
        raise refusal("order", f"{pointer}/order", method=given.method, choice=choice)
    if method == data.EXACT:
        return data.Requested(given.label or method, data.MethodChoice(method))
    order = given.order or (allowed[0] if allowed else 2)
    tolerance = METHODS[method].tolerance or 0.0
    if given.tolerance is not None:
        if method not in OWN_STEPS:
            raise refusal("takes_steps", f"{pointer}/tolerance", method=given.method)
        tolerance = number_of(given.tolerance, f"{pointer}/tolerance", "tolerance", 1e-18, 0.1)
    if verlet and (given.alpha is not None or given.symmetrised or given.form != "hamiltonian"):
        raise refusal("verlet", pointer)
    alpha, symmetrised, form = (
        (0.0, True, "verlet") if verlet else (alpha, given.symmetrised, given.form)
    )
    short = f"{alpha:g}"
    written = short if float(short) == alpha else given.alpha or short  # as it is written: 1/3
    shown = written if method in GEOMETRIC else None
    constants = [
        (key, number_of(text, f"{pointer}/constants/{escape(key)}"))
        for key, text in (given.constants or {}).items()
    ]
    settings = data.MethodChoice(method, alpha, symmetrised, order, form, given.guard, tolerance)
    label, convention = given.label or _label(given, shown, order), given.start or schema.start
    return data.Requested(
        label, settings, shown, convention, given.free_lagrangian, tuple(constants)
    )


def _label(given: schemas.SceneMethod, alpha: str | None, order: int) -> str:
    shown = alpha is not None and given.method != "stormer-verlet"
    parts = {
        given.method: True,
        str(alpha).replace("/", "_"): shown,
        f"order{order}": given.order not in (None, 2),
        "symmetrised": given.symmetrised,
        "raw": given.method == "variational" and given.form == "raw",
        str(given.free_lagrangian): _is_of_class(given.free_lagrangian),
    }
    return "-".join(word for word, is_shown in parts.items() if is_shown)


def _is_of_class(free_lagrangian: str | None) -> bool:
    """Whether it names an associated system, and is no formula."""
    if free_lagrangian is None:
        return False
    from inverse_service.mechanics import paper_class

    return free_lagrangian in paper_class.KINDS


def read_circle(schema: schemas.SceneDocument, names: nm.Names) -> tuple[int, int] | None:
    """The pair of coordinates named, else x and y, else the last two."""
    known = names.coordinates
    pair = ["x", "y"] if {"x", "y"} <= set(known) else known[-2:]
    if schema.circle is not None:
        pair = [
            _coordinate(name, names, f"/circle/{place}") for place, name in enumerate(schema.circle)
        ]
        if pair[0] == pair[1]:
            raise refusal("circle", "/circle")
    return (known.index(pair[0]), known.index(pair[1])) if len(pair) == 2 else None


def read_initial(
    given: schemas.SceneInitial, names: nm.Names, what: System, values: Mapping[str, float]
) -> tuple[Array, Array]:
    """Positions and velocities, (n,) each, the velocities on the constraints."""
    start = _of_all(given.positions, names, "position", "/initial/positions")
    if (given.velocities is None) == (given.momenta is None):
        raise refusal("two_speeds", "/initial")
    speeds = _by_coordinate(given.velocities or {}, names, "/initial/velocities")
    if given.momenta is not None:
        target = _of_all(given.momenta, names, "momentum", "/initial/momenta")
        found = velocities_from_momenta(what, values, start, target)
        speeds = dict(zip(names.coordinates, map(float, found), strict=True))
    check_constraints(what, values, start)
    return start, initial_velocities(what, values, start, speeds, given.project)


def _of_all(given: Mapping[str, str], names: nm.Names, what: str, pointer: str) -> Array:
    found = _by_coordinate(given, names, pointer)
    missing = ", ".join(name for name in names.coordinates if name not in found)
    if missing:
        raise refusal("missing", pointer, what=what, missing=missing)
    return np.array([found[name] for name in names.coordinates])


def _by_coordinate(given: Mapping[str, str], names: nm.Names, pointer: str) -> dict[str, float]:
    found = {}
    for key, text in given.items():
        place = f"{pointer}/{escape(key)}"
        name = key.removeprefix("p_") if pointer.endswith("momenta") else key
        found[_coordinate(name, names, place)] = number_of(text, place)
    return found


def _coordinate(key: str, names: nm.Names, pointer: str) -> str:
    """The coordinate of this name, as the system writes it."""
    if (name := names.spelling(key)) not in names.coordinates:
        raise refusal(
            "no_coordinate", pointer, name=escape(key), known=", ".join(names.coordinates)
        )
    return name


def read_members(
    given: schemas.SceneEnsemble, base: schemas.SceneInitial, names: nm.Names, scene: data.Scene
) -> data.Members:
    """Starts times combinations of parameters, the parameters running fastest; each start on the
    constraints.
    """
    unseen = [name for name in scene.observe if name not in OF_MEMBERS]
    if scene.events or scene.contacts or unseen:
        what = f"'{unseen[0]}' is" if unseen else "contacts are" if scene.contacts else "events are"
        pointer = "/contacts" if scene.contacts else "/events" if scene.events else "/observe"
        raise refusal("of_members", pointer, what=what, known=", ".join(OF_MEMBERS))
    axes = {}
    for key, texts in given.parameters.items():
        name, pointer = names.spelling(key), f"/ensemble/parameters/{escape(key)}"
        if name not in scene.values:
            raise refusal(
                "no_parameter", pointer, name=escape(key), known=", ".join(scene.values) or "none"
            )
        ends = (
            "energy",
            *names.coordinates,
            *(f"v_{of}" for of in names.coordinates),
            *(one.name for one in scene.own),
        )
        if name in {
            "completed",
            *(f"{of}_end" for of in ends),
            *(f"{of}_start" for of in names.coordinates),
        }:
            raise refusal("taken", pointer, name=name[:40])
        axes[name] = [number_of(text, f"{pointer}/{k}") for k, text in enumerate(texts)]
    grid, columns = list(product(*axes.values())), list[list[str]]()
    starts = given.initial
    if starts is None:
        starts = schemas.MemberColumns() if base.momenta is None else [base]
    elif isinstance(starts, schemas.MemberColumns):
        columns = [*starts.positions.values(), *starts.velocities.values()]
        if base.momenta is not None:
            raise refusal("momenta", "/ensemble/initial")
    count, each = (
        len(starts) if isinstance(starts, list) else len(next(iter(columns), [""])),
        len(grid),
    )
    rows = scene.grid.steps // scene.grid.record_every + 2
    if 2.0 * count * each * rows * len(names.coordinates) > MOST_NUMBERS:
        raise refusal("large_ensemble", "/ensemble", LimitError, most=MOST_NUMBERS)
    values = {name: np.tile([row[k] for row in grid], count) for k, name in enumerate(axes)}
    where = "/ensemble/initial"
    try:
        if isinstance(starts, schemas.MemberColumns):
            if given.initial is not None and len({*map(len, columns)}) != 1:
                raise refusal("columns", "/initial")
            return _together(starts, base, names, scene, values, count)
        found = []
        for place, one in enumerate(starts):
            where = f"/ensemble/initial/{place}"
            moving = one if one.velocities is not None or one.momenta is not None else base
            given_speeds = {"velocities": moving.velocities, "momenta": moving.momenta}
            merged = one.model_copy(
                update={"positions": base.positions | one.positions, **given_speeds}
            )
            # Momenta and constraints may depend on the parameters.
            for member in range(place * each, (place + 1) * each):
                own = {
                    **scene.values,
                    **{name: float(column[member]) for name, column in values.items()},
                }
                found.append(read_initial(merged, names, scene, own))
    except InputError as error:
        raise error.placed(error.pointer.replace("/initial", where, 1)) from None
    return data.Members(np.array([q for q, _ in found]), np.array([v for _, v in found]), values)


def _together(
    given: schemas.MemberColumns, base: schemas.SceneInitial, names: nm.Names, scene: data.Scene,
    values: Mapping[str, Array], count: int,
) -> data.Members:  # fmt: skip
    """Columns of starts, each repeated for the values of the parameters; missing velocities are
    filled in.
    """
    tables = [np.tile(row, (count, 1)) for row in (scene.positions, scene.velocities)]
    for table, what in zip(tables, ("positions", "velocities"), strict=True):
        for key, texts in getattr(given, what).items():
            pointer = f"/initial/{what}/{escape(key)}"
            place = names.coordinates.index(_coordinate(key, names, pointer))
            table[:, place] = [
                number_of(text, f"{pointer}/{row}") for row, text in enumerate(texts)
            ]
    each = len(next(iter(values.values()), tables[0])) // count
    positions, velocities = (np.repeat(table, each, axis=0) for table in tables)
    if scene.constraints:
        free = {*(base.velocities or {}), *map(names.spelling, given.velocities)}
        speeds = {
            name: velocities[:, k] for k, name in enumerate(names.coordinates) if name in free
        }
        velocities = initial_velocities(
            scene, {**scene.values, **values}, positions, speeds, base.project
        )
    return data.Members(positions, velocities, values)
