"""The jump of the velocities at one impact, by Newton's and Coulomb's laws, for any masses."""

from __future__ import annotations

import numpy as np
import pytest

from inverse_service.simulation import contacts

UP, ALONG = np.array([0.0, 1.0]), np.array([1.0, 0.0])
COUPLED = np.linalg.inv(np.array([[2.0, 0.3], [0.3, 1.0]]))  # M^-1
SLIDES = [-3.0, -0.05, 0.0, 0.05, 3.0]


def after(lift: np.ndarray, slides: float, bounce: float, friction: float) -> np.ndarray:
    """The velocity with which a body leaves that comes with (slides, -1)."""
    before = np.array([slides, -1.0])
    return before + contacts._impulse(lift, UP, ALONG, -1.0, slides, bounce, friction).change


@pytest.mark.parametrize("slides", SLIDES)
@pytest.mark.parametrize("bounce", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("lift", [np.eye(2), COUPLED], ids=["one mass", "coupled"])
def test_the_laws_hold_on_both_sides(lift: np.ndarray, bounce: float, slides: float) -> None:
    """|friction| <= mu N; what still slides has mu N against it; the gap opens with e times its
    velocity. Where the contact does not couple both directions, no energy is won; elsewhere
    Newton's law of impact may win some (Kane, Levinson 1985).
    """
    mu, before = 0.2, np.array([slides, -1.0])
    left = after(lift, slides, bounce, mu)
    impulse = np.linalg.solve(lift, left - before)
    assert left[1] == pytest.approx(bounce)
    assert abs(impulse[0]) <= mu * impulse[1] + 1e-12
    if abs(left[0]) > 1e-12:
        assert impulse[0] == pytest.approx(-np.sign(slides or left[0]) * mu * impulse[1])
    if lift[0, 1] == 0:
        assert left @ left <= before @ before + 1e-12


def test_a_slow_body_sticks_and_a_fast_one_is_slowed() -> None:
    """Mass 1, e = 1/2, mu = 1/5: the impulses are 3/2 and at most 3/10."""
    for slides, left in ((3.0, 2.7), (-3.0, -2.7), (0.2, 0.0), (-0.2, 0.0)):
        assert after(np.eye(2), slides, 0.5, 0.2) == pytest.approx([left, 0.5])


def test_a_mirror_image_has_the_mirrored_jump() -> None:
    mirror = np.diag([-1.0, 1.0])
    for slides in SLIDES:
        one = after(COUPLED, slides, 0.3, 0.1)
        other = after(mirror @ COUPLED @ mirror, -slides, 0.3, 0.1)
        assert other == pytest.approx(mirror @ one)


def test_without_friction_nothing_happens_along_the_contact() -> None:
    assert after(np.eye(2), 3.0, 0.5, 0.0) == pytest.approx([3.0, 0.5])
