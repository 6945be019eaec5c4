"""Parts of the OpenAPI description that several routes share."""

from __future__ import annotations

from typing import Any

from inverse_service.service.documents.problem_documents import TITLES
from inverse_service.web.problems import MEDIA_TYPE


def refusals(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The problem documents of a route."""
    return {status: {"description": TITLES.get(status, "Refused"), "content": {MEDIA_TYPE: {}}} for status in statuses}


def answers_of(*schemas: str) -> dict[str, Any]:
    """The answer of a route that has one of several schemas."""
    references = [{"$ref": f"#/components/schemas/{schema}"} for schema in schemas]
    return {"description": "The answer.", "content": {"application/json": {"schema": {"anyOf": references}}}}


def body_of(*schemas: str, others: dict[str, Any] | None = None) -> dict[str, Any]:
    """The body of a route that reads it itself."""
    references = [{"$ref": f"#/components/schemas/{schema}"} for schema in schemas]
    schema = references[0] if len(references) == 1 else {"anyOf": references}
    content = {"application/json": {"schema": schema}} | (others or {})
    return {"requestBody": {"required": True, "content": content}}


# What `Accept` may ask for in the place of JSON.
WRITTEN: dict[str, Any] = {
    name: {"schema": {"type": "string", "description": what}}
    for name, what in (
        ("text/plain", "The result of `solve` as text for people."),
        ("application/x-latex", "The result of `solve` as a LaTeX document."),
        ("text/x-python", "The result of `solve` as a SymPy program."),
    )
}
SOLVED = answers_of("NonholonomicResult", "ResultDocument", "ForwardResult")
SOLVED["content"] |= WRITTEN
PARSED = answers_of("ForwardParseAnswer", "NonholonomicParseAnswer", "ParseAnswer")
OBJECT: dict[str, Any] = {
    "description": "The result.",
    "content": {"application/json": {"schema": {"type": "object"}}},
}
KEY_AND_RATE = refusals(401, 429, 503)
BAD_BODY = refusals(400, 413, 415, 422, 500) | KEY_AND_RATE | refusals(410)
SYSTEM_BODY = body_of("SystemDocument", "NonholonomicDocument", "LagrangianDocument")
JOB_HEADERS = {
    "Location": {"description": "The address of the job.", "schema": {"type": "string"}},
    "Retry-After": {"description": "Seconds until it is worth to ask.", "schema": {"type": "integer"}},
}
TIME_LIMIT = {
    "name": "time_limit",
    "in": "query",
    "required": False,
    "description": "Seconds; at most the limit of the service.",
    "schema": {"type": "number", "exclusiveMinimum": 0},
}
PREFER = {
    "name": "Prefer",
    "in": "header",
    "required": False,
    "description": "respond-async, or wait=S with at most 20 s.",
    "schema": {"type": "string"},
}
BATCH_KEY = {
    "name": "Idempotency-Key",
    "in": "header",
    "required": False,
    "description": "Tells batches of the same lines apart.",
    "schema": {"type": "string", "maxLength": 255},
}
TIME_LIMIT_QUERY = {"parameters": [TIME_LIMIT, PREFER]}
BATCH_PARAMETERS = {"parameters": [TIME_LIMIT, BATCH_KEY]}
