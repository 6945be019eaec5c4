"""Small pictures of the gallery: two methods on one path, and sketches of a motion."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from inverse_service import catalogue
from inverse_service.web.pages.figures import small_picture
from inverse_service.web.pages.gallery import BODIES, body_of
from inverse_service.web.pages.rendering import environment
from inverse_service.web.pages.starts import _drawn, sketch

T = [math.tau * k / 50 for k in range(51)]


def result(methods: dict[str, dict[str, list[Any]]]) -> dict[str, Any]:
    """The part of a simulation that a picture needs."""
    found = [{"method": name, "label": name, "energy_start": 1.0, "points": {"every": 1, "columns": columns}}
             for name, columns in methods.items()]  # fmt: skip
    return {"methods": found, "observe": ["energy"], "system": {"coordinates": ["x", "y"], "constraints": []}}


def lines_of(svg: str) -> list[tuple[str, list[tuple[float, float]]]]:
    """(color, corners) of the lines inside the frame."""
    paths = re.findall(r'<path d="([^"]*)" clip-path[^>]*fill: none;[^>]*stroke: (#\w+)', svg)
    return [(color, [(float(x), float(y)) for x, y in re.findall(r"([-\d.]+) ([-\d.]+)", path)])
            for path, color in paths if color not in ("#747d8d",)]  # fmt: skip


def test_a_circle_drawn_to_scale_is_a_circle_and_the_true_one_lies_below() -> None:
    circle = {"t": T, "x": [math.cos(t) for t in T], "y": [math.sin(t) for t in T]}
    svg = small_picture(result({"variational": circle, "exact": circle}), "", ("x", "y"), True)
    assert svg is not None
    (below, _), (above, points) = lines_of(svg)
    assert (below, above) == ("#9aa3b2", "#0072b2")
    sizes = np.ptp(np.array(points), axis=0)
    assert sizes[0] == pytest.approx(sizes[1], abs=0.3)
    assert sizes[0] > 100
    assert len(svg) < 16_000


@pytest.mark.slow
def test_what_is_zero_or_has_no_value_is_left_out_on_a_logarithmic_axis() -> None:
    energy = [1.0, 1.0, 1.0 + 1e-6, None, 1.0 + 1e-4, 1.0 + 1e-5]
    svg = small_picture(result({"variational": {"t": T[:6], "energy": energy}}), "energy", ("x", "y"), False)
    assert svg is not None
    [(_, points)] = [line for line in lines_of(svg) if line[0] == "#0072b2"]
    low, high, middle = (height for _, height in points)
    assert high - middle == pytest.approx((high - low) / 2, abs=0.2)


def test_labels_are_escaped_and_without_points_there_is_no_picture() -> None:
    svg = small_picture(result({"variational": {"t": T[:2], "<b>": [0, 1], "&": [1, 2]}}), "", ("<b>", "&"), False)
    assert svg is not None
    assert "<b>" not in svg
    assert small_picture(result({"variational": {}}), "", ("x", "y"), True) is None


@pytest.mark.slow
def test_the_sketch_of_an_oscillator_is_a_circle_and_that_of_a_pair_has_two_coordinates() -> None:
    """x'^2 + x^2 is constant; the anisotropic oscillator draws a figure of Lissajous in the same square."""
    for name in ("sho", "anisotropic-oscillator-2d"):
        svg = sketch(name)
        assert svg is not None
        corners = np.array([[int(n) for n in pair.split(",")] for pair in re.findall(r"\d+,\d+", svg)])
        assert corners.min() >= 0
        assert corners.max() <= 320
        assert np.ptp(corners, axis=0) == pytest.approx([288, 288], abs=6)
        if name == "sho":
            assert np.hypot(*(corners - 160).T) == pytest.approx(np.full(len(corners), 144), abs=4)


def test_a_direction_without_motion_is_not_magnified() -> None:
    path = np.array([[0.0, 1.0], [1.0, 1.0 + 1e-15], [2.0, 1.0]])
    assert 'points="16,160 160,160 304,160"' in _drawn(path)
    assert 'points="160,160 160,160"' in _drawn(np.ones((2, 2)))


@pytest.mark.nightly
@pytest.mark.parametrize("name", catalogue.names())
def test_every_system_has_a_sketch(name: str) -> None:
    svg = sketch(name)
    assert svg is not None
    assert len(svg) < 1_600


@pytest.mark.parametrize(
    ("name", "body"),
    [
        ("vertically-rolling-disk", "disk"),
        ("two-wheeled-carriage", "carriage"),
        ("inclined-knife-edge", "inclined-knife-edge"),
        ("knife-edge-second", "knife-edge"),
        ("damped-double-pendulum", "double-pendulum"),
        ("pendulum-on-viscous-cart", "cart-pendulum"),
        ("kepler-polar", "orbit"),
        ("sho", "spring"),
        ("shock", ""),
        ("douglas-iiib", ""),
    ],
)
def test_a_system_is_drawn_as_the_body_of_its_name(name: str, body: str) -> None:
    assert body_of(name) == body


def test_every_body_has_a_drawing_of_its_own() -> None:
    drawings = environment().get_template("bodies.html").module.drawings
    assert {body for _, body in BODIES} | {"drag"} == set(drawings)
    assert len(set(drawings.values())) == len(drawings)
