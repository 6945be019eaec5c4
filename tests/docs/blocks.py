"""Fenced blocks of the pages, and how the tests run those that are programs. The first word after
the fence is the language. `output` is the output of the previous program, with `...` for any text
within a line and, alone on a line, for any lines. A second word may follow: for `json` and `yaml`
the name of the file to write; for a program `slow` (not in the default tests) or `not-run`.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *ROOT.glob("docs/**/*.md"),
                ROOT / "paper/paper.md", *ROOT.glob("inverse_service/certificate/*.md")])  # fmt: skip
PROGRAMS = ("sh", "bash", "python", "javascript", "julia")
DOCUMENTS = ("json", "yaml")
# Languages that begin with a brace are only for the site (`make docs`).
LANGUAGES = (*PROGRAMS, *DOCUMENTS, "output", "text", "diff", "toml", "{toctree}", "{eval-rst}")
MARKS = ("slow", "not-run")
# The address in the pages; tests replace it with their own.
ADDRESS = "http://127.0.0.1:8000"
FENCE = re.compile(r"^```(.*)\n((?:.*\n)*?)```$", re.MULTILINE)
END = "\x1e"


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block; `line` is the line of its fence."""

    page: Path
    line: int
    language: str
    mark: str
    text: str

    @property
    def is_program(self) -> bool:
        return self.language in PROGRAMS

    @property
    def place(self) -> str:
        return f"{name(self.page)}:{self.line}"


def name(page: Path) -> str:
    """The name of the page in tests: its path in the repository."""
    return page.relative_to(ROOT).as_posix()


@cache
def blocks(page: Path) -> tuple[Block, ...]:
    """All fenced blocks of a page in order."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in FENCE.finditer(text):
        language, _, mark = match[1].strip().partition(" ")
        found.append(Block(page, text.count("\n", 0, match.start()) + 1, language, mark, match[2]))
    return tuple(found)


def programs(page: Path, with_slow: bool) -> list[tuple[Block, str | None]]:
    """The programs to run, each with its expected output, or None if the page shows none."""
    own = blocks(page)
    left_out = {"not-run"} if with_slow else set(MARKS)
    missing = {"julia", *(() if shutil.which("node") else ("javascript",))}
    return [
        (block, after.text if after is not None and after.language == "output" else None)
        for block, after in zip(own, [*own, None][1:], strict=True)
        if block.is_program and block.mark not in left_out and block.language not in missing
    ]


def pattern(expected: str) -> re.Pattern[str]:
    """A pattern for the expected output: `...` matches any text in a line, and any lines if it is a
    whole line.
    """
    parts = [
        "(?:.*\n)*?"
        if line.strip() == "..."
        else re.escape(line).replace(re.escape("..."), ".*") + "\n"
        for line in expected.splitlines()
    ]
    return re.compile("".join(parts))


def run_page(page: Path, folder: Path, address: str, with_slow: bool) -> list[str]:
    """Run the programs of a page in one shell; return a sentence for each that does not behave as
    the page says.
    """
    chosen = programs(page, with_slow)
    prepare(page, folder)
    script = "set -euo pipefail\n" + "".join(command(block, folder, address) for block, _ in chosen)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path}
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=3_600 if with_slow else 600,  # that nothing hangs; a busy machine is late
        env=environment,
    )
    printed = done.stdout.split(END)
    faults = [
        f"{block.place} printed\n{output}"
        for (block, expected), output in zip(chosen, printed, strict=False)
        if expected is not None and not pattern(expected).fullmatch(output)
    ]
    if done.returncode != 0 or len(printed) != len(chosen) + 1:
        last = chosen[min(len(printed), len(chosen)) - 1][0]
        faults.append(f"{last.place} ended with {done.returncode}: {done.stderr}")
    return faults


def prepare(page: Path, folder: Path) -> None:
    """Prepare the folder of a reader: docs and sources, and the files that the page defines."""
    for name in ("docs", "inverse_service"):
        (folder / name).symlink_to(ROOT / name)
    for block in blocks(page):
        if block.language in DOCUMENTS and block.mark:
            (folder / block.mark).write_text(block.text, encoding="utf-8")


def command(block: Block, folder: Path, address: str) -> str:
    """The block as shell lines that end by printing a separator."""
    text = block.text.replace(ADDRESS, address).replace(".venv/bin/", "")
    if interpreter := {"python": ("python", "py"), "javascript": ("node", "mjs")}.get(
        block.language
    ):
        name = f"line{block.line}.{interpreter[1]}"
        (folder / name).write_text(text, encoding="utf-8")
        text = f"{interpreter[0]} {name}\n"
    # One shell for all, because later blocks use the variables of earlier ones.
    return f"{text}printf '\\x1e'\n"
