"""If the corpus says that there is no Lagrangian, conditions derived and evaluated by SymPy confirm
it.

Lagrangians prove a yes by themselves (tests/doors/test_systems.py); rows with `proof` are proved
here.
"""

from __future__ import annotations

import pytest

from tests.doors.rows import SYSTEMS, Row, rows
from tests.systems.prolonged import is_excluded
from tests.systems.reading import Formulas, formulas
from tests.systems.second_opinion import algebraic_conditions

ROWS = {
    row["id"]: row for row in rows(*SYSTEMS) if {"algebraic", "prolonged"} & {*row.get("proof", ())}
}
SAMPLE = (
    "suslov",
    "case-iia2-driven-by-x",
    "unequal-drag-linear",
    "latitude-sphere-wrong",
    "kepler-linear-drag",
)


def given_formulas(row: Row) -> Formulas:
    return formulas(row["document"], row.get("equations") or row["document"]["equations"])


def derivatives(row: Row) -> int:
    """The derivatives of Phi that can be computed in seconds."""
    document = row["document"]
    return {2: 3, 3: 2, 8: 3}.get(len(document.get("coordinates") or document["equations"]), 1)


def assert_proven(row: Row) -> None:
    given = given_formulas(row)
    if "algebraic" in row["proof"]:
        assert algebraic_conditions(given, derivatives(row))[1]
    elif row["verdict_with_time"] == "not_variational":
        assert is_excluded(given, 3, with_time=True)
    else:
        assert is_excluded(given, 2) or is_excluded(given, 3)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SAMPLE if name in ROWS])
def test_a_sample_has_no_lagrangian(name: str) -> None:
    assert_proven(ROWS[name])


@pytest.mark.nightly
@pytest.mark.parametrize("name", ROWS)
def test_none_has_a_lagrangian(name: str) -> None:
    assert_proven(ROWS[name])


@pytest.mark.slow
def test_the_second_opinion_can_say_yes() -> None:
    """Without this the tests above could not fail."""
    literature = {row["id"]: row for row in rows("literature")}
    kepler = given_formulas(literature["kepler-cartesian"])
    assert algebraic_conditions(kepler, 3) == (1, False)
    assert not is_excluded(kepler, 2)
    damped = given_formulas(literature["kepler-linear-drag"])
    assert is_excluded(damped, 2)
    assert not is_excluded(damped, 2, with_time=True)
    assert algebraic_conditions(damped, 3) == (1, False)
