"""A multiplier without velocities is excluded exactly where there is none."""

from __future__ import annotations

import pytest

from inverse_service.inverse_problem.decision.analysis import analyse
from inverse_service.inverse_problem.search.families import possible_shapes
from inverse_service.inverse_problem.search.material import gather
from inverse_service.inverse_problem.search.shapes import quadratic
from inverse_service.mechanics.reading import read_system
from tests.generator import random_systems

POSSIBLE = [
    ({"x": "0"}, False),
    ({"x": "0", "y": "0", "z": "0"}, False),
    ({"x": "-sin(x)"}, False),
    ({"theta": "sin(theta)*cos(theta)*phi'^2", "phi": "-2*cos(theta)/sin(theta)*theta'*phi'"}, False),
    ({"x": "-x - x'"}, True),
    ({"x": "y'/sqrt(1 + x^2)", "y": "-x'/sqrt(1 + x^2)"}, False),
]
EXCLUDED = [
    ({"x": "-x - x'"}, False),
    ({"x": "-x*(1 - x'^2)^(3/2)"}, False),
    ({"x": "-x*exp(x')"}, False),
    ({"w": "0", "x": "-w'*y'", "y": "w'*x'"}, False),
    ({"x": "x'^2*y'", "y": "2*y' + 2*x'^2*y'"}, True),
]


def possible(equations: dict[str, str], with_time: bool, seed: int = 1) -> bool:
    system = read_system(list(equations), equations)
    given = gather(analyse(system), with_time)
    return bool(possible_shapes(given, quadratic(given), seed))


@pytest.mark.parametrize(("equations", "with_time"), POSSIBLE)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_system_with_a_quadratic_lagrangian_is_never_excluded(
    equations: dict[str, str], with_time: bool, seed: int
) -> None:
    assert possible(equations, with_time, seed)


@pytest.mark.parametrize("family", ["natural", "metric", "magnetic"])
def test_generated_quadratic_lagrangians_are_never_excluded(family: str) -> None:
    for given in random_systems(8, seed=5, families=(family,)):
        assert possible(dict(given.equations), given.time_dependent), given.id


@pytest.mark.parametrize(("equations", "with_time"), EXCLUDED)
def test_a_system_without_one_is_excluded(equations: dict[str, str], with_time: bool) -> None:
    assert not possible(equations, with_time)
