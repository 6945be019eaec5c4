"""Every line of docs/rest.md does what the page says."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

GUIDE = Path(__file__).parents[2] / "docs" / "rest.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PRINTED = "http://127.0.0.1:8000"


def programs() -> list[tuple[str, str, str]]:
    """Language, program and what it is said to print."""
    blocks = BLOCK.findall(GUIDE.read_text(encoding="utf-8"))
    following = [*blocks[1:], ("", "")]
    return [
        (language, program, output if kind == "output" else "")
        for (language, program), (kind, output) in zip(blocks, following, strict=True)
        if language in ("bash", "python")
    ]


def pattern(expected: str) -> re.Pattern[str]:
    """What is printed, with `...` for anything in a line, and for any lines where it is a line."""
    parts = [re.escape(line).replace(re.escape("..."), ".*") + "\n" for line in expected.splitlines()]
    return re.compile("".join("(?:.*\n)*?" if part == ".*\n" else part for part in parts))


def test_the_page_shows_both_ways_and_what_they_print() -> None:
    found = programs()
    assert sum(language == "bash" for language, _, _ in found) >= 6
    assert sum(language == "python" for language, _, _ in found) >= 2
    assert all(output for _, _, output in found)
    assert not pattern("a\n...\nb\n").fullmatch("a\nx\n")
    assert pattern("a\n...\nb c...\n").fullmatch("a\nx\ny\nb cd\n")


@pytest.mark.skipif(shutil.which("curl") is None or shutil.which("bash") is None, reason="curl and bash are needed")
def test_every_block_prints_what_the_page_says(service: str, tmp_path: Path) -> None:
    shell = []
    for number, (language, program, _) in enumerate(programs()):
        if language == "python":
            (tmp_path / f"{number}.py").write_text(program.replace(PRINTED, service), encoding="utf-8")
            program = f"{sys.executable} {number}.py\n"
        # One shell for all, as the variables of one block are used in the next.
        shell.append(f"{program.replace(PRINTED, service)}printf '\\x1e'\n")
    script = "set -euo pipefail\n" + "".join(shell)
    done = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    printed = done.stdout.split("\x1e")
    for (_, program, expected), output in zip(programs(), printed, strict=False):
        assert pattern(expected).fullmatch(output), f"{program}\nprinted\n{output}{done.stderr}"
    assert done.returncode == 0, done.stderr
    assert len(printed) == len(programs()) + 1
