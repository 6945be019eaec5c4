"""The system of a scene, from the catalogue, a document or a result, with symbolic parameters.

Formulas for arbitrary functions are substituted, also in their derivatives.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from api_schemas import base, scene
from inverse_service import catalogue, errors
from inverse_service.expressions import derivative, pieces, tree as trees
from inverse_service.field import tower
from inverse_service.mechanics import constrained_motion, reading
from inverse_service.reading import reader
from inverse_service.reading.document_names import AND_GUESS, Declared, document_names, known_names
from inverse_service.reading.names import Names
from inverse_service.service.documents import accepting
from inverse_service.simulation import numeric_formulas

SYSTEM = (
    'an object: {"catalogue": name}, {"document": {...}}, {"result": {...}} or a document with coordinates and '
    "lagrangian or equations"
)
Values = Mapping[str, str]
LAGRANGIAN_KEYS = "name, coordinates, lagrangian, constraints, parameters, functions, where, time"
# Keys of a nonholonomic document that are options of `solve` and do not affect the motion.
SOLVE_ONLY = frozenset(
    {
        "multiples",
        "search",
        "special_cases",
        "first_integrals",
        "time_dependent_lagrangian",
        "ansatz",
        "series_order",
        "question",
        "id",
    }
)
WORDING = accepting.Wording(
    "The system",
    accepting.EXPECTED,
    lambda _, where: f"The key {where} is not known here; a system with a Lagrangian has the keys {LAGRANGIAN_KEYS}.",
    lambda steps: tuple(step for step in steps if step not in ("dict", "list") and not str(step).endswith("]")),
)


def read_definitions(given: Mapping[str, str], names: Names) -> derivative.Definitions:
    """The formula of each function over its own arguments; InputError with the pointer below /functions."""
    found = {}
    for key, text in given.items():
        pointer = f"/functions/{key}"
        name = names.spelling(key)
        if name not in names.functions:
            known = ", ".join(names.functions) or "none"
            raise errors.InputError(
                f"'{key[:40]}' is not a function of this system: its functions are {known}.", pointer
            )
        arguments = names.functions[name]
        with reader.placed_at(pointer):
            tree = reader.read_formula(text, Names(names.coordinates, names.parameters))
        moving: dict[trees.Expression, trees.Expression]
        moving = {trees.Velocity(of[0]): trees.Symbol(word) for word in arguments if (of := names.derivative(word))}
        tree = trees.substitute(tree, moving)
        foreign = [n for n in trees.walk(tree) if isinstance(n, trees.Velocity) or _is_other(n, arguments, names)]
        if foreign:
            raise errors.InputError(f"{name} depends on {', '.join(arguments)} only: use only these.", pointer)
        found[name] = (arguments, tree)
    return found


def _is_other(node: trees.Expression, arguments: tuple[str, ...], names: Names) -> bool:
    return isinstance(node, trees.Symbol) and node.name in names.coordinates and node.name not in arguments


def refuse_open_functions(formulas: Sequence[trees.Expression], names: Names) -> None:
    """InputError if a formula contains an arbitrary function for which the scene gives no formula."""
    missing = sorted({node.name for tree in formulas for node in trees.walk(tree) if isinstance(node, trees.Arbitrary)})
    if not missing:
        return
    example = f'{{"{missing[0]}": "cos({names.functions[missing[0]][0]})"}}'
    raise errors.InputError(
        f"the functions {', '.join(missing)} are arbitrary: give each a formula in 'functions', as in {example}.",
        "/functions",
    )


@dataclass(frozen=True, slots=True)
class KnownLagrangian:
    """The text of an L~ and the conditions under which it is one of the system, such as "x > 0"."""

    text: str
    domain: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class MechanicalSystem:
    """Coordinates with L and constraints, or with accelerations; `names` are those its formulas may use.

    `values` are the parameters that its document gives a value. `known` are the L~ that come with the system, the best
    first, `source` says from where. `document` is what `solve` would be asked about. `definitions` are the
    formulas that the scene gives to its functions. `catalogue_name` is there where it comes from the catalogue.
    """

    names: Names
    lagrangian: trees.Expression | None
    constraints: tuple[trees.Expression, ...]
    accelerations: tuple[trees.Expression, ...] | None
    values: Values
    name: str = ""
    known: tuple[KnownLagrangian, ...] = ()
    source: str = ""
    document: Mapping[str, Any] | None = None
    definitions: derivative.Definitions = field(default_factory=dict)
    catalogue_name: str | None = None


def mechanical_system(given: Any, extra: Sequence[str]) -> MechanicalSystem:
    """The system that the scene's `system` names; `extra` are additional parameters with values in the scene.

    InputError with its pointer below /system.
    """
    match given:
        case scene.CatalogueSystem(catalogue=name):
            return _at("/system/catalogue", _of_catalogue, name, extra)
        case scene.DocumentSystem(document=document):
            return _at("/system/document", _of_document, document, extra)
        case scene.ResultSystem(result=result):
            return _at("/system/result", _of_result, result, extra)
        case _:
            return _at("/system", _of_document, given, extra)


def _at(pointer: str, read: Any, *arguments: Any) -> MechanicalSystem:
    try:
        found: MechanicalSystem = read(*arguments)
    except errors.DocumentRefused as error:
        places = (replace(p, pointer=pointer + p.pointer) for p in error.places)
        raise errors.DocumentRefused(tuple(places)) from None
    except errors.InputError as error:
        raise error.at(pointer) from None
    return found


def _of_catalogue(name: str, extra: Sequence[str]) -> MechanicalSystem:
    entry = catalogue.entry(name)
    known = entry.get("expected", {}).get("lagrangians", [])
    found = replace(_of_document(entry["document"], extra), catalogue_name=name)
    if found.accelerations is not None and known:
        return replace(found, known=(KnownLagrangian(known[0]),), source="the known Lagrangian of the catalogue")
    return found


def _of_result(result: Mapping[str, Any], extra: Sequence[str]) -> MechanicalSystem:
    result = accepting.inward(result)
    system = result.get("system")
    if not isinstance(system, Mapping):
        raise errors.InputError("The result has no part 'system': give the whole result of solve.")
    given = system.get("given")
    if isinstance(given, Mapping) and "lagrangian" in given:
        found = _of_document(given, extra)
    else:
        keys = ("name", "coordinates", "equations", "parameters", "functions")
        found = _of_document({key: system[key] for key in keys if key in system}, extra)
    return replace(found, known=lagrangians_of(result, found.names), source="the result given")


def lagrangians_of(result: Mapping[str, Any], names: Names) -> tuple[KnownLagrangian, ...]:
    """The Lagrangians of a result on all its branches, also with t, the most suitable first: those with a
    Hamiltonian in closed form, and of these those with the fewest walls, at which a motion would end."""
    branches = [result, *(branch for branch in result.get("branches") or () if isinstance(branch, Mapping))]
    answers = [
        answer
        for branch in branches
        for answer in (branch, branch.get("with_time"))
        if isinstance(answer, Mapping) and _is_part(answer.get("lagrangian"))
    ]

    def rank(answer: Mapping[str, Any]) -> tuple[bool, int]:
        hamiltonian = answer.get("hamiltonian")
        closed = _is_part(hamiltonian) and not (hamiltonian or {}).get("implicit")
        return not closed, len(_walls(answer["lagrangian"]["text"], names))

    parts = [answer["lagrangian"] for answer in sorted(answers, key=rank)]
    return tuple(dict.fromkeys(KnownLagrangian(part["text"], tuple(part.get("domain") or ())) for part in parts))


def _walls(text: str, names: Names) -> set[trees.Expression]:
    moving: set[trees.Expression] = {trees.Symbol(name) for name in names.coordinates}
    return set(numeric_formulas.walls(reader.read_formula(text, names), moving))


def _is_part(value: Any) -> bool:
    return isinstance(value, Mapping) and isinstance(value.get("text"), str)


def _of_document(document: Mapping[str, Any], extra: Sequence[str]) -> MechanicalSystem:
    ready = accepting.prepared(document)
    if accepting.uses_the_letter_t(ready):
        raise errors.InputError(
            "the motion already has a column t for the time: rename the coordinate t.", "/coordinates"
        )
    document = ready.document
    if "lagrangian" in document and "equations" in document:
        raise errors.InputError("The system has both 'lagrangian' and 'equations': keep only one of them.")
    try:
        if "lagrangian" in document:
            return _of_lagrangian(document, extra)
        if "equations" in document:
            return _of_equations(document, extra)
    except errors.InputError as error:
        raise ready.error(error) from None
    raise errors.InputError(f"The system has neither 'lagrangian' nor 'equations'; it must be {SYSTEM}.")


def _of_lagrangian(document: Mapping[str, Any], extra: Sequence[str]) -> MechanicalSystem:
    schema = accepting.validated(
        {k: v for k, v in document.items() if k not in SOLVE_ONLY}, scene.LagrangianDocument, WORDING
    )
    parameters, values = _parameters(schema.parameters, [name for name in extra if name not in schema.coordinates])
    declared = Declared(schema.coordinates, parameters, schema.functions, schema.where, base.MAX_SIMULATED)
    known = known_names(declared, {"/lagrangian": schema.lagrangian}, order=1)
    names = known.remaining()
    if schema.constraints:
        system = constrained_motion.read_nonholonomic(
            names.coordinates,
            schema.lagrangian,
            schema.constraints,
            parameters,
            schema.functions,
            most=base.MAX_SIMULATED,
            where=schema.where,
        )
        lagrangian, constraints = system.lagrangian, system.constraints
    else:
        lagrangian, constraints = known.put_in(formula(schema.lagrangian, known.names, "/lagrangian")), ()
    return MechanicalSystem(names, lagrangian, constraints, None, values, schema.name, document=document)


def _of_equations(document: Mapping[str, Any], extra: Sequence[str]) -> MechanicalSystem:
    schema = accepting.to_schema(document)
    coordinates = schema.coordinates or schema.equations
    parameters, values = _parameters(schema.parameters, [name for name in extra if name not in coordinates])
    system = reading.read_system(
        schema.coordinates, schema.equations, parameters, schema.functions, schema.name, schema.where
    )
    functions = dict(system.functions)
    names = document_names(Declared(system.coordinates, system.parameters, functions), {})
    accelerations = tuple(map(without_steps, system.accelerations))
    return MechanicalSystem(names, None, (), accelerations, values, schema.name, document=document)


def without_steps(tree: trees.Expression) -> trees.Expression:
    """The tree with step functions written with u/sqrt(u^2), like sign(u)."""
    return trees.substitute(tree, {node: tower.to_kernels(node) for node in trees.walk(tree) if _is_step(node)})


def _is_step(node: trees.Expression) -> bool:
    return isinstance(node, trees.Apply) and node.function == pieces.STEP


def formula(text: str, names: Names, pointer: str) -> trees.Expression:
    """A formula of coordinates and velocities; InputError at the pointer."""
    with reader.placed_at(pointer):
        return reader.without_accelerations(reader.read_formula(text, names), "the formula", "")


def _parameters(given: Any, extra: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """All parameter names, with the values of the document; values are not substituted, so that one kernel
    serves all values."""
    values = {name: text for name, text in given.items() if text is not None} if isinstance(given, Mapping) else {}
    declared = Declared(parameters=given)
    names = list(declared.named_parameters())
    more = [AND_GUESS] if declared.guesses else []
    spelled = Names((), tuple(extra))
    taken = {spelled.spelling(name) for name in names}
    return [*names, *(name for name in extra if name not in taken), *more], values
