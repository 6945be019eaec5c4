"""All pages as one router: open pages, pages that require a key, logging in and out, and the colors.

A mistyped address has a page, not JSON.
"""

from fastapi import APIRouter, Depends
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from inverse_service.service.documents import answers
from inverse_service.web import clients, engine, problems
from inverse_service.web.pages import exercises, library, rendering, results, simulate, solve

router = APIRouter()
account = APIRouter()
TITLES = answers.TITLES | {403: "Forbidden", 404: "Nothing here", 422: "There is a problem with your input"}
REDIRECTS = range(300, 400)
A_YEAR = 365 * 86_400


def page_of_refusal(request: Request, refusal: problems.Refusal) -> HTMLResponse | None:
    """The page; None for a program, which calls /v1 or does not accept HTML."""
    if request.url.path.startswith("/v1/") or "text/html" not in request.headers.get("accept", ""):
        return None
    if refusal.status in REDIRECTS:
        return None
    rendering.note_visitor_of(request)
    detail = "The address may be mistyped." if refusal.detail.startswith("There is nothing at") else refusal.detail
    title = TITLES.get(refusal.status, "This was refused")
    found = rendering.page("missing.html", refusal.status, active="", title=title, detail=detail)
    found.headers.update(refusal.headers)
    return found


@account.get("/login")
async def login_form(request: Request) -> Response:
    """The form for a key; the start page if no keys are required."""
    if not _engine(request).keys.are_asked:
        return RedirectResponse("/", 303)
    return _form(rendering.local_address(request.query_params.get("next", "/")))


@account.post("/login")
async def login(request: Request) -> Response:
    """The key, checked as in the header, kept in a cookie until the browser is closed."""
    sent = await results.read_form(request, results.SMALL_FORM)
    place, key = rendering.local_address(sent.text("next")), sent.text("key")
    if len(key) > clients.LARGEST_KEY or _engine(request).keys.client_of(key) is None:
        return _form(place, "This key is not known here.", 401)
    answer = RedirectResponse(place, 303)
    answer.set_cookie(
        clients.COOKIE, clients.cookie_of_key(key), httponly=True, samesite="strict", secure=_is_secure(request)
    )
    return answer


@account.post("/logout")
async def logout(request: Request) -> Response:
    """The cookie taken back."""
    await results.read_form(request, results.SMALL_FORM)
    answer = RedirectResponse("/login", 303)
    answer.delete_cookie(clients.COOKIE, httponly=True, samesite="strict", secure=_is_secure(request))
    return answer


@account.post("/theme")
async def theme(request: Request) -> Response:
    """Light, dark, or as the system says; remembered for a year."""
    sent = await results.read_form(request, results.SMALL_FORM)
    answer = RedirectResponse(rendering.local_address(sent.text("back")), 303)
    if sent.text("theme") in rendering.THEMES:
        answer.set_cookie(
            rendering.THEME_COOKIE, sent.text("theme"), max_age=A_YEAR, samesite="lax", secure=_is_secure(request)
        )
    else:
        answer.delete_cookie(rendering.THEME_COOKIE, samesite="lax", secure=_is_secure(request))
    return answer


@account.get("/robots.txt")
async def robots() -> Response:
    """Pages may be read by all; answers to single questions are not a site's content."""
    return Response("User-agent: *\nDisallow: /results/\nDisallow: /v1/\n", media_type="text/plain")


@account.get("/favicon.ico")
async def favicon() -> Response:
    """The icon under the name that browsers request by default."""
    return RedirectResponse(rendering.address("icon.svg"), 301, {"Cache-Control": "public, max-age=86400"})


def _form(place: str, problem: str = "", status: int = 200) -> HTMLResponse:
    return rendering.page("login.html", status, active="", place=place, problem=problem)


def _engine(request: Request) -> engine.Engine:
    found: engine.Engine = request.app.state.engine
    return found


def _is_secure(request: Request) -> bool:
    return request.url.scheme == "https"


router.get("/static/{asked}/{name}")(rendering.static)
for part in (account, library.open_router):
    router.include_router(part, dependencies=[Depends(rendering.note_visitor)])
for pages in (solve, exercises, results, simulate, library):
    router.include_router(pages.router, dependencies=[Depends(rendering.require_visitor)])
