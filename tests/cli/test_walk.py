"""How many files of ours one question touches."""

from __future__ import annotations

import pytest

from benchmarks import walk

MOST_FILES = 90


@pytest.mark.slow
def test_a_question_with_one_coordinate_touches_few_files() -> None:
    """The first run may compile, for which it needs more; so the second one counts."""
    walk.files_of(walk.QUESTION)
    found, loaded = walk.files_of(walk.QUESTION)
    assert "inverse_service/certificate/checker.py" in found
    assert "inverse_service/simulation/running.py" not in found
    assert len(found) <= MOST_FILES, found
    assert loaded >= len(found)
