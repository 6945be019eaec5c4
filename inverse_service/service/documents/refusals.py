"""From the schema's complaints to one clear sentence a fault, with its place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import ValidationError

from api_schemas.base import Document
from api_schemas.system import MAX_SERIES_ORDER, TAGS, SystemDocument
from inverse_service.errors import DocumentRefused, Place
from inverse_service.service.documents.reading import escape

Read = TypeVar("Read", bound=Document)
MAX_PLACES = 10
NOT_IN_THE_DOCUMENT = frozenset({*TAGS, "[key]"})
ALSO = ("time", "id", "options")
TITLES = {"NonholonomicDocument": "nonholonomic system", "LagrangianDocument": "Lagrangian"}
EXPECTED = {
    "": "an object with coordinates and equations",
    "lagrangian": "a formula written as text",
    "constraints": """a list of constraints such as ["x' - R*cos(phi)*theta'"], or one text""",
    "associated": '"first", "second", "third", "search" or "any"',
    "multiples": """an object such as {"x": "mu*(x' - R*theta')"}, or a list of such objects""",
    "name": "a text",
    "coordinates": 'a list of names such as ["x", "y"]',
    "equations": "an object of formulas by coordinate, a list of equations or one text",
    "parameters": "a list of names, or an object with values",
    "functions": 'an object such as {"A": ["r1"]}, each function with the coordinates it depends on',
    "time_dependent_lagrangian": "true or false, without quotes",
    "ansatz": """a list of terms such as ["y'^2/x'"]""",
    "series_order": f"an integer from 1 to {MAX_SERIES_ORDER}",
    "special_cases": "true or false, without quotes",
    "clock": 'a formula in the coordinates, such as "1 + x^2"',
    "kinds": """a list such as ["natural", "riemannian", "finsler", "positive_definite", "rayleigh", """
    """"rayleigh_general", {"invariant": ["x"]}]""",
    "near": """an object of numbers such as {"x": "1", "x'": "0"}""",
    "where": """an object of formulas such as {"r": "sqrt(x^2 + y^2)"}""",
    "search": """an object such as {"families": ["products", "ratios"], "depth": 2, "members": 1000}""",
}

# Questions about equations of second order, which a document with constraints does not have.
BESIDE = {
    "kinds": "Kinds of Lagrangians are asked about equations: give those of an associated or of the reduced system, "
    "which the result of this document without 'kinds' has.",
    "clock": "With constraints the clock is found, see 'reduced' of the result: leave 'clock' out, or give the "
    "equations of the reduced system.",
}


def validated(document: Any, schema: type[Read]) -> Read:
    """The document in its schema; raises DocumentRefused with every fault found."""
    try:
        return schema.model_validate(document)
    except ValidationError as error:
        raise DocumentRefused(places_of(error, schema)) from None


def places_of(error: ValidationError, schema: type[Document] = SystemDocument) -> tuple[Place, ...]:
    """At most MAX_PLACES faults in the order of the document, read as `schema`; never a value of the input."""
    found = error.errors(include_url=False, include_input=False, include_context=True)
    return tuple(_place(fault, schema) for fault in found[:MAX_PLACES])


def _place(fault: Mapping[str, Any], schema: type[Document]) -> Place:
    steps = [step for step in fault["loc"] if step not in NOT_IN_THE_DOCUMENT]
    pointer = "".join(f"/{escape(step)}" for step in steps)
    code = "limit" if fault["type"].endswith("too_long") else "bad-input"
    return Place(_sentence(fault, steps, schema), pointer, None, code)


def _sentence(fault: Mapping[str, Any], steps: list[Any], schema: type[Document]) -> str:
    top = str(steps[0]) if steps else ""
    kind, context = fault["type"], fault.get("ctx", {})
    where = f"'{'/'.join(escape(step) for step in steps)}'" if steps else "The document"
    if kind == "missing":
        return f"The key {where} is missing; it must be {EXPECTED.get(top, 'there')}."
    if kind == "extra_forbidden" and top in BESIDE and "constraints" in schema.model_fields:
        return BESIDE[top]
    if kind == "extra_forbidden":
        keys = ", ".join((*schema.model_fields, *ALSO))
        return f"The key {where} is not known here; a {TITLES.get(schema.__name__, 'system')} has the keys {keys}."
    if kind.endswith("too_long"):
        return f"{where} is too long: at most {context['max_length']} {_counted(kind)} are accepted."
    if kind.endswith("too_short"):
        return f"{where} must not be empty; it must be {_expected(steps)}."
    return f"{where} has the wrong type; it must be {_expected(steps)}."


def _counted(kind: str) -> str:
    return "characters" if kind.startswith("string") else "entries"


def _expected(steps: list[Any]) -> str:
    if len(steps) <= 1:
        return EXPECTED.get(str(steps[0]) if steps else "", "a text")
    if steps[0] in ("equations", "ansatz", "constraints", "multiples", "where"):
        return "a formula written as text"
    if steps[0] == "kinds":
        return (
            "one of natural, riemannian, finsler, positive_definite, rayleigh, rayleigh_general"
            if len(steps) == 2
            else 'a list such as ["x", {"y": "x"}]'
        )
    if steps[0] == "parameters":
        return 'a number written as text or as a number, such as "1/2"' if isinstance(steps[1], str) else "a name"
    if steps[0] == "functions" and len(steps) == 2:
        return "a list of the coordinates that the function depends on"
    return "a name"
