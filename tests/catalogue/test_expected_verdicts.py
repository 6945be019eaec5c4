"""The decision gives the verdicts that the catalogue expects, with and without t."""

from __future__ import annotations

import pytest

from inverse_service import catalogue
from inverse_service.inverse_problem.decision.deciding import decide
from inverse_service.mechanics.reading import read_system


def marked(name: str) -> object:
    """Five and six coordinates take a second and more each."""
    large = len(catalogue.document(name)["coordinates"]) > 4
    return pytest.param(name, marks=pytest.mark.slow) if large else name


@pytest.mark.parametrize("name", [marked(name) for name in catalogue.names()])
def test_the_decision_agrees_with_the_catalogue(name: str) -> None:
    document, expected = catalogue.document(name), catalogue.entry(name)["expected"]
    system = read_system(
        document["coordinates"], document["equations"], document.get("parameters", ()), document.get("functions")
    )
    assert decide(system, False).verdict == expected["verdict"]
    assert decide(system, True).verdict == expected["verdict_with_time"]
