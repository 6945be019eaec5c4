"""The exact motion follows the closed forms, recognized by structure; otherwise the reason is
given.
"""

from __future__ import annotations

import numpy as np
import pytest

from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.simulation.exact_motion import ExactMotion, motion_by_quadrature, positions_of
from inverse_service.simulation.scene_data import Problem, Unavailable

TIMES = np.linspace(0, 50, 401)


def known(
    coordinates: str, lagrangian: str, constraints: list[str], **values: float
) -> ExactMotion:
    names = Names(tuple(coordinates.split()), tuple(values))
    trees = tuple(read_formula(text, names) for text in constraints)
    return motion_by_quadrature(
        Problem(names.coordinates, (), read_formula(lagrangian, names), trees), values
    )


def motion(*arguments: object, **values: float) -> ExactMotion:
    return known(*arguments, **values)  # type: ignore[arg-type]


DISK = "M/2*(x'^2 + y'^2) + I/2*theta'^2 + J/2*phi'^2"
ROLLING = ["x' - R*cos(phi)*theta'", "y' - R*sin(phi)*theta'"]


def test_the_disk_runs_on_its_circle() -> None:
    found = motion("phi theta x y", DISK, ROLLING, M=3.0, I=0.5, J=0.25, R=2.0)
    start = np.array([0.3, 0.1, 1.0, -1.0])
    velocity = np.array([1.5, 0.5, np.cos(0.3), np.sin(0.3)])
    q, v = positions_of(found, start, velocity, TIMES)
    phi = 0.3 + 1.5 * TIMES
    radius = 2 * 0.5 / 1.5
    expected = [phi, 0.1 + 0.5 * TIMES, 1 + radius * (np.sin(phi) - np.sin(0.3)),
                -1 - radius * (np.cos(phi) - np.cos(0.3))]  # fmt: skip
    assert np.abs(q - np.column_stack(expected)).max() < 2e-14
    assert np.abs(v[:, 2] - np.cos(phi)).max() < 1e-14


def test_the_knife_edge_crosses_both_zeros_of_its_constraint() -> None:
    found = motion(
        "phi x y", "m/2*(x'^2 + y'^2) + J/2*phi'^2", ["x'*sin(phi) - y'*cos(phi)"], m=2.0, J=1.0
    )
    q, _ = positions_of(found, np.array([0.0, 0, 0]), np.array([-1.0, -0.7, 0]), TIMES)
    expected = [-TIMES, -0.7 * np.sin(TIMES), -0.7 * (np.cos(TIMES) - 1)]
    assert np.abs(q - np.column_stack(expected)).max() < 2e-14


@pytest.mark.parametrize("steps", [1, 7, 400])
def test_the_particle_passes_zero_at_any_times(steps: int) -> None:
    found = motion("x y z", "(x'^2 + y'^2 + z'^2)/2", ["z' + x*y'"])
    times = np.linspace(50 / steps, 50, steps)
    root = np.sqrt(2.0)
    q, _ = positions_of(found, np.array([-1.0, 0, 0]), np.array([0.25, 1.0, 1.0]), times)
    x = -1 + 0.25 * times
    y = root / 0.25 * (np.arcsinh(x) - np.arcsinh(-1))
    z = -root / 0.25 * (np.sqrt(1 + x**2) - root)
    assert np.abs(q - np.column_stack([x, y, z])).max() < 3e-13


def test_any_coefficients_of_the_class_are_integrated() -> None:
    """The velocity satisfies the constraints, conserves the energy, and is the derivative of the
    position.
    """
    found = motion("a b c", "a'^2 + 3*b'^2/2 + 5*c'^2/2", ["c' + (1 + a^2)*exp(-a)*b'"])
    a, b = 0.2, 1.0
    start = np.array([a, 0, 0])
    velocity = np.array([0.5, b, -(1 + a**2) * np.exp(-a) * b])
    q, v = positions_of(found, start, velocity, TIMES)
    A = (1 + q[:, 0] ** 2) * np.exp(-q[:, 0])
    energy = 1.5 * v[:, 1] ** 2 + 2.5 * v[:, 2] ** 2
    assert np.abs(v[:, 2] + A * v[:, 1]).max() < 1e-14
    assert energy == pytest.approx(energy[0], rel=1e-14)
    step = np.array([1e-3])
    later, earlier = (
        positions_of(found, start, velocity, 20 + sign * step)[0][0] for sign in (1, -1)
    )
    middle = positions_of(found, start, velocity, np.array([20.0]))[1][0]
    assert (later - earlier) / 2e-3 == pytest.approx(middle, rel=1e-6)


def test_free_motion_is_straight() -> None:
    found = motion("x", "x'^2/2", [])
    q, v = positions_of(found, np.array([1.0]), np.array([-2.0]), TIMES)
    assert (q[:, 0] == 1 - 2 * TIMES).all()
    assert (v == -2).all()


def test_a_turning_coordinate_at_rest_gives_a_straight_line() -> None:
    found = motion("phi theta x y", DISK, ROLLING, M=1.0, I=0.5, J=0.25, R=1.0)
    q, _ = positions_of(found, np.zeros(4), np.array([0, 2.0, 2.0, 0]), TIMES)
    assert np.abs(q - TIMES[:, None] * np.array([0, 2, 2, 0])).max() == 0


@pytest.mark.parametrize(("coordinates", "lagrangian", "constraints", "word"), [
    ("x", "x'^2/2 - x^2/2", [], "potential"),
    ("x y", "x'^2/2 + x^2*y'^2", [], "not constant"),
    ("x y z", "(x'^2 + y'^2 + z'^2)/2", ["z' - x*y'*y"], "more than one coordinate"),
    ("x y z", "(x'^2 + y'^2 + z'^2)/2", ["z' - x*x'"], "velocity of x"),
    ("x y z w", "(x'^2 + y'^2 + z'^2 + w'^2)/2", ["z' - x*y'"], "more than one direction"),
    ("x y z", "(x'^2 + y'^2 + z'^2)/2 + x'*y'/3", ["z' - x*y'"], "couples"),
    ("x y z", "(x'^2 + y'^2 + z'^2)/2", ["z' - x*y' + 1"], "homogeneous"),
    ("x y z", "(x'^2 + y'^2 + z'^2)/2", ["z' - t*y'"], "more than one coordinate"),
])  # fmt: skip
def test_other_systems_are_not_claimed(
    coordinates: str, lagrangian: str, constraints: list[str], word: str
) -> None:
    with pytest.raises(Unavailable, match=word):
        known(coordinates, lagrangian, constraints)


@pytest.mark.slow
@pytest.mark.parametrize("start", [0.0, -0.123456789, -7.0])
def test_constraints_that_lose_rank_on_the_way_are_refused(start: float) -> None:
    found = motion("x y z", "(x'^2 + y'^2 + z'^2)/2", ["x*z' - x*y'"])
    with pytest.raises(Unavailable, match="lose rank"):
        positions_of(found, np.array([start, 0, 0]), np.array([1.0, 1, 1]), TIMES)


def test_many_records_at_a_late_time_stay_exact() -> None:
    found = motion("phi x y", "(x'^2 + y'^2 + phi'^2)/2", ["x'*sin(phi) - y'*cos(phi)"])
    times = np.linspace(0.1, 1e4, 30_000)
    q, _ = positions_of(found, np.zeros(3), np.array([1.0, 1, 0]), times)
    assert np.abs(q[:, 1] - np.sin(times)).max() < 1e-11
