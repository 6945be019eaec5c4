"""The input of a batch: a file, standard input or a .gz, one document a line."""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import io
import json
import sys
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

from inverse_service.errors import InputError, LimitError
from inverse_service.service.documents.answers import as_bytes, of_input_error
from inverse_service.service.documents.plain_data import read_json
from inverse_service.service.jobs.batches import BatchLine
from inverse_service.service.jobs.model import BULK, JobOptions, document_digest, read_options, split_options
from inverse_service.service.jobs.tasks import request_of

MAX_LINE_BYTES = 1_000_000
STANDARD = "-"
Identifier = str | int


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the input; `fault` says why it cannot be solved, else `document` is to be solved.

    `identifier` is its own `id`, or its line number where it has none; None where it is unreadable.
    `raw` are the bytes of a line that is no document.
    """

    number: int
    identifier: Identifier | None
    document: Any = None
    fault: InputError | None = None
    duplicate_of: int | None = None
    raw: bytes = b""

    @property
    def digest(self) -> str:
        """What the line asks, its options included, its id left out: an answer holds only for this."""
        return hashlib.sha256(self.raw).hexdigest() if self.document is None else document_digest(self.document)


def open_source(path: Path) -> contextlib.AbstractContextManager[IO[bytes]]:
    """The input, - for standard input, decompressed where its name ends so; raises InputError."""
    if str(path) == STANDARD:
        if sys.stdin is None:
            raise InputError("Standard input is closed; name a file of one system a line.")
        return contextlib.nullcontext(sys.stdin.buffer)
    try:
        return gzip.open(path) if path.suffix == ".gz" else path.open("rb")  # type: ignore[return-value]
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or "the name is not a file name").lower()
        raise InputError(f"The input {path} cannot be read: {reason}; name a file of one system a line.") from None


def read_lines(stream: IO[bytes]) -> Iterator[Line]:
    """Every line that is not empty, in order; a bad line becomes one with a fault."""
    first_with: dict[Identifier, int] = {}
    for number, data in enumerate(_bounded_lines(stream), 1):
        if data is None:
            fault = InputError(f"The line is longer than {MAX_LINE_BYTES} bytes; give this system alone to 'solve'.")
            yield Line(number, None, fault=fault)
        elif data.strip():
            yield marked(_read_line(number, data), first_with)


def read_answers(stream: IO[bytes]) -> Iterator[tuple[Line, dict[str, Any]]]:
    """The lines of a batch's output with their answers, ids included, which may be null; InputError for others."""
    for line in read_lines(stream):
        answer = {**line.document, "id": line.identifier} if line.document is not None else None
        if line.fault and line.raw[:1] == b"{":
            answer = read_json(line.raw)
        if not isinstance(answer, dict) or not {"format", "error"} & answer.keys():
            raise InputError(f"Line {line.number} is not an answer of a batch.")
        yield line, answer


def count_lines(path: Path) -> int | None:
    """How many lines there are, empty ones included; None for what can be read only once."""
    if not path.is_file():
        return None
    with open_source(path) as stream:
        return sum(1 for _ in _bounded_lines(stream))


def _read_line(number: int, data: bytes) -> Line:
    try:
        value = read_json(data.rstrip())  # a fault at its end is on this line
    except InputError as error:
        return Line(number, None, fault=error, raw=data.strip())
    return replace(line_of(number, value), raw=data.strip())


def line_of(number: int, value: Any) -> Line:
    """A line from its JSON value: a document with an `id` of its own or not."""
    if not isinstance(value, dict):
        fault = InputError("The line must be a JSON object with coordinates and equations.")
        return Line(number, None, fault=fault)
    document = {key: part for key, part in value.items() if key != "id"}
    identifier = value.get("id", number)
    if isinstance(identifier, bool) or not isinstance(identifier, str | int) or len(str(identifier)) > 200:
        return Line(number, None, fault=InputError("The id must be a text or an integer of at most 200 characters."))
    return Line(number, identifier, document)


def marked(line: Line, first_with: dict[Identifier, int]) -> Line:
    """The line, with a fault where its id was used before; `first_with` remembers the ids."""
    if line.identifier is None:
        return line
    first = first_with.setdefault(line.identifier, line.number)
    if first == line.number:
        return line
    fault = InputError(f"The id of this line was used on line {first} already; give each line its own.", "/id")
    return replace(line, fault=fault, duplicate_of=first)


def _bounded_lines(stream: IO[bytes]) -> Iterator[bytes | None]:
    try:
        while data := stream.readline(MAX_LINE_BYTES + 1):
            if len(data) <= MAX_LINE_BYTES or data.endswith(b"\n"):
                yield data
                continue
            while data and not data.endswith(b"\n"):
                data = stream.readline(MAX_LINE_BYTES)
            yield None
    except (OSError, EOFError, zlib.error) as error:  # OSError: BadGzipFile too
        reason = getattr(error, "strerror", None) or "the compressed data are damaged or end too early"
        raise InputError(f"The input cannot be read to its end: {reason.lower()}.") from None


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


def lines_of_array(values: Any) -> Iterator[Line]:
    """Every element of a JSON array, numbered from 1. Raises InputError where it is no array."""
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
        found.append(batch_line(line, terms))
    if not found:
        raise InputError("The batch is empty; send one document a line.")
    return found


def batch_line(line: Line, terms: BatchTerms) -> BatchLine:
    """A line as its question, or as the problem document of one that is none."""
    identifier = json.dumps(line.identifier)
    try:
        if line.fault is not None:
            raise line.fault
        document, given = split_options(line.document)
        options = terms.options if given is None else read_options(given, terms.server)
        request = request_of(terms.kind, document, options, terms.client, BULK, terms.fresh)
    except InputError as error:
        return BatchLine(line.number, identifier, problem=as_bytes(of_input_error(error)))
    return BatchLine(line.number, identifier, request)
