"""The calls of the service for people, from its OpenAPI description."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse

from inverse_service import catalogue
from inverse_service.web.pages.rendering import page

router = APIRouter()
SYSTEM = {"coordinates": ["x", "y"], "equations": "x'' = -x; y'' = -y"}
SCENE = {
    "system": {"catalogue": "vertically-rolling-disk"},
    "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"},
    "effects": ["constraints"],
    "initial": {"positions": {"phi": 0.1, "theta": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "theta": 1}},
    "step": 0.05,
    "steps": 200,
    "methods": [{"method": "variational", "alpha": 0}, {"method": "exact"}],
    "observe": ["trajectory", "energy"],
}
BODIES: dict[str, Any] = {
    "/v1/parse": SYSTEM,
    "/v1/solve": SYSTEM,
    "/v1/batches": [{"id": "first", **SYSTEM}, {"id": "second", "equations": "x'' = -x'"}],
    "/v1/simulate": SCENE,
    "/v1/work-precision": SCENE,
}
GROUPS = (
    ("Questions", ("/v1/parse", "/v1/solve", "/v1/check")),
    ("Jobs", ("/v1/jobs",)),
    ("Batches", ("/v1/batches",)),
    ("Simulation", ("/v1/simulate", "/v1/work-precision", "/v1/figures")),
    ("Catalogue and limits", ("/v1/catalogue", "/v1/limits")),
    ("Operation", ("/",)),
)


@dataclass(frozen=True, slots=True)
class Call:
    """One call: what it does, its parameters, its answers, and a line for a shell."""

    method: str
    path: str
    summary: str
    details: list[str]
    parameters: list[tuple[str, str, str]]
    answers: list[tuple[str, str]]
    example: str
    body: str

    @property
    def key(self) -> str:
        """Its name on the page."""
        return "call" + re.sub(r"\W+", "-", f"{self.method}{self.path}").rstrip("-")

    @property
    def tried(self) -> str:
        """Where the page sends it."""
        return self.path.replace("{name}", _some_name())


@router.get("/docs")
async def documentation(request: Request) -> HTMLResponse:
    """The calls in groups."""
    description: dict[str, Any] = request.app.openapi()
    address = str(request.base_url).rstrip("/")
    return page("calls.html", active="/docs", groups=groups(description, address))


def groups(description: dict[str, Any], address: str) -> list[tuple[str, list[Call]]]:
    """Each call in the first group whose addresses it begins with."""
    found: dict[str, list[Call]] = {heading: [] for heading, _ in GROUPS}
    for path, calls in description["paths"].items():
        heading = next(heading for heading, starts in GROUPS if path.startswith(starts))
        found[heading] += [_call(method, path, call, address) for method, call in calls.items()]
    return [(heading, calls) for heading, calls in found.items() if calls]


def _call(method: str, path: str, call: dict[str, Any], address: str) -> Call:
    paragraphs = [part.replace("\n", " ").strip() for part in call.get("description", "").split("\n\n")]
    parameters = [
        (
            p["name"],
            {"path": "address", "query": "query", "header": "header"}.get(p["in"], p["in"]),
            p.get("description", ""),
        )
        for p in call.get("parameters", [])
    ]
    answers = [(status, answer.get("description", "")) for status, answer in call.get("responses", {}).items()]
    return Call(
        method.upper(),
        path,
        paragraphs[0],
        paragraphs[1:],
        parameters,
        answers,
        _example(method, path, address),
        json.dumps(BODIES[path], indent=1) if method == "post" and path in BODIES else "",
    )


def _example(method: str, path: str, address: str) -> str:
    if method == "get" and "{" not in path:
        return f"curl -s {address}{path}"
    if method == "post" and path in BODIES:
        body = json.dumps(BODIES[path])
        return f"curl -s {address}{path} -H 'Content-Type: application/json' -d {shlex.quote(body)}"
    if path == "/v1/catalogue/{name}":
        return f"curl -s {address}/v1/catalogue/{_some_name()}"
    return ""


@lru_cache(maxsize=1)
def _some_name() -> str:
    return catalogue.names()[0]
