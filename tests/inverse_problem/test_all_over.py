"""Every Lagrangian and Hamiltonian that is shown holds all over its domain, not only near one point."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service import catalogue
from inverse_service.errors import InputError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_document
from tests.generator import random_systems
from tests.inverse_problem.all_over import assert_holds_all_over
from tests.systems.reading import known_systems


def held(document: dict[str, Any]) -> int:
    """How many points the answer to a document was tried at; none for what is no system of second order."""
    try:
        result = solve_document(document, SolveOptions(time_limit=900.0))
    except InputError:
        return 0
    return 0 if result.get("verdict") is None else assert_holds_all_over(result)


def test_some_generated_systems_hold_all_over() -> None:
    assert sum(held(system.document) for system in random_systems(5, seed=314)) > 16


@pytest.mark.nightly
def test_generated_systems_hold_all_over() -> None:
    assert sum(held(system.document) for system in random_systems(400, seed=315)) > 1000


@pytest.mark.nightly
@pytest.mark.parametrize("name", catalogue.names())
def test_the_catalogue_holds_all_over(name: str) -> None:
    held(catalogue.document(name))


@pytest.mark.nightly
@pytest.mark.parametrize("known", known_systems(), ids=lambda known: known.id)
def test_the_literature_holds_all_over(known: Any) -> None:
    held(known.document)
