"""The matching circle is the circle of the motion, and there is none if the motion is not
circular.
"""

from __future__ import annotations

import numpy as np
import pytest

from inverse_service.simulation import circles
from tests.values import present


def arc(center: tuple[float, float], radius: float, angles: np.ndarray) -> np.ndarray:
    return np.column_stack(
        [center[0] + radius * np.cos(angles), center[1] + radius * np.sin(angles)]
    )


@pytest.mark.parametrize(
    ("center", "radius"), [((0.0, 0.0), 1.0), ((1e3, -2.0), 0.5), ((-3.0, 4.0), 1e-4)]
)
def test_three_points_of_a_circle_give_it_back(center: tuple[float, float], radius: float) -> None:
    found = present(circles.least_squares_circle(arc(center, radius, np.array([0.1, 1.3, 4.0]))))
    assert found.radius == pytest.approx(radius, rel=1e-8)
    assert found.center == pytest.approx(center, abs=1e-8)


def test_all_points_of_an_arc_give_the_circle_back() -> None:
    found = present(circles.least_squares_circle(arc((5.0, -7.0), 2.5, np.linspace(0, 0.9, 40))))
    assert found.radius == pytest.approx(2.5, rel=1e-10)
    assert found.misfit < 1e-12


def test_the_fit_is_a_minimum_of_the_distances() -> None:
    angles = np.linspace(0, 2.5, 60)
    points = arc((1.0, 2.0), 1.0, angles) * (1 + 0.05 * np.sin(9 * angles))[:, None]
    found = present(circles.least_squares_circle(points))

    def misfit(center: tuple[float, float]) -> float:
        distances = np.hypot(*(points - np.array(center)).T)
        return float(np.sqrt(((distances - distances.mean()) ** 2).mean()))

    assert misfit(found.center) == pytest.approx(found.misfit, rel=1e-9)
    for dx, dy in [(1e-3, 0), (-1e-3, 0), (0, 1e-3), (0, -1e-3)]:
        assert misfit((found.center[0] + dx, found.center[1] + dy)) > found.misfit


@pytest.mark.parametrize("points", [
    np.zeros((0, 2)), np.zeros((1, 2)), np.ones((7, 2)), np.array([[0.0, 0.0], [1.0, 2.0]]),
    np.array([[0, 0], [1, 1], [2, 2.0]]), np.array([[0, 0], [0, 0], [1, 0.0]]), np.array([[0, 0], [1, np.nan], [2, 0]]),
    np.column_stack([np.arange(9.0), 3 * np.arange(9.0) + 1]), np.array([[0, 0], [1, 1], [np.inf, 2.0]]),
])  # fmt: skip
def test_too_few_points_and_lines_have_no_circle(points: np.ndarray) -> None:
    assert circles.least_squares_circle(points) is None
    assert circles.circle_drift(points) is None


def test_the_drift_of_a_steady_circle_is_nothing() -> None:
    drift = present(circles.circle_drift(arc((2.0, 1.0), 3.0, -0.1 * np.arange(400))))
    assert drift.revolutions == pytest.approx(39.8 / (2 * np.pi))
    assert drift.centre_drift < 1e-11
    assert drift.last.radius == pytest.approx(drift.first.radius, rel=1e-11)


def test_a_moving_center_and_a_growing_radius_are_distinguished() -> None:
    angles = 0.05 * np.arange(2001)
    growing = circles.circle_drift(arc((0, 0), 1, angles) * (1 + 0.001 * angles)[:, None])
    moving = circles.circle_drift(
        arc((0, 0), 1, angles) + np.column_stack([0.001 * angles, 0 * angles])
    )
    assert growing is not None
    assert moving is not None
    assert growing.last.radius - growing.first.radius == pytest.approx(
        0.001 * (100 - 2 * np.pi), rel=2e-2
    )
    assert growing.centre_drift < 2e-3
    assert moving.centre_drift == pytest.approx(0.001 * (100 - 2 * np.pi), rel=2e-2)
    assert moving.last.radius == pytest.approx(moving.first.radius, rel=1e-3)


def test_a_path_known_at_few_steps_has_its_circles_too() -> None:
    """Chords that turn by 10 radians do not resolve revolutions, but the points are still on the
    circle.
    """
    angles = 10.0 * np.arange(20_000)
    drift = present(
        circles.circle_drift(
            arc((0, 0), 2, angles) + np.column_stack([1e-6 * angles, 0 * angles]), 20.0
        )
    )
    assert np.isnan(drift.revolutions)
    assert drift.last.radius == pytest.approx(2, rel=1e-3)
    assert drift.centre_drift == pytest.approx(0.2, rel=0.02)
    short = present(circles.circle_drift(arc((0, 0), 2, angles[:10]), 20.0))
    assert short.first == short.last
    assert circles.circle_drift(np.zeros((500, 2)), 20.0) is None


def test_less_than_a_revolution_is_said() -> None:
    drift = present(circles.circle_drift(arc((0, 0), 1, np.linspace(0, 2, 30))))
    assert drift.revolutions < 1
    assert drift.first == drift.last


def test_the_turning_of_a_path_that_rests_is_nothing() -> None:
    assert (circles.turned(np.ones((5, 2))) == 0).all()
    resting = np.array([[0, 0], [0, 0], [1, 0], [1, 0], [1, 1.0]])
    assert circles.turned(resting) == pytest.approx([0, 0, 0, np.pi / 2])


def test_radial_distance_and_phase_are_what_was_put_in() -> None:
    angles = 0.2 * np.arange(100)
    exact, late = arc((0, 0), 2, angles), arc((1, 1), 2.2, 0.99 * angles)
    assert circles.radial_distance(late, circles.Circle((1, 1), 2.0)) == pytest.approx(0.1)
    error = circles.phase_error(late, exact)
    assert error[1:] == pytest.approx(-0.01 * (angles[1:] - 0.1), abs=1e-12)


@pytest.mark.parametrize("every", [1, 20, 41])
def test_a_spiral_in_step_has_no_phase_error(every: int) -> None:
    """This holds for any radius and center, and for any number of recorded points."""
    angles = 0.2 * np.arange(2000)[::every]
    exact = arc((0, 0), 2, angles)
    error = circles.phase_error(exact * 0.5 + np.array([7.0, 1.0]), exact)
    assert np.abs(error).max() < 1e-12


@pytest.mark.parametrize("count", [0, 1])
def test_no_chord_has_no_phase_error(count: int) -> None:
    assert (circles.phase_error(np.ones((count, 2)), np.ones((count, 2))) == 0).all()


@pytest.mark.parametrize("turn", [0.01, 0.3, 1.9])
def test_revolutions_are_counted_over_recorded_points_too(turn: float) -> None:
    angles = turn * np.arange(4000)
    spiral = arc((0, 0), 1, angles) * (1 - 1e-5 * angles)[:, None]
    found = present(circles.circle_drift(spiral, turn))
    assert found.revolutions == pytest.approx(angles[-1] / (2 * np.pi), rel=1e-2)
    assert found == circles.circle_drift(spiral)


def test_points_more_than_half_a_turn_apart_do_not_say_how_often_the_path_turned() -> None:
    angles = (2 * np.pi + 0.3) * np.arange(4000)
    points = arc((0, 0), 1, angles)
    found = present(circles.circle_drift(points, 2 * np.pi + 0.3))
    assert np.isnan(found.revolutions)
    assert found.first.radius == pytest.approx(1)
    # A speed that does not fit the chords is rejected.
    assert np.isnan(present(circles.circle_drift(points, 1.5)).revolutions)


@pytest.mark.parametrize("growth", [1.02, 0.98])
def test_a_spiral_has_the_change_of_its_radius(growth: float) -> None:
    """The radius of the last revolution over that of the first one, minus 1."""
    angles = np.linspace(0, 40 * np.pi, 4000)
    points = arc((0.0, 0.0), 1.0, angles) * (growth ** (angles / (2 * np.pi)))[:, None]
    found = circles.circle_numbers(points, None)["circle"]
    assert found["radius_change"] == pytest.approx(growth**19 - 1, rel=0.05)
    assert (found["radius_last"] > found["radius_first"]) is (growth > 1)
