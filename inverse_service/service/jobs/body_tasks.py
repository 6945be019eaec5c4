"""Bodies of requests, read inside worker processes: bytes in, and out what the service has to keep or to send."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import Any

from inverse_service.errors import InputError
from inverse_service.service.documents import documents
from inverse_service.service.documents.reading import decode, read_json
from inverse_service.service.documents.refusals import DocumentRefused
from inverse_service.service.jobs.asking import request_of
from inverse_service.service.jobs.batch_lines import BatchTerms, batch_lines, lines_of_array, lines_of_ndjson
from inverse_service.service.jobs.model import BatchLine, JobRequest
from inverse_service.service.jobs.options import JobOptions, read_options, split_options
from inverse_service.service.jobs.outcome import Outcome, Place
from inverse_service.service.jobs.tasks import guard

# The code of a place in a body that cannot be read at all; HTTP answers it with 400 and all others with 422.
UNREADABLE = "unreadable"
NO_RESULT = "The body is not a result: send the JSON object that /v1/solve answered."


@dataclass(frozen=True, slots=True)
class AskingTerms:
    """What a request says beside its body: the kind, the server's options, a time limit of its own, who asks."""

    kind: str
    server: JobOptions
    time_limit: float | None
    client: str
    fresh: bool


def ask_task(body: bytes, terms: AskingTerms) -> Outcome:
    """A question to its JobRequest."""
    return guard(_asked, body, terms)


def parse_task(body: bytes) -> Outcome:
    """A System document to the JSON of what was understood."""
    return guard(_parsed, body)


def check_task(body: bytes) -> Outcome:
    """A result or a certificate to the checker's verdict."""
    return guard(_checked, body)


def batch_task(body: bytes, is_array: bool, terms: BatchTerms) -> Outcome:
    """A batch to its lines."""
    return guard(_lines, body, is_array, terms)


def _asked(body: bytes, terms: AskingTerms) -> JobRequest:
    document, given = split_options(_read(body))
    options = read_options(given, terms.server)
    if terms.time_limit is not None:
        options = replace(options, time_limit=terms.time_limit)
    return request_of(terms.kind, document, options, terms.client, fresh=terms.fresh)


def _parsed(body: bytes) -> bytes:
    understood = documents.parse_document(split_options(_read(body))[0])
    return json.dumps(understood, ensure_ascii=False, allow_nan=False).encode()


def _checked(body: bytes) -> Any:
    if not isinstance(_read(body), dict):
        raise InputError(NO_RESULT)
    return documents.check_document(decode(body))


def _lines(body: bytes, is_array: bool, terms: BatchTerms) -> list[BatchLine]:
    return batch_lines(lines_of_array(body) if is_array else lines_of_ndjson(body), terms)


def _read(body: bytes) -> Any:
    try:
        return read_json(body)
    except InputError as error:
        place = Place(error.detail, error.pointer, error.column, UNREADABLE)
        raise DocumentRefused((place,)) from None
