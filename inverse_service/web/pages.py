"""Plain HTML, written by the server, without scripts: a form, its answer, and the list of calls."""

from __future__ import annotations

from html import escape
from typing import Any
from urllib.parse import parse_qs

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from inverse_service.errors import InputError
from inverse_service.web.bodies import read_body
from inverse_service.web.engine import Engine
from inverse_service.web.problems import Refusal

router = APIRouter()
STYLE = """
body { font: 1rem/1.5 system-ui, sans-serif; max-width: 46rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
label { display: block; margin-top: 1rem; font-weight: 600; }
input, textarea { font: 1rem monospace; width: 100%; box-sizing: border-box; padding: .4rem; }
button { margin-top: 1rem; font-size: 1rem; padding: .5rem 1.5rem; }
pre, code { background: #f3f3f3; padding: .1rem .3rem; overflow-x: auto; }
.error { border-left: .3rem solid #b00; padding-left: .8rem; }
"""
VERDICTS = {
    "variational": "Variational: a regular Lagrangian exists.",
    "not_variational": "Not variational: no regular Lagrangian exists.",
    "undetermined": "Undetermined.",
}
FIELDS = ("coordinates", "equations", "parameters")


@router.get("/style.css")
async def style() -> Response:
    """The one style sheet."""
    return Response(STYLE, media_type="text/css", headers={"Cache-Control": "max-age=3600"})


@router.get("/")
async def form() -> HTMLResponse:
    """The form with an example in it."""
    return page("Is it variational?", form_html({"coordinates": "x, y", "equations": "x'' = -x; y'' = -y"}))


@router.post("/")
async def answer(request: Request) -> HTMLResponse:
    """The form as it was sent, with the answer or what to change."""
    engine: Engine = request.app.state.engine
    fields = read_fields(await read_body(request, engine.settings.max_body))
    try:
        result = await engine.solve(document_of(fields), engine.settings.time_limit)
    except InputError as error:
        column = f", column {error.column}" if error.column is not None else ""
        place = f"{error.pointer}{column}: " if error.pointer else ""
        return page(
            "Please change this", f'<p class="error">{escape(place + error.detail)}</p>{form_html(fields)}', 422
        )
    return page(VERDICTS[result["verdict"]], result_html(result) + form_html(fields))


@router.get("/docs")
async def documentation(request: Request) -> HTMLResponse:
    """The calls, from the OpenAPI description; nothing is loaded from elsewhere."""
    description: dict[str, Any] = request.app.openapi()
    rows = "".join(
        f"<h2><code>{method.upper()} {escape(path)}</code></h2><p>{escape(call.get('description', ''))}</p>"
        for path, calls in description["paths"].items()
        for method, call in calls.items()
    )
    link = '<p>The whole description for programs is <a href="/openapi.json">/openapi.json</a>.</p>'
    return page("The calls of the service", link + rows)


def page(title: str, body: str, status: int = 200) -> HTMLResponse:
    """A whole page; `body` is HTML whose texts are escaped already."""
    head = f'<meta charset="utf-8"><title>{escape(title)}</title><link rel="stylesheet" href="/style.css">'
    footer = '<hr><p><a href="/">The form</a> | <a href="/docs">The calls</a></p>'
    return HTMLResponse(
        f'<!doctype html><html lang="en"><head>{head}</head><body><h1>{escape(title)}</h1>{body}{footer}</body></html>',
        status,
    )


def form_html(fields: dict[str, str]) -> str:
    """The form, filled in."""
    value = {name: escape(fields.get(name, ""), quote=True) for name in FIELDS}
    return (
        '<form method="post" action="/">'
        f'<label for="c">Coordinates</label><input id="c" name="coordinates" value="{value["coordinates"]}">'
        f'<label for="e">Equations</label><textarea id="e" name="equations" rows="6">{value["equations"]}</textarea>'
        f'<label for="p">Parameters</label><input id="p" name="parameters" value="{value["parameters"]}">'
        "<button>Decide</button></form>"
    )


def result_html(result: dict[str, Any]) -> str:
    """Verdict, Lagrangian, Hamiltonian and steps as a list of texts."""
    parts = [result["reason"]]
    for label, key in (("L", "lagrangian"), ("H", "hamiltonian")):
        if result[key] is not None:
            parts.append(f"{label} = {result[key]['text']}")
    if result["verdict_with_time"] is not None:
        parts.append(f"With L(t, q, q') allowed: {VERDICTS[result['verdict_with_time']]}")
    if result["checked"] is not None:
        parts.append(f"Independent check of the certificate: {result['checked']}")
    parts += [step["text"] for step in result["explanation"]]
    return "".join(f"<p>{escape(part)}</p>" for part in parts if part)


def read_fields(body: bytes) -> dict[str, str]:
    """The fields of a sent form; unknown ones are left out."""
    try:
        found = parse_qs(body.decode("ascii"), max_num_fields=20, errors="strict", keep_blank_values=True)
    except ValueError:
        raise Refusal(400, "unreadable", "The form was not sent as a browser sends it.") from None
    return {name: found[name][0] for name in FIELDS if name in found}


def document_of(fields: dict[str, str]) -> dict[str, Any]:
    """The System document of a form."""
    names = {name: [part.strip() for part in fields.get(name, "").split(",") if part.strip()] for name in FIELDS}
    return {
        "coordinates": names["coordinates"] or None,
        "equations": fields.get("equations", "").replace("\r\n", "\n").strip(),
        "parameters": names["parameters"],
    }
