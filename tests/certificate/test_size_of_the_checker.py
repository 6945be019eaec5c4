"""The checker stays a folder that a sceptic reads in an evening, and each kind of Lagrangian one short file."""

from __future__ import annotations

import ast
from pathlib import Path

from inverse_service.certificate import checker

FILES = sorted(Path(checker.__file__).parent.glob("*.py"))


def lines_of_code(source: str) -> int:
    """Lines that hold more than a comment or a docstring."""
    plain = {number for number, line in enumerate(source.splitlines(), 1) if line.strip() and line.strip()[0] != "#"}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            plain -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(plain)


def test_the_checker_has_at_most_1806_lines_of_code() -> None:
    sources = [path.read_text(encoding="utf-8") for path in FILES]
    assert 0 < sum(map(lines_of_code, sources)) <= 1806
    assert max(len(line) for source in sources for line in source.splitlines()) <= 120


def test_a_kind_of_lagrangians_has_a_file_of_at_most_150_lines() -> None:
    folder = Path(checker.__file__).parents[1] / "inverse_problem"
    files = [path for room in ("kinds", "of_kind") for path in (folder / room).glob("*.py")]
    assert len(files) > 8
    assert {path.name: n for path in files if (n := lines_of_code(path.read_text(encoding="utf-8"))) > 150} == {}
