"""Pages written by the server; they work without scripts, and a small script makes them live."""

from __future__ import annotations

from fastapi import APIRouter

from inverse_service.web.pages import assets, batches, calls_page, gallery, learn, results, simulate, solve, thumbnails

router = APIRouter()
for part in (assets, solve, results, simulate, thumbnails, gallery, batches, learn, calls_page):
    router.include_router(part.router)

__all__ = ["router"]
