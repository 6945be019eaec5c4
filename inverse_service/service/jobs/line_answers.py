"""One line of the output of a batch, by HTTP and on the command line: the result, or a problem object."""

from __future__ import annotations

import json
from typing import Any

from inverse_service.service.documents.problem_documents import as_bytes, problem_document
from inverse_service.service.jobs.model import BatchAnswer


def answer_line(answer: BatchAnswer) -> bytes:
    """JSON with the `id` and the number of the line in front, and a line feed at the end."""
    if answer.status != "successful" or answer.body is None:
        return error_line(answer.number, answer.identifier, _problem(answer), digest=answer.digest)
    head = line_head(answer)
    result = answer.body.strip()
    inside = result[1:-1].strip() if result[:1] == b"{" else b'"result": ' + result
    return head + (b", " + inside if inside else b"") + b"}\n"


def line_head(answer: BatchAnswer) -> bytes:
    """What stands before the result in its line: the result follows without its first bracket, after a comma."""
    digest = f', "digest": "{answer.digest}"' if answer.digest else ""
    return f'{{"id": {answer.identifier}, "line": {answer.number}{digest}'.encode()


def error_line(
    number: int, identifier: str, problem: dict[str, Any], duplicate_of: int | None = None, digest: str = ""
) -> bytes:
    """A problem document with the id of its line; `error` holds it once more for who looks for that key."""
    told = problem | {"detail": f"Line {number}: {problem['detail']}"}
    line: dict[str, Any] = {"id": json.loads(identifier), "line": number}
    more = {"digest": digest or None, "duplicate_of": duplicate_of}
    line |= {key: value for key, value in more.items() if value is not None}
    return as_bytes(line | told | {"error": told}) + b"\n"


def _problem(answer: BatchAnswer) -> dict[str, Any]:
    if answer.body is None:
        return problem_document(410, "dismissed", "The job of this line was dismissed.")
    found: dict[str, Any] = json.loads(answer.body)
    return found
