"""Plots show every point, at its place, with round numbers beside the axes."""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree

import pytest

from inverse_service.web.pages.plots import Axis, PlotLine, plot, round_step

SVG = "{http://www.w3.org/2000/svg}"


def lines_of(svg: str) -> list[list[tuple[float, float]]]:
    found = ElementTree.fromstring(svg).iter(f"{SVG}polyline")
    return [[tuple(map(float, p.split(","))) for p in line.get("points", "").split()] for line in found]  # type: ignore[misc]


def circle(count: int = 100) -> tuple[tuple[float, float], ...]:
    return tuple((math.cos(k * math.tau / count), math.sin(k * math.tau / count)) for k in range(count + 1))


def test_a_circle_drawn_to_scale_is_a_circle() -> None:
    [points] = lines_of(plot([PlotLine(circle(), "#000")], "x", "y", equal=True))
    xs, ys = [x for x, _ in points], [y for _, y in points]
    assert max(xs) - min(xs) == pytest.approx(max(ys) - min(ys), abs=0.3)
    assert max(xs) - min(xs) > 100


def test_points_keep_their_order_and_stay_inside_the_frame() -> None:
    [points] = lines_of(plot([PlotLine(((0, 1e-9), (1, 1e-3), (2, 1e-6)), "#000")], "t", "e", logarithmic=True))
    assert points[0][0] < points[1][0] < points[2][0]
    assert points[0][1] > points[2][1] > points[1][1]
    assert all(0 <= x <= 400 and 0 <= y <= 270 for x, y in points)


def test_what_has_no_place_is_left_out() -> None:
    odd = PlotLine(((0, 1.0), (1, math.nan), (2, math.inf), (3, 2.0)), "#000")
    assert len(lines_of(plot([odd], "x", "y"))[0]) == 2
    low = PlotLine(((0, 1.0), (1, 0.0), (2, -1.0), (3, 2.0)), "#000")
    assert len(lines_of(plot([low], "x", "y", logarithmic=True))[0]) == 2


@pytest.mark.parametrize("points", [(), ((0.0, math.nan),)])
def test_without_points_there_is_no_plot(points: tuple[tuple[float, float], ...]) -> None:
    with pytest.raises(ValueError, match="no points"):
        plot([PlotLine(points, "#000")], "x", "y")


def test_a_constant_line_is_drawn() -> None:
    [points] = lines_of(plot([PlotLine(((0, 5.0), (1, 5.0)), "#000")], "x", "y"))
    assert points[0][1] == points[1][1]


@pytest.mark.parametrize(("low", "high"), [(-1.2, 1.1), (0, 40), (1e-7, 3e-7), (-1e6, 1e6)])
def test_ticks_are_round_inside_and_at_their_places(low: float, high: float) -> None:
    axis = Axis("x", low, high, 50, 350)
    ticks = axis.ticks()
    assert 2 <= len(ticks) <= 9
    for place, text in ticks:
        assert 50 - 1e-6 <= place <= 350 + 1e-6
        assert axis.place(float(text)) == pytest.approx(place, abs=0.01)
        assert re.fullmatch(r"-?\d*\.?\d{1,6}(e[-+]\d+)?", text)


@pytest.mark.parametrize(("size", "step"), [(0.9, 1), (1, 1), (1.1, 2), (3, 5), (6, 10), (0.03, 0.05)])
def test_steps_are_one_two_or_five(size: float, step: float) -> None:
    assert round_step(size) == pytest.approx(step)


def test_labels_are_escaped() -> None:
    assert "<b>" not in plot([PlotLine(((0, 1), (1, 2)), "#000")], "<b>", "&")
