"""The calls of the service for people, from its OpenAPI description."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import dataclass
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
    ("Atlas, catalogue, limits", ("/v1/atlas", "/v1/catalogue", "/v1/limits")),
    ("Operation", ("/",)),
)


@dataclass(frozen=True, slots=True)
class Call:
    """One call as OpenAPI describes it, with a line for a shell and a body to try."""

    method: str
    path: str
    about: dict[str, Any]
    address: str

    @property
    def key(self) -> str:
        """Its name on the page."""
        return "call" + re.sub(r"\W+", "-", f"{self.method}{self.path}").rstrip("-")

    @property
    def tried(self) -> str:
        """Where the page sends it."""
        return self.path.replace("{name}", catalogue.names()[0])

    @property
    def paragraphs(self) -> list[str]:
        """What it does; the first says it in a sentence."""
        return [part.replace("\n", " ").strip() for part in self.about.get("description", "").split("\n\n")]

    @property
    def body(self) -> Any:
        """What is sent, None where that is nothing or up to the reader."""
        return BODIES.get(self.path) if self.method == "POST" else None

    @property
    def example(self) -> str:
        """The call with curl, empty where it needs an id."""
        if self.body is not None:
            sent = f"-H 'Content-Type: application/json' -d {shlex.quote(json.dumps(self.body))}"
            return f"curl -s {self.address}{self.path} {sent}"
        is_plain = self.method == "GET" and "{" not in self.tried
        return f"curl -s {self.address}{self.tried}" if is_plain else ""


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
        found[heading] += [Call(method.upper(), path, about, address) for method, about in calls.items()]
    return [(heading, calls) for heading, calls in found.items() if calls]
