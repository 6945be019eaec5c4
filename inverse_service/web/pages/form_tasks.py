"""Forms read inside worker processes: the fields, the document that they mean, and how it is understood."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from inverse_service import catalogue
from inverse_service.decision.solutions import SolveOptions
from inverse_service.errors import InputError
from inverse_service.service.jobs.model import split_options
from inverse_service.service.jobs.tasks import solve_task
from inverse_service.web.pages import reading_back, sheets
from inverse_service.web.pages.form_documents import document_of, document_of_fields, fields_from, fields_of
from inverse_service.web.pages.forms import Form, form_of
from inverse_service.web.pages.preview import motion_of_result

Fields = dict[str, str]
# How long a person waits for an answer next to a form that they are still filling in, s.
GLANCE = 1.5


@dataclass(frozen=True, slots=True)
class Sent:
    """The solve form as it was sent: its document, or why there is none. `shown` are the fields of that document."""

    fields: Fields
    shown: Fields
    document: dict[str, Any] | None = None
    problem: reading_back.Problem | None = None


def glance_task(body: bytes, content_type: str) -> dict[str, Any] | None:
    """The sent solve form to a short answer, which nobody stores; None where it takes longer than a glance."""
    document = sent_task(body, content_type).document
    return None if document is None else glance_of(document)


def glance_of_fields(fields: Fields) -> dict[str, Any] | None:
    """The same of the fields of a link; None where they cannot be read, too."""
    try:
        return glance_of(document_of_fields(fields))
    except InputError:
        return None


def glance_of(document: Mapping[str, Any]) -> dict[str, Any] | None:
    """The sheet of a document without its proofs, and its motion; None where nothing was settled."""
    found = solve_task(split_options(document)[0], SolveOptions(time_limit=GLANCE))
    sheet = sheets.sheet_of(found, brief=True)
    return None if sheet.verdict == sheets.OPEN else {"sheet": sheet, "motion": motion_of_result(found)}


def sent_task(body: bytes, content_type: str) -> Sent:
    """The sent solve form to what it says."""
    form = form_of(body, content_type)
    fields, example = fields_of(form), form.text("example")
    try:
        document = _example(example) if example else document_of(form)
    except InputError as error:
        return Sent(fields, fields, problem=reading_back.problem_of_error(error, fields))
    is_shown = example or "document" in form.files
    return Sent(fields, fields_from(document) if is_shown else fields, document)


def _example(name: str) -> dict[str, Any]:
    try:
        return catalogue.document(name)
    except InputError:
        raise InputError("The catalogue has no system of this name; /atlas shows them.") from None


def echo_sent_task(body: bytes, content_type: str) -> tuple[Fields, dict[str, Any]]:
    """The sent solve form to its fields and how it is understood."""
    sent = sent_task(body, content_type)
    if sent.document is None:
        return sent.fields, {"problem": sent.problem}
    return sent.fields, _understood(sent.fields, sent.document)


def echo_task(fields: Fields) -> dict[str, Any]:
    """The fields of the solve form to how they are understood."""
    try:
        document = document_of(Form({name: (value,) for name, value in fields.items()}))
    except InputError as error:
        return {"problem": reading_back.problem_of_error(error, fields)}
    return _understood(fields, document)


def _understood(fields: Fields, document: Mapping[str, Any]) -> dict[str, Any]:
    """What /v1/parse says of a document, for the template."""
    typed = any(fields[name] for name in ("equations", "lagrangian", "constraints"))
    if not (typed or document):
        return {}
    from inverse_service.service.documents.documents import parse_document

    try:
        answer = parse_document(split_options(document)[0])
    except InputError as error:
        return {"problem": reading_back.problem_of_error(error, fields)} if typed else {}
    return {"understood": reading_back.understood(answer)}
