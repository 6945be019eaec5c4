"""What a slow row of the corpus states, the default tests state too, of a smaller system."""

from __future__ import annotations

import pytest

from tests.conftest import COVERED, TESTS
from tests.doors.cousins import Statement, is_cousin, statement
from tests.doors.rows import Row, rows, systems

TABLES = ("ends", "motions", "integrals", "certificates")


def is_default(row: Row) -> bool:
    return not any(row.get(mark) for mark in ("slow", "nightly", "open"))


def alone(chosen: list[Row]) -> dict[str, Statement]:
    """The slow rows without a default cousin; a row may name one in another table."""
    said = {statement(row) for row in chosen if is_default(row)}
    every = [*chosen, *(row for table in TABLES for row in rows(table))]
    quick = {row["id"] for row in every if is_default(row)}
    return {
        row["id"]: own
        for row in chosen
        if not is_default(row) and row.get("cousin") not in quick
        for own in [statement(row)]
        if not any(is_cousin(one, own) for one in said)
    }


@pytest.mark.parametrize("table", ["systems", *TABLES])
def test_every_slow_row_has_a_quick_cousin(table: str) -> None:
    assert alone(systems() if table == "systems" else rows(table)) == {}


def test_every_test_with_covered_cases_exists_and_has_others() -> None:
    """That each case exists, and is not the last, is asserted where tests are collected."""
    assert COVERED
    for file, listed in COVERED.items():
        source = (TESTS / file).read_text(encoding="utf-8")
        assert [name for name in listed if f"def {name}(" not in source] == [], file
        assert all(len(cases) == len({*cases}) > 0 for cases in listed.values()), file


def test_a_slow_row_that_states_something_else_is_alone() -> None:
    """A row says so by its keys, the words among its values, and what its document asks."""
    base: Row = {"id": "a", "document": {"equations": {"x": "0"}}, "verdict": "variational"}
    others: list[Row] = [
        {"verdict": "not_variational"},
        {"found": ["hamiltonian"]},
        {"document": base["document"] | {"clock": True}},
        {"document": base["document"] | {"functions": {"F": ["x"]}}},
        {"cousin": "none of this name", "domain": ["x > 0"]},
    ]
    slow = [base | {"id": str(k), "slow": True} | other for k, other in enumerate(others)]
    assert [*alone([base, *slow])] == [*map(str, range(len(others)))]
    same = base | {"id": "b", "slow": True, "document": {"equations": {"x": "-7*x"}}}
    named = base | {"id": "c", "slow": True, "domain": ["x > 0"], "cousin": "a"}
    assert alone([base, same, named]) == {}
    assert alone([base | {"found": ["hamiltonian"]}, same]) == {}  # it states that and more
