"""The checker stays one file that a sceptic reads in an evening."""

from __future__ import annotations

from pathlib import Path

from inverse_service.certificate import checker


def test_the_checker_has_at_most_nine_hundred_lines() -> None:
    lines = Path(checker.__file__).read_text(encoding="utf-8").splitlines()
    assert 0 < len(lines) <= 900
    assert max(map(len, lines)) <= 120
