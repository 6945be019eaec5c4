"""Systems in other coordinates keep their closed form.

Rotations, polar coordinates, a shear and an exponential; the share is measured, not promised for each.
"""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from tests.generator import disguised, random_systems
from tests.inverse_problem.search.test_generated_lagrangians import (
    Solved,
    assert_euler_lagrange,
    assert_legendre,
    share_without,
    solved,
)


def missing(systems: Sequence[Solved]) -> list[str]:
    return [given.id for given, _, answer in systems if answer.lagrangian is None]


@pytest.mark.slow
def test_some_disguised_systems_keep_their_closed_form() -> None:
    families = ("velocity-ratio", "velocity-logarithm")
    systems = [solved(disguised(system, 1)) for system in random_systems(6, seed=33, families=families)]
    assert {answer.verdict for _, _, answer in systems} == {"variational"}
    assert share_without(systems)[0] <= 0.2, missing(systems)
    assert_euler_lagrange(systems)
    assert_legendre(systems)


@pytest.mark.slow
def test_four_of_five_among_a_hundred_keep_it() -> None:
    systems = [solved(disguised(system, 1)) for system in random_systems(100, seed=34)]
    # Where no closed form is found the checker may lack the time for the proof of existence, n = 4 above all.
    assert {answer.verdict for _, _, answer in systems} <= {"variational", "undetermined"}
    assert sum(answer.verdict == "undetermined" for _, _, answer in systems) <= 2
    assert share_without(systems)[0] <= 0.2, missing(systems)
    assert_euler_lagrange(systems)
    assert_legendre(systems)
