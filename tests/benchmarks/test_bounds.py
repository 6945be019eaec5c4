"""The benchmark of bounds changes what it says it changes, everywhere, and puts it back."""

from __future__ import annotations

import pytest

from benchmarks import bounds
from benchmarks.ablation import Run
from inverse_service.inverse_problem.search import linear_ansatz, null_vectors


def test_a_bound_is_changed_where_it_is_written_and_where_it_is_imported() -> None:
    (spare,) = (one for one in bounds.bounds() if one.place == "null_vectors.SPARE")
    assert spare.value == linear_ansatz.SPARE == 12
    with bounds.changed(spare, 5):
        assert (null_vectors.SPARE, linear_ansatz.SPARE) == (5, 5)
    assert (null_vectors.SPARE, linear_ansatz.SPARE) == (12, 12)


def test_every_bound_is_an_integer_that_is_named_once() -> None:
    places = [one.place for one in bounds.bounds()]
    assert len(places) > 50
    assert len(set(places)) == len(places)
    assert "families.SPARE" not in places


def run(name: str, text: str, seconds: float) -> Run:
    return Run(name, text, False, "", (), seconds)


def test_what_is_lost_found_and_written_otherwise_is_told() -> None:
    before = [run("a", "x'^2", 1.0), run("b", "", 1.0), run("c", "x'", 1.0), run("d", "y'", 1.0)]
    after = [run("a", "", 0.5), run("b", "y'^2", 0.5), run("c", "2*x'", 0.5), run("d", "y'", 0.5)]
    assert bounds.told(before, after) == "-1, +1, 1 otherwise; 0.50"
    assert bounds.told(before, before) == "same; 1.00"


def test_a_table_has_a_row_for_each_bound_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    told: list[str] = []
    bounds.main(["--generated", "1", "--limit", "5", "--only", "null_vectors.SPARE"], told.append)
    assert "1 systems" in told[0]
    assert "| null_vectors.SPARE | 12 | same; " in told[1]
    assert "null_vectors.SPARE | 12 | same; " in capsys.readouterr().err
