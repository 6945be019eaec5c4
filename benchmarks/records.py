"""Measure the tables of docs/records/ again: `python -m benchmarks.records [PAGE ...] [--only TEXT]
[--list]`.

A table on a page lies between two comments, of which the first one is the command:

    <!-- run: python -m benchmarks --part size -->
    ...
    <!-- end of run -->

What the command prints (but for headings) is put there, below a line that names the command and
the conditions: commit, Python, cores, load. `--only` chooses the commands that contain
a text, `--list` prints them and runs none. A command that fails leaves its table as it is, and the
exit code is 1, as for a page that is named and has no command that was chosen.
"""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.measured import ROOT, conditions

PAGES = ROOT / "docs" / "records"
PLACE = re.compile(
    r"<!-- run: (?P<command>[^\n]*) -->\n(?P<text>.*?)<!-- end of run -->", re.DOTALL
)


def places(page: Path) -> Iterator[re.Match[str]]:
    """The places of a page in which a command has printed."""
    return PLACE.finditer(page.read_text(encoding="utf-8"))


def printed(command: str) -> str:
    """What a command prints, without headings and without what stands above the first of them: a
    page has its own.

    Raises subprocess.CalledProcessError if it fails, ValueError if it prints nothing else.
    """
    words = [sys.executable if word == "python" else word for word in shlex.split(command)]
    done = subprocess.run(words, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    body = done.stdout.split("\n## ", 1)
    lines = body[-1].splitlines()[len(body) - 1 :]
    text = "\n".join(line for line in lines if not line.startswith("#")).strip()
    if not text:
        raise ValueError(f"{command} prints nothing")
    return re.sub(r"\n{3,}", "\n\n", text)


def measured(page: Path, command: str) -> None:
    """Run one command and put what it prints into its place, or places."""
    text = f"`{command}`, {conditions()}\n\n{printed(command)}"
    new = f"<!-- run: {command} -->\n{text}\n<!-- end of run -->"
    old = page.read_text(encoding="utf-8")
    changed = PLACE.sub(lambda one: new if one["command"] == command else one[0], old)
    page.write_text(changed, encoding="utf-8")


def options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.records",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("pages", nargs="*", type=Path, help="pages (default: all of docs/records)")
    parser.add_argument("--only", default="", help="commands that contain this text")
    parser.add_argument("--list", action="store_true", help="print the commands, run none")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    chosen = options(arguments)
    failed = 0
    for page in chosen.pages or sorted(PAGES.glob("*.md")):
        commands = {place["command"]: None for place in places(page)}
        wanted = [command for command in commands if chosen.only in command]
        if chosen.pages and not wanted:
            failed = 1
            print(f"{page.name}: no command to run; see its text", file=sys.stderr, flush=True)
        for command in wanted:
            print(f"{page.name}: {command}", flush=True)
            if chosen.list:
                continue
            try:
                measured(page, command)
            except (subprocess.CalledProcessError, ValueError) as error:
                failed = 1
                print(f"{page.name} keeps its table: {error}", file=sys.stderr, flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(main())
