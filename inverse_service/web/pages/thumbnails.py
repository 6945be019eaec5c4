"""A small picture of a system's motion in a plane, for the gallery: two methods on one path."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from inverse_service import catalogue
from inverse_service.web.pages.calls import call
from inverse_service.web.pages.figures import columns_of
from inverse_service.web.pages.rendering import can_simulate, sent
from inverse_service.web.pages.results import missing
from inverse_service.web.pages.scenes import PLANE, scene_document, scene_form

router = APIRouter()
WIDTH, HEIGHT, MARGIN = 300, 190, 14
# Told apart by colour and by dashes, on light and on dark.
LOOKS = (("#3b82d0", ""), ("#d9772b", ' stroke-dasharray="5 4"'))
METHODS = ("nonholonomic", "variational")
STEPS = "300"
MOST_POINTS = 100
WAIT = "wait=20"


def has_thumbnail(name: str) -> bool:
    """Whether a picture of the system's motion can be drawn."""
    return can_simulate() and len(catalogue.document(name)["coordinates"]) > 1


def plane_of(name: str) -> tuple[str, str]:
    """The coordinates of the picture: x and y, else the last two."""
    coordinates = catalogue.document(name)["coordinates"]
    return PLANE if set(PLANE) <= set(coordinates) else (coordinates[-2], coordinates[-1])


@router.get("/gallery/{name}.svg")
async def thumbnail(request: Request, name: str) -> Response:
    """The path of a nonholonomic system, computed as a job once and kept like every answer."""
    if name not in catalogue.names("nonholonomic") or not has_thumbnail(name):
        return missing()
    form = scene_form(catalogue.document(name), "", system=name)
    scene = scene_document(replace(form, methods=METHODS, observe=("trajectory",), steps=STEPS), {"catalogue": name})
    answer = await call(request, "POST", "/v1/simulate", scene, {"Prefer": WAIT})
    if answer.status != 200:
        return Response(drawing([]), media_type="image/svg+xml")
    headers = {"Cache-Control": "private, max-age=3600"}
    return sent(drawing(paths(answer.value, plane_of(name))), "image/svg+xml", headers)


def paths(result: Mapping[str, Any], plane: tuple[str, str]) -> list[list[tuple[float, float]]]:
    """The points of each method in a plane, those that are numbers."""
    found = []
    for method in result["methods"]:
        columns = columns_of(method)
        every = max(1, math.ceil(len(columns.get(plane[0], ())) / MOST_POINTS))
        pairs = zip(*(columns.get(axis, ())[::every] for axis in plane), strict=True)
        found.append([(x, y) for x, y in pairs if x is not None and y is not None])
    return [points for points in found if len(points) > 1]


def drawing(lines: Sequence[Sequence[tuple[float, float]]]) -> str:
    """The SVG; both axes have one scale. Without lines it says that there is nothing to draw."""
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}">'
    if not lines:
        text = '<text x="50%" y="50%" text-anchor="middle" font-family="sans-serif" font-size="13" fill="#7a8392">'
        return f"{head}{text}not computed yet</text></svg>"
    xs, ys = [x for line in lines for x, _ in line], [y for line in lines for _, y in line]
    size = max((max(xs) - min(xs)) / (WIDTH - 2 * MARGIN), (max(ys) - min(ys)) / (HEIGHT - 2 * MARGIN), 1e-12)
    middle = (max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2
    body = "".join(
        f'<polyline fill="none" stroke="{colour}" stroke-width="2"{dash} points="{_points(line, middle, size)}"/>'
        for line, (colour, dash) in zip(lines, LOOKS, strict=False)
    )
    return f"{head}{body}</svg>"


def _points(line: Sequence[tuple[float, float]], middle: tuple[float, float], size: float) -> str:
    shown = ((WIDTH / 2 + (x - middle[0]) / size, HEIGHT / 2 - (y - middle[1]) / size) for x, y in line)
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in shown)
