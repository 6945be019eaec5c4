"""Impacts and rests of textbooks: a rocking block, a wheel at a step, masses over an edge,
pendulums that touch, floors that curve, an oscillator that hits a wall, disks, a superball.

Each is compared with closed forms or with scipy's DOP853 from one impact to the next, whose law is
written here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.service.test_contacts import G, Scene, Start, run, scene
from tests.values import slow

Motion = Callable[[float], Mapping[str, float]]
Array = Any


class Case(NamedTuple):
    """A scene and its motion, by name of a column; where it says nothing of one, it is not known."""

    scene: Scene
    motion: Motion


def between(
    slope: Callable[[float, Array], Any], start: list[float], times: tuple[float, float], gap: Any = None
) -> Any:  # fmt: skip
    """The motion up to where the gap closes."""
    if gap is not None:
        gap.terminal, gap.direction = True, -1
    return solve_ivp(slope, times, start, "DOP853", None, True, gap, rtol=1e-13, atol=1e-14, max_step=0.05)  # fmt: skip


def rocking() -> Case:
    """G. W. Housner, Bull. Seism. Soc. Am. 53 (1963) 403: a block of the sides 2 b and 2 a turns
    about one corner, then about the other, with 1 - m r^2 (1 - cos 2 alpha)/I of its speed.
    """
    a, b, tilted = 1.0, 0.3, 0.1
    own, square = (a * a + b * b) / 3, a * a + b * b
    contacts = [
        {"gap": f"y + {x}*sin(h) - {a}*cos(h)", "friction": 5, "slides": f"x' + ({a}*cos(h) - {x}*sin(h))*h'"}
        for x in (-b, b)
    ]  # fmt: skip

    def turning(side: float) -> Callable[[float, Array], Any]:
        return lambda t, s: [
            s[1],
            -G * (side * b * np.cos(s[0]) - a * np.sin(s[0])) / (own + square),
        ]

    first = between(turning(1), [tilted, 0], (0, 5), lambda t, s: s[0])
    begin, speed = first.t[-1], first.y[1, -1]
    kept = 1 - square * (1 - np.cos(2 * np.arctan2(b, a))) / (own + square)
    second = between(turning(-1), [0, kept * speed], (begin, begin + 0.4))

    def motion(t: float) -> dict[str, float]:
        return {"h": float((first if t <= begin else second).sol(t)[0])}

    start: Start = {
        "x": (0, 0),
        "y": (b * np.sin(tilted) + a * np.cos(tilted), 0),
        "h": (tilted, 0),
    }
    text = f"(x'^2 + y'^2 + {own}*h'^2)/2 - {G}*y"
    return Case(scene(text, start, contacts, begin + 0.3), motion)


def at_a_step() -> Case:
    """A disk of radius 1 that rolls into a step of height s turns about it with 1 - 2 s/3 of its
    speed, if nothing slips.
    """
    height, speed, place = 0.2, 2.5, 3.0
    angle = np.arcsin(1 - height)
    begin = (place - np.cos(angle)) / speed
    over = between(lambda t, s: [s[1], -G * np.cos(s[0]) / 1.5], [angle, speed * (1 - 2 * height / 3)],
                   (begin, begin + 0.5))  # fmt: skip
    x, y = f"({place} - x)", f"({height} - y)"
    contacts: list[Scene] = [
        {"gap": "y - 1", "friction": 2, "slides": "x' - h'"},
        {"gap": f"sqrt({x}^2 + {y}^2) - 1", "friction": 4, "slides": f"-(x' + h'*{y})*{y} + (y' - h'*{x})*{x}"},
    ]  # fmt: skip

    def motion(t: float) -> dict[str, float]:
        if t < begin:
            return {"x": speed * t, "y": 1.0}
        turned = float(over.sol(t)[0])
        return {"x": place - np.cos(turned), "y": height + np.sin(turned)}

    start: Start = {"x": (0, speed), "y": (1, 0), "h": (0, speed)}
    text = f"(x'^2 + y'^2 + h'^2/2)/2 - {G}*y"
    return Case(scene(text, start, contacts, begin + 0.4), motion)


def over_an_edge() -> Case:
    """A mass on a rough table, pulled by one that hangs over its edge, bounces back from the edge
    until it rests there.
    """
    lying, hanging, mu, kept = 2.0, 1.5, 0.3, 0.5
    there, back = ((hanging - sign * mu * lying) * G / (lying + hanging) for sign in (1, -1))

    def motion(t: float) -> dict[str, float]:
        first = np.sqrt(2 / there)
        if t < first:
            return {"x": there * t * t / 2}
        t, speed = t - first, kept * there * first
        for _ in range(80):
            reach = speed**2 / 2 / back
            away, again = speed / back, np.sqrt(2 * reach / there)
            if t < away:
                return {"x": 1 - speed * t + back * t * t / 2}
            if t < away + again:
                return {"x": 1 - reach + there * (t - away) ** 2 / 2}
            t, speed = t - away - again, kept * there * again
        return {"x": 1.0}

    contacts: list[Scene] = [
        {"gap": "y", "friction": mu, "slides": "x'"}, {"gap": "1 - x", "restitution": kept}
    ]  # fmt: skip
    text = f"{(lying + hanging) / 2}*x'^2 + {lying / 2}*y'^2 - {lying * G}*y + {hanging * G}*x"
    return Case(scene(text, {"x": (0, 0), "y": (0, 0)}, contacts, 4), motion)


def two_pendulums() -> Case:
    """Equal ones exchange their speeds: together they are one pendulum."""
    one = solve_ivp(lambda t, s: [s[1], -G * np.sin(s[0])], (0, 5), [-0.8, 0], "DOP853", None, True,
                    rtol=1e-13, atol=1e-14)  # fmt: skip

    def motion(t: float) -> dict[str, float]:
        angle = float(one.sol(t)[0])
        return {"a": min(angle, 0.0), "b": max(angle, 0.0)}

    text = f"(a'^2 + b'^2)/2 + {G}*(cos(a) + cos(b))"
    contacts = [{"gap": "b - a", "restitution": 1}]
    return Case(scene(text, {"a": (-0.8, 0), "b": (0, 0)}, contacts, 5), motion)


def bouncing(
    scene_of_it: Scene, slope: Callable[[float, Array], Any], gap: Callable[[Array], Any],
    across: Callable[[Array], Any], restitution: float,
) -> Case:  # fmt: skip
    """A point of mass 1 that is reflected where the gap closes, with the slopes `across` of the
    gap.
    """
    names, initial = scene_of_it["system"]["coordinates"], scene_of_it["initial"]
    state: Any = [initial[key][name] for key in ("positions", "velocities") for name in names]
    n, begin, end, pieces = len(names), 0.0, scene_of_it["time"], []
    while begin < end:
        found = between(slope, state, (begin, end), lambda t, s: gap(s[:n]))
        pieces.append(found)
        begin, state = found.t[-1], found.y[:, -1]
        normal = np.array(across(state[:n]), dtype=float)
        normal /= np.linalg.norm(normal)
        away = -(1 + restitution) * (normal @ state[n:]) * normal
        state = np.concatenate([state[:n] + 1e-14 * normal, state[n:] + away])

    def motion(t: float) -> dict[str, float]:
        place = next(one for one in pieces if t <= one.t[-1] + 1e-9).sol(t)[:n]
        return dict(zip(names, map(float, place), strict=True))

    return Case(scene_of_it, motion)


def on_a_floor(
    gap: str, start: Start, restitution: float, time: float, closes: Any, across: Any
) -> Case:
    text = f"(x'^2 + y'^2)/2 - {G}*y"
    document = scene(text, start, [{"gap": gap, "restitution": restitution}], time)
    return bouncing(document, lambda t, s: [*s[2:], 0, -G], closes, across, restitution)


def at_a_wall() -> Case:
    """A driven oscillator that hits a wall."""
    document = scene("x'^2/2 - x^2/2", {"x": (0, 0)}, [{"gap": "1 - x", "restitution": 0.8}], 20,
                     forces={"x": "1.5*cos(1.7*t)"})  # fmt: skip
    return bouncing(
        document,
        lambda t, s: [s[1], 1.5 * np.cos(1.7 * t) - s[0]],
        lambda q: 1 - q[0],
        lambda q: [-1],
        0.8,
    )


def superball() -> Case:
    """R. L. Garwin, Am. J. Phys. 37 (1969) 88, of a ball that does not keep its sliding speed: the
    floor stops it.
    """
    inertia, speed, fall = 0.4, 3.0, np.sqrt(2 / G)
    push = -speed / (1 + 1 / inertia)

    def motion(t: float) -> dict[str, float]:
        later = max(0.0, t - fall)
        height = 2 - G * t * t / 2 if t < fall else 1 + G * fall * later - G * later**2 / 2
        return {"x": speed * t + push * later, "y": height, "h": -push / inertia * later}

    contacts = [{"gap": "y - 1", "restitution": 1, "friction": 5, "slides": "x' - h'"}]
    text = f"(x'^2 + y'^2 + {inertia}*h'^2)/2 - {G}*y"
    return Case(scene(text, {"x": (0, speed), "y": (2, 0), "h": (0, 0)}, contacts, 1.3), motion)


def two_disks() -> Case:
    """Of masses 1 and 2 and diameter 1, not in line."""
    across, masses = np.array([0.8, 0.6]), (1.0, 2.0)
    begin = (3 - 0.8) / 2
    pushed = 1.9 * 2 * across[0] / (1 / masses[0] + 1 / masses[1]) * across

    def motion(t: float) -> dict[str, float]:
        later = max(0.0, t - begin)
        (a, b), (c, d) = (-pushed / masses[0] * later, pushed / masses[1] * later)
        return {"a": 2 * t + a, "b": b, "c": 3 + c, "d": 0.6 + d}

    start: Start = {"a": (0, 2), "b": (0, 0), "c": (3, 0), "d": (0.6, 0)}
    contacts = [{"gap": "sqrt((a - c)^2 + (b - d)^2) - 1", "restitution": 0.9}]
    return Case(scene("(a'^2 + b'^2)/2 + c'^2 + d'^2", start, contacts, 3), motion)


def ladder() -> Case:
    """A ladder of length 2 that slips at its floor and at its wall."""
    mu, begin = 0.2, 1.0

    def slope(t: float, s: Array) -> list[float]:
        across, along = np.cos(s[0]), np.sin(s[0])
        pulls = [
            [1, 0, 0, mu, -1],
            [0, 1, 0, -1, -mu],
            [0, 0, 1 / 3, across - mu * along, -along - mu * across],
            [0, 1, -across, 0, 0],
            [1, 0, along, 0, 0],
        ]
        right = [0, -G, 0, -along * s[1] ** 2, -across * s[1] ** 2]
        return [s[1], float(np.linalg.solve(pulls, right)[2])]

    turned = between(slope, [begin, 0], (0, 0.45))
    contacts: list[Scene] = [
        {"gap": "y - sin(h)", "friction": mu, "slides": "x' - sin(h)*h'"},
        {"gap": "x - cos(h)", "friction": mu, "slides": "y' + cos(h)*h'"},
    ]
    start: Start = {"x": (np.cos(begin), 0), "y": (np.sin(begin), 0), "h": (begin, 0)}
    text = f"(x'^2 + y'^2 + h'^2/3)/2 - {G}*y"
    return Case(scene(text, start, contacts, 0.4), lambda t: {"h": float(turned.sol(t)[0])})


CASES: dict[str, Callable[[], Case]] = {
    "rocking block": rocking,
    "wheel at a step": at_a_step,
    "mass over an edge": over_an_edge,
    "two pendulums": two_pendulums,
    "parabola": lambda: on_a_floor(
        "y - x^2", {"x": (0.5, 0), "y": (2, 0)}, 1, 2.5, lambda q: q[1] - q[0] ** 2, lambda q: [-2 * q[0], 1]
    ),
    "waves": lambda: on_a_floor(
        "y - sin(3*x)/5", {"x": (0, 1), "y": (2, 0)}, 0.9, 2, lambda q: q[1] - np.sin(3 * q[0]) / 5,
        lambda q: [-0.6 * np.cos(3 * q[0]), 1],
    ),
    "oscillator": at_a_wall,
    "superball": superball,
    "two disks": two_disks,
    "ladder": ladder,
}  # fmt: skip


@pytest.mark.parametrize("name", [name if name == "two disks" else slow(name) for name in CASES])
def test_impacts_and_rests_of_textbooks(name: str) -> None:
    case = CASES[name]()
    found = run(case.scene)
    assert found["outcome"] == "completed"
    columns = found["points"]["columns"]
    times = found["points"].get("t") or columns["t"]
    worst = max(
        abs(columns[column][k] - value)
        for k, t in enumerate(times)
        for column, value in case.motion(t).items()
    )
    assert worst < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("turning", [-1.0, 0.0, 1.0])
@pytest.mark.parametrize("friction", [0.5, 1.0, 1.8, 3.0])
@pytest.mark.parametrize("way", [1, -1])
def test_a_rod_slides_on_its_tip_or_has_no_motion(
    way: int, friction: float, turning: float
) -> None:
    """P. Painleve, C. R. Acad. Sci. 121 (1895) 112: beyond some friction the force of the floor
    would have to pull, and the run ends by name.
    """
    begin = 1.0

    def force(h: float, turn: float) -> float:
        falls = G - np.sin(h) * turn**2 / 2
        return float(falls / (1 + 3 * np.cos(h) ** 2 + 3 * friction * way * np.sin(h) * np.cos(h)))

    def slope(t: float, s: Array) -> list[float]:
        normal = force(s[2], s[3])
        along = -friction * way * normal
        return [s[1], along, s[3], 6 * (along * np.sin(s[2]) - normal * np.cos(s[2]))]

    speed = 2 * way - np.sin(begin) * turning / 2
    contact = {"gap": "y - sin(h)/2", "friction": friction, "slides": "x' + sin(h)*h'/2"}
    start: Start = {
        "x": (0, speed),
        "y": (np.sin(begin) / 2, np.cos(begin) * turning / 2),
        "h": (begin, turning),
    }
    found = run(scene(f"(x'^2 + y'^2 + h'^2/12)/2 - {G}*y", start, [contact], 0.3))
    if force(begin, turning) < 0:
        assert found["outcome"] == "no_one_motion"
        return
    slid = between(
        slope,
        [0, speed, begin, turning],
        (0, 0.3),
        lambda t, s: way * (s[1] + np.sin(s[2]) * s[3] / 2),
    )
    assert found["outcome"] == "completed"
    columns = found["points"]["columns"]
    times = found["points"].get("t") or columns["t"]
    worst = max(
        np.abs(slid.sol(t)[[0, 2]] - [columns["x"][k], columns["h"][k]]).max()
        for k, t in enumerate(times)
        if t <= slid.t[-1]
    )
    assert worst < 1e-11
