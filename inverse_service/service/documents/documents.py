"""One door for all documents that are solved: which use case a document belongs to.

Only the use case that is asked for is imported: the nonholonomic one takes 0.05 s, which a single call notices.
Processes that serve many import all before the first (`tasks.load_engine`).
"""

from __future__ import annotations

import contextlib
import logging
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from api_schemas.base import ParseAnswer
from inverse_service.errors import CertificateRefused, InputError
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.service.documents.answers import undetermined
from inverse_service.service.documents.preparing import Prepared, is_forward, is_motion, is_nonholonomic, prepared

# What ends the mathematics of a document that is well written, and what is said of it then.
REASONS = {
    OverflowError: "A number of the calculation, most often an exponent, has more than 64 bits; nothing was decided.",
    CertificateRefused: "The independent checker refused the certificate of this answer, so there is none; that is a "
    "fault of the program.",
}
Progress = Callable[[Any], None]
ENDED: tuple[type[Exception], ...] = tuple(REASONS)
log = logging.getLogger(__name__)


def solve_document(document: Any, options: SolveOptions, progress: Progress | None = None) -> dict[str, Any]:
    """The result of a document of any kind. Raises InputError for one that cannot be accepted.

    `progress` receives the name of each stage, and as {"so_far": ...} an answer that is confirmed while more is sought.

    Where the mathematics fails on it the answer is undetermined and says why; `provenance.fault` names the error.
    """
    try:
        ready = prepared(document)
        told = None if progress is None else lambda report: progress(_outward(ready, report))
        found = _in_own_words(ready, lambda cases: cases.solve(ready.document, options, told))
    except ENDED as error:
        if is_forward(document):
            raise
        return _undetermined(document, error, options)
    if isinstance(found.get("system"), dict):
        found["system"]["given"] = _as_given(document)
    return found


def _outward(ready: Prepared, report: Any) -> Any:
    return {key: ready.outward(part) for key, part in report.items()} if isinstance(report, dict) else report


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
    ready = prepared(document)
    return _in_own_words(ready, lambda cases: cases.parse(cases.look(ready.document)).model_dump(mode="json"))


def parse_associated(document: Any) -> dict[str, Any] | None:
    """The equations of the associated system that a document asks for; None where it asks for no single one."""
    ready = prepared(document)
    if not is_nonholonomic(ready.document):
        return None
    from inverse_service.service.documents.nonholonomic_documents import parse_associated as associated

    return _in_own_words(ready, lambda cases: associated(cases.look(ready.document)) or {}) or None


def understand_document(document: Any) -> dict[str, Any]:
    """The `system` part of a result; raises InputError."""
    ready = prepared(document)
    return {**_in_own_words(ready, lambda cases: _understood(cases, ready)), "given": _as_given(document)}


def _understood(cases: UseCases, ready: Prepared) -> dict[str, Any]:
    from inverse_service.service.documents.translate import to_understood

    schema = cases.look(ready.document)
    return to_understood(cases.system(schema), schema).model_dump(mode="json")


def _as_given(document: Any) -> dict[str, Any]:
    """The document as JSON has it; exact decimals are texts."""
    from inverse_service.service.documents.translate import plain

    found: dict[str, Any] = plain(document)
    return found


@dataclass(frozen=True, slots=True)
class UseCases:
    """What is done with a document of one kind: read into its schema, answered, parsed, seen as a system, solved."""

    look: Callable[[Any], Any]
    parse: Callable[[Any], ParseAnswer]
    system: Callable[[Any], SecondOrderSystem]
    solve: Callable[[Any, SolveOptions, Progress | None], dict[str, Any]]


def use_cases(document: Any) -> UseCases:
    """Those of the kind that a prepared document is of, imported now."""
    if is_motion(document):
        from inverse_service.service.documents import reduced_documents as reduced

        return UseCases(reduced.look_motion, reduced.parse, reduced.system_of, reduced.solve_motion)
    if is_forward(document):
        from inverse_service.service.documents import forward as alone

        return UseCases(alone.look_forward, alone.parse, alone.system_of, alone.solve_forward)
    if is_nonholonomic(document):
        from inverse_service.service.documents import nonholonomic_documents as held
        from inverse_service.service.documents.translate_nonholonomic import to_nonholonomic_schema as look

        return UseCases(look, held.parse, held.system_of, held.solve_nonholonomic)
    from inverse_service.service.documents import system_documents
    from inverse_service.service.documents.accepting import to_schema, to_system

    return UseCases(to_schema, system_documents.parse, to_system, system_documents.solve_document)


def _in_own_words(ready: Prepared, work: Callable[[UseCases], dict[str, Any]]) -> dict[str, Any]:
    """The answer, or the refusal, in the names that the writer of the document uses."""
    try:
        return ready.outward(work(use_cases(ready.document)))
    except InputError as error:
        raise ready.error(error) from None


def look(document: Any) -> None:
    """Raise DocumentRefused where a document has not the shape of one that is solved."""
    plain = prepared(document).document
    use_cases(plain).look(plain)
