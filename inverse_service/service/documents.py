"""One door for all documents that are solved: which use case a document belongs to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service import checking, nonholonomic, solving, translate
from inverse_service.service.document_kinds import is_nonholonomic
from inverse_service.service.translate_nonholonomic import to_nonholonomic_schema


def solve_document(
    document: Any, options: SolveOptions, progress: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """The result of a System or a Nonholonomic document; see `solving` and `nonholonomic` for what it raises."""
    if is_nonholonomic(document):
        return nonholonomic.solve_nonholonomic(document, options, progress)
    return solving.solve_document(document, options, progress)


def parse_document(document: Any) -> dict[str, Any]:
    """What was understood of a document; raises InputError."""
    if is_nonholonomic(document):
        return nonholonomic.parse_nonholonomic(document)
    return solving.parse_document(document)


def understand_document(document: Any) -> dict[str, Any]:
    """The `system` part of a result; raises InputError."""
    if is_nonholonomic(document):
        return nonholonomic.understand_nonholonomic(document)
    return solving.understand_document(document)


def check_document(text: str) -> dict[str, Any]:
    """The verdict on the text of a result; see `checking.check_document`."""
    return checking.check_document(text)


def look(document: Any) -> None:
    """Raise DocumentRefused where a document has not the shape of one that is solved."""
    if is_nonholonomic(document):
        to_nonholonomic_schema(document)
    else:
        translate.to_schema(document)
