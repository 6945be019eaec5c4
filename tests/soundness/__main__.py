"""Run the soundness campaign: `python -m tests.soundness --output DIR`; exit code 1 if a verdict is
wrong. With the same seed and folder it resumes an earlier run.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.soundness.campaign import Line, done, run
from tests.soundness.report import markdown

# The number of cases of each kind, in the order in which they run.
COUNTS = {
    "random": 10_000,
    "generated": 10_000,
    "rewritten": 4_000,
    "corrupted": 1_000,
    "disguised": 1_000,
}


def options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.soundness", description=__doc__)
    for kind, count in COUNTS.items():
        parser.add_argument(
            f"--{kind}", type=int, default=count, help=f"cases of this kind (default {count})"
        )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=None, help="default: one for each core")
    parser.add_argument(
        "--so-far", action="store_true", help="run nothing: the page of what is there"
    )
    parser.add_argument(
        "--output", type=Path, default=Path("build/soundness"), help="folder of the outcomes"
    )
    parser.add_argument(
        "--report", type=Path, help="the page (default: soundness.md in the folder)"
    )
    return parser.parse_args(arguments)


def _outcomes(chosen: argparse.Namespace, counts: dict[str, int]) -> list[Line]:
    if chosen.so_far:
        return done(counts, chosen.seed, chosen.output)
    return run(counts, chosen.seed, chosen.output, chosen.processes)


def main(arguments: Sequence[str] | None = None) -> int:
    chosen = options(arguments)
    counts = {kind: getattr(chosen, kind) for kind in COUNTS}
    try:
        lines = _outcomes(chosen, counts)
    except KeyboardInterrupt:
        print("Stopped; the same command goes on from here.", file=sys.stderr)
        return 130
    given = " ".join(f"--{kind} {count}" for kind, count in counts.items())
    page = markdown(
        lines, counts, chosen.seed, f"python -m tests.soundness {given} --seed {chosen.seed}"
    )
    (chosen.report or chosen.output / "soundness.md").write_text(page, encoding="utf-8")
    wrong = sum(len(line["wrong"]) for line in lines)
    print(f"{len(lines)} cases, {wrong} wrong verdicts")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
