"""The benchmark of the search counts what it says; nothing is timed here."""

from __future__ import annotations

import pytest

from benchmarks.lagrangians import Measured, by_ansatz, by_family, generated, main, measure, percentile
from tests.generator.shapes import SHAPES


def one(family: str, ansatz: str, seconds: float, closed: bool = True) -> Measured:
    return Measured("x", family, 2, "variational", ansatz, closed and bool(ansatz), seconds)


def test_shares_and_seconds_are_those_of_the_lagrangians_found() -> None:
    some = [
        one("a", "f", 1.0),
        one("a", "f", 3.0, closed=False),
        one("a", "", 9.0),
        one("a", "g", 2.0),
        one("b", "", 5.0),
    ]
    first, second, every = by_family(some)
    assert (first.family, first.systems, first.found, first.median, first.percentile) == ("a", 4, 0.75, 2.0, 3.0)
    assert first.closed_hamiltonians == pytest.approx(2 / 3)
    assert (second.found, second.median, second.percentile, second.closed_hamiltonians) == (0.0, None, None, None)
    assert (every.family, every.systems, every.found) == ("all", 5, 0.6)
    assert by_ansatz(some) == {"f": 2, "g": 1}


@pytest.mark.parametrize(("share", "expected"), [(0.5, 10), (0.95, 19), (0.951, 20), (1.0, 20), (0.01, 1)])
def test_a_percentile_is_the_smallest_number_that_the_share_does_not_pass(share: float, expected: float) -> None:
    assert percentile([float(k) for k in range(1, 21)], share) == expected


def test_disguised_systems_have_other_equations() -> None:
    plain, other = generated(2, 5, False), generated(2, 5, True)
    assert [system.family for system in plain] == [system.family for system in other]
    assert plain[0].equations != other[0].equations


def test_a_measurement_says_which_ansatz_found_the_lagrangian() -> None:
    found = measure(generated(1, 5, False)[0], 30.0)
    assert found.verdict == "variational"
    assert found.ansatz
    assert found.seconds > 0


def test_the_command_reports_tables(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--count", "1", "--seed", "5"])
    text = capsys.readouterr().out
    assert "| all | 1 | 100.0% |" in text
    assert "- none" in text


def test_the_less_usual_shapes_are_asked_for_and_begin_where_it_is_said() -> None:
    whole = generated(8, seed=3, disguised=False, shapes=True)
    assert {one.family for one in whole} == set(SHAPES)
    assert [one.id for one in generated(2, seed=3, disguised=False, shapes=True, start=6)] == [
        one.id for one in whole[6:]
    ]
