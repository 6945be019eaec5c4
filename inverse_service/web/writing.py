"""Results as text, LaTeX or a SymPy program, for those who ask by `Accept`; workers write them."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Mapping

from starlette.requests import Request
from starlette.responses import Response

from inverse_service.service.documents.answers import value_of
from inverse_service.service.documents.latex_page import latex_page
from inverse_service.service.documents.text_page import text_page
from inverse_service.service.jobs.finishing import LIMITS
from inverse_service.service.jobs.model import Job
from inverse_service.service.jobs.opening import stored_answer
from inverse_service.service.jobs.outcome import Outcome
from inverse_service.service.jobs.tasks import guard
from inverse_service.web.clients import client_of
from inverse_service.web.engine import LONG_DEADLINE, Engine
from inverse_service.web.problems import Refusal

MEDIA_TYPES = {"text/plain": "text", "application/x-latex": "latex", "text/x-python": "sympy"}
_QUALITY = re.compile(r";\s*q\s*=\s*([01](?:\.\d{0,3})?)\s*$")


def media_type_of(request: Request) -> str | None:
    """The media type of MEDIA_TYPES that is asked for above JSON; None where JSON is as good."""
    best, quality = None, 0.0
    for part in ",".join(request.headers.getlist("accept")).lower().split(","):
        found = _QUALITY.search(part)
        name, weight = part.partition(";")[0].strip(), float(found[1]) if found else 1.0
        if weight > quality or (weight == quality and name not in MEDIA_TYPES):
            best, quality = name, weight
    return best if best in MEDIA_TYPES else None


async def written_response(
    request: Request, job: Job, engine: Engine, media_type: str, headers: Mapping[str, str]
) -> Response:
    """A solved job in this form; raises Refusal where writing it takes too long."""
    form = MEDIA_TYPES[media_type]
    outcome = await engine.run_quick(
        client_of(request), written_task, engine.store.address, job.id, form, seconds=LONG_DEADLINE
    )
    if outcome.status in LIMITS:
        raise Refusal(503, "busy", "To write this takes too long; take the result as JSON, or try again later.")
    return Response(value_of(outcome), 200, dict(headers), media_type)


def written_task(store: str, id: str, form: str) -> Outcome:
    """A stored result as text, LaTeX or a SymPy program; SymPy is imported in workers only."""
    return guard(_written, json.loads(stored_answer(store, id)[1]), form)


def _written(result: dict[str, object], form: str) -> str:
    if form == "sympy":
        text: str = importlib.import_module("inverse_service.sympy").from_result(result).to_code(form)
        return text
    return text_page(result, True) if form == "text" else latex_page(result, True)
