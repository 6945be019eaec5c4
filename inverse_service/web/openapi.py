"""The OpenAPI description: what is accepted and answered, also by routes that read their bodies
themselves.

What follows from no model is in `openapi.json`, as the description has it.
"""

import copy
import inspect
import json
from collections.abc import Iterator
from importlib import resources
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from api_schemas.base import ParseAnswer, ProblemDocument
from api_schemas.job import (
    BatchProblem,
    CheckedDocument,
    JobEvent,
    JobOptions,
    JobResult,
    SolveResult,
)
from api_schemas.result import (
    ForwardParseAnswer,
    ForwardResult,
    NonholonomicParseAnswer,
    NonholonomicResult,
    ResultDocument,
)
from api_schemas.scene import SceneDocument
from api_schemas.simulation import SimulationResult, WorkPrecisionResult
from api_schemas.system import LagrangianDocument, NonholonomicDocument, SystemDocument
from inverse_service import catalogue
from inverse_service.service.documents.answers import TITLES
from inverse_service.web.problems import MEDIA_TYPE

REFERENCE = "#/components/schemas/{model}"
DOCUMENTS = ("SystemDocument", "NonholonomicDocument", "LagrangianDocument")
ASKED = (SystemDocument, NonholonomicDocument, LagrangianDocument)
ANSWERED = (ResultDocument, ForwardResult, ParseAnswer, NonholonomicParseAnswer, ForwardParseAnswer)
UNIONS = (SolveResult, JobResult, JobEvent, CheckedDocument, JobOptions)
OTHERS = (SceneDocument, SimulationResult, WorkPrecisionResult, ProblemDocument, BatchProblem)
EXAMPLES = {"SystemDocument": "sho", "NonholonomicDocument": "vertically-rolling-disk"}


def _read(package: str, name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(
        resources.files(package).joinpath(name).read_text(encoding="utf-8")
    )
    return found


PARTS = _read("inverse_service.web", "openapi.json")


def refusals(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The problem documents of a route."""
    return {
        status: {"description": TITLES.get(status, "Refused"), "content": {MEDIA_TYPE: {}}}
        for status in statuses
    }


def any_of(*names: str) -> dict[str, Any]:
    """One of these schemas."""
    references = [{"$ref": REFERENCE.format(model=name)} for name in names]
    return references[0] if len(references) == 1 else {"anyOf": references}


def answer(schema: dict[str, Any]) -> dict[str, Any]:
    """The answer of a route that does not name its model."""
    return {"description": "The answer.", "content": {"application/json": {"schema": schema}}}


def body_of(*names: str) -> dict[str, Any]:
    """The body of a route that reads it itself."""
    return {
        "requestBody": {
            "required": True,
            "content": {"application/json": {"schema": any_of(*names)}},
        }
    }


SOLVED = answer(any_of("SolveResult"))
PARSED = answer(any_of("ForwardParseAnswer", "NonholonomicParseAnswer", "ParseAnswer"))
KEY_AND_RATE = refusals(401, 429, 503)
UNKNOWN = refusals(404) | KEY_AND_RATE
BAD_BODY = refusals(400, 413, 415, 422, 500) | KEY_AND_RATE | refusals(410)
SYSTEM_BODY = body_of(*DOCUMENTS)
JOB_HEADERS = PARTS["job_headers"]
TIME_LIMIT_QUERY = {"parameters": [PARTS["time_limit"], PARTS["prefer"], PARTS["key"]]}
BATCH_BODY = {"requestBody": PARTS["batch_body"]} | TIME_LIMIT_QUERY


def description_of(app: FastAPI) -> dict[str, Any]:
    """The whole description, made once."""
    if app.openapi_schema is None:
        found = get_openapi(
            title=app.title, version=app.version, summary=app.summary, routes=app.routes
        )
        found["info"] |= PARTS["info"]
        found |= PARTS["whole"]
        components = found.setdefault("components", {})
        components["schemas"] = _schemas(components.get("schemas", {}))
        components["securitySchemes"] = PARTS["securitySchemes"]
        _finish_operations(found["paths"])
        # What each field is, by its name, or by Model.name where that means another thing.
        described = _read("api_schemas", "descriptions.json")
        for holder in _objects(found):
            for name, part in holder["properties"].items():
                own = described.get(f"{holder.get('title')}.{name}")
                part.setdefault("description", own or described.get(name, ""))
        app.openapi_schema = found
    return app.openapi_schema


def _schemas(known: dict[str, Any]) -> dict[str, Any]:
    """All schemas, with the keys that are taken from every document and a description of every
    property.
    """
    for model in (*ASKED, *ANSWERED, *OTHERS, *UNIONS):
        # A result about a motion on constraints has all keys that there are.
        whole = NonholonomicResult if model is ResultDocument else model
        schema = whole.model_json_schema(ref_template=REFERENCE)
        schema |= {"title": model.__name__, "description": inspect.getdoc(model)}
        if model in (*ASKED, SceneDocument, JobOptions):
            _without_defaults(schema)
        parts = schema.pop("$defs", {})
        known.update(
            {name: parts[name] for name in parts if model not in UNIONS or name not in known}
        )
        known[model.__name__] = schema
    for model in ASKED:
        known[model.__name__]["properties"] |= copy.deepcopy(PARTS["keys_of_documents"])
        known[model.__name__]["patternProperties"] = {"^_": {}}
    scene = known["SceneDocument"]["properties"]
    # A system written out is any object, so that more than one of these may fit.
    scene["system"] = {"anyOf": scene["system"].pop("oneOf")}
    for name, example in EXAMPLES.items():
        known[name]["examples"] = [catalogue.document(example)]
    for model in ANSWERED:
        known[model.__name__]["properties"] |= {
            "document_id": dict(PARTS["keys_of_documents"]["id"]),
            "metadata": {},
        }
        # Its older name `id` is not described, so that an answer with an `id` is a job.
        known[model.__name__].pop("additionalProperties")
    for place in known["JobResult"]["discriminator"]["mapping"].values():
        result = known[place.rpartition("/")[2]]
        result["required"] = sorted({*result["required"], "format"})
    known["Job"]["properties"]["result"] = {"anyOf": [any_of("JobResult"), {"type": "null"}]}
    for name in ("HTTPValidationError", "ValidationError", "BranchPart"):
        known.pop(name, None)
    return known


def _without_defaults(schema: dict[str, Any]) -> None:
    """What has a default need not be sent; generators take a default for a promise that it is
    there.
    """
    for holder in _objects(schema):
        for part in holder["properties"].values():
            part.pop("default", None)


def _objects(value: Any) -> Iterator[dict[str, Any]]:
    """Every schema with properties."""
    if isinstance(value, dict):
        if isinstance(value.get("properties"), dict):
            yield value
        for part in value.values():
            yield from _objects(part)
    elif isinstance(value, list):
        for part in value:
            yield from _objects(part)


def _finish_operations(paths: dict[str, Any]) -> None:
    """What a call does, tags, and problem documents as the only kind of error."""
    for call in [call for methods in paths.values() for call in methods.values()]:
        call.setdefault("tags", ["operations"])
        call["summary"] = str(call["description"]).split("\n")[0].removesuffix(".")
        for status, answer in call["responses"].items():
            if status[0] in "45":
                answer["content"] = {MEDIA_TYPE: {"schema": any_of("ProblemDocument")}}
