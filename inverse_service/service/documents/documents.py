"""One door for all documents that are solved: which use case a document belongs to.

Only the use case that is asked for is imported: the nonholonomic one takes 0.05 s, which a single call notices.
Processes that serve many import all before the first (`tasks.load_engine`).
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.document_kinds import is_nonholonomic

SOLVING = "inverse_service.service.documents.solving"
NONHOLONOMIC = "inverse_service.service.documents.nonholonomic"
CHECKING = "inverse_service.service.documents.checking"


def solve_document(
    document: Any, options: SolveOptions, progress: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """The result of a System or a Nonholonomic document; see `solving` and `nonholonomic` for what it raises."""
    return _called(document, "solve_document", "solve_nonholonomic", options, progress)


def parse_document(document: Any) -> dict[str, Any]:
    """What was understood of a document; raises InputError."""
    return _called(document, "parse_document", "parse_nonholonomic")


def understand_document(document: Any) -> dict[str, Any]:
    """The `system` part of a result; raises InputError."""
    return _called(document, "understand_document", "understand_nonholonomic")


def _called(document: Any, of_system: str, of_motion: str, *others: Any) -> dict[str, Any]:
    module, name = (NONHOLONOMIC, of_motion) if is_nonholonomic(document) else (SOLVING, of_system)
    found: dict[str, Any] = getattr(importlib.import_module(module), name)(document, *others)
    return found


def check_document(text: str) -> dict[str, Any]:
    """The verdict on the text of a result; see `checking.check_document`."""
    found: dict[str, Any] = importlib.import_module(CHECKING).check_document(text)
    return found


def look(document: Any) -> None:
    """Raise DocumentRefused where a document has not the shape of one that is solved."""
    if is_nonholonomic(document):
        from inverse_service.service.documents.translate_nonholonomic import to_nonholonomic_schema

        to_nonholonomic_schema(document)
    else:
        from inverse_service.service.documents.translate import to_schema

        to_schema(document)
