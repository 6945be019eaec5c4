"""Forms that browsers send: taken from our own pages only, and read by workers where they may be large."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from starlette.requests import Request

from inverse_service.service.jobs.outcome import Outcome
from inverse_service.web.asking import body_of
from inverse_service.web.clients import client_of, is_of_own_page
from inverse_service.web.engine import QUICK_DEADLINE, Engine
from inverse_service.web.pages.form_tasks import form_task
from inverse_service.web.pages.forms import Form, form_of
from inverse_service.web.problems import Refusal

# A key, a button, a colour: read where it stands.
SMALL_FORM = 10_000


async def read_form(request: Request, limit: int) -> Form:
    """The sent form; refuses one of another site (403), too large (413), not written by a browser (400)."""
    form: Form = await read_sent(request, limit, form_task)
    return form


async def read_sent(
    request: Request, limit: int, task: Callable[[bytes, str], Outcome], seconds: float = QUICK_DEADLINE
) -> Any:
    """What a task of `form_tasks` makes of the sent form; refuses as `read_form` does."""
    if not is_of_own_page(request):
        raise Refusal(403, "cross-site", "Forms are taken from the pages of this service only.")
    engine: Engine = request.app.state.engine
    content_type = request.headers.get("content-type", "")
    async with body_of(request, limit) as body:
        if limit <= SMALL_FORM:
            return form_of(body, content_type)
        return await engine.read_body(client_of(request), task, body, content_type, seconds=seconds)
