"""Contacts beside switches, events, constraints, and other contacts, against closed forms."""

import math
from typing import Any

import pytest

from inverse_service.service.scenes.simulating import simulate

pytestmark = pytest.mark.slow
PLANE = "(x'^2 + y'^2)/2"
FLOOR = {"gap": "y", "restitution": 0.5, "friction": 0.1, "slides": "x'"}
WALL = {"gap": "x", "restitution": 0.25, "friction": 0.5, "slides": "y'"}
BOX = [{"gap": gap, "restitution": 1} for name in "xyz" for gap in (name, f"1 - {name}")]


def at_end(
    system: dict[str, Any], start: dict[str, tuple[Any, Any]], contacts: list[Any], time: float, **more: Any
) -> tuple[dict[str, float], dict[str, float]]:  # fmt: skip
    """Positions and velocities."""
    scene = {
        "system": {"coordinates": [*start], **system},
        "initial": {
            "positions": {name: q for name, (q, _) in start.items()},
            "velocities": {name: v for name, (_, v) in start.items()},
        },
        "contacts": contacts,
        "step": 0.01,
        "time": time,
        "methods": ["adaptive"],
    }
    (run,) = simulate(scene | more)["methods"]
    assert run["outcome"] == "completed"
    return run["final"]["positions"], run["final"]["velocities"]


def test_a_corner_with_friction_on_both_sides() -> None:
    """The floor first, which closes faster: its impulse is 3, so x' = -1 + 0.3, and then the
    wall's is 1.25 * 0.7, which takes half as much from y'.
    """
    start = {"x": (1, -1), "y": (2, -2)}
    _, v = at_end({"lagrangian": PLANE}, start, [FLOOR, WALL], 2.0)
    assert v == pytest.approx({"x": 0.25 * 0.7, "y": 1 - 0.5 * 1.25 * 0.7}, abs=1e-12)


def test_three_walls_at_once() -> None:
    """A ball along the diagonal of a box, by unfolding: each coordinate is a triangle wave."""
    start = dict.fromkeys("xyz", (0.5, 1))
    q, _ = at_end({"lagrangian": "(x'^2 + y'^2 + z'^2)/2"}, start, BOX, 10.0)
    assert q == pytest.approx(dict.fromkeys("xyz", 0.5), abs=1e-12)


def test_a_billiard_in_a_ball() -> None:
    """Chords between reflections, 10 units of time long."""
    q, v, left = [0.1, 0.2, -0.3], [0.7, -0.4, 0.9], 10.0
    start = dict(zip("xyz", zip(q, v, strict=True), strict=True))
    while True:
        a, b, c = (
            sum(map(math.prod, zip(*pair, strict=True))) for pair in ((v, v), (q, v), (q, q))
        )
        chord = (math.sqrt(b * b - a * (c - 1)) - b) / a
        step = min(chord, left)
        q, left = [x + step * u for x, u in zip(q, v, strict=True)], left - step
        if left <= 0:
            break
        along = sum(map(math.prod, zip(q, v, strict=True)))
        v = [u - 2 * along * x for x, u in zip(q, v, strict=True)]
    contact = [{"gap": "1 - x^2 - y^2 - z^2", "restitution": 1}]
    found, _ = at_end({"lagrangian": "(x'^2 + y'^2 + z'^2)/2"}, start, contact, 10.0)
    assert [*found.values()] == pytest.approx(q, abs=1e-12)


def test_a_wall_dry_friction_and_an_event() -> None:
    """x'' = -sign(x') from 3 to the wall at 1, back with half of sqrt(7), and at rest at 1/8."""
    events = [{"when": "x - 1/2"}]
    q, v = at_end(
        {"lagrangian": "x'^2/2"}, {"x": (0, 3)}, [{"gap": "1 - x", "restitution": 0.5}], 3.0,
        forces={"x": "-sign(x')"}, events=events,
    )  # fmt: skip
    assert (q["x"], v["x"]) == (pytest.approx(0.125, abs=1e-12), 0)


def test_a_bead_on_a_wire_and_a_wall() -> None:
    """A frictionless parabola: the bead returns to the height that half of its speed gives."""
    system = {"lagrangian": f"{PLANE} - y", "constraints": ["y' - 2*x*x'"]}
    events = [{"when": "x'", "direction": 1, "do": "stop"}]
    contact = [{"gap": "1/2 - x", "restitution": 0.5}]
    q, _ = at_end(system, {"x": (-1, 0), "y": (1, 0)}, contact, 5.0, events=events)
    assert q["y"] == pytest.approx(0.25 + (1 - 0.25) / 4, abs=1e-9)


def test_a_table_throws_what_lies_on_it() -> None:
    """y = 1 - cos(4 t) pushes until 16 cos(4 t) = -9.81."""
    t = math.acos(-9.81 / 16) / 4
    left, rate = 0.6 - t, 4 * math.sin(4 * t)
    height = 1 - math.cos(4 * t) + rate * left - 9.81 * left**2 / 2
    contact = [{"gap": "y - (1 - cos(4*t))", "restitution": 0}]
    q, _ = at_end({"lagrangian": "y'^2/2 - 9.81*y"}, {"y": (0, 0)}, contact, 0.6)
    assert q["y"] == pytest.approx(height, abs=1e-12)
