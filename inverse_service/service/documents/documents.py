"""One door for all documents that are solved: which use case a document belongs to.

Only the use case that is asked for is imported: the nonholonomic one takes 0.05 s, which a single call notices.
Processes that serve many import all before the first (`tasks.load_engine`).
"""

from __future__ import annotations

import contextlib
import importlib
import logging
import traceback
from collections.abc import Callable
from decimal import Decimal
from typing import Any

from inverse_service.errors import CertificateRefused, InputError
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.answers import undetermined
from inverse_service.service.documents.document_kinds import is_forward, is_motion, is_nonholonomic
from inverse_service.service.documents.preparing import prepared
from inverse_service.service.documents.refusals import DocumentRefused

CHECKING = "inverse_service.service.documents.checking"
FOLDER = "inverse_service.service.documents"
# What ends the mathematics of a document that is well written, and what is said of it then.
REASONS = {
    OverflowError: "A number of the calculation, most often an exponent, has more than 64 bits; nothing was decided.",
    CertificateRefused: "The independent checker refused the certificate of this answer, so there is none; that is a "
    "fault of the program.",
}
ENDED: tuple[type[Exception], ...] = tuple(REASONS)
log = logging.getLogger(__name__)


def solve_document(
    document: Any, options: SolveOptions, progress: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """The result of a document of any kind. Raises InputError for one that cannot be accepted.

    Where the mathematics fails on it the answer is undetermined and says why; `provenance.fault` names the error.
    """
    try:
        found = _called("solve", document, options, progress)
    except ENDED as error:
        if is_forward(document):
            raise
        return _undetermined(document, error, options)
    if isinstance(found.get("system"), dict):
        found["system"]["given"] = _as_given(document)
    return found


def _undetermined(document: Any, error: Exception, options: SolveOptions) -> dict[str, Any]:
    understood = None
    with contextlib.suppress(*ENDED):
        understood = understand_document(document)
    reason = next(text for kind, text in REASONS.items() if isinstance(error, kind))
    result = undetermined(understood, reason, options)
    trace = "".join(traceback.format_exception(error))[-4000:]
    result["provenance"] |= {"fault": type(error).__name__}
    log.error("no verdict: %s", trace)
    return result


def parse_document(document: Any) -> dict[str, Any]:
    """What was understood of a document; raises InputError."""
    return _called("parse", document)


def understand_document(document: Any) -> dict[str, Any]:
    """The `system` part of a result; raises InputError."""
    return {**_called("understand", document), "given": _as_given(document)}


def _as_given(document: Any) -> dict[str, Any]:
    """The document as JSON has it; exact decimals are texts."""
    return {key: _plain(value) for key, value in document.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return str(value) if isinstance(value, Decimal) else value


def _called(verb: str, document: Any, *others: Any) -> dict[str, Any]:
    ready = prepared(document)
    name = _kind(ready.document)
    module = importlib.import_module(f"{FOLDER}.{_MODULES[name]}")
    try:
        found: dict[str, Any] = getattr(module, f"{verb}_{name}")(ready.document, *others)
    except DocumentRefused:
        raise
    except InputError as error:
        raise ready.error(error) from None
    return ready.outward(found)


def _kind(document: Any) -> str:
    if is_motion(document):
        return "motion"
    if is_forward(document):
        return "forward"
    return "nonholonomic" if is_nonholonomic(document) else "document"


_MODULES = {"document": "solving", "nonholonomic": "nonholonomic", "forward": "forward", "motion": "motion"}


def check_document(text: str) -> dict[str, Any]:
    """The verdict on the text of a result; see `checking.check_document`."""
    found: dict[str, Any] = importlib.import_module(CHECKING).check_document(text)
    return found


def proof_document(result: dict[str, Any], form: str, seed: int) -> str:
    """The verdict of a result for another prover; see `proofs.proof_document`."""
    found: str = importlib.import_module(f"{FOLDER}.proofs").proof_document(result, form, seed)
    return found


def look(document: Any) -> None:
    """Raise DocumentRefused where a document has not the shape of one that is solved."""
    plain = prepared(document).document
    match _kind(plain):
        case "forward":
            from inverse_service.service.documents.forward import look_forward

            look_forward(plain)
        case "motion":
            from inverse_service.service.documents.motion import look_motion

            look_motion(plain)
        case "nonholonomic":
            from inverse_service.service.documents.translate_nonholonomic import to_nonholonomic_schema

            to_nonholonomic_schema(plain)
        case _:
            from inverse_service.service.documents.translate import to_schema

            to_schema(plain)
