"""The checker stays a folder that a sceptic reads in an evening."""

from __future__ import annotations

from pathlib import Path

from inverse_service.certificate import checker

FILES = sorted(Path(checker.__file__).parent.glob("*.py"))


def test_the_checker_has_at_most_thirteen_hundred_lines_of_code() -> None:
    lines = [line for path in FILES for line in path.read_text(encoding="utf-8").splitlines()]
    code = [line for line in lines if line.strip() and not line.strip().startswith("#")]
    assert 0 < len(code) <= 1300
    assert max(map(len, lines)) <= 120
