"""Several contacts at once: corners, piles, wedges and stops against the solver by quadratics, and
friction at several contacts against exact solutions.
"""

from __future__ import annotations

import random

import numpy as np
import pytest

from tests.service.test_contacts import (
    FLOOR,
    GRAVITY,
    POINT,
    G,
    Row,
    Scene,
    at_rest,
    by_quadratics,
    run,
    scene,
)  # fmt: skip
from tests.values import slow

NAMES = "abcde"
Planes = tuple[
    list[float], list[float], list[float], list[float], list[list[float]], list[float], list[float], float
]  # fmt: skip
# Masses, forces, places, speeds, gaps G q + c as rows of G and c, restitutions, length of time.
PLANES: dict[str, Planes] = {
    "three stops, no restitution": (
        [1, 1],
        [-1, -2],
        [0.3, 0.4],
        [0.7, -0.2],
        [[1, 0], [0, 1], [-1, -1]],
        [0, 0, 1],
        [0, 0, 0],
        3.0,
    ),
    "three stops, elastic": (
        [1, 1],
        [-1, -2],
        [0.3, 0.4],
        [0.7, -0.2],
        [[1, 0], [0, 1], [-1, -1]],
        [0, 0, 1],
        [1, 1, 1],
        2.0,
    ),
    "three stops, mixed": (
        [1, 2],
        [-1, -2],
        [0.3, 0.4],
        [0.7, -0.2],
        [[1, 0], [0, 1], [-1, -1]],
        [0, 0, 1],
        [0.5, 0, 1],
        3.0,
    ),
    "an acute corner": (
        [1, 1],
        [0, -1],
        [0, 1],
        [0.1, 0],
        [[1, 1], [-1, 1]],
        [0, 0],
        [0.5, 0.5],
        4.0,
    ),
    "an obtuse corner": (
        [1, 1],
        [0.1, -1],
        [0, 1],
        [0.1, 0],
        [[0.3, 1], [-0.3, 1]],
        [0, 0],
        [0.3, 0.3],
        6.0,
    ),
    "a corner in space": (
        [1, 1, 1],
        [-1, -2, -3],
        [1, 1, 1],
        [0.3, -0.4, 0.1],
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [0, 0, 0],
        [0.4, 0.2, 0],
        5.0,
    ),
    "into a pyramid": (
        [1, 1, 1],
        [0, 0, -1],
        [0.2, 0.1, 1],
        [0, 0, 0],
        [[1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1]],
        [0, 0, 0, 0],
        [0, 0, 0, 0],
        3.88,  # just before its tip, where two walls are hit at once and their order counts
    ),
    "bouncing in a pyramid": (
        [1, 2, 1],
        [0, 0, -1],
        [0.2, 0.1, 1],
        [0, 0, 0],
        [[1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1]],
        [0, 0, 0, 0],
        [0.3, 0.3, 0.3, 0.3],
        6.0,
    ),
    "a wedge and what slides on it fall": (
        [2, 2, 1, 1],
        [0, -2, 0, -1],
        [0, 0.5, 0.2, 2],
        [0, 0, 0, 0],
        [[0, 1, 0, 0], [0.5, -1, -0.5, 1]],
        [0, 0],
        [0, 0],
        2.5,
    ),
    "a wedge and what slides on it bounce": (
        [2, 2, 1, 1],
        [0, -2, 0, -1],
        [0, 0.5, 0.2, 2],
        [0, 0, 0, 0],
        [[0, 1, 0, 0], [0.5, -1, -0.5, 1]],
        [0, 0],
        [0.5, 0.8],
        2.5,
    ),
    "five on a line into a wall": (
        [1, 1, 1, 1, 1],
        [0] * 5,
        [0, 1, 2, 3, 4.5],
        [2, 1, 0.5, 0, -1],
        [[-1, 1, 0, 0, 0], [0, -1, 1, 0, 0], [0, 0, -1, 1, 0], [0, 0, 0, -1, 1], [0, 0, 0, 0, -1]],
        [0, 0, 0, 0, 5],
        [1, 0.5, 0.5, 0.5, 0.5],
        4.0,
    ),
    "three are pressed together": (
        [1, 2, 1],
        [3, 0, -3],
        [0, 1, 2.5],
        [0, 0, 0],
        [[-1, 1, 0], [0, -1, 1]],
        [0, 0],
        [0.3, 0.3],
        4.0,
    ),
    "pile hit from above": (
        [1, 1, 1, 1],
        [-10] * 4,
        [0, 1, 2, 4],
        [0] * 4,
        [[1, 0, 0, 0], [-1, 1, 0, 0], [0, -1, 1, 0], [0, 0, -1, 1]],
        [0, -1, -1, -1],
        [0, 0, 0, 0.5],
        3.0,
    ),
    "pile hit elastic": (
        [1, 1, 1, 1],
        [-10] * 4,
        [0, 1, 2, 4],
        [0] * 4,
        [[1, 0, 0, 0], [-1, 1, 0, 0], [0, -1, 1, 0], [0, 0, -1, 1]],
        [0, -1, -1, -1],
        [1, 1, 1, 1],
        1.0,
    ),
    "pile hit heavy": (
        [1, 2, 3, 9],
        [-10, -20, -30, -90],
        [0, 1, 2, 3.5],
        [0] * 4,
        [[1, 0, 0, 0], [-1, 1, 0, 0], [0, -1, 1, 0], [0, 0, -1, 1]],
        [0, -1, -1, -1],
        [0.2, 0.2, 0.2, 0.2],
        2.0,
    ),
    "three between two walls": (
        [1, 1, 1],
        [0.2, 0, -0.1],
        [0.2, 0.5, 0.9],
        [1, 0, -1],
        [[1, 0, 0], [-1, 1, 0], [0, -1, 1], [0, 0, -1]],
        [0, 0, 0, 1],
        [0.9, 0.9, 0.9, 0.9],
        3.0,
    ),
    "one is released while another hits it": (
        [1, 1],
        [1, -1],
        [0, 1],
        [0, -1],
        [[1, 0], [-1, 1]],
        [0, 0],
        [0.5, 0.5],
        3.0,
    ),
}
QUICK = ("three stops, elastic",)


def plane(row: list[float], offset: float) -> str:
    terms = (f"({x})*{name}" for x, name in zip(row, NAMES, strict=False) if x)
    return " + ".join([*terms, f"({offset})"])


def scene_of(planes: Planes) -> Scene:
    masses, forces, places, speeds, rows, offsets, restitutions, until = planes
    parts = zip(masses, forces, NAMES, strict=False)
    lagrangian = " + ".join(f"{m}*{x}'^2/2 + ({f})*{x}" for m, f, x in parts)
    start = {x: (float(q), float(v)) for x, q, v in zip(NAMES, places, speeds, strict=False)}
    contacts = [
        {"gap": plane(row, offset), "restitution": e}
        for row, offset, e in zip(rows, offsets, restitutions, strict=True)
    ]
    return scene(lagrangian, start, contacts, until)


@pytest.mark.parametrize("name", [name if name in QUICK else slow(name) for name in PLANES])
def test_planes_are_those_of_the_solver_by_quadratics(name: str) -> None:
    found, expected = run(scene_of(PLANES[name])), by_quadratics(*PLANES[name])
    assert found["outcome"] == "completed"
    assert [*found["final"]["positions"].values()] == pytest.approx(expected, abs=1e-8)


def random_planes(seed: int) -> Planes | None:
    """Boxes, lines of bodies, and oblique planes, of which some touch at the start; None where a
    gap is negative.
    """
    dice = random.Random(seed)
    size = dice.choice([1, 2, 2, 3, 3, 4])
    span, count = range(size), dice.randint(1, min(5, 2 * size + 1))
    places = [round(dice.uniform(0.2, 1.5), 2) for _ in span]
    kind, rows = dice.choice(["box", "line", "oblique"]), list[list[float]]()
    if kind == "line":
        places.sort()
    for k in range(count):
        row = [0.0] * size
        if kind == "oblique":
            row = [round(dice.uniform(-0.5, 1), 2) for _ in span]
        elif k < size:
            row[k] = 1.0
            if kind == "line" and k:
                row[k - 1] = -1.0
        else:
            row[k % size if kind == "box" else -1] = -1.0
        rows.append(row)
    at = np.array(rows) @ np.array(places)
    offsets = [
        round(-float(value), 10) if dice.random() < 0.25 or value < 0 else 0.0 for value in at
    ]
    if (at + offsets < -1e-12).any() or len(set(map(tuple, rows))) < count:
        return None
    return (
        [dice.choice([1, 1, 2, 3, 0.5, 5]) for _ in span],
        [round(dice.uniform(-3, 1), 2) for _ in span],
        places,
        [round(dice.uniform(-1, 1), 2) if dice.random() < 0.7 else 0.0 for _ in span],
        rows,
        offsets,
        [dice.choice([0, 0, 0.3, 0.5, 0.8, 1]) for _ in range(count)],
        2.0,
    )


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(60))
def test_random_planes_are_those_of_the_solver_or_end_by_name(seed: int) -> None:
    planes = random_planes(seed)
    if planes is None:
        return
    found, expected = run(scene_of(planes)), by_quadratics(*planes)
    assert found["outcome"] in ("completed", "no_one_motion")
    if found["outcome"] == "completed":
        assert [*found["final"]["positions"].values()] == pytest.approx(expected, abs=1e-8)


RUBBING: dict[str, Row] = {
    "block down a rough wall onto a floor": (
        scene(
            "(x'^2+y'^2)/2 - g*y + 3*x",
            {"x": (1, 0), "y": (1, 0)},
            [{"gap": "1-x", "friction": 0.5, "slides": "y'"}, FLOOR],
            0.4,
            **GRAVITY,
        ),
        {"x": 1, "y": 1 - (G - 1.5) * 0.08},
    ),
    "held at a rough wall": (
        scene(
            "(x'^2+y'^2)/2 - g*y + 30*x",
            {"x": (1, 0), "y": (1, 0)},
            [{"gap": "1-x", "friction": 0.5, "slides": "y'"}, FLOOR],
            1,
            **GRAVITY,
        ),
        {"x": 1, "y": 1},
    ),
    "down a rough wall to rest": (
        scene(
            "(x'^2+y'^2)/2 - g*y + 3*x",
            {"x": (1, 0), "y": (1, 0)},
            [{"gap": "1-x", "friction": 0.5, "slides": "y'"}, FLOOR],
            2,
            **GRAVITY,
        ),
        {"x": 1, "y": 0},
    ),
    "three stacked blocks, the top pulled away": (
        scene(
            "(a'^2+b'^2+c'^2+x'^2+y'^2+z'^2)/2 - g*(x+y+z) + 8*c",
            {"a": (0, 0), "b": (0, 0), "c": (0, 0), "x": (0, 0), "y": (1, 0), "z": (2, 0)},
            [
                {"gap": "x", "friction": 0.5, "slides": "a'"},
                {"gap": "y-x-1", "friction": 0.5, "slides": "b'-a'"},
                {"gap": "z-y-1", "friction": 0.5, "slides": "c'-b'"},
            ],
            1,
            **GRAVITY,
        ),
        {"a": 0, "b": 0, "c": (8 - G / 2) / 2, "x": 0, "y": 1, "z": 2},
    ),
    "three stacked blocks, the middle pulled out": (
        scene(
            "(a'^2+b'^2+c'^2+x'^2+y'^2+z'^2)/2 - g*(x+y+z) + 20*b",
            {"a": (0, 0), "b": (0, 0), "c": (0, 0), "x": (0, 0), "y": (1, 0), "z": (2, 0)},
            [
                {"gap": "x", "friction": 0.5, "slides": "a'"},
                {"gap": "y-x-1", "friction": 0.5, "slides": "b'-a'"},
                {"gap": "z-y-1", "friction": 0.5, "slides": "c'-b'"},
            ],
            1,
            **GRAVITY,
        ),
        {"a": 0, "b": (20 - 1.5 * G) / 2, "c": G / 4, "x": 0, "y": 1, "z": 2},
    ),
    "two blocks pushed along a rough floor": (
        scene(
            "(a'^2+b'^2+x'^2+y'^2)/2 - g*(x+y) + 10*a",
            {"a": (0, 0), "b": (1, 0), "x": (0, 0), "y": (0, 0)},
            [
                {"gap": "x", "friction": 0.3, "slides": "a'"},
                {"gap": "y", "friction": 0.3, "slides": "b'"},
                {"gap": "b-a-1"},
            ],
            1,
            **GRAVITY,
        ),
        {"a": (10 - 0.6 * G) / 4, "b": 1 + (10 - 0.6 * G) / 4},
    ),
    "one slides into another and both stop": (
        scene(
            "(a'^2+b'^2+x'^2+y'^2)/2 - g*(x+y)",
            {"a": (0, 3), "b": (1.5, 0), "x": (0, 0), "y": (0, 0)},
            [
                {"gap": "x", "friction": 0.3, "slides": "a'"},
                {"gap": "y", "friction": 0.3, "slides": "b'"},
                {"gap": "b-a-1"},
            ],
            2,
            **GRAVITY,
        ),
        {"a": 0.5 + (9 - 0.3 * G) / 4 / (0.6 * G), "b": 1.5 + (9 - 0.3 * G) / 4 / (0.6 * G)},
    ),
    "one slides into another, elastic": (
        scene(
            "(a'^2+b'^2+x'^2+y'^2)/2 - g*(x+y)",
            {"a": (0, 3), "b": (1.5, 0), "x": (0, 0), "y": (0, 0)},
            [
                {"gap": "x", "friction": 0.3, "slides": "a'"},
                {"gap": "y", "friction": 0.3, "slides": "b'"},
                {"gap": "b-a-1", "restitution": 1},
            ],
            2,
            **GRAVITY,
        ),
        {"a": 0.5, "b": 1.5 + (9 - 0.3 * G) / (0.6 * G)},
    ),
    "on a table that swings along and up": (
        scene(
            POINT,
            {"x": (0, 0), "y": (0, 0)},
            [{"gap": "y - (1-cos(t))/2", "friction": 0.3, "slides": "x' - t"}, {"gap": "9-x"}],
            2,
            **GRAVITY,
        ),
        {"x": 2, "y": (1 - np.cos(2)) / 2},
    ),
    "chain of three falls on a floor, inelastic": (
        scene(
            "(a'^2+b'^2+c'^2)/2 - 9.81*(a+b+c)",
            at_rest(1, 2, 3),
            [{"gap": "a"}, {"gap": "b-a-1/2"}, {"gap": "c-b-1/2"}],
            2,
        ),
        {"a": 0, "b": 0.5, "c": 1},
    ),
    "jammed between two rough walls": (
        scene(
            "(x'^2+y'^2+z'^2)/2 - g*y + 20*x - 20*z",
            {"x": (1, 0), "y": (0.5, 0), "z": (0, 0)},
            [
                {"gap": "1-x", "friction": 0.3, "slides": "y'"},
                {"gap": "z", "friction": 0.3, "slides": "y'"},
                FLOOR,
            ],
            1,
            **GRAVITY,
        ),
        {"x": 1, "y": 0.5, "z": 0},
    ),
    "slips between two rough walls": (
        scene(
            "(x'^2+y'^2+z'^2)/2 - g*y + 10*x - 10*z",
            {"x": (1, 0), "y": (5, 0), "z": (0, 0)},
            [
                {"gap": "1-x", "friction": 0.3, "slides": "y'"},
                {"gap": "z", "friction": 0.3, "slides": "y'"},
                FLOOR,
            ],
            1,
            **GRAVITY,
        ),
        {"x": 1, "y": 5 - (G - 6) / 2, "z": 0},
    ),
    "a disk spins between a rough floor and a rough wall": (
        scene(
            "(x'^2+y'^2)/2+p'^2/4 - g*y - 5*x",
            {"x": (0, 0), "y": (0, 0), "p": (0, 20)},
            [
                {"gap": "y", "friction": 0.2, "slides": "x'+p'"},
                {"gap": "x", "friction": 0.2, "slides": "y'-p'"},
            ],
            1,
            **GRAVITY,
        ),
        {"x": 0, "y": 0, "p": 20 - 0.2 * (1.2 * (G - 1) / 1.04 + 5)},
    ),
    # Pressed on by 5 and 4, pads reach a wheel at 0.2 and at b: each takes the friction of its
    # whole impulse at once, and from then on 5/5 and 3/10 4 as it presses, until 3 - 2.2 t is 0.
    "a wheel is braked by two pads": (
        scene(
            "(p'^2+a'^2+b'^2)/2 - 5*a - 4*b",
            {"p": (0, 3), "a": (0.1, 0), "b": (0.3, 0)},
            [
                {"gap": "a", "friction": 0.2, "slides": "p'"},
                {"gap": "b", "friction": 0.3, "slides": "p'"},
            ],
            2,
        ),
        {"a": 0, "b": 0, "p": 9 / 4.4 + 0.2**2 / 2 + 1.2 * 0.15 / 2},
    ),
}
SHORT = ("held at a rough wall", "on a table that swings along and up")


@pytest.mark.parametrize("name", [name if name in SHORT else slow(name) for name in RUBBING])
def test_friction_at_several_contacts_is_exact(name: str) -> None:
    document, ends = RUBBING[name]
    found = run(document)
    assert found["outcome"] == "completed"
    assert {x: found["final"]["positions"][x] for x in ends} == pytest.approx(ends, abs=1e-8)


THREE = "(a'^2 + b'^2 + c'^2)/2"
CORNER = {  # half of the angle, restitution: whether both orders of the two walls leave the same
    (45, 0.5): True,
    (30, 1.0): True,
    (30, 0.5): False,
    (35, 1.0): False,
}


@pytest.mark.parametrize("half", [*CORNER])
def test_a_corner_that_is_hit_in_the_middle_needs_no_order(half: tuple[float, float]) -> None:
    """Reflections at walls with an angle of pi/k make the same turn in either order, others do not."""
    x, y = (float(f(np.radians(half[0]))) for f in (np.cos, np.sin))
    walls = [{"gap": f"{y!r}*y {sign} {x!r}*x", "restitution": half[1]} for sign in "+-"]
    found = run(scene("(x'^2 + y'^2)/2", {"x": (0, 0), "y": (1, -1)}, walls, 2))
    assert found["outcome"] == ("completed" if CORNER[half] else "no_one_motion")
    if CORNER[half]:
        ends = {"x": 0, "y": half[1]}
        assert found["final"]["positions"] == pytest.approx(ends, abs=1e-8)


def test_two_impacts_whose_order_decides_end_a_run() -> None:
    """(1, 0, -1) with e = 1/2 becomes (-23, 3, 20)/64 or (-20, -3, 23)/64, so the sentence names both."""
    start = {"a": (-1, 1), "b": (0, 0), "c": (1, -1)}
    gaps = [{"name": f"{x}{y}", "gap": f"{y} - {x}", "restitution": 0.5} for x, y in ("ab", "bc")]
    found = run(scene(THREE, start, gaps, 2))
    assert found["outcome"] == "no_one_motion"
    assert "ab, bc" in found["stopped"]["sentence"]
    assert found["stopped"]["time"] == pytest.approx(1)
