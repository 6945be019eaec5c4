"""The small wrong changes of a review, each with a default test that notices it:
`python -m tests.mutation.reviewed` makes each in turn, runs its test, and prints a table.

The changes stand in reviewed.toml. `old` occurs once in its file; where the code moved since the
review, it is the place that does the same now.
"""

from __future__ import annotations

import argparse
import ast
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.mutation.children import Job, answers
from tests.mutation.trial import KILLED, anew, path_of, prepare

STORED = Path(__file__).with_name("reviewed.toml")
SECONDS = 120.0  # of processor time: the test, and the package loaded again


@dataclass(frozen=True, slots=True)
class Reviewed:
    """A change of one text, and the test (file::name) that has to notice it."""

    change: str
    file: str
    old: str
    new: str
    test: str

    @property
    def module(self) -> str:
        return "inverse_service." + self.file.removesuffix(".py").replace("/", ".")

    def source(self) -> str:
        """The changed file. Raises ValueError unless the old text occurs once."""
        text = path_of(self.module).read_text(encoding="utf-8")
        if text.count(self.old) != 1:
            raise ValueError(f"{self.file}: {self.old!r} occurs {text.count(self.old)} times")
        return text.replace(self.old, self.new)


def reviewed() -> list[Reviewed]:
    """All changes, in the order of the review."""
    return [Reviewed(**row) for row in tomllib.loads(STORED.read_text(encoding="utf-8"))["changes"]]


def job(one: Reviewed) -> Job:
    """Work of a child: what its test says of the change."""
    return lambda: anew(one.module, ast.parse(one.source()), [f"tests/{one.test}"])


def main(arguments: Sequence[str] | None = None) -> None:
    """Print what each test says."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation.reviewed", description=__doc__)
    parser.add_argument("--only", default="", help="changes that contain this text")
    only = parser.parse_args(arguments).only
    prepare()
    chosen = [one for one in reviewed() if only in one.change]
    jobs: Iterator[tuple[int, Job, float]] = (
        (k, job(one), SECONDS) for k, one in enumerate(chosen)
    )
    said = dict(answers(jobs, 1))
    print("| Change | File | Noticed by |\n|---|---|---|")
    for k, one in enumerate(chosen):
        end = f"`{one.test}`" if said[k].startswith(KILLED) else f"**no**: {said[k]}"
        print(f"| {one.change} | `{one.file}` | {end} |", flush=True)
    print(f"\n{sum(each.startswith(KILLED) for each in said.values())} of {len(chosen)} noticed.")


if __name__ == "__main__":
    main()
