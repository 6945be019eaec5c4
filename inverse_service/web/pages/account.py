"""Logging in with an API key, logging out, and the colours of the pages: what a browser is asked to remember."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from inverse_service.web.clients import COOKIE, LARGEST_KEY, cookie_of_key
from inverse_service.web.engine import Engine
from inverse_service.web.pages.calls import SMALL_FORM, read_form
from inverse_service.web.pages.rendering import THEME_COOKIE, THEMES, local_address, page

router = APIRouter()
A_YEAR = 365 * 86_400


@router.get("/login")
async def login_form(request: Request) -> Response:
    """The form for a key; the start page where no keys are asked for."""
    if not _engine(request).keys.are_asked:
        return RedirectResponse("/", 303)
    return _form(local_address(request.query_params.get("next", "/")))


@router.post("/login")
async def login(request: Request) -> Response:
    """The key, checked as in the header, kept in a cookie until the browser is closed."""
    sent = await read_form(request, SMALL_FORM)
    place, key = local_address(sent.text("next")), sent.text("key")
    if len(key) > LARGEST_KEY or _engine(request).keys.client_of(key) is None:
        return _form(place, "This key is not known here.", 401)
    answer = RedirectResponse(place, 303)
    answer.set_cookie(COOKIE, cookie_of_key(key), httponly=True, samesite="strict", secure=_is_secure(request))
    return answer


@router.post("/logout")
async def logout(request: Request) -> Response:
    """The cookie taken back."""
    await read_form(request, SMALL_FORM)
    answer = RedirectResponse("/login", 303)
    answer.delete_cookie(COOKIE, httponly=True, samesite="strict", secure=_is_secure(request))
    return answer


@router.post("/theme")
async def theme(request: Request) -> Response:
    """Light, dark, or as the system says; remembered for a year."""
    sent = await read_form(request, SMALL_FORM)
    answer = RedirectResponse(local_address(sent.text("back")), 303)
    if sent.text("theme") in THEMES:
        answer.set_cookie(THEME_COOKIE, sent.text("theme"), max_age=A_YEAR, samesite="lax", secure=_is_secure(request))
    else:
        answer.delete_cookie(THEME_COOKIE, samesite="lax", secure=_is_secure(request))
    return answer


def _form(place: str, problem: str = "", status: int = 200) -> HTMLResponse:
    return page("login.html", status, active="", place=place, problem=problem)


def _engine(request: Request) -> Engine:
    found: Engine = request.app.state.engine
    return found


def _is_secure(request: Request) -> bool:
    return request.url.scheme == "https"
