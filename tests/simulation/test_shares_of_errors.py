"""Which share of the range of a coordinate an error is."""

from __future__ import annotations

import numpy as np
import pytest

from inverse_service.simulation import accuracy

OFF = 0.125
PLAIN, ANGLE = np.array([False]), np.array([True])


def shares(span: float, turns: np.ndarray, off: float = OFF, part: float = 1.0) -> float:
    """The largest share of an error `off` on a way from 0 to `span`."""
    way = np.linspace(0, span, 9)[:, None]
    return float(accuracy.errors_of(way + off, way, turns, part)[1].max())


@pytest.mark.parametrize("span", [0.5, 3.0, 4.0, 6.0])
@pytest.mark.parametrize("turns", [PLAIN, ANGLE])
def test_within_a_turn_the_share_is_that_of_the_range(span: float, turns: np.ndarray) -> None:
    assert shares(span, turns) == pytest.approx(OFF / span)


def test_an_angle_that_goes_round_and_round_has_the_range_of_a_turn() -> None:
    assert shares(100.0, ANGLE) == pytest.approx(OFF / (2 * np.pi))
    assert shares(100.0, PLAIN) == pytest.approx(OFF / 100)


def test_what_differs_by_a_part_of_the_error_is_off_by_the_whole() -> None:
    assert shares(4.0, PLAIN, part=0.5) == pytest.approx(2 * OFF / 4)


def test_a_coordinate_that_hardly_moves_is_measured_by_the_widest() -> None:
    """Of (x, y) with the ranges 5 and 0, an error of y is a share of LEAST_RANGE of 5."""
    way = np.stack([np.linspace(0, 5, 9), np.zeros(9)], axis=1)
    _, found = accuracy.errors_of(way + OFF, way, np.array([False, False]))
    assert found[:, 0].max() == pytest.approx(OFF / 5)
    assert found[:, 1].max() == pytest.approx(OFF / (accuracy.LEAST_RANGE * 5))


def test_the_range_of_the_whole_way_counts_where_few_points_are_recorded() -> None:
    whole = np.linspace(-1, 1, 33)[:, None]
    few = np.zeros((3, 1))  # once a period
    _, found = accuracy.errors_of(few + OFF, few, PLAIN, 1.0, whole)
    assert found.max() == pytest.approx(OFF / 2)


def test_no_error_is_below_round_off() -> None:
    way = np.linspace(1e6, 1e6 + 1, 9)[:, None]
    errors, _ = accuracy.errors_of(way, way, PLAIN)
    assert errors.min() >= 1e6 * accuracy.ROUND_OFF
