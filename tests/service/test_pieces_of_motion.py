"""Compare events that act, and switches of sign, abs, and pieces, with closed forms and SciPy."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import beta

from inverse_service.errors import InputError
from inverse_service.service.scenes.simulating import simulate
from tests.values import slow

EXACT = [
    "adaptive", slow({"method": "variational", "order": 8}), slow("reference"),
    slow({"method": "runge-kutta", "order": 8}),
]  # fmt: skip
FORCES = 9.81 * 0.3


def run(scene: dict[str, Any], method: Any = "adaptive") -> dict[str, Any]:
    (found,) = simulate(
        {"step": 0.01, "observe": ["trajectory", "velocities"], **scene, "methods": [method]}
    )["methods"]
    assert isinstance(found, dict)
    return found


def columns(found: dict[str, Any], *names: str) -> list[np.ndarray]:
    return [np.array(found["points"]["columns"][name], dtype=float) for name in ("t", *names)]


def system(lagrangian: str, *names: str, **parameters: float) -> dict[str, Any]:
    return {"system": {"coordinates": list(names), "lagrangian": lagrangian, "parameters": list(parameters)},
            "parameters": parameters}  # fmt: skip


def start(*values: float, names: str = "x") -> dict[str, Any]:
    half = len(values) // 2
    positions, velocities = (
        dict(zip(names, values[:half], strict=True)),
        dict(zip(names, values[half:], strict=True)),
    )
    return {"initial": {"positions": positions, "velocities": velocities}}


BALL = system("y'^2/2 - g*y", "y", g=9.81) | start(1, 0, names="y")
BOUNCE = {"when": "y", "direction": -1, "do": {"set": {"y'": "-0.8*y'"}}}


def ball(t: float) -> float:
    fall = np.sqrt(2 / 9.81)
    if t < fall:
        return float(1 - 9.81 * t * t / 2)
    begin, speed = fall, 9.81 * fall
    while True:
        speed *= 0.8
        if t < begin + 2 * speed / 9.81:
            return float(speed * (t - begin) - 9.81 * (t - begin) ** 2 / 2)
        begin += 2 * speed / 9.81


def block(t: float) -> float:
    return 2 * t - FORCES * t * t / 2 if t < 2 / FORCES else 2 / FORCES


def rubbed(t: float) -> float:
    """x'' = -4 x - sign(x')/2 from rest at 1: half turns about +-1/8 until it sticks."""
    place, begin = 1.0, 0.0
    while 4 * abs(place) > 0.5:
        middle = np.sign(place) / 8
        if t < begin + np.pi / 2:
            return float(middle + (place - middle) * np.cos(2 * (t - begin)))
        place, begin = 2 * middle - place, begin + np.pi / 2
    return float(place)


def roof(t: float) -> float:
    """x'' = -sign(x) from rest at 1."""
    quarter = np.sqrt(2)
    turn, rest = divmod(t / quarter, 2)
    fall = 1 - (rest * quarter) ** 2 / 2 if rest < 1 else -(1 - ((2 - rest) * quarter) ** 2 / 2)
    return float(fall if turn % 2 == 0 else -fall)


def two_springs(t: float) -> float:
    """x'' = -x for x > 0, -4 x for x < 0, from x' = 1 at 0."""
    rest = t % (1.5 * np.pi)
    return float(np.sin(rest) if rest < np.pi else -np.sin(2 * (rest - np.pi)) / 2)


def sawtooth(t: float) -> float:
    return t % 1


KNOWN: dict[str, tuple[dict[str, Any], str, Callable[[float], float]]] = {
    "a ball that bounces": (BALL | {"time": 3, "events": [BOUNCE]}, "y", ball),
    "a block that comes to rest": (
        system("x'^2/2", "x", f=FORCES) | start(0, 2) | {"forces": {"x": "-f*sign(x')"}, "time": 1}, "x", block,
    ),
    "an oscillator with dry friction": (
        system("x'^2/2 - 2*x^2", "x") | start(1, 0) | {"forces": {"x": "-sign(x')/2"}, "time": 10}, "x", rubbed,
    ),
    "a roof": (system("x'^2/2 - abs(x)", "x") | start(1, 0) | {"time": 10}, "x", roof),
    "two springs": (
        system("x'^2/2", "x") | start(0, 1)
        | {"forces": {"x": "piecewise((-x, x > 0), (-4*x, true))"}, "time": 10}, "x", two_springs,
    ),
    "a reset": (
        system("x'^2/2", "x") | start(0, 1) | {"time": 5.5, "events": [{"when": "x - 1", "do": {"set": {"x": "0"}}}]},
        "x", sawtooth,
    ),
}  # fmt: skip


@pytest.mark.parametrize("method", EXACT, ids=str)
@pytest.mark.parametrize("name", KNOWN)
def test_closed_forms_are_met(name: str, method: Any) -> None:
    scene, coordinate, closed = KNOWN[name]
    found = run(scene, method)
    assert found["outcome"] == "completed"
    assert "doubt" not in found
    t, x = columns(found, coordinate)
    # Where the position jumps, times within round-off of the jump may be on either side.
    near = np.abs((t - np.round(t)) * (name == "a reset") + (name != "a reset")) > 1e-9
    assert np.abs(x - [closed(time) for time in t])[near].max() < 1e-9


def test_switches_and_events_are_listed() -> None:
    found = run(KNOWN["an oscillator with dry friction"][0])
    assert found["switches"]["count"] == 4
    assert found["switches"]["columns"]["to"] == ["above", "below", "above", "sticks"]
    assert found["switches"]["columns"]["t"] == pytest.approx(
        np.pi / 2 * np.arange(1, 5), abs=1e-12
    )
    found = run(KNOWN["a ball that bounces"][0])
    assert found["events"][0]["count"] == 6
    first = np.sqrt(2 / 9.81)
    assert found["events"][0]["columns"]["t"][:2] == pytest.approx([first, first * 2.6], abs=1e-12)


@pytest.mark.slow
def test_a_ball_that_bounces_ever_faster_ends_by_name() -> None:
    found = run(BALL | {"time": 6, "events": [BOUNCE]})
    assert found["outcome"] == "zeno"
    assert found["stopped"]["time"] == pytest.approx(9 * np.sqrt(2 / 9.81), abs=1e-6)


def test_a_count_ends_the_run() -> None:
    found = run(BALL | {"time": 6, "events": [BOUNCE | {"count": 3}]})
    assert found["outcome"] == "completed"
    assert found["final"]["t"] == pytest.approx(np.sqrt(2 / 9.81) * (1 + 1.6 + 1.28), abs=1e-12)
    assert found["final"]["velocities"]["y"] == pytest.approx(np.sqrt(2 * 9.81) * 0.8**3, abs=1e-9)
    third = run(
        BALL
        | {"time": 6, "events": [BOUNCE, {"when": "y'", "direction": -1, "do": "stop", "count": 2}]}
    )
    assert third["final"]["t"] == pytest.approx(np.sqrt(2 / 9.81) * (1 + 1.6 + 0.64), abs=1e-12)


def oracle(
    f: Callable[[float, np.ndarray], Any], state: list[float], times: np.ndarray,
    hits: Callable[[float, np.ndarray], float], act: Callable[[float, np.ndarray], np.ndarray], direction: float,
) -> np.ndarray:  # fmt: skip
    """SciPy's DOP853 at 1e-12, restarted after each event."""
    hits.terminal, hits.direction = True, direction  # type: ignore[attr-defined]
    rows, begin, y = [], float(times[0]), np.array(state)
    while begin < times[-1]:
        wanted = times[times >= begin]
        done = solve_ivp(
            f, (begin, times[-1]), y, "DOP853", wanted, events=hits, rtol=3e-14, atol=1e-14
        )
        rows += list(done.y.T)
        if not len(done.t_events[0]):
            break
        begin = float(done.t_events[0][0])
        y = act(begin, done.y_events[0][0])
    return np.array(rows)


def test_a_ball_on_a_table_that_moves() -> None:
    hit = {
        "when": "y - sin(5*t)/10",
        "direction": -1,
        "do": {"set": {"y'": "0.95*cos(5*t) - 0.9*y'"}},
    }
    scene = system("y'^2/2 - 9.81*y", "y") | start(1, 0, names="y") | {"time": 4, "events": [hit]}
    t, y = columns(run(scene), "y")
    expected = oracle(
        lambda t, s: [s[1], -9.81], [1, 0], t, lambda t, s: s[0] - np.sin(5 * t) / 10,
        lambda t, s: np.array([s[0], np.cos(5 * t) / 2 - 0.9 * (s[1] - np.cos(5 * t) / 2)]), -1,
    )  # fmt: skip
    assert np.abs(y - expected[:, 0]).max() < 1e-9


def test_a_ball_with_drag_bounces_in_a_box() -> None:
    scene = system("(x'^2 + y'^2)/2 - y", "x", "y") | start(0.2, 1, 1, 0, names="xy") | {
        "forces": {"x": "-x'/10", "y": "-y'/10"}, "time": 3,
        "events": [{"when": "y", "direction": -1, "do": {"set": {"y'": "-0.9*y'", "x'": "0.95*x'"}}},
                   {"when": "x - 1", "direction": 1, "do": {"set": {"x'": "-x'"}}},
                   {"when": "x", "direction": -1, "do": {"set": {"x'": "-x'"}}}]}  # fmt: skip
    t, x, y = columns(run(scene), "x", "y")

    def walls(t: float, s: np.ndarray) -> float:
        return min(s[1], 1 - s[0], s[0])

    def bounce(t: float, s: np.ndarray) -> np.ndarray:
        low = s[1] < 1e-9
        return np.array([s[0], s[1], 0.95 * s[2] if low else -s[2], -0.9 * s[3] if low else s[3]])

    expected = oracle(
        lambda t, s: [s[2], s[3], -s[2] / 10, -1 - s[3] / 10], [0.2, 1, 1, 0], t, walls, bounce, -1
    )
    assert np.abs(x - expected[:, 0]).max() < 1e-8
    assert np.abs(y - expected[:, 1]).max() < 1e-8


@pytest.mark.slow
def test_a_kicked_rotor_is_the_standard_map() -> None:
    scene = system("x'^2/2", "x") | start(1, 0.5) | {
        "time": 20.5, "events": [{"when": "sin(pi*t)", "do": {"set": {"x'": "x' + 0.9*sin(x)"}}}]}  # fmt: skip
    t, x = columns(run(scene), "x")
    place, speed, expected = 1.0, 0.5, []
    for k in range(21):
        own = t[(t >= k) & (t < k + 1)]
        expected += list(place + speed * (own - k))
        place += speed
        speed += 0.9 * np.sin(place)
    assert np.abs(x - expected).max() < 1e-9


@pytest.mark.slow
def test_a_billiard_in_a_circle() -> None:
    """Each chord turns by the same angle."""
    mirror = {"x'": "x' - 2*x*(x*x' + y*y')", "y'": "y' - 2*y*(x*x' + y*y')"}
    scene = system("(x'^2 + y'^2)/2", "x", "y") | start(-0.6, -0.8, 0.8, 1.0, names="xy") | {
        "time": 30, "events": [{"when": "x^2 + y^2 - 1", "direction": 1, "do": {"set": mirror}}]}  # fmt: skip
    found = run(scene)["events"][0]["columns"]
    times, angles = np.array(found["t"]), np.unwrap(np.arctan2(found["y"], found["x"]))
    assert len(times) > 15
    assert np.ptp(np.diff(times)) < 1e-10
    assert np.ptp(np.diff(angles)) < 1e-10


def test_stick_and_slip_on_a_belt() -> None:
    """x'' = -x - m(u) with u = x' - 1/2 and m = sign(u)/(1 + |u|): sticks to the belt, slips,
    sticks again.
    """
    scene = system("x'^2/2 - x^2/2", "x") | start(0, 0.5) | {
        "forces": {"x": "-sign(x' - 1/2)/(1 + abs(x' - 1/2))"}, "time": 12}  # fmt: skip
    found = run(scene)
    assert found["outcome"] == "completed"
    t, x = columns(found, "x")

    # The belt carries it until x = 1; then u < 0 until u = 0 again, where it sticks because |x| <
    # 1.
    def caught(t: float, s: np.ndarray) -> float:
        return float(s[1] - 0.5)

    caught.terminal, caught.direction = True, 1  # type: ignore[attr-defined]
    slip = solve_ivp(
        lambda t, s: [s[1], -s[0] + 1 / (1.5 - s[1])], (2.0, 12), [1, 0.5 - 1e-13], "DOP853", t[t >= 2], rtol=3e-14,
        atol=1e-14, events=caught,
    )  # fmt: skip
    again = float(slip.t_events[0][0])
    rows = t < again
    expected = np.where(t < 2, t / 2, 0.0)
    expected[(t >= 2) & rows] = slip.y[0][: int(((t >= 2) & rows).sum())]
    assert found["switches"]["columns"]["to"][:2] == ["below", "sticks"]
    assert found["switches"]["columns"]["t"][:2] == pytest.approx([2, again], abs=1e-5)
    assert np.abs(x - expected)[rows].max() < 1e-5  # the oracle starts next to the point of release
    held = (t > again + 0.01) & (t < found["switches"]["columns"]["t"][2])
    assert np.diff(x[held]) == pytest.approx(0.005, abs=1e-10)


@pytest.mark.slow
def test_two_blocks_that_rub_at_once() -> None:
    """Both slide, one comes to rest first, is pulled along, and both rest in the end; SciPy's
    events give the times.
    """
    scene = system("(x'^2 + y'^2)/2 - (x - y)^2/2", "x", "y") | start(0, 1, 1.5, 0, names="xy") | {
        "forces": {"x": "-0.4*sign(x')", "y": "-0.2*sign(y')"}, "time": 12, "step": 0.02}  # fmt: skip
    found = run(scene)
    assert found["outcome"] == "completed"
    t, x, y, v, w = columns(found, "x", "y", "v_x", "v_y")
    assert found["switches"]["columns"]["to"][-1] == "sticks"
    assert abs(v[-1]) + abs(w[-1]) < 1e-12

    def smooth(t: float, s: np.ndarray, width: float) -> list[float]:
        pull = s[0] - s[1]
        return [s[2], s[3], -pull - 0.4 * np.tanh(s[2] / width), pull - 0.2 * np.tanh(s[3] / width)]

    apart = []
    for width in (1e-2, 1e-3):
        done = solve_ivp(
            smooth, (0, 12), [0, 1, 1.5, 0], "LSODA", t, args=(width,), rtol=1e-9, atol=1e-11
        )
        apart.append(max(np.abs(done.y[0] - x).max(), np.abs(done.y[1] - y).max()))
    # Steeper friction laws converge to it, in proportion to their width.
    assert apart[1] < 0.2 * apart[0]


@pytest.mark.parametrize("method", ["adaptive", slow("runge-kutta"), slow("variational")])
def test_drag_by_the_square_has_a_kink_only(method: str) -> None:
    scene = (
        system("x'^2/2 - x^2/2", "x") | start(1, 0) | {"forces": {"x": "-x'*abs(x')/2"}, "time": 10}
    )
    found = run(scene, method)
    t, x = columns(found, "x")
    done = solve_ivp(lambda t, s: [s[1], -s[0] - s[1] * abs(s[1]) / 2], (0, 10), [1, 0], "DOP853", t, rtol=1e-13,
                     atol=1e-14, max_step=0.01)  # fmt: skip
    assert np.abs(x - done.y[0]).max() < (1e-4 if method == "variational" else 1e-8)


def test_a_place_from_which_two_motions_go_ends_by_name() -> None:
    scene = {"system": {"coordinates": ["x"], "equations": {"x": "sign(x)"}}, "time": 1} | start(
        0, 0
    )
    found = run(scene)
    assert found["outcome"] == "singular"
    assert "several continuations" in found["stopped"]["quantity"]


@pytest.mark.slow
def test_errors_are_against_the_motion_with_its_events() -> None:
    found = run(
        BALL | {"time": 3, "events": [BOUNCE], "observe": ["error", "energy"]}, "stormer-verlet"
    )
    assert found["max_error"] < 1e-9
    assert found["max_energy_error"] is None
    assert "Events" in found["energy_note"]


@pytest.mark.parametrize(
    ("event", "pointer", "words"),
    [
        ({"set": {"z": "1"}}, "/events/0/do/set/z", "z"),
        ({"set": {"y*2": "1"}}, "/events/0/do/set/y*2", "sets coordinates and velocities"),
        ({"set": {"y'": "q"}}, "/events/0/do/set/y'", "q"),
        ({"set": {}}, "/events/0/do", ""),
        ("jump", "/events/0/do", ""),
    ],
)
def test_what_an_event_cannot_set_is_refused_at_its_place(
    event: Any, pointer: str, words: str
) -> None:
    with pytest.raises(InputError) as refused:
        simulate(
            BALL
            | {
                "step": 0.1,
                "steps": 3,
                "events": [{"when": "y", "do": event}],
                "methods": ["adaptive"],
            }
        )
    assert refused.value.pointer.startswith(pointer)
    assert words in refused.value.detail


def test_a_force_like_a_root_is_passed_where_it_is_zero() -> None:
    """x'' = -sign(x) sqrt|x| from rest at 1: x = 0 after B(2/3, 1/2)/sqrt(3), and after three times
    that.
    """
    scene = {
        "system": {"coordinates": ["x"], "equations": {"x": "-sign(x)*sqrt(abs(x))"}},
        "time": 6,
        "step": 0.02,
    }
    found = run(scene | start(1, 0) | {"events": [{"when": "x"}]})
    assert found["outcome"] == "completed"
    quarter = beta(2 / 3, 1 / 2) / np.sqrt(3)
    assert found["events"][0]["columns"]["t"] == pytest.approx([quarter, 3 * quarter], abs=1e-8)


def rubbing(masses: np.ndarray, forces: np.ndarray, friction: np.ndarray) -> np.ndarray:
    """a with M a = F - mu s from rest, s the sign of a where it moves, |s| <= 1 elsewhere: all ways
    are tried.
    """
    found = []
    for way in product((0, 1, -1), repeat=len(forces)):
        signs, moving = np.array(way), np.flatnonzero(way)
        a = np.zeros(len(forces))
        inner = masses[np.ix_(moving, moving)]
        a[moving] = np.linalg.solve(inner, (forces - friction * signs)[moving])
        held = np.abs(forces - masses @ a) <= friction + 1e-12
        if (held | (signs != 0)).all() and (signs * a >= 0).all():
            found.append(a)
    (only,) = found
    return only


def test_five_that_rub_at_once_go_where_friction_lets_them() -> None:
    """Coupled by their masses, with constant forces from rest: some move, others are held."""
    drawn = np.random.default_rng(4)
    root = drawn.uniform(-1, 1, (5, 5)).round(2)
    masses, forces = (
        root @ root.T + np.eye(5),
        drawn.uniform(-3, 3, 5).round(2),
    )
    friction = np.array([0.5, 2.5, 1.0, 2.0, 1.5])
    names = "abcde"
    kinetic = " + ".join(
        f"({float(masses[i, k])})*{names[i]}'*{names[k]}'/2" for i in range(5) for k in range(5)
    )
    pushes = " + ".join(f"({float(f)})*{x}" for x, f in zip(names, forces, strict=True))
    document = {
        "system": {"coordinates": [*names], "lagrangian": f"{kinetic} + {pushes}"},
        "forces": {x: f"-{mu}*sign({x}')" for x, mu in zip(names, friction, strict=True)},
        "initial": {"positions": dict.fromkeys(names, 0), "velocities": dict.fromkeys(names, 0)},
        "step": 0.1,
        "time": 1,
        "methods": ["adaptive"],
        "observe": ["trajectory"],
    }
    (found,) = simulate(document)["methods"]
    a = rubbing(masses, forces, friction)
    assert 0 < (a != 0).sum() < 5
    assert found["outcome"] == "completed"
    assert [*found["final"]["positions"].values()] == pytest.approx(a / 2, abs=1e-9)
