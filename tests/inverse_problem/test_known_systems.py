"""Systems of the catalogue, solved from document to a result that the checker accepts.

That the decision agrees with the catalogue is in tests/catalogue; here the whole way is gone.
"""

from __future__ import annotations

import pytest

from inverse_service import catalogue
from inverse_service.inverse_problem.solutions import Answer, SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem

SAMPLE = (
    *("knife-edge-first", "knife-edge-second", "nonholonomic-particle-third", "vertically-rolling-disk-first"),
    *("generic-class-one-first", "extension", "extension-counterexample", "inclined-knife-edge-second"),
    *("sho", "painleve-i", "henon-heiles", "kepler-polar", "hill-lunar", "toda-3-particle", "damped-henon-heiles"),
    *("poynting-robertson", "douglas-iiib", "bryant-mo", "iiia-differential-obstruction-1", "lie-a3-8-sl2"),
    *("lie-a4-7", "y-times-vx-2", "uniform-drag-2d", "semi-separated-1", "time-dependent-coupling"),
)


def catalogue_system(name: str) -> SecondOrderSystem:
    found = catalogue.document(name)
    return read_system(
        found["coordinates"], found["equations"], found.get("parameters", ()), found.get("functions"), name
    )


def assert_proven(answer: Answer | None, verdict: str) -> None:
    assert answer is not None
    assert answer.verdict == verdict, answer.reason
    assert answer.checked == "valid"
    assert answer.certificate is not None
    assert answer.explanation


def assert_solved(name: str, time_limit: float = 60.0) -> None:
    system, expected = catalogue_system(name), catalogue.entry(name)["expected"]
    solution = solve(system, SolveOptions(time_limit=time_limit))
    if system.depends_on_time:
        assert solution.autonomous is None
    else:
        assert_proven(solution.autonomous, expected["verdict"])
    assert_proven(solution.with_time, expected["verdict_with_time"])


@pytest.mark.parametrize("name", SAMPLE)
def test_a_sample_of_the_catalogue_is_solved_and_checked(name: str) -> None:
    assert_solved(name)


@pytest.mark.nightly
@pytest.mark.parametrize("name", [name for name in catalogue.names() if name not in SAMPLE])
def test_the_rest_of_the_catalogue_is_solved_and_checked(name: str) -> None:
    assert_solved(name, time_limit=120.0)


def test_the_sample_holds_both_verdicts_both_ways_and_all_sizes() -> None:
    expected = [catalogue.entry(name)["expected"] for name in SAMPLE]
    pairs = {(found["verdict"], found["verdict_with_time"]) for found in expected}
    assert pairs == {
        ("variational", "variational"),
        ("not_variational", "not_variational"),
        ("not_variational", "variational"),
    }
    assert {len(catalogue.document(name)["coordinates"]) for name in SAMPLE} == {1, 2, 3, 4}
