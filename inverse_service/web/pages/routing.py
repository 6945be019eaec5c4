"""All pages as one router: open ones, and those that ask who looks; a mistyped address as a page, not as JSON."""

from __future__ import annotations

from fastapi import APIRouter, Depends
from starlette.requests import Request
from starlette.responses import HTMLResponse

from inverse_service.web.pages import (
    account,
    assets,
    batches,
    calls_page,
    gallery,
    learn,
    manual,
    paper_figures,
    results,
    simulate,
    solve,
)
from inverse_service.web.pages.rendering import note_visitor, note_visitor_of, page, require_visitor
from inverse_service.web.problems import Refusal

router = APIRouter()
router.include_router(assets.router)
for part in (account, calls_page, manual):
    router.include_router(part.router, dependencies=[Depends(note_visitor)])
for part in (solve, results, simulate, paper_figures, gallery, batches, learn):
    router.include_router(part.router, dependencies=[Depends(require_visitor)])

TITLES = {403: "Not from here", 404: "There is nothing here", 405: "Not that way", 413: "That is too large"}
REDIRECTS = range(300, 400)


def page_of_refusal(request: Request, refusal: Refusal) -> HTMLResponse | None:
    """The page, None for a program: calls under /v1, and who does not ask for HTML."""
    if request.url.path.startswith("/v1/") or "text/html" not in request.headers.get("accept", ""):
        return None
    if refusal.status in REDIRECTS:
        return None
    note_visitor_of(request)
    detail = "The address may be mistyped." if refusal.detail.startswith("There is nothing at") else refusal.detail
    title = TITLES.get(refusal.status, "This was refused")
    found = page("missing.html", refusal.status, active="", title=title, detail=detail)
    found.headers.update(refusal.headers)
    return found
