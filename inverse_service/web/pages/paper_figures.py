"""Pictures of the gallery, drawn from scenes that the service runs when they are first looked at.

The figures of section 3 of the paper, and a small one of each constrained system: two methods on one path.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from inverse_service import catalogue
from inverse_service.web.pages.calls import call
from inverse_service.web.pages.figures import SERIES, columns_of, series
from inverse_service.web.pages.plots import PlotLine, plot
from inverse_service.web.pages.rendering import can_simulate, sent
from inverse_service.web.pages.results import missing, result_address
from inverse_service.web.pages.scenes import PLANE, scene_document, scene_form

router = APIRouter()
WAIT = "wait=20"
MOST_POINTS = 200
TRUE_LOOK = ("#9aa3b2", "", 5.0)
# Told apart by colour and by dashes, on light and on dark; by the method's place among those that are not the truth.
LOOKS = (("#3b82d0", "", 2.0), ("#d9772b", "7 4", 2.0), ("#2f9e6e", "2 4", 2.0), ("#b5659b", "9 3 2 3", 2.0))


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


LINES = "Solid: variational. Dashes: nonholonomic. Pale: exact."
FIGURES = (
    PaperFigure("disk-paths", "Rolling disk, \u03b1 = 0: paths", f"{LINES} Dots: modified.", DISK),
    PaperFigure(
        "disk-energy", "Rolling disk, \u03b1 = 0: energy error", f"{LINES} Dots: modified.", DISK, series="energy"
    ),
    PaperFigure(
        "disk-constraints", "Rolling disk, \u03b1 = 0: constraint defect", f"{LINES} Dots: modified.", DISK,
        series="constraints",
    ),
    PaperFigure(
        "disk-alphas", "Rolling disk: the nonholonomic path for four \u03b1",
        "Solid: \u03b1 = 0. Dashes: 1/3. Dots: 1/2. Dashes and dots: 1.", ALPHAS,
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


async def _drawn(request: Request, figure: PaperFigure) -> Response:
    answer = await call(request, "POST", "/v1/simulate", dict(figure.scene), {"Prefer": WAIT})
    if answer.status != 200 or not any(_points(figure, method) for method in answer.value["methods"]):
        # Not kept by the browser: the next look at the page asks again.
        return Response(status_code=503, headers={"Retry-After": "5"})
    headers = {"Cache-Control": "private, max-age=3600"}
    return sent(drawing(figure, answer.value), "image/svg+xml", headers)


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


def drawing(figure: PaperFigure, result: Mapping[str, Any]) -> str:
    """The plot of a simulated scene; the true motion is drawn first, under the others."""
    truth = [m for m in result["methods"] if m["method"] == "exact"]
    others = [m for m in result["methods"] if m["method"] != "exact"]
    looks = [(m, TRUE_LOOK) for m in truth if not figure.series] + list(zip(others, LOOKS, strict=False))
    lines = [PlotLine(_points(figure, method), *look) for method, look in looks]
    if figure.series:
        return plot(lines, "t", SERIES[figure.series][1], logarithmic=True)
    return plot(lines, *figure.plane, equal=figure.is_to_scale)


def _points(figure: PaperFigure, method: Mapping[str, Any]) -> tuple[tuple[float, float], ...]:
    columns = columns_of(method)
    a = columns.get("t" if figure.series else figure.plane[0], [])
    b = series(figure.series, method) if figure.series else columns.get(figure.plane[1], [])
    every = max(1, math.ceil(len(a) / MOST_POINTS))
    pairs = zip(a[::every], b[::every], strict=False)
    return tuple((x, y) for x, y in pairs if x is not None and y is not None)
