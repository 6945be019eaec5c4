"""Pictures: drawings of bodies, and pictures of answers for pages without scripts and for shared
links.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from inverse_service import catalogue, solve
from inverse_service.expressions import tree as ex
from inverse_service.web.pages import preview
from inverse_service.web.pages.library import BODIES, body_of
from inverse_service.web.pages.rendering import environment
from inverse_service.web.pages.starts import STEP, drawn_motion, lasted, picture_of


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
    assert {body for _, body in BODIES} == set(drawings)
    assert len(set(drawings.values())) == len(drawings)


@pytest.mark.slow
def test_the_oscillator_draws_a_circle_and_a_constraint_is_kept() -> None:
    """x'^2 + x^2 is constant; the velocity of y follows from the constraint."""
    found = drawn_motion(solve({"equations": "x'' = -x"}))
    assert found is not None
    radii = (found[0] ** 2).sum(axis=1)
    assert radii == pytest.approx(radii[0], rel=1e-3)
    knife = {
        "lagrangian": "(x'^2+y'^2+p'^2)/2",
        "constraints": ["y' - x'*tan(p)"],
        "coordinates": ["p", "x", "y"],
    }
    result = solve(knife)
    assert (picture_of(result, "svg", "") or b"").startswith(b"<?xml")
    assert (picture_of(result, "png", "Yes") or b"").startswith(b"\x89PNG")


@pytest.mark.nightly
def test_every_system_of_the_atlas_with_a_body_can_be_drawn() -> None:
    for entry in list(catalogue.atlas().values())[:40]:
        result = solve(dict(entry["document"]))
        if body_of(entry["name"]):
            assert drawn_motion(result) is not None, entry["name"]


def test_the_drawn_oscillator_keeps_its_energy() -> None:
    scene = SimpleNamespace(coordinates=("x",), values={}, grid=SimpleNamespace(step=STEP))
    q, v = np.array([[1.0], [0.3]]), np.array([[0.0], [-0.4]])
    motion = lasted(scene, (-ex.Symbol("x"),), (), q, v, 300).motion
    energy = (motion**2).sum(axis=1)
    assert energy.shape == (300, 2, 1)
    assert np.abs(energy / energy[0] - 1).max() < 1e-5


def test_nothing_moves_by_a_function_that_nobody_knows() -> None:
    system = {"coordinates": ["x"], "equations": {"x": "-a*x"}, "parameters": ["a"]}
    assert preview.moving_of({"system": {**system, "functions": {}}}) is not None
    assert preview.moving_of({"system": {**system, "functions": {"F": ["x"]}}}) is None
    assert preview.moving_of({"system": None}) is None
