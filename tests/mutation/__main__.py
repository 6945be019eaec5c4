"""Mutation testing of checker and decision: `python -m tests.mutation --sample N --output DIR`.

Survivors, the mutants that no test notices, are printed and written to survivors.md in the folder.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from tests.mutation.mutants import Mutant, mutants, mutated
from tests.mutation.trial import is_noticed, path_of, prepare

DECISION_TESTS = tuple(
    f"tests/inverse_problem/test_{name}.py"
    for name in ("safeguards_of_the_decision", "involution", "prolongation", "decision", "certify")
)
# Which tests answer for a module; quick ones first, for the first that fails ends the trial.
TESTS: dict[str, tuple[str, ...]] = {
    "inverse_service.certificate.checker": ("tests/certificate",),
    "inverse_service.inverse_problem.decision": DECISION_TESTS,
    "inverse_service.inverse_problem.involution": DECISION_TESTS,
    "inverse_service.inverse_problem.prolongation": DECISION_TESTS,
}


def options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("--module", choices=[name.split(".")[-1] for name in TESTS], action="append")
    parser.add_argument("--sample", type=int, help="so many mutants of each module (default all)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=int, default=60, help="processor seconds for the tests of one mutant")
    parser.add_argument("--output", type=Path, default=Path("build/mutation"))
    return parser.parse_args(arguments)


def chosen_mutants(module: str, sample: int | None, seed: int) -> tuple[int, list[Mutant]]:
    """How many there are, and those of the sample in a random order."""
    every = mutants(path_of(module).read_text(encoding="utf-8"))
    order = random.Random(f"{module}/{seed}").sample(every, len(every))
    return len(every), order[:sample]


def tried(module: str, asked: argparse.Namespace) -> list[str]:
    """The lines of the report on one module."""
    tests = TESTS[module]
    source = path_of(module).read_text(encoding="utf-8")
    if is_noticed(module, source, tests, 10 * asked.limit) != "survived":
        raise SystemExit(f"The tests of {module} fail without any mutant.")
    total, sample = chosen_mutants(module, asked.sample, asked.seed)
    ends: Counter[str] = Counter()
    survivors = []
    for mutant in sample:
        end = is_noticed(module, mutated(source, mutant), tests, asked.limit)
        ends[end] += 1
        if end == "survived":
            survivors.append(f"- line {mutant.line}: `{mutant.before}`: {mutant.rule}")
            print(module, survivors[-1], flush=True)
        print(f"{module} {ends.total()} of {len(sample)}: {dict(ends)}", file=sys.stderr, flush=True)
    head = f"{total} mutants, {len(sample)} tried: {ends['killed']} killed, {ends['stopped']} stopped by the limit"
    return [f"## {module}", "", f"{head}, {ends['survived']} survived.", "", *survivors, ""]


def main(arguments: Sequence[str] | None = None) -> None:
    asked, began = options(arguments), time.monotonic()
    prepare()
    lines = [line for module in TESTS if not asked.module or module.split(".")[-1] in asked.module
             for line in tried(module, asked)]  # fmt: skip
    asked.output.mkdir(parents=True, exist_ok=True)
    (asked.output / "survivors.md").write_text("\n".join(["# Mutants", "", *lines]), encoding="utf-8")
    print(f"{time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
