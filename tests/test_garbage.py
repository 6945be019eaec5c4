"""A call of the package looks for cyclic garbage seldom, and leaves the process as it found it."""

import threading
from typing import Any

import pytest

from inverse_service import garbage
from inverse_service.decision.solutions import SolveOptions
from inverse_service.service.documents import documents

PYTHONS = (700, 10, 10)


class Kept:
    """Thresholds as the process has them; those of the tests are fixed."""

    def __init__(self, *values: int) -> None:
        self.values = values

    def get_threshold(self) -> tuple[int, ...]:
        return self.values

    def set_threshold(self, *values: int) -> None:
        self.values = values


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> Kept:
    found = Kept(*PYTHONS)
    monkeypatch.setattr(garbage, "gc", found)
    return found


def test_garbage_is_looked_for_seldom_within_and_as_before_after(kept: Kept) -> None:
    with garbage.seldom():
        assert kept.values == (garbage.BETWEEN_COLLECTIONS, 10, 10)
    assert kept.values == PYTHONS


def test_an_error_restores_it_too(kept: Kept) -> None:
    with pytest.raises(KeyError), garbage.seldom():
        raise KeyError
    assert kept.values == PYTHONS


@pytest.mark.parametrize("values", [(0, 10, 10), (2_000_000, 5, 5)])
def test_a_process_that_looks_more_seldom_is_left_alone(
    kept: Kept, values: tuple[int, ...]
) -> None:
    kept.values = values
    with garbage.seldom():
        assert kept.values == values
    assert kept.values == values


def test_the_last_thread_restores_what_was_before_the_first(kept: Kept) -> None:
    inside, leave = threading.Event(), threading.Event()

    def stay() -> None:
        with garbage.seldom():
            inside.set()
            leave.wait(10)

    other = threading.Thread(target=stay)
    with garbage.seldom():
        other.start()
        assert inside.wait(10)
    assert kept.values == (garbage.BETWEEN_COLLECTIONS, 10, 10)
    leave.set()
    other.join()
    assert kept.values == PYTHONS


def test_a_question_is_answered_so(kept: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    met = list[Any]()

    def noting(document: Any, _options: Any, _progress: Any) -> dict[str, Any]:
        met.append(kept.values)
        return {"document": document}

    monkeypatch.setattr(documents, "_solved", noting)
    documents.solve_document({"equations": "x'' = -x"}, SolveOptions())
    assert met == [(garbage.BETWEEN_COLLECTIONS, 10, 10)]
    assert kept.values == PYTHONS
