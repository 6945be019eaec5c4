"""Pictures of the gallery, drawn from scenes that the service runs when they are first looked at.

The figures of section 3 of the paper, a small one of each constrained system, two methods on one path, and sketches.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from inverse_service import catalogue
from inverse_service.web.clients import client_of
from inverse_service.web.engine import Engine
from inverse_service.web.pages.own_calls import call
from inverse_service.web.pages.rendering import can_simulate, sent
from inverse_service.web.pages.result_pages import made, missing, result_address
from inverse_service.web.pages.result_tasks import sketch_task, small_picture_task
from inverse_service.web.pages.scenes import PLANE, scene_document, scene_form

router = APIRouter()
WAIT = "wait=20"
KEPT = {"Cache-Control": "private, max-age=3600"}


def _both(*alphas: str) -> list[dict[str, str]]:
    return [{"method": name, "alpha": alpha} for alpha in alphas for name in ("variational", "nonholonomic")]


DISK = {
    "name": "vertically rolling disk, \u03b1 = 0",
    "system": {"catalogue": "vertically-rolling-disk"},
    "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"},
    "initial": {"positions": {"phi": 0.3, "theta": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "theta": 0.5}},
    "start": "discrete_constraint", "step": 0.2, "time": 25,
    "methods": [*_both("0"), {"method": "modified", "alpha": "0"}, {"method": "exact"}],
    "observe": ["trajectory", "energy", "constraints", "matching_circle"],
}  # fmt: skip
ALPHAS = DISK | {
    "name": "vertically rolling disk, four \u03b1",
    "methods": [{"method": "nonholonomic", "alpha": alpha} for alpha in ("0", "1/3", "1/2", "1")],
    "observe": ["trajectory", "matching_circle"],
}
KNIFE_EDGE = {
    "name": "knife edge, \u03b1 = 0",
    "system": {"catalogue": "knife-edge"},
    "parameters": {"m": 1, "J": 1},
    "initial": {"positions": {"phi": 0.3, "x": 0, "y": 0}, "velocities": {"phi": 1, "x": 0.5}},
    "start": "discrete_constraint", "step": 0.05, "time": 40,
    "methods": [*_both("0"), {"method": "exact"}],
    "observe": ["trajectory", "energy", "constraints", "matching_circle"],
}  # fmt: skip
PARTICLE = {
    "name": "nonholonomic particle, \u03b1 = 0",
    "system": {"catalogue": "nonholonomic-particle"},
    "initial": {"positions": {"x": 0.5, "y": 0, "z": 0}, "velocities": {"x": 1, "y": 1}},
    "start": "discrete_constraint", "step": 0.2, "time": 10,
    "methods": [*_both("0"), {"method": "exact"}],
    "observe": ["trajectory", "energy", "constraints", "error"],
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class PaperFigure:
    """A figure: its scene, and either two coordinates against each other or a series in time."""

    name: str
    title: str
    caption: str
    scene: Mapping[str, Any]
    plane: tuple[str, str] = ("x", "y")
    series: str = ""
    is_to_scale: bool = True


DISK_LINES = "Solid: variational. Dashes: nonholonomic. Pale: exact. Dashes and dots: modified."
LINES = "Solid: variational. Dashes: nonholonomic. Pale: exact."
FIGURES = (
    PaperFigure("disk-paths", "Rolling disk, \u03b1 = 0: paths", DISK_LINES, DISK),
    PaperFigure(
        "disk-energy", "Rolling disk, \u03b1 = 0: energy error", DISK_LINES, DISK, series="energy"
    ),
    PaperFigure(
        "disk-constraints", "Rolling disk, \u03b1 = 0: constraint defect", DISK_LINES, DISK,
        series="constraints",
    ),
    PaperFigure(
        "disk-alphas", "Rolling disk: the nonholonomic path for four \u03b1",
        "Solid: \u03b1 = 0. Dashes: 1/3. Dashes and dots: 1/2. Dots: 1.", ALPHAS,
    ),
    PaperFigure("knife-edge-paths", "Knife edge, \u03b1 = 0: paths", LINES, KNIFE_EDGE),
    PaperFigure(
        "particle-plane", "Nonholonomic particle, \u03b1 = 0: y over x", LINES, PARTICLE, is_to_scale=False
    ),
)  # fmt: skip


@router.get("/gallery/figures/{name}.svg")
async def figure(request: Request, name: str) -> Response:
    """A figure of the paper; its scene is computed once as a job and kept like every answer."""
    found = _figure(name)
    return missing() if found is None else await _drawn(request, found)


@router.get("/gallery/{name}.svg")
async def thumbnail(request: Request, name: str) -> Response:
    """The path of a constrained system by two methods."""
    if name not in catalogue.names("nonholonomic") or not has_thumbnail(name):
        return missing()
    form = scene_form(catalogue.document(name), "", system=name)
    methods = ("nonholonomic", "variational")
    scene = scene_document(replace(form, methods=methods, observe=("trajectory",), steps="300"), {"catalogue": name})
    return await _drawn(request, PaperFigure(name, "", "", scene, plane_of(name)))


@router.get("/gallery/sketches/{name}.svg")
async def sketch(request: Request, name: str) -> Response:
    """A motion of a system that is given by its equations."""
    if name not in catalogue.names():
        return missing()
    engine: Engine = request.app.state.engine
    drawn = await engine.made(client_of(request), sketch_task, name)
    return missing() if drawn is None else sent(drawn, "image/svg+xml", KEPT)


async def _drawn(request: Request, figure: PaperFigure) -> Response:
    answer = await call(request, "POST", "/v1/simulate", dict(figure.scene), {"Prefer": WAIT})
    drawn = None
    if answer.status == 200:
        identifier = result_address(answer).rpartition("/")[2]
        drawn = await made(request, identifier, small_picture_task, figure.series, figure.plane, figure.is_to_scale)
    if drawn is None:
        # Not kept by the browser: the next look at the page asks again.
        return Response(status_code=503, headers={"Retry-After": "5"})
    return sent(drawn, "image/svg+xml", KEPT)


def has_thumbnail(name: str) -> bool:
    """Whether a picture of the system's motion can be drawn."""
    return can_simulate() and len(catalogue.document(name)["coordinates"]) > 1


def plane_of(name: str) -> tuple[str, str]:
    """The coordinates of the picture: x and y, else the last two."""
    coordinates = catalogue.document(name)["coordinates"]
    return PLANE if set(PLANE) <= set(coordinates) else (coordinates[-2], coordinates[-1])


@router.get("/gallery/figures/{name}")
async def opened(request: Request, name: str) -> Response:
    """The page of the scene behind a figure."""
    found = _figure(name)
    if found is None:
        return missing()
    answer = await call(request, "POST", "/v1/simulate", dict(found.scene), {"Prefer": "respond-async"})
    return missing() if answer.is_problem else RedirectResponse(result_address(answer), 303)


def _figure(name: str) -> PaperFigure | None:
    return next((figure for figure in FIGURES if figure.name == name), None)
