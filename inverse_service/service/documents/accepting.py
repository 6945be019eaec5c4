"""From a prepared document to its schema and the system that it describes; each fault is one sentence and its place."""

from __future__ import annotations

import json
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from api_schemas import base
from api_schemas.system import MAX_SERIES_ORDER, TAGS, NamedDocument, SystemDocument
from inverse_service import errors
from inverse_service.expressions import tree as ex
from inverse_service.field import reduction
from inverse_service.mechanics import reading, second_order_system
from inverse_service.reading import document_names, reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import plain_data, preparing

if TYPE_CHECKING:
    from api_schemas.nonholonomic import MotionDocument, NonholonomicDocument

    Asking = SystemDocument | NonholonomicDocument | MotionDocument

# Nodes of all accelerations, beyond which they are unreadable; on a cart two links have 1,748, three 14,834.
_MOST_NODES = 5_000
Read = TypeVar("Read", bound=base.Document)
Steps = tuple[int | str, ...]
MAX_PLACES = 10
NOT_IN_THE_DOCUMENT = frozenset({*TAGS, "[key]"})
ALSO = ("time", "id", "options")
TITLES = {"NonholonomicDocument": "nonholonomic system", "LagrangianDocument": "Lagrangian"}
FORMULA = "a formula written as text"
_IN_WORDS = (Path(base.__file__).parent / "expected.json").read_text(encoding="utf-8")
# The values allowed at these steps, in words; "*" is any key or place.
EXPECTED: dict[Steps, str] = {
    **{tuple(filter(None, place.split("/"))): words for place, words in json.loads(_IN_WORDS).items()},
    ("series_order",): f"an integer from 1 to {MAX_SERIES_ORDER}",
}

# Questions about equations of second order, which a document with constraints does not have.
BESIDE = {
    "kinds": "Kinds of Lagrangians are asked about equations: give those of an associated or of the reduced system, "
    "which the result of this document without 'kinds' has.",
    "clock": "With constraints the clock is found, see 'reduced' of the result: leave 'clock' out, or give the "
    "equations of the reduced system.",
}


def to_schema(document: Any) -> SystemDocument:
    """The document in its schema; raises DocumentRefused with every fault found."""
    return validated(document, SystemDocument)


def to_system(schema: SystemDocument) -> second_order_system.SecondOrderSystem:
    """The system that a document describes; raises InputError with pointer and column."""
    return reading.read_system(
        coordinates=schema.coordinates,
        equations=schema.equations,
        parameters=schema.parameters,
        functions=schema.functions,
        name=schema.name,
        where=schema.where,
    )


def to_solvable(schema: SystemDocument) -> second_order_system.SecondOrderSystem:
    """The system of a document to be solved; its equations as given where these are Euler-Lagrange equations already.

    That is where the accelerations, solved for, are too long to be written, or fill pages. InputError as `to_system`.
    """
    if schema.special_cases or schema.kinds or schema.clock or schema.near or isinstance(schema.equations, Mapping):
        return to_system(schema)
    from inverse_service.search import row_factors  # a simulation needs no solver

    system = None
    try:
        system = to_system(schema)
        if sum(map(ex.node_count, system.accelerations)) <= _MOST_NODES:
            return system
    except errors.LimitError:
        pass
    given = to_given(schema)
    lines = second_order_system.unsolved_system(given.names, given.residuals, schema.name)
    found = None if next(reduction.sign_cases(given.residuals)).roots else row_factors.in_own_order(lines)
    if found and all(ex.holds(f, ex.Acceleration(q)) for q, f in zip(found.coordinates, found.given, strict=True)):
        return found
    return system or to_system(schema)


def to_given(schema: SystemDocument) -> reading.GivenEquations:
    """The equations of the document as written, left side minus right side; raises InputError as `to_system`."""
    return reading.read_given(schema.coordinates, schema.equations, schema.parameters, schema.functions, schema.where)


def to_ansatz(schema: Asking, system: second_order_system.SecondOrderSystem) -> tuple[ex.Expression, ...]:
    """The user's own terms of a Lagrangian as trees; raises InputError with pointer and column."""
    named = document_names.Declared(parameters=schema.parameters).named_parameters()
    names = replace(system.names, parameters=tuple(dict.fromkeys((*system.parameters, *named))))
    places = {f"/ansatz/{place}": text for place, text in enumerate(schema.ansatz)}
    terms = ((formula_about(text, names, schema, pointer), pointer) for pointer, text in places.items())
    return tuple(reader.without_accelerations(term, "a term of a Lagrangian", pointer) for term, pointer in terms)


def formula_about(text: str, names: Names, schema: NamedDocument | None, pointer: str) -> ex.Expression:
    """A formula about the system of a document, whose parameters with values are put in; InputError with pointer."""
    values = (
        {}
        if schema is None
        else document_names.parameter_values(document_names.Declared(parameters=schema.parameters).named_parameters())
    )
    known = replace(names, parameters=(*names.parameters, *values))
    with reader.placed_at(pointer):
        return document_names.with_values(reader.read_formula(text, known), values)


@dataclass(frozen=True, slots=True)
class Wording:
    """The words in errors of a schema: the name of the whole, the allowed values, the sentence for an unknown key.

    `keys` takes from pydantic's way to a fault the steps that are no keys of the document.
    """

    whole: str
    expected: Mapping[Steps, str]
    unknown: Callable[[Steps, str], str]
    keys: Callable[[Steps], Steps]


def validated(document: Any, schema: type[Read], wording: Wording | None = None) -> Read:
    """The document in its schema; raises DocumentRefused with every fault found, at most MAX_PLACES in its order."""
    try:
        return schema.model_validate(document)
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False)
        found.sort(key=lambda fault: fault["type"] != "extra_forbidden" or not preparing.near_key(str(fault["loc"][0])))
        found = found[:MAX_PLACES]
        raise errors.DocumentRefused(tuple(_place(fault, wording or _of_systems(schema)) for fault in found)) from None


def _place(fault: ErrorDetails, wording: Wording) -> errors.Place:
    """The fault in a sentence, which never holds a value of the input."""
    kind, steps = fault["type"], wording.keys(fault["loc"])
    where = f"'{'/'.join(plain_data.escape(step) for step in steps)}'" if steps else wording.whole
    code, expected = "bad-input", f"it must be {_expected(steps, wording.expected)}."
    if kind == "missing":
        sentence = f"The key {where} is missing; {expected}"
    elif kind == "extra_forbidden":
        sentence = wording.unknown(steps, where)
    elif kind.endswith("too_long"):
        code, counted = "limit", "characters" if kind.startswith("string") else "entries"
        sentence = f"{where} is too long: at most {fault['ctx']['max_length']} {counted} are accepted."
    elif kind.endswith("too_short"):
        sentence = f"{where} must not be empty; {expected}"
    else:
        sentence = f"{where} has the wrong type or value; {expected}"
    return errors.Place(sentence, "".join(f"/{plain_data.escape(step)}" for step in steps), None, code)


def _of_systems(schema: type[base.Document]) -> Wording:
    def unknown(steps: Steps, where: str) -> str:
        if steps[0] in BESIDE and "constraints" in schema.model_fields:
            return BESIDE[str(steps[0])]
        if len(steps) == 1 and (meant := preparing.near_key(str(steps[0]))):
            return f"The key {where} is not known here: did you mean '{meant}'?"
        keys = ", ".join((*schema.model_fields, *ALSO))
        return f"The key {where} is not known here; a {TITLES.get(schema.__name__, 'system')} has the keys {keys}."

    return Wording("The document", EXPECTED, unknown, lambda steps: without(steps, NOT_IN_THE_DOCUMENT))


def without(steps: Steps, hidden: Container[Any]) -> Steps:
    """The steps that are keys of the document."""
    return tuple(step for step in steps if step not in hidden)


def _expected(steps: Steps, table: Mapping[Steps, str]) -> str:
    """The entry of the last of the steps that the table contains."""
    path: Steps = ()
    for step in steps:
        further = (*path, "*" if (*path, "*") in table else step)
        if further not in table:
            break
        path = further
    return table[path]
