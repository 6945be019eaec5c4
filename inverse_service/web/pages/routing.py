"""All pages as one router: open ones, and those that ask who looks."""

from __future__ import annotations

from fastapi import APIRouter, Depends

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
from inverse_service.web.pages.visitor import note_visitor, require_visitor

router = APIRouter()
router.include_router(assets.router)
for part in (account, calls_page, manual):
    router.include_router(part.router, dependencies=[Depends(note_visitor)])
for part in (solve, results, simulate, paper_figures, gallery, batches, learn):
    router.include_router(part.router, dependencies=[Depends(require_visitor)])

__all__ = ["router"]
