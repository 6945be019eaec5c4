"""The benchmark of bounds changes what it says it changes, everywhere, and puts it back."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import bounds
from benchmarks.ablation import Run
from inverse_service import bounds as amounts
from inverse_service.expressions.tree import Symbol, multiply
from inverse_service.inverse_problem.search import rungs
from inverse_service.inverse_problem.search.families import Family
from inverse_service.inverse_problem.search.terms import TooManyTerms, terms_of


def terms_of_rows() -> set[int]:
    return {rung.terms for rung in rungs.RUNGS if isinstance(rung, Family)}


def test_a_bound_is_changed_wherever_it_is_met_and_put_back() -> None:
    product = multiply(*(Symbol(name) + 1 for name in "abc"))
    assert terms_of_rows() == {0, amounts.SMALL, amounts.LARGE}
    with bounds.changed("LARGE", 5):
        assert terms_of_rows() == {0, amounts.SMALL, 5}
    with bounds.changed("EXPANSION", 5), pytest.raises(TooManyTerms):
        terms_of(product)
    assert terms_of_rows() == {0, amounts.SMALL, amounts.LARGE}
    assert len(terms_of(product)) == 8


def test_every_bound_is_used() -> None:
    source = "\n".join(path.read_text(encoding="utf-8") for path in Path(amounts.__file__).parent.rglob("*.py"))
    assert [name for name in bounds.VALUES if f"bounds.{name}" not in source] == []


def run(name: str, text: str, seconds: float) -> Run:
    return Run(name, text, False, "", (), seconds)


def test_what_is_lost_found_and_written_otherwise_is_told() -> None:
    before = [run("a", "x'^2", 1.0), run("b", "", 1.0), run("c", "x'", 1.0), run("d", "y'", 1.0)]
    after = [run("a", "", 0.5), run("b", "y'^2", 0.5), run("c", "2*x'", 0.5), run("d", "y'", 0.5)]
    assert bounds.told(before, after) == "-1, +1, 1 otherwise; 0.50"
    assert bounds.told(before, before) == "same; 1.00"


def test_a_table_has_a_row_for_each_bound_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    told: list[str] = []
    bounds.main(["--generated", "1", "--limit", "5", "--only", "RATIO"], told.append)
    assert "1 systems" in told[0]
    assert "| RATIO | 1,000 | same; " in told[1]
    assert "RATIO | 1,000 | same; " in capsys.readouterr().err
