"""`python -m paper --output DIR`: every statement of the paper computed again, as Markdown and HTML with figures."""

from __future__ import annotations

import argparse
import os
import platform
import sys
from pathlib import Path

from benchmarks.measured import commit
from inverse_service import __version__
from inverse_service.cli.command_line import ExitCode
from inverse_service.cli.simulate_command import made_folder
from paper.pages import counts, markdown, page, side_by_side
from paper.paper import FIGURES, sections


def write_paper(output: Path) -> ExitCode:
    """paper.md, records/paper.md, paper.html and paper/ (figures) in the directory; exit 1 if a statement differs."""
    folder = made_folder(made_folder(output) / FIGURES)
    found = sections(folder, lambda line: print(line, file=sys.stderr, flush=True))
    python = f"Python {platform.python_version()}"
    machine = f"Version {__version__}, {commit()}, {python}, {platform.machine()}, {os.cpu_count()} cores."
    records = made_folder(output / "records")
    (output / "paper.md").write_text(side_by_side(found), encoding="utf-8")
    (records / "paper.md").write_text(markdown(found, f"../{FIGURES}", machine), encoding="utf-8")
    (output / "paper.html").write_text(page(found, FIGURES, machine), encoding="utf-8")
    number = counts(found)
    print(", ".join(f"{count} {name}" for name, count in sorted(number.items())))
    print(
        f"Written to {output}: paper.md, records/paper.md, paper.html and {FIGURES}/",
        file=sys.stderr,
    )
    return ExitCode.OPEN if number["differs"] else ExitCode.DONE


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m paper", description=__doc__)
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("build/paper"),
        help="directory for the report and its figures",
    )
    sys.exit(write_paper(parser.parse_args().output))
