"""The two files of a batch: lines in, lines out, and where an interrupted run goes on."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from inverse_service.errors import InputError
from inverse_service.service.documents.reading import read_json

MAX_LINE_BYTES = 1_000_000
Identifier = str | int


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the input; `fault` says why it cannot be solved, else `document` is to be solved.

    `identifier` is its own `id`, or its line number where it has none; None where it is unreadable.
    """

    number: int
    identifier: Identifier | None
    document: Any = None
    fault: InputError | None = None
    duplicate_of: int | None = None

    @property
    def key(self) -> str:
        """What an answer is found by when the batch is started again."""
        return answer_key({"id": self.identifier, "line": self.number, "duplicate_of": self.duplicate_of})


def answer_key(answer: dict[str, Any]) -> str:
    """By id; by line number for a line without a readable id or with the id of another line."""
    if answer.get("id") is None or answer.get("duplicate_of") is not None:
        return f"line {answer.get('line')}"
    return f"id {json.dumps(answer['id'])}"


def read_lines(stream: IO[bytes]) -> Iterator[Line]:
    """Every line that is not empty, in order; a bad line becomes one with a fault."""
    first_with: dict[Identifier, int] = {}
    for number, data in enumerate(_bounded_lines(stream), 1):
        if data is None:
            fault = InputError(f"The line is longer than {MAX_LINE_BYTES} bytes; give this system alone to 'solve'.")
            yield Line(number, None, fault=fault)
        elif data.strip():
            yield marked(_read_line(number, data), first_with)


def count_lines(path: Path) -> int:
    """How many lines there are, for the progress bar; empty ones included."""
    with path.open("rb") as stream:
        return sum(1 for _ in _bounded_lines(stream))


def finished_keys(path: Path) -> set[str]:
    """The keys of all answers in an output file, a half-written last line cut off.

    Raises InputError where the file is not the output of a batch, so that nothing is spoilt.
    """
    if not path.exists():
        return set()
    keys, whole = set(), 0
    with path.open("r+b") as stream:
        for number, data in enumerate(stream, 1):
            if not data.endswith(b"\n"):
                break
            keys.add(_key_in_output(data, number))
            whole += len(data)
        stream.truncate(whole)
    return keys


def _key_in_output(data: bytes, number: int) -> str:
    answer = None
    with contextlib.suppress(ValueError, RecursionError):
        answer = json.loads(data)
    if not isinstance(answer, dict) or "line" not in answer or "id" not in answer:
        raise InputError(f"Line {number} of the output file is not an answer of a batch; choose another file.")
    return answer_key(answer)


def _read_line(number: int, data: bytes) -> Line:
    try:
        value = read_json(data)
    except InputError as error:
        return Line(number, None, fault=error)
    return line_of(number, value)


def line_of(number: int, value: Any) -> Line:
    """A line from its JSON value: a document with an `id` of its own or not."""
    if not isinstance(value, dict):
        fault = InputError("The line must be a JSON object with coordinates and equations.")
        return Line(number, None, fault=fault)
    document = {key: part for key, part in value.items() if key != "id"}
    identifier = value.get("id", number)
    if isinstance(identifier, bool) or not isinstance(identifier, str | int) or len(str(identifier)) > 200:
        return Line(number, None, fault=InputError("The id must be a text or whole number of at most 200 characters."))
    return Line(number, identifier, document)


def marked(line: Line, first_with: dict[Identifier, int]) -> Line:
    """The line, with a fault where its id was used before; `first_with` remembers the ids."""
    if line.identifier is None:
        return line
    first = first_with.setdefault(line.identifier, line.number)
    if first == line.number:
        return line
    fault = InputError(f"The id of this line was used on line {first} already; give each line its own.", "/id")
    return Line(line.number, line.identifier, fault=fault, duplicate_of=first)


def _bounded_lines(stream: IO[bytes]) -> Iterator[bytes | None]:
    while data := stream.readline(MAX_LINE_BYTES + 1):
        if len(data) <= MAX_LINE_BYTES or data.endswith(b"\n"):
            yield data
            continue
        while data and not data.endswith(b"\n"):
            data = stream.readline(MAX_LINE_BYTES)
        yield None
