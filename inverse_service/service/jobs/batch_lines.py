"""The lines of a batch as they are sent: NDJSON or a JSON array, bad lines among them."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from inverse_service.errors import InputError, LimitError
from inverse_service.service.documents.problem_documents import as_bytes, of_input_error
from inverse_service.service.documents.reading import read_json
from inverse_service.service.jobs.asking import request_of
from inverse_service.service.jobs.batch_files import Line, line_of, marked, read_lines
from inverse_service.service.jobs.model import BULK, BatchLine
from inverse_service.service.jobs.options import JobOptions, read_options, split_options


@dataclass(frozen=True, slots=True)
class BatchTerms:
    """What holds for all lines: kind, options of a line that has none, who asks, how many there may be."""

    kind: str
    options: JobOptions
    server: JobOptions
    client: str
    most: int
    fresh: bool


def lines_of_ndjson(body: bytes) -> Iterator[Line]:
    """Every line that is not empty; a bad one has a fault."""
    return read_lines(io.BytesIO(body))


def lines_of_array(body: bytes) -> Iterator[Line]:
    """Every element of a JSON array, numbered from 1. Raises InputError where the body is no array."""
    values = read_json(body)
    if not isinstance(values, list):
        raise InputError("The batch must be a JSON array of documents; one document alone goes to POST /v1/solve.")
    first_with: dict[str | int, int] = {}
    return (marked(line_of(number, value), first_with) for number, value in enumerate(values, 1))


def batch_lines(lines: Iterable[Line], terms: BatchTerms) -> list[BatchLine]:
    """The lines as the store takes them. Raises LimitError for too many, InputError for none."""
    found: list[BatchLine] = []
    for line in lines:
        if len(found) >= terms.most:
            raise LimitError(f"The batch has more than {terms.most} lines; send it in parts.")
        found.append(_batch_line(line, terms))
    if not found:
        raise InputError("The batch is empty; send one document a line.")
    return found


def _batch_line(line: Line, terms: BatchTerms) -> BatchLine:
    identifier = json.dumps(line.identifier)
    try:
        if line.fault is not None:
            raise line.fault
        document, options = _document_and_options(line.document, terms.options, terms.server)
        request = request_of(terms.kind, document, options, terms.client, BULK, terms.fresh)
    except InputError as error:
        return BatchLine(line.number, identifier, problem=as_bytes(of_input_error(error)))
    return BatchLine(line.number, identifier, request)


def _document_and_options(value: Any, options: JobOptions, server: JobOptions) -> tuple[Any, JobOptions]:
    document, given = split_options(value)
    return document, options if given is None else read_options(given, server)
